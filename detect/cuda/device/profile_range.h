// SPDX-License-Identifier: MIT
// Names for what the host does, as Nsight Systems shows them (NVTX). Without a profiler a range costs a few
// nanoseconds. Only .cu files include this.
#pragma once
#include <nvtx3/nvToolsExt.h>

namespace padder::detect::cuda {

// From here to the end of the scope. Kernels that are enqueued meanwhile are shown under this name, too.
class ProfileRange {
 public:
  explicit ProfileRange(const char* name) { nvtxRangePushA(name); }
  ~ProfileRange() { nvtxRangePop(); }
  ProfileRange(const ProfileRange&) = delete;
  ProfileRange& operator=(const ProfileRange&) = delete;
};

}  // namespace padder::detect::cuda
