// SPDX-License-Identifier: MIT
// Bins, keys and levels: what the completeness of the search rests on.
#include "detect/core/neighbourhood.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "tests/detect/core/summary_of.h"
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

TEST(Grid, SplitIsExactAtEveryMagnitude) {
  std::mt19937_64 random(5);
  for (const double size : {2.00390625, 0.5009765625 * 0x1p-30, 1023 * 0x1p40}) {
    Level l;
    l.size = size, l.per_size = 1 / size;
    for (int k = 0; k < 100000; k++) {
      const double x = size * signed_unit(random) * std::pow(2.0, 42 * std::abs(signed_unit(random)));
      const Split s = split(l, x);
      const long double corner = static_cast<long double>(s.bin) * size;
      ASSERT_GE(s.rest, 0);
      ASSERT_LE(s.rest, size);
      ASSERT_LE(std::abs(static_cast<double>(corner + s.rest - x)), size * 0x1p-52) << x;
    }
    for (const double bin : {-3., -1., 0., 1., 7., 1e12}) {  // on a face: the bin above it
      const Split s = split(l, bin * size);
      EXPECT_EQ(s.bin, static_cast<std::int64_t>(bin));
      EXPECT_EQ(s.rest, 0);
    }
    EXPECT_EQ(split(l, -0.5 * size).bin, -1) << "floor, not a cast";
  }
}

// split() against its definition, in arithmetic of 113 bits, where a corner and its comparison are exact:
// wherever a coordinate lies, of whatever size, beside whichever face.
TEST(Grid, SplitIsTheFloorAndNeverDecreases) {
  std::mt19937_64 random = random_of_new_seed();
  const auto any = [&](double low, double high) { return std::exp2(low + (high - low) * unit(random)); };
  for (int trial = 0; trial < 300; trial++) {
    Level l;
    const int exponent = trial % 3 == 0   ? -900
                         : trial % 3 == 1 ? static_cast<int>(random() % 40) - 20
                                          : static_cast<int>(random() % 1240) - 900;
    l.size = trial == 0 ? 0x1p-900 : std::ldexp(static_cast<double>(512 + random() % 513), exponent);
    l.per_size = 1 / l.size;
    std::vector<double> at = {0.0, -0.0, 5e-324, -5e-324, 1e-300, -1e-300, 0x1p-1022, -0x1p-1022};
    for (int k = 0; k < 400; k++) {
      const double sign = random() % 2 ? 1 : -1;
      at.push_back(sign * any(-1074, std::log2(l.size) + 42));                    // of any size
      at.push_back(sign * l.size * any(-60, 42.9));                               // some bins away
      double face = sign * l.size * std::floor(any(0, random() % 2 ? 3 : 42.9));  // on a face
      for (std::uint64_t n = random() % 4; n > 0; n--)
        face = std::nextafter(face, random() % 2 ? INFINITY : -INFINITY);  // and beside it
      at.push_back(face);
      at.push_back(sign * 5e-324 * static_cast<double>(random() % 1000));
      at.push_back(-l.size * any(-1100, -40));  // just below zero
    }
    std::sort(at.begin(), at.end());
    std::int64_t before = std::numeric_limits<std::int64_t>::min();
    for (const double x : at) {
      const Split s = split(l, x);
      const __float128 corner = static_cast<__float128>(s.bin) * l.size, next = corner + l.size;
      ASSERT_TRUE(corner <= x && x < next) << x << " bins of " << l.size << " bin " << s.bin;
      ASSERT_GE(s.bin, before) << x << " bins of " << l.size;
      before = s.bin;
      ASSERT_TRUE(s.rest >= 0 && s.rest <= l.size) << x << " bins of " << l.size << " rest " << s.rest;
      const __float128 off = s.rest - (x - corner);
      ASSERT_TRUE(s.bin == -1 ? (off < 0 ? -off : off) <= l.size * 0x1p-53 : corner + s.rest == x)
          << x << " bins of " << l.size;
    }
  }
}

TEST(Grid, FixedPointDifferencesDoNotGrowWithTheDomain) {
  Level l;
  l.size = 2.00390625, l.per_size = 1 / l.size, l.units = std::ldexp(l.per_size, kUnitBits);
  std::mt19937_64 random(6);
  for (const double far : {0., 1e5, 1e9, 1e12})
    for (int k = 0; k < 20000; k++) {
      const double a = far * signed_unit(random) + signed_unit(random), b = a + 4 * signed_unit(random);
      const double apart = wrapped_difference(fixed_point_of(l, split(l, a)), fixed_point_of(l, split(l, b)));
      ASSERT_LE(std::abs(apart - (b - a) * l.units), 1.001) << a << " " << b;
    }
}

