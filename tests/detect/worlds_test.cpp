// SPDX-License-Identifier: MIT
// Worlds and margins, on every backend and path, beside an oracle that tests every pair.

#include <array>

#include "detect/core/input.h"
#include "detect/core/nine_stages.h"
#include "detect/core/world_tree.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"
#include "tests/detect/world_answers.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

class Worlds : public BackendTest {};
class Margin : public BackendTest {};

// Worlds that stand at the same place: bodies of a few shapes, loose spheres, and some of all worlds.
TestBodies random_worlds(std::uint64_t seed, std::uint32_t worlds, std::uint32_t bodies,
                         std::uint32_t loose) {
  std::mt19937_64 random(seed);
  const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
  const auto world = [&]() -> std::uint32_t {
    const std::uint32_t w = below(worlds + 1);
    return w == worlds ? kEveryWorld : w;
  };
  TestBodies w;
  w.assets.resize(3);
  for (std::size_t k = 0; k < 3; k++)
    for (std::uint32_t q = 0; q < (k == 2 ? 150 : 20 * k + 1); q++)
      w.assets[k].push_back({unit(random), unit(random), unit(random), 0.02 + 0.2 * unit(random)});
  const double edge = 4;
  for (std::uint32_t k = 0; k < bodies; k++) {
    Body b;
    turn(random, b);
    for (double& c : b.position) c = edge * unit(random);
    b.shape = below(3), b.family = below(4) ? 0 : 1 + below(4), b.mask = below(4) ? 0 : below(16);
    b.is_static = below(5) == 0, b.world = world();
    w.bodies.push_back(b);
  }
  for (std::uint32_t k = 0; k < loose; k++) {
    w.loose.push_back({edge * unit(random), edge * unit(random), edge * unit(random), 0.3 * unit(random)});
    w.family.push_back(below(4) ? 0 : 1 + below(4)), w.mask.push_back(below(4) ? 0 : below(16));
    w.is_static.push_back(below(5) == 0), w.world.push_back(world());
  }
  return w;
}

// What detect_worlds() has to say; `host`: the same input in host memory.
void expect_answers(Detector& detector, const Input& in, std::uint32_t worlds, const Input& host) {
  const std::vector<Pair> contacts = oracle(host, detector.options());
  try {
    for (const Answer asked : {Answer::any, Answer::count, Answer::distance})
      check_answers(detector.detect_worlds(in, worlds, asked), asked, worlds, seen(host), contacts);
  } catch (const Wrong& wrong) {
    ADD_FAILURE() << wrong.what;
  }
}
void expect_answers(Detector& detector, const Input& in, std::uint32_t worlds) {
  expect_answers(detector, in, worlds, in);
}

TEST_P(Worlds, ContactsAreThoseOfTheOracleOnEveryPath) {
  int without_contacts = 0;
  SomeCases some;
  for (std::uint64_t seed = 1; seed <= 30; seed++) {
    if (some.left_out()) continue;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto worlds = static_cast<std::uint32_t>(1 + seed % 7);
    const TestBodies w = random_worlds(seed, worlds, static_cast<std::uint32_t>(2 + seed % 5 * 5),
                                       static_cast<std::uint32_t>(seed % 4 * 60));
    CallOptions o{.margin = seed % 3 == 0 ? 0 : 0.01 * static_cast<double>(seed)};
    if (seed % 5 == 0) o.own.low[0] = 1, o.own.high[1] = 3;
    if (seed % 5 == 1) o.own.low[0] = 1.9, o.own.high[0] = 2, o.margin = 1;  // wider than the region
    const std::vector<Pair> expected = oracle(w.input(), o);
    without_contacts += expected.empty();  // as of two bodies, and a box that owns none of their contacts
    for (const Path path : {Path::grid, Path::nine_stages}) {
      o.path = path;
      Detector detector(device_, o);
      EXPECT_EQ(sorted(detector.detect(w.input()).pair_span()), expected);
      if (path == Path::grid) expect_answers(detector, w.input(), worlds);
    }
  }
  EXPECT_LE(without_contacts, 3);
}

