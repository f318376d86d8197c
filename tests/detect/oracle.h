// SPDX-License-Identifier: MIT
// The oracle of the detector's tests: it tests every pair in double, and shares no code with the detector.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/generate.h"
#include "padding/asset/error.h"
#include "tests/detect/backends.h"
#include "tests/detect/random.h"

namespace padder::detect {

inline std::ostream& operator<<(std::ostream& out, const Pair& p) {
  return out << "(" << p.i << ", " << p.j << ")";
}

struct TestScene {
  std::vector<Sphere> spheres;
  std::vector<std::uint32_t> family, mask;  // empty: 0 for all

  // The scene with every coordinate and radius rounded to float.
  TestScene rounded() const {
    TestScene s = *this;
    for (Sphere& p : s.spheres)
      p = {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z),
           static_cast<float>(p.r)};
    return s;
  }
  void shift(double by) {
    for (Sphere& p : spheres) p.x += by, p.y -= by, p.z += 2 * by;
  }
  void scale(double by) {
    for (Sphere& p : spheres) p.x *= by, p.y *= by, p.z *= by, p.r *= by;
  }
  // Sphere k is of family k % families, and its mask is k % masks.
  void tag(std::uint32_t families, std::uint32_t masks) {
    for (std::uint32_t k = 0; k < spheres.size(); k++)
      family.push_back(k % families), mask.push_back(k % masks);
  }
};

// Borrows the spheres, of Sphere or FloatSphere.
template <class List>
Input input_of(const List& s) {
  Input input;
  if (std::size(s) > 0) input.spheres = spheres_of(std::size(s), &std::data(s)->x, &std::data(s)->r);
  input.spheres.center_stride = input.spheres.radius_stride = 4;
  return input;
}

inline std::vector<Sphere> in_double_of(const std::vector<FloatSphere>& spheres) {
  std::vector<Sphere> wide;
  for (const FloatSphere& s : spheres) wide.push_back({s.x, s.y, s.z, s.r});
  return wide;
}

// A float record is as near to that of double as detector.h promises.
inline void expect_record(const Sphere& a, const Sphere& b, const Normal<float>& n) {
  const double d = std::hypot(b.x - a.x, b.y - a.y, b.z - a.z), s = a.r + b.r;
  if (s < 1e-30) return;  // a float record has no digits for it
  ASSERT_NEAR(n.depth, s - d, 4e-7 * (s + d));
  if (!(d > 1e-30 * s)) return;
  ASSERT_NEAR(n.x, (b.x - a.x) / d, 1e-6);
  ASSERT_NEAR(n.y, (b.y - a.y) / d, 1e-6);
  ASSERT_NEAR(n.z, (b.z - a.z) / d, 1e-6);
}

inline bool oracle_admits(std::uint32_t fa, std::uint32_t ma, std::uint32_t fb, std::uint32_t mb) {
  if (fa != 0 && fa == fb) return false;
  for (std::uint32_t bit = 0; bit < 32; bit++) {
    if ((ma & (1u << bit)) && fb == bit + 1) return false;
    if ((mb & (1u << bit)) && fa == bit + 1) return false;
  }
  return true;
}

// The exact test for spheres of any size, whose gap may be as large as the margin. If the longest of its four
// lengths is very large or very small, all are scaled by a power of two so that it is between 0.5 and 1. Then
// no square that matters overflows or underflows.
inline bool oracle_touching(const Sphere& a, const Sphere& b, double margin = 0) {
  double v[4] = {b.x - a.x, b.y - a.y, b.z - a.z, a.r + b.r + margin}, longest = 0;
  for (const double c : v) longest = std::max(longest, std::abs(c));
  int exponent = 0;
  if (!(longest > 1e-50 && longest < 1e50)) {
    std::frexp(longest, &exponent);
    for (double& c : v) c = std::ldexp(c, -exponent);
  }
  const volatile double x = v[0] * v[0], y = v[1] * v[1], z = v[2] * v[2];
  const volatile double xy = x + y, d2 = xy + z, r2 = v[3] * v[3];  // volatile: no operation is fused
  return d2 <= r2;
}