TEST(Grid, DenseKeysAreInjectiveWithABorder) {
  std::vector<Sphere> spheres;
  for (int z = -2; z < 3; z++)
    for (int y = 0; y < 4; y++)
      for (int x = 5; x < 12; x++) spheres.push_back({2.1 * x, 2.1 * y, 2.1 * z, 1});
  const Grid g = choose_grid(summary_of(spheres), 0);
  ASSERT_EQ(g.levels, 1);
  const Level& l = g.level[0];
  ASSERT_FALSE(l.hashed);
  std::vector<int> seen(g.buckets, 0);
  for (std::int64_t z = l.first[2] - 1; z <= l.first[2] + l.count[2]; z++)
    for (std::int64_t y = l.first[1] - 1; y <= l.first[1] + l.count[1]; y++)
      for (std::int64_t x = l.first[0] - 1; x <= l.first[0] + l.count[0]; x++) {
        const std::uint32_t key = key_of(l, {x, y, z});
        ASSERT_LT(key, g.buckets);
        seen[key]++;
      }
  for (const int times : seen) EXPECT_EQ(times, 1);
}

TEST(Grid, SparseDomainsAreHashedAndSmall) {
  std::vector<Sphere> spheres;
  for (int k = 0; k < 1000; k++) spheres.push_back({3.0 * k, 3.0 * k, 3.0 * k, 1});
  const Grid g = choose_grid(summary_of(spheres), 0);
  EXPECT_TRUE(g.level[0].hashed);
  EXPECT_LE(g.buckets, 4096u);
}

// What the searches of hashed levels rest on: no two bins of a cube of `side` bins share a bucket, so that a
// search by rows meets each bin once.
TEST(Grid, TheBinsOfACubeHaveBucketsOfTheirOwnInARing) {
  for (int bits = kLeastRingBits; bits <= kMostRingBits; bits++) {
    const Hash hash = hash_of_ring(bits);
    const std::uint32_t mask = (1u << bits) - 1, side = hash.side;
    // Two bins share a bucket if their difference has bucket 0.
    const auto distance = [&](std::uint32_t key) { return std::min(key & mask, (0u - key) & mask); };
    for (std::uint32_t z = 0; z < side; z++)
      for (std::uint32_t y = z ? 0u - (side - 1) : 1; y != side; y++)
        ASSERT_GE(distance(y * hash.row + z * hash.plane), side) << bits;
    // Rows around a bin stay apart, even where eight bins share an entry of the table.
    const std::uint32_t rows[] = {0, hash.row, hash.plane, hash.plane - hash.row, hash.plane + hash.row};
    for (const std::uint32_t a : rows)
      for (const std::uint32_t b : rows) {
        if (a != b) {
          EXPECT_GE(distance(a - b), 40u) << bits;
        }
        if (a + b) {
          EXPECT_GE(distance(a + b), 40u) << bits;
        }
      }
  }
}

// What caches keep for a search: in a large ring the rows about a bin lie within a small part of it.
TEST(Grid, NeighbouringRowsAreNearEachOtherInALargeRing) {
  for (int bits = 21; bits <= kMostRingBits; bits++) {
    const Hash hash = hash_of_ring(bits);
    EXPECT_LE(hash.row + hash.plane, std::pow(2, 17 + 0.5 * (bits - 21))) << bits;
  }
}

// However the spheres of a hashed level lie, buckets are about as full as the bins are, and twice at most.
TEST(Grid, HashedLevelsSpreadBoxesPlanesAndLines) {
  const auto fullest = [](std::int64_t x, std::int64_t y, std::int64_t z) {
    Level l;
    const int bits = std::bit_width(static_cast<std::uint64_t>(2 * x * y * z - 1));
    const Hash hash = hash_of_ring(bits);
    l.hashed = 1, l.ring = l.buckets = 1u << bits, l.row = hash.row, l.plane = hash.plane;
    std::vector<int> found(l.ring, 0);
    for (std::int64_t a = 0; a < x; a++)
      for (std::int64_t b = 0; b < y; b++)
        for (std::int64_t c = 0; c < z; c++) found[key_of(l, {a, b, c})]++;
    return *std::max_element(found.begin(), found.end());
  };
  for (const std::int64_t n : {20, 40, 64, 100, 160}) {
    EXPECT_LE(fullest(n, n, n), 2) << n;
    EXPECT_LE(fullest(n * n, n, 1), 4) << n;
    EXPECT_LE(fullest(1, n * n, n), 4) << n;
    EXPECT_LE(fullest(n, 1, n * n), 4) << n;
    EXPECT_EQ(fullest(n * n, 1, 1), 1) << n;
    EXPECT_EQ(fullest(1, n * n, 1), 1) << n;
    EXPECT_EQ(fullest(1, 1, n * n), 1) << n;
  }
}

