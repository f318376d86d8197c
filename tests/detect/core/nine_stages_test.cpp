// SPDX-License-Identifier: MIT
// The nine stages and their arrays, on each backend.
#include "detect/core/nine_stages.h"

#include <map>

#include "detect/scene/generate.h"
#include "tests/detect/oracle.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

class StagesTest : public BackendTest {
 protected:
  StagesTest() { options_.path = Path::nine_stages; }
};

// The figures of section 2.1, as far as the text gives them: bins A1 to A5 and B1 to B5 of edge 1 (columns 1
// to 5 along x, row A at y 0 to 1, row B at 1 to 2, one layer in z). Object k of the figures is sphere k - 1.
TestScene worked_example() {
  return {{{0.3, 1.5, 0.5, 0.2},    // 1: B1
           {2.0, 0.4, 0.5, 0.2},    // 2: A2 A3
           {1.0, 1.0, 0.5, 0.3},    // 3: A1 A2 B1 B2
           {4.0, 1.0, 0.5, 0.3},    // 4: A4 A5 B4 B5: four bins, its two bounding points in B4 and A5
           {2.4, 0.7, 0.5, 0.2},    // 5: A3
           {2.5, 1.5, 0.5, 0.2},    // 6: B3
           {3.5, 0.35, 0.5, 0.6}},  // 7: A3 A4 A5, and the layers around them
          {},
          {}};
}

TEST_P(StagesTest, WorkedExampleOfThePaper) {
  const Arranged a(worked_example(), Scalar::f64);
  options_.bin_size = 1;
  Detector d(device_, options_);
  const Arrays s = d.stages(a.input);
  EXPECT_EQ(s.T, (std::vector<std::uint64_t>{1, 2, 4, 4, 1, 1, 18}));
  EXPECT_EQ(s.S, (std::vector<std::uint64_t>{1, 3, 7, 11, 12, 13, 31}));
  ASSERT_EQ(s.B.size(), 31u);

  const auto name = [&](std::uint64_t bin) -> std::string {
    const auto x = static_cast<std::int64_t>(bin % s.grid.side[0]) + s.grid.first[0];
    const auto y = static_cast<std::int64_t>(bin / s.grid.side[0] % s.grid.side[1]) + s.grid.first[1];
    const auto z = static_cast<std::int64_t>(bin / s.grid.side[0] / s.grid.side[1]) + s.grid.first[2];
    if (z != 0 || y < 0 || y > 1) return "";
    return (y == 0 ? "A" : "B") + std::to_string(x + 1);
  };
  std::map<std::string, std::vector<int>> lists;
  for (const BinEntry& e : s.B_sorted)
    if (!name(e.bin).empty()) lists[name(e.bin)].push_back(static_cast<int>(e.object) + 1);
  const std::map<std::string, std::vector<int>> figure14{
      {"A1", {3}},    {"A2", {2, 3}}, {"A3", {2, 5, 7}}, {"A4", {4, 7}}, {"A5", {4, 7}},
      {"B1", {1, 3}}, {"B2", {3}},    {"B3", {6}},       {"B4", {4}},    {"B5", {4}}};
  EXPECT_EQ(lists, figure14);
  for (std::size_t k = 1; k < s.B_sorted.size(); k++) EXPECT_LE(s.B_sorted[k - 1].bin, s.B_sorted[k].bin);

  // Stages 5 and 6: a bin that fewer than two objects touch is inactive and goes to the end.
  ASSERT_EQ(s.C.size(), s.C_sorted.size());
  EXPECT_EQ(s.active, 5u);
  std::vector<std::string> active;
  for (std::uint64_t k = 0; k < s.active; k++) active.push_back(name(s.C_sorted[k].bin));
  EXPECT_EQ(active, (std::vector<std::string>{"A2", "A3", "A4", "A5", "B1"}));
  for (std::uint64_t k = 0; k < s.C_sorted.size(); k++)
    EXPECT_EQ(s.C_sorted[k].start == kInactive, k >= s.active);
  for (std::uint64_t k = 0; k < s.active; k++)
    EXPECT_EQ(s.B_sorted[s.C_sorted[k].start].bin, s.C_sorted[k].bin);

  // Stage 7: objects 4 and 7 share A4 and A5; the midpoint of their collision volume lies in A4.
  EXPECT_EQ(s.D, (std::vector<std::uint64_t>{0, 0, 1, 0, 0}));
  EXPECT_EQ(s.E, (std::vector<std::uint64_t>{0, 0, 1, 1, 1}));
  ASSERT_EQ(s.F.size(), 1u);
  EXPECT_EQ(s.F[0], (Pair{3, 6}));
}

