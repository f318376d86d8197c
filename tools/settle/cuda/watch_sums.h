// SPDX-License-Identifier: MIT
// The sums of a Watch over everything on the device. Only .cu files include this.
#pragma once
#include "detect/cuda/device/memory.h"
#include "tools/settle/cuda/view.h"
#include "tools/settle/state.h"

namespace padder::settle::cuda {

class WatchSums {
 public:
  explicit WatchSums(detect::cuda::MemoryBook& book)
      : parts_(book, "the sums of energies"), host_parts_(book, "the sums of energies", true) {}
  // Each block sums in the order of its threads, and the host sums the blocks in theirs.
  Watch watch(const View& view, cudaStream_t stream);

 private:
  detect::cuda::Buffer<Watch> parts_, host_parts_;
};

}  // namespace padder::settle::cuda