// One world and kEveryWorld keep nothing apart, so the scene is searched like one without worlds.
TEST_P(Worlds, OneWorldWithWhatIsInEveryWorldIsSearchedAsOne) {
  TestBodies w = random_worlds(7, 1, 60, 500);
  for (Body& b : w.bodies) b.world = b.world == 0 ? 7 : b.world;
  for (std::uint32_t& world : w.world) world = world == 0 ? 7 : world;
  const auto apart = [](const Input& input) { return has_worlds(tally_of(input), input); };
  EXPECT_FALSE(apart(w.input()));
  Detector detector(device_);
  EXPECT_EQ(sorted(detector.detect(w.input()).pair_span()), oracle(w.input(), {}));
  w.world[3] = 8;
  EXPECT_TRUE(apart(w.input()));
  Input loose = w.input();
  loose.bodies = {}, loose.spheres.count = 3;
  EXPECT_FALSE(apart(loose));
}

// Of a few bodies and loose spheres, in one, two or all worlds: what a pass over them tells is what a look at
// each pair tells.
TEST(BodyTally, IsWhatALookAtEachPairTells) {
  std::mt19937_64 random = random_of_new_seed();
  const auto below = [&](std::uint64_t n) { return static_cast<std::uint32_t>(random() % n); };
  const std::uint32_t worlds[] = {0, 5, kEveryWorld};
  const std::vector<Sphere> spheres(7);
  for (int k = 0; k < 2000; k++) {
    const std::vector<Shape> shapes{{spheres.data(), 3}, {nullptr, 0}, {spheres.data(), 7}};
    std::vector<Body> bodies(below(5));
    std::vector<std::uint32_t> world_of(below(4)), of_all;
    std::uint64_t count = world_of.size(), of_shape[3] = {}, moving_of_shape[3] = {};
    bool have_worlds = false;
    const std::uint32_t kinds = 1 + below(3);
    for (Body& b : bodies) {
      b.shape = below(3), b.world = worlds[below(kinds)], b.is_static = below(2);
      count += shapes[b.shape].count, of_shape[b.shape]++, moving_of_shape[b.shape] += !b.is_static;
      have_worlds = have_worlds || b.world != 0, of_all.push_back(b.world);
    }
    for (std::uint32_t& w : world_of) w = worlds[below(kinds)], of_all.push_back(w);
    bool apart = false;
    for (const std::uint32_t a : of_all)
      for (const std::uint32_t b : of_all) apart = apart || !worlds_meet(a, b);
    Input input;
    input.shapes = shapes, input.bodies = bodies;
    input.spheres.count = world_of.size(), input.spheres.world = world_of.data();
    const BodyTally tally = tally_of(input);
    EXPECT_EQ(sphere_count(input), count);
    EXPECT_EQ(has_worlds(tally, input), apart);
    EXPECT_EQ(tally.have_worlds, have_worlds);
    EXPECT_TRUE(std::ranges::equal(tally.of_shape, of_shape));
    EXPECT_TRUE(std::ranges::equal(tally.moving_of_shape, moving_of_shape));
    EXPECT_EQ(tally.moving, moving_of_shape[0] + moving_of_shape[1] + moving_of_shape[2]);
  }
}

TEST_P(Worlds, LooseSpheresInManyWorldsAndInOneAreFound) {
  SomeCases some;
  for (const std::uint32_t worlds : {1u, 3u, 500u})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
      if (some.left_out()) continue;
      TestScene scene = random_scene(3000, 20, 1.5, 7 + worlds).rounded();
      scene.spheres[17].x = 1e7;  // one that escaped
      Arranged arranged(scene, scalar);
      std::vector<std::uint32_t> world;
      std::mt19937 random(worlds);
      for (std::size_t k = 0; k < scene.spheres.size(); k++)
        world.push_back(random() % 50 ? static_cast<std::uint32_t>(random() % worlds) : kEveryWorld);
      arranged.input.spheres.world = world.data();
      CallOptions o{.margin = 0.1};
      Detector detector(device_, o);
      EXPECT_EQ(sorted(detector.detect(arranged.input).pair_span()), oracle(arranged.input, o));
      expect_answers(detector, arranged.input, worlds);
    }
}

