// SPDX-License-Identifier: MIT
// Loose spheres and the files they come from. As a part of scenes: scene_test.cpp.
#include "detect/scene/loose.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/asset/npz.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

TEST(Loose, FaultyFiles) {
  const auto csv = [](const char* text) { return loose_from_csv(text, "l.csv"); };
  EXPECT_THROW(csv(""), Error);
  EXPECT_THROW(csv("x,y,z\n"), Error);
  EXPECT_THROW(csv("x,y,z,radius\n1,2,3,4\n"), Error);
  EXPECT_EQ(error_of([&] { csv("x,y,z,r\n1,2,3,4\n1,2,3\n"); }),
            "l.csv:3: 4 numbers are wanted, there are 3");
  EXPECT_THROW(csv("x,y,z,r\n1,2,3,4x\n"), Error);
  EXPECT_THROW(csv("x,y,z,r,family\n1,2,3,4,-1\n"), Error);
  EXPECT_EQ(csv("\xEF\xBB\xBFx,y,z,r\n1,2,3,4\n").size(), 1u) << "as Excel writes it";
  const std::vector<double> four(4, 1.);
  const std::string good =
      npz_bytes({{"centers", npy_array(four.data(), {1, 3})}, {"radii", npy_array(four.data(), {1})}});
  EXPECT_EQ(loose_from_npz(good, "l").size(), 1u);
  for (std::size_t cut = 0; cut < good.size(); cut += 7)
    EXPECT_THROW(loose_from_npz(good.substr(0, cut), "l"), Error) << cut;
  for (std::size_t at = 0; at < good.size(); at++) {  // no byte may crash it
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x55);
    try {
      loose_from_npz(bad, "l");
    } catch (const Error&) {
    }
  }
}

// Float stays float until double comes behind it; what only one side names is 0 on the other.
TEST(Loose, AppendedSpheresKeepTheirNumbersAndFilters) {
  LooseSpheres all = loose_from({{1, 2, 3, 0.1f}, {4, 5, 6, 0.5f}});
  ASSERT_EQ(all.scalar, Scalar::f32);
  LooseSpheres more = loose_from({{7, 8, 9, 2}});
  more.family = {11};
  all.append(more);
  ASSERT_EQ(all.scalar, Scalar::f32);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all.single, (std::vector<float>{1, 2, 3, 0.1f, 4, 5, 6, 0.5f, 7, 8, 9, 2}));
  all.append(loose_from_csv("x,y,z,r,mask\n0.1,0.2,0.3,0.4,6\n", "l.csv"));
  ASSERT_EQ(all.scalar, Scalar::f64);
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all.twice[3], static_cast<double>(0.1f)) << "widened, not read again";
  EXPECT_EQ(all.twice[12], 0.1);
  EXPECT_EQ(all.family, (std::vector<std::uint32_t>{0, 0, 11, 0}));
  EXPECT_EQ(all.mask, (std::vector<std::uint32_t>{0, 0, 0, 6}));
  EXPECT_TRUE(all.is_static.empty());
}

// The view is of the arrays themselves.
TEST(Loose, ViewIsBorrowed) {
  const LooseSpheres one = loose_from({{1, 2, 3, 4}, {5, 6, 7, 8}}),
                     two = loose_from_csv("x,y,z,r\n1,2,3,4\n5,6,7,8\n", "l.csv");
  const Spheres f = one.view(), d = two.view();
  ASSERT_EQ(f.count, 2u);
  EXPECT_EQ(f.scalar, Scalar::f32);
  EXPECT_EQ(f.centers, one.single.data());
  EXPECT_EQ(static_cast<const float*>(f.centers)[f.center_stride], 5);
  EXPECT_EQ(static_cast<const float*>(f.radii)[f.radius_stride], 8);
  ASSERT_EQ(d.count, 2u);
  EXPECT_EQ(d.scalar, Scalar::f64);
  EXPECT_EQ(d.centers, two.twice.data());
  EXPECT_EQ(static_cast<const double*>(d.centers)[d.center_stride], 5);
  EXPECT_EQ(static_cast<const double*>(d.radii)[d.radius_stride], 8);
  EXPECT_EQ(f.family, nullptr);
}

// Found by fuzzing: the radii began behind the beginning of no array.
TEST(Loose, NoSpheresAreNoArrays) {
  const Spheres none = loose_from(std::vector<FloatSphere>{}).view();
  EXPECT_EQ(none.count, 0u);
  EXPECT_EQ(none.centers, nullptr);
  EXPECT_EQ(none.radii, nullptr);
}

}  // namespace
}  // namespace padder::detect
