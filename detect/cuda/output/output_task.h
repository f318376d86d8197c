// SPDX-License-Identifier: MIT
// What a kernel needs to write contacts: the spheres in the order of their bins, the list, and the
// bookkeeping that gives a list of stable order its output slots. Only .cu files include this.
//
// A producer is what reserves output slots together: a tile of spheres, or a unit (spheres of one level that
// search another level). Producers are numbered: first the tiles, behind them the units. The stable order is
// the order of producers, and within a producer the order in which it finds its contacts.
#pragma once
#include "detect/cuda/device/counters.h"
#include "detect/cuda/order/order.h"
#include "detect/cuda/output/output.h"

namespace padder::detect::cuda {

using Word = unsigned long long;  // what 64-bit atomic operations take

// A block of threads takes a tile: each of its four warps 32 consecutive spheres of the order, one a lane.
inline constexpr int kTileWarps = 4, kTileSpheres = 32 * kTileWarps;
// In the fused search one warp takes a tile. Those of a stable order are twice as large, and some of any
// order.
inline constexpr std::uint32_t kLargeTile = 2 * kTileSpheres;

// A producer notes how many slots it left empty and how many contacts it spilled, in sums over groups of this
// many producers. A group has tiles or units, not both.
inline constexpr int kGroupProducers = 1024;
// Quotas of units are laid out in groups of this many units: one block of threads computes a group.
inline constexpr std::uint32_t kQuotaUnits = 256;
// The word of a unit: its quota in the lower bits, above them its offset within its group.
inline constexpr std::uint32_t kQuotaBits = 12, kMostQuota = (1u << kQuotaBits) - 1;
// A unit's spilled contact names its unit and a sphere of the unit (below 32) instead of a sphere.
inline constexpr std::uint32_t kOfUnit = 1u << 31, kMostUnits = 1u << 26;
// Entry k of the index of empty slots names the producer that left empty slot number k * kIndexStep.
inline constexpr std::uint32_t kIndexStep = 32;

// Bookkeeping of a list of stable order, in device memory (stable_output.cu lays it out).
struct StableOutput {
  // So few tiles that each waits for those before it (ordered_tiles.h). The first word is the number of the
  // search.
  bool ordered = false;
  Word* ordered_words = nullptr;
  // Blocks of a compaction that have read the sums. Zero between searches.
  unsigned int* blocks_done = nullptr;
  // Of each group of producers two words, slots left empty and contacts spilled; with `octets` one word for
  // each eight producers (note_net). Zero between searches.
  Word* group_sums = nullptr;
  bool octets = false;
  std::uint32_t tile_groups = 0, all_groups = 0, quota_groups = 0;
  // Of each producer, where its spilled contacts begin, and its contacts less its quota; of each unit its
  // first sphere.
  Word* spill_start = nullptr;
  std::uint32_t *net = nullptr, *unit_first = nullptr;
  // The side list: i (or the unit and a sphere of it) in the upper half of a word, j in the lower half. The
  // fused search writes two words a contact (fused_queue.h).
  Word* spill = nullptr;
  std::uint64_t spill_capacity = 0;
  // Where units have quotas, the word of each unit (kQuotaBits). Of each producer the empty slots up to its
  // end, modulo 2^32, and the index of empty slots.
  std::uint32_t *unit_quotas = nullptr, *empty_upto = nullptr, *empty_index = nullptr;
  // The first output slot of each group of units, and behind them the slot behind all quotas; the number of
  // all empty slots.
  Word *quota_bases = nullptr, *empty_total = nullptr;
  // Of each group of units a word of the look-back in unit_quotas.cu. Zero between searches.
  Word* quota_sums = nullptr;
  std::uint64_t index_capacity = 0;
};

// Quotas of the tiles of each level: which tile is the first of the level, how many slots each tile has to
// itself, and the first slot of the first tile. The entry behind the last level is the slot behind all tiles.
struct TileQuotas {
  int levels = 1;
  std::uint32_t first[kMaxLevels] = {}, quota[kMaxLevels] = {};
  Word slot[kMaxLevels + 1] = {};
};

// Output slots that a producer has to itself: each tile, and a unit for each 16th of a contact that it is
// expected to find (unit_quotas.cu).
struct SlotQuota {
  std::uint32_t tile = 0;
  float unit = 0;
  friend bool operator==(const SlotQuota&, const SlotQuota&) = default;
};

struct OutputTask {
  DeviceSpheres source;
  Ordered spheres;
  Output output;
  Counters* counters = nullptr;
  bool stable_order = true;
  SlotQuota quota;
  StableOutput stable;
  TileQuotas tile_quotas;
  std::uint32_t tiles = 0, units = 0, tile_spheres = kTileSpheres;
  double radius = 0;  // of all spheres, for SlotKind::equal
  float radius_f32 = 0;
};

// ---- The spheres as the search reads them. `index` counts spheres in the order of their bins; `id` is a
// sphere's number in the input.
template <SlotKind Kind>
struct SlotOf {
  using Type = FloatSlot;
};
template <>
struct SlotOf<SlotKind::fixed_point> {
  using Type = FixedPointSlot;
};

__device__ __forceinline__ FloatSlot load_slot(const FloatSlot* p) {
  const float4 v = __ldg(reinterpret_cast<const float4*>(p));
  return {v.x, v.y, v.z, v.w};
}
__device__ __forceinline__ FixedPointSlot load_slot(const FixedPointSlot* p) {
  const int4 v = __ldg(reinterpret_cast<const int4*>(p));
  return {v.x, v.y, v.z, __int_as_float(v.w)};
}
__device__ __forceinline__ float3 difference(const FloatSlot& a, const FloatSlot& b) {
  return make_float3(b.x - a.x, b.y - a.y, b.z - a.z);
}
__device__ __forceinline__ float3 difference(const FixedPointSlot& a, const FixedPointSlot& b) {
  return make_float3(static_cast<float>(wrapped_difference(a.x, b.x)),
                     static_cast<float>(wrapped_difference(a.y, b.y)),
                     static_cast<float>(wrapped_difference(a.z, b.z)));
}
template <SlotKind Kind>
__device__ __forceinline__ const typename SlotOf<Kind>::Type* slots_of(const OutputTask& task) {
  return static_cast<const typename SlotOf<Kind>::Type*>(task.spheres.slots);
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t id_at(const OutputTask& task, std::uint32_t index) {
  if constexpr (Kind == SlotKind::equal)
    return __float_as_uint(load_slot(slots_of<Kind>(task) + index).r);
  else
    return __ldg(task.spheres.ids + index);
}
// As it was given, where slots do not hold the spheres. Rounded ones of several sizes are always gathered.
template <SlotKind Kind>
__device__ __forceinline__ Sphere given_sphere(const OutputTask& task, std::uint32_t index) {
  if (Kind != SlotKind::unequal && !task.spheres.given)
    return task.source.given_sphere(id_at<Kind>(task, index));
  const auto* const p = reinterpret_cast<const double2*>(task.spheres.given + index);
  const double2 xy = __ldg(p), zr = __ldg(p + 1);
  return {xy.x, xy.y, zr.x, zr.y};
}
// By its slot, which may be rounded: for where it is searched.
template <SlotKind Kind>
__device__ __forceinline__ Sphere sphere_of_slot(const OutputTask& task, std::uint32_t index) {
  if constexpr (Kind == SlotKind::fixed_point) {
    return given_sphere<Kind>(task, index);
  } else {
    const FloatSlot s = load_slot(slots_of<Kind>(task) + index);
    return {s.x, s.y, s.z, Kind == SlotKind::equal ? task.radius : double(s.r)};
  }
}
// As it was given.
template <SlotKind Kind>
__device__ __forceinline__ Sphere sphere_at(const OutputTask& task, std::uint32_t index) {
  return task.spheres.rounded ? given_sphere<Kind>(task, index) : sphere_of_slot<Kind>(task, index);
}

}  // namespace padder::detect::cuda