// Loose spheres alone, at one place or far from the origin, of equal and unequal radii, none, some or all of
// them of every world; numbers of worlds that have gaps, or that leave most numbers out. One detector sees
// all of it, and spheres that move.
TEST_P(Worlds, LooseSpheresOfWorldsAtOnePlace) {
  CallOptions o;
  Detector detector(device_, o);
  SomeCases some;
  std::mt19937_64 random(9);
  for (const std::uint32_t worlds : {1u, 2u, 37u, 700u, 1u << 20})
    for (const double ratio : {1.0, 3.0, 200.0})
      for (const double far : {0.0, 1e5}) {
        if (some.left_out()) continue;
        TestScene scene = random_scene(1400, ratio, 1 + static_cast<double>(random() % 5), random());
        std::vector<std::uint32_t> world;
        const std::uint64_t every = std::array{0, 0, 1, 20, 50, 100}[random() % 6];  // of a hundred
        for (Sphere& s : scene.spheres) {
          s.x += far, s.y -= 3 * far;
          world.push_back(static_cast<std::uint32_t>(7 + random() % worlds * (random() % 2 ? 1 : 2)));
          if (random() % 100 < every) world.back() = kEveryWorld;
        }
        for (int call = 0; call < 4; call++) {
          SCOPED_TRACE(std::to_string(worlds) + " worlds, ratio " + std::to_string(ratio) + " at " +
                       std::to_string(far) + ", " + std::to_string(every) + " % of every world, call " +
                       std::to_string(call));
          for (Sphere& s : scene.spheres) s.z += call * 0.3 * s.r;
          if (call == 3) scene.spheres[5].z += 40;
          const Scalar scalar = call == 2 ? Scalar::f64 : Scalar::f32;
          if (scalar == Scalar::f32) scene = scene.rounded();
          Arranged arranged(scene, scalar);
          if (call != 1) arranged.input.spheres.family = arranged.input.spheres.mask = nullptr;
          arranged.input.spheres.world = world.data();
          o.margin = call == 3 ? 0.2 : 0, o.order = call % 2 ? Order::any : Order::stable;
          o.scalar = call == 2 ? Scalar::f64 : Scalar::f32;
          detector.options() = o;
          const Contacts& c = detector.detect(arranged.input);
          ASSERT_EQ(sorted(c.pair_span()), oracle(arranged.input, o));
          const std::vector<Seen> all = seen(arranged.input);
          for (std::uint64_t k = 0; k < c.count && call == 2; k++)
            ASSERT_EQ(c.normal_span<double>()[k].depth,
                      geometry(all[c.pairs[k].i].sphere, all[c.pairs[k].j].sphere).depth);
          if (o.order != Order::stable) continue;
          Detector fresh(device_, o);
          const Contacts& f = fresh.detect(arranged.input);
          EXPECT_TRUE(std::equal(c.pairs, c.pairs + c.count, f.pair_span().begin(), f.pair_span().end()));
        }
      }
}

// Long rods come near much and touch little. The tree gives up, and spheres are searched side by side.
TEST_P(Worlds, RodsAmongSpheresGiveTheSameHoweverTheyAreSearched) {
  for (const std::uint32_t worlds : {1u, 2u, 50u}) {
    SCOPED_TRACE(std::to_string(worlds) + " worlds");
    std::mt19937_64 random(worlds);
    const auto world = [&] {
      return random() % 20 ? static_cast<std::uint32_t>(random() % worlds) : kEveryWorld;
    };
    TestBodies w;
    w.assets.resize(1);
    for (int k = -50; k < 50; k++) w.assets[0].push_back({static_cast<double>(k), 0, 0, 0.45});
    w.bodies.resize(60);
    for (Body& b : w.bodies) {
      turn(random, b), b.world = world();
      for (double& c : b.position) c = 40 * unit(random);
    }
    for (int k = 0; k < 40; k++) {
      w.loose.push_back({40 * unit(random), 40 * unit(random), 40 * unit(random), 2 * unit(random)});
      w.is_static.push_back(k % 3 == 0), w.world.push_back(world());
    }
    for (const double margin : {0.0, 0.3}) {
      Detector detector(device_, {.margin = margin});
      const std::vector<Pair> expected = oracle(w.input(), detector.options());
      for (const Bodies bodies : {Bodies::automatic, Bodies::first, Bodies::expanded})
        for (const Order order : {Order::stable, Order::any}) {
          detector.options().bodies = bodies, detector.options().order = order;
          EXPECT_EQ(sorted(detector.detect(w.input()).pair_span()), expected);
        }
      detector.options().precision = Precision::float32;  // of lists; answers are exact
      expect_answers(detector, w.input(), worlds);
    }
  }
}

