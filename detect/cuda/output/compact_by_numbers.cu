// SPDX-License-Identifier: MIT
// Compaction in two kernels, for any number of producers: the first numbers the spilled contacts and the
// empty slots of all producers, the second moves contact by contact.
#include <cub/block/block_scan.cuh>

#include "detect/cuda/device/overlapped_launch.h"
#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/spilled_contact.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256, kEach = kGroupProducers / kThreads;  // kEach: producers of a thread

struct Producers {
  std::uint32_t first, end;
};
__device__ __forceinline__ Producers producers_of(const OutputTask& task, std::uint32_t group) {
  const bool tiles = group < task.stable.tile_groups;
  const std::uint32_t first =
      tiles ? group * kGroupProducers : task.tiles + (group - task.stable.tile_groups) * kGroupProducers;
  return {first, min(first + kGroupProducers, tiles ? task.tiles : task.tiles + task.units)};
}

// A block takes a group of producers. spill_start of a producer becomes what must be added to a spilled
// contact to get its number: to its place in the side list or, where the fused search wrote that, to its
// number among what its producer spilled.
template <bool Fused>
__global__ void __launch_bounds__(kThreads, 4) number_kernel(const __grid_constant__ OutputTask task) {
  using Scan = cub::BlockScan<Word, kThreads>;
  __shared__ typename Scan::TempStorage memory;
  __shared__ Word before[2];   // the group: contacts spilled, slots left empty
  wait_for_previous_kernel();  // the next kernel must not start before the search has ended
  allow_next_kernel();
  const StableOutput& stable = task.stable;
  const std::uint32_t group = blockIdx.x, flags = task.counters->flags;
  const Producers all_of = producers_of(task, group);
  if (threadIdx.x < 2) before[threadIdx.x] = 0;
  const std::uint32_t producer = all_of.first + threadIdx.x * kEach;
  Word mine[kEach], start[kEach], lies_at[kEach], all;
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    mine[u] = lies_at[u] = 0;
    if (producer + u >= all_of.end) continue;
    if (!Fused) lies_at[u] = stable.spill_start[producer + u];
    const auto net = static_cast<std::int32_t>(stable.net[producer + u]);
    // Contacts spilled in the lower half of the word, slots left empty in the upper half.
    mine[u] = net > 0 ? net : static_cast<Word>(-net) << 32;
  }
  // The first group adds up all groups for the counters, the others those before them.
  Word upto[2] = {}, net = 0, own = 0;  // net: contacts less quotas; own: the same of tiles alone
  for (std::uint32_t g = threadIdx.x; g < (group ? group : stable.all_groups); g += kThreads) {
    const Word empty = stable.group_sums[2 * g], spilled = stable.group_sums[2 * g + 1];
    if (group)
      upto[0] += spilled, upto[1] += empty;
    else
      net += spilled - empty, own += g < stable.tile_groups ? spilled - empty : 0;
  }
  if (flags) return;
  Scan(memory).ExclusiveSum(mine, start, all);
#pragma unroll
  for (int d = 16; d; d >>= 1) {
    upto[0] += __shfl_xor_sync(kFullWarp, upto[0], d), upto[1] += __shfl_xor_sync(kFullWarp, upto[1], d);
    net += __shfl_xor_sync(kFullWarp, net, d), own += __shfl_xor_sync(kFullWarp, own, d);
  }
  if ((threadIdx.x & 31) == 0) {
    if (upto[0]) atomicAdd(before, upto[0]);
    if (upto[1]) atomicAdd(before + 1, upto[1]);
  }
  if (group == 0 && (threadIdx.x & 31) == 0) {
    if (threadIdx.x == 0)
      net += slot_behind_quotas(task), own += task.tile_quotas.slot[task.tile_quotas.levels];
    if (net) atomicAdd(&task.counters->contacts, net);
    if (own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kEach; u++) {
    if (producer + u >= all_of.end) continue;
    stable.spill_start[producer + u] = before[0] + static_cast<std::uint32_t>(start[u]) - lies_at[u];
    const auto empty = static_cast<std::uint32_t>(mine[u] >> 32);
    const Word first = before[1] + (start[u] >> 32);
    stable.empty_upto[producer + u] = static_cast<std::uint32_t>(first) + empty;
    for (Word k = (first + kIndexStep - 1) / kIndexStep;
         k * kIndexStep < first + empty && k < stable.index_capacity; k++)
      stable.empty_index[k] = producer + u;
  }
  if (threadIdx.x == 0 && group + 1 == gridDim.x) *stable.empty_total = before[1] + (all >> 32);
}

