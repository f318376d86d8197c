// SPDX-License-Identifier: MIT
// The choice of levels of detail: contacts stay within the stated errors of the finest level. The parts are
// rods with round ends, whose covers by balls have errors in closed form, and the oracle is the distance of
// all pairs of balls in double.
#include "detect/scene/rungs.h"

#include "detect/scene/scene.h"
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

// A rod of this radius along x, covered by `balls` balls that are `more` larger. Between two balls, half a
// spacing from each, the surface is farthest from them.
Rung rod(double radius, double length, int balls, double more) {
  Rung rung;
  const double spacing = length / (balls - 1), r = radius + more, half = spacing / 2;
  for (int k = 0; k < balls; k++) rung.spheres.push_back({spacing * k - length / 2, 0, 0, r});
  const double to_ball = std::hypot(radius, half) - r, at_pole = -more;
  rung.protrusion = std::max(more, 0.0), rung.gap = std::max({to_ball, at_pole, 0.0});
  return rung;
}

struct Thing {
  std::vector<Sphere> finest, taken;
  double error = 0, size = 0;
  bool left_out = false;
};
double distance(const std::vector<Sphere>& a, const std::vector<Sphere>& b) {
  double least = INFINITY;
  for (const Sphere& p : a)
    for (const Sphere& q : b)
      least = std::min(least, std::hypot(p.x - q.x, p.y - q.y, p.z - q.z) - p.r - q.r);
  return least;
}

// Rods of two kinds and loose spheres at random, with ladders of three rungs.
Scene strewn(std::uint64_t seed, double room) {
  SplitMix64 random(seed);
  Scene scene;
  for (const double radius : {0.05, 0.2}) {
    Scene::Asset asset;
    asset.rungs = {rod(radius, 1, 40, 0), rod(radius, 1, 12, 0.02 * radius),
                   rod(radius, 1, 5, -0.1 * radius)};
    asset.spheres = asset.rungs[0].spheres;
    scene.assets.push_back(asset);
  }
  for (std::uint32_t b = 0; b < 60; b++) {
    Body body;
    rotation_of(random.signed_unit(), random.signed_unit(), random.signed_unit(), random.signed_unit(),
                body.rotation);
    for (double& p : body.position) p = room * random.signed_unit();
    body.shape = b % 2, body.is_static = b % 5 == 0;
    scene.bodies.push_back(body);
  }
  scene.loose.scalar = Scalar::f64;
  for (int k = 0; k < 100; k++) {
    for (int c = 0; c < 3; c++) scene.loose.twice.push_back(room * random.signed_unit());
    scene.loose.twice.push_back(random.unit() < 0.2 ? 0.01 : 0.3);
  }
  return scene;
}

std::vector<Thing> things_of(const Scene& before, const Scene& after, const RungChoice& choice) {
  std::vector<Thing> out;
  for (std::size_t b = 0; b < before.bodies.size(); b++) {
    const auto& rungs = before.assets[before.bodies[b].shape].rungs;
    Thing t;
    for (const Sphere& s : rungs[0].spheres) t.finest.push_back(placed(before.bodies[b], s));
    for (const Sphere& s : after.assets[after.bodies[b].shape].spheres)
      t.taken.push_back(placed(after.bodies[b], s));
    t.left_out = choice.rungs[b] == kLeftOut, t.size = rungs[0].spheres[0].r;
    if (!t.left_out && choice.rungs[b] > 0) t.error = error_between(rungs[0], rungs[choice.rungs[b]]);
    out.push_back(t);
  }
  for (std::size_t k = 0; k < before.loose.size(); k++) {
    const double* v = &before.loose.twice[4 * k];
    out.push_back({{{v[0], v[1], v[2], v[3]}}, {{v[0], v[1], v[2], v[3]}}, 0, v[3], false});
  }
  return out;
}

TEST(RungsTest, ContactsStayWithinTheStatedErrorOfTheFinestLevel) {
  std::uint64_t coarse = 0, out_of_reach = 0, met = 0, differ = 0;
  for (const double room : {1.5, 3.0, 8.0})
    for (std::uint64_t seed = 1; seed <= 8; seed++) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", room " + std::to_string(room));
      const Scene scene = strewn(seed, room);
      const double margin = seed % 2 ? 0 : 0.05;
      RungRule rule{RungRule::Kind::chosen};
      rule.share = 0.3;
      const RungChoice choice = choose_rungs(scene, rule, margin, {BackendKind::omp});
      Scene taken = scene;
      take_rungs(taken, choice);
      const std::vector<Thing> things = things_of(scene, taken, choice);
      for (std::size_t a = 0; a < scene.bodies.size(); a++) {
        double smallest = INFINITY;
        coarse += !things[a].left_out && choice.rungs[a] > 0, out_of_reach += things[a].left_out;
        for (std::size_t b = 0; b < things.size(); b++) {
          const bool still =
              b < scene.bodies.size() && scene.bodies[a].is_static && scene.bodies[b].is_static;
          if (a == b || still) continue;
          const double finest = distance(things[a].finest, things[b].finest) - margin;
          if (finest <= 0) smallest = std::min(smallest, things[b].size);
          if (things[a].left_out || things[b].left_out) {
            EXPECT_GT(finest, 0) << a << ", " << b;
            continue;
          }
          const double error = things[a].error + things[b].error + 1e-12,
                       now = distance(things[a].taken, things[b].taken) - margin;
          if (finest <= 0) {
            EXPECT_LE(now, error) << a << ", " << b;
          }
          if (now <= 0) {
            EXPECT_LE(finest, error) << a << ", " << b;
          }
          met += finest <= 0, differ += (finest <= 0) != (now <= 0);
        }
        EXPECT_LE(things[a].error, 0.3 * smallest);
        EXPECT_LE(things[a].error, choice.error);
      }
      // The detector's contacts of what was taken are those of the oracle.
      CallOptions options;
      options.margin = margin;
      Detector detector({BackendKind::omp}, options);
      std::uint64_t spheres = 0;
      for (const Thing& t : things) spheres += t.taken.size();
      EXPECT_EQ(detector.detect(taken.input()).spheres, spheres);
      EXPECT_EQ(choice.taken + scene.loose.size(), spheres);
      EXPECT_LE(choice.taken + choice.out_of_reach, choice.finest);
    }
  EXPECT_GT(coarse, 100u);
  EXPECT_GT(out_of_reach, 100u);
  EXPECT_GT(met, 1000u);
  EXPECT_GT(differ, 10u) << "the test sees no error at all";
}