// A grid that covers spheres gives each a bin that exists, and a level whose bins are wide enough.
TEST(Grid, CoversIsTrueOnlyWhereEverySphereHasAPlace) {
  std::mt19937_64 random = random_of_new_seed();
  int covered = 0, left = 0;
  for (int round = 0; round < 60; round++) {
    std::vector<Sphere> spheres =
        random_scene(300, round % 3 ? 50 : 1, 1, static_cast<std::uint32_t>(random())).spheres;
    const Summary before = summary_of(spheres);
    const Grid g =
        choose_grid(before, 0, 8, Processor::gpu, round % 2 ? GridBounds::wide : GridBounds::tight);
    EXPECT_TRUE(covers(g, before));
    const double step = std::pow(10, 2 * signed_unit(random));
    for (Sphere& s : spheres) s.x += step * signed_unit(random), s.y += step * signed_unit(random);
    const Summary now = summary_of(spheres);
    (covers(g, now) ? covered : left)++;
    if (!covers(g, now)) continue;
    for (const Sphere& s : spheres) {
      const Level& l = g.level[level_of(g, s)];
      const Bin b = bin_of(l, s);
      ASSERT_GE(l.size, need_of(s));
      ASSERT_GE(l.radius_max, s.r);
      const std::int64_t at[3] = {b.x, b.y, b.z};
      for (int k = 0; k < 3 && !l.hashed; k++) {
        ASSERT_GE(at[k], l.first[k]);
        ASSERT_LT(at[k], l.first[k] + l.count[k]);
      }
    }
  }
  EXPECT_GT(covered, 5);
  EXPECT_GT(left, 5);
}

// A stable list is searched twice where its grid differs from that of the call before. Spheres of several
// sizes fill a box whose walls stand at 0, and tremble.
TEST(Grid, SteppedGridsStayWhileSpheresTremble) {
  std::mt19937_64 random(20261123);
  std::vector<Sphere> spheres(30000);
  for (Sphere& s : spheres)
    s = {150 * unit(random), 150 * unit(random), 150 * unit(random), std::pow(unit(random), -0.4)};
  Grid before;
  int changes = 0;
  for (int frame = 0; frame < 20; frame++) {
    std::vector<Sphere> moved = spheres;
    for (Sphere& s : moved)
      for (double* x : {&s.x, &s.y, &s.z}) *x += 0.2 * s.r * (unit(random) - 0.5);
    const Grid g = choose_grid(summary_of(moved), 0, 8, Processor::gpu, GridBounds::stepped);
    ASSERT_GT(g.levels, 2);
    changes += frame > 0 && !(g == before);
    before = g;
  }
  EXPECT_LT(changes, 4);
}

TEST(Grid, EverySphereFitsItsLevel) {
  for (const double ratio : {1.0, 1.9, 4.0, 100.0, 1e4, 1e9}) {
    TestScene scene = random_scene(3000, ratio, 2, 77);
    scene.spheres.push_back({1e25, 0, 0, 1});
    scene.spheres.push_back({0, 0, 0, 0});
    for (const Processor processor : {Processor::cpu, Processor::gpu}) {
      Summary summary = summary_of(scene.spheres);
      for (const double grown_by : {0.0, 5.0}) {
        summary.grown_by = grown_by;
        const Grid g = choose_grid(summary, 0, 8, processor);
        ASSERT_LE(g.levels, kMaxLevels);
        for (const Sphere& s : scene.spheres) {
          const Level& l = g.level[level_of(g, s)];
          ASSERT_GT(l.size, 2 * (s.r + grown_by));
          ASSERT_GE(l.radius_max, s.r + grown_by);
          ASSERT_LE(std::abs(s.x) / l.size, 0x1p43);
          ASSERT_LT(key_of(l, bin_of(l, s)) - l.offset, l.buckets);
        }
        for (int k = 1; k < g.levels; k++) EXPECT_GE(g.level[k].size, g.level[k - 1].size);
        EXPECT_TRUE(covers(g, summary)) << "however far the farthest is";
        summary.grown_by = grown_by + 1;
        EXPECT_FALSE(covers(g, summary));
      }
    }
  }
}

// One ball beyond all others, or points beneath them, does not blur the sizes of the others.
TEST(Grid, OctavesAreWhereTheSpheresAre) {
  std::vector<std::uint64_t> of(kExponents, 0);
  const auto above = [&] { return octaves_above(std::span<const std::uint64_t, kExponents>(of)); };
  for (int e = 1023; e < 1030; e++) of[e] = 1000;
  EXPECT_EQ(above(), 0);
  of[1023 + 63] = 1;
  EXPECT_EQ(above(), 0) << "64 octaves are told apart";
  of[1023 + 63] = 0, of[1023 + 84] = 1, of[1023 + 300] = 2;
  const int top = 1023 + 300 - above();
  EXPECT_GT(top, 1029);
  EXPECT_LT(top, 1023 + 64);
  of[0] = 7000;  // more points than spheres: they are one octave of their own
  EXPECT_GT(1023 + 300 - above(), 1029);
  of.assign(kExponents, 0), of[0] = 5;
  EXPECT_EQ(above(), 0);
  of.assign(kExponents, 1);
  EXPECT_GE(above(), 0);
  EXPECT_LT(above(), kExponents);
}