// Radii that are all one or differ, near the origin and so far that doubles are rounded to floats, or become
// fixed point; and a lattice whose gaps are the margin, as far as doubles can say.
TEST_P(Worlds, AMarginOfEqualAndUnequalSpheresNearAndFar) {
  std::uint32_t seed = 100;
  for (const double ratio : {1.0, 4.0, 100.0})
    for (const double far : {0.0, 3e3, 5e4, 1e9})
      for (const bool lattice : {false, true}) {
        if (lattice && ratio != 1) continue;
        TestScene scene = random_scene(400, ratio, 2, seed++);
        for (std::size_t k = 0; k < scene.spheres.size(); k++) {
          Sphere& s = scene.spheres[k];
          if (lattice) {
            const std::size_t x = k % 8, y = k / 8 % 8, z = k / 64;
            s = {2.25 * static_cast<double>(x), 2.25 * static_cast<double>(y), 2.25 * static_cast<double>(z),
                 1};
          }
          s.x += far, s.y -= far, s.z += far / 3;
        }
        for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
          const Arranged arranged(scene, scalar);
          CallOptions o;
          Detector detector(device_, o);
          for (const double margin : {0.25, 0.25, 1e-9, 0.0, 0.25 * (1 - 0x1p-50), 3.0, 9.0}) {
            SCOPED_TRACE("ratio " + std::to_string(ratio) + " at " + std::to_string(far) + " margin " +
                         std::to_string(margin) + (lattice ? " lattice" : "") +
                         (scalar == Scalar::f64 ? " double" : ""));
            o.margin = margin, detector.options() = o;
            ASSERT_EQ(sorted(detector.detect(arranged.input).pair_span()), oracle(arranged.input, o));
            o.order = o.order == Order::any ? Order::stable : Order::any;
          }
        }
      }
}

// Bodies of one world: searched first, expanded, in a revision in which the margin changes, and moved.
TEST_P(Worlds, AMarginHoldsHoweverBodiesAreSearched) {
  for (const Bodies bodies : {Bodies::first, Bodies::expanded, Bodies::automatic})
    for (const double scale : {1.0, 1e-150, 1e60}) {
      TestBodies w = random_worlds(17, 1, 16, 60);
      w.world.clear();
      for (Body& b : w.bodies) b.world = 0;
      w.scale(scale);
      std::mt19937_64 random(3);
      Detector detector(device_, {.width = Width::pairs, .bodies = bodies});
      std::uint32_t step = 0;
      for (const double margin : {0.0, 0.2, 0.2, 1e-9, 0.0, 6.0, 0.2, 0.2}) {
        SCOPED_TRACE("step " + std::to_string(step) + ", scale " + std::to_string(scale));
        CallOptions& now = detector.options();
        now.margin = margin * scale, now.order = step % 2 ? Order::any : Order::stable, now.own = {};
        if (step % 3 == 1) now.own.low[0] = scale, now.own.high[1] = 3 * scale;
        const std::vector<std::uint32_t> moved{step, step + 7};
        for (const std::uint32_t b : moved)
          if (!w.bodies[b].is_static) turn(random, w.bodies[b]), w.bodies[b].position[1] += 0.1 * scale;
        Input in = w.input();
        in.revision = step < 5 ? 1 : 0, in.moved = moved;
        EXPECT_EQ(sorted(detector.detect(in).pair_span()), oracle(in, now));
        step++;
      }
    }
}

