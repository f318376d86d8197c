// A counting sort over bins for small scenes, in one launch: all blocks are resident and wait for each other
// between the steps, which costs less than the start of a kernel. Spheres stay in registers; counts live in
// L2.
#include <cooperative_groups.h>

#include "detect/cuda/order.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 512, kItems = 2, kBlocksAProcessor = 2;
constexpr std::uint32_t kMostOfABin = 64;
using Word = unsigned long long;

struct CellTask {
  Source source;
  Ordered to;
  std::uint32_t* numbers = nullptr;  // by place, in any order within a bin: for a tidy order
  Word* sums = nullptr;              // of each block's part of the table
  Word* bounds = nullptr;
  Counters* counters = nullptr;
};

// Exclusive sums of v[0 .. n) by all blocks: each publishes the sum of its part and adds up those before it.
__device__ void scan_table(std::uint32_t* v, std::uint32_t n, Word* sums) {
  constexpr Word kKnown = Word(1) << 32;
  constexpr int kWarps = kThreads / 32;
  __shared__ std::uint32_t warp_sums[2][kWarps], shared_before;
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  // 16 bytes a thread and step.
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

template <SlotKind Kind, class Bins, bool Along, bool Tidy>
__global__ void __launch_bounds__(kThreads, kBlocksAProcessor)
    cell_order_kernel(const __grid_constant__ CellTask task, const __grid_constant__ Bins bins) {
  const auto grid = cooperative_groups::this_grid();
  const std::uint32_t thread = blockIdx.x * kThreads + threadIdx.x, threads = gridDim.x * kThreads,
                      count = task.source.count, entries = static_cast<std::uint32_t>(task.to.entries + 1);
  std::uint32_t* const table = task.to.table;
  for (std::uint32_t k = thread; 4 * k < entries; k += threads)
    reinterpret_cast<uint4*>(table)[k] = make_uint4(0, 0, 0, 0);
  if (threadIdx.x == 0) task.sums[blockIdx.x] = 0;
  if (Along && thread < kBounds) task.bounds[thread] = Bounds::nothing(thread);
  if (Along && thread == 0) *task.counters = {};
  float4 slot[kItems];
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    if (k < count) slot[u] = slot_of<Kind>(task.source, grid_of(bins), k);
  }
  grid.sync();

  std::uint32_t key[kItems], rank[kItems];
  Bounds bounds;
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    key[u] = ~0u;
    if (k < count) {
      const Sphere s = task.source.sphere(k);
      key[u] = key_of_sphere(s, bins, task.counters);
      if (Along) bounds.take(s, k);
    }
    rank[u] = ticket(table, k < count ? key[u] >> task.to.merge : ~0u);
  }
  if (Along) bounds.give(task.bounds);
  grid.sync();

  scan_table(table, entries, task.sums);
  grid.sync();

  if (Tidy) {
    // Within a bin by number: a sphere's rank is how many of its bin have a smaller one. Bins are small; a
    // crowded one is reported, and the caller sorts instead.
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = thread + u * threads;
      if (k < count) task.numbers[table[key[u] >> task.to.merge] + rank[u]] = k;
    }
    grid.sync();
  }
#pragma unroll
  for (int u = 0; u < kItems; u++) {
    const std::uint32_t k = thread + u * threads;
    if (k >= count) break;
    const std::uint32_t entry = key[u] >> task.to.merge, from = table[entry];
    std::uint32_t at = from + rank[u];
    if (Tidy) {
      const std::uint32_t end = table[entry + 1];
      at = from;
      if (end - from > kMostOfABin) {
        atomicOr(&task.counters->flags, kCrowded);
        continue;
      }
      for (std::uint32_t p = from; p < end; p++) at += task.numbers[p] < k;
    }
    static_cast<float4*>(task.to.slots)[at] = slot[u];
    if (task.to.codes) task.to.codes[at] = code_for<Kind>(bins, key[u], slot[u]);
    if (!kKeyless<Bins>) task.to.keys[at] = key[u];
    if (Kind != SlotKind::equal) task.to.ids[at] = k;
  }
}

}  // namespace

bool Orderer::by_cells(const Source& source, const Grid& grid, bool tidy, unsigned long long* bounds,
                       Counters* counters, Ordered& o, cudaStream_t stream) {
  int device = 0, processors = 0;
  cuda_check(cudaGetDevice(&device), "ask for the device");
  cuda_check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device), "ask the device");
  const auto most = static_cast<unsigned>(processors * kBlocksAProcessor);
  if (o.count > std::uint64_t(most) * kThreads * kItems) return false;
  if (!o.bins.on) o.keys = sorted_keys_.reserve(o.count);
  if (o.kind != SlotKind::equal) o.ids = sorted_ids_.reserve(o.count);
  CellTask task{source, o};
  if (tidy) task.numbers = keys_.reserve(o.count);
  task.sums = reinterpret_cast<Word*>(scratch_.reserve(most * sizeof(Word)));
  task.bounds = bounds, task.counters = counters;
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    auto* const kernel = bounds ? (tidy ? cell_order_kernel<kind(), Bins, true, true>
                                        : cell_order_kernel<kind(), Bins, true, false>)
                                : (tidy ? cell_order_kernel<kind(), Bins, false, true>
                                        : cell_order_kernel<kind(), Bins, false, false>);
    Bins b = bins;
    void* arguments[] = {&task, &b};
    cuda_check(cudaLaunchCooperativeKernel(reinterpret_cast<const void*>(kernel),
                                           std::min(blocks_for(o.count, kThreads), most), kThreads, arguments,
                                           0, stream),
               "put the spheres in order");
  });
  return true;
}

}  // namespace padder::detect::cuda
