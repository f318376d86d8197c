// SPDX-License-Identifier: MIT
// The fused search, first half: a warp's pairs on their way from candidate to contact. All that a warp does
// feeds one row of pairs in shared memory: candidates wait at its end until there are enough for full warps
// to test, contacts at its front until there are enough to write. Testing and writing stand in the code once,
// whatever the candidates come from: with three copies a quarter of the time went into waiting for
// instructions. Only .cu files include this.
#pragma once
#include "detect/cuda/device/overlapped_launch.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/output/output_slots.h"
#include "detect/cuda/search/exact_test.h"

namespace padder::detect::cuda {

// Of a warp: the row of pairs, and the queries of a unit, in bins of the searched level.
struct FusedMemory {
  static constexpr std::uint32_t kPairs = 256, kWrite = 64;  // kWrite: contacts that are enough to write
  uint2 pair[kPairs];
  float4 within[32];  // centre: x within its bin, y and z from the middle of the first row; search radius
                      // squared
  uint4 rows[32];  // x of its bin, table entry of its first row, that row's number in the unit, 2^32 / side
  uint2 side[32];  // rows along y; index of the sphere
  uint4 level;     // table entries of a row and of a plane; the last bin along x, 0; of a hashed level its
                   // offset, its ring less one
  int2 ends;       // the first and the last bin along x of a hashed level
  // Stable order: the first slot and the quota of the tile. Of a unit: the first slot of its group, and its
  // word.
  Word slot;
  std::uint32_t quota;
};

// The members must stay in registers: where a function is called out of line, all that lives across the call
// lies in local memory. Stable: the list has a stable order; then the row runs dry after each producer.
// Given: slots are doubles rounded to float; doubt and records go by the spheres as they were given. Owned:
// contacts whose midpoint lies outside of the region are left out; nothing but that and the distance counts.
template <bool Stable, bool Given, bool Owned>
struct FusedQueue {
  static constexpr SlotKind kKind = SlotKind::unequal;
  static constexpr std::uint32_t kAtOnce = 2, kStep = 32 * kAtOnce;
  const SearchTask& task;
  FusedMemory& memory;
  std::uint32_t lane, address;                 // address: of the row of pairs
  std::uint32_t hits = 0, from = 0, upto = 0;  // contacts; candidates are `from` to `upto` - 1
  // Stable: the producer and how many of its contacts are written.
  std::uint32_t producer = 0, written = 0;

  __device__ __forceinline__ FusedQueue(const SearchTask& t, FusedMemory& m)
      : task(t), memory(m), lane(held(threadIdx.x & 31)), address(held(shared_address(m.pair))) {}
  // By a shuffle: then the compiler does not compute it again at each use.
  static __device__ __forceinline__ std::uint32_t held(std::uint32_t v) {
    return __shfl_sync(kFullWarp, v, threadIdx.x);
  }
  __device__ __forceinline__ std::uint32_t below() const { return (1u << lane) - 1; }
  __device__ __forceinline__ const FloatSlot* slots() const { return slots_of<kKind>(task); }

  // Tests the next candidates: kStep of them, or all there are.
  __device__ __forceinline__ void test_step() {
    uint2 pair[kAtOnce];
    FloatSlot a[kAtOnce], b[kAtOnce];
    bool hit[kAtOnce], sure[kAtOnce], doubt = false;
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint32_t at = from + 32 * u + lane;
      hit[u] = at < upto;
      pair[u] = load_shared_pair(address + 8 * min(at, upto - 1));
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      a[u] = load_slot(slots() + pair[u].x), b[u] = load_slot(slots() + pair[u].y);
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      hit[u] = float_test<kKind>(task, a[u], b[u], Given && task.spheres.rounded, sure[u]) && hit[u];
      doubt = doubt || (hit[u] && !(sure[u] && (!Owned || owns_contacts_of<kKind>(task, a[u]))));
    }
    if (__any_sync(kFullWarp, doubt)) {
      std::uint32_t doubtful = 0;
#pragma unroll
      for (int u = 0; u < kAtOnce; u++) {
        if (hit[u] && !sure[u]) hit[u] = exact_test(pair[u], a[u], b[u]), doubtful++;
        if (Owned && hit[u]) hit[u] = owns_contact<kKind>(task, pair[u].x, a[u], pair[u].y, b[u]);
      }
      count_doubtful(task, doubtful);
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint32_t has = __ballot_sync(kFullWarp, hit[u]);
      if (u == 0) __syncwarp();  // all have read what is written over
      if (hit[u]) store_shared(address + 8 * (hits + __popc(has & below())), pair[u].x, pair[u].y);
      hits += __popc(has);
    }
    from += kStep;
    __syncwarp();
  }

  // What float is not sure of, by the distance.
  __device__ __forceinline__ bool exact_test(const uint2& pair, const FloatSlot& a,
                                             const FloatSlot& b) const {
    if (!task.exact) return touching_in_float<kKind>(task, a, b);
    if constexpr (Given)
      return touching(given_sphere<kKind>(task, pair.x), given_sphere<kKind>(task, pair.y), task.margin);
    return touching({a.x, a.y, a.z, a.r}, {b.x, b.y, b.z, b.r}, task.margin);
  }