TEST_P(Worlds, IdsMayBeAny32BitNumbersAndAnArrayOrOneForAll) {
  const double centers[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, radius = 1;
  const std::uint32_t world[] = {4000000000u, 5, 4000000000u, kEveryWorld};
  for (const Path path : {Path::grid, Path::nine_stages}) {
    Detector detector(device_, {.path = path});
    Input in;
    in.spheres = spheres_of<double>(4, centers, &radius);
    in.spheres.radius_stride = 0, in.spheres.world = world;
    EXPECT_EQ(sorted(detector.detect(in).pair_span()), (std::vector<Pair>{{0, 2}, {0, 3}, {1, 3}, {2, 3}}));
    in.spheres.world = nullptr;
    for (const std::uint32_t all : {0u, 9u, kEveryWorld}) {
      in.spheres.world_of_all = all;
      EXPECT_EQ(detector.detect(in).count, 6u);
    }
  }
}

TEST_P(Worlds, TheListIsTheSameForAnyNumberOfThreadsAndAgain) {
  const TestBodies w = random_worlds(3, 6, 40, 300);
  std::vector<Pair> first;
  std::vector<float> depth;
  for (const int threads : {1, 2, 5, 1}) {
    Detector detector(device_, {.threads = threads, .margin = 0.1});
    for (int again = 0; again < 2; again++) {
      const Contacts& c = detector.detect(w.input());
      std::vector<float> d;
      for (const auto& n : c.normal_span<float>()) d.push_back(n.depth);
      if (first.empty()) first.assign(c.pair_span().begin(), c.pair_span().end()), depth = d;
      EXPECT_TRUE(std::equal(first.begin(), first.end(), c.pair_span().begin(), c.pair_span().end()));
      EXPECT_EQ(d, depth);
    }
  }
}

using WorldsOnAGpu = GpuTest;
TEST_F(WorldsOnAGpu, PosesSpheresAndAnswersMayLieOnTheDevice) {
  for (const std::uint64_t revision : {0, 4}) {
    TestBodies w = random_worlds(41, 9, 40, 200);
    CallOptions o;
    o.margin = 0.05, o.output = Memory::device;
    Detector detector({BackendKind::cuda}, o);
    const std::size_t n = w.loose.size();
    const DeviceCopy spheres(w.loose.data(), n * sizeof(Sphere)), family(w.family.data(), 4 * n),
        mask(w.mask.data(), 4 * n), world(w.world.data(), 4 * n), is_static(w.is_static.data(), n);
    Input in = w.input();
    in.spheres.centers = spheres.data(), in.spheres.radii = static_cast<const double*>(spheres.data()) + 3;
    in.spheres.family = static_cast<const std::uint32_t*>(family.data());
    in.spheres.mask = static_cast<const std::uint32_t*>(mask.data());
    in.spheres.world = static_cast<const std::uint32_t*>(world.data());
    in.spheres.is_static = static_cast<const std::uint8_t*>(is_static.data());
    in.spheres.memory = Memory::device, in.revision = revision, in.pose_memory = Memory::device;
    std::mt19937_64 random(6);
    for (int step = 0; step < 3; step++) {
      std::vector<Pose> poses(w.bodies.size());
      for (std::size_t b = 0; b < poses.size(); b++) {
        if (step > 0 && !w.bodies[b].is_static) turn(random, w.bodies[b]);
        poses[b] = pose_of(w.bodies[b]);
      }
      const DeviceCopy there(poses.data(), poses.size() * sizeof(Pose));
      in.poses = static_cast<const Pose*>(there.data());
      const Contacts& c = detector.detect(in);
      std::vector<Pair> pairs(c.count);
      copy_from_device(pairs.data(), c.pairs, c.count * sizeof(Pair));
      EXPECT_EQ(sorted(pairs), oracle(w.input(), o));
      EXPECT_EQ(detector.detect_worlds(in, 9, Answer::count).memory, Memory::device);
      expect_answers(detector, in, 9, w.input());
    }
  }
}

TEST_P(Margin, APairWhoseGapEqualsItIsInTheListAndOneUlpMoreIsNot) {
  for (const Path path : {Path::grid, Path::nine_stages})
    for (const double unit : {1.0, 0x1p-600, 0x1p200}) {
      CallOptions o;
      o.path = path, o.margin = 0.3 * unit, o.width = Width::points, o.scalar = Scalar::f64;
      Detector detector(device_, o);
      const double at = (0.1 * unit + 0.2 * unit) + 0.3 * unit;
      for (const bool beyond : {false, true}) {
        const Sphere s[2] = {{0, 0, 0, 0.1 * unit},
                             {beyond ? std::nextafter(at, INFINITY) : at, 0, 0, 0.2 * unit}};
        const Contacts& c = detector.detect(input_of(s));
        // The square of the next number may round to the same: the decision is that of the oracle.
        EXPECT_EQ(c.count, oracle_touching({0, 0, 0, 0.1}, {s[1].x / unit, 0, 0, 0.2}, 0.3) ? 1u : 0u);
        if (!c.count) continue;
        const Normal<double> n = c.normal_span<double>()[0];
        EXPECT_EQ(n.x, 1);
        EXPECT_NEAR(n.depth / unit, -0.3, 1e-15);
        const Points<double> p = c.point_span<double>()[0];
        EXPECT_NEAR(p.on_i[0] / unit, 0.1, 1e-15);
        EXPECT_NEAR(p.on_j[0] / unit, 0.4, 1e-15);
      }
    }
}

// The depth of a pair is r_i + r_j - |c_j - c_i|. Its gradient is the normal for c_i, and minus the normal
// for c_j; the points are where the gap, or the overlap, is measured.
TEST_P(Margin, TwoPointsInOnePlaceHaveDepthZero) {
  const Sphere points[] = {{1, 2, 3, 0}, {1, 2, 3, 0}};
  for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
    Detector detector(device_, {.scalar = scalar, .margin = 0.5});
    const Contacts& c = detector.detect(input_of(points));
    ASSERT_EQ(c.count, 1u);
    EXPECT_EQ(scalar == Scalar::f32 ? c.normal_span<float>()[0].depth : c.normal_span<double>()[0].depth, 0);
  }
}

