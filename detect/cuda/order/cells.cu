// SPDX-License-Identifier: MIT
// The order by a counting sort over bins, for small scenes, in one launch: all blocks are resident and wait
// for each other between the steps, which costs less than the start of a kernel. Spheres stay in registers,
// counts in the L2 cache.
#include <cooperative_groups.h>

#include "detect/cuda/device/device.h"
#include "detect/cuda/order/order_kernels.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 512, kItems = 2, kBlocksAProcessor = 2;
constexpr std::uint32_t kMostOfABin = 64;
using Word = unsigned long long;

// For a stable order: the numbers of the spheres of each table entry. The first kOfEntry spheres that come to
// an entry leave their numbers in places of its own, before it is known where the entry begins. The others go
// to a list. If that is full, all numbers are written once more, by place, for which all blocks must wait
// once more.
constexpr std::uint32_t kOfEntry = tuning::kNumbersOfEntry, kMostBeyond = 128;
struct Numbers {
  std::uint32_t* of_entry = nullptr;  // null: no memory for them
  Word* beyond = nullptr;             // entry << 32 | number
  std::uint32_t* beyond_count = nullptr;
  std::uint32_t* by_place = nullptr;  // in any order within an entry

  __device__ __forceinline__ void leave(std::uint32_t entry, std::uint32_t rank, std::uint32_t k) const {
    if (rank < kOfEntry) {
      of_entry[entry * kOfEntry + rank] = k;
    } else {
      const std::uint32_t at = atomicAdd(beyond_count, 1u);
      if (at < kMostBeyond) beyond[at] = static_cast<Word>(entry) << 32 | k;
    }
  }
  // What stands in the places of an entry once all spheres have come. smaller(): how many of the entry's n
  // numbers are smaller than k.
  struct First {
    uint4 a, b;
  };
  __device__ __forceinline__ First first(std::uint32_t entry) const {
    const auto* const four = reinterpret_cast<const uint4*>(of_entry + entry * kOfEntry);
    return {four[0], four[1]};
  }
  __device__ __forceinline__ std::uint32_t smaller(const First& f, std::uint32_t entry, std::uint32_t n,
                                                   std::uint32_t k, std::uint32_t all_beyond) const {
    const uint4 &a = f.a, &b = f.b;
    std::uint32_t s = (n > 0 && a.x < k) + (n > 1 && a.y < k) + (n > 2 && a.z < k) + (n > 3 && a.w < k) +
                      (n > 4 && b.x < k) + (n > 5 && b.y < k) + (n > 6 && b.z < k) + (n > 7 && b.w < k);
    for (std::uint32_t q = 0; n > kOfEntry && q < all_beyond; q++)
      s += beyond[q] >> 32 == entry && static_cast<std::uint32_t>(beyond[q]) < k;
    return s;
  }
};

struct CellTask {
  DeviceSpheres source;
  Ordered to;
  Numbers numbers;
  Word* sums = nullptr;  // of each block's part of the table
  Gather gather;
  Counters* counters = nullptr;
};

// Turns v[0 .. n) into its exclusive sums, by all blocks together. Each publishes the sum of its part, calls
// meanwhile(), and adds up the sums of the parts before its own. All blocks must be resident.
template <class Meanwhile>
__device__ __forceinline__ void scan_table(std::uint32_t* v, std::uint32_t n, Word* sums,
                                           Meanwhile meanwhile) {
  constexpr Word kKnown = Word(1) << 32;
  constexpr int kWarps = kThreads / 32;
  __shared__ std::uint32_t warp_sums[2][kWarps], shared_before;
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  // Each thread takes 16 bytes a step.
  const std::uint32_t quads = (n + 3) / 4, part = (quads + gridDim.x - 1) / gridDim.x,
                      from = min(blockIdx.x * part, quads), to = min(from + part, quads);
  auto* const quad = reinterpret_cast<uint4*>(v);
  std::uint32_t sum = 0;
  for (std::uint32_t k = from + threadIdx.x; k < to; k += kThreads) {
    const uint4 q = quad[k];
    sum += q.x + q.y + q.z + q.w;
  }
  sum = __reduce_add_sync(~0u, sum);
  if (lane == 0) warp_sums[0][warp] = sum;
  if (threadIdx.x == 0) shared_before = 0;
  __syncthreads();
  if (warp == 0) {
    const std::uint32_t all = __reduce_add_sync(~0u, lane < kWarps ? warp_sums[0][lane] : 0);
    if (lane == 0) atomicExch(sums + blockIdx.x, kKnown | all);
  }
  meanwhile();
  std::uint32_t earlier = 0;
  for (std::uint32_t b = threadIdx.x; b < blockIdx.x; b += kThreads) {
    Word s;
    do s = *static_cast<volatile Word*>(sums + b);
    while (!(s & kKnown));
    earlier += static_cast<std::uint32_t>(s);
  }
  earlier = __reduce_add_sync(~0u, earlier);
  if (lane == 0 && earlier) atomicAdd(&shared_before, earlier);
  __syncthreads();
  std::uint32_t before = shared_before;
  int which = 1;
  for (std::uint32_t step = from; step < to; step += kThreads, which ^= 1) {
    const std::uint32_t k = step + threadIdx.x;
    const uint4 q = k < to ? quad[k] : make_uint4(0, 0, 0, 0);
    std::uint32_t total, mine = sum_before(q.x + q.y + q.z + q.w, total);
    if (lane == 0) warp_sums[which][warp] = total;
    __syncthreads();
    const std::uint32_t w = lane < kWarps ? warp_sums[which][lane] : 0;
    mine += before + __reduce_add_sync(~0u, lane < warp ? w : 0);
    if (k < to) quad[k] = make_uint4(mine, mine + q.x, mine + q.x + q.y, mine + q.x + q.y + q.z);
    before += __reduce_add_sync(~0u, w);
  }
}

