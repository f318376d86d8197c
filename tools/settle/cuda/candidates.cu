// SPDX-License-Identifier: MIT
#include "tools/settle/cuda/candidates.h"

#include <algorithm>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_segmented_sort.cuh>

namespace padder::settle::cuda {
namespace {

using detect::cuda::cuda_check;
using detect::cuda::cuda_launched;
using Word = unsigned long long;

constexpr int kThreads = 256;

__device__ bool moves(const View& v, std::uint32_t sphere) {
  return v.all_move || v.motions[mover_of(v, sphere)].inverse_mass != 0;
}
__device__ bool wanted(const View& v, const detect::Pair& p) {
  return moves(v, p.i) || (p.j < v.spheres && moves(v, p.j));
}

// Two passes over pairs and walls: the first counts the entries of each row, the second (with `partners`)
// puts each partner into its row, and takes it off the count.
struct Filling {
  std::uint32_t* counts;  // of each row
  const std::uint32_t* starts = nullptr;
  std::uint32_t* partners = nullptr;
  __device__ void add(std::uint32_t row, std::uint32_t partner) const {
    if (partners)
      partners[starts[row] + atomicSub(counts + row, 1u) - 1] = partner;
    else
      atomicAdd(counts + row, 1u);
  }
};

__global__ void __launch_bounds__(kThreads) fill_pairs_kernel(const __grid_constant__ View v, Filling filling,
                                                              const detect::Pair* pairs, Word count) {
  for (Word c = blockIdx.x * Word(kThreads) + threadIdx.x; c < count; c += Word(gridDim.x) * kThreads) {
    const detect::Pair p = pairs[c];
    if (!wanted(v, p)) continue;
    filling.add(p.i, p.j);
    if (p.j < v.spheres) filling.add(p.j, p.i);
  }
}

__global__ void __launch_bounds__(kThreads)
    fill_walls_kernel(const __grid_constant__ View v, Filling filling, double gap) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < v.spheres; k += gridDim.x * kThreads) {
    const detect::Sphere at = v.centers[k];
    for (std::uint32_t w = 0; w < v.walls; w++)
      if (contact_with(v.wall[w], center_of(at), at.r).depth >= -gap && moves(v, k))
        filling.add(k, v.spheres + w);
  }
}

// The first of the entries `low` to `high` whose partner is at least this one.
__device__ std::uint32_t lower_bound(const std::uint32_t* partners, std::uint32_t low, std::uint32_t high,
                                     std::uint32_t partner) {
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (partners[middle] < partner)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}
// The entry of `partner` in the row, or ~0u.
__device__ std::uint32_t find_in_row(const std::uint32_t* starts, const std::uint32_t* partners,
                                     std::uint32_t row, std::uint32_t partner) {
  const std::uint32_t end = starts[row + 1], at = lower_bound(partners, starts[row], end, partner);
  return at < end && partners[at] == partner ? at : ~0u;
}

// A thread for each row: how many candidates begin in it, and the row of each entry.
__global__ void __launch_bounds__(kThreads)
    rows_kernel(std::uint32_t rows, const std::uint32_t* starts, const std::uint32_t* partners,
                std::uint32_t* begun, std::uint32_t* entries) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row > rows) return;
  if (row == rows) {
    begun[row] = 0;
    return;
  }
  const std::uint32_t first = starts[row], end = starts[row + 1];
  begun[row] = end - lower_bound(partners, first, end, row);
  for (std::uint32_t q = first; q < end; q++) entries[q] = row;
}

// What is known of candidates: their rows, and how many begin before each row. Those that begin in a row are
// its last entries.
struct Known {
  const std::uint32_t *starts, *partners, *bases;  // null: there were none
  Vec3* springs;
  __device__ std::uint32_t candidate_of(std::uint32_t entry, std::uint32_t row) const {
    return entry + bases[row + 1] - starts[row + 1];
  }
};