inline bool before(const Pair& a, const Pair& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; }
inline std::vector<Pair> sorted(std::span<const Pair> pairs) {
  std::vector<Pair> p(pairs.begin(), pairs.end());
  std::sort(p.begin(), p.end(), before);
  return p;
}
inline std::uint64_t hash_of(const std::vector<Pair>& pairs) {
  std::uint64_t sum = 0;
  for (const Pair& p : pairs) sum += pair_hash(p.i, p.j);
  return sum;
}

// The scene as input in float or double; keeps the arrays alive.
struct Arranged {
  std::vector<float> f;
  std::vector<double> d;
  Input input;
  Arranged(const TestScene& s, Scalar scalar) {
    f.reserve(3), d.reserve(3);  // so that the radii of no spheres begin somewhere, too
    for (const Sphere& p : s.spheres)
      for (const double v : {p.x, p.y, p.z, p.r})
        scalar == Scalar::f32 ? f.push_back(static_cast<float>(v)) : d.push_back(v);
    if (scalar == Scalar::f32)
      input.spheres = spheres_of<float>(s.spheres.size(), f.data(), f.data() + 3);
    else
      input.spheres = spheres_of<double>(s.spheres.size(), d.data(), d.data() + 3);
    input.spheres.center_stride = input.spheres.radius_stride = 4;
    if (!s.family.empty()) input.spheres.family = s.family.data();
    if (!s.mask.empty()) input.spheres.mask = s.mask.data();
  }
  Arranged(const Arranged&) = delete;
};

// A sphere of the input as the oracle sees it. body 0: it is loose.
struct Seen {
  Sphere sphere;
  std::uint32_t family, mask, world, body;
  bool is_static;
};
inline std::vector<Seen> seen(const Input& in) {
  std::vector<Seen> all;
  for (std::size_t b = 0; b < in.bodies.size(); b++) {
    const Body& body = in.bodies[b];
    for (std::uint64_t k = 0; k < in.shapes[body.shape].count; k++)
      all.push_back({placed(body, in.shapes[body.shape].spheres[k]), body.family, body.mask, body.world,
                     static_cast<std::uint32_t>(b + 1), body.is_static});
  }
  const Spheres& s = in.spheres;
  const auto number = [&](const void* numbers, std::uint64_t k) {
    return s.scalar == Scalar::f64 ? static_cast<const double*>(numbers)[k]
                                   : static_cast<const float*>(numbers)[k];
  };
  for (std::uint64_t k = 0; k < s.count; k++) {
    const std::uint64_t c = k * s.center_stride;
    all.push_back({{number(s.centers, c), number(s.centers, c + 1), number(s.centers, c + 2),
                    number(s.radii, k * s.radius_stride)},
                   s.family ? s.family[k] : 0,
                   s.mask ? s.mask[k] : 0,
                   s.world ? s.world[k] : s.world_of_all,
                   0,
                   s.is_static && s.is_static[k]});
  }
  return all;
}
inline bool oracle_meets(const Seen& a, const Seen& b) {
  if (a.is_static && b.is_static) return false;
  if (a.body != 0 && a.body == b.body) return false;
  if (a.world != b.world && a.world != kEveryWorld && b.world != kEveryWorld) return false;
  return oracle_admits(a.family, a.mask, b.family, b.mask);
}
// Every contact of the input, ascending.
inline std::vector<Pair> oracle(const Input& in, const CallOptions& o = {}) {
  const std::vector<Seen> all = seen(in);
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < all.size(); i++)
    for (std::uint32_t j = i + 1; j < all.size(); j++)
      if (oracle_touching(all[i].sphere, all[j].sphere, o.margin) && oracle_meets(all[i], all[j]) &&
          owns(o.own, midpoint(all[i].sphere, all[j].sphere)))
        pairs.push_back({i, j});
  return pairs;
}
inline std::vector<Pair> brute_force(const TestScene& s) { return oracle(Arranged(s, Scalar::f64).input); }

