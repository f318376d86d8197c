// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/scenes/uneven_scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace padder::bench {

using detect::FloatSphere, detect::SplitMix64;
using Spheres = std::vector<FloatSphere>;

double normal(SplitMix64& random) {
  const double u = 1 - random.unit(), v = random.unit();
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

void shuffle(Spheres& spheres, SplitMix64& random) {
  for (std::uint64_t k = spheres.size(); k-- > 1;) std::swap(spheres[k], spheres[random.bits() % (k + 1)]);
}

namespace {

FloatSphere at(double x, double y, double z, double r = 1) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), static_cast<float>(r)};
}
double count_of(std::uint64_t n) { return static_cast<double>(n); }

// The spheres that sphere(0) to sphere(n - 1) give, in this order.
template <class OneSphere>
Spheres all_of(std::uint64_t n, const OneSphere& sphere) {
  Spheres s;
  s.reserve(n);
  for (std::uint64_t k = 0; k < n; k++) s.push_back(sphere(k));
  return s;
}

// Of radius 1, uniform in a cube with this volume for each sphere.
Spheres uniform(std::uint64_t n, double volume, SplitMix64& random) {
  const double edge = std::cbrt(count_of(n) * volume);
  return all_of(n, [&](std::uint64_t) {
    const double x = random.unit() * edge, y = random.unit() * edge, z = random.unit() * edge;
    return at(x, y, z);
  });
}

Spheres dense(std::uint64_t n, SplitMix64&) { return detect::generate("dense", n, false); }
Spheres dilute(std::uint64_t n, SplitMix64&) { return detect::generate("dilute", n, false); }
Spheres poly35(std::uint64_t n, SplitMix64&) { return detect::generate("poly35", n, false); }
Spheres poly100(std::uint64_t n, SplitMix64&) { return detect::generate("poly100", n, false); }

// One sphere in 1,000 thrown up to `edges` edges of the scene away.
Spheres thrown(Spheres s, double edges, SplitMix64& random) {
  float high = 0;
  for (const FloatSphere& f : s) high = std::max({high, f.x, f.y, f.z});
  const auto far = [&] { return static_cast<float>(random.signed_unit() * edges) * high; };
  for (std::size_t k = 0; k < s.size(); k += 1000) s[k].x = far(), s[k].y = far(), s[k].z = far();
  return s;
}
Spheres escaped(std::uint64_t n, SplitMix64& random) { return thrown(dense(n, random), 100, random); }
Spheres escaped_poly100(std::uint64_t n, SplitMix64& random) {
  return thrown(poly100(n, random), 100, random);
}

// The first one at (far, -2 far, 3 far).
Spheres with_one_at(Spheres s, double far) {
  s[0] = at(far, -2 * far, 3 * far, s[0].r);
  return s;
}
Spheres one_far(std::uint64_t n, SplitMix64& random) { return with_one_at(dense(n, random), 1e6); }
Spheres one_lost(std::uint64_t n, SplitMix64& random) {  // too far for bins in float
  return with_one_at(dense(n, random), 1e12);
}
Spheres one_far_poly100(std::uint64_t n, SplitMix64& random) { return with_one_at(poly100(n, random), 1e6); }

Spheres ground_poly100(std::uint64_t n, SplitMix64& random) {
  Spheres s = poly100(n, random);
  const FloatSphere lowest =
      *std::min_element(s.begin(), s.end(), [](auto& a, auto& b) { return a.z - a.r < b.z - b.r; });
  s[0] = at(lowest.x, lowest.y, lowest.z - lowest.r - 1e6, 1e6);
  return s;
}
Spheres fallen_poly100(std::uint64_t n, SplitMix64& random) {
  Spheres s = poly100(n, random);
  for (std::size_t k = 0; k < s.size(); k += 100)
    s[k].z -= static_cast<float>(1e6 * random.unit() * random.unit());
  return s;
}

