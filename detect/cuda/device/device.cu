// SPDX-License-Identifier: MIT
#include "detect/cuda/device/device.h"

#include <algorithm>

namespace padder::detect::cuda {
namespace {

__global__ void version_kernel() {}  // has the version of all kernels of this build

}  // namespace

OnDevice::OnDevice(int device) noexcept {
  static const auto current = driver_function<CUresult (*)(CUcontext*)>("cuCtxGetCurrent", 4000);
  if (!current || current(&before_) != CUDA_SUCCESS) before_ = nullptr;
  cudaGetLastError();
  error_ = cudaSetDevice(device);
}

OnDevice::~OnDevice() {
  static const auto make_current = driver_function<CUresult (*)(CUcontext)>("cuCtxSetCurrent", 4000);
  if (before_ && make_current) make_current(before_);
}

void check_device_memory(const void* p, int device, const char* what) {
  cudaPointerAttributes found{};
  cuda_check(cudaPointerGetAttributes(&found, p), "ask where an array lies");
  if (found.type == cudaMemoryTypeUnregistered || !found.devicePointer)
    throw Error(
        std::string(what) +
        " are said to lie in device memory, but the pointer is none of the device's: say that they lie "
        "in host memory, or copy them to the device");
  if (found.type == cudaMemoryTypeDevice && found.device != device)
    throw Error(std::string(what) + " lie in the memory of GPU " + std::to_string(found.device) +
                ", but the detector works on GPU " + std::to_string(device) +
                ": copy them, or make the detector with that device");
}

int processors_of(cudaStream_t stream, int device) {
  static const auto green_of =
      driver_function<CUresult (*)(CUstream, CUgreenCtx*)>("cuStreamGetGreenCtx", 12040);
  static const auto resource_of =
      driver_function<CUresult (*)(CUgreenCtx, CUdevResource*, CUdevResourceType)>("cuGreenCtxGetDevResource",
                                                                                   12040);
  CUgreenCtx green = nullptr;
  CUdevResource part{};
  if (green_of && resource_of && green_of(stream, &green) == CUDA_SUCCESS && green &&
      resource_of(green, &part, CU_DEV_RESOURCE_TYPE_SM) == CUDA_SUCCESS)
    return static_cast<int>(part.sm.smCount);
  int processors = 0;
  cuda_check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device), "ask the device");
  return processors;
}

unsigned resident_blocks(const void* kernel, int threads, std::size_t shared_bytes, int processors) {
  int of_a_processor = 0;
  cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&of_a_processor, kernel, threads, shared_bytes),
             "ask how many blocks run at once");
  return static_cast<unsigned>(std::max(of_a_processor * processors, 1));
}

std::size_t shared_memory_of_block() {
  int device = 0, bytes = 0;
  cuda_check(cudaGetDevice(&device), "ask the device");
  cuda_check(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
             "ask the device");
  return std::min(static_cast<std::size_t>(bytes), test_limits.shared_memory);
}

bool has_programmatic_launch() {
  cudaFuncAttributes found{};
  cuda_check(cudaFuncGetAttributes(&found, version_kernel), "ask for the version of a kernel");
  return found.ptxVersion >= 90 && test_limits.programmatic_launch;
}

std::string unfit_sentence(int device, int major, int minor, bool has_code) {
  const std::string gpu = "GPU " + std::to_string(device),
                    capability = std::to_string(major) + "." + std::to_string(minor);
  if (major < 8)
    return "the CUDA backend needs compute capability 8.0 or newer; " + gpu + " has " + capability +
           ": choose omp";
  if (has_code) return "";
  return "this build has no code for " + gpu + ", whose compute capability is " + capability +
         ": build it with -DCMAKE_CUDA_ARCHITECTURES=" + std::to_string(major) + std::to_string(minor) +
         " or choose omp";
}

}  // namespace padder::detect::cuda
