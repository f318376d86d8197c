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
  // How fast a mover answers a push at its surface: the inverse of the mass that the push feels. A tangential
  // spring, 2/7 as stiff, feels 7/2 of the inverse mass of a sphere, so the normal one is as fast.
  double fastest = 0;
  for (std::size_t m = 0; m < s.movers(); m++) {
    if (s.inverse_mass[m] == 0) continue;
    double answer = s.inverse_mass[m];
    if (m < s.bodies.size()) {
      double arm = 0;
      for (const detect::Sphere& p : s.shapes[s.bodies[m].shape])
        arm = std::max(arm, std::hypot(p.x, p.y, p.z) + p.r);
      const Vec3& i = s.inverse_inertia[m];
      answer += arm * arm * std::max({i.x, i.y, i.z});
    }
    fastest = std::max(fastest, answer);
  }
  if (fastest == 0) throw Error("nothing in the scene can move: add grains, or bodies that are not static");
  double stiffness = s.law.stiffness;
  for (const Bushing& b : s.bushings) stiffness = std::max(stiffness, b.stiffness);
  const double duration = std::numbers::pi / std::sqrt(2 * fastest * stiffness);
  return {duration / 6, duration / 25};
}

}  // namespace padder::settle