// A thread for each entry, which holds its row, and gets its candidate's number.
__global__ void __launch_bounds__(kThreads)
    number_kernel(const __grid_constant__ View v, Word count, Known now, Known old, std::uint32_t* entries,
                  detect::Pair* pairs, detect::Pair* movers) {
  for (Word at = blockIdx.x * Word(kThreads) + threadIdx.x; at < count; at += Word(gridDim.x) * kThreads) {
    const auto q = static_cast<std::uint32_t>(at);
    const std::uint32_t row = entries[q], partner = now.partners[q];
    if (partner < row) {
      const std::uint32_t other = find_in_row(now.starts, now.partners, partner, row);
      entries[q] = now.candidate_of(other, partner) | kSecond;
      continue;
    }
    const std::uint32_t c = now.candidate_of(q, row);
    const std::uint32_t before = old.starts ? find_in_row(old.starts, old.partners, row, partner) : ~0u;
    entries[q] = c;
    pairs[c] = {row, partner};
    if (movers) movers[c] = {mover_of(v, row), partner < v.spheres ? mover_of(v, partner) : 0};
    now.springs[c] = before == ~0u ? Vec3{} : old.springs[old.candidate_of(before, row)];
  }
}

unsigned blocks_for(Word items) {
  return static_cast<unsigned>(std::clamp<Word>((items + kThreads - 1) / kThreads, 1, 8448));
}

template <class T>
void copy_up(T* to, const std::vector<T>& from) {
  if (!from.empty())
    cuda_check(cudaMemcpy(to, from.data(), from.size() * sizeof(T), cudaMemcpyHostToDevice),
               "copy the candidates");
}
template <class T>
std::vector<T> copy_down(const detect::cuda::Buffer<T>& from, std::uint64_t count) {
  std::vector<T> to(count);
  if (count)
    cuda_check(cudaMemcpy(to.data(), from.data(), count * sizeof(T), cudaMemcpyDeviceToHost),
               "read the candidates");
  return to;
}

}  // namespace

Candidates::Memory::Memory(detect::cuda::MemoryBook& book)
    : starts(book, "the candidates"),
      partners(book, "the candidates"),
      bases(book, "the candidates"),
      springs(book, "the candidates") {}

Candidates::Candidates(detect::cuda::MemoryBook& book)
    : book_(book),
      memory_{Memory(book), Memory(book)},
      pairs_(book, "the candidates"),
      movers_(book, "the candidates"),
      pushes_(book, "the candidates"),
      entries_(book, "the candidates"),
      counts_(book, "the candidates"),
      unsorted_(book, "the candidates"),
      room_(book, "the candidates") {}

Rows Candidates::rows() const {
  const Memory& m = memory_[now_];
  return {count_,         pairs_.data(),   movers_.data(), m.springs.data(),
          pushes_.data(), m.starts.data(), entries_.data()};
}

void Candidates::put(const View& view, std::span<const SpringMemory> pairs,
                     std::span<const SpringMemory> walls) {
  std::vector<detect::Pair> all;
  for (const SpringMemory& m : pairs) all.push_back({m.i, m.j});
  for (const SpringMemory& m : walls) all.push_back({m.i, view.spheres + m.j});
  detect::cuda::Buffer<detect::Pair> given(book_, "the candidates");
  copy_up(given.reserve(all.size()), all);
  memory_[now_].starts.release();  // no springs from what was there
  make_rows(view, {given.data(), all.size()}, {}, nullptr);
  std::vector<Vec3> springs;
  for (auto pair = pairs.begin(), wall = walls.begin(); springs.size() < count_;) {
    const bool is_pair = pair != pairs.end() && (wall == walls.end() || pair->i <= wall->i);
    springs.push_back(is_pair ? pair++->spring : wall++->spring);
  }
  copy_up(memory_[now_].springs.data(), springs);
}

void Candidates::get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls,
                     std::uint32_t spheres) const {
  const auto at = copy_down(pairs_, count_);
  const auto springs = copy_down(memory_[now_].springs, count_);
  pairs.clear(), walls.clear();
  for (std::uint32_t c = 0; c < count_; c++)
    if (at[c].j >= spheres)
      walls.push_back({at[c].i, at[c].j - spheres, springs[c]});
    else
      pairs.push_back({at[c].i, at[c].j, springs[c]});
}

