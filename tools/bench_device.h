// Spheres in the memory of a GPU, for benches of what a simulation on the GPU would see. Without CUDA in the
// build only host memory is offered.
#pragma once
#include <string>
#include <vector>

#include "tools/bench.h"

#ifdef PADDER_CUDA
#include <cuda_runtime_api.h>
#endif
#include "padding/error.h"

namespace padder::bench {

class DeviceSpheres {
 public:
  DeviceSpheres(const std::vector<detect::FloatSphere>& spheres, [[maybe_unused]] bool on_device)
      : input_(input_of(spheres)) {
#ifdef PADDER_CUDA
    if (!on_device || spheres.empty()) return;
    const std::size_t bytes = spheres.size() * sizeof(detect::FloatSphere);
    if (cudaMalloc(&memory_, bytes) != cudaSuccess ||
        cudaMemcpy(memory_, spheres.data(), bytes, cudaMemcpyHostToDevice) != cudaSuccess)
      throw Error("the spheres do not fit the GPU's memory: choose fewer");
    input_.spheres.centers = memory_, input_.spheres.radii = static_cast<const float*>(memory_) + 3;
    input_.spheres.memory = detect::Memory::device;
#endif
  }
  ~DeviceSpheres() {
#ifdef PADDER_CUDA
    cudaFree(memory_);
#endif
  }
  DeviceSpheres(const DeviceSpheres&) = delete;
  DeviceSpheres& operator=(const DeviceSpheres&) = delete;
  const detect::Input& input() const { return input_; }

 private:
  detect::Input input_;
  [[maybe_unused]] void* memory_ = nullptr;
};

inline std::string device_name() {
#ifdef PADDER_CUDA
  cudaDeviceProp p;
  if (cudaGetDeviceProperties(&p, 0) == cudaSuccess) return p.name;
#endif
  return "none";
}

}  // namespace padder::bench
