// SPDX-License-Identifier: MIT
// Host memory reaches the device as it was when the copy was asked for.
#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <random>
#include <thread>
#include <vector>

#include "detect/cuda/input/host_copy.h"
#include "detect/cuda/tuning.h"
#include "tests/detect/backends.h"

namespace padder::detect::cuda {
namespace {

struct Sides {
  const char* name;
  bool pinned;
};

class HostCopies : public testing::TestWithParam<Sides> {
 protected:
  void SetUp() override { skip_without(BackendKind::cuda); }
};

// Around the size from which blocks are used; from and to addresses that are aligned to nothing.
TEST_P(HostCopies, AreWhatTheHostHad) {
  constexpr std::uint64_t most = tuning::kStagedCopy + 3 * tuning::kCopyBlock;
  std::vector<std::uint64_t> words(most / 8 + 2);
  std::mt19937_64 random(1);
  MemoryBook book;
  Buffer<char> device(book, "the test"), pinned(book, "the test", true);
  char *to = device.reserve(most + 8), *from = reinterpret_cast<char*>(words.data());
  if (GetParam().pinned) from = pinned.reserve(most + 8);
  HostCopy copy;
  std::vector<char> back, expected;
  for (const std::uint64_t bytes : {std::uint64_t(0), std::uint64_t(1), tuning::kStagedCopy - 1,
                                    tuning::kStagedCopy, tuning::kStagedCopy + 1, most - 5}) {
    for (std::uint64_t& w : words) w = random();
    if (GetParam().pinned) std::memcpy(from, words.data(), most);
    expected.assign(from + 3, from + 3 + bytes);
    // The stream is busy: a block that did not wait for its copy before would be written over.
    ASSERT_EQ(
        cudaLaunchHostFunc(
            nullptr, [](void*) { std::this_thread::sleep_for(std::chrono::milliseconds(30)); }, nullptr),
        cudaSuccess);
    copy.run(to + 1, from + 3, bytes, "copy", nullptr);
    if (!GetParam().pinned) std::memset(from, 0, most);  // of a pinned one the device still reads
    back.resize(bytes);
    ASSERT_EQ(cudaMemcpy(back.data(), to + 1, bytes, cudaMemcpyDeviceToHost), cudaSuccess);
    ASSERT_TRUE(back == expected) << bytes << " bytes";
  }
}

INSTANTIATE_TEST_SUITE_P(From, HostCopies, testing::Values(Sides{"pageable", false}, Sides{"pinned", true}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace padder::detect::cuda