TEST_P(Margin, NormalsAreTheGradientOfTheDepthAndPointsSpanIt) {
  const TestBodies w = random_worlds(21, 3, 12, 80);
  CallOptions o;
  o.margin = 0.4, o.width = Width::points, o.scalar = Scalar::f64;
  Detector detector(device_, o);
  const Contacts& c = detector.detect(w.input());
  const std::vector<Seen> all = seen(w.input());
  std::size_t apart = 0;
  for (std::uint64_t k = 0; k < c.count; k++) {
    const Sphere i = all[c.pairs[k].i].sphere, j = all[c.pairs[k].j].sphere;
    const Normal<double> n = c.normal_span<double>()[k];
    const Points<double> p = c.point_span<double>()[k];
    const auto depth = [](const Sphere& a, const Sphere& b) {
      const long double x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
      return a.r + b.r - std::sqrt(x * x + y * y + z * z);
    };
    EXPECT_NEAR(n.depth, static_cast<double>(depth(i, j)), 1e-14);
    EXPECT_GE(n.depth, -o.margin - 1e-14);
    apart += n.depth < 0;
    const double h = 1e-6, normal[3] = {n.x, n.y, n.z};
    for (int a = 0; a < 3; a++) {
      Sphere up = j, down = j;
      (a == 0 ? up.x : a == 1 ? up.y : up.z) += h, (a == 0 ? down.x : a == 1 ? down.y : down.z) -= h;
      const double slope = static_cast<double>((depth(i, up) - depth(i, down)) / (2 * h));
      EXPECT_NEAR(slope, -normal[a], 1e-5);
      // From the point on i to that on j it is -depth along the normal.
      EXPECT_NEAR(p.on_j[a] - p.on_i[a], -n.depth * normal[a], 1e-14);
    }
  }
  EXPECT_GT(apart, 10u);
}