// Where a body lies far away, placing its spheres rounds by more than its bounding ball has room for.
TEST(RungsTest, WhatTouchesFarFromTheOriginIsNotLeftOut) {
  SplitMix64 random(5);
  for (const double far : {1e3, 1e7, 1e8, 1e9, 1e12}) {
    std::uint64_t touching = 0;
    for (int k = 0; k < 300; k++) {
      Scene scene;
      const double half = 0.2 + 0.8 * random.unit(), x = far * (0.5 + 0.5 * random.unit());
      Scene::Asset asset;
      asset.spheres = {{-half, 0, 0, 0.5}, {half, 0, 0, 0.5}};
      asset.rungs = {{asset.spheres}};
      scene.assets.push_back(asset), scene.bodies.resize(2);
      scene.bodies[0].position[0] = x;
      scene.bodies[1].position[0] =
          x + 2 * half + 1 + random.signed_unit() * (std::nextafter(far, 2 * far) - far);
      Detector detector({BackendKind::omp});
      if (detector.detect(scene.input()).count == 0) continue;
      touching++;
      EXPECT_EQ(choose_rungs(scene, rung_rule("auto")).left_out, 0u) << far;
    }
    EXPECT_GT(touching, 50u);
  }
}

TEST(RungsTest, ALevelIsTakenByItsNumberOrByTheSmallestThingAnywhere) {
  const Scene scene = strewn(1, 3);
  EXPECT_EQ(choose_rungs(scene, rung_rule("1")).rungs, std::vector<std::uint32_t>(60, 1));
  EXPECT_EQ(choose_rungs(scene, rung_rule("9")).rungs, std::vector<std::uint32_t>(60, 2));
  std::vector<std::span<const Rung>> shapes = {scene.assets[0].rungs, scene.assets[1].rungs};
  RungRule rule = rung_rule("auto");
  // The thin rods are the smallest things, and each other's partners.
  const double error = error_between(scene.assets[1].rungs[0], scene.assets[1].rungs[1]);
  rule.share = 1.001 * error / 0.05;
  EXPECT_GE(choose_rungs_anywhere(shapes, scene.bodies, INFINITY, rule).rungs[1], 1u);
  rule.share = 0.999 * error / 0.05;
  EXPECT_EQ(choose_rungs_anywhere(shapes, scene.bodies, INFINITY, rule).rungs[1], 0u);
  EXPECT_EQ(choose_rungs_anywhere(shapes, scene.bodies, 0, rule).taken, 60u * 40);
  for (const char* wrong : {"", "-1", "fine", "1.5", "4294967296", "auto "})
    EXPECT_THROW(rung_rule(wrong), Error);
}

TEST(RungsTest, WhatIsNotProvedIsNotTaken) {
  Cluster c;
  c.centers = {Point(0, 0, 0)}, c.radii = {1}, c.triangle = {-1};
  Lod lod;
  lod.centers = c.centers, lod.radii = {1.1}, lod.triangle = {-1};
  lod.accuracy.protrusion_max = 0.1, lod.accuracy.certified = true,
  lod.accuracy.proved_against = SurfaceKind::input;
  c.lods = {lod};
  const auto taken = [&] {
    Scene scene = pile_of(c, 1);
    return choose_rungs_anywhere(std::vector<std::span<const Rung>>{scene.assets[0].rungs}, scene.bodies, 100,
                                 rung_rule("auto"))
        .rungs[0];
  };
  EXPECT_EQ(taken(), 0u) << "the finest level has no certificate";
  c.accuracy.certified = true, c.accuracy.proved_against = SurfaceKind::input;
  EXPECT_EQ(taken(), 1u);
  for (const SurfaceKind kind : {SurfaceKind::none, SurfaceKind::wrap}) {
    c.lods[0].accuracy.proved_against = kind;
    EXPECT_EQ(taken(), 0u);
  }
}

}  // namespace
}  // namespace padder::detect
