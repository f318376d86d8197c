// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/stability/precision_cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "detect/scene/generate.h"

namespace padder::bench {
namespace {

using detect::Pair;
using detect::Sphere;
using detect::SplitMix64;
using Spheres = std::vector<Sphere>;

// edge^3 spheres around the origin.
Spheres lattice_of(std::uint32_t edge, double spacing, double radius) {
  Spheres out;
  const double half = edge / 2;
  for (std::uint32_t z = 0; z < edge; z++)
    for (std::uint32_t y = 0; y < edge; y++)
      for (std::uint32_t x = 0; x < edge; x++)
        out.push_back({spacing * (x - half), spacing * (y - half), spacing * (z - half), radius});
  return out;
}

Sphere at_random(SplitMix64& random, double half, double radius) {
  return {half * random.signed_unit(), half * random.signed_unit(), half * random.signed_unit(), radius};
}

Sphere along(SplitMix64& random, const Sphere& from, double distance, double radius) {
  double v[3], length = 0;
  do {
    for (double& c : v) c = random.signed_unit();
    length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  } while (!(length > 0.1 && length < 1));
  return {from.x + distance * v[0] / length, from.y + distance * v[1] / length,
          from.z + distance * v[2] / length, radius};
}

// Some 12 contacts a sphere.
Spheres dense(std::uint32_t n, std::uint64_t seed, double scale = 1, double shift = 0) {
  SplitMix64 random(seed);
  const double half = 0.5 * std::cbrt(n * 2.8);
  Spheres out;
  for (std::uint32_t k = 0; k < n; k++) {
    const Sphere s = at_random(random, half, 0.5 + 0.5 * random.unit());
    out.push_back({scale * s.x + shift, scale * s.y - shift, scale * s.z + 2 * shift, scale * s.r});
  }
  return out;
}

// Pairs whose gap is between -8 and 8 units in the last place of a float, or of a double.
Spheres nearly_touching(double unit) {
  SplitMix64 random(1);
  Spheres out;
  for (int k = 0; k < 6000; k++) {
    const Sphere a = {10.0 * (k % 20), 10.0 * (k / 20 % 20), 10.0 * (k / 400), 1 + random.unit()};
    const double r = 1 + random.unit();
    out.push_back(a);
    out.push_back(along(random, a, (a.r + r) * (1 + unit * (k % 17 - 8)), r));
  }
  return out;
}

Spheres contained() {
  SplitMix64 random(2);
  Spheres out;
  for (int k = 0; k < 50; k++) out.push_back({0, 0, 0, 100.0 + k});  // shells within shells
  for (int k = 0; k < 8000; k++) out.push_back(at_random(random, 57, 0.5));
  return out;
}

// One sphere of radius 1e6 and 8,000 of radius 1 that touch it to within 1e-9 of the large radius.
Spheres pebbles_on_a_planet() {
  SplitMix64 random(3);
  Spheres out = {{0, 0, 0, 1e6}};
  for (int k = 0; k < 8000; k++)
    out.push_back(along(random, out[0], 1e6 + 1 + 1e-3 * random.signed_unit(), 1));
  return out;
}

Spheres half_in_one_bin() {
  SplitMix64 random(4);
  Spheres out = lattice_of(20, 1, 0.5);
  for (int k = 0; k < 8000; k++) out.push_back(at_random(random, 0.05, 0.002));
  return out;
}

// Centres on faces, edges and corners of unit bins, and one unit in the last place on either side.
Spheres on_bin_faces() {
  SplitMix64 random(5);
  Spheres out;
  const auto face = [&] {
    const double v = static_cast<double>(random.bits() % 21) - 10;
    const std::uint64_t side = random.bits() % 4;
    return side == 0 ? std::nextafter(v, -INFINITY) : side == 1 ? std::nextafter(v, INFINITY) : v;
  };
  for (int k = 0; k < 8000; k++)
    out.push_back({face(), random.bits() % 2 ? face() : 10 * random.signed_unit(), face(), 0.5});
  return out;
}

Spheres on_a_line(int n, double dx, double dy, double dz) {
  Spheres out;
  for (int k = 0; k < n; k++) out.push_back({k * dx, k * dy, k * dz, 0.5});
  return out;
}

Spheres concentric() {
  Spheres out;
  for (int k = 0; k < 1500; k++) out.push_back({0.3, 0.3, 0.3, 1 + k / 1500.0});
  return out;
}

Spheres points_twice() {
  Spheres out = lattice_of(16, 0.1, 0);
  const Spheres again = out;
  out.insert(out.end(), again.begin(), again.end());
  return out;
}

bool formula(const Sphere& a, const Sphere& b) {
  double x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, s = a.r + b.r;
  if (s < 0x1p-500) x *= 0x1p600, y *= 0x1p600, z *= 0x1p600, s *= 0x1p600;
  return x * x + y * y + z * z <= s * s;
}

}  // namespace

std::vector<PrecisionCase> precision_cases(std::uint32_t edge) {
  const double below_half = std::nextafter(0.5f, 0.0f), root3 = 1 / std::numbers::sqrt3;
  Spheres plane = lattice_of(20, 1, 0.5);
  for (Sphere& s : plane) s = {s.x + 20 * (s.z + 10), s.y, 0, s.r};
  return {
      {"touching", "each pair of neighbours touches exactly", lattice_of(edge, 1, 0.5), edge},
      {"an ulp apart", "radii are one float ulp too small to touch", lattice_of(edge, 1, below_half), edge},
      {"tenths", "touching, but 0.1 is neither a float nor a double", lattice_of(edge, 0.1, 0.05), edge},
      {"gaps of float ulps", "gaps of -8 to 8 x 2^-24 of the distance", nearly_touching(0x1p-24)},
      {"gaps of double ulps", "gaps of -8 to 8 x 2^-53 of the distance", nearly_touching(0x1p-53)},
      {"concentric", "1,500 spheres around one point: no normal", concentric()},
      {"equal", "1,000 times the same sphere", Spheres(1000, {0.1, 0.2, 0.3, 0.4})},
      {"contained", "shells within shells, and 8,000 spheres in them", contained()},
      {"points", "radii of 0, each point twice", points_twice()},
      {"bin faces", "centres on the faces of bins and an ulp beside", on_bin_faces(), 0, 1},
      {"half in one bin", "8,000 of 16,000 spheres in one bin", half_in_one_bin()},
      {"1 : 1e6", "radii 1 and 1e6, touching to 1e-9", pebbles_on_a_planet()},
      {"line", "8,000 centres along x", on_a_line(8000, 0.9, 0, 0)},
      {"diagonal", "8,000 centres on a diagonal, touching", on_a_line(8000, root3, root3, root3)},
      {"plane", "8,000 centres in a plane, touching", plane},
      {"far", "1e5 diameters from the origin", dense(8000, 6, 1, 1e5)},
      {"very far", "1e9 diameters from the origin", dense(2000, 7, 1, 1e9)},
      {"float denormals", "sizes of 1e-42", dense(1000, 8, 1e-42)},
      {"double denormals", "sizes of 1e-310", dense(1000, 9, 1e-310)},
      {"squares overflow floats", "sizes of 1e30", dense(8000, 10, 1e30)},
      {"beyond floats", "sizes of 1e97", dense(8000, 11, 1e97)},
  };
}

std::vector<Sphere> rounded(std::vector<Sphere> spheres) {
  for (Sphere& s : spheres)
    s = {static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z), static_cast<float>(s.r)};
  return spheres;
}

std::vector<Pair> all_contacts(const Spheres& spheres, std::uint32_t lattice) {
  std::vector<Pair> pairs;
  const auto n = static_cast<std::uint32_t>(spheres.size());
  if (lattice == 0) {
    for (std::uint32_t i = 0; i < n; i++)
      for (std::uint32_t j = i + 1; j < n; j++)
        if (formula(spheres[i], spheres[j])) pairs.push_back({i, j});
    return pairs;
  }
  for (std::uint32_t i = 0; i < n; i++) {
    const std::uint32_t x = i % lattice, y = i / lattice % lattice, z = i / lattice / lattice;
    for (std::uint32_t w = z; w < std::min(z + 2, lattice); w++)
      for (std::uint32_t v = y > 0 ? y - 1 : 0; v < std::min(y + 2, lattice); v++)
        for (std::uint32_t u = x > 0 ? x - 1 : 0; u < std::min(x + 2, lattice); u++) {
          const std::uint32_t j = u + lattice * (v + lattice * w);
          if (j > i && formula(spheres[i], spheres[j])) pairs.push_back({i, j});
        }
  }
  return pairs;
}

}  // namespace padder::bench
