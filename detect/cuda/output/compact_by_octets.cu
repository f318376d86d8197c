// SPDX-License-Identifier: MIT
// Compaction in one kernel: each block adds up all producers for itself, eight by eight, and moves some of
// the contacts. So it waits for no other kernel and no other block, and finds in shared memory what it looks
// for. Shared memory limits how many producers there may be; beyond that compact_by_numbers.cu serves.
#include "detect/cuda/device/overlapped_launch.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/spilled_contact.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 1024, kChunks = kThreads / 32;  // a warp adds up a chunk of octets

// Contacts less quota of eight producers: above zero a producer spilled so many, below zero it left so many
// slots empty. What is read behind the last producer is not used.
__device__ __forceinline__ void load_octet(const OutputTask& task, std::uint32_t octet,
                                           std::int32_t (&net)[8]) {
  const auto* const p = reinterpret_cast<const int4*>(task.stable.net) + 2 * octet;
  const int4 a = __ldcg(p), b = __ldcg(p + 1);
  net[0] = a.x, net[1] = a.y, net[2] = a.z, net[3] = a.w, net[4] = b.x, net[5] = b.y, net[6] = b.z,
  net[7] = b.w;
}

// Prefix sums in shared memory, of contacts spilled (x) and slots left empty (y): of each octet those before
// it in its chunk, of each chunk those before it, at last all.
struct OctetSums {
  uint2* octet;
  uint2* chunk;
  std::uint32_t count, bits;  // 2^bits octets a chunk
};
__device__ __forceinline__ std::uint32_t chunk_bits(std::uint32_t octets) {
  std::uint32_t bits = 5;
  while (std::uint64_t(kChunks) << bits < octets) bits++;
  return bits;
}

// Empty slot number `number` of all.
__device__ __forceinline__ Word empty_slot(const OutputTask& task, const OctetSums& sums,
                                           std::uint32_t number) {
  std::uint32_t chunk = 0;
#pragma unroll
  for (std::uint32_t step = kChunks / 2; step; step /= 2)
    if (sums.chunk[chunk + step].y <= number) chunk += step;
  const std::uint32_t m = number - sums.chunk[chunk].y, first = chunk << sums.bits;
  std::uint32_t at = first;
#pragma unroll 1
  for (std::uint32_t step = 1u << (sums.bits - 1); step; step /= 2)
    if (at + step < sums.count && sums.octet[at + step].y <= m) at += step;
  std::int32_t net[8], left = static_cast<std::int32_t>(m - sums.octet[at].y);
  load_octet(task, at, net);
  std::uint32_t producer = 8 * at;
  std::int32_t end = 0;  // from the slot to the end of its producer's
  bool found = false;
#pragma unroll
  for (int u = 0; u < 8; u++) {
    left += min(net[u], 0);
    if (!found && left < 0) found = true, end = -left, producer += u;
  }
  return end_of_quota(task, min(producer, task.tiles + task.units - 1)) - end;
}

