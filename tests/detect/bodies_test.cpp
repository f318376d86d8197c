// SPDX-License-Identifier: MIT
// Bodies first, and what stands still: against brute force over every placed sphere, the nine stages and the
// path that expands every body. Calls of all kinds one after another, with their records, families and
// faults, are those of model/detector_model_test.cpp.
#include "detect/core/bodies/pieces.h"

#include <random>
#include <set>

#include "detect/scene/generate.h"
#include "tests/detect/oracle.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

std::vector<Sphere> blob(std::uint32_t n, double size, double r_low, double r_high, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> at(-size, size), radius(r_low, r_high);
  std::vector<Sphere> s(n);
  for (Sphere& p : s) p = {at(random), at(random), at(random), radius(random)};
  return s;
}
TestBodies strewn(std::vector<std::vector<Sphere>> assets, std::uint32_t bodies, std::uint32_t loose,
                  double size, std::uint32_t seed) {
  TestBodies s;
  s.assets = std::move(assets);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> at(-size, size), radius(0.05, 0.5);
  for (std::uint32_t b = 0; b < bodies; b++)
    s.bodies.push_back(
        body_at(b % static_cast<std::uint32_t>(s.assets.size()), at(random), at(random), at(random), random));
  for (std::uint32_t k = 0; k < loose; k++)
    s.loose.push_back({at(random), at(random), at(random), radius(random)});
  return s;
}

class BodiesTest : public BackendTest {
 protected:
  BodiesTest() { options_.bodies = Bodies::first; }
  void expect_right(TestBodies& s, const std::string& what) {
    SCOPED_TRACE(what);
    const std::vector<Pair> wanted = oracle(s.input());
    const std::uint64_t hash = hash_of(wanted);
    if (!detector_) detector_ = std::make_unique<Detector>(device_, options_);
    for (const Order order : {Order::stable, Order::any}) {
      detector_->options().order = order;
      const std::vector<Pair> found = sorted(detector_->detect(s.input()).pair_span());
      ASSERT_EQ(found.size(), wanted.size());
      ASSERT_EQ(found, wanted);
      ASSERT_EQ(detector_->hash(), hash);
    }
    CallOptions other = options_;
    other.bodies = Bodies::expanded;
    if (!expanded_) expanded_ = std::make_unique<Detector>(device_, other);
    ASSERT_EQ(expanded_->detect(s.input()).count, wanted.size());
    ASSERT_EQ(expanded_->hash(), hash);
    other.path = Path::nine_stages;
    if (!stages_) stages_ = std::make_unique<Detector>(device_, other);
    ASSERT_EQ(stages_->detect(s.input()).count, wanted.size());
    ASSERT_EQ(stages_->hash(), hash);
  }
  std::unique_ptr<Detector> detector_, expanded_, stages_;
};

TEST_P(BodiesTest, NoneAndEmptyAndOne) {
  TestBodies s;
  expect_right(s, "nothing");
  s.assets = {{}, {{0, 0, 0, 1}}};
  expect_right(s, "shapes only");
  std::mt19937_64 random(1);
  s.bodies = {body_at(0, 0, 0, 0, random)};
  expect_right(s, "a body of no spheres");
  s.bodies.push_back(body_at(1, 0, 0, 0, random));
  expect_right(s, "one sphere");
  s.bodies.push_back(body_at(1, 2, 0, 0, random));
  expect_right(s, "two, exactly touching");
  s.loose = {{0, 2, 0, 1}};
  expect_right(s, "and a loose one");
}

TEST_P(BodiesTest, PilesOfAllKinds) {
  auto seed = static_cast<std::uint32_t>(random_of_new_seed()());
  const auto one = blob(1, 0.3, 0.2, 1, 1), few = blob(7, 1, 0.1, 0.6, 2), piece = blob(64, 1, 0.1, 0.3, 3),
             more = blob(65, 1, 0.1, 0.3, 4), many = blob(300, 2, 0.05, 0.2, 5);
  for (const double size : {1.0, 4.0, 12.0})
    for (const std::uint32_t loose : {0u, 150u})
      for (int kind = 0; kind < 5; kind++) {
        const std::vector<std::vector<std::vector<Sphere>>> kinds{
            {one}, {few}, {piece}, {more, one}, {many, few, one}};
        TestBodies s = strewn(kinds[static_cast<std::size_t>(kind)],
                              kind == 4   ? 12
                              : kind == 0 ? 150
                                          : 30,
                              loose, size, ++seed);
        for (std::size_t b = 0; b < s.bodies.size(); b++) s.bodies[b].family = b % 3 ? 0 : 33 + b % 5;
        expect_right(s, "kind " + std::to_string(kind) + " size " + std::to_string(size) + " loose " +
                            std::to_string(loose) + " seed " + std::to_string(seed));
        if (HasFatalFailure()) return;
      }
}