// Writes for each row the sum of the counts before it, and behind the last that of all, which it returns.
std::uint32_t Candidates::sum_before(const std::uint32_t* counts, std::uint32_t* sums, std::uint32_t rows,
                                     cudaStream_t stream) {
  std::size_t bytes = 0;
  const auto scan = [&](void* room) {
    cuda_check(cub::DeviceScan::ExclusiveSum(room, bytes, counts, sums, std::int64_t(rows) + 1, stream),
               "scan");
  };
  scan(nullptr);
  scan(room_.reserve(bytes));
  std::uint32_t sum = 0;
  cuda_check(cudaMemcpyAsync(&sum, sums + rows, sizeof sum, cudaMemcpyDeviceToHost, stream), "count");
  cuda_check(cudaStreamSynchronize(stream), "count the candidates");
  return sum;
}

void Candidates::make_rows(const View& view, std::span<const detect::Pair> pairs,
                           std::optional<double> wall_gap, cudaStream_t stream) {
  const std::uint32_t rows = view.spheres;
  const Memory& before = memory_[now_];
  const Known old{before.starts.data(), before.partners.data(), before.bases.data(), before.springs.data()};
  Memory& m = memory_[now_ = 1 - now_];
  std::uint32_t* const starts = m.starts.reserve(rows + std::uint64_t(1));
  std::uint32_t* const bases = m.bases.reserve(rows + std::uint64_t(1));
  std::uint32_t* const counts = counts_.reserve(rows + std::uint64_t(1));
  cuda_check(cudaMemsetAsync(counts, 0, (rows + std::uint64_t(1)) * sizeof *counts, stream), "count");
  const auto fill = [&](const Filling& filling) {
    fill_pairs_kernel<<<blocks_for(pairs.size()), kThreads, 0, stream>>>(view, filling, pairs.data(),
                                                                         pairs.size());
    if (wall_gap && view.walls)
      fill_walls_kernel<<<blocks_for(rows), kThreads, 0, stream>>>(view, filling, *wall_gap);
  };
  fill({counts});
  const std::uint32_t entries = sum_before(counts, starts, rows, stream);
  std::uint32_t* const unsorted = unsorted_.reserve(entries);
  std::uint32_t* const partners = m.partners.reserve(entries);
  std::uint32_t* const numbers = entries_.reserve(entries);
  fill({counts, starts, unsorted});
  std::size_t bytes = 0;
  const auto sort = [&](void* room) {
    cuda_check(cub::DeviceSegmentedSort::SortKeys(room, bytes, unsorted, partners, std::int64_t(entries),
                                                  std::int64_t(rows), starts, starts + 1, stream),
               "sort");
  };
  sort(nullptr);
  sort(room_.reserve(bytes));
  rows_kernel<<<rows / kThreads + 1, kThreads, 0, stream>>>(rows, starts, partners, counts, numbers);
  count_ = sum_before(counts, bases, rows, stream);
  const Known now{starts, partners, bases, m.springs.reserve(count_)};
  pairs_.reserve(count_), pushes_.reserve(count_);
  if (view.bodies) movers_.reserve(count_);
  number_kernel<<<blocks_for(entries), kThreads, 0, stream>>>(view, entries, now, old, numbers, pairs_.data(),
                                                              movers_.data());
  cuda_launched("order the candidates");
}

void Candidates::find(const View& view, std::span<const detect::Pair> pairs, double gap,
                      cudaStream_t stream) {
  if (2 * Word(pairs.size()) + Word(view.walls) * view.spheres >= 0xffffffffu ||
      std::uint64_t(view.spheres) + view.walls >= 0xffffffffu)
    throw Error(std::to_string(pairs.size()) +
                " candidate pairs are more than a step on a GPU can number (2^31 - 1)");
  make_rows(view, pairs, gap, stream);
}

}  // namespace padder::settle::cuda