// Half in a heap of radius 1; a quarter of radius 1 and a quarter of radius 100, both spread widely.
Spheres heap_poly(std::uint64_t n, SplitMix64& random) {
  const double heap = std::cbrt(11.5 * count_of(n) / 2), wide = 300 * std::cbrt(count_of(n));
  return all_of(n, [&](std::uint64_t k) {
    const double edge = k % 4 < 2 ? heap : wide, x = edge * (random.unit() - 0.5),
                 y = edge * (random.unit() - 0.5), z = edge * (random.unit() - 0.5);
    return at(x, y, z, k % 4 == 3 ? 100 : 1);
  });
}

// Half in a Gaussian clump, half spread 12 times as far.
Spheres clump(std::uint64_t n, SplitMix64& random) {
  const double sigma = std::cbrt(0.0525 * count_of(n));
  return all_of(n, [&](std::uint64_t k) {
    const double d = k % 2 ? sigma : 12 * sigma;
    const double x = d * normal(random), y = d * normal(random), z = d * normal(random);
    return at(x, y, z);
  });
}
// Dense below, exponentially thinner above.
Spheres atmosphere(std::uint64_t n, SplitMix64& random) {
  const double edge = std::cbrt(20 * count_of(n));
  return all_of(n, [&](std::uint64_t) {
    const double x = random.unit() * edge, y = random.unit() * edge,
                 z = -0.3 * edge * std::log(1 - random.unit());
    return at(x, y, z);
  });
}
// A point of a lattice whose spheres touch.
FloatSphere lattice_point(std::uint64_t x, std::uint64_t y, std::uint64_t z, SplitMix64& random) {
  const auto jittered = [&](std::uint64_t v) { return 1.97 * count_of(v) + 0.1 * random.signed_unit(); };
  const double px = jittered(x), py = jittered(y), pz = jittered(z);
  return at(px, py, pz);
}
// A lattice of spheres that touch or miss each other by a 20,000th of their size: float is not sure of them.
Spheres settled(std::uint64_t n, SplitMix64& random) {
  const auto side = static_cast<std::uint64_t>(std::ceil(std::cbrt(count_of(n))));
  const auto place = [&](std::uint64_t v) { return 2 * count_of(v) + 5e-5 * random.signed_unit(); };
  return all_of(n, [&](std::uint64_t k) {
    const double x = place(k % side), y = place(k / side % side), z = place(k / side / side);
    return at(x, y, z);
  });
}
// Layers of touching spheres.
Spheres layers(std::uint64_t n, std::uint64_t deep, SplitMix64& random) {
  const auto side = static_cast<std::uint64_t>(std::ceil(std::sqrt(count_of(n) / count_of(deep))));
  return all_of(n, [&](std::uint64_t k) {
    const std::uint64_t c = k / deep;
    return lattice_point(c % side, c / side, k % deep, random);
  });
}
Spheres bed(std::uint64_t n, SplitMix64& random) { return layers(n, 16, random); }
Spheres escaped_bed(std::uint64_t n, SplitMix64& random) { return thrown(layers(n, 1, random), 10, random); }
// Spheres that touch on the surface of a ball.
Spheres shell(std::uint64_t n, SplitMix64&) {
  const double radius = std::sqrt(count_of(n) * 3.4 / (4 * std::numbers::pi));
  return all_of(n, [&](std::uint64_t k) {
    const double z = 1 - (2 * count_of(k) + 1) / count_of(n), around = std::sqrt(1 - z * z),
                 angle = count_of(k) * std::numbers::pi * (3 - std::sqrt(5.0));
    return at(radius * around * std::cos(angle), radius * around * std::sin(angle), radius * z);
  });
}
// A hundred straight chains from the origin, in all directions.
Spheres lines(std::uint64_t n, SplitMix64& random) {
  double d[3] = {1, 0, 0};
  const std::uint64_t each = std::max<std::uint64_t>(n / 100, 1);
  return all_of(n, [&](std::uint64_t k) {
    if (k % each == 0) {
      for (double& v : d) v = normal(random);
      if (k / each < 4)
        for (int a = 0; a < 3; a++) d[a] = a == static_cast<int>(k / each) || k / each == 3;
      const double length = std::hypot(d[0], d[1], d[2]);
      for (double& v : d) v /= length;
    }
    const double t = 1.95 * count_of(k % each + 20);
    return at(d[0] * t, d[1] * t, d[2] * t);
  });
}
// A fractal heap: each group of eight lies about a point of a group of the next size, three times as wide.
Spheres fractal(std::uint64_t n, SplitMix64& random) {
  double centre[24][3] = {};
  return all_of(n, [&](std::uint64_t k) {
    double x[3] = {}, width = 1.2;
    int depth = 0;
    for (std::uint64_t q = n; q > 0; q /= 8) depth++;
    for (int g = 0; g < depth; g++, width *= 3) {
      if (k % (std::uint64_t(1) << 3 * g) == 0)
        for (double& c : centre[g]) c = width * normal(random);
      for (int a = 0; a < 3; a++) x[a] += centre[g][a];
    }
    return at(x[0], x[1], x[2]);
  });
}
// Two dense heaps, far from each other.
Spheres two_heaps(std::uint64_t n, SplitMix64& random) {
  Spheres s = dense(n / 2, random), other = dense(n - n / 2, random);
  for (const FloatSphere& f : other) s.push_back({f.x + 20000, f.y - 30000, f.z + 7000, f.r});
  return s;
}