TEST_P(BodiesTest, NestedAndCoinciding) {
  TestBodies s = strewn({blob(300, 3, 0.1, 0.4, 1), blob(20, 0.5, 0.05, 0.2, 2)}, 12, 50, 1, 3);
  for (Body& b : s.bodies) b.position[0] = b.position[1] = b.position[2] = 0;
  expect_right(s, "all about one point");
  for (Body& b : s.bodies) std::copy_n(s.bodies[0].rotation, 9, b.rotation);
  expect_right(s, "in one pose");
}

// A ground of thousands of spheres under small things, and a pebble of 1e-6 of its size.
TEST_P(BodiesTest, HugeBesideTiny) {
  std::vector<Sphere> ground;
  for (int y = 0; y < 40; y++)
    for (int x = 0; x < 40; x++) ground.push_back({x - 20.0, y - 20.0, std::sin(0.3 * x), 0.8});
  TestBodies s = strewn({blob(20, 0.3, 0.05, 0.2, 1)}, 60, 100, 1, 5);
  s.assets.push_back(ground);
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> at(-20, 20);
  for (Body& b : s.bodies) b.position[0] = at(random), b.position[1] = at(random);
  s.bodies.push_back({});
  s.bodies.back().shape = 1, s.bodies.back().position[2] = -0.7;
  s.assets.push_back({{0, 0, 0, 1e-6}, {1e-6, 0, 0, 1e-6}});
  for (int k = 0; k < 20; k++) s.bodies.push_back(body_at(2, at(random), at(random), 0, random));
  s.assets.push_back({{0, 0, -1e6, 1e6 - 3}});
  s.bodies.push_back(body_at(3, 0, 0, 0, random));
  for (double& r : s.bodies.back().rotation) r = 0;  // any matrix at all
  s.bodies.back().rotation[0] = s.bodies.back().rotation[4] = s.bodies.back().rotation[8] = 1;
  expect_right(s, "a ground");
}

TEST_P(BodiesTest, FarTinyAndHuge) {
  for (const double far : {1e7, 1e12}) {
    TestBodies s = strewn({blob(64, 1, 0.1, 0.3, 3)}, 20, 50, 2, 6);
    s.shift(far);
    expect_right(s, "at " + std::to_string(far));
  }
  for (const double scale : {1e-320, 1e-310, 1e-300, 1e-200, 1e-160, 1e-150, 1e-40, 1e40, 1e90, 1e97}) {
    TestBodies s = strewn({blob(64, 1, 0.1, 0.3, 3), blob(1, 0, 0, 0, 1)}, 20, 60, 1.5, 7);
    s.scale(scale);
    if (scale > 1) {
      options_.width = Width::pairs;
      detector_.reset(), expanded_.reset(), stages_.reset();
    }
    expect_right(s, "scaled by " + std::to_string(scale));
    for (std::size_t b = 0; b < s.bodies.size(); b++) s.bodies[b].is_static = b % 3 == 0;
    for (std::size_t k = 0; k < s.loose.size(); k++) s.is_static.push_back(k % 4 == 0);
    expect_right(s, "scaled by " + std::to_string(scale) + ", some static");
    if (HasFatalFailure()) return;
  }
}

// Shapes whose spheres lie far from the shape's own origin, and matrices that are no rotations: the balls
// must still be generous enough.
TEST_P(BodiesTest, OddFramesAndMatrices) {
  TestBodies s = strewn({blob(100, 1, 0.1, 0.3, 3)}, 25, 50, 2, 8);
  for (Sphere& p : s.assets[0]) p.x += 1e5, p.z -= 1e5;
  for (Body& b : s.bodies) {
    const Sphere at = placed(b, {1e5, 0, -1e5, 0});
    b.position[0] -= at.x - b.position[0], b.position[1] -= at.y - b.position[1];
    b.position[2] -= at.z - b.position[2];
  }
  expect_right(s, "an asset far from its origin");
  TestBodies t = strewn({blob(100, 1, 0.1, 0.3, 3)}, 25, 50, 3, 9);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> any(-1.5, 1.5);
  for (Body& b : t.bodies)
    for (double& m : b.rotation) m = any(random);
  expect_right(t, "any matrices");
  for (Body& b : t.bodies)
    for (double& m : b.rotation) m = 0;
  expect_right(t, "matrices of zeros");
}