TEST(Grid, EqualRadiiAreOneLevelAndWideOnesSeveral) {
  EXPECT_EQ(choose_grid(summary_of(random_scene(1000, 1, 1, 1).spheres), 0).levels, 1);
  EXPECT_GT(choose_grid(summary_of(random_scene(20000, 100, 0.5, 1).spheres), 0).levels, 2);
}

// Along an axis with few bins a hashed level ends where its spheres do, and one bin later if a bin in float
// may be the next one. Elsewhere its bounds are wide.
TEST(Grid, HashedLevelsOfALayerAreBounded) {
  std::mt19937_64 random(27);
  for (const double height : {0.0, -1e-20, 37.0}) {
    std::vector<Sphere> spheres;
    for (int k = 0; k < 20'000; k++)
      spheres.push_back({1100 * unit(random), height, 1100 * unit(random),
                         std::min(100., std::pow(unit(random), -1 / 2.4))});
    const Summary s = summary_of(spheres);
    const Grid g = choose_grid(s, 0, 8, Processor::gpu);
    const Level& l = g.level[0];
    ASSERT_TRUE(l.hashed);
    EXPECT_TRUE(bounded(l, 1));
    EXPECT_FALSE(bounded(l, 0) || bounded(l, 2));
    EXPECT_EQ(l.count[1], height < 0 ? 2 : 1);
    EXPECT_EQ(l.first[1], std::floor(height / l.size));
    EXPECT_TRUE(covers(g, s));
    for (const double up : {-l.size, l.size}) {
      std::vector<Sphere> moved = spheres;
      for (Sphere& p : moved) p.y = (std::floor(height / l.size) + 0.5) * l.size + (height < 0 ? 2 : 1) * up;
      EXPECT_FALSE(covers(g, summary_of(moved))) << height << " by " << up;
    }
    std::vector<Sphere> below_a_face = spheres;
    for (Sphere& p : below_a_face)
      p.y = std::nextafter((std::floor(height / l.size) + 1) * l.size, -INFINITY);
    EXPECT_EQ(covers(g, summary_of(below_a_face)), height < 0) << height;
  }
}

// Bins in float are for dense levels of no more than kMostFloatBins bins along an axis, also while the bounds
// are wider than the spheres.
TEST(Grid, LongLevelsAreHashedForAGpu) {
  for (const double length : {2.0 * kMostFloatBins * 0.9, 2.0 * kMostFloatBins * 0.97, 1e5}) {
    std::vector<Sphere> spheres;
    for (int k = 0; k < 20'000; k++) spheres.push_back({length * k / 20'000, k % 7 * 2.0, k % 5 * 2.0, 1});
    for (const GridBounds bounds : {GridBounds::tight, GridBounds::stepped, GridBounds::wide}) {
      const Level on_gpu = choose_grid(summary_of(spheres), 0, 400, Processor::gpu, bounds).level[0];
      EXPECT_EQ(on_gpu.hashed, length > 2.0 * kMostFloatBins * 0.95) << length;
      if (!on_gpu.hashed) {
        EXPECT_LE(on_gpu.count[0], kMostFloatBins) << length;
      }
      EXPECT_FALSE(choose_grid(summary_of(spheres), 0, 400, Processor::cpu, bounds).level[0].hashed);
    }
  }
}

// Bins of points are as small as coordinates allow. If the step of these were 2^30 of them, a third of the
// points would share a bucket of the ring, and each would be tested against each.
TEST(Grid, FewPointsOnALineShareABucket) {
  std::vector<Sphere> points;
  for (int k = 0; k <= 1 << 12; k++) points.push_back({1.5 * k, 1.5 * k, -1.5 * k, 0});
  const Grid g = choose_grid(summary_of(points), 0, 8, Processor::gpu);
  std::map<std::uint32_t, std::size_t> in_bucket;
  std::size_t most = 0;
  for (const Sphere& p : points) {
    const Level& l = g.level[level_of(g, p)];
    most = std::max(most, ++in_bucket[key_of(l, bin_of(l, p))]);
  }
  EXPECT_LT(most, points.size() / 50);
}

