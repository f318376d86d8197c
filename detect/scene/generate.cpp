// SPDX-License-Identifier: MIT
#include "detect/scene/generate.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder::detect {
namespace {

// A face-centred cubic lattice whose nearest distance is a little below the diameter, with jittered
// coordinates.
std::vector<FloatSphere> dense(std::uint64_t n, SplitMix64& random) {
  const double nearest = 2 / 1.013313, cell = nearest * std::sqrt(2.0), jitter = 0.06;
  const double corner[4][3] = {{0, 0, 0}, {0.5, 0.5, 0}, {0.5, 0, 0.5}, {0, 0.5, 0.5}};
  auto side = static_cast<std::uint64_t>(std::ceil(std::cbrt(static_cast<double>(n) / 4) - 1e-9));
  while (4 * side * side * side < n) side++;
  std::vector<FloatSphere> spheres(n);
#pragma omp parallel for schedule(static)
  for (std::uint64_t k = 0; k < n; k++) {
    SplitMix64 own = random.after(3 * k);
    const std::uint64_t c = k / 4, at[3] = {c % side, c / side % side, c / side / side};
    double p[3];
    for (int a = 0; a < 3; a++)
      p[a] = (static_cast<double>(at[a]) + corner[k % 4][a]) * cell + own.signed_unit() * jitter * nearest;
    spheres[k] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 1};
  }
  random = random.after(3 * n);
  return spheres;
}

// Uniform positions in a cube that is so large that there are `contacts` contacts for each sphere, on
// average. `radius` maps [0, 1) to a radius; null: 1 for all.
std::vector<FloatSphere> poisson(std::uint64_t n, double contacts,
                                 const std::function<double(double)>& radius, SplitMix64& random) {
  double mean[3] = {1, 1, 1};  // the mean of the radius, of its square and of its cube
  if (radius) {
    constexpr int kSamples = 2000000;
    for (double& m : mean) m = 0;
    for (int k = 0; k < kSamples; k++) {
      const double r = radius((k + .5) / kSamples);
      mean[0] += r, mean[1] += r * r, mean[2] += r * r * r;
    }
    for (double& m : mean) m /= kSamples;
  }
  // Two spheres touch if their centres are not farther apart than the sum of the radii. The mean volume of
  // the ball with that radius is 4/3 pi (2 mean[2] + 6 mean[1] mean[0]).
  const double density =
      contacts / (0.5 * 4.0 / 3.0 * std::numbers::pi * (2 * mean[2] + 6 * mean[1] * mean[0]));
  const double edge = std::cbrt(static_cast<double>(n) / density);
  std::vector<FloatSphere> spheres(n);
#pragma omp parallel for schedule(static)
  for (std::uint64_t k = 0; k < n; k++) {
    SplitMix64 own = random.after(4 * k);
    const double x = own.unit() * edge, y = own.unit() * edge, z = own.unit() * edge, u = own.unit();
    spheres[k] = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z),
                  radius ? static_cast<float>(radius(u)) : 1.f};
  }
  random = random.after(4 * n);
  return spheres;
}

// A uniformly random rotation from a random unit quaternion (Shoemake, Uniform random rotations, 1992).
void random_rotation(SplitMix64& random, double (&m)[9]) {
  const double u = random.unit(), a = 2 * std::numbers::pi * random.unit(),
               b = 2 * std::numbers::pi * random.unit();
  const double x = std::sqrt(1 - u) * std::sin(a), y = std::sqrt(1 - u) * std::cos(a);
  const double z = std::sqrt(u) * std::sin(b), w = std::sqrt(u) * std::cos(b);
  rotation_of(w, x, y, z, m);
}

}  // namespace

std::vector<FloatSphere> generate(const std::string& name, std::uint64_t n, bool random_order) {
  SplitMix64 random(12345 + n);
  const auto one_to_four = [](double u) { return 1 + 3 * u; };
  const auto power_law = [](double u) {
    return std::pow(1 + (std::pow(100.0, -2.5) - 1) * u, -0.4);
  };  // density r^-3.5
  std::vector<FloatSphere> spheres;
  if (name == "dense")
    spheres = dense(n, random);
  else if (name == "dilute")
    spheres = poisson(n, 0.45, nullptr, random);
  else if (name == "poly35")
    spheres = poisson(n, 3.5, one_to_four, random);
  else if (name == "poly045")
    spheres = poisson(n, 0.45, one_to_four, random);
  else if (name == "poly100")
    spheres = poisson(n, 3.5, power_law, random);
  else
    throw Error("no generator is called '" + excerpt(name) +
                "': there are dense, dilute, poly35, poly045 and poly100");
  if (random_order)
    for (std::uint64_t k = n; k-- > 1;) std::swap(spheres[k], spheres[random.bits() % (k + 1)]);
  return spheres;
}

BodyScene generate_bodies(std::uint64_t count) {
  BodyScene scene;
  constexpr int kSpheres = 64;
  for (int k = 0; k < kSpheres; k++) {  // a Fibonacci lattice, which is nearly even on the shell
    const double z = 1 - (2 * k + 1.0) / kSpheres, around = std::sqrt(1 - z * z);
    const double angle = k * std::numbers::pi * (3 - std::sqrt(5.0));
    scene.shape.push_back({3 * around * std::cos(angle), 3 * around * std::sin(angle), 3 * z, 1});
  }
  scene.bodies = pile(count, 4, 2);
  return scene;
}

std::vector<Body> pile(std::uint64_t n, double bound, double spacing) {
  SplitMix64 random(12345 + n);
  std::vector<Body> bodies(n);
  const double cell = spacing * bound;
  std::uint64_t side = 1;
  while (side * side * side < n) side++;
  for (std::uint64_t k = 0; k < n; k++) {
    Body& b = bodies[k];
    const std::uint64_t at[3] = {k % side, k / side % side, k / side / side};
    for (int a = 0; a < 3; a++)
      b.position[a] = (static_cast<double>(at[a]) + 0.1 * random.signed_unit()) * cell;
    random_rotation(random, b.rotation);
    b.family = static_cast<std::uint32_t>(33 + k);
  }
  return bodies;
}

}  // namespace padder::detect
