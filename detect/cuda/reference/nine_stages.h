// SPDX-License-Identifier: MIT
// The nine stages of section 2.1 on the GPU, one function each, arrays under the paper's names: the reference
// that the fast path is checked against. Always decides in double. Internal; only .cu files include this.
#pragma once

#include "detect/core/nine_stages.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

class Stages {
 public:
  explicit Stages(MemoryBook& book);

  std::uint64_t count_bins(const DeviceSpheres& source, const StageGrid& grid, cudaStream_t stream);  // 1: T
  std::uint64_t scan_bins(cudaStream_t stream);                 // 2: S; the size of B
  void fill_bins(cudaStream_t stream);                          // 3: B
  void sort_by_bin(cudaStream_t stream);                        // 4
  void find_starts(cudaStream_t stream);                        // 5: C
  void push_inactive(cudaStream_t stream);                      // 6
  void count_contacts(const Region& own, cudaStream_t stream);  // 7: D
  std::uint64_t scan_contacts(cudaStream_t stream);             // 8: E; the size of F
  void write_contacts(Pair* pairs, cudaStream_t stream);        // 9: F

  Arrays arrays(const Pair* pairs, cudaStream_t stream) const;  // copied to the host

 private:
  DeviceSpheres source_;
  StageGrid grid_;
  Region own_;
  std::uint64_t entries_ = 0, bins_ = 0, active_ = 0, contacts_ = 0;
  Buffer<std::uint64_t> T_, S_, B_bin_, B_bin_sorted_, C_start_, C_start_sorted_, C_end_, C_bin_, D_, E_;
  Buffer<std::uint32_t> B_object_, B_object_sorted_, C_order_, C_order_sorted_;
  Buffer<std::uint64_t> heads_;
  Buffer<unsigned char> scratch_;
};

}  // namespace padder::detect::cuda