TEST_P(StagesTest, ArraysAgreeWithEachOther) {
  TestScene scene = random_scene(400, 3, 0.2, 55);
  for (std::size_t k = 0; k < scene.spheres.size(); k++)
    scene.family.push_back(static_cast<std::uint32_t>(k % 5)), scene.mask.push_back(k % 7 ? 0 : 2);
  const Arranged a(scene, Scalar::f64);
  Detector d(device_, options_);
  const Arrays s = d.stages(a.input);
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < s.T.size(); k++) EXPECT_EQ(s.S[k], sum += s.T[k]);
  EXPECT_EQ(s.B.size(), sum);
  for (std::size_t i = 0; i < s.T.size(); i++)
    for (std::uint64_t k = i ? s.S[i - 1] : 0; k < s.S[i]; k++) EXPECT_EQ(s.B[k].object, i);
  ASSERT_EQ(s.D.size(), s.active);
  for (std::size_t k = 0; k < s.D.size(); k++) EXPECT_EQ(s.E[k], s.D[k] + (k ? s.E[k - 1] : 0));
  EXPECT_EQ(s.F.size(), s.E.back()) << "stage 9 writes what stage 7 counted, filter and all";
  EXPECT_EQ(sorted(s.F), brute_force(scene));
}

TEST_P(StagesTest, BinsAreTwiceTheLargestRadiusAndASphereTouchesEight) {
  const std::vector<FloatSphere> f = generate("dense", 2000);
  Detector d(device_, options_);
  const Arrays s = d.stages(input_of(f));
  EXPECT_NEAR(s.grid.size, 2, 1e-5);
  for (const std::uint64_t t : s.T) EXPECT_LE(t, 8u);
}

TEST_P(StagesTest, WideRatiosTakeTheMean) {
  TestScene scene = random_scene(1000, 1, 2, 1);
  scene.spheres[0].r = 20;
  const Arranged a(scene, Scalar::f64);
  Detector d(device_, options_);
  EXPECT_LT(d.stages(a.input).grid.size, 10);
}

TEST_P(StagesTest, NoSpheresAndOne) {
  Detector d(device_, options_);
  EXPECT_TRUE(d.stages({}).B.empty());
  const Arranged a({{{1, 2, 3, 4}}, {}, {}}, Scalar::f64);
  const Arrays s = d.stages(a.input);
  EXPECT_EQ(s.active, 0u);
  EXPECT_TRUE(s.F.empty());
}

// More bins than fit in memory, or even in 2^63 numbers: they wrap.
TEST_P(StagesTest, SparseBinsWrap) {
  TestScene scene = random_scene(300, 1, 0.3, 4);
  for (int k = 0; k < 50; k++) scene.spheres.push_back({1e9 * k, 1e11 * (k % 5), -1e12, 1});
  for (int k = 0; k < 50; k++) scene.spheres.push_back({1e9 * k + 1, 1e11 * (k % 5), -1e12, 1});
  const Arranged a(scene, Scalar::f64);
  Detector d(device_, options_);
  EXPECT_EQ(sorted(d.stages(a.input).F), brute_force(scene));
}

TEST_P(StagesTest, BinsTooSmallAreRefused) {
  const Arranged a(random_scene(100, 1, 1, 1), Scalar::f64);
  options_.bin_size = 1e-5;
  Detector d(device_, options_);
  EXPECT_THROW(d.stages(a.input), Error);
}

TEST_P(StagesTest, AnArrayBThatIsTooLargeAsksForLargerBins) {
  const Arranged a(random_scene(100, 2, 0.5, 7), Scalar::f64);
  options_.bin_size = 0.01, options_.memory_limit = 1u << 20;
  Detector d(device_, options_);
  EXPECT_TRUE(refuses([&] { d.detect(a.input); },
                      "array B, but CallOptions::memory_limit is 1048576: raise it, choose larger bins"));
}

ON_EVERY_BACKEND(StagesTest);

}  // namespace
}  // namespace padder::detect
