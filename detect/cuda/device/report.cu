// SPDX-License-Identifier: MIT
#include "detect/cuda/device/report.h"

#include <atomic>
#include <chrono>

#include "detect/cuda/device/overlapped_launch.h"

namespace padder::detect::cuda {
namespace {

using Word = unsigned long long;
constexpr Word kMark = 0x9d1f5c3ab7e60248;
constexpr auto kPatience = std::chrono::microseconds(400);

constexpr unsigned kThreads = 256;
__global__ void __launch_bounds__(kThreads) report_kernel(const __grid_constant__ Report::Parts parts) {
  wait_for_previous_kernel();
  write_report(parts);
}

}  // namespace

void Report::add(const void* device, void* pinned, std::uint64_t bytes) {
  parts_.part[parts_.count++] = {static_cast<const Word*>(device), static_cast<Word*>(pinned),
                                 static_cast<std::uint32_t>(bytes / sizeof(Word)), nullptr};
}

void Report::add_and_clear(void* device, void* pinned, std::uint64_t bytes) {
  add(device, pinned, bytes);
  parts_.part[parts_.count - 1].cleared = static_cast<Word*>(device);
}

void Report::expect() const {
  for (int p = 0; p < parts_.count; p++)
    for (std::uint32_t k = 0; k < parts_.part[p].words; k++)
      std::atomic_ref(parts_.part[p].to[k]).store(kMark, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_seq_cst);
}

void Report::send(cudaStream_t stream) const {
  launch_overlapped(report_kernel, {1, kThreads}, stream, parts_);
}

void Report::arrived(cudaStream_t stream, const char* what) const {
  using Clock = std::chrono::steady_clock;
  const auto until = Clock::now() + kPatience;
  unsigned turn = 0;
  for (int p = 0; p < parts_.count; p++)
    for (std::uint32_t k = 0; k < parts_.part[p].words;) {
      if (std::atomic_ref(parts_.part[p].to[k]).load(std::memory_order_acquire) != kMark) {
        k++;
      } else if (++turn % 64 == 0 && Clock::now() > until) {
        cuda_check(cudaStreamSynchronize(stream), what);
        return;
      }
    }
}

}  // namespace padder::detect::cuda
