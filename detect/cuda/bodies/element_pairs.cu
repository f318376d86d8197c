// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/element_pairs.h"

#include <algorithm>

#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/warp.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr std::uint32_t kAll = ~0u;

__device__ __forceinline__ Filter filter_of(const BodyView& v, std::uint32_t element) {
  return {v.family[element], v.mask[element], v.owner[element]};
}

// A warp for each element, which meets the half of the others that follows it in a circle: so each two meet
// once, and all warps have the same work.
template <bool Write>
__global__ void __launch_bounds__(kThreads) all_pairs_kernel(const __grid_constant__ ElementPairTask task) {
  const BodyView& v = task.view;
  const std::uint32_t lane = threadIdx.x & 31, e = blockIdx.x * kWarps + (threadIdx.x >> 5), n = v.moving;
  if (e >= n) return;
  if (Write && task.counts[e] == 0 && e + 1 < n) return;
  const Sphere ball = v.balls[e];
  const Filter mine = filter_of(v, e);
  // With an even number, the one opposite is met by the first half alone.
  const std::uint32_t others = n % 2 || e >= n / 2 ? (n - 1) / 2 : n / 2;
  const unsigned long long base = Write ? task.offsets[e] : 0;
  std::uint32_t found = 0;
  for (std::uint32_t from = 0; from < others; from += 32) {
    const std::uint32_t step = from + lane, j = e + 1 + step - (e + 1 + step < n ? 0 : n);
    const bool hit = step < others && touching(ball, v.balls[j]) && admitted(mine, filter_of(v, j));
    const std::uint32_t hits = __ballot_sync(kAll, hit);
    const unsigned long long at = base + found + __popc(hits & ((1u << lane) - 1));
    if (Write && hit && at < task.pair_room) task.pairs[at] = {e, j};
    found += __popc(hits);
  }
  if (lane == 0 && !Write) task.counts[e] = found;
  if (lane == 0 && Write && e + 1 == n) task.counters->broad.contacts = base + found;
}

// The first lane whose `upto` is more than k, if there is one.
__device__ __forceinline__ std::uint32_t lane_beyond(std::uint32_t upto, std::uint32_t k) {
  std::uint32_t lane = 0;
#pragma unroll
  for (std::uint32_t d = 16; d; d >>= 1)
    if (__shfl_sync(kAll, upto, lane + d - 1) <= k) lane += d;
  return lane;
}

// A warp for each moving element. Each lane looks up one row of bins; the balls of 32 rows are then dealt out
// to all lanes, in the order of the rows.
template <bool Write>
__global__ void __launch_bounds__(kThreads)
    static_pairs_kernel(const __grid_constant__ ElementPairTask task, const __grid_constant__ Grid grid) {
  const BodyView& v = task.view;
  const StaticView& t = task.table;
  const std::uint32_t lane = threadIdx.x & 31;
  for (std::uint32_t e = blockIdx.x * kWarps + (threadIdx.x >> 5); e < v.moving; e += gridDim.x * kWarps) {
    const Sphere ball = v.balls[e];
    const Filter mine = filter_of(v, e);
    unsigned long long found = 0, base = 0;
    if (Write) {
      if (task.counts[e] == 0 && e + 1 < v.moving) continue;
      base = task.counters->broad.contacts + task.offsets[e];
    }
    for (int level = 0; level < grid.levels; level++) {
      const Level& l = grid.level[level];
      const std::uint32_t begin = t.starts[l.offset], population = t.starts[l.offset + l.buckets] - begin;
      BinBox box;
      if (population == 0 || !bins_near(l, t.bounds[level], ball, population, box)) continue;
      const std::uint64_t nx = l.hashed ? box.high[0] - box.low[0] + 1 : 1, ny = box.high[1] - box.low[1] + 1,
                          rows = box.whole ? 1 : nx * ny * (box.high[2] - box.low[2] + 1);
      for (std::uint64_t from = 0; from < rows; from += 32) {
        const std::uint64_t row = from + lane;
        std::uint32_t first = begin, count = box.whole && lane == 0 ? population : 0;
        std::int64_t x = 0, y = 0, z = 0;
        if (!box.whole && row < rows) {
          x = box.low[0] + row % nx, y = box.low[1] + row / nx % ny, z = box.low[2] + row / nx / ny;
          const std::uint32_t key = row_of(l, y, z);
          first = t.starts[key_in_row(l, key, x)];
          count = t.starts[key_in_row(l, key, l.hashed ? x : box.high[0]) + 1] - first;
        }
        std::uint32_t all;
        const std::uint32_t before = sum_before(count, all), upto = before + count;
        for (std::uint32_t k0 = 0; k0 < all; k0 += 32) {
          const std::uint32_t k = k0 + lane, of = lane_beyond(upto, k),
                              at = __shfl_sync(kAll, first - before, of) + k;
          const auto of_row = [&](std::int64_t c) { return __shfl_sync(kAll, c, of); };
          bool in_its_row = k < all;
          if (l.hashed && !box.whole) {
            const std::int64_t x0 = of_row(x), y0 = of_row(y), z0 = of_row(z);
            in_its_row = in_its_row && in_row(l, t.balls[at], x0, x0, y0, z0);
          }
          const bool hit =
              in_its_row && touching(ball, t.balls[at]) && admitted(mine, filter_of(v, t.elements[at]));
          const std::uint32_t hits = __ballot_sync(kAll, hit);
          const unsigned long long to = base + found + __popc(hits & ((1u << lane) - 1));
          if (Write && hit && to < task.pair_room) task.pairs[to] = {e, t.elements[at]};
          found += __popc(hits);
        }
      }
    }
    if (lane == 0 && !Write) task.counts[e] = static_cast<std::uint32_t>(found);
    if (lane == 0 && Write && e + 1 == v.moving) task.counters->static_pairs = task.offsets[e] + found;
  }
}

}  // namespace

void count_all_pairs(const ElementPairTask& task, cudaStream_t stream) {
  all_pairs_kernel<false><<<(task.view.moving + kWarps - 1) / kWarps, kThreads, 0, stream>>>(task);
  cuda_launched("search the bodies");
}
void write_all_pairs(const ElementPairTask& task, cudaStream_t stream) {
  all_pairs_kernel<true><<<(task.view.moving + kWarps - 1) / kWarps, kThreads, 0, stream>>>(task);
  cuda_launched("search the bodies");
}
void count_static_pairs(const ElementPairTask& task, const Grid& grid, int processors, cudaStream_t stream) {
  static_pairs_kernel<false>
      <<<std::min(blocks_for(task.view.moving, kWarps), 16u * processors), kThreads, 0, stream>>>(task, grid);
  cuda_launched("search among what is static");
}
void write_static_pairs(const ElementPairTask& task, const Grid& grid, int processors, cudaStream_t stream) {
  static_pairs_kernel<true>
      <<<std::min(blocks_for(task.view.moving, kWarps), 16u * processors), kThreads, 0, stream>>>(task, grid);
  cuda_launched("search among what is static");
}

}  // namespace padder::detect::cuda
