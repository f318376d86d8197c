// SPDX-License-Identifier: MIT
// The stepper beside closed forms, and beside itself: kept candidates, threads and snapshots change no bit.
// On each backend that is there, and one beside the other.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "detect/scene/generate.h"
#include "tests/detect/backends.h"
#include "tests/error_of.h"
#include "tools/settle/files.h"
#include "tools/settle/page/page.h"
#include "tools/settle/stepper.h"

namespace padder::settle {
namespace {

constexpr double kPi = std::numbers::pi;

System empty_system(double friction = 0.5, double restitution = 0.6, double stiffness = 1e5) {
  System s;
  s.gravity = {0, 0, -9.81};
  s.law.stiffness = stiffness, s.law.tangential_stiffness = 2 * stiffness / 7;
  s.law.surfaces[0][0] = {damping_ratio_of(restitution), friction};
  return s;
}
Wall floor_with(double friction) { return {Wall::Kind::plane, {0, 0, 0}, {0, 0, 1}, 0, friction}; }

// Grains on a jittered lattice of nx ny nz places, from the floor up.
System heap(int nx, int ny, int nz, std::uint64_t seed) {
  System s = empty_system();
  s.walls.push_back(floor_with(0.5));
  s.walls.push_back({Wall::Kind::cylinder, {0, 0, 0}, {0, 0, 1}, 0.0165 * (nx + 1), 0.5});
  detect::SplitMix64 random(seed);
  for (int z = 0; z < nz; z++)
    for (int y = 0; y < ny; y++)
      for (int x = 0; x < nx; x++) {
        const double r = 0.008 + 0.002 * random.unit();
        const Vec3 at{0.021 * (x - 0.5 * nx) + 1e-4 * random.unit(),
                      0.021 * (y - 0.5 * ny) + 1e-4 * random.unit(), 0.012 + 0.021 * z};
        add_grain(s, at, r, 2500, {0, 0, -1});
      }
  s.step = step_limits(s).chosen;
  return s;
}

void expect_same_bits(const Stepper& a, const Stepper& b) {
  const Snapshot x = a.snapshot(), y = b.snapshot();
  ASSERT_EQ(x.steps, y.steps);
  ASSERT_TRUE(x.position == y.position) << "positions differ";
  ASSERT_TRUE(x.velocity == y.velocity) << "velocities differ";
  ASSERT_TRUE(x.momentum == y.momentum) << "angular momenta differ";
  ASSERT_TRUE(x.orientation == y.orientation) << "orientations differ";
  ASSERT_EQ(x.contacts.size(), y.contacts.size());
  for (std::size_t k = 0; k < x.contacts.size(); k++) ASSERT_EQ(x.contacts[k].spring, y.contacts[k].spring);
}

// A shape of `n` spheres in a row along x, and its mass.
Mass rod(System& s, int n, double radius, double spacing, double density) {
  std::vector<detect::Sphere> spheres;
  Mass mass;
  const double one = density * 4 / 3 * kPi * radius * radius * radius;
  for (int k = 0; k < n; k++) {
    const double x = spacing * (k - 0.5 * (n - 1));
    spheres.push_back({x, 0, 0, radius});
    mass.mass += one;
    const double own = 0.4 * one * radius * radius;
    mass.moments.x += own, mass.moments.y += own + one * x * x, mass.moments.z += own + one * x * x;
  }
  s.shapes.push_back(spheres);
  return mass;
}

using detect::BackendKind, detect::name_in_one_word;

class SettleTest : public detect::BackendTest {
 protected:
  static StepperOptions on(int threads = 0, double skin = -1) { return {threads, skin, GetParam()}; }
  // With the step that is chosen for it.
  static Stepper started(System& s) {
    s.step = step_limits(s).chosen;
    return Stepper(s, on());
  }
};
ON_EVERY_BACKEND(SettleTest);

// A ball meets the floor with speed v. It leaves with e v, without damping after pi / omega_0, and its
// deepest point is v / omega_0 exp(-b atan(sqrt(1 - b^2) / b) / sqrt(1 - b^2)).
TEST_P(SettleTest, ABallBouncesAsTheClosedFormSays) {
  for (const double restitution : {1.0, 0.8, 0.3}) {
    System s = empty_system(0.5, restitution);
    s.gravity = {};
    s.walls.push_back(floor_with(0.5));
    const double speed = 0.7;
    add_grain(s, {0, 0, 0.0101}, 0.01, 2500, {0, 0, -speed});
    s.step = step_limits(s).chosen / 40;
    const double omega = std::sqrt(s.law.stiffness * s.inverse_mass[0]),
                 b = s.law.surfaces[0][0].damping_ratio;
    const double damped = std::sqrt(1 - b * b);
    const double deepest = speed / omega * (b > 0 ? std::exp(-b * std::atan2(damped, b) / damped) : 1);
    Stepper stepper(s, on());
    double most = 0;
    std::uint64_t touching = 0;
    while (stepper.system().velocity[0].z <= 0 || stepper.contacts() > 0) {
      stepper.step();
      touching += stepper.contacts();
      most = std::max(most, stepper.watch().deepest);
      ASSERT_LT(stepper.steps(), 1000000u);
    }
    EXPECT_NEAR(most, deepest, 0.003 * deepest) << restitution;
    EXPECT_NEAR(stepper.system().velocity[0].z, restitution * speed, 0.01 * speed) << restitution;
    if (restitution == 1) {
      EXPECT_NEAR(static_cast<double>(touching) * s.step, kPi / omega, 0.02 * kPi / omega);
    }
  }
}

// A ball falls 1 m on a soft floor: its deepest point, v / omega, is known when it has long left the floor.
TEST_P(SettleTest, TheDeepestPenetrationOfARunIsKept) {
  System s = empty_system(0.5, 1, 5e3);
  s.walls.push_back(floor_with(0.5));
  add_grain(s, {0, 0, 1.01}, 0.01, 2500);
  s.step = step_limits(s).chosen / 10;
  const double deepest = std::sqrt(2 * 9.81 / (s.law.stiffness * s.inverse_mass[0]));
  Stepper stepper(s, on());
  stepper.step(static_cast<std::uint64_t>(0.6 / s.step));
  EXPECT_EQ(stepper.contacts(), 0u);
  EXPECT_EQ(stepper.watch().deepest, 0);
  EXPECT_NEAR(stepper.deepest_so_far(), deepest, 0.01 * deepest);
  EXPECT_EQ(stepper.deepest_ratio_so_far(), stepper.deepest_so_far() / 0.01);
  stepper.resume(stepper.snapshot());
  stepper.watch();
  EXPECT_EQ(stepper.deepest_so_far(), 0);
}

TEST_P(SettleTest, ABallFallsAsGalileiSays) {
  System s = empty_system();
  add_grain(s, {0, 0, 10}, 0.01, 2500, {1, 0, 2});
  s.step = 1e-4;
  Stepper stepper(s, on());
  for (int k = 0; k < 10000; k++) stepper.step();
  EXPECT_NEAR(stepper.system().position[0].x, 1, 1e-9);
  EXPECT_NEAR(stepper.system().position[0].z, 10 + 2 - 9.81 / 2,
              9.81 * s.step);  // leapfrog: half a step of speed
}

// The speed that a block gains on an incline by gravity and friction.
double gained(double angle, double mu, double time) {
  return std::max(0.0, 9.81 * (std::sin(angle) - mu * std::cos(angle)) * time);
}
void tilt(System& s, double angle) {
  s.gravity = {9.81 * std::sin(angle), 0, -9.81 * std::cos(angle)};
  std::vector<detect::Sphere> block;
  for (const double x : {-0.05, 0.05})
    for (const double y : {-0.05, 0.05}) block.push_back({x, y, 0, 0.01});
  s.shapes.push_back(block);
}
const Mass kBlock{0.5, {2e-3, 2e-3, 3e-3}};

// A flat body of four spheres on an incline: it holds below the angle of friction and slips above, where it
// gains the speed g (sin a - mu cos a) t.
TEST_P(SettleTest, ABlockOnASlopeSlipsAtItsAngleOfFriction) {
  const double mu = 0.5, slip = std::atan(mu);
  for (const double angle : {slip - 0.02, slip + 0.02, slip + 0.2}) {
    System s = empty_system(mu, 0.3);
    tilt(s, angle);
    s.walls.push_back(floor_with(mu));
    add_body(s, 0, kBlock, {0, 0, 0.01}, {});
    Stepper stepper = started(s);
    stepper.step(static_cast<std::uint64_t>(0.5 / s.step));
    const double speed = gained(angle, mu, stepper.time());
    EXPECT_NEAR(stepper.system().velocity[0].x, speed, 0.01 * speed + 5e-3) << angle;
  }
}

// Blocks of three materials on slopes of two other ones, each pair with a friction of its own.
TEST_P(SettleTest, BlocksOfSeveralMaterialsSlipByTheirPairs) {
  const double mu[3][2] = {{0.1, 0.5}, {0.7, 0.2}, {0.3, 0.9}}, angle = std::atan(0.4);
  for (const std::uint32_t floor : {0u, 1u}) {
    System s = empty_system(9, 0.3);
    tilt(s, angle);
    Wall wall = floor_with(-1);
    wall.material = 3 + floor;
    s.walls.push_back(wall);
    for (std::uint32_t m = 0; m < 3; m++) {
      const Surface surface{damping_ratio_of(0.3), mu[m][floor]};
      s.law.surfaces[m][wall.material] = s.law.surfaces[wall.material][m] = surface;
      add_body(s, 0, kBlock, {0, 0.5 * m, 0.01}, {});
      s.material.push_back(static_cast<std::uint8_t>(m));
    }
    Stepper stepper = started(s);
    stepper.step(static_cast<std::uint64_t>(0.4 / s.step));
    for (std::uint32_t m = 0; m < 3; m++) {
      const double speed = gained(angle, mu[m][floor], stepper.time());
      EXPECT_NEAR(stepper.system().velocity[m].x, speed, 0.01 * speed + 5e-3) << m << " on " << floor;
    }
  }
}

// Two balls meet head on, in a row for each pair of two materials: they part with the restitution of the
// pair.
TEST_P(SettleTest, BallsOfTwoMaterialsPartWithTheRestitutionOfThePair) {
  const double restitution[2][2] = {{0.9, 0.2}, {0.2, 0.6}};
  System s = empty_system();
  s.gravity = {};
  for (int a = 0; a < 2; a++)
    for (int b = 0; b < 2; b++) {
      s.law.surfaces[a][b] = {damping_ratio_of(restitution[a][b]), 0.5};
      const double y = 0.1 * (2 * a + b);
      add_grain(s, {-0.0101, y, 0}, 0.01, 2500, {0.5, 0, 0});
      add_grain(s, {0.0101, y, 0}, 0.01, 2500, {-0.5, 0, 0});
      s.material.push_back(static_cast<std::uint8_t>(a)), s.material.push_back(static_cast<std::uint8_t>(b));
    }
  s.step = step_limits(s).chosen / 10;
  Stepper stepper(s, on());
  stepper.step(static_cast<std::uint64_t>(0.02 / s.step));
  for (std::size_t k = 0; k < 4; k++) {
    const double parted = stepper.system().velocity[2 * k + 1].x - stepper.system().velocity[2 * k].x;
    EXPECT_NEAR(parted, restitution[k / 2][k % 2], 0.01) << k;
  }
}

// Linear and angular momentum, the latter about the origin.
std::pair<Vec3, Vec3> momenta(const System& s) {
  Vec3 p, l;
  for (std::size_t m = 0; m < s.movers(); m++) {
    const Vec3 q = (1 / s.inverse_mass[m]) * s.velocity[m];
    p = p + q, l = l + s.momentum[m] + cross(s.position[m], q);
  }
  return {p, l};
}

TEST_P(SettleTest, AFreePairKeepsItsMomentumToRounding) {
  System s = empty_system();
  s.gravity = {};
  const Mass mass = rod(s, 3, 0.01, 0.015, 2500);
  add_body(s, 0, mass, {0, 0.004, 0.05}, turned({}, {0.3, 0.2, 0.5}));
  add_grain(s, {0.005, 0, 0}, 0.012, 2500, {0.1, 0.2, 2});
  Stepper stepper = started(s);
  const auto [p0, l0] = momenta(stepper.system());
  std::uint64_t contacts = 0;
  while (stepper.time() < 0.1) stepper.step(), contacts += stepper.contacts();
  ASSERT_GT(contacts, 0u);
  const auto [p, l] = momenta(stepper.system());
  EXPECT_LT(length(p - p0), 1e-14 * length(p0));
  EXPECT_LT(length(l - l0), 1e-11 * length(l0) + 1e-15);
  EXPECT_GT(length(stepper.system().momentum[0]), 0);
}

// A bushing whose points are apart from the start, while they pass each other: its spring and its dashpot
// move and turn two free bodies, but not both together.
TEST_P(SettleTest, ABushingKeepsTheMomentumOfTwoFreeBodies) {
  for (const double damping : {0.0, 0.5, 5.0}) {
    System s = empty_system();
    s.gravity = {};
    const Mass mass = rod(s, 3, 0.01, 0.015, 2500);
    add_body(s, 0, mass, {0, 0, 0}, turned({}, {0.3, 0.2, 0.5}));
    add_body(s, 0, mass, {0.1, 0, 0}, {});
    s.bushings.push_back({0, 1, {0.03, 0, 0.01}, {-0.04, 0.02, 0}, 500, damping});
    s.velocity = {{0, 1, 0}, {0, -1, 0.5}};
    Stepper stepper = started(s);
    const auto [p0, l0] = momenta(stepper.system());
    stepper.step(static_cast<std::uint64_t>(0.05 / s.step));
    const auto [p, l] = momenta(stepper.system());
    EXPECT_LT(length(p - p0), 1e-9 * length(p0)) << damping;
    EXPECT_LT(length(l - l0), 1e-9 * length(l0)) << damping;
    EXPECT_GT(length(stepper.system().spin[1]), 1) << damping;
  }
}

// Euler's equations of a free symmetric rod: the spin precesses about the axis of the rod, in the rod's
// frame, at (1 - I_x / I_y) times its axial part; the angular momentum is constant by construction, the
// energy is what the scheme must keep. Beside them an integration of the equations by Runge and Kutta.
TEST_P(SettleTest, AFreeRodOfSpheresTurnsAsEulersEquationsSay) {
  System s = empty_system();
  s.gravity = {};
  Mass mass = rod(s, 4, 0.01, 0.018, 2500);
  mass.moments.z *= 1.3;  // no symmetry
  add_body(s, 0, mass, {}, {});
  const Vec3 spin{20, 3, 10};
  s.spin[0] = spin;
  s.momentum[0] = {mass.moments.x * spin.x, mass.moments.y * spin.y, mass.moments.z * spin.z};
  Stepper stepper = started(s);
  Vec3 w = spin;  // in the rod's frame
  const Vec3 i = mass.moments;
  const auto rate = [&](const Vec3& v) {
    return Vec3{(i.y - i.z) / i.x * v.y * v.z, (i.z - i.x) / i.y * v.z * v.x, (i.x - i.y) / i.z * v.x * v.y};
  };
  const double energy = stepper.watch().kinetic;
  while (stepper.time() < 1) {
    stepper.step();
    const double h = s.step;
    const Vec3 a = rate(w), b = rate(w + 0.5 * h * a), c = rate(w + 0.5 * h * b), d = rate(w + h * c);
    w = w + (h / 6) * (a + 2 * b + 2 * c + d);
  }
  double m[9];
  matrix_of(stepper.system().orientation[0], m);
  const Vec3 ours = transposed_times(m, stepper.system().spin[0]);
  EXPECT_LT(length(ours - w), 1e-4 * length(w));
  EXPECT_NEAR(stepper.watch().kinetic, energy, 1e-6 * energy);
}

TEST_P(SettleTest, APileComesToRestAndItsEnergyOnlyFalls) {
  System s = heap(6, 6, 6, 5);
  s.law.stiffness = 2e4, s.law.tangential_stiffness = 4e4 / 7;
  Stepper stepper = started(s);
  double before = stepper.watch().total(), moving = 0;
  const double first = before, fall = 216 * 2500 * 4 / 3 * kPi * 1e-6 * 9.81 * 0.1;
  while (stepper.time() < 2) {
    for (int k = 0; k < 500; k++) stepper.step();
    const Watch w = stepper.watch();
    EXPECT_LT(w.total(), before + 1e-4 * fall);
    before = w.total(), moving = w.kinetic;
  }
  EXPECT_TRUE(stepper.at_rest());
  EXPECT_LT(before, first);
  EXPECT_LT(moving, 1e-6 * fall);
  EXPECT_LT(stepper.watch().deepest_ratio, 0.02);
  EXPECT_GT(stepper.contacts(), 216u);
}

// A ball on a slope of 1 degree, one that rolls up there and turns back, a block that slides, and a rod that
// tips over from its end: all are slow for long, and each look finds that they move.
TEST_P(SettleTest, WhatBeginsToMoveOrTurnsBackIsNotAtRest) {
  const auto expect_moving = [](System s, const char* what) {
    s.walls.push_back(floor_with(0.3));
    Stepper stepper = started(s);
    while (stepper.time() < 0.3) {
      stepper.watch();
      ASSERT_FALSE(stepper.at_rest()) << what << " at " << stepper.time();
      stepper.step(11);
    }
  };
  const double radius = 0.01;
  for (const double speed : {0.0, -0.01}) {
    System ball = empty_system();
    tilt(ball, kPi / 180);
    add_grain(ball, {0, 0, radius}, radius, 2500, {speed, 0, 0});
    ball.spin[0].y = speed / radius, ball.momentum[0].y = ball.spin[0].y / ball.inverse_inertia[0].y;
    expect_moving(ball, speed == 0 ? "a ball" : "a ball that rolls up");
  }
  System block = empty_system();
  tilt(block, std::atan(0.3) + 0.02);
  add_body(block, 0, kBlock, {0, 0, radius}, {});
  expect_moving(block, "a block");
  System tipping = empty_system();
  const double tilted = 10 * kPi / 180;
  add_body(tipping, 0, rod(tipping, 12, radius, 0.018, 2500), {0, 0, 0.099 * std::cos(tilted) + radius},
           turned({}, {0, tilted - kPi / 2, 0}));
  expect_moving(tipping, "a rod");
}

// A plate that falls flat meets the floor with all its spheres at once, and their dampers pull together.
TEST_P(SettleTest, APlateThatFallsFlatComesToRest) {
  for (const int side : {3, 10, 24}) {
    System s = empty_system();
    s.walls.push_back(floor_with(0.5));
    std::vector<detect::Sphere> plate;
    for (int x = 0; x < side; x++)
      for (int y = 0; y < side; y++)
        plate.push_back({0.015 * (x - (side - 1) / 2.0), 0.015 * (y - (side - 1) / 2.0), 0, 0.01});
    s.shapes.push_back(plate);
    const double mass = 0.01 * side * side, across = mass * std::pow(0.015 * side, 2) / 12;
    add_body(s, 0, {mass, {across, across, 2 * across}}, {0, 0, 0.012}, {});
    const StepLimits limits = step_limits(s);
    EXPECT_NEAR(limits.chosen * 25 / (limits.longest * 6), std::min(1.0, 40.0 / (side * side)), 1e-12);
    s.step = limits.chosen;
    Stepper stepper(s, on());
    const double first = stepper.watch().total(), fall = 9.81 * mass * 0.002;
    while (stepper.time() < 0.1) {
      stepper.step(16);
      ASSERT_LE(stepper.watch().total(), first + 0.1 * fall) << side << " at " << stepper.time();
    }
    EXPECT_LT(length(stepper.system().velocity[0]), 1e-3) << side;
    EXPECT_EQ(stepper.contacts(), plate.size());
  }
}

// Grains are poured on a disc of grains that are held, and what is too much falls over its edge. What stays
// lies at the angle of repose. Spheres with friction 0.5 and little or no rolling resistance have 15 to 28
// degrees (Zhou, Xu, Yu and Zulli, An experimental and numerical study of the angle of repose of coarse
// spheres, Powder Technology 125, 2002).
TEST_P(SettleTest, AHeapHasAnAngleOfReposeInThePublishedRange) {
  System s = empty_system(0.5, 0.3, 1e4);
  const double d = 0.02, disc = 6.5 * d;
  s.walls.push_back({Wall::Kind::plane, {0, 0, -3 * d}, {0, 0, 1}, 0, 0.5});
  detect::SplitMix64 random(11);
  std::size_t held = 0;
  for (int ring = 0; ring * d <= disc; ring++)
    for (int k = 0; k < std::max(1, 6 * ring); k++, held++) {
      const double t = 2 * kPi * k / std::max(1, 6 * ring);
      add_grain(s, {ring * d * std::cos(t), ring * d * std::sin(t), 0}, 0.5 * d, 2500);
    }
  for (std::size_t m = 0; m < held; m++) s.inverse_mass[m] = 0;
  for (int z = 0; z < 7; z++)
    for (int y = -5; y <= 5; y++)
      for (int x = -5; x <= 5; x++)
        if (x * x + y * y <= 26)
          add_grain(s,
                    {1.05 * d * x + 0.02 * d * random.unit(), 1.05 * d * y + 0.02 * d * random.unit(),
                     d * (1.1 + 1.05 * z)},
                    d * (0.46 + 0.06 * random.unit()), 2500);
  s.grain_static.assign(s.grain_radius.size(), 0);
  std::fill_n(s.grain_static.begin(), held, 1);
  Stepper stepper = started(s);
  while (stepper.time() < 1) stepper.step();

  // The highest grain of each ring, and the line through these points.
  std::vector<double> top(6, 0);
  const System& e = stepper.system();
  for (std::size_t m = held; m < e.movers(); m++) {
    const auto ring = static_cast<std::size_t>(std::hypot(e.position[m].x, e.position[m].y) / d);
    if (ring < top.size()) top[ring] = std::max(top[ring], e.position[m].z);
  }
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t ring = 1; ring < top.size(); ring++) {
    const double x = (static_cast<double>(ring) + 0.5) * d, y = top[ring];
    n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double angle = std::atan(-(n * sxy - sx * sy) / (n * sxx - sx * sx)) * 180 / kPi;
  std::printf("angle of repose: %.1f degrees\n", angle);
  EXPECT_GT(angle, 15);
  EXPECT_LT(angle, 28);
  EXPECT_GT(top[1], 2 * d);
}

TEST_P(SettleTest, KeptCandidatesThreadsAndTheSkinChangeNoBit) {
  const System s = heap(10, 10, 10, 7);
  Stepper every(s, on(1, 0)), kept(s, on(1, -1)), wide(s, on(2, 0.01));
  for (int k = 0; k < 1000; k++) {
    every.step(), kept.step(), wide.step();
    if (k % 10 == 0 && GetParam() == BackendKind::omp) {
      ASSERT_EQ(every.touching_pairs(), kept.touching_pairs()) << k;
      ASSERT_EQ(every.touching_pairs(), wide.touching_pairs()) << k;
    }
    ASSERT_EQ(every.contacts(), kept.contacts()) << k;
  }
  expect_same_bits(every, kept), expect_same_bits(every, wide);
  EXPECT_EQ(every.effort().detections, 1000u);
  EXPECT_LT(kept.effort().detections, 300u);
  EXPECT_GT(kept.contacts(), 300u);
}

TEST_P(SettleTest, ARunThatIsResumedHasTheBitsOfOneThatIsNot) {
  System s = empty_system(0.5, 0.6, 1e4);
  s.walls.push_back(floor_with(0.5));
  const Mass mass = rod(s, 3, 0.01, 0.012, 2500);
  for (int k = 0; k < 30; k++)
    add_body(s, 0, mass, {0.05 * (k % 3), 0.03 * (k / 3 % 3), 0.02 + 0.025 * (k / 9)},
             turned({}, {0.1 * k, 0.3, -0.2 * k}));
  for (int k = 0; k < 50; k++)
    add_grain(s, {0.02 * (k % 5), 0.02 * (k / 5 % 5), 0.16 + 0.021 * (k / 25)}, 0.009, 2500);
  for (Vec3& v : s.velocity) v = {0, 0, -1};
  for (std::uint32_t k = 0; k < 30; k++) s.bodies[k].family = 33 + k;
  s.step = step_limits(s).chosen;
  Stepper whole(s, on()), first(s, on(1, 0));
  for (int k = 0; k < 3000; k++) whole.step();
  for (int k = 0; k < 1700; k++) first.step();
  Stepper second(s, on(2, -1));
  second.resume(first.snapshot());
  for (int k = 0; k < 1300; k++) second.step();
  expect_same_bits(whole, second);
  EXPECT_GT(whole.contacts(), 10u);
  EXPECT_GT(whole.snapshot().contacts.size(), 2u);
}

// Everything that a run does not change is in the fingerprint by which a checkpoint knows its scene.
TEST_P(SettleTest, AFingerprintIsOfWhatIsStaticAndDrivenToo) {
  System s = empty_system();
  const Mass mass = rod(s, 3, 0.01, 0.015, 2500);
  add_body(s, 0, {}, {0, 0, 0}, {});
  add_body(s, 0, mass, {0, 0, 0.1}, {});
  s.driven[1] = 1, s.inverse_mass[1] = 0, s.velocity[1] = {0.1, 0, 0}, s.spin[1] = {0, 0, 1};
  add_grain(s, {0, 0, 0.2}, 0.01, 2500), add_grain(s, {0, 0.3, 0}, 0.01, 2500);
  s.inverse_mass[3] = 0, s.grain_static = {0, 1};
  s.step = step_limits(s).chosen;
  const std::uint64_t first = fingerprint(s);
  Stepper stepper(s, on());
  stepper.step(20);
  EXPECT_EQ(fingerprint(stepper.system()), first);
  std::vector<System> edited(5, s);
  edited[0].position[0].x = 0.01;
  edited[1].orientation[0] = turned({}, {0, 0, 0.1});
  edited[2].velocity[1].x = 0.2;
  edited[3].spin[1].z = 2;
  edited[4].position[3].y = 0.31;
  for (std::size_t k = 0; k < edited.size(); k++) EXPECT_NE(fingerprint(edited[k]), first) << k;
}

// Two grains that press each other, one of them the floor as well: before the first step, and again where a
// state without any spring of friction is resumed.
TEST_P(SettleTest, WhatPressesAtTheStartHasEnergy) {
  System s = empty_system(0);
  s.walls.push_back(floor_with(0));
  add_grain(s, {0, 0, 0.009}, 0.01, 2500), add_grain(s, {0.018, 0, 0.012}, 0.01, 2500);
  s.step = step_limits(s).chosen;
  const double between = 0.02 - std::hypot(0.018, 0.003), floor = 0.001;
  const double stored = 0.5 * s.law.stiffness * (between * between + floor * floor);
  Stepper stepper(s, on());
  EXPECT_NEAR(stepper.watch().elastic, stored, 1e-9 * stored);
  Stepper resumed(s, on());
  resumed.step(3);
  resumed.resume(Stepper(s, on()).snapshot());
  EXPECT_NEAR(resumed.watch().elastic, stored, 1e-9 * stored);
  stepper.step(100), resumed.step(100);
  expect_same_bits(stepper, resumed);
}

TEST_P(SettleTest, WhatCannotBeSteppedIsRefusedInASentence) {
  const auto refused = [](const System& s, const std::string& part) {
    EXPECT_TRUE(refuses(
        [&] {
          Stepper stepper(s, on());
          for (int k = 0; k < 100; k++) stepper.step();
        },
        part));
  };
  System s = heap(2, 2, 2, 1);
  s.step = 2 * step_limits(s).longest;
  refused(s, "is unstable for this stiffness");
  refused(System{}, "no spheres");
  System overlap = heap(2, 2, 2, 1);
  add_grain(overlap, {overlap.position[0].x + 1e-4, overlap.position[0].y, overlap.position[0].z}, 0.01,
            2500);
  refused(overlap, "exploded in step 0");
  System fast = heap(2, 2, 2, 1);
  fast.velocity[3] = {1e5, 0, 0};
  refused(fast, "grain 3 has a speed of");
  // The rims of bodies: one that spins, and one that is driven through whatever is there.
  System bodies = empty_system();
  add_body(bodies, 0, rod(bodies, 20, 0.008, 0.004, 2500), {0, 0, 1}, {});
  add_grain(bodies, {0, 0, 2}, 0.01, 2500);
  bodies.step = step_limits(bodies).chosen;
  const double longest = 0.5 * 0.01 / bodies.step;  // half the radius of the grain
  System spinning = bodies, driven = bodies;
  spinning.spin[0] = {0, longest / 0.04, 0};  // the rod is 0.092 long
  refused(spinning, "body 0 moves by up to");
  driven.driven[0] = 1, driven.inverse_mass[0] = 0, driven.velocity[0] = {1.01 * longest, 0, 0};
  refused(driven, "body 0 moves by up to");
  driven.velocity[0] = {0.99 * longest, 0, 0};
  EXPECT_NO_THROW(Stepper(driven, on()).step(5));
}

// A box of 30 layers, and a room inside of it that nobody sees: what is near the top or a side is seen.
TEST(SettlePageTest, WhatIsHiddenIsInside) {
  std::vector<Vec3> points;
  detect::SplitMix64 random(5);
  const auto jittered = [&](int k) { return k + 0.1 * random.signed_unit(); };
  for (int z = 0; z < 30; z++)
    for (int y = 0; y < 30; y++)
      for (int x = 0; x < 30; x++)
        if (std::max({std::abs(x - 15), std::abs(y - 15), std::abs(z - 10)}) > 4)
          points.push_back({jittered(x), jittered(y), jittered(z)});
  const std::vector<bool> seen = seen_from_outside(points);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < points.size(); k++) {
    const Vec3& p = points[k];
    const double depth = std::min({p.x, 29 - p.x, p.y, 29 - p.y, 29 - p.z});
    if (depth < 1 || depth > 6) {
      EXPECT_EQ(seen[k], depth < 1) << p.x << ' ' << p.y << ' ' << p.z;
    }
    kept += seen[k];
  }
  EXPECT_LT(kept, points.size() * 4 / 5);
}

// Every second frame, and again every second, from the last one backwards, until the page is small or has
// two.
TEST(SettlePageTest, LeavesOutFramesWhereItWouldBeLarge) {
  Stepper stepper(heap(4, 4, 2, 1), {1});
  Movie movie;
  for (int frame = 0; frame < 8; frame++) {
    if (frame > 0) stepper.step(5);
    stepper.place();
    movie.add(stepper);
  }
  const std::string path = testing::TempDir() + "settle_page.html";
  const Movie::Written all = movie.write("heap", stepper.system(), path);
  EXPECT_EQ(all.frames, 8u);
  EXPECT_EQ(movie.write("heap", stepper.system(), path, all.bytes).frames, 8u);
  const Movie::Written few = movie.write("heap", stepper.system(), path, 1);
  EXPECT_EQ(few.frames, 2u);
  EXPECT_LT(few.bytes, all.bytes);
  std::ifstream file(path);
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const std::size_t begin = page.find("\"times\":["), last = page.rfind(',', page.find(']', begin));
  ASSERT_LT(begin, last);
  EXPECT_EQ(std::stod(page.substr(last + 1)), stepper.time());
  std::filesystem::remove(path);
}

// Grains that fall, roll and pile up in a cylinder: without bodies a step takes no sine, so that both
// backends have the same bits. With bodies they differ by rounding.
TEST(SettleBackendsTest, GrainsHaveTheSameBitsOnAGpu) {
  if (!detect::cuda_present()) GTEST_SKIP() << "there is no GPU that this build can use";
  const System s = heap(12, 12, 12, 3);
  Stepper host(s), device(s, {0, -1, BackendKind::cuda});
  for (int k = 0; k < 20; k++) {
    host.step(50), device.step(50);
    ASSERT_EQ(host.contacts(), device.contacts()) << k;
  }
  expect_same_bits(host, device);
  EXPECT_GT(host.contacts(), 500u);
  Stepper resumed(s, {0, -1, BackendKind::cuda});
  resumed.resume(host.snapshot());
  host.step(300), resumed.step(100), resumed.step(200);
  expect_same_bits(host, resumed);
  const Watch a = host.watch(), b = device.watch(), c = resumed.watch();
  EXPECT_NEAR(a.kinetic, c.kinetic, 1e-12 * a.kinetic);
  EXPECT_NEAR(a.elastic, c.elastic, 1e-12 * a.elastic);
  EXPECT_NEAR(a.potential, c.potential, 1e-12 * std::abs(a.potential));
  EXPECT_EQ(a.fastest, c.fastest);
  EXPECT_EQ(a.deepest, c.deepest);
  EXPECT_GT(b.elastic, 0);
}

// Bodies, a large ball with many contacts, bushings and a driven body: the backends agree for as long as
// rounding has not grown.
TEST(SettleBackendsTest, BodiesMoveAsOnTheHostForAShortTime) {
  System s = empty_system(0.5, 0.6, 1e4);
  s.walls.push_back(floor_with(0.5));
  const Mass mass = rod(s, 3, 0.01, 0.012, 2500), chain = rod(s, 20, 0.008, 0.004, 2500);
  for (int k = 0; k < 100; k++)
    add_body(s, 0, mass, {0.05 * (k % 5), 0.05 * (k / 5 % 5), 0.0101 + 0.0202 * (k / 25)},
             turned({}, {0, 0, 0.2 * k}));
  add_body(s, 1, chain, {0.1, -0.05, 0.02}, {}), add_body(s, 1, chain, {0.2, -0.05, 0.02}, {});
  s.bushings.push_back({100, 101, {0.05, 0, 0}, {-0.05, 0, 0}, 100, 0.1});
  add_body(s, 1, {}, {0.1, 0.25, 0.02}, {});
  for (Vec3& v : s.velocity) v = {0, 0, -0.5};
  s.bodies[102].is_static = false, s.driven[102] = 1, s.velocity[102] = {0, -0.5, 0}, s.spin[102] = {0, 0, 1};
  for (int k = 0; k < 200; k++)
    add_grain(s, {0.021 * (k % 10), 0.021 * (k / 10 % 10), 0.11 + 0.021 * (k / 100)}, 0.009, 2500);
  add_grain(s, {0.1, 0.08, 0.27}, 0.11, 500, {0, 0, -2});
  s.step = step_limits(s).chosen;
  Stepper host(s);
  host.step(300);
  ASSERT_GT(host.contacts(), 100u);
  if (!detect::cuda_present()) GTEST_SKIP() << "there is no GPU that this build can use";
  Stepper device(s, {0, -1, BackendKind::cuda}), again(s, {0, 0, BackendKind::cuda});
  device.step(300), again.step(300);
  EXPECT_EQ(host.contacts(), device.contacts());
  expect_same_bits(device, again);
  for (std::size_t m = 0; m < s.movers(); m++) {
    EXPECT_LT(length(host.system().position[m] - device.system().position[m]), 1e-10) << m;
    EXPECT_LT(length(host.system().velocity[m] - device.system().velocity[m]), 1e-6) << m;
  }
  device.step(2000), again.step(1500);
  Stepper second(s, {0, -1, BackendKind::cuda});
  second.resume(again.snapshot()), second.step(500);
  expect_same_bits(device, second);
}

TEST(SettleBackendsTest, AGpuThatIsMissingIsSaid) {
  if (detect::cuda_present()) GTEST_SKIP() << "there is a GPU";
  EXPECT_STREQ(Stepper(heap(2, 2, 2, 1), {0, -1, BackendKind::automatic}).backend(), "omp");
  EXPECT_TRUE(refuses([&] { Stepper stepper(heap(2, 2, 2, 1), {0, -1, BackendKind::cuda}); }, "choose omp"));
}

}  // namespace
}  // namespace padder::settle
