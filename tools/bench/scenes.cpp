// SPDX-License-Identifier: GPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"

namespace padder::bench {
namespace {

using detect::FloatSphere;
using detect::SplitMix64;
using Spheres = std::vector<FloatSphere>;

// With this many unit spheres in a unit of volume, a sphere has 1.7 contacts if they lie at random.
constexpr double kDensity = 0.1;

struct Point {
  double x, y, z;
};
FloatSphere sphere(const Point& p, double r = 1) {
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z), static_cast<float>(r)};
}
Point in_cube(SplitMix64& random, double edge) {
  return {random.unit() * edge, random.unit() * edge, random.unit() * edge};
}
// Box and Muller. Three independent normal numbers of this standard deviation.
Point gaussian(SplitMix64& random, double deviation) {
  const auto two = [&](double& a, double& b) {
    const double r = deviation * std::sqrt(-2 * std::log(1 - random.unit())),
                 at = 2 * std::numbers::pi * random.unit();
    a = r * std::cos(at), b = r * std::sin(at);
  };
  Point p;
  double unused;
  two(p.x, p.y), two(p.z, unused);
  return p;
}
Point direction(SplitMix64& random) {
  const double z = random.signed_unit(), around = std::sqrt(1 - z * z),
               at = 2 * std::numbers::pi * random.unit();
  return {around * std::cos(at), around * std::sin(at), z};
}
double edge_for(std::uint64_t n, double volume_of_one = 1 / kDensity) {
  return std::cbrt(static_cast<double>(n) * volume_of_one);
}

// n spheres at random in a cube; `radius` gives the radius of each. `size` is the mean volume that a sphere
// needs, in those of a unit sphere.
Spheres uniform(std::uint64_t n, SplitMix64& random, double size,
                const std::function<double(std::uint64_t)>& radius) {
  const double edge = edge_for(n, size / kDensity);
  Spheres spheres;
  spheres.reserve(n);
  for (std::uint64_t k = 0; k < n; k++) {
    const double r = radius(k);
    spheres.push_back(sphere(in_cube(random, edge), r));
  }
  return spheres;
}
Spheres placed(std::uint64_t n, const std::function<Point(std::uint64_t)>& at) {
  Spheres spheres;
  spheres.reserve(n);
  for (std::uint64_t k = 0; k < n; k++) spheres.push_back(sphere(at(k)));
  return spheres;
}

Spheres escaped(std::uint64_t n, SplitMix64& random) {
  Spheres spheres = detect::generate("dense", n, false);
  double edge = 0;
  for (const FloatSphere& s : spheres) edge = std::max<double>(edge, s.x);
  for (std::uint64_t k = 0; k < n; k += 1000) {
    const Point d = direction(random);
    const double far = random.unit() * 100 * edge;
    spheres[k] = sphere({spheres[k].x + d.x * far, spheres[k].y + d.y * far, spheres[k].z + d.z * far});
  }
  return spheres;
}

Spheres clump(std::uint64_t n, SplitMix64& random) {
  const double deviation = std::cbrt(0.0525 * static_cast<double>(n));  // 1.8 contacts for each sphere
  return placed(n, [&](std::uint64_t k) { return gaussian(random, k % 2 ? deviation : 12 * deviation); });
}

Spheres lognormal(std::uint64_t n, SplitMix64& random) {
  return uniform(n, random, 12, [&](std::uint64_t) { return std::exp(gaussian(random, 0.5).x); });
}

Spheres large(std::uint64_t n, SplitMix64& random) {
  return uniform(n, random, 2.6, [](std::uint64_t k) { return k % 2000 ? 1. : 30.; });
}

Spheres giants(std::uint64_t n, SplitMix64& random) {
  return uniform(n, random, 1.3, [](std::uint64_t k) { return k < 10 ? 40. : 1.; });
}

