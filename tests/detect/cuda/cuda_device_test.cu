// SPDX-License-Identifier: MIT
// What a GPU must offer and what it is told otherwise; and the same list where it offers less than this one:
// an H200 stands for smaller GPUs.
#include "detect/cuda/device/device.h"

#include <cuda_runtime.h>

#include <cstring>

#include "detect/cuda/device/memory.h"
#include "detect/scene/generate.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"

namespace padder::detect {
namespace {

using cuda::ScopedTestLimits;
using cuda::TestLimits;
using cuda::unfit_sentence;

// Needs no device: the capabilities are made up.
TEST(CudaDevice, AnOldGpuIsToldWhatIsNeeded) {
  for (const bool has_code : {false, true})
    EXPECT_EQ(unfit_sentence(0, 7, 5, has_code),
              "the CUDA backend needs compute capability 8.0 or newer; GPU 0 has 7.5: choose omp");
  EXPECT_EQ(unfit_sentence(1, 8, 0, true), "");
  EXPECT_EQ(unfit_sentence(1, 12, 1, true), "");
  EXPECT_EQ(unfit_sentence(1, 12, 1, false),
            "this build has no code for GPU 1, whose compute capability is 12.1: build it with "
            "-DCMAKE_CUDA_ARCHITECTURES=121 or choose omp");
}

using CudaLimits = GpuTest;

// In a roomy book an eighth more than is needed is taken at once, as long as half of the memory stays free;
// else only when a buffer grows.
TEST_F(CudaLimits, MemoryTakesAnEighthMoreWhereItWillGrow) {
  for (const bool roomy : {false, true}) {
    cuda::MemoryBook book;
    book.roomy = roomy;
    cuda::Buffer<std::uint32_t> buffer(book, "the test"), pinned(book, "the test", true);
    buffer.reserve(800), pinned.reserve(800);
    EXPECT_EQ(buffer.capacity(), roomy ? 900u : 800u);
    EXPECT_EQ(pinned.capacity(), 800u);
    EXPECT_EQ(book.held, 4 * buffer.capacity());
    buffer.reserve(1600);
    EXPECT_EQ(buffer.capacity(), 1800u);
  }
  std::size_t free = 0, total = 0;
  ASSERT_EQ(cudaMemGetInfo(&free, &total), cudaSuccess);
  cuda::MemoryBook book;
  book.roomy = true;
  cuda::Buffer<char> buffer(book, "the test");
  if (free < total / 2 + total / 16) return;  // other programs hold the memory
  const std::uint64_t most = free - total / 2;
  buffer.reserve(most);
  EXPECT_EQ(buffer.capacity(), most);
}

TEST_F(CudaLimits, AreLowered) {
  const std::size_t shared = cuda::shared_memory_of_block();
  EXPECT_GE(shared, 48u * 1024);
  {
    const ScopedTestLimits limits({.shared_memory = 1000, .programmatic_launch = false});
    EXPECT_EQ(cuda::shared_memory_of_block(), 1000u);
    EXPECT_FALSE(cuda::has_programmatic_launch());
  }
  EXPECT_EQ(cuda::shared_memory_of_block(), shared);
}

// Each limit alone, then both. Calls: the first, one with the grid of the previous call, then recorded ones.
struct LimitedScene {
  const char* name;
  std::uint64_t spheres;
  bool in_double;
};
void expect_same_list(std::initializer_list<LimitedScene> scenes) {
  for (const LimitedScene& scene : scenes) {
    SCOPED_TRACE(testing::Message() << scene.name << " " << scene.spheres);
    const auto spheres = generate(scene.name, scene.spheres);
    const std::vector<Sphere> wide = in_double_of(spheres);
    const Input input = scene.in_double ? input_of(wide) : input_of(spheres);
    CallOptions options;
    options.order = Order::stable;
    Detector whole({BackendKind::cuda}, options);
    const Contacts& expected = whole.detect(input);
    for (const TestLimits& limit :
         {TestLimits{.shared_memory = 99 * 1024}, TestLimits{.programmatic_launch = false},
          TestLimits{.shared_memory = 99 * 1024, .programmatic_launch = false}}) {
      SCOPED_TRACE(testing::Message() << limit.shared_memory << " bytes of shared memory"
                                      << (limit.programmatic_launch ? "" : ", no programmatic launch"));
      const ScopedTestLimits limits(limit);
      Detector smaller({BackendKind::cuda}, options);
      SomeCases some;
      for (int call = 0; call < 4; call++) {
        if (some.left_out()) continue;
        const Contacts& found = smaller.detect(input);
        ASSERT_EQ(found.count, expected.count) << "call " << call;
        ASSERT_EQ(std::memcmp(found.pairs, expected.pairs, found.count * sizeof(Pair)), 0) << "call " << call;
      }
    }
  }
}

// By cells; through buckets, whose number is too large to divide among at once in 99 KB only; several levels.
TEST_F(CudaLimits, TheListIsTheSameOnASmallerGpu) {
  expect_same_list({{"dense", 100'000, false}, {"poly100", 150'000, false}, {"poly100", 60'000, true}});
}
TEST_F(CudaLimits, LargeListsAreTheSameOnASmallerGpu) {
  expect_same_list({{"dense", 1'000'000, false},
                    {"dense", 12'000'000, false},
                    {"poly100", 400'000, true},
                    {"poly100", 3'000'000, false}});
}

}  // namespace
}  // namespace padder::detect