// Four octets of a lane at a time; the next are loaded while the last are added up.
struct OctetLoad {
  static constexpr std::uint32_t kEach = 4;
  ulonglong2 word[kEach / 2];
  __device__ __forceinline__ void load(const OutputTask& task, std::uint32_t k, std::uint32_t end) {
#pragma unroll
    for (std::uint32_t u = 0; u < kEach / 2; u++) {  // zeros lie behind the last
      word[u] = {};
      if (k < end) word[u] = __ldcg(reinterpret_cast<const ulonglong2*>(task.stable.group_sums + k) + u);
    }
  }
  __device__ __forceinline__ Word get(std::uint32_t u) const { return u % 2 ? word[u / 2].y : word[u / 2].x; }
};
// By a warp: the prefix sums of its chunk, whose first load is `load`. `own`, if it is wanted: contacts less
// quotas of whole octets of tiles.
__device__ __forceinline__ void add_up_chunk(const OutputTask& task, const OctetSums& sums, OctetLoad& load,
                                             std::uint32_t k, std::uint32_t end, bool wants_own, Word& own) {
  constexpr std::uint32_t kEach = OctetLoad::kEach;
  const std::uint32_t lane = threadIdx.x & 31;
  uint2 sum = make_uint2(0, 0);
#pragma unroll 1
  for (std::uint32_t at = k; at - lane * kEach < end; at = k) {
    uint2 before[kEach], mine = make_uint2(0, 0), all;
#pragma unroll
    for (std::uint32_t u = 0; u < kEach; u++) {
      const Word w = load.get(u);
      const auto spilled = static_cast<std::uint32_t>(w), empty = static_cast<std::uint32_t>(w >> 32);
      before[u] = mine, mine.x += spilled, mine.y += empty;
      if (wants_own && at + u < task.tiles / 8) own += static_cast<Word>(spilled) - empty;
    }
    k += 32 * kEach;
    load.load(task, k, end);
    const uint2 first = make_uint2(sum.x + sum_before(mine.x, all.x), sum.y + sum_before(mine.y, all.y));
#pragma unroll
    for (std::uint32_t u = 0; u < kEach; u++)
      if (at + u < end) sums.octet[at + u] = make_uint2(first.x + before[u].x, first.y + before[u].y);
    sum.x += all.x, sum.y += all.y;
  }
  if (lane == 0) sums.chunk[threadIdx.x >> 5] = sum;
}
__device__ __forceinline__ void count_own(const OutputTask& task, Word own) {
#pragma unroll
  for (int d = 16; d; d >>= 1) own += __shfl_xor_sync(kFullWarp, own, d);
  if (threadIdx.x == 0) {
    own += task.tile_quotas.slot[task.tile_quotas.levels];
    for (std::uint32_t tile = task.tiles & ~7u; tile < task.tiles; tile++)
      own += static_cast<std::int32_t>(__ldcg(task.stable.net + tile));
  }
  if ((threadIdx.x & 31) == 0 && own) atomicAdd(&task.counters->own, own);
}
// By one warp: the last block leaves the sums of groups as they were before the search.
__device__ __forceinline__ void clear_sums(const StableOutput& stable, std::uint32_t octets) {
  const std::uint32_t lane = threadIdx.x & 31;
  unsigned last = 0;
  if (lane == 0) last = atomicInc(stable.blocks_done, gridDim.x - 1) + 1 == gridDim.x;
  if (__shfl_sync(kFullWarp, last, 0)) {
    for (std::uint32_t g = lane; g < octets; g += 32) stable.group_sums[g] = 0;
    for (std::uint32_t g = lane; g < stable.quota_groups; g += 32) stable.quota_sums[g] = 0;
  }
}

// A spilled contact and which of its producer's spilled contacts it is; one is loaded before the other is
// moved.
template <SlotKind Kind, bool Double, bool Fused>
struct Loaded {
  using Entry = std::conditional_t<Fused, uint4, Word>;
  static constexpr int kWords = sizeof(Entry) / sizeof(Word);
  SpilledContact<Kind, Double> contact;
  std::int32_t net[8];  // of the producer's octet
  std::uint32_t rank;
  __device__ __forceinline__ void take(const OutputTask& task, const Entry& entry, Word at) {
    if constexpr (Fused)
      contact = {task, entry.x, entry.y, entry.z}, rank = entry.w;
    else
      contact = {task, entry},
      rank = static_cast<std::uint32_t>(at - __ldcg(task.stable.spill_start + contact.producer));
    load_octet(task, contact.producer / 8, net);
  }
  // Its number among all spilled contacts.
  __device__ __forceinline__ std::uint32_t number(const OctetSums& sums) const {
    const std::uint32_t octet = contact.producer / 8;
    std::uint32_t n = sums.chunk[octet >> sums.bits].x + sums.octet[octet].x + rank;
#pragma unroll
    for (std::uint32_t u = 0; u < 7; u++)
      if (u < contact.producer % 8) n += max(net[u], 0);
    return n;
  }
};