// Spheres put on the threshold, as near as rounding lets them be: at the rims of both bodies' balls.
TEST_P(BodiesTest, TouchingAtTheRim) {
  std::mt19937_64 random(10);
  std::normal_distribution<double> normal;
  for (const double far : {0.0, 1e3, 1e6}) {
    TestBodies s;
    s.assets = {{{0, 0, 0, 1}}, {{0.1, 0.2, 0.3, 0.5}, {0.3, 0.2, 0.1, 0.25}}};
    for (int k = 0; k < 150; k++) {
      Body a = body_at(k % 2, 7.0 * (k % 12), 7.0 * (k / 12), 0, random), b = body_at(0, 0, 0, 0, random);
      const Sphere at = placed(a, s.assets[a.shape][0]);
      double d[3], length = 0;
      for (double& v : d) v = normal(random), length += v * v;
      const double t = (at.r + 1) * (1 + 1e-15 * normal(random)) / std::sqrt(length);
      b.position[0] = at.x + t * d[0], b.position[1] = at.y + t * d[1], b.position[2] = at.z + t * d[2];
      s.bodies.push_back(a), s.bodies.push_back(b);
    }
    s.shift(far);
    expect_right(s, "at " + std::to_string(far));
  }
}

// The boxes of long pieces tell more pairs apart than their balls: not those within the margin.
TEST_P(BodiesTest, AMarginReachesFromLongPieceToLongPiece) {
  std::vector<Sphere> rod;
  for (int k = 0; k < 16; k++) rod.push_back({0.15 * k, 0, 0, 0.1});
  const TestBodies s = strewn({rod}, 300, 0, 4, 11);
  for (const double margin : {0.05, 0.3}) {
    options_.margin = margin;
    Detector detector(device_, options_);
    const std::vector<Pair> wanted = oracle(s.input(), options_);
    EXPECT_GT(wanted.size(), oracle(s.input()).size());
    EXPECT_EQ(sorted(detector.detect(s.input()).pair_span()), wanted) << margin;
  }
}

