// SPDX-License-Identifier: MIT
#include "tools/settle/cuda/candidates.h"

#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

namespace padder::settle::cuda {
namespace {

using detect::cuda::cuda_check;
using detect::cuda::cuda_launched;
using Word = unsigned long long;

constexpr int kThreads = 256;

// A key is a row and a partner. Keys of the row behind the last, `spheres`, are of no candidate.
struct KeyForm {
  int bits;  // of the partner
  std::uint32_t spheres;
  PADDER_HD Word key(std::uint32_t row, std::uint32_t partner) const { return Word(row) << bits | partner; }
  __device__ std::uint32_t row(Word key) const { return static_cast<std::uint32_t>(key >> bits); }
  __device__ std::uint32_t partner(Word key) const {
    return static_cast<std::uint32_t>(key & ((Word(1) << bits) - 1));
  }
};

__device__ bool moves(const View& v, std::uint32_t sphere) {
  return v.motions[mover_of(v, sphere)].inverse_mass != 0;
}

__global__ void __launch_bounds__(kThreads)
    pair_keys_kernel(const __grid_constant__ View v, KeyForm form, const detect::Pair* pairs, Word count,
                     Word* keys) {
  for (Word c = blockIdx.x * Word(kThreads) + threadIdx.x; c < count; c += Word(gridDim.x) * kThreads) {
    const detect::Pair p = pairs[c];
    const bool wanted = moves(v, p.i) || moves(v, p.j);
    keys[2 * c] = form.key(wanted ? p.i : form.spheres, p.j);
    keys[2 * c + 1] = form.key(wanted ? p.j : form.spheres, p.i);
  }
}

// Counts the spheres near walls, and writes their keys if there is room for them.
__global__ void __launch_bounds__(kThreads)
    wall_keys_kernel(const __grid_constant__ View v, KeyForm form, double gap, Word* keys, Word* count) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < v.spheres; k += gridDim.x * kThreads) {
    const detect::Sphere at = v.centers[k];
    for (std::uint32_t w = 0; w < v.walls; w++) {
      if (contact_with(v.wall[w], center_of(at), at.r).depth < -gap || !moves(v, k)) continue;
      const Word place = atomicAdd(count, Word(1));
      if (keys) keys[place] = form.key(k, v.spheres + w);
    }
  }
}

// The number of the first key of a row not below `row`, for each row, and the partners.
__global__ void __launch_bounds__(kThreads)
    rows_kernel(KeyForm form, const Word* keys, Word count, std::uint32_t* starts, std::uint32_t* partners) {
  for (Word q = blockIdx.x * Word(kThreads) + threadIdx.x; q <= count; q += Word(gridDim.x) * kThreads) {
    const std::uint32_t row = q < count ? form.row(keys[q]) : form.spheres;
    const std::uint32_t from = q ? form.row(keys[q - 1]) + 1 : 0;
    for (std::uint32_t r = from; r <= row; r++) starts[r] = static_cast<std::uint32_t>(q);
    if (q < count) partners[q] = form.partner(keys[q]);
  }
}

// 1 for the entry of a candidate in the row of its first sphere.
struct IsFirst {
  KeyForm form;
  __device__ std::uint32_t operator()(Word key) const {
    const std::uint32_t row = form.row(key);
    return row < form.spheres && form.partner(key) > row;
  }
};

// The place of `partner` in the row, or ~0u.
__device__ std::uint32_t find_in_row(const std::uint32_t* starts, const std::uint32_t* partners,
                                     std::uint32_t row, std::uint32_t partner) {
  std::uint32_t low = starts[row], high = starts[row + 1];
  const std::uint32_t last = high;
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (partners[middle] < partner)
      low = middle + 1;
    else
      high = middle;
  }
  return low < last && partners[low] == partner ? low : ~0u;
}

// What is known of the candidates before.
struct Old {
  const std::uint32_t *starts, *partners, *entries;  // null: there were none
  const Vec3* springs;
};

