// SPDX-License-Identifier: MIT
// Reserve and emit: the half of the interface between search and output that runs on the device (the other
// half is compaction.h). A producer reserves output slots for the contacts it found and then emits them. Only
// .cu files include this.
//
// In any order one atomic addition reserves the slots. In stable order the slots must not depend on which
// producer comes first, and no producer should wait for another. So each has a quota, a range of slots of its
// own. Contacts beyond the quota spill to a side list, slots that it does not use stay empty. After the
// search a compaction moves the spilled contacts: the n-th one, counted in the order of producers, goes to
// the n-th empty slot, the rest goes behind all quotas. Quotas are a little smaller than what is found on
// average, so that all empty slots are filled and few contacts move. All tiles have the same quota. Units
// find such different numbers of contacts that each has a quota of its own (unit_quotas.cu), or none where
// spheres are few.
#pragma once
#include "detect/cuda/output/record_writer.h"

namespace padder::detect::cuda {

// Slots of a producer: its contacts 0 to quota - 1 go to `slot` onwards, the others to the side list from
// `spill` on. Of a unit also what its spilled contacts are called: kOfUnit | unit << 5, and the unit's first
// sphere.
struct OutputRange {
  Word slot, spill;
  std::uint32_t quota, unit_tag, unit_first;
};

// The slots that a tile has to itself.
struct TileSlots {
  Word first;
  std::uint32_t count;
};
__device__ __forceinline__ TileSlots slots_of_tile(const OutputTask& task, std::uint32_t tile) {
  const TileQuotas& q = task.tile_quotas;
  int level = q.levels - 1;
#pragma unroll 1
  while (level > 0 && tile < q.first[level]) level--;
  return {q.slot[level] + static_cast<Word>(tile - q.first[level]) * q.quota[level], q.quota[level]};
}
// The word of a unit (kQuotaBits); 0 where units have no quota.
__device__ __forceinline__ std::uint32_t unit_quota_word(const StableOutput& stable, std::uint32_t unit) {
  return stable.unit_quotas ? __ldcg(stable.unit_quotas + unit) : 0;
}
__device__ __forceinline__ Word slot_behind_quotas(const OutputTask& task) {
  const StableOutput& stable = task.stable;
  return stable.unit_quotas ? stable.quota_bases[stable.quota_groups]
                            : task.tile_quotas.slot[task.tile_quotas.levels];
}
// The slot behind a producer's quota.
__device__ __forceinline__ Word end_of_quota(const OutputTask& task, std::uint32_t producer) {
  if (producer < task.tiles) {
    const TileSlots s = slots_of_tile(task, producer);
    return s.first + s.count;
  }
  const std::uint32_t unit = producer - task.tiles, word = __ldcg(task.stable.unit_quotas + unit);
  return __ldcg(task.stable.quota_bases + unit / kQuotaUnits) + (word >> kQuotaBits) + (word & kMostQuota);
}

__device__ __forceinline__ std::uint32_t group_of(const OutputTask& task, std::uint32_t producer) {
  return producer < task.tiles ? producer / kGroupProducers
                               : task.stable.tile_groups + (producer - task.tiles) / kGroupProducers;
}
// Notes `net`, the contacts of a producer less its quota, and adds what it spilled or left empty to the sums.
// With `octets` these are over eight producers: contacts spilled in the lower half of a word, slots left
// empty in the upper half.
__device__ __forceinline__ void note_net(const OutputTask& task, std::uint32_t producer, std::int32_t net) {
  task.stable.net[producer] = static_cast<std::uint32_t>(net);
  if (net == 0) return;
  const auto more = static_cast<Word>(net < 0 ? -net : net);
  if (task.stable.octets)
    atomicAdd(task.stable.group_sums + producer / 8, net < 0 ? more << 32 : more);
  else
    atomicAdd(task.stable.group_sums + group_of(task, producer) * 2 + (net > 0), more);
}

// By one thread.
__device__ __forceinline__ OutputRange reserve_for_tile(const OutputTask& task, std::uint32_t tile,
                                                        std::uint32_t found) {
  if (!task.stable_order)
    return {found ? atomicAdd(&task.counters->contacts, static_cast<Word>(found)) : 0, 0, ~0u, 0, 0};
  const std::uint32_t quota = task.quota.tile, spilled = found > quota ? found - quota : 0;
  OutputRange range{static_cast<Word>(tile) * quota, 0, quota, 0, 0};
  if (spilled) range.spill = atomicAdd(&task.counters->spilled, static_cast<Word>(spilled));
  note_net(task, tile, static_cast<std::int32_t>(found - quota));
  task.stable.spill_start[tile] = range.spill;
  return range;
}
__device__ __forceinline__ OutputRange reserve_for_unit(const OutputTask& task, std::uint32_t unit,
                                                        std::uint32_t first, std::uint32_t found) {
  Counters* const c = task.counters;
  if (!task.stable_order)
    return {found ? atomicAdd(&c->contacts, static_cast<Word>(found)) : 0, 0, ~0u, 0, 0};
  const StableOutput& stable = task.stable;
  const std::uint32_t producer = task.tiles + unit, word = unit_quota_word(stable, unit),
                      quota = word & kMostQuota, spilled = found > quota ? found - quota : 0;
  OutputRange range{0, 0, quota, kOfUnit | unit << 5, first};
  if (quota) range.slot = __ldcg(stable.quota_bases + unit / kQuotaUnits) + (word >> kQuotaBits);
  if (spilled) range.spill = atomicAdd(&c->spilled, static_cast<Word>(spilled));
  note_net(task, producer, static_cast<std::int32_t>(found - quota));
  stable.spill_start[producer] = range.spill, stable.unit_first[unit] = first;
  return range;
}

// Contact number k of a producer, of spheres i and j of the order.
__device__ __forceinline__ void spill(const OutputTask& task, const OutputRange& range, std::uint32_t k,
                                      std::uint32_t i, std::uint32_t j) {
  const Word to = range.spill + (k - range.quota);
  const std::uint32_t who = range.unit_tag ? range.unit_tag | (i - range.unit_first) : i;
  if (to < task.stable.spill_capacity) task.stable.spill[to] = static_cast<Word>(who) << 32 | j;
}
template <SlotKind Kind>
__device__ __forceinline__ void emit(const OutputTask& task, const OutputRange& range, std::uint32_t k,
                                     std::uint32_t i, std::uint32_t j) {
  if (k < range.quota)
    write_record<Kind>(task, i, j, range.slot + k);
  else
    spill(task, range, k, i, j);
}

// By a warp: its contacts, which are numbers `before` onwards of the producer; `pair(k, i, j)` gives the
// spheres of the k-th. A lane has two records under way.
template <SlotKind Kind, class PairOf>
__device__ __forceinline__ void emit_by_warp(const OutputTask& task, const OutputRange& range,
                                             std::uint32_t found, std::uint32_t before, PairOf pair) {
  const std::uint32_t lane = kept_in_register(threadIdx.x & 31), quota = range.quota,
                      here = before < quota ? min(found, quota - before) : 0;
  std::uint32_t i, j;
  const Word to = range.slot + before;
  const auto write = [&]<bool Given, bool NormalsOnly>() {
    constexpr int kAtOnce = Given ? 1 : 2;  // what was given takes twice the registers
#pragma unroll 1
    for (std::uint32_t k = lane; k < here; k += 32 * kAtOnce) {
      RecordInput<Given> input[kAtOnce];
#pragma unroll
      for (int u = 0; u < kAtOnce; u++) {
        pair(k + 32 * u < here ? k + 32 * u : k, i, j);
        input[u] = load_record_input<Kind, Given>(task, i, j);
      }
#pragma unroll
      for (int u = 0; u < kAtOnce; u++)
        if (k + 32 * u < here) write_float_record<Kind, NormalsOnly>(task, input[u], to + k + 32 * u);
    }
  };
  const RecordKind kind = record_kind(task);
  if (kind == RecordKind::doubles) {
#pragma unroll 1
    for (std::uint32_t k = lane; k < here; k += 32)
      pair(k, i, j), write_double_record<Kind>(task, i, j, to + k);
  } else if (kind == RecordKind::from_given) {
    write.template operator()<true, false>();
  } else if (task.output.width == Width::normals) {
    write.template operator()<false, true>();
  } else {
    write.template operator()<false, false>();
  }
  const Word spill = range.spill + before - quota;
#pragma unroll 1
  for (std::uint32_t k = here + lane; k < found; k += 32) {
    pair(k, i, j);
    if (spill + k < task.stable.spill_capacity) task.stable.spill[spill + k] = static_cast<Word>(i) << 32 | j;
  }
}

}  // namespace padder::detect::cuda
