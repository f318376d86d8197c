// SPDX-License-Identifier: MIT
// Which level searches which on the CPU: what the plan costs in scenes whose bounds tell little.
#include "detect/omp/search/cross_search.h"

#include "detect/omp/choose_levels.h"
#include "tests/detect/oracle.h"

namespace padder::detect::omp {
namespace {

class CrossSearchOfAHeap : public ::testing::Test {
 protected:
  std::mt19937_64 random = random_of_new_seed();
  std::normal_distribution<double> normal;
  std::vector<Sphere> spheres;

  void place(double r, double edge) {
    spheres.push_back({edge * unit(random), edge * unit(random), edge * unit(random), r});
  }
  // How many spheres of coarser levels the finer ones read in their lists, for each sphere of the scene.
  double listed_by_plan() {
    std::shuffle(spheres.begin(), spheres.end(), random);
    const View<double> view{&spheres[0].x, &spheres[0].r, 4, 4, spheres.size(), nullptr, nullptr};
    const Summary s = summarize(view, 1);
    const Grid g = choose_levels(s, 0);
    const CrossSearches plan = plan_cross_searches(g, s, false);
    double listed = 0;
    for (std::size_t k = 0; k < spheres.size(); k += 100) {
      const int level = level_of(g, spheres[k]);
      for (const LevelSearch& c : plan.of_level[level])
        if (c.way == Way::table) listed += 100 * static_cast<double>(list_length(g, spheres[k], c.at));
    }
    return listed / static_cast<double>(spheres.size());
  }

 private:
  // Spheres of a level that may touch something in the bin of `finer`.
  std::uint64_t list_length(const Grid& g, const Sphere& finer, int level) {
    const Level& l = g.level[level];
    const double partner = g.level[level_of(g, finer)].radius_max, at[3] = {finer.x, finer.y, finer.z};
    std::uint64_t length = 0;
    for (const Sphere& p : spheres) {
      if (level_of(g, p) != level) continue;
      const double c[3] = {p.x, p.y, p.z};
      bool reaches = true;
      for (int k = 0; k < 3; k++) {
        const double low = static_cast<double>(split(l, at[k]).bin) * l.size;
        reaches = reaches && c[k] > low - p.r - partner && c[k] < low + l.size + p.r + partner;
      }
      length += reaches;
    }
    return length;
  }
};

// The largest grains of the heap have the sizes of stones that lie far apart. With the stones they would
// share bins that hold the whole heap, and each smaller grain would have all of them in its list: 1,200. By
// bounds alone, it also looks cheaper that all grains read lists of the largest grains, 20 each.
TEST_F(CrossSearchOfAHeap, GrainsReadShortLists) {
  constexpr int kScenes = 8;
  double listed = 0;
  for (int scene = 0; scene < kScenes; scene++) {
    spheres.clear();
    for (int k = 0; k < 40'000; k++) place(0.015 * std::exp(0.8 * normal(random)), 5);
    for (int k = 0; k < 8'000; k++) place(std::exp(1.2 * normal(random)), 3500);
    listed += listed_by_plan() / kScenes;
  }
  EXPECT_LT(listed, 12);
}

}  // namespace
}  // namespace padder::detect::omp