// However large one sphere is, it searches no more bins than there are. So it must not get a level with bins
// of its own size that holds the others, too: there each would be tested against each.
TEST(Grid, OneGiantDoesNotCoarsenTheOthers) {
  for (const double giant : {1e3, 1e6, 1e30}) {
    std::vector<Sphere> spheres;
    for (int k = 0; k < 64000; k++)
      spheres.push_back({1.6 * (k % 40), 1.6 * (k / 40 % 40), 1.6 * (k / 1600), 1});
    spheres[777].r = giant;
    for (const Processor processor : {Processor::gpu, Processor::cpu}) {
      const Grid g = choose_grid(summary_of(spheres), 0, 8, processor);
      EXPECT_GT(g.levels, 1) << giant;
      EXPECT_LT(g.level[0].size, 4) << giant;
    }
  }
}

// For each level: how many spheres each of its spheres finds in its own bin, summed up.
std::vector<double> met_in_bins(const Grid& g, const std::vector<Sphere>& spheres) {
  std::map<std::array<std::int64_t, 4>, double> bins;
  for (const Sphere& s : spheres) {
    const int level = level_of(g, s);
    const Bin b = bin_of(g.level[level], s);
    bins[{level, b.x, b.y, b.z}]++;
  }
  std::vector<double> met(kMaxLevels);
  for (const auto& [bin, count] : bins) met[static_cast<std::size_t>(bin[0])] += count * count;
  return met;
}

// Where radii grow with the distance from the middle, large spheres are not near the small ones, however many
// they are: they would visit few of their bins. So the small ones need not share bins that suit larger ones.
TEST(Grid, RadiiThatGrowOutwardsHaveLevelsOfTheirOwn) {
  std::mt19937_64 random(26);
  std::normal_distribution<double> normal;
  for (const double ratio : {1e2, 3e3, 1e6})
    for (const double radii_away : {16, 50}) {
      std::vector<Sphere> spheres;
      while (spheres.size() < 20'000) {
        const double r = std::pow(ratio, unit(random)), x = normal(random), y = normal(random),
                     z = normal(random), far = radii_away * r / std::hypot(x, y, z);
        spheres.push_back({x * far, y * far, z * far, r});
      }
      Summary s = summary_of(spheres);
      s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
      for (const Processor processor : {Processor::gpu, Processor::cpu}) {
        const Grid g = choose_grid(s, 0, 8, processor);
        const std::vector<double> met = met_in_bins(g, spheres);
        for (int k = 0; k < g.levels; k++)
          EXPECT_LT(met[static_cast<std::size_t>(k)] / static_cast<double>(g.level[k].spheres), 10)
              << "spheres in the bin of a sphere of level " << k << " of " << g.levels << ", ratio " << ratio
              << ", " << radii_away << " radii away";
      }
    }
}