  // Emits the contacts. In stable order those beyond the producer's quota go to the side list, two words
  // each: the pair, the producer, and which of the producer's spilled contacts it is.
  __device__ __forceinline__ void write() {
    if constexpr (Stable) {
      // Loaded when the unit began, and not waited for before something is written.
      wait_for_copies();
      __syncwarp();
      const std::uint32_t word = memory.quota, quota = word & quota_mask(),
                          here = written < quota ? min(hits, quota - written) : 0;
      write_records(memory.slot + ((word & ~quota_mask()) >> kQuotaBits) + written, here);
      if (here < hits) {
        Word begin = 0;
        if (lane == 0) begin = atomicAdd(&task.counters->spilled, 2 * static_cast<Word>(hits - here));
        begin = __shfl_sync(kFullWarp, begin, 0);
#pragma unroll 1
        for (std::uint32_t k = here + lane; k < hits; k += 32) {
          const uint2 pair = load_shared_pair(address + 8 * k);
          const Word to = begin + 2 * (k - here);
          if (to + 1 < task.stable.spill_capacity)
            reinterpret_cast<uint4*>(task.stable.spill)[to / 2] =
                make_uint4(pair.x, pair.y, producer, written + k - quota);
        }
      }
      written += hits;
    } else {
      Word slot = 0;
      if (lane == 0) slot = atomicAdd(&task.counters->contacts, static_cast<Word>(hits));
      write_records(slot, hits);
    }
    hits = 0;
    __syncwarp();
  }
  // One body for all widths of a record: the instructions must fit their cache.
  __device__ __forceinline__ void write_records(Word slot, std::uint32_t count) {
    constexpr int kRecords = Given ? 1 : 2;
#pragma unroll 1
    for (std::uint32_t k = 0; k < count; k += 32 * kRecords) {
      RecordInput<Given> input[kRecords];
#pragma unroll
      for (int u = 0; u < kRecords; u++) {
        const uint2 pair = load_shared_pair(address + 8 * min(k + 32 * u + lane, count - 1));
        input[u] = load_record_input<kKind, Given>(task, pair.x, pair.y);
      }
      if (k == 0) {  // the slot arrives while the records' input is loaded
        if (!Stable) slot = __shfl_sync(kFullWarp, slot, 0);
        if (slot + count > task.output.capacity) break;  // counted; the caller searches again
      }
#pragma unroll
      for (int u = 0; u < kRecords; u++)
        if (k + 32 * u + lane < count) write_float_record<kKind>(task, input[u], slot + (k + 32 * u + lane));
    }
  }

  // Stable order. Of a unit's word the bits that are its quota; a tile's word is its quota alone.
  __device__ __forceinline__ std::uint32_t quota_mask() const {
    return producer < task.tiles ? ~0u : kMostQuota;
  }
  __device__ __forceinline__ void begin_tile(std::uint32_t number) {
    producer = number, written = 0;
    const TileSlots s = slots_of_tile(task, number);
    if (lane == 0) memory.slot = s.first, memory.quota = s.count;
  }
  __device__ __forceinline__ void begin_unit(std::uint32_t number) {
    producer = task.tiles + number, written = 0;
    wait_for_previous_kernel();  // which computes the quotas of units
    if (lane == 0) {
      copy_async<8>(&memory.slot, task.stable.quota_bases + number / kQuotaUnits);
      copy_async<4>(&memory.quota, task.stable.unit_quotas + number);
    }
  }
  // The producer is done: nothing of it waits any more.
  __device__ __forceinline__ void end_producer() {
    if (lane == 0) {
      wait_for_copies();
      note_net(task, producer, static_cast<std::int32_t>(written - (memory.quota & quota_mask())));
    }
  }

  // Tests and writes while there is enough for full warps; `all`: until nothing waits.
  __device__ __forceinline__ void drain(bool all) {
    const std::uint32_t tested = all ? 1 : kStep, enough = all ? 1 : FusedMemory::kWrite;
#pragma unroll 1
    while (from < upto && upto - from >= tested) test_step();
    if (all) from = upto = 0;
    if (hits >= enough) write();
  }
  // Candidates have been put at the end of the row, up to `end`.
  __device__ __forceinline__ void put(std::uint32_t end, bool all) {
    upto = end;
    __syncwarp();
    drain(all);
  }
  // Moves what waits together. Then there is room for kRoom candidates.
  static constexpr std::uint32_t kRoom = FusedMemory::kPairs - FusedMemory::kWrite - kStep;
  __device__ __forceinline__ void make_room() {
    const std::uint32_t left = upto - from;  // less than kStep
    uint2 pair[kAtOnce];
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      if (32 * u + lane < left) pair[u] = load_shared_pair(address + 8 * (from + 32 * u + lane));
    __syncwarp();
#pragma unroll
    for (int u = 0; u < kAtOnce; u++)
      if (32 * u + lane < left) store_shared(address + 8 * (hits + 32 * u + lane), pair[u].x, pair[u].y);
    from = hits, upto = hits + left;
  }
  __device__ __forceinline__ void finish() { drain(true); }

  // Puts consecutive candidates of each lane, for sphere i, at the end of the row, as many as there is room
  // for. `begin` moves to the first that is left. Returns the new end.
  __device__ __forceinline__ std::uint32_t put_runs(std::uint32_t i, std::uint32_t& begin,
                                                    std::uint32_t end) {
    const std::uint32_t count = min(end - begin, FusedMemory::kPairs);
    std::uint32_t total;
    const std::uint32_t start = sum_before(count, total);
    if (upto + total > FusedMemory::kPairs) make_room();
    const std::uint32_t room = FusedMemory::kPairs - upto, n = min(count, room - min(start, room));
    std::uint32_t to = address + 8 * (upto + start);
#pragma unroll 1
    for (std::uint32_t k = 0; __any_sync(kFullWarp, k < n); k += 4, to += 32)
#pragma unroll
      for (std::uint32_t u = 0; u < 4; u++)
        if (k + u < n) store_shared(to + 8 * u, i, begin + k + u);
    begin += n;
    return upto + min(total, room);
  }
};

}  // namespace padder::detect::cuda
