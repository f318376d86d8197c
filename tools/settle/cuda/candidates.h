// SPDX-License-Identifier: MIT
// Makes the candidates and their rows from the detector's list of pairs, and carries the springs from the old
// ones to the new. Only .cu files include this.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "detect/cuda/device/memory.h"
#include "tools/settle/cuda/view.h"
#include "tools/settle/state.h"

namespace padder::settle::cuda {

class Candidates {
 public:
  explicit Candidates(detect::cuda::MemoryBook& book);

  // These candidates with these springs, and no others.
  void put(const View& view, std::span<const SpringMemory> pairs, std::span<const SpringMemory> walls);
  // `pairs`, which lie in device memory, and all spheres and walls whose gap is at most `gap`. Pairs and
  // walls of which nothing moves are left out. Throws Error if there are too many.
  void find(const View& view, std::span<const detect::Pair> pairs, double gap, cudaStream_t stream);
  // Copies all candidates to the host.
  void get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls, std::uint32_t spheres) const;
  Rows rows() const;

 private:
  // What a row of candidates needs to be found again: their rows and springs.
  struct Memory {
    explicit Memory(detect::cuda::MemoryBook& book);
    detect::cuda::Buffer<std::uint32_t> starts, partners, bases;
    detect::cuda::Buffer<Vec3> springs;
  };
  // Of these pairs, which may name walls as Rows does, and of all spheres and walls with at most this gap.
  void make_rows(const View& view, std::span<const detect::Pair> pairs, std::optional<double> wall_gap,
                 cudaStream_t stream);
  std::uint32_t sum_before(const std::uint32_t* counts, std::uint32_t* sums, std::uint32_t rows,
                           cudaStream_t stream);

  detect::cuda::MemoryBook& book_;
  std::uint32_t count_ = 0;  // of candidates
  int now_ = 0;              // which of the two memories: the one before is read while a new one is made
  Memory memory_[2];
  detect::cuda::Buffer<detect::Pair> pairs_, movers_;
  detect::cuda::Buffer<Push> pushes_;
  detect::cuda::Buffer<std::uint32_t> entries_, counts_, unsorted_;
  detect::cuda::Buffer<std::uint8_t> room_;  // of the sort and the scans
};

}  // namespace padder::settle::cuda