// Gives the bounds of each octave to task.gather.octaves. By all threads of the block.
template <class Task>
__device__ __forceinline__ void give_octaves(const Task& task, std::uint32_t thread, std::uint32_t threads) {
  const std::uint32_t count = task.source.count;
  __shared__ OctaveBounds octaves;
  OctaveTaker taker;
  octaves.begin();
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    const Sphere s = k < count ? task.source.searched(k) : Sphere{};
    const auto f = make_float4(static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z),
                               static_cast<float>(s.r));
    if (u == 0) taker.begin(task.gather.top, f, k < count);
    if (k < count) taker.take(octaves, task.gather.top, f);
  }
  taker.give(octaves);
  __syncthreads();
  octaves.give(task.gather.octaves);
}

// The spheres of one thread: those of number thread + u * threads. Of each its slot, its key and its rank
// among the spheres of its table entry.
struct OwnSpheres {
  std::uint32_t thread, threads, count;
  float4 slot[kItems];
  std::uint32_t key[kItems], rank[kItems];
};

// Writes the spheres to their places. `beyond`: numbers in the list beyond the entries' own places; `listed`:
// all numbers stand by place.
template <SlotKind Kind, class Bins, bool Stable>
__device__ __forceinline__ void write_spheres(const CellTask& task, const Bins& bins, const OwnSpheres& own,
                                              const Numbers::First (&first)[kItems], std::uint32_t beyond,
                                              bool listed) {
  const std::uint32_t* const table = task.to.table;
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = own.thread + u * own.threads;
    if (k >= own.count) break;
    const std::uint32_t entry = own.key[u] >> task.to.merge, from = table[entry];
    std::uint32_t at = from + own.rank[u];
    if (Stable) {
      // Within a bin by number: a sphere's rank is how many of its bin have a smaller one. Bins are small; a
      // crowded one is reported, and the caller sorts instead.
      const std::uint32_t end = table[entry + 1];
      at = from;
      if (end - from > kMostOfABin) {
        atomicOr(&task.counters->flags, kCrowded);
        continue;
      }
      if (listed)
        for (std::uint32_t p = from; p < end; p++) at += task.numbers.by_place[p] < k;
      else
        at += task.numbers.smaller(first[u], entry, end - from, k, beyond);
    }
    static_cast<float4*>(task.to.slots)[at] = own.slot[u];
    if (task.to.codes) task.to.codes[at] = code_for<Kind>(bins, own.key[u], own.slot[u]);
    if (!kKeyless<Bins>) task.to.keys[at] = own.key[u];
    if (Kind != SlotKind::equal) task.to.ids[at] = k;
  }
}

