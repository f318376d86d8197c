// SPDX-License-Identifier: MIT
// What the kernels of the three ways of putting spheres in order share. Only .cu files of this folder include
// this.
#pragma once
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/order/bins.h"
#include "detect/cuda/order/order.h"

namespace padder::detect::cuda {

// Arrays that hold spheres while they are put in order. `ids` is null where the slot holds the number, `keys`
// where keys are computed from slots, `codes` where they are not wanted yet.
struct Places {
  void* slots = nullptr;
  std::uint32_t* ids = nullptr;
  std::uint32_t* keys = nullptr;
  std::uint32_t* codes = nullptr;
};

// With bins in float, keys are computed from slots and never stored.
template <class Bins>
inline constexpr bool kKeyless = !std::is_same_v<Bins, Grid>;

// A slot, except that the fourth word holds the radius even for SlotKind::equal. Packed: the input is known
// to be packed (source.packed), and one load fetches a sphere.
template <SlotKind Kind, bool Packed>
__device__ __forceinline__ float4 bare_slot(const DeviceSpheres& source, const Grid* grid, std::uint32_t id) {
  if constexpr (Packed) return __ldg(source.float_sphere(id));
  const Sphere s = source.searched(id);
  if constexpr (Kind == SlotKind::fixed_point) {
    const FixedPointSlot f = fixed_point_slot(grid->level[level_of(*grid, s)], s);
    return make_float4(__int_as_float(f.x), __int_as_float(f.y), __int_as_float(f.z), f.r);
  } else {
    const FloatSlot f = float_slot(s);
    return make_float4(f.x, f.y, f.z, f.r);
  }
}

// Adds one to count[b] for each lane with b != ~0. Returns what the count was before, as if lanes came one
// after the other. Neighbouring lanes with the same b, as in coherent input, share one atomic operation.
__device__ __forceinline__ std::uint32_t ticket(std::uint32_t* count, std::uint32_t b) {
  const int lane = threadIdx.x & 31;
  const std::uint32_t left = __shfl_up_sync(~0u, b, 1);
  const std::uint32_t heads = __ballot_sync(~0u, lane == 0 || left != b);
  const int head = 31 - __clz(heads & (~0u >> (31 - lane)));
  const std::uint32_t after = lane == 31 ? 0 : heads & (~1u << lane);
  std::uint32_t at = 0;
  if (head == lane && b != ~0u) at = atomicAdd(count + b, (after ? __ffs(after) - 1 : 32) - lane);
  return __shfl_sync(~0u, at, head) + lane - head;
}

template <SlotKind Kind>
__device__ __forceinline__ float4 slot_of(const DeviceSpheres& source, const Grid* grid, std::uint32_t id) {
  constexpr bool kMayPack = Kind != SlotKind::fixed_point;
  float4 s = kMayPack && source.packed && !source.wide ? bare_slot<Kind, kMayPack>(source, grid, id)
                                                       : bare_slot<Kind, false>(source, grid, id);
  if (Kind == SlotKind::equal) s.w = __uint_as_float(id);
  return s;
}

// The code (codes.h) of a slot with this key.
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t code_for(const FloatBins& bins, std::uint32_t, const float4& s) {
  return code_of<Kind>(bins, {s.x, s.y, s.z, s.w});
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t code_for(const LevelBins& g, std::uint32_t, const float4& s) {
  return code_of<Kind>(g.level[level_of(g, s)], {s.x, s.y, s.z, s.w});
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t code_for(const Grid& grid, std::uint32_t key, const float4& s) {
  const Level& l = grid.level[level_of_key(grid, key)];
  if constexpr (Kind == SlotKind::fixed_point)
    return code_of<Kind>(l,
                         FixedPointSlot{__float_as_int(s.x), __float_as_int(s.y), __float_as_int(s.z), s.w});
  else
    return code_of<Kind>(l, FloatSlot{s.x, s.y, s.z, s.w});
}

// Calls f(kind, bins) with the bins that `o` goes by: those of the grid, or bins in float.
template <class F>
void with_bins(const Ordered& o, const Grid& grid, F f) {
  with_kind(o.kind, [&](auto kind) {
    if constexpr (kind() != SlotKind::fixed_point)
      if (o.bins.on) return f(kind, o.bins);
    if constexpr (kind() == SlotKind::unequal)
      if (o.float_levels) return f(kind, level_bins(grid, kind()));
    f(kind, grid);
  });
}
__device__ __forceinline__ const Grid* grid_of(const Grid& g) { return &g; }
template <class Bins>
__device__ __forceinline__ const Grid* grid_of(const Bins&) {
  return nullptr;
}
// The bins of a bucket, whose spheres are all of one level.
template <class Bins>
__device__ __forceinline__ const Bins& bins_of_level(const Bins& bins, int) {
  return bins;
}
__device__ __forceinline__ const FloatBins& bins_of_level(const LevelBins& bins, int level) {
  return bins.level[level];
}

}  // namespace padder::detect::cuda