template <SlotKind Kind, bool Double, bool Fused>
__global__ void __launch_bounds__(kThreads, 1) octet_kernel(const __grid_constant__ OutputTask task) {
  using Spilled = Loaded<Kind, Double, Fused>;
  extern __shared__ uint2 of_octets[];
  __shared__ uint2 of_chunks[kChunks + 1];
  wait_for_previous_kernel();
  allow_next_kernel();
  const StableOutput& stable = task.stable;
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5,
                      thread = blockIdx.x * kThreads + threadIdx.x, threads = gridDim.x * kThreads,
                      count = octets_of(task), bits = chunk_bits(count);
  const OctetSums sums{of_octets, of_chunks, count, bits};
  // The thread's first contact, and what it needs, are loaded before it is known whether there is one.
  const auto* const spill = reinterpret_cast<const typename Spilled::Entry*>(stable.spill);
  const Word room = stable.spill_capacity / Spilled::kWords;
  typename Spilled::Entry entry{};
  if (thread < room) entry = __ldcg(spill + thread);
  const std::uint32_t end = min((warp + 1) << bits, count), k = (warp << bits) + lane * OctetLoad::kEach;
  OctetLoad load;
  load.load(task, k, end);
  const std::uint32_t flags = task.counters->flags;
  const Word spilled = task.counters->spilled / Spilled::kWords, hits = min(spilled, room),
             quotas = slot_behind_quotas(task);
  const bool totals = blockIdx.x + 1 == gridDim.x;  // sets the counters: this block has the fewest contacts
  if (flags) return;
  Spilled mine;
  if (thread < hits) mine.take(task, entry, thread);
  if (thread + threads < hits) entry = __ldcg(spill + thread + threads);

  Word own = 0;
  add_up_chunk(task, sums, load, k, end, totals, own);
  if (totals) count_own(task, own);
  __syncthreads();
  if (warp == 0) {
    const uint2 c = of_chunks[lane];
    uint2 all;
    const std::uint32_t spilled_before = sum_before(c.x, all.x), empty_before = sum_before(c.y, all.y);
    of_chunks[lane] = make_uint2(spilled_before, empty_before);
    if (lane == 0) of_chunks[kChunks] = all;
  }
  __syncthreads();
  if (warp == kChunks - 1) clear_sums(stable, count);
  const std::uint32_t empties = of_chunks[kChunks].y;
  if (totals && threadIdx.x == 0) task.counters->contacts = quotas + spilled - empties;
  const Word behind = quotas - empties;
#pragma unroll 1
  for (Word from = thread; from < hits;) {
    const std::uint32_t number = mine.number(sums);
    const auto numbered = mine.contact;
    // The next is loaded before this one is moved.
    from += threads;
    if (from < hits) mine.take(task, entry, from);
    if (from + threads < hits) entry = __ldcg(spill + from + threads);
    numbered.write(task, number < empties ? empty_slot(task, sums, number) : behind + number);
  }
}

}  // namespace

bool fits_octets(const OutputTask& task, bool fused) {
  constexpr std::uint64_t kOwnBytes = 512;  // of arrays of a fixed size
  return octets_of(task) <= (fused ? tuning::kMostFusedOctets : tuning::kMostOctets) &&
         octets_of(task) * sizeof(uint2) + kOwnBytes <= shared_memory_of_block();
}

void compact_by_octets(const OutputTask& task, bool fused, int processors, cudaStream_t stream) {
  const auto bytes = static_cast<unsigned>(octets_of(task) * sizeof(uint2)),
             blocks = static_cast<unsigned>(processors);
  with_record(task, fused, [&](auto kind, auto wide, auto of_fused) {
    auto* const kernel = octet_kernel<kind(), wide(), of_fused()>;
    cuda_check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
               "take shared memory");
    if (of_fused())
      launch_overlapped(kernel, {blocks, kThreads, bytes}, stream, task);
    else
      kernel<<<blocks, kThreads, bytes, stream>>>(task);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
