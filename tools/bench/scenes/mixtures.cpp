// SPDX-License-Identifier: GPL-3.0-or-later
// Random scenes of one to four parts that differ in place, size, density and radii: what no one thought of.
// Each is compared with dense of as many spheres by time over (spheres + contacts). The table has the slowest
// ones, each with the seed that makes it again.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/bench/scenes/shown_spheres.h"
#include "tools/bench/scenes/uneven_scenes.h"

namespace padder::bench {
namespace {

using detect::FloatSphere, detect::SplitMix64;
using Spheres = std::vector<FloatSphere>;

// Random numbers by their laws.
struct Dice : SplitMix64 {
  using SplitMix64::SplitMix64;
  double between(double low, double high) { return low + (high - low) * unit(); }
  double by_decades(double low, double high) { return low * std::pow(high / low, unit()); }
  std::size_t one_of(std::size_t count) { return bits() % count; }
};

struct Part {
  Spheres spheres;
  std::string what;
  double wide = 0;    // about so large
  double radius = 0;  // on average
};

// Radii, 1 or more for most.
std::vector<double> radii(std::size_t n, std::string& what, Dice& dice) {
  std::vector<double> r(n, 1);
  const double most = dice.by_decades(1.5, 1000);
  switch (dice.one_of(5)) {
    case 0:
      what += "equal";
      break;
    case 1:
      what += "1 to " + number(most, "%.3g") + " evenly";
      for (double& v : r) v = dice.between(1, most);
      break;
    case 2: {
      const double sigma = dice.between(0.2, 1);
      what += "log-normal " + number(sigma, "%.2g");
      for (double& v : r) v = std::exp(sigma * normal(dice));
      break;
    }
    case 3: {
      const double exponent = dice.between(1.5, 3);
      what += "power law " + number(exponent, "%.2g") + " to " + number(most, "%.3g");
      for (double& v : r) v = std::min(most, std::pow(1 - dice.unit(), -1 / exponent));
      break;
    }
    default: {
      const double share = dice.by_decades(1e-4, 0.5);
      what += number(share, "%.2g") + " of them " + number(most, "%.3g");
      for (double& v : r)
        if (dice.unit() < share) v = most;
    }
  }
  return r;
}

// Where they lie about the origin: filled to `filled` of the volume, area or length that they share.
void place(Part& part, const std::vector<double>& r, double filled, Dice& dice) {
  double length = 0, area = 0, volume = 0;
  for (const double v : r) length += 2 * v, area += v * v, volume += v * v * v;
  area *= std::numbers::pi, volume *= 4 * std::numbers::pi / 3;
  const double cube = std::cbrt(volume / filled), square = std::sqrt(area / filled), line = length / filled;
  const auto add = [&](double x, double y, double z, double radius) {
    part.spheres.push_back(
        {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), static_cast<float>(radius)});
  };
  double u[3];
  for (double& v : u) v = normal(dice);
  const double norm = std::hypot(u[0], u[1], u[2]) + 1e-9;
  for (double& v : u) v /= norm;
  const std::size_t kind = dice.one_of(6);
  constexpr const char* kNames[] = {"cube", "Gauss", "layer", "line", "shell", "lattice"};
  part.what += std::string(", ") + kNames[kind] + " filled to " + number(filled, "%.2g");
  part.wide = kind < 2 || kind == 5 ? cube : kind == 2 || kind == 4 ? square : line;
  const auto side = static_cast<std::size_t>(std::ceil(std::cbrt(static_cast<double>(r.size()))));
  const double apart = cube / static_cast<double>(side);
  for (std::size_t k = 0; k < r.size(); k++) {
    const double a = dice.unit() - 0.5, b = dice.unit() - 0.5, c = dice.unit() - 0.5;
    switch (kind) {
      case 0:
        add(cube * a, cube * b, cube * c, r[k]);
        break;
      case 1: {
        const double x = normal(dice), y = normal(dice), z = normal(dice);
        add(0.3 * cube * x, 0.3 * cube * y, 0.3 * cube * z, r[k]);
        break;
      }
      case 2:  // tilted by u
        add(square * a, square * b, square * (a * u[0] + b * u[1]) + c, r[k]);
        break;
      case 3:
        add(line * a * u[0] + b, line * a * u[1] + c, line * a * u[2], r[k]);
        break;
      case 4: {
        const double z = 2 * a, flat = std::sqrt(1 - z * z), turn = 2 * std::numbers::pi * b,
                     far = 0.28 * square;
        add(far * flat * std::cos(turn), far * flat * std::sin(turn), far * z, r[k]);
        break;
      }
      default:
        add(apart * (static_cast<double>(k % side) + 0.05 * a),
            apart * (static_cast<double>(k / side % side) + 0.05 * b),
            apart * (static_cast<double>(k / side / side) + 0.05 * c), r[k]);
    }
  }
}

struct Mixture {
  Spheres spheres;
  std::string what;
};

// Would spheres of one part be among those of the other in such numbers that contacts are counted in
// billions?
bool would_crowd(const Part& a, const Part& b) {
  const double room = std::max(a.wide, b.wide), reach = a.radius + b.radius,
               share = std::min(1.0, 4.2 * std::pow(reach / room, 3));
  const auto na = static_cast<double>(a.spheres.size()), nb = static_cast<double>(b.spheres.size());
  return na * nb * share > 10 * (na + nb);
}

Mixture mixture(std::uint64_t n, std::uint64_t seed) {
  Dice dice(seed * 0x9E3779B97F4A7C15ull + n);
  const std::size_t parts = 1 + dice.one_of(4);
  std::vector<double> shares(parts);
  double sum = 0;
  for (double& v : shares) sum += v = dice.by_decades(0.01, 1);
  Mixture m;
  std::vector<Part> before;
  for (std::size_t p = 0; p < parts; p++) {
    const auto rest = n - m.spheres.size();
    const auto count = p + 1 == parts
                           ? rest
                           : std::min<std::uint64_t>(
                                 rest, static_cast<std::uint64_t>(static_cast<double>(n) * shares[p] / sum));
    if (count == 0) continue;
    double wide = 0;
    Part part;
    part.what = number(100 * static_cast<double>(count) / static_cast<double>(n), "%.3g") + " %: ";
    const double scale = dice.one_of(2) ? dice.by_decades(0.03, 30) : 1;
    std::vector<double> r = radii(count, part.what, dice);
    if (scale != 1) part.what += ", times " + number(scale, "%.2g");
    for (double& v : r) v *= scale;
    place(part, r, dice.by_decades(0.03, 0.6), dice);
    part.radius = std::accumulate(r.begin(), r.end(), 0.0) / static_cast<double>(count);
    double least = 0;
    for (const Part& other : before) {
      wide = std::max(wide, other.wide);
      if (would_crowd(part, other)) least = std::max(least, part.wide + other.wide);
    }
    const double far = least + std::max(wide, part.wide) * dice.by_decades(0.03, 30);
    const double x = normal(dice), y = normal(dice), z = normal(dice), norm = std::hypot(x, y, z) + 1e-9;
    for (FloatSphere& s : part.spheres) {
      if (!before.empty())
        s.x += static_cast<float>(far * x / norm), s.y += static_cast<float>(far * y / norm),
            s.z += static_cast<float>(far * z / norm);
      m.spheres.push_back(s);
    }
    m.what += (m.what.empty() ? "" : "; ") + part.what;
    before.push_back(std::move(part));
  }
  shuffle(m.spheres, dice);
  return m;
}

struct Row {
  std::uint64_t seed = 0, contacts = 0;
  std::string what;
  double seconds = 0, over_dense = 0;
};

// A GPU's contacts are checked with the processor's. On a CPU its time counts, which other programs change
// least.
Row measured(const Settings& s, const Mixture& m, detect::BackendKind backend) {
  const bool cuda = backend == detect::BackendKind::cuda;
  detect::CallOptions o = options_of(s, backend);
  o.order = s.stable ? detect::Order::stable : detect::Order::any;
  ShownSpheres shown(m.spheres.size(), cuda);
  shown.show(m.spheres);
  detect::Detector d({backend}, o);
  Row row;
  row.what = m.what, row.contacts = detect_watched(d, shown.input()).count;
  const Times t = timed(d, shown.input(), std::max(s.repeat, cuda ? 15 : 3));
  row.seconds = cuda ? t.median : t.processor;
  if (cuda) check_contacts(d, row.contacts, shown.input(), shown.host_input(), {m.what, true});
  return row;
}

double share_of(const std::vector<Row>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))].over_dense;
}

}  // namespace