// A chain wound round a cone, so that no two turns touch.
Spheres spiral(std::uint64_t n, SplitMix64&) {
  return all_of(n, [&](std::uint64_t k) {
    const double turns = std::sqrt(1.95 * count_of(k) / (3 * std::numbers::pi)),
                 angle = 2 * std::numbers::pi * turns;
    return at(3 * turns * std::cos(angle), 3 * turns * std::sin(angle), 2 * turns);
  });
}
// A Menger sponge whose holes are empty, of spheres that touch.
Spheres menger(std::uint64_t n, SplitMix64& random) {
  std::uint64_t depth = 1, cells = 20;
  while (cells < n) depth++, cells *= 20;
  return all_of(n, [&](std::uint64_t k) {
    std::uint64_t cell = k, place[3] = {}, width = 1;
    for (std::uint64_t g = 0; g < depth; g++, cell /= 20, width *= 3) {
      std::uint64_t number = cell % 20;  // of the twenty of 27 parts that are no hole
      for (std::uint64_t part = 0; part < 27; part++) {
        const std::uint64_t p[3] = {part % 3, part / 3 % 3, part / 9};
        if ((p[0] == 1) + (p[1] == 1) + (p[2] == 1) > 1 || number-- > 0) continue;
        for (int a = 0; a < 3; a++) place[a] += p[a] * width;
        break;
      }
    }
    return lattice_point(place[0], place[1], place[2], random);
  });
}
// One layer of spheres that touch, in a plane along no axis.
Spheres sheet(std::uint64_t n, SplitMix64& random) {
  const double a[3] = {0.36, 0.48, -0.8}, b[3] = {-0.8, 0.6, 0};
  Spheres s = layers(n, 1, random);
  for (FloatSphere& f : s) {
    const double u = f.x, v = f.y;
    f = at(u * a[0] + v * b[0], u * a[1] + v * b[1], u * a[2] + v * b[2]);
  }
  return s;
}
// A chain whose next step goes anywhere.
Spheres walk(std::uint64_t n, SplitMix64& random) {
  double x[3] = {};
  return all_of(n, [&](std::uint64_t) {
    double step[3];
    for (double& v : step) v = normal(random);
    const double length = std::hypot(step[0], step[1], step[2]);
    for (int a = 0; a < 3; a++) x[a] += 1.95 * step[a] / length;
    return at(x[0], x[1], x[2]);
  });
}
// One straight chain along the diagonal.
Spheres column(std::uint64_t n, SplitMix64&) {
  return all_of(n, [&](std::uint64_t k) {
    const double t = 1.1 * count_of(k);
    return at(t, t, t);
  });
}
// Two dense heaps of radius 1 and of radius 37, far from each other.
Spheres two_sizes(std::uint64_t n, SplitMix64& random) {
  Spheres s = dense(n / 2, random), other = dense(n - n / 2, random);
  for (const FloatSphere& f : other) s.push_back({f.x * 37 + 50000, f.y * 37, f.z * 37 - 90000, f.r * 37});
  return s;
}
// Radii by a power law without an upper end.
Spheres power_law(std::uint64_t n, SplitMix64& random) {
  Spheres s = uniform(n, 60, random);
  for (FloatSphere& f : s) f.r = static_cast<float>(std::pow(1 - random.unit(), -1 / 3.2));
  return s;
}

