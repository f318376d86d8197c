// SPDX-License-Identifier: MIT
// Two kernels of one stream that overlap: the second starts while the first still runs, does what does not
// depend on it, and then waits for its end (programmatic dependent launch, from compute capability 9.0 on).
// Elsewhere the second starts when the first has ended. Only .cu files include this.
#pragma once
#include "detect/cuda/device/device.h"

namespace padder::detect::cuda {

// In the first kernel: the next kernel of the stream may start when all blocks have come here.
__device__ __forceinline__ void allow_next_kernel() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;");
#endif
}
// In the second kernel: waits for the end of the first, and sees what it wrote.
__device__ __forceinline__ void wait_for_previous_kernel() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
}

struct LaunchConfig {
  unsigned blocks, threads, shared_bytes = 0;  // shared_bytes: of dynamic shared memory
};
// Launches a kernel that waits for the one before it by wait_for_previous_kernel(). Throws Error.
template <class... Given, class... Arguments>
void launch_overlapped(void (*kernel)(Given...), LaunchConfig launch, cudaStream_t stream,
                       const Arguments&... arguments) {
  cudaLaunchAttribute overlap{};
  overlap.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  overlap.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = launch.blocks, config.blockDim = launch.threads;
  config.dynamicSmemBytes = launch.shared_bytes, config.stream = stream;
  if (has_programmatic_launch()) config.attrs = &overlap, config.numAttrs = 1;
  cuda_check(cudaLaunchKernelEx(&config, kernel, Given(arguments)...), "search for contacts");
}

}  // namespace padder::detect::cuda
