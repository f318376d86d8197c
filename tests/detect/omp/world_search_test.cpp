// SPDX-License-Identifier: MIT
// The search of the tree on a CPU gives up where it tests too much in vain, whatever the number of threads.
#include "detect/omp/worlds/world_search.h"

#include <gtest/gtest.h>

namespace padder::detect::omp {
namespace {

TEST(WorldSearch, GivesUpByTheTestsInVainAndNotByTheThreads) {
  // Rods of ten spheres; the third crosses the first two, and touches neither.
  std::vector<Sphere> rod;
  for (int k = 0; k < 10; k++) rod.push_back({static_cast<double>(k), 0, 0, 0.4});
  const std::vector<Shape> shapes = {{rod.data(), rod.size()}};
  std::vector<Body> bodies(3);
  bodies[1].position[1] = 0.5;
  bodies[2].position[0] = bodies[2].position[2] = 4.5;
  Input input;
  input.shapes = shapes, input.bodies = bodies;
  CallOptions options;
  options.width = Width::pairs;
  for (const int threads : {1, 2}) {
    Budget budget;
    Records records(budget);
    WorldSearch search(budget);
    Seconds seconds;
    std::uint64_t needed = 0;
    for (; needed < 10000; needed++) {
      Allowance allowance(needed);
      if (search.run(input, options, threads, allowance, records, seconds)) break;
    }
    EXPECT_GT(needed, 10u);  // of each pair, the spheres of one rod
    EXPECT_LT(needed, 1000u);
    EXPECT_EQ(records.count, 10u);  // the first against the second: each sphere with one
    static std::uint64_t needed_by_one;
    if (threads == 1) needed_by_one = needed;
    EXPECT_EQ(needed, needed_by_one);
  }
}

}  // namespace
}  // namespace padder::detect::omp
