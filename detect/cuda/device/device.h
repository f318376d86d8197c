// SPDX-License-Identifier: MIT
// Where kernels run: the device's context, which is current for the length of a call only; the memory that a
// caller says is the device's; and what the device offers: processors, shared memory, newer instructions.
// Internal; only .cu files include this.
#pragma once
#include <cuda.h>

#include <cstddef>
#include <string>

#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// A function of the driver as it is since that version (12040: 12.4); a program is not linked to the driver.
// Null where the driver is older.
template <class Function>
Function driver_function(const char* name, unsigned since) {
  void* found = nullptr;
  cudaDriverEntryPointQueryResult result{};
  if (cudaGetDriverEntryPointByVersion(name, &found, since, cudaEnableDefault, &result) != cudaSuccess) {
    cudaGetLastError();
    return nullptr;
  }
  return result == cudaDriverEntryPointSuccess ? reinterpret_cast<Function>(found) : nullptr;
}

// Makes the device's primary context current, and the caller's current again at the end, whatever it was.
// Discards the error that an earlier call of the caller's own left in the runtime: it would be taken for
// ours.
class OnDevice {
 public:
  explicit OnDevice(int device) noexcept;
  ~OnDevice();
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;
  void require() const { cuda_check(error_, "choose the device"); }  // throws Error

 private:
  CUcontext before_ = nullptr;
  cudaError_t error_ = cudaSuccess;
};

// Throws Error unless kernels on `device` can read what lies at `p`, which is named `what` ("the centres").
void check_device_memory(const void* p, int device, const char* what);

// Processors that kernels on the stream may use: fewer than the device has in a green context, under MPS or
// on a MIG slice.
int processors_of(cudaStream_t stream, int device);

// How many blocks of the kernel run at once on so many processors, at least one. Blocks that wait for each
// other must be no more than this: then each runs sooner or later, whatever else the device does. Throws
// Error.
unsigned resident_blocks(const void* kernel, int threads, std::size_t shared_bytes, int processors);

// Bytes of shared memory that one block may have on the current device. Throws Error.
std::size_t shared_memory_of_block();

// Was the code that runs on the current device compiled with the instructions that let kernels overlap
// (overlapped_launch.h)? They came with compute capability 9.0; a newer GPU may run older code. Throws Error.
bool has_programmatic_launch();

// By tests alone: what the device is taken to offer at most, so that a large GPU stands for a smaller one.
struct TestLimits {
  std::size_t shared_memory = ~std::size_t(0);  // bytes of a block
  bool programmatic_launch = true;
  std::uint32_t all_pairs_elements = ~0u;  // of bodies, that are searched without a grid
};
inline TestLimits test_limits;
class ScopedTestLimits {
 public:
  explicit ScopedTestLimits(const TestLimits& limits) { test_limits = limits; }
  ~ScopedTestLimits() { test_limits = before_; }
  ScopedTestLimits(const ScopedTestLimits&) = delete;
  ScopedTestLimits& operator=(const ScopedTestLimits&) = delete;

 private:
  const TestLimits before_ = test_limits;
};

// Why the detector does not run on a GPU of this compute capability; "" if it does. `has_code`: this build
// has kernels for it.
std::string unfit_sentence(int device, int major, int minor, bool has_code);

}  // namespace padder::detect::cuda