// Spheres of any size that are far away do not make others look as if nothing were near them.
TEST(Grid, StraySpheresLeaveTheLevelsOfTheOthers) {
  std::mt19937_64 random(28);
  std::vector<Sphere> spheres(30'000);
  double volume = 0;
  for (Sphere& s : spheres) s.r = std::pow(1 - unit(random), -0.4), volume += 12 * s.r * s.r * s.r;
  const double edge = std::cbrt(volume);
  for (Sphere& s : spheres) s.x = edge * unit(random), s.y = edge * unit(random), s.z = edge * unit(random);
  for (const Processor processor : {Processor::cpu, Processor::gpu}) {
    const Grid without = choose_grid(summary_of(spheres), 0, 8, processor);
    ASSERT_GT(without.levels, 2);
    for (const double far : {1e5, 1e9, 4e12})
      for (const std::size_t strays : {1, 30}) {
        std::vector<Sphere> all = spheres;
        for (std::size_t k = 0; k < strays; k++) all[k * 1000].z = -far * (1 - 0.01 * static_cast<double>(k));
        const Grid g = choose_grid(summary_of(all), 0, 8, processor);
        const std::vector<double> met = met_in_bins(g, all), before = met_in_bins(without, spheres);
        EXPECT_LT(std::accumulate(met.begin(), met.end(), 0.0),
                  1.5 * std::accumulate(before.begin(), before.end(), 0.0))
            << far << ", " << strays;
      }
  }
}

// Lone spheres of the heap's size make it look as if nothing were near it, and those of many other sizes need
// octaves to be joined: others than that of the heap.
TEST(Grid, LoneSpheresOfManySizesDoNotCoarsenAHeap) {
  std::mt19937_64 random(30);
  std::vector<Sphere> spheres;
  for (int k = 0; k < 20'000; k++)
    spheres.push_back({65 * unit(random), 65 * unit(random), 65 * unit(random), 1});
  for (int k = 0; k < 20'000; k++)
    spheres.push_back(
        {2e8 * unit(random), 2e8 * unit(random), 2e8 * unit(random), std::pow(1e6, unit(random))});
  Summary s = summary_of(spheres);
  s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
  for (const Processor processor : {Processor::gpu, Processor::cpu}) {
    const Grid g = choose_grid(s, 0, 8, processor);
    EXPECT_LT(met_in_bins(g, spheres)[0] / 20'000, 10) << g.levels << " levels";
  }
}

// A heap of grains; stones and boulders are spread widely, with a few grains between them. By their bounds,
// grains are so far from each other that they share a level with the stones. All of the heap would lie in few
// of its bins.
TEST(Grid, AHeapAmongBouldersHasBinsOfItsOwn) {
  std::mt19937_64 random = random_of_new_seed();
  for (const double ratio : {20.0, 100.0, 1000.0}) {
    std::vector<Sphere> spheres;
    const auto strew = [&](int count, double edge, double r) {
      for (int k = 0; k < count; k++)
        spheres.push_back({edge * unit(random), edge * unit(random), edge * unit(random), r});
    };
    const double wide = 2000 * ratio;
    strew(10, wide, 100 * ratio), strew(300, wide, ratio), strew(30, wide, 1), strew(60'000, 80, 1);
    std::shuffle(spheres.begin(), spheres.end(), random);
    Summary s = summary_of(spheres);
    const auto bins_of_heap = [&](Processor processor) {
      const Grid g = choose_grid(s, 0, 8, processor);
      return g.level[level_of(g, {0, 0, 0, 1})].size;
    };
    for (const Processor processor : {Processor::gpu, Processor::cpu}) {
      s.near = nullptr;
      EXPECT_GT(bins_of_heap(processor), ratio) << ratio;
      s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
      EXPECT_LT(bins_of_heap(processor), 3) << ratio;
    }
    // Probes say how many small spheres are near a small one.
    const SizeGroups& groups = s.near->groups;
    ASSERT_EQ(groups.count, 3);
    double found = 0, small = 0, all = 0;
    for (int d = 0; d < 2; d++) found += s.near->pairs[0][0][d];
    for (std::size_t k = 0; k < spheres.size(); k += 100) {
      if (spheres[k].r > 1) continue;
      small++;
      for (const Sphere& p : spheres)
        all += p.r == 1 && chebyshev_distance(spheres[k], p) <= groups.within[1];
    }
    const double near = found / s.near->probes[0] * static_cast<double>(spheres.size()) / s.near->targets,
                 exact = all / small;
    EXPECT_NEAR(near, exact, 0.3 * exact) << ratio;
  }
}

// A heap of four octaves, and ten coarser octaves spread widely: some must share a level. Those of the heap
// do not get bins for coarser ones, in which all of the heap would lie.
TEST(Grid, JoinedOctavesDoNotCoarsenAHeap) {
  std::mt19937_64 random = random_of_new_seed();
  std::vector<Sphere> spheres;
  for (int k = 0; k < 60'000; k++) {
    const bool heap = k % 3 < 2;
    const double edge = heap ? 600 : 3e7, r = std::exp2(heap ? 4 * unit(random) : 8 + 10 * unit(random));
    spheres.push_back({edge * unit(random), edge * unit(random), edge * unit(random), r});
  }
  Summary s = summary_of(spheres);
  ASSERT_GT(std::count_if(s.octave, s.octave + kOctaves, [](const auto& o) { return o.count > 0; }),
            kMaxLevels);
  s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
  const Grid g = choose_grid(s, 0, 8, Processor::gpu);
  for (const Sphere& p : spheres) {  // what rounds up to the next octave may be alone there
    if (p.r < 15.99) {
      ASSERT_LT(g.level[level_of(g, p)].size, 64);
    }
  }
}

// Spheres that lie evenly have the grid that their bounds ask for: what probes find by chance seldom counts.
TEST(Grid, ProbesOfEvenSpheresSeldomChangeIt) {
  std::mt19937_64 random = random_of_new_seed();
  int changed = 0;
  for (int trial = 0; trial < 60; trial++) {
    const double ratio = std::pow(100, unit(random)), edge = 20 * ratio * (1 + unit(random));
    std::vector<Sphere> spheres(1000 + random() % 50'000);
    for (Sphere& p : spheres)
      p = {edge * unit(random), edge * unit(random), edge * unit(random), std::pow(ratio, unit(random))};
    Summary s = summary_of(spheres);
    const Grid without = choose_grid(s, 0, 8, Processor::gpu);
    s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
    changed += choose_grid(s, 0, 8, Processor::gpu) != without;
  }
  EXPECT_LE(changed, 4);
}

// Where spheres are few within their bounds, they are taken to lie about one point, unless probes find that
// they do not: then no level of their own is worth it.
TEST(Grid, ProbesTellThatSparseSpheresAreAlone) {
  std::mt19937_64 random = random_of_new_seed();
  std::vector<Sphere> spheres;
  for (int k = 0; k < 100'000; k++)
    spheres.push_back({1e6 * unit(random), 1e6 * unit(random), 1e6 * unit(random), k % 5 ? 17.0 : 800.0});
  Summary s = summary_of(spheres);
  EXPECT_EQ(choose_grid(s, 0, 8, Processor::gpu).levels, 2);
  s.near = probe_neighbourhood(
      s, [&](std::uint32_t k) { return spheres[k]; }, Draw::many);
  EXPECT_EQ(choose_grid(s, 0, 8, Processor::gpu).levels, 1);
}

TEST(Grid, ProbesAreDifferentSpheres) {
  for (const std::uint64_t n :
       {1ull, 63ull, 64ull, 511ull, 512ull, 5000ull, 65'536ull, 100'000ull, 0xfffffffeull})
    for (const auto& [draw, probes] : {std::pair(Draw::few, false), std::pair(Draw::few, true),
                                       std::pair(Draw::many, false), std::pair(Draw::many, true)}) {
      const std::uint32_t drawn = probes ? probes_of(n, draw) : targets_of(n, draw),
                          targets =
                              draw == Draw::many ? Neighbourhood::kManyTargets : Neighbourhood::kFewTargets,
                          most = probes ? targets / Neighbourhood::kTargetsOfProbe : targets;
      ASSERT_LE(drawn, most);
      ASSERT_TRUE(n < 65'536 || drawn > most * 7 / 8) << n;
      std::uint32_t last = 0;
      for (std::uint32_t k = 0; k < drawn; k++) {
        const std::uint32_t at = drawn_at(k, probes ? part_of_probes(n, draw) : part_of_targets(n, draw));
        ASSERT_LT(at, n);
        ASSERT_TRUE(k == 0 || at > last) << n << ' ' << k;
        last = at;
      }
    }
}

// The grid of moving spheres seldom changes where some come and go, unless a level has nearly as many as a
// step of Level::spheres.
TEST(Grid, AFewSpheresMoreOrLessSeldomChangeIt) {
  std::mt19937_64 random = random_of_new_seed();
  for (const double ratio : {1.0, 30.0}) {
    int stays = 0, covered = 0, calls = 0;
    for (int scene = 0; scene < 10; scene++) {
      std::vector<Sphere> spheres(20'000 + random() % 50'000);
      for (Sphere& p : spheres)
        p = {100 * unit(random), 100 * unit(random), 100 * unit(random),
             0.3 * std::pow(ratio, -unit(random))};
      Grid before, wide;
      for (int call = 0; call < 20; call++) {
        std::vector<Sphere> some(spheres.begin(), spheres.end() - static_cast<std::ptrdiff_t>(random() % 20));
        Summary s = summary_of(some);
        if (ratio > 1) s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return some[k]; });
        const auto grid_of = [&](GridBounds bounds) { return choose_grid(s, 0, 8, Processor::gpu, bounds); };
        const Grid now = grid_of(GridBounds::stepped);
        if (call == 0) before = now, wide = grid_of(GridBounds::wide);
        // Who comes may be the largest of its octave.
        calls++, stays += now == before, covered += covers(wide, s);
        before = now;
        for (const Grid& g : {now, wide}) {
          std::uint64_t most = 0;
          for (int k = 0; k < g.levels; k++) most += g.level[k].spheres;
          EXPECT_TRUE(most >= some.size() && most <= some.size() * 9 / 8) << most << " for " << some.size();
        }
      }
    }
    EXPECT_GE(stays, calls * 6 / 10) << ratio;
    EXPECT_GE(covered, calls * 8 / 10) << ratio;
  }
}

// Radii over more octaves than there can be levels: octaves of few spheres share one, but the few largest
// spheres do not make bins for the many.
TEST(Grid, MoreOctavesThanLevels) {
  std::mt19937_64 random(27);
  std::normal_distribution<double> normal;
  for (const double sigma : {2.0, 4.0}) {
    std::vector<Sphere> spheres(50'000);
    double volume = 0;
    for (Sphere& s : spheres) s.r = std::exp(sigma * normal(random)), volume += 40 * s.r * s.r * s.r;
    const double edge = std::cbrt(volume);
    for (Sphere& s : spheres) s.x = edge * unit(random), s.y = edge * unit(random), s.z = edge * unit(random);
    const Summary summary = summary_of(spheres);
    const auto octaves = std::count_if(std::begin(summary.octave), std::end(summary.octave),
                                       [](const Summary::Octave& o) { return o.count > 0; });
    ASSERT_GT(octaves, 1.5 * kMaxLevels);
    for (const Processor processor : {Processor::cpu, Processor::gpu}) {
      const Grid g = choose_grid(summary, 0, 8, processor);
      for (const Sphere& s : spheres) ASSERT_LE(need_of(s), g.level[level_of(g, s)].size);
      EXPECT_LT(g.level[g.levels - 1].spheres, 100u) << sigma;
      const std::vector<double> met = met_in_bins(g, spheres);
      EXPECT_LT(std::accumulate(met.begin(), met.end(), 0.0), 10.0 * 50'000) << sigma;
    }
  }
}

// A hair above an octave is no level more, and few large spheres look down at many small ones, not the other
// way round.
TEST(Grid, LevelsThatLookEitherWay) {
  TestScene near = random_scene(20000, 1, 3.5, 5);
  for (std::size_t k = 0; k < near.spheres.size(); k++)
    near.spheres[k].r = k == 7 ? 2.0001 : 1 + static_cast<double>(k % 100) / 100;
  EXPECT_EQ(choose_grid(summary_of(near.spheres), 0, 8, Processor::cpu).levels, 1);
  TestScene wide = random_scene(20000, 1, 3.5, 6);
  for (std::size_t k = 0; k < wide.spheres.size(); k += 200) wide.spheres[k].r = 30;
  const Grid g = choose_grid(summary_of(wide.spheres), 0, 8, Processor::cpu);
  ASSERT_EQ(g.levels, 2);
  const Level &fine = g.level[0], &coarse = g.level[1];
  EXPECT_LT(coarse_to_fine_cost(coarse, fine) * static_cast<double>(coarse.spheres),
            fine_to_coarse_cost(fine, coarse) * static_cast<double>(fine.spheres));
  EXPECT_GT(coarse_to_fine_cost(coarse, fine), 20 * fine_to_coarse_cost(fine, coarse)) << "of one sphere";
}

// The bounds of hashed levels are wide and tell nothing: these spheres lie together, but for some far away.
TEST(Grid, LargeSpheresSearchSmallOnesAlsoInHashedLevels) {
  Level fine, coarse;
  fine.hashed = coarse.hashed = 1;
  fine.size = 8, fine.radius_max = 4, fine.spheres = 97000;
  coarse.size = 32, coarse.radius_max = 15.9, coarse.spheres = 3000;
  for (int k = 0; k < 3; k++)
    fine.first[k] = -4096, fine.count[k] = 8192, coarse.first[k] = -512, coarse.count[k] = 1024;
  EXPECT_LT(2 * coarse_to_fine_cost(coarse, fine) * static_cast<double>(coarse.spheres),
            fine_to_coarse_cost(fine, coarse) * static_cast<double>(fine.spheres));
}

// Two spheres of one level that touch are at most one bin apart.
TEST(Grid, PartnersAreInNeighbouringBins) {
  std::mt19937_64 random(8);
  const TestScene scene = random_scene(2000, 30, 1, 3);
  const Grid g = choose_grid(summary_of(scene.spheres), 0);
  for (const Sphere& a : scene.spheres)
    for (int coarser = level_of(g, a); coarser < g.levels; coarser++) {
      const Level& l = g.level[coarser];
      const double r = l.radius_max, d = (a.r + r) * (1 + 1e-15) * (unit(random) < 0.5 ? -1 : 1);
      ASSERT_LE(std::abs(split(l, a.x + d).bin - split(l, a.x).bin), 1);
    }
}

// Spheres that spread and travel have the grid that was foreseen; those that draw together to nothing have
// one.
TEST(Grid, OfSpheresThatGoOnIsForeseen) {
  const TestScene scene = random_scene(2000, 30, 1, 3);
  const auto at = [&](double time, double growth) {
    std::vector<Sphere> moved = scene.spheres;
    for (Sphere& s : moved)
      s.x = s.x * (1 + growth * time) + 40 * time, s.y *= 1 + growth * time, s.z *= 1 + growth * time;
    return summary_of(moved);
  };
  const auto grid = [](const Summary& s) {
    return choose_grid(s, 0, 4, Processor::gpu, GridBounds::stepped);
  };
  EXPECT_EQ(grid(going_on(at(0, 0.25), at(1, 0.25))), grid(at(2, 0.25)));
  EXPECT_NE(grid(at(1, 0.25)), grid(at(2, 0.25)));
  const Summary after = at(1, -0.75), gone = going_on(at(0, -0.75), after);
  for (int k = 1; k < 3; k++) {
    EXPECT_EQ(gone.low[k], after.low[k]);
    EXPECT_EQ(gone.high[k], after.high[k]);
  }
}

TEST(Grid, BitsForKeys) {
  EXPECT_EQ(bits_for(1), 0);
  EXPECT_EQ(bits_for(2), 1);
  EXPECT_EQ(bits_for(3), 2);
  EXPECT_EQ(bits_for(1u << 31), 31);
  EXPECT_EQ(bits_for(0xffffffffu), 32);
}

}  // namespace
}  // namespace padder::detect
