// SPDX-License-Identifier: GPL-3.0-or-later
// Table 2 of the paper: contacts against Bullet in double, on scenes with disjoint, touching, overlapping and
// contained spheres (poly045: radii 1 to 4, 0.45 contacts a sphere).
#include <algorithm>
#include <cmath>

#include "tools/bench/bench.h"
#include "tools/bench/peers/bullet.h"

namespace padder::bench {
namespace {

struct Moments {
  double sum = 0, squares = 0;
  std::uint64_t count = 0;
  void add(double v) { sum += v, squares += v * v, count++; }
  double mean() const { return count ? sum / static_cast<double>(count) : 0; }
  double deviation() const {
    return count ? std::sqrt(std::max(0., squares / static_cast<double>(count) - mean() * mean())) : 0;
  }
};

struct Errors {
  Moments distance, normal, point;
  std::uint64_t matched = 0;
};

template <class T>
double apart(const T* a, const double* b) {
  return std::hypot(static_cast<double>(a[0]) - b[0], static_cast<double>(a[1]) - b[1],
                    static_cast<double>(a[2]) - b[2]);
}

// Both lists sorted by pair.
template <class T>
Errors compare(const detect::Contacts& c, const std::vector<std::uint64_t>& order,
               const std::vector<BulletContact>& bullet) {
  Errors e;
  std::size_t b = 0;
  for (const std::uint64_t k : order) {
    const detect::Pair p = c.pairs[k];
    while (b < bullet.size() && (bullet[b].i < p.i || (bullet[b].i == p.i && bullet[b].j < p.j))) b++;
    if (b == bullet.size() || bullet[b].i != p.i || bullet[b].j != p.j) continue;
    e.matched++;
    const detect::Normal<T>& n = c.normal_span<T>()[k];
    const detect::Points<T>& q = c.point_span<T>()[k];
    e.distance.add(std::abs(static_cast<double>(n.depth) - bullet[b].depth));
    e.normal.add(apart(&n.x, bullet[b].normal));
    e.point.add(std::max(apart(q.on_i, bullet[b].on_i), apart(q.on_j, bullet[b].on_j)));
  }
  return e;
}

std::vector<std::uint64_t> sorted_order(const detect::Contacts& c) {
  std::vector<std::uint64_t> order(c.count);
  for (std::uint64_t k = 0; k < c.count; k++) order[k] = k;
  std::sort(order.begin(), order.end(), [&](std::uint64_t a, std::uint64_t b) {
    return c.pairs[a].i != c.pairs[b].i ? c.pairs[a].i < c.pairs[b].i : c.pairs[a].j < c.pairs[b].j;
  });
  return order;
}

struct PaperRow {
  std::uint64_t spheres, contacts;
  double distance, normal, point;
};
constexpr PaperRow kPaper[] = {{1000000, 462108, 1.46e-7, 8.24e-11, 2.73e-6},
                               {2000000, 1015556, 7.40e-8, 1.91e-10, 2.37e-6},
                               {3000000, 1379397, 1.69e-7, 2.75e-10, 3.58e-6},
                               {4000000, 1530309, 5.49e-7, 2.33e-10, 1.94e-6},
                               {5000000, 1995548, 6.35e-7, 1.09e-10, 3.10e-6}};

Json moments_json(const Moments& m) { return {{"mean", m.mean()}, {"std", m.deviation()}}; }

}  // namespace

Json table2(const Settings& s) {
  if (!have_bullet()) BulletWorld{{}};
  std::vector<std::uint64_t> papers;
  for (const PaperRow& p : kPaper) papers.push_back(p.spheres);
  Json rows = Json::array();
  Json table = Json::array({{"spheres", "record", "backend", "contacts", "double grid", "Bullet", "in both",
                             "distance: mean", "std", "normal: mean", "std", "point: mean", "std"}});
  const auto result = [&]() -> Json {
    return {
        {"bench", "table2"}, {"scene", "poly045"}, {"machine", machine()}, {"rows", rows}, {"table", table}};
  };
  for (const std::uint64_t n : sizes_or(s, papers)) {
    say(s, std::to_string(n) + " spheres: Bullet");
    const std::vector<detect::FloatSphere> spheres = detect::generate("poly045", n);
    const std::vector<detect::Pair> oracle = plain_grid(spheres);
    const std::uint64_t oracle_hash = hash_of(oracle);
    std::vector<BulletContact> bullet;
    {
      BulletWorld world(spheres);
      world.step();
      bullet = world.contacts();
    }
    for (const detect::BackendKind backend : backends(s))
      for (const detect::Scalar scalar : {detect::Scalar::f64, detect::Scalar::f32}) {
        detect::CallOptions o;
        o.width = detect::Width::points, o.scalar = scalar, o.threads = s.threads;
        detect::Detector detector({backend}, o);
        const detect::Contacts& c = detect_watched(detector, input_of(spheres));
        const std::vector<std::uint64_t> order = sorted_order(c);
        const Errors e = scalar == detect::Scalar::f64 ? compare<double>(c, order, bullet)
                                                       : compare<float>(c, order, bullet);
        const bool equal = c.count == oracle.size() && hash_watched(detector) == oracle_hash;
        const char* record = scalar == detect::Scalar::f64 ? "double" : "float";
        rows.push_back({{"spheres", n},
                        {"record", record},
                        {"backend", detector.backend()},
                        {"contacts", c.count},
                        {"contacts_double_grid", oracle.size()},
                        {"pairs_equal_double_grid", equal},
                        {"contacts_bullet", bullet.size()},
                        {"matched", e.matched},
                        {"distance", moments_json(e.distance)},
                        {"normal", moments_json(e.normal)},
                        {"point", moments_json(e.point)}});
        const auto cell = [](double v) { return number(v, "%.2e"); };
        table.push_back({std::to_string(n), record, detector.backend(), std::to_string(c.count),
                         std::to_string(oracle.size()) + (equal ? " (same pairs)" : " (DIFFERS)"),
                         std::to_string(bullet.size()), std::to_string(e.matched), cell(e.distance.mean()),
                         cell(e.distance.deviation()), cell(e.normal.mean()), cell(e.normal.deviation()),
                         cell(e.point.mean()), cell(e.point.deviation())});
      }
    for (const PaperRow& p : kPaper)
      if (p.spheres == n)
        table.push_back({std::to_string(n), "float", "the paper", std::to_string(p.contacts), "",
                         std::to_string(p.contacts), "", number(p.distance, "%.2e"), "",
                         number(p.normal, "%.2e"), "", number(p.point, "%.2e"), ""});
    write_result(s, result());  // after each size: the large ones take long
  }
  return result();
}

}  // namespace padder::bench
