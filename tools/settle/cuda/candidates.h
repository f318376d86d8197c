// SPDX-License-Identifier: MIT
// Makes the rows of candidates from the detector's list of pairs, and carries the springs from the old rows
// to the new. Only .cu files include this.
#pragma once
#include <span>
#include <vector>

#include "detect/cuda/device/memory.h"
#include "tools/settle/cuda/view.h"
#include "tools/settle/state.h"

namespace padder::settle::cuda {

class Candidates {
 public:
  explicit Candidates(detect::cuda::MemoryBook& book);

  // The rows of these springs, and no others. `spheres`, `walls`: how many there are.
  void put(std::span<const SpringMemory> pairs, std::span<const SpringMemory> walls, std::uint32_t spheres);
  // The rows of `pairs`, which lie in device memory, and of all spheres and walls whose gap is at most `gap`.
  // Pairs and walls of which nothing moves are left out. Throws Error if there are too many.
  void find(const View& view, std::span<const detect::Pair> pairs, double gap, cudaStream_t stream);
  // Copies all rows to the host, each pair once.
  void get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls, std::uint32_t spheres) const;
  Rows rows() const { return {starts_[now_].data(), partners_[now_].data(), springs_[now_].data()}; }

 private:
  std::uint64_t count_ = 0;  // of entries in all rows
  int now_ = 0;              // which of the two: the rows before are read while new ones are made
  detect::cuda::Buffer<std::uint32_t> starts_[2], partners_[2];
  detect::cuda::Buffer<Vec3> springs_[2];
  detect::cuda::Buffer<unsigned long long> keys_[2], counter_;
  detect::cuda::Buffer<std::uint8_t> room_;  // of the sort
};

}  // namespace padder::settle::cuda
