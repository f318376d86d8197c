// SPDX-License-Identifier: MIT
// Keys of bins on the CPU: what neighbouring bins promise, and scenes whose far spheres share buckets.
#include "detect/omp/choose_levels.h"

#include <numeric>
#include <set>

#include "tests/detect/oracle.h"

namespace padder::detect::omp {
namespace {

LevelKeys periodic(int bits, Spread spread = Spread::cubes) {
  Level l;
  l.hashed = 1, l.ring = l.buckets = 1u << bits;
  set_spread(l, spread);
  return keys_of(l);
}
// Every size of ring, and every way to spread over it.
std::vector<std::pair<int, Spread>> rings() {
  std::vector<std::pair<int, Spread>> all;
  for (int bits = 10; bits <= 28; bits++)
    for (const Spread spread : {Spread::cubes, Spread::xy, Spread::yz})
      if (spread == Spread::cubes || bits >= kLeastPlaneBits) all.push_back({bits, spread});
  return all;
}
std::uint32_t difference(const LevelKeys& k, int x, int y, int z) {
  return (static_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(y) * k.row +
          static_cast<std::uint32_t>(z) * k.plane) &
         k.mask;
}

TEST(LevelKeys, BinsOfABoxHaveDifferentKeys) {
  for (const auto& [bits, spread] : rings()) {
    const LevelKeys k = periodic(bits, spread);
    const int side = static_cast<int>(k.side());
    EXPECT_GE(side, 7) << bits;
    // All differences where they are few, and otherwise those between neighbours and some at random.
    const int all = bits <= 16 ? side - 1 : 4;
    for (int z = -all; z <= all; z++)
      for (int y = -all; y <= all; y++)
        for (int x = -all; x <= all; x++)
          ASSERT_TRUE((x == 0 && y == 0 && z == 0) || difference(k, x, y, z) != 0)
              << bits << ": " << x << ' ' << y << ' ' << z;
    std::mt19937_64 random(static_cast<std::uint64_t>(bits));
    std::uniform_int_distribution<int> within(1 - side, side - 1);
    for (int n = 0; n < 20000; n++) {
      const int x = within(random), y = within(random), z = within(random);
      ASSERT_TRUE((x == 0 && y == 0 && z == 0) || difference(k, x, y, z) != 0)
          << bits << ": " << x << ' ' << y << ' ' << z;
    }
  }
}

TEST(LevelKeys, LinesSpreadOverTheRing) {
  for (const auto& [bits, spread] : rings()) {
    const LevelKeys k = periodic(bits, spread);
    for (int z = -1; z <= 1; z++)
      for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
          if (x == 0 && y == 0 && z == 0) continue;
          EXPECT_LE(std::gcd(difference(k, x, y, z), k.mask + 1), 8u) << bits << ": " << x << y << z;
        }
  }
}

TEST(LevelKeys, ADenseLevelHasAKeyForEachBinAndItsBorder) {
  Level l;
  l.first[0] = -3, l.first[1] = 5, l.first[2] = -1;
  l.count[0] = 4, l.count[1] = 3, l.count[2] = 2;
  l.offset = 100, l.buckets = 6 * 5 * 4;
  const LevelKeys k = keys_of(l);
  std::set<std::uint32_t> seen;
  for (std::int64_t z = -2; z <= 1; z++)
    for (std::int64_t y = 4; y <= 8; y++)
      for (std::int64_t x = -4; x <= 1; x++) {
        const std::uint32_t key = k.key({x, y, z});
        EXPECT_TRUE(100 <= key && key < 100 + l.buckets);
        EXPECT_TRUE(seen.insert(key).second);
      }
  EXPECT_EQ(k.key({-3, 5, -1}), key_of(l, {-3, 5, -1}));
}

// Small heaps that lie on each other's buckets: each is another one, moved by a vector between bins of equal
// keys, or by 256 bins, after which fixed-point slots repeat. `larger`: with spheres of other sizes between.
TestScene aliases(std::mt19937_64& random, bool larger) {
  const LevelKeys k = periodic(10);
  const double size = 513.0 / 256;  // the bins of unit spheres
  const double row = k.row, stack = k.plane / k.row, ring = 1024;
  const double vectors[][3] = {{ring, 0, 0}, {row, -1, 0},     {0, stack, -1},  {256, 0, 0},
                               {0, 256, 0},  {256, -256, 256}, {0, 0, 1 << 20}, {-ring * 256, 0, 0}};
  TestScene s;
  for (int heap = 0; heap < 4; heap++) {
    const double at[3] = {1e4 * unit(random), 1e4 * unit(random), 1e4 * unit(random)};
    std::vector<Sphere> own;
    for (int n = 0; n < 12; n++)
      own.push_back({at[0] + 4 * unit(random), at[1] + 4 * unit(random), at[2] + 4 * unit(random),
                     larger && n < 2 ? 1 + 20 * unit(random) : 1});
    for (const auto& v : vectors)
      for (const double times : {0.0, 1.0, -1.0, 3.0})
        for (Sphere p : own) {
          p.x += times * v[0] * size, p.y += times * v[1] * size, p.z += times * v[2] * size;
          if (times != 0 || &v == &vectors[0]) s.spheres.push_back(p);
        }
  }
  std::shuffle(s.spheres.begin(), s.spheres.end(), random);
  return s;
}

TEST(PeriodicLevels, FarSpheresOfOneBucketAreNotTakenForNeighbours) {
  std::mt19937_64 random = random_of_new_seed();
  for (int round = 0; round < 12; round++)
    for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
      TestScene s = aliases(random, round % 2 == 1);
      if (scalar == Scalar::f32) s = s.rounded();
      const std::vector<Pair> wanted = brute_force(s);
      ASSERT_GT(wanted.size(), s.spheres.size() / 4);
      const Arranged a(s, scalar);
      for (const Precision precision : {Precision::exact, Precision::float32}) {
        Detector d({BackendKind::omp}, {});
        d.options().precision = precision, d.options().threads = 1;
        const Contacts& c = d.detect(a.input);
        std::vector<Pair> found = sorted(c.pair_span());
        if (precision == Precision::exact) {
          ASSERT_EQ(found, wanted) << "round " << round;
        } else {
          ASSERT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
          ASSERT_LE(std::max(found.size(), wanted.size()) - std::min(found.size(), wanted.size()),
                    c.doubtful);
        }
      }
    }
}

