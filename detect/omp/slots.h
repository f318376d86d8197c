// SPDX-License-Identifier: MIT
// Spheres in the order of their bins, as the search on the CPU reads them. Internal.
#pragma once
#include <cstdint>
#include <type_traits>

#include "detect/contact.h"
#include "detect/core/grid.h"

namespace padder::detect::omp {

// Spheres that are tested at once. Arrays of slots are longer than the number of spheres by this much.
inline constexpr std::uint32_t kLanes = 8;

// Slots as four arrays, so that a run of candidates is read in whole vectors.
template <class Slot>
struct Slots {
  using Component = std::conditional_t<std::is_same_v<Slot, FloatSlot>, float, std::int32_t>;
  Component *x, *y, *z;
  float* r;
  Slot operator[](std::uint64_t k) const { return {x[k], y[k], z[k], r[k]}; }
  void set(std::uint64_t k, const Slot& s) const { x[k] = s.x, y[k] = s.y, z[k] = s.z, r[k] = s.r; }
};

// The spheres of slots as the caller gave them: float slots are that themselves.
template <class Slot>
using Exact = std::conditional_t<std::is_same_v<Slot, FloatSlot>, FloatSlot, Sphere>;
inline Sphere sphere_of(const FloatSlot& s) { return {s.x, s.y, s.z, s.r}; }
inline Sphere sphere_of(const Sphere& s) { return s; }

// Consecutive slots, from begin to end - 1.
struct Run {
  std::uint32_t begin, end;
};

}  // namespace padder::detect::omp