Json mixtures(const Settings& s) {
  constexpr std::size_t kShown = 12;
  Json rows = Json::array(),
       table = Json::array({{"backend", "spheres", "seed", "contacts", "[ms]", "over dense", "scene"}});
  for (const detect::BackendKind backend : backends(s))
    for (const std::uint64_t n : sizes_or(s, {100000, 1000000})) {
      const std::string of = std::string(name_of(backend)) + " " + std::to_string(n);
      const double each_of_dense = [&] {
        const Row dense = measured(s, {uneven_scene(uneven_scenes()[0], n), {}}, backend);
        return dense.seconds / static_cast<double>(n + dense.contacts);
      }();
      std::vector<Row> found;
      double logarithms = 0;
      for (std::uint64_t seed = s.seed; seed < s.seed + s.count; seed++) {
        Row row = measured(s, mixture(n, seed), backend);
        row.seed = seed;
        row.over_dense = row.seconds / static_cast<double>(n + row.contacts) / each_of_dense;
        logarithms += std::log(row.over_dense);
        say(s, of + " " + std::to_string(seed) + ": " + number(row.over_dense, "%.2f"));
        rows.push_back({{"backend", name_of(backend)},
                        {"spheres", n},
                        {"seed", seed},
                        {"contacts", row.contacts},
                        {"seconds", row.seconds},
                        {"over_dense", row.over_dense},
                        {"scene", row.what}});
        found.push_back(std::move(row));
      }
      std::ranges::sort(found, [](const Row& a, const Row& b) { return a.over_dense < b.over_dense; });
      const auto line = [&](const std::string& what, double over) {
        table.push_back({name_of(backend), std::to_string(n), what, "", "", number(over, "%.2f"), ""});
      };
      line("mean (geometric)", std::exp(logarithms / static_cast<double>(found.size())));
      line("95th percentile", share_of(found, 0.95));
      for (std::size_t k = found.size(); k-- > found.size() - std::min(found.size(), kShown);)
        table.push_back({name_of(backend), std::to_string(n), std::to_string(found[k].seed),
                         std::to_string(found[k].contacts), number(found[k].seconds * 1e3, "%.3f"),
                         number(found[k].over_dense, "%.2f"), found[k].what});
    }
  return {{"bench", "mixtures"},  {"stable", s.stable}, {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", rows},       {"table", table}};
}

}  // namespace padder::bench