Spheres channel(std::uint64_t n, SplitMix64& random) {
  const double length = count_of(n) * 11.5 / 400;
  return all_of(n, [&](std::uint64_t) {
    const double x = random.unit() * 20, y = random.unit() * 20, z = random.unit() * length;
    return at(x, y, z);
  });
}
Spheres lognormal_of(double sigma, std::uint64_t n, double volume, SplitMix64& random) {
  Spheres s = uniform(n, volume, random);
  for (FloatSphere& f : s) f.r = static_cast<float>(std::exp(sigma * normal(random)));
  return s;
}
Spheres lognormal(std::uint64_t n, SplitMix64& random) { return lognormal_of(0.5, n, 77, random); }
Spheres lognormal_wide(std::uint64_t n, SplitMix64& random) { return lognormal_of(1, n, 2250, random); }
Spheres one_in_2000(std::uint64_t n, SplitMix64& random) {
  Spheres s = uniform(n, 46, random);
  for (std::size_t k = 0; k < s.size(); k += 2000) s[k].r = 30;
  return s;
}
Spheres ten_giants(std::uint64_t n, SplitMix64& random) {
  Spheres s = uniform(n, 11.5, random);
  for (std::size_t k = 0; k < std::min<std::size_t>(10, s.size()); k++) s[k * (s.size() / 10)].r = 40;
  return s;
}
Spheres ten_huge(std::uint64_t n, SplitMix64& random) {
  Spheres s = uniform(n, 11.5, random);
  for (std::size_t k = 0; k < std::min<std::size_t>(10, s.size()); k++)
    s[k] = at(-990 + 4 * count_of(k), 100 * count_of(k), 50, 1000);
  return s;
}
// A bed on a ground that is one sphere.
Spheres ground(std::uint64_t n, SplitMix64& random) {
  const double edge = std::sqrt(count_of(n) * 11.5 / 16);
  Spheres s{at(0, 0, -1e5, 1e5)};
  while (s.size() < n) {
    const double x = edge * (random.unit() - 0.5), y = edge * (random.unit() - 0.5),
                 z = 1 + 16 * random.unit();
    s.push_back(at(x, y, z));
  }
  return s;
}
FloatSphere on_sphere(const FloatSphere& centre, double radius, double r, SplitMix64& random) {
  const double x = normal(random), y = normal(random), z = normal(random), far = radius / std::hypot(x, y, z);
  return at(centre.x + x * far, centre.y + y * far, centre.z + z * far, r);
}
// Spheres of radius 100, each dusted with 999 of radius 1.
Spheres dusted(std::uint64_t n, SplitMix64& random) {
  const double edge = std::cbrt(count_of(n) / 1000) * 400;
  Spheres s;
  FloatSphere large{};
  while (s.size() < n) {
    if (s.size() % 1000 == 0) {
      const double x = edge * random.unit(), y = edge * random.unit(), z = edge * random.unit();
      s.push_back(large = at(x, y, z, 100));
    } else {
      s.push_back(on_sphere(large, 101, 1, random));
    }
  }
  return s;
}
// The radius, 1 to 100, grows with the distance from the middle.
Spheres outwards(std::uint64_t n, SplitMix64& random) {
  Spheres s;
  while (s.size() < n) {
    const double r = std::pow(100, random.unit());
    s.push_back(on_sphere({}, 0.6 * r * std::cbrt(count_of(n)), r, random));
  }
  return s;
}
// Boxes of 1 to n / 4 spheres, from crowded to thin, strewn widely.
Spheres clusters(std::uint64_t n, SplitMix64& random) {
  const double wide = 60 * std::cbrt(count_of(n));
  Spheres s;
  while (s.size() < n) {
    const double size = std::pow(count_of(n) / 4, random.unit()), volume = 6 * std::pow(200, random.unit()),
                 edge = std::cbrt(size * volume);
    const double x = wide * random.unit(), y = wide * random.unit(), z = wide * random.unit();
    for (double k = 0; k < size && s.size() < n; k++) {
      const double u = edge * random.unit(), v = edge * random.unit(), w = edge * random.unit();
      s.push_back(at(x + u, y + v, z + w));
    }
  }
  return s;
}
// Most in the middle, and at any distance some: normal directions over normal numbers.
Spheres cauchy(std::uint64_t n, SplitMix64& random) {
  Spheres s;
  while (s.size() < n) {
    const double far = 1.5 * std::cbrt(count_of(n)) / (std::abs(normal(random)) + 1e-6);
    const double x = far * normal(random), y = far * normal(random), z = far * normal(random);
    s.push_back(at(x, y, z));
  }
  return s;
}
// One in 100 stands in crowds, of 1,000 at a point each.
Spheres crowds(std::uint64_t n, SplitMix64& random) {
  Spheres s = dense(n, random);
  const std::size_t points = std::max<std::size_t>(s.size() / 100'000, 1), apart = s.size() / points;
  for (std::size_t k = 0; k < s.size() / 100; k++) s[100 * k] = s[k % points * apart + 1];
  return s;
}
// By a power law, up to `most`.
double radius_up_to(double most, SplitMix64& random) {
  return std::min(most, std::pow(1 - random.unit(), -1 / 2.4));
}
// About a point, as many at each distance, so that their density goes by 1 / distance^2. Of radius 1, 500
// hold that point.
template <class Radius>
Spheres about_a_point(std::uint64_t n, SplitMix64& random, const Radius& radius) {
  return all_of(n, [&](std::uint64_t) {
    const double far = count_of(n) / 500 * random.unit(), r = radius(), z = random.signed_unit(),
                 turn = 2 * std::numbers::pi * random.unit(), flat = far * std::sqrt(1 - z * z);
    return at(flat * std::cos(turn), flat * std::sin(turn), far * z, r);
  });
}
Spheres cusp(std::uint64_t n, SplitMix64& random) {
  return about_a_point(n, random, [] { return 1; });
}
Spheres cusp_poly(std::uint64_t n, SplitMix64& random) {
  return about_a_point(n, random, [&] { return radius_up_to(10, random); });
}
// Over a square that has so much area for each sphere; sphere k is sphere(k, x, y).
template <class OneSphere>
Spheres over_square(std::uint64_t n, double area, SplitMix64& random, const OneSphere& sphere) {
  const double edge = std::sqrt(count_of(n) * area);
  return all_of(n, [&](std::uint64_t k) {
    const double x = edge * random.unit(), y = edge * random.unit();
    return sphere(k, x, y);
  });
}
// Two layers, 100,000 apart.
Spheres two_layers(std::uint64_t n, SplitMix64& random) {
  return over_square(n, 2, random,
                     [](std::uint64_t k, double x, double y) { return at(x, y, k % 2 ? 1e5 : 0); });
}
// Radii by a power law, 1 to 100, in a plane.
Spheres poly_layer(std::uint64_t n, SplitMix64& random) {
  return over_square(n, 60, random, [&](std::uint64_t, double x, double y) {
    return at(x, y, 0, radius_up_to(100, random));
  });
}

}  // namespace

