// SPDX-License-Identifier: MIT
// For each bin of a level, the spheres of the level that reach into it. Internal.
//
// A finer sphere that searches the level by its bins asks several rows of bins, most of which hold nothing it
// touches. Here it finds its partners in one list: that of its own bin. A sphere is listed in 8 bins or so,
// which costs little where the finer spheres are many more.
#pragma once
#include "detect/omp/level_keys.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

// The finer levels that search a level: the largest radius, and bounds of the spheres.
struct Partners {
  bool any = false;
  double radius = 0;
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  void add(const Level& l) {
    any = true, radius = std::max(radius, l.radius_max);
    for (int k = 0; k < 3; k++) {
      low[k] = l.hashed ? -INFINITY : std::min(low[k], low_of(l, k));
      high[k] = l.hashed ? INFINITY : std::max(high[k], high_of(l, k));
    }
  }
};

class ReachTable {
 public:
  explicit ReachTable(Budget& b) : starts_(b), slots_(b) {}

  // Lists the spheres of level `l`, which are in slots `first` to `last` - 1.
  template <class S>
  void build(const Level& l, const Partners& partners, const S* spheres, std::uint32_t first,
             std::uint32_t last) {
    level_ = l, partners_ = partners, keys_ = keys_of(l), keys_.offset = 0;
    std::uint32_t* const starts = starts_.resize(std::uint64_t(l.buckets) + 2, "bins of large spheres");
    std::fill_n(starts, std::uint64_t(l.buckets) + 2, 0u);
    for (std::uint32_t k = first; k < last; k++)
      each_bin(sphere_of(spheres[k]), [&](std::uint32_t key) { starts[key]++; });
    std::uint64_t sum = 0;
    for (std::uint32_t b = 0; b <= l.buckets; b++)
      sum += starts[b], starts[b] = static_cast<std::uint32_t>(sum);
    starts[l.buckets + 1] = starts[l.buckets];
    std::uint32_t* const slots = slots_.resize(sum + kLanes, "bins of large spheres");
    for (std::uint32_t k = last; k-- > first;)
      each_bin(sphere_of(spheres[k]), [&](std::uint32_t key) { slots[--starts[key]] = k; });
  }
  // The run of the table that holds the spheres that reach into bin (x, y, z). The numbers are modulo 2^32.
  Run run(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t key =
        (inside(x, 0) & inside(y, 1) & inside(z, 2)) != 0 ? keys_.key(x, y, z) : level_.buckets;
    return {starts_[key], starts_[std::uint64_t(key) + 1]};
  }
  // Slots of spheres; behind the last run, there are kLanes more that can be read.
  const std::uint32_t* slots() const { return slots_.data(); }

 private:
  // Is a bin one of those of the level or of its border, 1 or 0? Partners elsewhere touch nothing of the
  // level.
  std::uint32_t inside(std::uint32_t bin, int axis) const {
    return keys_.periodic() ||
           bin + 1 - static_cast<std::uint32_t>(level_.first[axis]) < level_.count[axis] + 2;
  }
  // Calls visit(key) for the bins in which partners may touch s. They are at most one bin away from that of
  // s, and so have keys of their own. A bin more than the reach makes up for rounding.
  template <class Visit>
  void each_bin(const Sphere& s, const Visit& visit) const {
    const double reach = (s.r + level_.grown_by + partners_.radius) * (1 + 0x1p-20),
                 place[3] = {s.x, s.y, s.z}, far = reach + level_.size;
    std::uint32_t low[3], high[3];
    for (int k = 0; k < 3; k++) {
      if (place[k] + far < partners_.low[k] || place[k] - far > partners_.high[k]) return;
      const Split at = split(level_, place[k]);
      low[k] = static_cast<std::uint32_t>(at.bin) - (at.rest < reach);
      high[k] = static_cast<std::uint32_t>(at.bin) + (at.rest + reach >= level_.size);
    }
    for (std::uint32_t z = low[2]; z != high[2] + 1; z++)
      for (std::uint32_t y = low[1]; y != high[1] + 1; y++)
        for (std::uint32_t x = low[0]; x != high[0] + 1; x++) visit(keys_.key(x, y, z));
  }

  Level level_;
  Partners partners_;
  LevelKeys keys_;
  Buffer<std::uint32_t> starts_, slots_;
};

}  // namespace padder::detect::omp