// n spheres at uniform places of a cube. The volume of the cube is `per_sphere` times the sum of the cubes of
// the diameters. Radii are from 1 to `ratio`; small ones are far more frequent.
inline TestScene random_scene(std::uint32_t n, double ratio, double per_sphere, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  TestScene s;
  double volume = 0;
  std::vector<double> radii;
  for (std::uint32_t k = 0; k < n; k++) {
    const double u = unit(random), r = ratio == 1 ? 1 : 1 / (1 - u * (1 - 1 / ratio));
    radii.push_back(r), volume += 8 * r * r * r;
  }
  const double edge = std::cbrt(volume * per_sphere);
  for (const double r : radii)
    s.spheres.push_back({unit(random) * edge, unit(random) * edge, unit(random) * edge, r});
  return s;
}

// A grain of this radius in any direction from a ball, its centre `away` from the ball's surface.
inline Sphere grain_on(const Sphere& ball, double radius, double away, std::mt19937_64& random) {
  const double d[3] = {signed_unit(random), signed_unit(random), signed_unit(random)},
               by = (ball.r + away) / std::hypot(d[0], d[1], d[2]);
  return {ball.x + by * d[0], ball.y + by * d[1], ball.z + by * d[2], radius};
}

inline TestScene lattice(int side, double spacing, double radius) {
  TestScene s;
  for (int x = 0; x < side; x++)
    for (int y = 0; y < side; y++)
      for (int z = 0; z < side; z++) s.spheres.push_back({spacing * x, spacing * y, spacing * z, radius});
  return s;
}

// Shapes, bodies of them, and loose spheres.
struct TestBodies {
  std::vector<std::vector<Sphere>> assets;
  std::vector<Body> bodies;
  std::vector<Sphere> loose;
  std::vector<std::uint32_t> family, mask, world;  // of the loose spheres; empty: 0 for all
  std::vector<std::uint8_t> is_static;             // likewise
  mutable std::vector<Shape> shapes;               // that the input borrows

  Input input() const {
    shapes.clear();
    for (const auto& a : assets) shapes.push_back({a.data(), a.size()});
    Input in = input_of(loose);
    if (!family.empty()) in.spheres.family = family.data();
    if (!mask.empty()) in.spheres.mask = mask.data();
    if (!world.empty()) in.spheres.world = world.data();
    if (!is_static.empty()) in.spheres.is_static = is_static.data();
    in.shapes = shapes, in.bodies = bodies;
    return in;
  }
  void scale(double by) {
    const auto scaled = [&](Sphere& s) { s = {s.x * by, s.y * by, s.z * by, s.r * by}; };
    for (auto& a : assets) std::for_each(a.begin(), a.end(), scaled);
    std::for_each(loose.begin(), loose.end(), scaled);
    for (Body& b : bodies)
      for (double& p : b.position) p *= by;
  }
  void shift(double by) {
    for (Body& b : bodies) b.position[0] += by, b.position[1] -= by, b.position[2] += 2 * by;
    for (Sphere& s : loose) s.x += by, s.y -= by, s.z += 2 * by;
  }
};

inline void turn(std::mt19937_64& random, Body& body) {
  std::normal_distribution<double> normal;
  rotation_of(normal(random), normal(random), normal(random), normal(random), body.rotation);
}
inline Body body_at(std::uint32_t shape, double x, double y, double z) {
  Body b;
  b.position[0] = x, b.position[1] = y, b.position[2] = z, b.shape = shape;
  return b;
}
inline Body body_at(std::uint32_t shape, double x, double y, double z, std::mt19937_64& random) {
  Body b = body_at(shape, x, y, z);
  turn(random, b);
  return b;
}

}  // namespace padder::detect