const std::vector<UnevenScene>& uneven_scenes() {
  static const std::vector<UnevenScene> all{
      {"dense", "the reference", 1, dense},
      {"dilute", "uniform, 0.45 contacts a sphere", 1.7, dilute},
      {"escaped", "dense, one in 1,000 thrown up to 100 edges away", 1.7, escaped},
      {"one_far", "dense, a single sphere at 3e6", 1.7, one_far},
      {"one_lost", "dense, a single sphere at 4e12", 1.7, one_lost},
      {"clump", "half in a Gaussian clump, half spread 12 times as far", 1.7, clump},
      {"atmosphere", "dense below, exponentially thinner above", 1.7, atmosphere},
      {"settled", "a lattice of spheres that touch or miss by 5e-5", 1.7, settled},
      {"bed", "16 layers", 1.7, bed},
      {"escaped_bed", "one layer, one in 1,000 thrown up to 10 edges away", 1.7, escaped_bed},
      {"shell", "on the surface of a ball", 1.7, shell},
      {"lines", "a hundred chains in all directions", 1.7, lines},
      {"fractal", "groups of eight, each three times as wide as the one inside", 1.7, fractal},
      {"two_heaps", "two dense heaps 37,000 apart", 1.7, two_heaps},
      {"spiral", "a chain wound round a cone", 1.7, spiral},
      {"menger", "a Menger sponge", 1.7, menger},
      {"sheet", "a tilted layer", 1.7, sheet},
      {"walk", "a random walk", 1.7, walk},
      {"column", "a chain along the diagonal", 1.7, column},
      {"channel", "20 wide, 20 high and long", 1.7, channel},
      {"clusters", "boxes of 1 to n / 4 spheres, crowded to thin", 1.7, clusters},
      {"cauchy", "thinner outwards, without an end", 1.7, cauchy},
      {"crowds", "dense, one in 100 in crowds of 1,000 at a point each", 1.7, crowds},
      {"cusp", "density by 1 / distance^2 about a point", 1.7, cusp},
      {"two_layers", "two layers 100,000 apart", 1.7, two_layers},
      {"poly35", "radii 1 to 4", 2.2, poly35},
      {"poly100", "radii 1 to 100", 2.2, poly100},
      {"escaped_poly", "poly100, one in 1,000 thrown up to 100 edges away", 2.2, escaped_poly100},
      {"one_far_poly", "poly100, a single sphere at 3e6", 2.2, one_far_poly100},
      {"heap_poly", "a heap of radius 1 among spheres of radii 1 and 100, spread widely", 2.2, heap_poly,
       true},
      {"ground_poly", "poly100 on one sphere of radius 1e6", 3, ground_poly100, true},
      {"fallen_poly", "poly100, one in 100 fallen as far as 1e6", 2.2, fallen_poly100},
      {"lognormal", "log-normal radii, sigma 0.5", 2.2, lognormal},
      {"lognormal_wide", "log-normal radii, sigma 1", 3, lognormal_wide},
      {"one_in_2000", "one in 2,000 is 30 times as large", 2.2, one_in_2000},
      {"two_sizes", "two heaps of radius 1 and 37, far from each other", 2.2, two_sizes, true},
      {"power_law", "radii by a power law, exponent 4.2", 2.2, power_law},
      {"cusp_poly", "radii 1 to 10, density by 1 / distance^2 about a point", 2.2, cusp_poly},
      {"poly_layer", "radii by a power law, 1 to 100, in a plane", 2.2, poly_layer},
      {"outwards", "radii 1 to 100 that grow with the distance", 2.2, outwards, true},
      {"dusted", "spheres of radius 100, each dusted with 999 of radius 1", 2.2, dusted},
      {"ground", "a bed on one sphere of radius 100,000", 3, ground, true},
      {"ten_giants", "ten of radius 40 among radius 1", 3, ten_giants},
      {"ten_huge", "ten of radius 1,000 beside radius 1", 3, ten_huge},
  };
  return all;
}

Spheres uneven_scene(const UnevenScene& scene, std::uint64_t n) {
  SplitMix64 random(12345 + n);
  Spheres s = scene.make(n, random);
  shuffle(s, random);
  return s;
}

}  // namespace padder::bench
