// SPDX-License-Identifier: MIT
// How near spheres lie to each other, which their bounds do not tell (docs/detector/algorithm.md, "How
// densely spheres lie"): what is counted before levels are chosen, and what choose_grid() takes from it. For
// host and device, except for what is marked as host code. Internal.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "detect/core/grid.h"

namespace padder::detect {

// The octaves that hold spheres, in groups: a group for each, unless there are more of them than levels.
struct SizeGroups {
  std::int32_t count = 0;  // groups, from the finest to the coarsest
  std::int32_t top = 0;    // as Grid::top
  std::uint8_t of_octave[kOctaves] = {};
  double within[kMaxLevels] = {};  // of each group: 1.5 times the largest need
  friend bool operator==(const SizeGroups&, const SizeGroups&) = default;
};
// The first of the groups' distances, which grow, that this one does not exceed; `count`: none.
PADDER_HD int first_within(const SizeGroups& g, double distance) {
  int smaller = 0;
  for (int k = 0; k < g.count; k++) smaller += distance > g.within[k];
  return smaller;
}
PADDER_HD double chebyshev_distance(const Sphere& a, const Sphere& b) {
  return larger(larger(magnitude(sub(a.x, b.x)), magnitude(sub(a.y, b.y))), magnitude(sub(a.z, b.z)));
}

// How near spheres lie to each other: it is counted how many of some spheres, the targets, lie near some
// others, the probes. Bounds do not tell that: fine grains may lie in one heap among boulders that are spread
// widely. A level with bins for both would have the heap in a few bins.
struct Neighbourhood {
  static constexpr std::uint32_t kFewTargets = 1024, kManyTargets = 4096, kTargetsOfProbe = 8;
  SizeGroups groups;
  std::uint32_t targets = 0;  // that were drawn
  std::uint32_t probes[kMaxLevels] = {};
  // Of a probe's group, a target's group, and the first of the groups' distances that is not exceeded.
  std::uint32_t pairs[kMaxLevels][kMaxLevels][kMaxLevels] = {};
};
// The input is cut into parts, and one sphere is taken from each, anywhere, because the input may have an
// order of its own. A part for targets has so many spheres, one for probes eight times as many. It has at
// least 64, or 16: counting must not take longer than the call. It goes in steps, so that mostly the same
// spheres are taken where a few come or go. Spheres behind the last whole part are in none.
//
// Few where each call counts: on a CPU, and for a stable order. Many where a GPU keeps its levels.
enum class Draw { few, many };
PADDER_HD std::uint32_t part_of_targets(std::uint64_t spheres, Draw draw) {
  const bool many = draw == Draw::many;
  const std::uint32_t least = many ? 16 : 64;
  std::uint64_t part = spheres / (many ? Neighbourhood::kManyTargets : Neighbourhood::kFewTargets) + 1;
  int shift = 0;
  while (part >> shift >= 16) shift++;
  if (shift > 0) part = ((part >> shift) + 1) << shift;
  return part < least ? least : static_cast<std::uint32_t>(part);
}
PADDER_HD std::uint32_t part_of_probes(std::uint64_t spheres, Draw draw) {
  return Neighbourhood::kTargetsOfProbe * part_of_targets(spheres, draw);
}
PADDER_HD std::uint32_t targets_of(std::uint64_t spheres, Draw draw) {
  return static_cast<std::uint32_t>(spheres / part_of_targets(spheres, draw));
}
PADDER_HD std::uint32_t probes_of(std::uint64_t spheres, Draw draw) {
  return static_cast<std::uint32_t>(spheres / part_of_probes(spheres, draw));
}
// The sphere that is taken from part number k.
PADDER_HD std::uint32_t drawn_at(std::uint32_t k, std::uint32_t part) {
  const std::uint32_t begin = k * part;
  return begin + static_cast<std::uint32_t>(((mixed(begin) >> 32) * part) >> 32);
}

// Host code. The groups of the octaves, which are known.
SizeGroups size_groups(const Summary& s);
// Host code. Summary::near; at(k) is sphere number k.
template <class SphereAt>
std::shared_ptr<const Neighbourhood> probe_neighbourhood(const Summary& s, const SphereAt& at,
                                                         Draw draw = Draw::few) {
  const auto made = std::make_shared<Neighbourhood>();
  Neighbourhood& n = *made;
  const SizeGroups groups = n.groups = size_groups(s);
  const auto group_of = [&](const Sphere& p) { return groups.of_octave[octave_of(groups.top, need_of(p))]; };
  const std::uint32_t probes = probes_of(s.count, draw), targets = n.targets = targets_of(s.count, draw);
  std::vector<double> x(targets), y(targets), z(targets), distance(targets);
  std::vector<std::uint8_t> group(targets);
  std::vector<std::uint32_t> number(targets);
  for (std::uint32_t k = 0; k < targets; k++) {
    const Sphere p = at(number[k] = drawn_at(k, part_of_targets(s.count, draw)));
    x[k] = p.x, y[k] = p.y, z[k] = p.z, group[k] = group_of(p);
  }
  const double farthest = groups.within[groups.count - 1];
  for (std::uint32_t q = 0; q < probes; q++) {
    const std::uint32_t own = drawn_at(q, part_of_probes(s.count, draw));
    const Sphere probe = at(own);
    const std::uint8_t of_probe = group_of(probe);
    n.probes[of_probe]++;
    for (std::uint32_t k = 0; k < targets; k++)
      distance[k] = chebyshev_distance(probe, {x[k], y[k], z[k], 0});
    for (std::uint32_t k = 0; k < targets; k++)
      if (distance[k] <= farthest && number[k] != own)
        n.pairs[of_probe][group[k]][first_within(groups, distance[k])]++;
  }
  return made;
}

// Host code. What Summary::near says of the spheres near others.
class ProbedDensity {
 public:
  // Without probes, or with other groups than `octaves`, it says nothing.
  ProbedDensity(const Summary& s, const SizeGroups& octaves) : near_(s.near.get()) {
    known_ = near_ && near_->groups.count == octaves.count &&
             std::equal(octaves.of_octave, octaves.of_octave + kOctaves, near_->groups.of_octave);
    if (!known_) return;
    weight_ = static_cast<double>(s.count) / std::max(near_->targets, 1u);
    const auto n = static_cast<std::size_t>(octaves.count);
    for (std::size_t i = 0; i < n; i++)
      for (std::size_t k = 0; k < n; k++)
        for (std::size_t d = 0; d < n; d++)
          upto_[i][k][d] = near_->pairs[i][k][d] + (k ? upto_[i][k - 1][d] : 0) +
                           (d ? upto_[i][k][d - 1] : 0) - (k && d ? upto_[i][k - 1][d - 1] : 0);
  }
  // The mean number of spheres of groups a to b in the bins for group b that are near spheres of group
  // `seen_by`, as probes say: 0 and infinity where they say nothing. Within 1.5 bins of a sphere there are
  // 27; a coarser sphere sees as many of its own size. What chance may add is left out: two deviations, and
  // three where it may have left some out.
  struct Bounds {
    double least = 0, most = INFINITY;
    double clamped(double estimate) const { return std::clamp(estimate, least, most); }
  };
  Bounds in_bin(std::size_t a, std::size_t b, std::size_t seen_by) const {
    if (!known_ || near_->probes[seen_by] == 0) return {};
    const std::size_t at = std::max(b, seen_by);
    const double found = upto_[seen_by][b][at] - (a ? upto_[seen_by][a - 1][at] : 0),
                 deviation = std::sqrt(found) + 1,
                 wide = 3 * near_->groups.within[at] / near_->groups.within[b],
                 each = weight_ / (near_->probes[seen_by] * wide * wide * wide);
    return {each * std::max(found - 2 * deviation, 0.0), each * (found + 3 * deviation)};
  }

