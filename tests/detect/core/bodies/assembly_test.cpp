// SPDX-License-Identifier: MIT
// A scene in elements, and the table of what stands still: every sphere in one element, every ball in its
// bin, and no ball out of reach of a bin that touches it, by brute force.
#include "detect/core/bodies/assembly.h"
#include "detect/core/bodies/static_table.h"

#include <set>

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

using Random = std::mt19937_64;

std::vector<Sphere> row_of_spheres(std::uint32_t n) {
  std::vector<Sphere> s(n);
  for (std::uint32_t k = 0; k < n; k++) s[k] = {0.5 * k, 0, 0, 1};
  return s;
}

struct Parts : TestBodies {
  Parts() { assets = {row_of_spheres(3), {}, row_of_spheres(200), row_of_spheres(1)}; }
  void add(std::uint32_t shape, bool still) {
    bodies.push_back(body_at(shape, 0, 0, 0)), bodies.back().is_static = still;
  }
};

// The numbers of the spheres of an element, by the order in which the input counts them.
std::vector<std::uint64_t> spheres_of_element(const Assembly& a, const Element& e) {
  if (e.body == kLoose) return {a.body_first.back() + e.piece};
  std::vector<std::uint64_t> numbers;
  const Piece& p = a.pieces.pieces[e.piece];
  for (std::uint32_t k = p.first; k < p.first + p.count; k++)
    numbers.push_back(a.body_first[e.body] + a.pieces.numbers[k]);
  return numbers;
}

TEST(Assembly, EverySphereInOneElementAndWhatMovesComesFirst) {
  Parts parts;
  for (const auto& [shape, is_static] : std::vector<std::pair<int, bool>>{
           {2, true}, {0, false}, {1, false}, {1, true}, {3, true}, {2, false}, {0, true}})
    parts.add(static_cast<std::uint32_t>(shape), is_static);
  parts.loose.resize(4), parts.is_static = {0, 1, 0, 7};
  const Input input = parts.input();
  Assembly a;
  a.update(input, parts.is_static.data());
  EXPECT_EQ(a.body_first, (std::vector<std::uint32_t>{0, 200, 203, 203, 203, 204, 404, 407}));
  // Which sphere stands still, by number.
  std::vector<bool> still;
  for (const Body& b : parts.bodies) still.insert(still.end(), parts.assets[b.shape].size(), b.is_static);
  for (const std::uint8_t s : parts.is_static) still.push_back(s != 0);
  std::set<std::uint64_t> seen;
  for (std::size_t k = 0; k < a.elements.size(); k++)
    for (const std::uint64_t number : spheres_of_element(a, a.elements[k])) {
      ASSERT_LT(number, still.size());
      EXPECT_EQ(still[number], k >= a.moving) << "sphere " << number;
      EXPECT_TRUE(seen.insert(number).second) << "sphere " << number << " is in two elements";
    }
  EXPECT_EQ(seen.size(), 411u);
  // Each half goes through bodies, and then loose spheres, in their order.
  for (std::size_t k = 1; k < a.elements.size(); k++) {
    if (k == a.moving) continue;
    const Element &e = a.elements[k - 1], &f = a.elements[k];
    EXPECT_TRUE(e.body < f.body || (e.body == f.body && e.piece < f.piece)) << k;
  }
}

TEST(Assembly, UpdatedToAnotherScene) {
  Parts parts;
  parts.add(0, false), parts.add(0, true);
  parts.loose.resize(2), parts.is_static = {1, 1};
  Assembly a;
  a.update(parts.input(), parts.is_static.data());
  EXPECT_EQ(a.moving, 1u);
  EXPECT_EQ(a.elements.size(), 4u);
  a.update(parts.input(), nullptr);  // nobody says that loose spheres stand still
  EXPECT_EQ(a.moving, 3u);
  parts.bodies[1].is_static = false, parts.loose.clear(), parts.is_static.clear();
  a.update(parts.input(), nullptr);
  EXPECT_EQ(a.moving, 2u);
  EXPECT_EQ(a.elements.size(), 2u);
  parts.bodies.clear();
  a.update(parts.input(), nullptr);
  EXPECT_EQ(a.elements.size(), 0u);
  EXPECT_EQ(a.body_first, (std::vector<std::uint32_t>{0}));
  // A shape that changes where it lies is noticed.
  parts.add(0, false);
  parts.assets[0] = row_of_spheres(130);
  a.update(parts.input(), nullptr);
  EXPECT_EQ(a.body_first.back(), 130u);
  EXPECT_GT(a.elements.size(), 1u);
}

