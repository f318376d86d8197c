// SPDX-License-Identifier: MIT
// The reference scenes: their contacts are numbers that compare with other work, and their hashes are pinned.
#include "detect/scene/generate.h"

#include <cstring>
#include <tuple>

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

struct Found {
  std::uint64_t count, hash;
};

Found found(const std::vector<FloatSphere>& f, const DeviceChoice& device, const CallOptions& options,
            bool in_double) {
  const std::vector<Sphere> wide = in_double_of(f);
  Detector detector(device, options);
  const std::uint64_t count = detector.detect(in_double ? input_of(wide) : input_of(f)).count;
  return {count, detector.hash()};
}

TEST(Generate, TheSameSpheresEverywhere) {
  SplitMix64 random(1);
  EXPECT_EQ(random.bits(), 0x910a2dec89025cc1ull);  // of splitmix64
  const std::vector<FloatSphere> a = generate("dense", 1000), b = generate("dense", 1000);
  EXPECT_EQ(0, std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]));
  EXPECT_THROW(generate("no such scene", 10), Error);
  EXPECT_TRUE(generate("dense", 0).empty());
}

TEST(Generate, CoherentIsTheSameSetInAnotherOrder) {
  const auto key = [](const FloatSphere& a, const FloatSphere& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  };
  std::vector<FloatSphere> a = generate("poly35", 500), b = generate("poly35", 500, false);
  EXPECT_NE(0, std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]));
  std::sort(a.begin(), a.end(), key), std::sort(b.begin(), b.end(), key);
  EXPECT_EQ(0, std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]));
}

// Determinism is a number: the same on every backend, path, thread count and machine.
TEST(Generate, PinnedContactsAndHashes) {
  const struct {
    const char* name;
    std::uint64_t n, count, hash;
  } pinned[] = {{"dense", 30000, 99710, 0xa404845f576fb3d8},
                {"dilute", 30000, 13076, 0xc41e828616020081},
                {"poly35", 30000, 98382, 0x9cd90b8230237ba1},
                {"poly045", 30000, 13022, 0x96e089edcfcfbf94},
                {"poly100", 30000, 72733, 0x077921a8e95168e3}};
  for (const auto& p : pinned) {
    SCOPED_TRACE(p.name);
    const std::vector<FloatSphere> f = generate(p.name, p.n);
    for (const BackendKind backend : backends())
      for (const Path path : {Path::grid, Path::nine_stages})
        for (const int threads : {1, 2}) {
          if (path == Path::nine_stages && threads == 1) continue;
          CallOptions o;
          o.path = path, o.threads = threads, o.width = Width::pairs;
          const Found f1 = found(f, {backend}, o, threads == 2);
          EXPECT_EQ(f1.count, p.count) << (threads == 2 ? "in double" : "in float");
          EXPECT_EQ(f1.hash, p.hash) << std::hex << f1.hash;
        }
  }
}

TEST(Generate, BodiesHaveNoContactsInside) {
  const BodyScene scene = generate_bodies(200);
  const Shape shape{scene.shape.data(), scene.shape.size()};
  Input input;
  input.shapes = {&shape, 1}, input.bodies = scene.bodies;
  std::vector<std::uint64_t> hashes;
  for (const BackendKind backend : backends())
    for (const Path path : {Path::grid, Path::nine_stages}) {
      CallOptions o;
      o.path = path;
      Detector d({backend}, o);
      const Contacts& c = d.detect(input);
      EXPECT_GT(c.count, 200u);
      for (const Pair& p : c.pair_span()) ASSERT_NE(p.i / 64, p.j / 64);
      hashes.push_back(d.hash());
    }
  for (const std::uint64_t h : hashes) EXPECT_EQ(h, hashes[0]);
}

}  // namespace
}  // namespace padder::detect