// The place where a revision began, or how many balls touched in the calls since, does not decide in which
// order the list is. Of the rods and the small bodies too many touch where they are crowded: they are counted
// there, or estimated where there are more elements.
TEST_P(BodiesTest, TheListDoesNotDependOnThePosesOfOtherCalls) {
  std::vector<Sphere> rod;
  for (int k = 0; k < 100; k++) rod.push_back({k - 50.0, 0, 0, 0.6});
  for (TestBodies crowded :
       {strewn({rod}, 3000, 0, 60, 15), strewn({rod}, 4000, 0, 60, 15),
        strewn({{{0, 0, 0, 0.6}, {0.5, 0, 0, 0.6}, {0, 0.5, 0, 0.6}}}, 10'000, 0, 12, 16)}) {
    TestBodies wide = crowded;
    for (Body& b : wide.bodies)
      for (double& p : b.position) p *= 20;
    std::vector<std::uint32_t> all(wide.bodies.size());
    std::iota(all.begin(), all.end(), 0u);
    CallOptions automatic = options_;
    automatic.bodies = Bodies::automatic;
    for (const std::uint64_t revision : {0, 1}) {
      Detector used(device_, automatic);
      for (const bool is_wide : {false, true, true, true, false, false, true}) {
        Input input = (is_wide ? wide : crowded).input();
        input.revision = revision, input.moved = all;
        Detector fresh(device_, automatic);
        const Contacts &a = used.detect(input), &b = fresh.detect(input);
        ASSERT_EQ(a.count, b.count);
        EXPECT_TRUE(std::equal(a.pairs, a.pairs + a.count, b.pairs)) << is_wide << ", " << revision;
      }
    }
  }
}

// In any order, calls of one scene try now and then whether the way that was not chosen is faster
// (WayChoice). Poses that change meanwhile are seen by either.
TEST_P(BodiesTest, TriesOfTheOtherWayFindTheSame) {
  if (device_.backend == BackendKind::omp) GTEST_SKIP() << "goes by the costs alone";
  std::mt19937_64 random = random_of_new_seed();
  for (const std::uint64_t revision : {0, 1}) {
    TestBodies s = strewn({blob(40, 1.5, 0.2, 0.4, 3), blob(8, 1, 0.2, 0.4, 4)}, 600, 300, 14, 15);
    for (std::size_t b = 0; b < 100; b++) s.bodies[b].is_static = true;
    CallOptions options = options_;
    options.bodies = Bodies::automatic, options.order = Order::any;
    Detector used(device_, options);
    options.bodies = Bodies::expanded;
    Detector expanded(device_, options);
    for (int call = 0; call < 230; call++) {
      std::vector<std::uint32_t> moved;
      for (int k = 0; k < 20; k++) moved.push_back(100 + static_cast<std::uint32_t>(random() % 500));
      if (call == 0) moved.clear();
      for (const std::uint32_t b : moved)
        for (double& p : s.bodies[b].position) p = 14 * (2 * unit(random) - 1);
      for (Sphere& p : s.loose) p.x += 0.1 * (unit(random) - 0.5);
      Input in = s.input();
      in.revision = revision, in.moved = moved;
      ASSERT_EQ(used.detect(in).count, expanded.detect(s.input()).count) << call;
      ASSERT_EQ(used.hash(), expanded.hash()) << "call " << call << ", revision " << revision;
    }
  }
}

// Every body meets every other one: the list of bodies that meet is longer than anyone would guess.
TEST_P(BodiesTest, ManyInOnePlace) {
  TestBodies s = strewn({{{0, 0, 0, 0.1}, {2, 0, 0, 0.1}}}, 300, 300, 0.3, 18);
  expect_right(s, "all within reach");
}

TEST_P(BodiesTest, MemoryIsKeptAndShortageIsASentence) {
  TestBodies s = strewn({blob(100, 1, 0.1, 0.3, 3)}, 40, 50, 1.5, 19);
  options_.threads = 1;
  Detector d(device_, options_);
  const std::uint64_t contacts = d.detect(s.input()).count, held = d.memory();
  EXPECT_GT(held, 0u);
  d.detect(s.input());
  EXPECT_EQ(d.memory(), held);
  Detector narrow(device_, options_);
  narrow.options().memory_limit = held / 3;
  EXPECT_TRUE(refuses([&] { narrow.detect(s.input()); }, " bytes of "));
  narrow.options().memory_limit = 0;
  EXPECT_EQ(narrow.detect(s.input()).count, contacts);
}

// No two spheres touch, so that there is nothing but pairs of bodies to make room for.
TEST_P(BodiesTest, ShortageOfPairsIsNotCalledOneOfContacts) {
  if (GetParam() != BackendKind::omp) GTEST_SKIP() << "the lists of the CPU";
  options_.threads = 1;
  std::set<std::string> words;
  for (const int one_in : {2, 1000}) {
    TestBodies s = strewn({{{-1, 0, 0, 1e-6}, {1, 0, 0, 1e-6}}}, 1000, 0, 0.3, 23);
    for (std::size_t b = 0; b < s.bodies.size(); b++) s.bodies[b].is_static = b % one_in == 1;
    Detector d(device_, options_);
    ASSERT_EQ(d.detect(s.input()).count, 0u);
    for (std::uint64_t limit = d.memory(); limit > 4096; limit -= limit / 8) {
      Detector narrow(device_, options_);
      narrow.options().memory_limit = limit;
      const std::string said = error_of([&] { narrow.detect(s.input()); });
      EXPECT_EQ(said.find("contacts"), said.npos) << said;
      const std::size_t at = said.find("pairs of");
      if (at != said.npos) words.insert(said.substr(at, said.find(',', at) - at));
    }
  }
  EXPECT_EQ(words, std::set<std::string>{"pairs of bodies that may touch"});
}

// ---- what stands still

// Few and far: the table of the static ones is hashed, or has bins without end.
TEST_P(BodiesTest, StaticOnesStrewnThinly) {
  TestBodies s = strewn({blob(5, 1, 0.1, 0.3, 3)}, 300, 300, 3e4, 14);
  for (std::size_t b = 0; b < 300; b++) s.bodies[b].is_static = b % 2;
  for (std::size_t b = 1; b < 300; b += 2)
    for (int c = 0; c < 3; c++) s.bodies[b - 1].position[c] = s.bodies[b].position[c] + 0.5;
  s.bodies[10].position[0] = 1e18, s.bodies[11].position[0] = 1e18, s.bodies[13].position[1] = -1e25;
  for (std::size_t k = 0; k < 300; k++) s.is_static.push_back(k % 2);
  expect_right(s, "thin");
  s.loose[0].r = 1e5;
  expect_right(s, "one that covers it all");
  s.loose[1].r = 1e5;
  expect_right(s, "a static one that covers it all");
}

// The level of the large ones, which the few small ones search, is hashed, and has so few bins along each
// axis that a search ends at the last. A level like that must not be kept for spheres that have left it.
TEST_P(BodiesTest, LooseOnesLeaveTheirLevelUnderOneRevision) {
  constexpr std::size_t kMany = 8000;  // more than are tried each against each
  TestBodies s = strewn({blob(2, 1, 0.1, 0.3, 3)}, 1, kMany, 1, 18);
  std::mt19937_64 random(19);
  std::uniform_real_distribution<double> at(0, 110);
  const auto place = [&](double from) {
    for (std::size_t k = 0; k < kMany; k++)
      s.loose[k] = {from + at(random), from + at(random), from + at(random), k % 4 == 0 ? 0.25 : 1};
  };
  options_.order = Order::any;
  Detector d(device_, options_);
  for (const double from : {0, 0, -110, -55, 0}) {
    place(from);
    Input in = s.input();
    in.revision = 7;
    ASSERT_EQ(sorted(d.detect(in).pair_span()), oracle(s.input())) << "from " << from;
  }
}

ON_EVERY_BACKEND(BodiesTest);

// ---- pieces

TEST(Pieces, HoldEverySphereOnceAndItsBallHoldsThem) {
  const auto a = blob(1000, 3, 0.1, 0.5, 1), b = blob(64, 1, 0, 0, 2), c = blob(65, 1, 0, 1, 3);
  const Shape shapes[] = {{a.data(), a.size()}, {b.data(), b.size()}, {nullptr, 0}, {c.data(), c.size()}};
  Pieces p;
  EXPECT_TRUE(p.update(shapes));
  EXPECT_FALSE(p.update(shapes));
  ASSERT_EQ(p.shape_first.size(), 5u);
  for (int shape = 0; shape < 4; shape++) {
    std::vector<int> seen(shapes[shape].count, 0);
    for (std::uint32_t k = p.shape_first[shape]; k < p.shape_first[shape + 1]; k++) {
      const Piece& piece = p.pieces[k];
      ASSERT_GE(piece.count, 1u);
      ASSERT_LE(piece.count, kPieceSpheres);
      for (std::uint32_t s = piece.first; s < piece.first + piece.count; s++) {
        seen[p.numbers[s]]++;
        const Sphere &in = p.spheres[s], &given = shapes[shape].spheres[p.numbers[s]];
        EXPECT_EQ(in.x, given.x);
        EXPECT_LE(std::hypot(in.x - piece.ball.x, in.y - piece.ball.y, in.z - piece.ball.z) + in.r,
                  piece.ball.r * (1 + 1e-15));
      }
    }
    for (const int n : seen) EXPECT_EQ(n, 1);
    EXPECT_EQ(p.shape_first[shape + 1] - p.shape_first[shape],
              (shapes[shape].count + kPieceSpheres - 1) / kPieceSpheres);
  }
}

// The ball about the 64 unit spheres of a shell of radius 3 is that of radius 4, or a little less.
TEST(Pieces, TheBallIsSmall) {
  const BodyScene scene = generate_bodies(1);
  const Shape shape[] = {{scene.shape.data(), scene.shape.size()}};
  Pieces p;
  p.update(shape);
  ASSERT_EQ(p.pieces.size(), 1u);
  EXPECT_LE(p.pieces[0].ball.r, 4.0001);
  EXPECT_GE(p.pieces[0].ball.r, 3.9);
}

}  // namespace
}  // namespace padder::detect
