// SPDX-License-Identifier: MIT
// How many threads a call gets.
#include "detect/omp/threads.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <thread>
#include <vector>

namespace padder::detect::omp {
namespace {

constexpr std::uint64_t kMuch = 1u << 30;

TEST(Threads, AsAskedOrAsTheWorkIsWorth) {
  omp_set_num_threads(4);
  Threads t;
  EXPECT_EQ(t.choose(7, 1), 7);
  EXPECT_EQ(t.choose(0, 0), 1);
  EXPECT_EQ(t.choose(0, 2047), 1);
  EXPECT_EQ(t.choose(0, 3 * 2048), 4);
  EXPECT_EQ(t.choose(0, kMuch), 4);
  omp_set_num_threads(100000);
  EXPECT_EQ(t.choose(0, ~std::uint64_t(0)), 1024);
  omp_set_num_threads(1);
  EXPECT_EQ(t.choose(0, kMuch), 1);
}

TEST(Threads, OneAfterACallThatWasInterruptedAndSeveralAgainLater) {
  omp_set_num_threads(2);
  Threads t;
  ASSERT_EQ(t.choose(0, kMuch), 2);
  std::atomic<bool> end{false};
  std::vector<std::thread> busy(4 * std::thread::hardware_concurrency());  // they take each other's turns
  for (std::thread& b : busy)
    b = std::thread([&] {
      while (!end) {
      }
    });
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  end = true;
  for (std::thread& b : busy) b.join();
  t.done();
  EXPECT_EQ(t.choose(0, kMuch), 1);
  EXPECT_EQ(t.choose(2, kMuch), 2) << "who asks gets them";
  t.done();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(t.choose(0, kMuch), 2);
}

}  // namespace
}  // namespace padder::detect::omp