// In float or in double, in turn.
void expect_brute_force(const TestScene& scene, int round) {
  const Scalar scalar = round % 2 ? Scalar::f32 : Scalar::f64;
  const TestScene s = scalar == Scalar::f32 ? scene.rounded() : scene;
  const Arranged a(s, scalar);
  Detector d({BackendKind::omp}, {});
  d.options().threads = 1;
  EXPECT_EQ(sorted(d.detect(a.input).pair_span()), brute_force(s)) << "round " << round;
}

// Few spheres in much space, so that rows often go on at the other end of the ring.
TEST(PeriodicLevels, AnyPlaceOnTheRingGivesTheContactsOfBruteForce) {
  std::mt19937_64 random = random_of_new_seed();
  for (int round = 0; round < 150; round++) {
    TestScene s;
    const double edge = std::pow(10, 2 + 4 * unit(random)),
                 ratio = round % 3 == 0 ? 1 : 1 + 60 * unit(random);
    for (int heap = 0; heap < 60; heap++) {
      const double at[3] = {edge * unit(random), edge * unit(random), -edge * unit(random)};
      for (int n = 0; n < 6; n++) {
        const double u = unit(random), r = ratio == 1 ? 1 : 1 / (1 - u * (1 - 1 / ratio));
        s.spheres.push_back(
            {at[0] + 3 * r * unit(random), at[1] + 3 * r * unit(random), at[2] + 3 * r * unit(random), r});
      }
    }
    expect_brute_force(s, round);
  }
}

// A layer and a sphere far away. Spread as cubes, the layer would lie on itself seven times over.
TEST(PeriodicLevels, LayersDoNotLieOnThemselves) {
  std::mt19937_64 random(21);
  std::uniform_real_distribution<float> unit(0, 1);
  for (const int upright : {0, 2, 3}) {  // 3: no layer, a cube
    std::vector<FloatSphere> spheres{{1e6f, -2e6f, 3e6f, 1}};
    for (int k = 0; k < 120000; k++) {
      float place[3] = {700 * unit(random), 700 * unit(random), 700 * unit(random)};
      if (upright < 3)
        place[upright] = 0;
      else
        for (float& p : place) p *= 0.15f;
      spheres.push_back({place[0], place[1], place[2], 1});
    }
    const Input input = input_of(spheres);
    const View<float> view{&spheres[0].x, &spheres[0].r, 4, 4, spheres.size(), nullptr, nullptr};
    Grid grid = choose_levels(summarize(view, 1), 0);
    ASSERT_TRUE(grid.levels == 1 && grid.level[0].hashed);
    const std::uint64_t before = mistaken_pairs(view, grid.level[0]);
    spread_planes(view, grid);
    EXPECT_EQ(2 * mistaken_pairs(view, grid.level[0]) < before, upright < 3) << upright;
    CallOptions options;
    options.threads = 2, options.width = Width::pairs;
    Detector d({BackendKind::omp}, options);
    options.path = Path::nine_stages;
    Detector reference({BackendKind::omp}, options);
    const std::uint64_t wanted = reference.detect(input).count;
    ASSERT_GT(wanted, 1000u);
    EXPECT_EQ(d.detect(input).count, wanted);
    EXPECT_EQ(d.hash(), reference.hash());
  }
}

// Heaps of many small spheres and a few large ones, far from each other: two levels, both periodic.
TEST(PeriodicLevels, OneLevelSearchesAnotherAcrossTheEndOfTheRing) {
  std::mt19937_64 random = random_of_new_seed();
  for (int round = 0; round < 24; round++) {
    TestScene s;
    for (int heap = 0; heap < 12; heap++) {
      const double at[3] = {1e5 * unit(random), -1e5 * unit(random), 1e5 * unit(random)};
      const auto add = [&](double r) {
        s.spheres.push_back(
            {at[0] + 60 * unit(random), at[1] + 60 * unit(random), at[2] + 60 * unit(random), r});
      };
      for (int n = 0; n < 150; n++) add(1);
      for (int n = 0; n < 3; n++) add(round % 4 < 2 ? 30 : 8);
    }
    expect_brute_force(s, round);
  }
}

}  // namespace
}  // namespace padder::detect::omp