 private:
  const Neighbourhood* near_;
  bool known_;
  double weight_ = 0;
  std::uint32_t upto_[kMaxLevels][kMaxLevels][kMaxLevels];  // sums over groups and distances
};

// Host code. The same for the levels of a grid that was chosen from the summary.
class ProbedLevels {
 public:
  ProbedLevels(const Summary& s, const Grid& g)
      : near_(s.near.get()), probed_(s, near_ ? near_->groups : SizeGroups()) {
    for (int o = kOctaves - 1; o >= 0 && near_; o--)
      if (s.octave[o].count) groups_[g.level_of_octave[o]].add(near_->groups.of_octave[o]);
  }
  // The mean number of spheres of level `at`, at least, in its bins that are near spheres of another level.
  double in_bin(int at, int seen_by) const {
    double sum = 0, probes = 0;
    for (std::size_t k = groups_[seen_by].first; near_ && k <= groups_[seen_by].last; k++) {
      const double of_group = near_->probes[k];
      if (of_group > 0) sum += of_group * probed_.in_bin(groups_[at].first, groups_[at].last, k).least;
      probes += of_group;
    }
    return probes > 0 ? sum / probes : 0;
  }

 private:
  struct Groups {
    std::size_t first = kMaxLevels, last = 0;
    void add(std::size_t k) { first = std::min(first, k), last = std::max(last, k); }
  };
  const Neighbourhood* near_;
  ProbedDensity probed_;
  Groups groups_[kMaxLevels];
};

}  // namespace padder::detect