// Radii from 1 to 1,000: the number of spheres falls with the radius to the power of -3.5.
Spheres thousand(std::uint64_t n, SplitMix64& random) {
  return uniform(n, random, 30, [&](std::uint64_t) {
    return std::pow(1 + (std::pow(1000.0, -2.5) - 1) * random.unit(), -0.4);
  });
}

// 16 layers of a jittered lattice. `tilted`: turned, so that the bounds are nearly empty.
Spheres bed(std::uint64_t n, SplitMix64& random, bool tilted) {
  const double apart = 1.96;
  const auto side = static_cast<std::uint64_t>(std::ceil(std::sqrt(static_cast<double>(n) / 16)));
  return placed(n, [&](std::uint64_t k) {
    const std::uint64_t layer = k / (side * side), row = k / side % side, column = k % side;
    Point p = {apart * static_cast<double>(column) + 0.06 * random.signed_unit(),
               apart * static_cast<double>(row) + 0.06 * random.signed_unit(),
               apart * static_cast<double>(layer) + 0.06 * random.signed_unit()};
    // Two rotations by 45 degrees: about z, then about x.
    const double h = std::numbers::sqrt2 / 2;
    if (tilted) p = {(p.x - p.y) * h, (p.x + p.y) * h, p.z}, p = {p.x, (p.y - p.z) * h, (p.y + p.z) * h};
    return p;
  });
}

// A layer of thickness 4 on a sphere.
Spheres shell(std::uint64_t n, SplitMix64& random) {
  const double radius = std::sqrt(static_cast<double>(n) / (16 * std::numbers::pi * kDensity));
  return placed(n, [&](std::uint64_t) {
    const Point d = direction(random);
    const double at = radius + 2 * random.signed_unit();
    return Point{d.x * at, d.y * at, d.z * at};
  });
}

// A strand of diameter 6 along the diagonal of a cube.
Spheres line(std::uint64_t n, SplitMix64& random) {
  const double length = static_cast<double>(n) / (kDensity * 9 * std::numbers::pi);
  return placed(n, [&](std::uint64_t) {
    const double at = random.unit() * length / std::numbers::sqrt3;
    const Point d = direction(random);
    const double wide = 3 * std::cbrt(random.unit());
    return Point{at + d.x * wide, at + d.y * wide, at + d.z * wide};
  });
}

