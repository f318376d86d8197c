// SPDX-License-Identifier: MIT
// Compaction in one kernel, for few producers: each block adds up the counts of all of them in shared memory
// and moves some of the contacts. Units have no quota here.
#include "detect/cuda/device.h"
#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/spilled_contact.h"
#include "detect/cuda/tuning.h"
#include "detect/cuda/warp.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 1024;
// Each thread adds up so many times four producers: an odd number, so that threads do not meet at a bank.
__host__ __device__ inline std::uint32_t quads_of_thread(std::uint32_t producers) {
  return ((producers + 4 * kThreads - 1) / (4 * kThreads)) | 1;
}

template <SlotKind Kind, bool Double>
__global__ void __launch_bounds__(kThreads) count_kernel(const __grid_constant__ OutputTask task) {
  static_assert(kThreads == 32 * 32);
  extern __shared__ uint4 shared[];
  __shared__ uint2 of_warps[32];
  const StableOutput& stable = task.stable;
  const std::uint32_t tiles = task.tiles + task.units, each = quads_of_thread(tiles), share = task.quota.tile,
                      lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  // Of each tile: the number of the first hit that it spilled; places left spare up to its end.
  uint4 *const quads = shared + threadIdx.x * each, *const spare_quads = quads + kThreads * each;
  const auto* const numbers = reinterpret_cast<const std::uint32_t*>(shared);
  const std::uint32_t* const spares = numbers + 4 * kThreads * each;
  const bool totals = blockIdx.x + 1 == gridDim.x;  // sets the counters: it has the fewest hits
  // The thread's first hit is asked for before it is known whether there is one.
  const Word step = gridDim.x * Word(kThreads);
  Word from = blockIdx.x * Word(kThreads) + threadIdx.x, hit = 0;
  if (from < stable.spill_capacity) hit = __ldg(stable.spill + from);
  const std::uint32_t flags = task.counters->flags;
  const Word spilled = task.counters->spilled, count = min(spilled, static_cast<Word>(stable.spill_capacity));
  // Places of tiles `t` to t + 3, of which those behind the last count nothing and have none.
  const auto places_of = [&](std::uint32_t t) {
    const auto of = [&](std::uint32_t tile) { return tile < task.tiles ? share : 0; };
    if (t + 3 < task.tiles) return make_uint4(share, share, share, share);
    return make_uint4(of(t), of(t + 1), of(t + 2), of(t + 3));
  };
  const std::uint32_t first = threadIdx.x * each * 4;
  std::uint32_t over = 0, spare = 0;  // hits that spilled, places left spare
  const auto add = [&](std::uint32_t found, std::uint32_t places) {
    const std::uint32_t more = max(found, places);
    over += more - places, spare += more - found;
  };
  Word own = 0;
#pragma unroll 3
  for (std::uint32_t q = 0; q < each; q++) {
    const std::uint32_t t = first + 4 * q;
    uint4 c = make_uint4(0, 0, 0, 0);
    if (t < tiles) c = __ldg(reinterpret_cast<const uint4*>(stable.counts + t));
    if (t + 3 >= tiles) {
      c.y = t + 1 < tiles ? c.y : 0, c.z = t + 2 < tiles ? c.z : 0, c.w = 0;
    }
    quads[q] = c;
    const uint4 p = places_of(t);
    add(c.x, p.x), add(c.y, p.y), add(c.z, p.z), add(c.w, p.w);
    if (totals)
      own += (t < task.tiles ? c.x : 0) + static_cast<Word>(t + 1 < task.tiles ? c.y : 0) +
             (t + 2 < task.tiles ? c.z : 0) + static_cast<Word>(t + 3 < task.tiles ? c.w : 0);
  }
  if (flags || (blockIdx.x * Word(kThreads) >= count && !totals)) return;
  SpilledContact<Kind, Double> mine;
  std::uint32_t lies_at = 0;
  const auto ask = [&] {
    mine = {task, hit}, lies_at = static_cast<std::uint32_t>(__ldg(stable.spill_start + mine.producer));
  };
  // The next is asked for before this one is moved.
  const auto ask_next = [&] {
    if (from + step < count) hit = __ldg(stable.spill + from + step);
  };
  if (from < count) ask(), ask_next();
  std::uint32_t over_all, spare_all;
  over = sum_before(over, over_all), spare = sum_before(spare, spare_all);
  if (lane == 0) of_warps[warp] = make_uint2(over_all, spare_all);
  if (totals) {
#pragma unroll
    for (int d = 16; d; d >>= 1) own += __shfl_xor_sync(kFullWarp, own, d);
    if (lane == 0 && own) atomicAdd(&task.counters->own, own);
  }
  __syncthreads();
  const uint2 of_warp = of_warps[lane];
  over += __reduce_add_sync(kFullWarp, lane < warp ? of_warp.x : 0);
  spare += __reduce_add_sync(kFullWarp, lane < warp ? of_warp.y : 0);
  const std::uint32_t all_spares = __reduce_add_sync(kFullWarp, of_warp.y);
  const Word shares = static_cast<Word>(task.tiles) * share;
  if (totals && threadIdx.x == 0) task.counters->contacts = shares - all_spares + spilled;
#pragma unroll 1
  for (std::uint32_t q = 0; q < each; q++) {
    const uint4 c = quads[q], p = places_of(first + 4 * q);
    uint4 n, s;
    n.x = over, add(c.x, p.x), s.x = spare, n.y = over, add(c.y, p.y), s.y = spare;
    n.z = over, add(c.z, p.z), s.z = spare, n.w = over, add(c.w, p.w), s.w = spare;
    quads[q] = n, spare_quads[q] = s;
  }
  __syncthreads();
  while (from < count) {
    const std::uint32_t number = numbers[mine.producer] + (static_cast<std::uint32_t>(from) - lies_at);
    Word to = shares + number - all_spares;
    if (number < all_spares) {
      std::uint32_t tile = 0;
      for (std::uint32_t k = 1u << (31 - __clz(task.tiles)); k; k >>= 1)
        if (tile + k <= task.tiles && spares[tile + k - 1] <= number) tile += k;
      tile = min(tile, task.tiles - 1);
      to = static_cast<Word>(tile + 1) * share - (spares[tile] - number);
    }
    mine.write(task, to);
    from += step;
    if (from < count) ask(), ask_next();
  }
}

unsigned shared_bytes_of(std::uint32_t producers) { return 2 * 16 * kThreads * quads_of_thread(producers); }

}  // namespace

bool fits_counts(const OutputTask& task) {
  const std::uint64_t producers = std::uint64_t(task.tiles) + task.units;
  constexpr unsigned kOwnBytes = 512;  // of arrays of a fixed size
  return producers <= tuning::kMostCounted &&
         shared_bytes_of(static_cast<std::uint32_t>(producers)) + kOwnBytes <= shared_memory_of_block();
}

void compact_by_counts(const OutputTask& task, int processors, cudaStream_t stream) {
  const unsigned bytes = shared_bytes_of(task.tiles + task.units);
  with_record(task, [&](auto kind, auto wide) {
    const auto kernel = count_kernel<kind(), wide()>;
    cuda_check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
               "take shared memory");
    kernel<<<processors, kThreads, bytes, stream>>>(task);
  });
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
