// SPDX-License-Identifier: MIT
// Takes the place of cuda/backend.cu in a build without CUDA.
#include "detect/core/backend.h"
#include "padding/asset/error.h"

namespace padder::detect {

std::string cuda_absence(int) {
  return "this build has no CUDA backend: build with the CUDA toolkit on the PATH, or choose omp";
}

int cuda_device_count() { return 0; }

std::unique_ptr<Backend> make_cuda_backend(int device) { throw Error(cuda_absence(device)); }

}  // namespace padder::detect
