// SPDX-License-Identifier: MIT
#include "tools/settle/system.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/asset/error.h"

namespace padder::settle {

namespace {

// 1 / mass. Throws Error for a mass, or a moment, with which no motion can be computed in double.
double inverse_of(double mass, const char* of, std::size_t number) {
  const double inverse = 1 / mass;
  if (!(inverse > 0 && std::isfinite(inverse)))
    throw Error(of + std::to_string(number) + " has a mass or moment of inertia that is too " +
                (mass > 1 ? "large" : "small") +
                " for numbers in double: use other units, or another density");
  return inverse;
}

// How many spheres of a body, in the frame of its principal axes, may lie on one plane: of the planes across
// the axes and across the diagonals between them. They reach equally far, but for a hundredth of a radius.
std::size_t contacts_at_once(const std::vector<detect::Sphere>& shape) {
  double smallest = INFINITY;
  for (const detect::Sphere& p : shape) smallest = std::min(smallest, p.r);
  std::size_t most = 0;
  for (int n = 0; n < 27; n++) {
    const Vec3 toward{double(n % 3 - 1), double(n / 3 % 3 - 1), double(n / 9 - 1)};
    if (toward == Vec3{}) continue;
    std::vector<double> reach;
    for (const detect::Sphere& p : shape)
      reach.push_back(dot(toward, {p.x, p.y, p.z}) / length(toward) + p.r);
    const double least = *std::ranges::max_element(reach) - smallest / 100;
    most = std::max<std::size_t>(most, std::ranges::count_if(reach, [&](double r) { return r >= least; }));
  }
  return most;
}

}  // namespace

double System::radius_of(std::uint64_t sphere) const {
  if (sphere >= body_spheres()) return grain_radius[sphere - body_spheres()];
  const std::uint32_t body = mover_of(sphere);
  return shapes[bodies[body].shape][sphere - first_sphere[body]].r;
}

std::uint32_t System::mover_of(std::uint64_t sphere) const {
  if (sphere >= body_spheres()) return static_cast<std::uint32_t>(bodies.size() + (sphere - body_spheres()));
  const auto after = std::upper_bound(first_sphere.begin(), first_sphere.end(), sphere);
  return static_cast<std::uint32_t>(after - first_sphere.begin() - 1);
}

std::uint32_t add_grain(System& s, const Vec3& center, double radius, double density, const Vec3& velocity) {
  const double mass = density * 4 / 3 * std::numbers::pi * radius * radius * radius;
  const std::size_t number = s.grain_radius.size();
  const double inverse = inverse_of(0.4 * mass * radius * radius, "grain ", number);
  s.position.push_back(center), s.velocity.push_back(velocity);
  s.momentum.push_back({}), s.spin.push_back({});
  s.inverse_mass.push_back(inverse_of(mass, "grain ", number)),
      s.inverse_inertia.push_back({inverse, inverse, inverse});
  s.grain_radius.push_back(radius);
  return static_cast<std::uint32_t>(s.movers() - 1);
}

std::uint32_t add_body(System& s, std::uint32_t shape, const Mass& mass, const Vec3& center,
                       const Quaternion& orientation) {
  if (!s.grain_radius.empty()) throw Error("bodies must be added before grains");
  const auto number = static_cast<std::uint32_t>(s.bodies.size());
  if (s.first_sphere.empty()) s.first_sphere.push_back(0);
  s.first_sphere.push_back(s.first_sphere.back() + s.shapes.at(shape).size());
  detect::Body body;
  body.shape = shape, body.is_static = mass.mass == 0;
  s.bodies.push_back(body);
  const auto inverse = [&](double v) { return mass.mass == 0 ? 0 : inverse_of(v, "body ", number); };
  s.position.push_back(center), s.velocity.push_back({}), s.momentum.push_back({}), s.spin.push_back({});
  s.inverse_mass.push_back(inverse(mass.mass));
  s.inverse_inertia.push_back({inverse(mass.moments.x), inverse(mass.moments.y), inverse(mass.moments.z)});
  s.orientation.push_back(orientation), s.driven.push_back(0);
  place_body(s, number);
  return number;
}

void place_body(System& s, std::size_t b) {
  detect::Body& body = s.bodies[b];
  matrix_of(s.orientation[b], body.rotation);
  body.position[0] = s.position[b].x, body.position[1] = s.position[b].y, body.position[2] = s.position[b].z;
}

StepLimits step_limits(const System& s) {
  // A step for one contact at a time also serves a body that lies on so many. Beyond, the dampers of all
  // together ask for a step that is shorter by their number: plates of 100, 256 and 900 spheres and rings of
  // 64, 144 and 400 that fall flat need a step of 1/2, 1/4, 1/12, 1/2, 1/3 and 1/8.
  constexpr double kAtOnce = 40;
  std::vector<double> crowd;  // of each shape: how many times as many
  for (const auto& shape : s.shapes)
    crowd.push_back(std::max(1.0, static_cast<double>(contacts_at_once(shape)) / kAtOnce));
  // How fast a mover answers a push at its surface: the inverse of the mass that the push feels. A tangential
  // spring, 2/7 as stiff, feels 7/2 of the inverse mass of a sphere, so the normal one is as fast.
  double fastest = 0, in_crowd = 0;
  for (std::size_t m = 0; m < s.movers(); m++) {
    if (s.inverse_mass[m] == 0) continue;
    double answer = s.inverse_mass[m], many = 1;
    if (m < s.bodies.size()) {
      double arm = 0;
      for (const detect::Sphere& p : s.shapes[s.bodies[m].shape])
        arm = std::max(arm, std::hypot(p.x, p.y, p.z) + p.r);
      const Vec3& i = s.inverse_inertia[m];
      answer += arm * arm * std::max({i.x, i.y, i.z}), many = crowd[s.bodies[m].shape];
    }
    fastest = std::max(fastest, answer), in_crowd = std::max(in_crowd, answer * many * many);
  }
  if (fastest == 0) throw Error("nothing in the scene can move: add grains, or bodies that are not static");
  double stiffness = s.law.stiffness;
  for (const Bushing& b : s.bushings) stiffness = std::max(stiffness, b.stiffness);
  const auto duration = [&](double answer) { return std::numbers::pi / std::sqrt(2 * answer * stiffness); };
  StepLimits limits{duration(fastest) / 6, duration(in_crowd) / 25};
  // A dashpot that is damped more than critically slows its points down in less time than its spring would
  // turn them. Half of that time is stable; an eighth is what a critical one gets by its spring.
  for (const Bushing& b : s.bushings) {
    const auto answer = [&](std::uint32_t body, const Vec3& at) {
      const Vec3& i = s.inverse_inertia[body];
      return s.inverse_mass[body] + dot(at, at) * std::max({i.x, i.y, i.z});
    };
    const double rate = b.damping * (answer(b.a, b.on_a) + answer(b.b, b.on_b));
    if (rate > 0)
      limits.longest = std::min(limits.longest, 1 / rate),
      limits.chosen = std::min(limits.chosen, 0.25 / rate);
  }
  return limits;
}

}  // namespace padder::settle
