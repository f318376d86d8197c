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

// A warp for each moving element; a lane takes one row of bins at a time. With `Write` each lane goes over
// its row twice, once to count, so that the pairs come in the order of rows.
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
                          rows = box.whole ? population : nx * ny * (box.high[2] - box.low[2] + 1);
      for (std::uint64_t from = 0; from < rows; from += 32) {
        const std::uint64_t row = from + lane;
        std::uint32_t first = 0, end = 0;
        std::int64_t x = 0, y = 0, z = 0;
        if (row < rows && box.whole) {
          first = begin + static_cast<std::uint32_t>(row), end = first + 1;
        } else if (row < rows) {
          x = box.low[0] + row % nx, y = box.low[1] + row / nx % ny, z = box.low[2] + row / nx / ny;
          const std::uint32_t key = row_of(l, y, z);
          first = t.starts[key_in_row(l, key, x)];
          end = t.starts[key_in_row(l, key, l.hashed ? x : box.high[0]) + 1];
        }
        const auto touches = [&](std::uint32_t k) {
          const Sphere s = t.balls[k];
          if (!touching(ball, s) || (l.hashed && !box.whole && !in_row(l, s, x, x, y, z))) return false;
          return admitted(mine, filter_of(v, t.elements[k]));
        };
        std::uint32_t count = 0;
        for (std::uint32_t k = first; k < end; k++) count += touches(k);
        if (Write && __any_sync(kAll, count != 0)) {
          std::uint32_t upto = count;
#pragma unroll
          for (int d = 1; d < 32; d <<= 1) {
            const std::uint32_t u = __shfl_up_sync(kAll, upto, d);
            if (static_cast<int>(lane) >= d) upto += u;
          }
          unsigned long long at = base + found + upto - count;
          for (std::uint32_t k = first; count && k < end; k++)
            if (touches(k)) {
              if (at < task.pair_room) task.pairs[at] = {e, t.elements[k]};
              at++;
            }
        }
        found += __reduce_add_sync(kAll, count);
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
