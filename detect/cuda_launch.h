// Launches whose kernels may be made ready while the one before still runs (programmatic dependent launch,
// CUDA Programming Guide): between small kernels that saves more than a microsecond each. Only .cu files
// include this.
#pragma once
#include "detect/cuda_memory.h"

namespace padder::detect::cuda {

// The first statement of every kernel that is launched by launch(): lets the kernel after it be made ready,
// and waits until all before it have ended and what they wrote can be seen.
__device__ __forceinline__ void follow() {
  cudaTriggerProgrammaticLaunchCompletion();
  cudaGridDependencySynchronize();
}

struct Shape {
  dim3 blocks, threads;
  std::size_t shared = 0;  // bytes
};
template <class... Parameters, class... Arguments>
void launch(void (*kernel)(Parameters...), const Shape& shape, cudaStream_t stream,
            Arguments&&... arguments) {
  cudaLaunchAttribute overlap{};
  overlap.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  overlap.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = shape.blocks, config.blockDim = shape.threads, config.dynamicSmemBytes = shape.shared;
  config.stream = stream, config.attrs = &overlap, config.numAttrs = 1;
  cuda_check(cudaLaunchKernelEx(&config, kernel, static_cast<Parameters>(arguments)...), "launch a kernel");
}

}  // namespace padder::detect::cuda
