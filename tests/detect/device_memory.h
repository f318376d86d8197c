// SPDX-License-Identifier: MIT
// Device memory for tests that are also built without CUDA, where there is none.
#pragma once
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#if defined(PADDER_TEST_CUDA)
#include <cuda_runtime_api.h>
#endif

namespace padder::detect {

#if defined(PADDER_TEST_CUDA)
inline void cuda_must(cudaError_t e, const char* what) {
  if (e != cudaSuccess) throw std::runtime_error(std::string(what) + ": " + cudaGetErrorString(e));
}
#endif

// Bytes in device memory, freed at the end.
class DeviceCopy {
 public:
  DeviceCopy() = default;
  DeviceCopy(const void* from, std::size_t bytes) {
#if defined(PADDER_TEST_CUDA)
    cuda_must(cudaMalloc(&data_, bytes ? bytes : 1), "cudaMalloc");
    cuda_must(cudaMemcpy(data_, from, bytes, cudaMemcpyHostToDevice), "copy to the device");
    cuda_must(cudaStreamSynchronize(nullptr),
              "copy to the device");  // a stream of another kind may read it next
#else
    (void)from, (void)bytes;
    throw std::runtime_error("this build has no device memory");
#endif
  }
  DeviceCopy(DeviceCopy&& other) noexcept : data_(std::exchange(other.data_, nullptr)) {}
  DeviceCopy& operator=(DeviceCopy&& other) noexcept {
    std::swap(data_, other.data_);
    return *this;
  }
  ~DeviceCopy() {
#if defined(PADDER_TEST_CUDA)
    if (data_) cudaFree(data_);
#endif
  }
  void* data() const { return data_; }

 private:
  void* data_ = nullptr;
};

inline void copy_from_device(void* to, const void* from, std::size_t bytes) {
#if defined(PADDER_TEST_CUDA)
  cuda_must(cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost), "copy from the device");
#else
  std::memcpy(to, from, bytes);
#endif
}

// A stream of the test's own for Options::stream; null in a build without CUDA.
class TestStream {
 public:
  TestStream() {
#if defined(PADDER_TEST_CUDA)
    cudaStream_t s = nullptr;
    cuda_must(cudaStreamCreateWithFlags(&s, cudaStreamNonBlocking), "make a stream");
    stream_ = s;
#endif
  }
  TestStream(const TestStream&) = delete;
  ~TestStream() {
#if defined(PADDER_TEST_CUDA)
    cudaStreamDestroy(static_cast<cudaStream_t>(stream_));
#endif
  }
  void* get() const { return stream_; }

 private:
  void* stream_ = nullptr;
};

}  // namespace padder::detect