TEST_P(Worlds, WhatMakesNoSenseIsRefusedInASentence) {
  const TestBodies w = random_worlds(2, 3, 5, 5);
  Detector detector(device_, CallOptions{});
  for (const double margin : {-1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
    detector.options().margin = margin;
    EXPECT_TRUE(refuses([&] { detector.detect(w.input()); }, "margin"));
  }
  detector.options().margin = 0.1;
  TestBodies bad = w;
  for (const std::uint32_t world : {8u, kEveryWorld - 1}) {
    bad.bodies[1].world = world;
    for (const Answer answer : {Answer::any, Answer::count, Answer::distance})
      EXPECT_EQ(error_of([&] { detector.detect_worlds(bad.input(), 8, answer); }),
                "body 1 is in world " + std::to_string(world) +
                    ", but answers are asked for worlds 0 to 7: ask for more worlds");
  }
  bad = w, bad.assets.emplace_back();  // a body has a world even without spheres
  bad.bodies[1].shape = 3, bad.bodies[1].world = 8;
  const auto refuses_world = [&](Answer answer) {
    return refuses([&] { detector.detect_worlds(bad.input(), 8, answer); }, "body 1 is in world 8");
  };
  EXPECT_TRUE(refuses_world(Answer::any) && refuses_world(Answer::count));
  for (Body& b : bad.bodies) b.shape = 3;
  bad.loose.clear();  // there are no spheres
  EXPECT_TRUE(refuses_world(Answer::any) && refuses_world(Answer::count));
  bad = w, bad.loose[3].r = -1;
  EXPECT_TRUE(refuses([&] { detector.detect(bad.input()); }, "negative radius"));
  bad = w, bad.bodies[2].position[1] = NAN;
  EXPECT_TRUE(refuses([&] { detector.detect(bad.input()); }, "of body 2) at"));
  EXPECT_EQ(detector.hash(), 0u);
  EXPECT_EQ(sorted(detector.detect(w.input()).pair_span()), oracle(w.input(), detector.options()));
}

// Loose spheres may come with an array of worlds or without one in the same revision, and of another world.
TEST_P(Worlds, ARevisionMayChangeTheWorldsOfItsLooseSpheres) {
  for (const bool bodies_in_worlds : {true, false})
    for (const Bodies bodies : {Bodies::automatic, Bodies::first, Bodies::expanded}) {
      TestBodies w = random_worlds(6, 4, 12, 40);
      if (!bodies_in_worlds)
        for (Body& b : w.bodies) b.world = 2;
      Detector detector(device_, {.bodies = bodies});
      const std::vector<std::uint32_t> array(w.loose.size(), 2);
      enum Loose { own_worlds, array_of_2, all_in_2, all_in_0, all_in_the_last };
      for (const Loose loose : {own_worlds, all_in_2, all_in_2, own_worlds, all_in_the_last, all_in_0,
                                array_of_2, all_in_0, all_in_2, own_worlds}) {
        Input in = w.input();
        if (loose != own_worlds) in.spheres.world = loose == array_of_2 ? array.data() : nullptr;
        if (loose == all_in_2) in.spheres.world_of_all = 2;
        if (loose == all_in_the_last) in.spheres.world_of_all = kEveryWorld - 1;
        const std::vector<Pair> expected = oracle(in, detector.options());
        in.revision = 8;
        EXPECT_EQ(sorted(detector.detect(in).pair_span()), expected) << loose;
      }
    }
}

// stages() reads everything and keeps nothing, so a revision that comes again is read anew.
TEST_P(Worlds, ARevisionBeforeStagesIsForgotten) {
  TestBodies w = random_worlds(5, 3, 6, 0);
  Detector detector(device_);
  Input in = w.input();
  in.revision = 3;
  detector.detect(in);
  detector.stages(in);
  w.bodies[2].shape = 99;
  in.bodies = w.bodies;
  EXPECT_TRUE(refuses([&] { detector.detect(in); }, "names shape 99"));
}

// Whichever sphere it is, and also where no body makes the search go by the tree.
TEST_P(Worlds, AFaultyLooseSphereIsNamed) {
  Detector detector(device_);
  for (const int component : {0, 2, 3})
    for (const double fault : {double(NAN), -double(NAN), double(INFINITY), -double(INFINITY), 1e101, -1.0})
      for (const std::size_t at : {0, 57, 299}) {
        if (fault == -1 && component != 3) continue;
        TestBodies w = random_worlds(4, 5, 0, 300);
        for (std::uint32_t& world : w.world) world = std::min(world, 5u);
        (&w.loose[at].x)[component] = fault;
        EXPECT_TRUE(refuses([&] { detector.detect(w.input()); }, "sphere " + std::to_string(at) + " "))
            << component << ", " << fault;
      }
}

TEST_P(Worlds, AnswersCountAsMemory) {
  const TestBodies w = random_worlds(2, 3, 5, 5);
  Detector detector(device_, CallOptions{});
  constexpr std::uint32_t worlds = 1u << 20;
  detector.detect_worlds(w.input(), 4, Answer::distance);
  const std::uint64_t held = detector.memory();
  detector.options().memory_limit = held + worlds;
  for (const Answer answer : {Answer::count, Answer::distance})
    EXPECT_TRUE(refuses([&] { detector.detect_worlds(w.input(), worlds, answer); }, "memory are needed"));
  detector.options().memory_limit = 0;
  const WorldAnswers a = detector.detect_worlds(w.input(), worlds, Answer::distance);
  EXPECT_EQ(a.distance[worlds - 1], INFINITY);
  EXPECT_GE(detector.memory(), 16 * static_cast<std::uint64_t>(worlds));
}

// Those of loose spheres come from a list, if there is memory for it.
TEST_P(Worlds, AnswersNeedNoMemoryForAList) {
  TestBodies w;
  for (int k = 0; k < 2000; k++)  // two million contacts
    w.loose.push_back({0.001 * k, 0, 0, 3}), w.world.push_back(k % 2);
  Detector detector(device_, {.margin = 0.5});
  detector.options().memory_limit = 4 << 20;
  const WorldAnswers count = detector.detect_worlds(w.input(), 2, Answer::count);
  EXPECT_EQ(count.count[0], 1000u * 999 / 2);
  EXPECT_EQ(count.count[1], 1000u * 999 / 2);
  const WorldAnswers nearest = detector.detect_worlds(w.input(), 2, Answer::distance);
  EXPECT_NEAR(nearest.distance[1], 0.002 - 6, 1e-12);
}

// The distances to a huge sphere are rounded by more than the gaps between the others.
TEST_P(Worlds, TheNearestPairOfAHugeSphereIsNamed) {
  std::mt19937_64 random = random_of_new_seed();
  for (int scene = 0; scene < 20; scene++) {
    TestBodies w;
    for (int k = 0; k < 60; k++) {
      w.loose.push_back({20 + 4 * unit(random), 12, 24, 3 + unit(random)});
      w.world.push_back(0);
    }
    w.loose[scene * 3] = {24, 12, 24, static_cast<float>(3.5e11 * (1 + unit(random)))};
    Detector detector(device_, CallOptions{});
    expect_answers(detector, w.input(), 1);
  }
}

TEST_P(Worlds, EmptyScenesHaveEmptyAnswers) {
  Detector detector(device_, {.margin = 1});
  EXPECT_EQ(detector.detect({}).count, 0u);
  EXPECT_EQ(detector.detect_worlds({}, 0, Answer::any).worlds, 0u);
  const WorldAnswers a = detector.detect_worlds({}, 3, Answer::distance);
  for (int w = 0; w < 3; w++) {
    EXPECT_EQ(a.distance[w], INFINITY);
    EXPECT_EQ(a.pair[w], (Pair{~0u, ~0u}));
  }
}

TEST(WorldTree, AWalkVisitsEverythingThatABoxMeetsOnceAndInOrder) {
  std::mt19937_64 random(9);
  for (const std::uint32_t n : {0u, 1u, 7u, 8u, 9u, 64u, 65u, 700u, 4097u}) {
    std::vector<Sphere> balls;
    for (std::uint32_t k = 0; k < n; k++)
      balls.push_back({k * 0.1 + unit(random), unit(random), unit(random), 0.2 * unit(random)});
    WorldTree tree;
    std::vector<TreeBox> nodes(lay_out(tree, n, static_cast<std::uint32_t>(random() % (n + 1))));
    tree.balls = balls.data(), tree.nodes = nodes.data();
    for (std::uint32_t level = 1; level <= tree.levels; level++)
      for (std::uint32_t k = tree.first[level]; k < tree.first[level + 1]; k++)
        nodes[k] = box_of_node(tree, level, k - tree.first[level]);
    for (int again = 0; again < 100; again++) {
      const auto begin = static_cast<std::uint32_t>(random() % (n + 1)),
                 end = again % 2 ? n : begin + static_cast<std::uint32_t>(random() % (n - begin + 1));
      const TreeBox box = box_of({n * 0.1 * unit(random), unit(random), unit(random), 0.5}, 0.1);
      TreeWalk walk{begin, end};
      const auto meets = [&](const TreeBox& node, std::uint32_t, std::uint32_t) {
        return overlap(box, node);
      };
      std::uint32_t expected = begin;
      for (TreeWalk::Run run; (run = walk.next(tree, meets)).first < run.end;) {
        for (; expected < run.first; expected++) EXPECT_FALSE(overlap(box, box_of(balls[expected], 0)));
        EXPECT_EQ(run.first, expected);
        EXPECT_LE(run.end, std::min(end, run.first + 8));
        expected = run.end;
      }
      for (; expected < end; expected++) EXPECT_FALSE(overlap(box, box_of(balls[expected], 0)));
    }
  }
}

ON_EVERY_BACKEND(Worlds);
ON_EVERY_BACKEND(Margin);

}  // namespace
}  // namespace padder::detect