// --- The table of static balls ---

enum class Kind { even, sizes, far_apart, line, one_point };

std::vector<Sphere> balls_of(Kind kind, std::uint32_t n, Random& random) {
  std::vector<Sphere> balls;
  for (std::uint32_t k = 0; k < n; k++) {
    Sphere s{40 * unit(random) - 20, 40 * unit(random) - 20, 40 * unit(random) - 20, 0.2 + unit(random)};
    if (kind == Kind::sizes) s.r = std::exp2(-10 + 14 * std::pow(unit(random), 8));
    if (kind == Kind::far_apart) s.x += 1e9 * (k % 5), s.y -= 3e8 * (k % 3);
    if (kind == Kind::line) s.x *= 1e4, s.y = s.z = 0;
    if (kind == Kind::one_point) s.x = s.y = s.z = 3;
    balls.push_back(s);
  }
  return balls;
}

TEST(StaticTable, EachBallOnceInTheBucketOfItsBin) {
  Random random(1);
  for (const Kind kind : {Kind::even, Kind::sizes, Kind::far_apart, Kind::line, Kind::one_point}) {
    SCOPED_TRACE(static_cast<int>(kind));
    const std::vector<Sphere> all = balls_of(kind, 3000, random);
    StaticTable t;
    ASSERT_TRUE(t.build(all, 77));
    EXPECT_EQ(t.count, 3000u);
    ASSERT_EQ(t.starts.size(), std::uint64_t(t.grid.buckets) + 1);
    EXPECT_EQ(t.starts.front(), 0u);
    EXPECT_EQ(t.starts.back(), 3000u);
    std::set<std::uint32_t> seen;
    for (std::size_t bucket = 0; bucket + 1 < t.starts.size(); bucket++) {
      ASSERT_LE(t.starts[bucket], t.starts[bucket + 1]);
      for (std::uint32_t k = t.starts[bucket]; k < t.starts[bucket + 1]; k++) {
        const Sphere& b = t.balls[k];
        const Level& l = t.grid.level[level_of(t.grid, b)];
        ASSERT_EQ(key_of(l, bin_of(l, b)), bucket);
        ASSERT_TRUE(seen.insert(t.elements[k]).second);
        ASSERT_GE(t.elements[k], 77u);
        const Sphere& given = all[t.elements[k] - 77];
        ASSERT_TRUE(b.x == given.x && b.y == given.y && b.z == given.z && b.r == given.r);
        ASSERT_TRUE(k == t.starts[bucket] || t.elements[k - 1] < t.elements[k]);
      }
    }
    EXPECT_EQ(seen.size(), 3000u);
  }
}

TEST(StaticTable, NoneAndFaulty) {
  StaticTable t;
  ASSERT_TRUE(t.build({}, 5));
  EXPECT_EQ(t.count, 0u);
  EXPECT_EQ(t.starts.back(), 0u);
  for (const Sphere& bad :
       {Sphere{NAN, 0, 0, 1}, Sphere{0, INFINITY, 0, 1}, Sphere{0, 0, 0, -1}, Sphere{0, 0, 0, NAN}}) {
    const std::vector<Sphere> balls{{0, 0, 0, 1}, bad, {1, 0, 0, 1}};
    EXPECT_FALSE(t.build(balls, 0));
  }
  const std::vector<Sphere> good{{0, 0, 0, 1}};
  ASSERT_TRUE(t.build(good, 0)) << "a table may be made again after that";
  EXPECT_EQ(t.count, 1u);
}