template <SlotKind Kind, class Bins, bool Along, bool Stable>
__global__ void __launch_bounds__(kThreads, kBlocksAProcessor)
    cell_order_kernel(const __grid_constant__ CellTask task, const __grid_constant__ Bins bins) {
  const auto grid = cooperative_groups::this_grid();
  const std::uint32_t thread = blockIdx.x * kThreads + threadIdx.x, threads = gridDim.x * kThreads,
                      count = task.source.count, entries = static_cast<std::uint32_t>(task.to.entries + 1);
  std::uint32_t* const table = task.to.table;
  for (std::uint32_t k = thread; 4 * k < entries; k += threads)
    reinterpret_cast<uint4*>(table)[k] = make_uint4(0, 0, 0, 0);
  if (threadIdx.x == 0) task.sums[blockIdx.x] = 0;
  if (Along) task.gather.begin(thread, threads);
  if (Along && thread == 0) *task.counters = {};
  if (Stable && thread == 0) *task.numbers.beyond_count = 0;
  OwnSpheres own;
  own.thread = thread, own.threads = threads, own.count = count;
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    if (k < count) own.slot[u] = slot_of<Kind>(task.source, grid_of(bins), k);
  }
  grid.sync();

  Bounds bounds;
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    own.key[u] = ~0u;
    if (k < count) {
      const Sphere s = task.source.searched(k);
      own.key[u] = key_of_sphere(s, bins, task.counters);
      if (Along) bounds.take(s, k);
    }
    own.rank[u] = ticket(table, k < count ? own.key[u] >> task.to.merge : ~0u);
  }
  if (Stable && task.numbers.of_entry) {
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = thread + u * threads;
      if (k < count) task.numbers.leave(own.key[u] >> task.to.merge, own.rank[u], k);
    }
  }
  if (Along) bounds.give(task.gather.bounds);
  if (Along && task.gather.octaves) give_octaves(task, thread, threads);
  grid.sync();

  std::uint32_t beyond = ~0u;
  Numbers::First first[kItems];
  scan_table(table, entries, task.sums, [&] {
    if (!Stable || !task.numbers.of_entry) return;
    beyond = *static_cast<volatile std::uint32_t*>(task.numbers.beyond_count);
#pragma unroll
    for (int u = 0; u < kItems; u++)
      if (thread + u * threads < count) first[u] = task.numbers.first(own.key[u] >> task.to.merge);
  });
  grid.sync();

  const bool listed = Stable && beyond > kMostBeyond;
  if (listed) {
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = thread + u * threads;
      if (k < count) task.numbers.by_place[table[own.key[u] >> task.to.merge] + own.rank[u]] = k;
    }
    grid.sync();
  }
  write_spheres<Kind, Bins, Stable>(task, bins, own, first, beyond, listed);
}

// Calls f(kernel, bins) with the kernel for this kind of slots and bins.
template <class F>
void with_kernel(const Ordered& o, const Grid& grid, bool along, bool stable, F f) {
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    f(along ? (stable ? cell_order_kernel<kind(), Bins, true, true>
                      : cell_order_kernel<kind(), Bins, true, false>)
            : (stable ? cell_order_kernel<kind(), Bins, false, true>
                      : cell_order_kernel<kind(), Bins, false, false>),
      bins);
  });
}

}  // namespace

bool Orderer::by_cells(const OrderRequest& r, Ordered& o) {
  const bool stable = r.stable;
  const Lent& lent = r.lent;
  unsigned most = 0;
  with_kernel(o, r.grid, r.gather.bounds, stable, [&](auto* kernel, const auto&) {
    most =
        std::min<unsigned>(resident_blocks(reinterpret_cast<const void*>(kernel), kThreads, 0, r.processors),
                           static_cast<unsigned>(r.processors) * kBlocksAProcessor);
  });
  if (o.count > std::uint64_t(most) * kThreads * kItems) return false;
  if (!o.bins.on && !o.float_levels) o.keys = sorted_keys_.reserve(o.count);
  if (o.kind != SlotKind::equal) o.ids = sorted_ids_.reserve(o.count);
  CellTask task{r.source, o};
  task.sums = reinterpret_cast<Word*>(scratch_.reserve((most + kMostBeyond + 1) * sizeof(Word)));
  Numbers& numbers = task.numbers;
  numbers.beyond = task.sums + most;
  numbers.beyond_count = reinterpret_cast<std::uint32_t*>(numbers.beyond + kMostBeyond);
  if (stable) numbers.by_place = keys_.reserve(o.count);
  // Work space lies in the list of contacts, which is written afterwards. In a first call there is no list
  // yet, and nobody knows whether it will be long enough: then all numbers are written by place.
  const std::uint64_t words = o.entries * kOfEntry;
  if (stable && lent.slots * 4 >= words)
    numbers.of_entry = reinterpret_cast<std::uint32_t*>(lent.slot);
  else if (stable && lent.words > 0)
    numbers.of_entry = lent.words >= words ? lent.word : ids_.reserve(words);
  if (numbers.of_entry) clear_for_initcheck(numbers.of_entry, words, r.stream);
  task.gather = r.gather, task.counters = r.counters;
  with_kernel(o, r.grid, r.gather.bounds, stable, [&](auto* kernel, auto bins) {
    void* arguments[] = {&task, &bins};
    cuda_check(cudaLaunchCooperativeKernel(reinterpret_cast<const void*>(kernel),
                                           std::min(blocks_for(o.count, kThreads), most), kThreads, arguments,
                                           0, r.stream),
               "put the spheres in order");
  });
  return true;
}

}  // namespace padder::detect::cuda