// `entries` holds for each entry how many candidates begin before it, and gets the candidates' numbers.
__global__ void __launch_bounds__(kThreads)
    number_kernel(const __grid_constant__ View v, KeyForm form, const Word* keys, Word count,
                  const std::uint32_t* starts, const std::uint32_t* partners, std::uint32_t* entries,
                  detect::Pair* pairs, detect::Pair* movers, Vec3* springs, std::uint8_t* touched, Old old) {
  for (Word q = blockIdx.x * Word(kThreads) + threadIdx.x; q < count; q += Word(gridDim.x) * kThreads) {
    const std::uint32_t row = form.row(keys[q]), partner = form.partner(keys[q]);
    if (row >= form.spheres) continue;
    if (partner < row) {  // its number stands in the row of its first sphere, where nothing is written
      entries[q] = entries[find_in_row(starts, partners, partner, row)] | kSecond;
      continue;
    }
    const std::uint32_t before = old.starts ? find_in_row(old.starts, old.partners, row, partner) : ~0u;
    pairs[entries[q]] = {row, partner};
    if (movers) movers[entries[q]] = {mover_of(v, row), partner < v.spheres ? mover_of(v, partner) : 0};
    const Vec3 spring = before == ~0u ? Vec3{} : old.springs[old.entries[before]];
    springs[entries[q]] = spring, touched[entries[q]] = spring != Vec3{};
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

KeyForm form_of(const View& v) {
  return {static_cast<int>(std::bit_width(std::uint64_t(v.spheres) + v.walls)), v.spheres};
}

}  // namespace

Candidates::Memory::Memory(detect::cuda::MemoryBook& book)
    : starts(book, "the candidates"),
      partners(book, "the candidates"),
      entries(book, "the candidates"),
      springs(book, "the candidates") {}

Candidates::Candidates(detect::cuda::MemoryBook& book)
    : memory_{Memory(book), Memory(book)},
      pairs_(book, "the candidates"),
      movers_(book, "the candidates"),
      pushes_(book, "the candidates"),
      touched_(book, "the candidates"),
      keys_{{book, "the candidates"}, {book, "the candidates"}},
      counter_(book, "the candidates"),
      room_(book, "the candidates") {}

Rows Candidates::rows() const {
  const Memory& m = memory_[now_];
  return {count_,         pairs_.data(),   movers_.data(),  m.springs.data(),
          pushes_.data(), touched_.data(), m.starts.data(), m.entries.data()};
}

void Candidates::put(const View& view, std::span<const SpringMemory> pairs,
                     std::span<const SpringMemory> walls) {
  const KeyForm form = form_of(view);
  const auto key = [&](std::uint32_t row, std::uint32_t partner) { return form.key(row, partner); };
  std::vector<Word> keys;
  for (const SpringMemory& m : pairs) keys.push_back(key(m.i, m.j)), keys.push_back(key(m.j, m.i));
  for (const SpringMemory& m : walls) keys.push_back(key(m.i, view.spheres + m.j));
  reserve_keys(keys.size() + 1);
  copy_up(keys_[0].data(), keys);
  memory_[now_].starts.release();  // no springs from what was there
  sort_into_rows(keys.size(), view, nullptr);
  std::vector<Vec3> springs;
  for (auto pair = pairs.begin(), wall = walls.begin(); springs.size() < count_;) {
    const bool is_pair = pair != pairs.end() && (wall == walls.end() || pair->i <= wall->i);
    springs.push_back(is_pair ? pair++->spring : wall++->spring);
  }
  copy_up(memory_[now_].springs.data(), springs);
  std::vector<std::uint8_t> touched;
  for (const Vec3& s : springs) touched.push_back(s != Vec3{});
  copy_up(touched_.data(), touched);
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

void Candidates::reserve_keys(std::uint64_t count) {
  for (auto& keys : keys_) keys.reserve(count);
}

void Candidates::sort_into_rows(std::uint64_t entries, const View& view, cudaStream_t stream) {
  const KeyForm form = form_of(view);
  const Memory& before = memory_[now_];
  const Old old{before.starts.data(), before.partners.data(), before.entries.data(), before.springs.data()};
  Memory& m = memory_[now_ = 1 - now_];
  std::uint32_t* const starts = m.starts.reserve(view.spheres + std::uint64_t(1));
  std::uint32_t* const partners = m.partners.reserve(entries);
  std::uint32_t* const numbers = m.entries.reserve(entries + 1);
  cub::DoubleBuffer<Word> keys(keys_[0].data(), keys_[1].data());
  std::size_t for_sort = 0, for_scan = 0;
  const auto items = static_cast<std::int64_t>(entries);
  const auto sort = [&](void* room) {
    cuda_check(cub::DeviceRadixSort::SortKeys(room, for_sort, keys, items, 0, 2 * form.bits, stream), "sort");
  };
  const auto scan = [&](void* room) {
    const auto first =
        thrust::make_transform_iterator(static_cast<const Word*>(keys.Current()), IsFirst{form});
    cuda_check(cub::DeviceScan::ExclusiveSum(room, for_scan, first, numbers, items + 1, stream), "scan");
  };
  sort(nullptr), scan(nullptr);
  void* const room = room_.reserve(std::max(for_sort, for_scan));
  sort(room);
  // The entry behind the last begins no candidate.
  cuda_check(cudaMemsetAsync(keys.Current() + entries, 0xff, sizeof(Word), stream), "sort");
  scan(room);
  cuda_check(cudaMemcpyAsync(&count_, numbers + entries, sizeof count_, cudaMemcpyDeviceToHost, stream),
             "count");
  cuda_check(cudaStreamSynchronize(stream), "count the candidates");
  m.springs.reserve(count_), pairs_.reserve(count_), pushes_.reserve(count_), touched_.reserve(count_);
  if (view.bodies) movers_.reserve(count_);
  rows_kernel<<<blocks_for(entries + 1), kThreads, 0, stream>>>(form, keys.Current(), entries, starts,
                                                                partners);
  number_kernel<<<blocks_for(entries), kThreads, 0, stream>>>(
      view, form, keys.Current(), entries, starts, partners, numbers, pairs_.data(), movers_.data(),
      m.springs.data(), touched_.data(), old);
  cuda_launched("order the candidates");
}

void Candidates::find(const View& view, std::span<const detect::Pair> pairs, double gap,
                      cudaStream_t stream) {
  const KeyForm form = form_of(view);
  Word* const counter = counter_.reserve(1);
  Word near_walls = 0;
  const auto count_walls = [&](Word* keys) {
    cuda_check(cudaMemsetAsync(counter, 0, sizeof(Word), stream), "count the walls");
    wall_keys_kernel<<<blocks_for(view.spheres), kThreads, 0, stream>>>(view, form, gap, keys, counter);
  };
  if (view.walls) {
    count_walls(nullptr);
    cuda_check(cudaMemcpyAsync(&near_walls, counter, sizeof(Word), cudaMemcpyDeviceToHost, stream), "count");
    cuda_check(cudaStreamSynchronize(stream), "count the walls");
  }
  const std::uint64_t from_pairs = 2 * pairs.size(), entries = from_pairs + near_walls;
  if (entries >= 0xffffffffu || std::uint64_t(view.spheres) + view.walls >= 0xffffffffu)
    throw Error(std::to_string(pairs.size()) +
                " candidate pairs are more than a step on a GPU can number (2^31 - 1)");
  reserve_keys(entries + 1);
  pair_keys_kernel<<<blocks_for(pairs.size()), kThreads, 0, stream>>>(view, form, pairs.data(), pairs.size(),
                                                                      keys_[0].data());
  if (near_walls) count_walls(keys_[0].data() + from_pairs);
  sort_into_rows(entries, view, stream);
}

}  // namespace padder::settle::cuda
