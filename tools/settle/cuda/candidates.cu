// SPDX-License-Identifier: MIT
#include "tools/settle/cuda/candidates.h"

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>

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
  __device__ Word key(std::uint32_t row, std::uint32_t partner) const { return Word(row) << bits | partner; }
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

// The spring of each entry: that of the same entry in the old rows, or 0.
__global__ void __launch_bounds__(kThreads)
    springs_kernel(KeyForm form, const Word* keys, Word count, Rows old, Vec3* springs) {
  for (Word q = blockIdx.x * Word(kThreads) + threadIdx.x; q < count; q += Word(gridDim.x) * kThreads) {
    const std::uint32_t row = form.row(keys[q]), partner = form.partner(keys[q]);
    Vec3 spring;
    if (row < form.spheres) {
      std::uint32_t low = old.starts[row], high = old.starts[row + 1];
      const std::uint32_t last = high;
      while (low < high) {
        const std::uint32_t middle = low + (high - low) / 2;
        if (old.partners[middle] < partner)
          low = middle + 1;
        else
          high = middle;
      }
      if (low < last && old.partners[low] == partner) spring = old.springs[low];
    }
    springs[q] = spring;
  }
}

unsigned blocks_for(Word items) {
  return static_cast<unsigned>(std::clamp<Word>((items + kThreads - 1) / kThreads, 1, 8448));
}

template <class T>
void copy_up(detect::cuda::Buffer<T>& to, const std::vector<T>& from) {
  to.reserve(from.size());
  if (!from.empty())
    cuda_check(cudaMemcpy(to.data(), from.data(), from.size() * sizeof(T), cudaMemcpyHostToDevice),
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

Candidates::Candidates(detect::cuda::MemoryBook& book)
    : starts_{{book, "the candidates"}, {book, "the candidates"}},
      partners_{{book, "the candidates"}, {book, "the candidates"}},
      springs_{{book, "the candidates"}, {book, "the candidates"}},
      keys_{{book, "the candidates"}, {book, "the candidates"}},
      counter_(book, "the candidates"),
      room_(book, "the candidates") {}

void Candidates::put(std::span<const SpringMemory> pairs, std::span<const SpringMemory> walls,
                     std::uint32_t spheres) {
  std::vector<std::uint32_t> starts(spheres + std::size_t(1), 0);
  for (const SpringMemory& m : pairs) starts[m.i + 1]++, starts[m.j + 1]++;
  for (const SpringMemory& m : walls) starts[m.i + 1]++;
  for (std::size_t k = 1; k < starts.size(); k++) starts[k] += starts[k - 1];
  std::vector<std::uint32_t> partners(starts.back()), next(starts.begin(), starts.end() - 1);
  std::vector<Vec3> springs(starts.back());
  const auto add = [&](std::uint32_t row, std::uint32_t partner, const Vec3& spring) {
    partners[next[row]] = partner, springs[next[row]++] = spring;
  };
  // By i, then j: so the partners of a row ascend, those below it first.
  for (const SpringMemory& m : pairs) add(m.j, m.i, -1.0 * m.spring);
  for (const SpringMemory& m : pairs) add(m.i, m.j, m.spring);
  for (const SpringMemory& m : walls) add(m.i, spheres + m.j, m.spring);
  count_ = partners.size(), now_ = 0;
  copy_up(starts_[0], starts), copy_up(partners_[0], partners), copy_up(springs_[0], springs);
}

void Candidates::get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls,
                     std::uint32_t spheres) const {
  const auto starts = copy_down(starts_[now_], spheres + std::uint64_t(1));
  const auto partners = copy_down(partners_[now_], count_);
  const auto springs = copy_down(springs_[now_], count_);
  pairs.clear(), walls.clear();
  for (std::uint32_t k = 0; k < spheres; k++)
    for (std::uint32_t q = starts[k]; q < starts[k + 1]; q++) {
      if (partners[q] >= spheres)
        walls.push_back({k, partners[q] - spheres, springs[q]});
      else if (partners[q] > k)
        pairs.push_back({k, partners[q], springs[q]});
    }
}

void Candidates::find(const View& view, std::span<const detect::Pair> pairs, double gap,
                      cudaStream_t stream) {
  const KeyForm form{static_cast<int>(std::bit_width(std::uint64_t(view.spheres) + view.walls)),
                     view.spheres};
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
  const std::uint64_t from_pairs = 2 * pairs.size();
  count_ = from_pairs + near_walls;
  if (count_ >= 0xffffffffu || std::uint64_t(view.spheres) + view.walls >= 0xffffffffu)
    throw Error(std::to_string(pairs.size()) +
                " candidate pairs are more than a step on a GPU can number (2^31 - 1)");
  const std::uint64_t room = count_ + count_ / 8;
  for (auto& keys : keys_)
    if (keys.capacity() < count_) keys.reserve(room);
  pair_keys_kernel<<<blocks_for(pairs.size()), kThreads, 0, stream>>>(view, form, pairs.data(), pairs.size(),
                                                                      keys_[0].data());
  if (near_walls) count_walls(keys_[0].data() + from_pairs);
  cub::DoubleBuffer<Word> keys(keys_[0].data(), keys_[1].data());
  std::size_t bytes = 0;
  const auto items = static_cast<std::int64_t>(count_);
  cuda_check(cub::DeviceRadixSort::SortKeys(nullptr, bytes, keys, items, 0, 2 * form.bits, stream), "sort");
  room_.reserve(bytes);
  cuda_check(cub::DeviceRadixSort::SortKeys(room_.data(), bytes, keys, items, 0, 2 * form.bits, stream),
             "sort");
  const Rows old = rows();
  const int next = 1 - now_;
  starts_[next].reserve(view.spheres + std::uint64_t(1));
  if (partners_[next].capacity() < count_) partners_[next].reserve(room);
  if (springs_[next].capacity() < count_) springs_[next].reserve(room);
  rows_kernel<<<blocks_for(count_ + 1), kThreads, 0, stream>>>(form, keys.Current(), count_,
                                                               starts_[next].data(), partners_[next].data());
  springs_kernel<<<blocks_for(count_), kThreads, 0, stream>>>(form, keys.Current(), count_, old,
                                                              springs_[next].data());
  cuda_launched("order the candidates");
  now_ = next;
}

}  // namespace padder::settle::cuda