// Empty slot number `number`, of `all`. What number_kernel wrote while this kernel ran must not be read as
// constant data (__ldg).
__device__ __forceinline__ Word empty_slot(const OutputTask& task, Word number, Word all) {
  const StableOutput& stable = task.stable;
  const Word k = number / kIndexStep;
  if (k >= stable.index_capacity) return ~Word(0);  // the side list was too short: the caller searches again
  const auto left = [&](std::uint32_t producer) {   // from the slot to the end of the producer's slots
    return static_cast<std::int32_t>(stable.empty_upto[producer] - static_cast<std::uint32_t>(number));
  };
  // The first producer with some left, of `producer` to `last`. Three are read at a time: memory is what this
  // waits for.
  std::uint32_t producer = stable.empty_index[k], last = task.tiles + task.units - 1;
  if ((k + 1) * kIndexStep < all && k + 1 < stable.index_capacity)
    last = min(last, stable.empty_index[k + 1]);
  producer = min(producer, last);
  while (producer < last) {
    const std::uint32_t step = (last - producer + 3) / 4, t1 = min(producer + step - 1, last - 1),
                        t2 = min(t1 + step, last - 1), t3 = min(t2 + step, last - 1);
    const std::int32_t l1 = left(t1), l2 = left(t2), l3 = left(t3);
    if (l1 > 0)
      last = t1;
    else if (l2 > 0)
      producer = t1 + 1, last = t2;
    else if (l3 > 0)
      producer = t2 + 1, last = t3;
    else
      producer = t3 + 1;
  }
  return end_of_quota(task, producer) - static_cast<std::uint32_t>(left(producer));
}

// Moves the spilled contacts. Starts beside number_kernel, since most of what it reads is there already.
// Leaves the sums of groups as they were before the search.
template <SlotKind Kind, bool Double, bool Fused>
__global__ void __launch_bounds__(kThreads, Fused ? tuning::kFusedMoveBlocks : tuning::kMoveBlocks)
    move_kernel(const __grid_constant__ OutputTask task) {
  const StableOutput& stable = task.stable;
  const std::uint32_t thread = blockIdx.x * kThreads + threadIdx.x, threads = gridDim.x * kThreads;
  // A thread loads its next contact before it moves the last one, and the first before it knows whether there
  // is one.
  using Entry = std::conditional_t<Fused, uint4, Word>;
  const auto* const spill = reinterpret_cast<const Entry*>(stable.spill);
  const Word room = Fused ? stable.spill_capacity / 2 : stable.spill_capacity;
  Entry entry{};
  if (thread < room) entry = __ldg(spill + thread);
  const std::uint32_t flags = task.counters->flags;
  const Word count = min(Fused ? task.counters->spilled / 2 : task.counters->spilled, room);
  if (flags) return;
  SpilledContact<Kind, Double> mine;
  std::uint32_t rank = 0;
  const auto take = [&] {
    if constexpr (Fused)
      mine = {task, entry.x, entry.y, entry.z}, rank = entry.w;
    else
      mine = {task, entry};
  };
  if (thread < count) take();
  wait_for_previous_kernel();
  allow_next_kernel();
  for (std::uint32_t k = thread; k < 2 * stable.all_groups; k += threads) stable.group_sums[k] = 0;
  for (std::uint32_t k = thread; k < stable.quota_groups; k += threads) stable.quota_sums[k] = 0;
  const Word empties = __ldcg(stable.empty_total), behind = slot_behind_quotas(task) - empties;
  for (Word from = thread; from < count;) {
    const Word next = from + threads;
    if (next < count) entry = __ldg(spill + next);
    const Word number = (Fused ? rank : from) + stable.spill_start[mine.producer];
    mine.write(task, number < empties ? empty_slot(task, number, empties) : behind + number);
    if (next < count) take();
    from = next;
  }
}

}  // namespace

void compact_by_numbers(const OutputTask& task, bool fused, int processors, cudaStream_t stream) {
  const auto blocks =
      static_cast<unsigned>((fused ? tuning::kFusedMoveBlocks : tuning::kMoveBlocks) * processors);
  with_record(task, fused, [&](auto kind, auto wide, auto of_fused) {
    launch_overlapped(number_kernel<of_fused()>, {task.stable.all_groups, kThreads}, stream, task);
    launch_overlapped(move_kernel<kind(), wide(), of_fused()>, {blocks, kThreads}, stream, task);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
