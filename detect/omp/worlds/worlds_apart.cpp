// SPDX-License-Identifier: MIT
#include "detect/omp/worlds/worlds_apart.h"

#include <algorithm>
#include <numeric>

#include "detect/core/errors.h"

namespace padder::detect::omp {
namespace {

// Of what is a number: faults are looked for where the spheres are summarized.
template <class T>
WorldBounds bounds_of(const View<T>& spheres, int threads) {
  WorldBounds all{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, INFINITY, 0, ~0u, 0};
  const auto join = [&](WorldBounds& to, const WorldBounds& b) {
    for (int c = 0; c < 3; c++)
      to.low[c] = std::min(to.low[c], b.low[c]), to.high[c] = std::max(to.high[c], b.high[c]);
    to.radius_min = std::min(to.radius_min, b.radius_min);
    to.radius_max = std::max(to.radius_max, b.radius_max);
    to.first_world = std::min(to.first_world, b.first_world);
    to.last_world = std::max(to.last_world, b.last_world);
  };
  const auto n = static_cast<std::int64_t>(spheres.count);
#pragma omp parallel num_threads(threads)
  {
    WorldBounds mine = all;
#pragma omp for schedule(static) nowait
    for (std::int64_t k = 0; k < n; k++) {
      const Sphere s = spheres[static_cast<std::uint64_t>(k)];
      const std::uint32_t world = spheres.world_of(static_cast<std::uint64_t>(k));
      join(mine, {{s.x, s.y, s.z}, {s.x, s.y, s.z}, s.r, s.r, world, world});
    }
#pragma omp critical
    join(all, mine);
  }
  return all;
}

}  // namespace

WorldsApart::WorldsApart(Budget& b) : moved_(b), grid_path_(b), found_(b) {}

template <class T>
bool WorldsApart::run(const View<T>& spheres, const CallOptions& options, int threads, Records& records,
                      Contacts& contacts) {
  Stopwatch watch;
  const WorldBounds bounds = bounds_of(spheres, threads);
  SideBySide boxes;
  double extent;
  if (!(options.own == Region{}) || !lay_side_by_side(bounds, spheres.count, options.margin, boxes, extent))
    return false;
  // docs/detector/exactness.md
  const double off = 8 * 0x1p-52 * extent;
  if (off > 0x1p-10 * bounds.radius_max) return false;
  Summary given;
  for (int c = 0; c < 3; c++)
    given.extent = std::max({given.extent, std::abs(bounds.low[c]), std::abs(bounds.high[c])});
  given.radius_max = bounds.radius_max;
  check_range(given, options);

  Sphere* moved = moved_.resize(spheres.count, "the spheres of worlds");
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(spheres.count); k++) {
    const auto q = static_cast<std::uint64_t>(k);
    moved[q] = boxes.moved(spheres[q], spheres.world_of(q));
  }
  View<double> apart = view_of(moved, spheres.count, spheres.family, spheres.mask, nullptr);
  apart.is_static = spheres.is_static;
  CallOptions wider = options;
  wider.width = Width::pairs, wider.margin += off;
  Summary summary = summarize(apart, threads);
  if (summary.first_fault != ~std::uint64_t(0)) return false;
  summary.grown_by = wider.margin / 2;
  contacts.seconds.place = watch.lap();
  grid_path_.run(apart, summary, wider, threads, found_, contacts.seconds);
  watch.lap();
  write(spheres, options, threads, records);
  contacts.seconds.stage[8] += watch.lap();
  return true;
}

template <class T>
void WorldsApart::write(const View<T>& spheres, const CallOptions& options, int threads,
                        Records& records) const {
  constexpr std::uint64_t kPart = 4096;  // pairs
  const std::uint64_t parts = (found_.count + kPart - 1) / kPart;
  std::vector<std::uint64_t> first(parts + 1, 0);
  const auto each = [&](std::uint64_t part, auto take) {
    for (std::uint64_t k = part * kPart; k < std::min((part + 1) * kPart, found_.count); k++) {
      const Pair p = found_.pairs[k];
      const Sphere i = spheres[p.i], j = spheres[p.j];
      if (touching(i, j, options.margin)) take(p, i, j);
    }
  };
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t part = 0; part < static_cast<std::int64_t>(parts); part++)
    each(static_cast<std::uint64_t>(part),
         [&](Pair, const Sphere&, const Sphere&) { first[static_cast<std::uint64_t>(part) + 1]++; });
  std::inclusive_scan(first.begin(), first.end(), first.begin());
  records.resize(first.back(), options);
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t part = 0; part < static_cast<std::int64_t>(parts); part++) {
    RecordWriter writer(records, options, first[static_cast<std::uint64_t>(part)]);
    each(static_cast<std::uint64_t>(part),
         [&](Pair p, const Sphere& i, const Sphere& j) { writer.add(p.i, p.j, i, [&] { return j; }); });
  }
}

template bool WorldsApart::run(const View<float>&, const CallOptions&, int, Records&, Contacts&);
template bool WorldsApart::run(const View<double>&, const CallOptions&, int, Records&, Contacts&);

}  // namespace padder::detect::omp
