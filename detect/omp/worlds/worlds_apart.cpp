// SPDX-License-Identifier: MIT
#include "detect/omp/worlds/worlds_apart.h"

#include <algorithm>
#include <unordered_map>

#include "detect/core/errors.h"

namespace padder::detect::omp {
namespace {

// The unit of work, and of the stable order: pairs that the grid has found, and spheres that walk over the
// tree.
constexpr std::uint64_t kPartPairs = 4096, kPartSpheres = 1024;

// Of what is a number: faults are looked for where the spheres are summarized.
template <class T>
WorldBounds bounds_of(const View<T>& spheres, int threads) {
  constexpr WorldBounds kNone{
      {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, INFINITY, 0, ~0u, 0};
  WorldBounds all = kNone;
  const auto join = [&](WorldBounds& to, const WorldBounds& b) {
    for (int c = 0; c < 3; c++)
      to.low[c] = std::min(to.low[c], b.low[c]), to.high[c] = std::max(to.high[c], b.high[c]);
    to.radius_min = std::min(to.radius_min, b.radius_min);
    to.radius_max = std::max(to.radius_max, b.radius_max);
    to.first_world = std::min(to.first_world, b.first_world);
    to.last_world = std::max(to.last_world, b.last_world), to.every += b.every;
  };
  const auto n = static_cast<std::int64_t>(spheres.count);
#pragma omp parallel num_threads(threads)
  {
    WorldBounds mine = kNone;
#pragma omp for schedule(static) nowait
    for (std::int64_t k = 0; k < n; k++) {
      const Sphere s = spheres[static_cast<std::uint64_t>(k)];
      const std::uint32_t world = spheres.world_of(static_cast<std::uint64_t>(k));
      const bool every = world == kEveryWorld;
      join(mine, {{s.x, s.y, s.z}, {s.x, s.y, s.z}, s.r, s.r, world, every ? 0 : world, every});
    }
#pragma omp critical
    join(all, mine);
  }
  return all;
}

// Numbers of worlds without gaps, in the order in which the worlds appear. kEveryWorld stays.
template <class T>
std::vector<std::uint32_t> ranks_of_worlds(const View<T>& spheres) {
  std::unordered_map<std::uint32_t, std::uint32_t> rank{{kEveryWorld, kEveryWorld}};
  std::vector<std::uint32_t> ranks(spheres.count);
  for (std::uint64_t k = 0; k < spheres.count; k++)
    ranks[k] = k > 0 && spheres.world_of(k) == spheres.world_of(k - 1)
                   ? ranks[k - 1]
                   : rank.try_emplace(spheres.world_of(k), static_cast<std::uint32_t>(rank.size()) - 1)
                         .first->second;
  return ranks;
}

}  // namespace

WorldsApart::WorldsApart(Budget& b)
    : moved_(b), grid_path_(b), found_(b), every_spheres_(b), tree_(b), hits_(b, "contacts") {}

template <class T>
bool WorldsApart::run(const View<T>& input, const CallOptions& options, int threads, Records& records,
                      Contacts& contacts) {
  Stopwatch watch;
  View<T> spheres = input;
  WorldBounds bounds = bounds_of(spheres, threads);
  std::vector<std::uint32_t> ranks;
  if (bounds.sparse(spheres.count)) {
    ranks = ranks_of_worlds(spheres), spheres.world = ranks.data();
    bounds = bounds_of(spheres, threads);
  }
  SideBySide boxes;
  double extent;
  if (!lay_side_by_side(bounds, spheres.count, options.margin, boxes, extent)) return false;
  // docs/detector/exactness.md
  const double off = 8 * 0x1p-52 * extent;
  if (off > 0x1p-10 * bounds.radius_max) return false;
  Sphere* moved = moved_.resize(spheres.count, "the spheres of worlds");
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(spheres.count); k++) {
    const auto q = static_cast<std::uint64_t>(k);
    moved[q] = boxes.moved(spheres[q], spheres.world_of(q));
  }
  View<double> apart = view_of(moved, spheres.count, spheres.family, spheres.mask, spheres.owner);
  apart.is_static = spheres.is_static;
  CallOptions wider = options;
  wider.width = Width::pairs, wider.margin += off, wider.own = {};
  Summary summary = summarize(apart, threads);
  if (summary.first_fault != ~std::uint64_t(0)) return false;
  Summary given;
  for (int c = 0; c < 3; c++)
    given.extent = std::max({given.extent, std::abs(bounds.low[c]), std::abs(bounds.high[c])});
  given.radius_max = bounds.radius_max;
  check_range(given, options);
  summary.grown_by = wider.margin / 2;
  build_tree(spheres, bounds.many() ? bounds.every : 0, threads);
  contacts.seconds.place = watch.lap();
  grid_path_.run(apart, summary, wider, threads, found_, contacts.seconds);
  watch.lap();
  find_hits(spheres, options, threads);
  contacts.seconds.stage[6] += watch.lap();
  records.resize(hits_.size(), options);
  hits_.each(threads, [&](std::span<const Pair> hits, std::uint64_t place) {
    RecordWriter writer(records, options, place);
    for (const Pair h : hits) writer.add(h.i, h.j, spheres[h.i], [&] { return spheres[h.j]; });
  });
  contacts.seconds.stage[8] += watch.lap();
  return true;
}

// The tree of the `count` spheres of kEveryWorld.
template <class T>
void WorldsApart::build_tree(const View<T>& spheres, std::uint64_t count, int threads) {
  every_.clear();
  if (count == 0) return;
  Sphere* const every = every_spheres_.resize(count, "the tree of worlds");
  for (std::uint64_t k = 0; k < spheres.count; k++)
    if (spheres.world_of(k) == kEveryWorld)
      every[every_.size()] = spheres[k], every_.push_back(static_cast<std::uint32_t>(k));
  const CurveBox curve = curve_box(every, static_cast<std::uint32_t>(count));
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
  for (std::uint64_t k = 0; k < count; k++) order.emplace_back(place_on_curve(curve, every[k]), every_[k]);
  std::sort(order.begin(), order.end());
  for (std::uint64_t k = 0; k < count; k++) every_[k] = order[k].second, every[k] = spheres[every_[k]];
  tree_.build(every, static_cast<std::uint32_t>(count), threads);
}

// What touches, of the pairs that the grid has found and of those with kEveryWorld.
template <class T>
void WorldsApart::find_hits(const View<T>& spheres, const CallOptions& options, int threads) {
  const bool bounded = options.own != Region{};
  const auto owned = [&](std::uint32_t a, std::uint32_t b) {
    return !bounded || owns(options.own, midpoint(spheres[std::min(a, b)], spheres[std::max(a, b)]));
  };
  const std::uint64_t of_grid = (found_.count + kPartPairs - 1) / kPartPairs,
                      of_tree = every_.empty() ? 0 : (spheres.count + kPartSpheres - 1) / kPartSpheres;
  hits_.fill(of_grid + of_tree, threads, [&](std::uint64_t part, List<Pair>& list) {
    if (part < of_grid) {
      for (std::uint64_t k = part * kPartPairs; k < std::min((part + 1) * kPartPairs, found_.count); k++) {
        const Pair p = found_.pairs[k];
        if (touching(spheres[p.i], spheres[p.j], options.margin) && owned(p.i, p.j)) list.add(p);
      }
      return;
    }
    const std::uint64_t first = (part - of_grid) * kPartSpheres;
    for (std::uint64_t k = first; k < std::min(first + kPartSpheres, spheres.count); k++) {
      if (spheres.world_of(k) == kEveryWorld) continue;
      const Sphere s = spheres[k];
      tree_->visit(box_of(s, options.margin), 0, static_cast<std::uint32_t>(every_.size()),
                   [&](std::uint32_t e) {
                     if (touching(s, every_spheres_[e], options.margin) &&
                         admitted(spheres.filter(k), spheres.filter(every_[e])) &&
                         owned(static_cast<std::uint32_t>(k), every_[e]))
                       list.add({static_cast<std::uint32_t>(k), every_[e]});
                     return true;
                   });
    }
  });
}

template bool WorldsApart::run(const View<float>&, const CallOptions&, int, Records&, Contacts&);
template bool WorldsApart::run(const View<double>&, const CallOptions&, int, Records&, Contacts&);

}  // namespace padder::detect::omp
