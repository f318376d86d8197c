// SPDX-License-Identifier: MIT
// The table by which finer spheres search a level on the CPU: that each finds its partners, and once.
#include "detect/omp/search/reach_table.h"

#include <algorithm>

#include "tests/detect/oracle.h"

namespace padder::detect::omp {
namespace {

// A level of spheres with radii of at most 1 that are `grown_by` larger.
Level level_over(const std::vector<Sphere>& spheres, bool hashed, double grown_by) {
  Level l;
  l.size = 2.25 + 2 * grown_by, l.per_size = 1 / l.size;
  l.radius_max = 1 + grown_by, l.grown_by = grown_by, l.spheres = spheres.size();
  l.buckets = 1;
  for (int k = 0; k < 3; k++) {
    const auto [low, high] =
        std::minmax_element(spheres.begin(), spheres.end(),
                            [&](const Sphere& a, const Sphere& b) { return (&a.x)[k] < (&b.x)[k]; });
    l.first[k] = split(l, (&low->x)[k]).bin;
    l.count[k] = static_cast<std::uint32_t>(split(l, (&high->x)[k]).bin - l.first[k] + 1);
    l.buckets *= l.count[k] + 2;
  }
  if (hashed) l.hashed = 1, l.ring = l.buckets = kLeastRing, set_spread(l, Spread::cubes);
  return l;
}

TEST(ReachTable, TellsEachPartnerOnce) {
  std::mt19937_64 random = random_of_new_seed();
  Budget budget;
  ReachTable table(budget);
  int met = 0, beyond = 0;
  for (int round = 0; round < 60; round++) {
    const bool hashed = round % 3 == 0;
    const double edge = hashed ? 1e4 : 12, margin = round % 2 ? 0.3 : 0, partner = round % 5 ? 0.1 : 1;
    const auto sphere = [&](double r) -> Sphere {
      // Every third coordinate is a multiple of the bins' edge.
      const auto at = [&] {
        const double v = edge * (unit(random) - 0.5), size = 2.25 + margin;
        return random() % 3 ? v : std::floor(v / size) * size;
      };
      const double x = at(), y = at(), z = at();
      return {x, y, z, r * (1 - 0.5 * unit(random) * unit(random))};
    };
    std::vector<Sphere> spheres, partners;
    for (int k = 0; k < 150; k++) spheres.push_back(sphere(1));
    const Level l = level_over(spheres, hashed, margin / 2);
    for (int k = 0; k < 600; k++) {
      Sphere p = sphere(partner);
      if (k % 2) {  // just touches one
        const Sphere& s = spheres[random() % spheres.size()];
        p.x = s.x, p.y = s.y, p.z = s.z;
        (&p.x)[k / 2 % 3] += (k % 4 == 1 ? 1 : -1) * (s.r + p.r + margin) * (1 - 1e-15);
      }
      partners.push_back(p);
    }
    Level fine = level_over(partners, hashed, margin / 2);
    fine.radius_max = partner + margin / 2;
    Partners all;
    all.add(fine);
    table.build(l, all, spheres.data(), 0, static_cast<std::uint32_t>(spheres.size()));
    for (const Sphere& p : partners) {
      const Bin bin = bin_of(l, p);
      const omp::Run run = table.run(static_cast<std::uint32_t>(bin.x), static_cast<std::uint32_t>(bin.y),
                                     static_cast<std::uint32_t>(bin.z));
      std::vector<std::uint32_t> found(table.slots() + run.begin, table.slots() + run.end);
      ASSERT_TRUE(std::is_sorted(found.begin(), found.end()));
      ASSERT_EQ(std::adjacent_find(found.begin(), found.end()), found.end()) << "listed twice";
      for (std::uint32_t k = 0; k < spheres.size(); k++)
        if (oracle_touching(p, spheres[k], margin)) {
          ASSERT_TRUE(std::binary_search(found.begin(), found.end(), k)) << "round " << round;
          met++;
        }
      beyond += found.empty();
    }
  }
  EXPECT_GT(met, 10000);
  EXPECT_GT(beyond, 1000);
}

// Grains on the surfaces of many large balls: too many for a search of them all, and too large for a search
// of the grains' bins. With a filter, a box, and a margin; near and far from each other; of any size.
TEST(ReachTable, GrainsFindTheBallsThatTheyLieOn) {
  std::mt19937_64 random = random_of_new_seed();
  for (const double wide : {1200.0, 1e6})
    for (const double scale : {1.0, 1e-160})
      for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
        if (scalar == Scalar::f32 && scale < 1) continue;
        TestScene s;
        for (int ball = 0; ball < 150; ball++) {
          const Sphere b{wide * signed_unit(random), wide * signed_unit(random), wide * signed_unit(random),
                         100};
          s.spheres.push_back(b);
          for (int grain = 0; grain < 10; grain++) s.spheres.push_back(grain_on(b, 1, 1, random));
        }
        s.scale(scale);
        if (scalar == Scalar::f32) s = s.rounded();
        for (const bool filtered : {false, true}) {
          for (std::size_t k = 0; k < s.spheres.size() && filtered; k++)
            s.family.push_back(static_cast<std::uint32_t>(random() % 3));
          const Arranged a(s, scalar);
          for (const double margin : {0.0, 0.02 * scale})
            for (const bool boxed : {false, true}) {
              CallOptions o;
              o.margin = margin, o.threads = 2;
              if (boxed) o.own.low[0] = 0, o.own.high[1] = wide * scale / 3;
              Detector d({BackendKind::omp}, o);
              const std::vector<Pair> wanted = oracle(a.input, o);
              ASSERT_GT(wanted.size(), 100u);
              ASSERT_EQ(sorted(d.detect(a.input).pair_span()), wanted)
                  << wide << ' ' << scale << (filtered ? " filtered" : "") << (boxed ? " boxed" : "");
            }
        }
      }
}

}  // namespace
}  // namespace padder::detect::omp