// Sierpinski's tetrahedron: dimension 2.
Spheres fractal(std::uint64_t n, SplitMix64& random) {
  int depth = 1;
  while (std::pow(4.0, depth) < static_cast<double>(n)) depth++;
  const double edge = 1.6 * std::pow(2.0, depth) * std::sqrt(static_cast<double>(n) / std::pow(4.0, depth));
  const Point corners[4] = {{0, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
  return placed(n, [&](std::uint64_t) {
    Point p = {0, 0, 0};
    double half = edge / 2;
    for (int k = 0; k < depth; k++, half /= 2) {
      const Point& c = corners[random.bits() >> 62];
      p.x += half * c.x, p.y += half * c.y, p.z += half * c.z;
    }
    return Point{p.x + random.unit(), p.y + random.unit(), p.z + random.unit()};
  });
}

// Heaps of 1,000 spheres, each as dense as the others, that fill a thousandth of their bounds.
Spheres islands(std::uint64_t n, SplitMix64& random) {
  const double edge = edge_for(n) * 10;
  const std::uint64_t heaps = n / 1000 + 1;
  Spheres centres;
  for (std::uint64_t k = 0; k < heaps; k++) centres.push_back(sphere(in_cube(random, edge)));
  return placed(n, [&](std::uint64_t k) {
    const FloatSphere& c = centres[k % heaps];
    const Point p = gaussian(random, 4.8);
    return Point{c.x + p.x, c.y + p.y, c.z + p.z};
  });
}

// Grains that lie denser at the bottom: the density falls by e each tenth of the edge, and the highest are a
// hundred times as high as the edge.
Spheres sediment(std::uint64_t n, SplitMix64& random) {
  const double edge = std::cbrt(static_cast<double>(n) / kDensity * 5);
  return placed(n, [&](std::uint64_t k) {
    const Point p = in_cube(random, edge);
    const double high = k % 1000 ? -0.1 * edge * std::log(1 - random.unit()) : 100 * edge * random.unit();
    return Point{p.x, p.y, high};
  });
}

// Grains of two sizes in two places: small ones in a corner of a cube that is full of large ones.
Spheres corner(std::uint64_t n, SplitMix64& random) {
  const double small = edge_for(n / 2 + 1), edge = edge_for(n / 2 + 1, 1000 / kDensity);
  Spheres spheres;
  spheres.reserve(n);
  for (std::uint64_t k = 0; k < n; k++)
    spheres.push_back(k % 2 ? sphere(in_cube(random, small)) : sphere(in_cube(random, edge), 10));
  return spheres;
}

}  // namespace

const std::vector<SceneEntry>& uneven_scenes() {
  static const std::vector<SceneEntry> all{
      {"dense", "a jittered lattice of equal spheres: what the others are compared with", 1},
      {"escaped", "dense, one sphere in a thousand thrown up to 100 edges away", 1.7},
      {"clump", "half in a Gaussian clump, half spread 12 times as far", 1.7},
      {"bed", "16 layers deep", 1.7},
      {"tilted", "such a bed, turned", 1.7},
      {"shell", "on a sphere", 1.7},
      {"line", "a strand along the diagonal of a cube", 1.7},
      {"fractal", "Sierpinski's tetrahedron", 1.7},
      {"islands", "heaps of 1,000, far from each other", 1.7},
      {"sediment", "denser at the bottom, some very high", 1.7},
      {"poly100", "radii from 1 to 100", 2.2},
      {"lognormal", "log-normal radii, sigma 0.5", 2.2},
      {"large", "one in 2,000 is 30 times as large", 2.2},
      {"corner", "small spheres in a corner of large ones", 2.2},
      {"giants", "ten of radius 40", 3},
      {"thousand", "radii from 1 to 1,000", 3},
  };
  return all;
}

std::vector<FloatSphere> uneven_scene(const std::string& name, std::uint64_t n) {
  SplitMix64 random(54321 + n);
  Spheres spheres;
  if (name == "dense" || name == "poly100")
    return detect::generate(name, n);
  else if (name == "escaped")
    spheres = escaped(n, random);
  else if (name == "clump")
    spheres = clump(n, random);
  else if (name == "bed" || name == "tilted")
    spheres = bed(n, random, name == "tilted");
  else if (name == "shell")
    spheres = shell(n, random);
  else if (name == "line")
    spheres = line(n, random);
  else if (name == "fractal")
    spheres = fractal(n, random);
  else if (name == "islands")
    spheres = islands(n, random);
  else if (name == "sediment")
    spheres = sediment(n, random);
  else if (name == "lognormal")
    spheres = lognormal(n, random);
  else if (name == "large")
    spheres = large(n, random);
  else if (name == "corner")
    spheres = corner(n, random);
  else if (name == "giants")
    spheres = giants(n, random);
  else if (name == "thousand")
    spheres = thousand(n, random);
  else {
    std::string known;
    for (const SceneEntry& e : uneven_scenes()) known += (known.empty() ? "" : ", ") + std::string(e.name);
    throw Error("bench scenes has no scene '" + name + "': it has " + known);
  }
  for (std::uint64_t k = n; k-- > 1;) std::swap(spheres[k], spheres[random.bits() % (k + 1)]);
  return spheres;
}

void move_a_little(std::vector<FloatSphere>& spheres, std::uint64_t step) {
  constexpr double kFar = 0.01;
  for (std::uint64_t k = 0; k < spheres.size(); k++) {
    SplitMix64 random(step * 0x100000000ull + k);
    FloatSphere& s = spheres[k];
    s.x += static_cast<float>(kFar * random.signed_unit());
    s.y += static_cast<float>(kFar * random.signed_unit());
    s.z += static_cast<float>(kFar * random.signed_unit());
  }
}

}  // namespace padder::bench