// What a search does with the table: over the bins in reach of each level. Every ball that touches is found,
// and none twice.
std::vector<std::uint32_t> met(const StaticTable& t, const Sphere& ball) {
  std::vector<std::uint32_t> found;
  const auto look = [&](std::uint32_t key_from, std::uint32_t key_end, auto meant) {
    for (std::uint32_t k = t.starts[key_from]; k < t.starts[key_end]; k++)
      if (meant(t.balls[k]) && touching(ball, t.balls[k])) found.push_back(t.elements[k]);
  };
  for (int level = 0; level < t.grid.levels; level++) {
    const Level& l = t.grid.level[level];
    BinBox box;
    const std::uint32_t population = t.starts[l.offset + l.buckets] - t.starts[l.offset];
    if (population == 0 || !bins_near(l, t.bounds[level], ball, population, box)) continue;
    if (box.whole) {
      look(l.offset, l.offset + l.buckets, [](const Sphere&) { return true; });
      continue;
    }
    for (std::int64_t z = box.low[2]; z <= box.high[2]; z++)
      for (std::int64_t y = box.low[1]; y <= box.high[1]; y++)
        for (std::int64_t x = box.low[0]; x <= box.high[0]; x++) {
          const std::uint32_t key = key_in_row(l, row_of(l, y, z), x);
          look(key, key + 1, [&](const Sphere& s) { return !l.hashed || in_row(l, s, x, x, y, z); });
        }
  }
  std::sort(found.begin(), found.end());
  return found;
}

TEST(StaticTable, NoBallThatTouchesIsOutOfReach) {
  std::mt19937_64 random = random_of_new_seed();
  int hashed = 0, levels = 0, whole = 0, touched = 0;
  for (const Kind kind : {Kind::even, Kind::sizes, Kind::far_apart, Kind::line, Kind::one_point})
    for (const std::uint32_t n : {1u, 40u, 2000u}) {
      const std::vector<Sphere> all = balls_of(kind, n, random);
      StaticTable t;
      ASSERT_TRUE(t.build(all, 0));
      levels = std::max(levels, t.grid.levels);
      for (int k = 0; k < t.grid.levels; k++) hashed += t.grid.level[k].hashed != 0;
      for (int q = 0; q < 300; q++) {
        // About one of the balls, from well inside to just beside it; small to larger than all.
        const Sphere& near = all[random() % n];
        Sphere ball{near.x, near.y, near.z, near.r * std::exp2(12 * unit(random) - 6)};
        double d[3], length = 0;
        for (double& v : d) v = unit(random) - 0.5, length += v * v;
        double at = (near.r + ball.r) / std::sqrt(length);
        at *= q % 3 == 0 ? unit(random) : 1 + (q % 3 == 1 ? 1e-15 : 1e-3) * (unit(random) - 0.5);
        ball.x += at * d[0], ball.y += at * d[1], ball.z += at * d[2];
        if (q % 50 == 49) ball.r = 1e12;   // holds them all
        if (q % 50 == 48) ball.x = 1e300;  // far beyond all bin numbers
        std::vector<std::uint32_t> wanted;
        for (std::uint32_t k = 0; k < n; k++)
          if (touching(ball, all[k])) wanted.push_back(k);
        touched += !wanted.empty();
        ASSERT_EQ(met(t, ball), wanted) << "kind " << static_cast<int>(kind) << ", ball (" << ball.x << ", "
                                        << ball.y << ", " << ball.z << ") of " << ball.r;
        for (int level = 0; level < t.grid.levels; level++) {
          BinBox box;
          whole += bins_near(t.grid.level[level], t.bounds[level], ball, n, box) && box.whole;
        }
      }
    }
  // The scenes are of the kinds they are meant to be.
  EXPECT_GT(hashed, 0);
  EXPECT_GT(levels, 2);
  EXPECT_GT(whole, 0);
  EXPECT_GT(touched, 1000);
}

}  // namespace
}  // namespace padder::detect
