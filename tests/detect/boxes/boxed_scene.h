// SPDX-License-Identifier: MIT
// What the tests of the boxes share: comparing a BoxedDetector with one Detector and with brute force.
#pragma once
#include <map>

#include "detect/boxes/boxed_detector.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"

namespace padder::detect {

inline BoxOptions on_the_cpu(std::uint32_t boxes, std::size_t devices = 1, int threads = 1) {
  BoxOptions o;
  o.detector.threads = threads;
  o.detector.width = Width::points, o.detector.scalar = Scalar::f64;
  o.devices.assign(devices, {BackendKind::omp, 0});
  o.boxes = boxes;
  return o;
}

// All spheres at one place; one; none; contacts on faces, edges and corners of boxes, of a lattice with so
// many along each edge; grains of which some are far away, large ones among them; one across all boxes.
inline std::vector<TestScene> odd_scenes(int edge, std::uint32_t grains) {
  std::vector<TestScene> scenes(6);
  for (int k = 0; k < 40; k++) scenes[0].spheres.push_back({1, 2, 3, 0.5});
  scenes[1].spheres.push_back({0, 0, 0, 1});
  scenes[3] = lattice(edge, 1, 0.5);
  scenes[4] = random_scene(grains, 3, 0.5, 9);
  for (const double far : {1e6, -1e12, 1e30, -1e99})
    for (const Sphere& s : {Sphere{far, 0, 1, 1}, {far, 1, 1, 1}, {1, far, far, 1e-3 * std::abs(far)}})
      scenes[4].spheres.push_back(s);
  scenes[5] = random_scene(grains, 3, 0.5, 11);
  scenes[5].spheres.push_back({5, 5, 5, 100});
  return scenes;
}

// One detector, to compare with.
inline Detector one_on_the_cpu(const CallOptions& options) {
  return Detector(DeviceChoice{BackendKind::omp}, options);
}

// The records of contacts by their pair, as bytes.
class Records : public std::map<std::pair<std::uint64_t, std::uint64_t>, std::string> {
 public:
  void add(std::uint64_t i, std::uint64_t j, const Normal<double>& normal, const Points<double>& points) {
    EXPECT_LT(i, j);
    std::string bytes(reinterpret_cast<const char*>(&normal), sizeof normal);
    bytes.append(reinterpret_cast<const char*>(&points), sizeof points);
    EXPECT_TRUE(emplace(std::pair(i, j), bytes).second) << i << ", " << j << " was reported twice";
  }
  bool hold(const Records& some) const { return std::includes(begin(), end(), some.begin(), some.end()); }
};
inline Records records_of(const Contacts& c) {
  Records records;
  for (std::uint64_t k = 0; k < c.count; k++)
    records.add(c.pairs[k].i, c.pairs[k].j, c.normal_span<double>()[k], c.point_span<double>()[k]);
  return records;
}

// The same pairs, records and hash as one Detector.
inline void expect_as_one_detector(const Input& input, BoxedDetector& boxed) {
  CallOptions options = boxed.options();
  options.memory_limit = 0;
  Detector one = one_on_the_cpu(options);
  const Contacts& wanted = one.detect(input);
  const Contacts& found = boxed.detect(input);
  ASSERT_EQ(found.count, wanted.count);
  EXPECT_EQ(found.spheres, wanted.spheres);
  EXPECT_EQ(boxed.hash(), one.hash());
  EXPECT_EQ(records_of(found), records_of(wanted));
}

// So many spheres in a pile that collapses to one side, and jitters. detect(input, step) gives the hash,
// which must be that of one detector, and whether the boxes were cut. Returns how often they were.
template <class Detect>
int expect_steps(int steps, std::uint32_t spheres, double pull, const Detect& detect) {
  std::mt19937_64 random(101);
  std::normal_distribution<double> jump(0, 0.2);
  TestScene scene = random_scene(spheres, 4, 0.6, 101).rounded();
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  int cuts = 0, crossed = 0;
  SomeCases some;
  for (int step = 0; step < steps; step++) {
    if (!some.left_out()) {
      const Arranged a(scene, Scalar::f32);
      one.detect(a.input);
      const auto [hash, cut] = detect(a.input, step);
      EXPECT_EQ(hash, one.hash()) << "step " << step;
      cuts += cut;
    }
    for (Sphere& s : scene.spheres) {
      const bool left = s.x < 10;
      s.x = pull * s.x + jump(random), s.y += jump(random), s.z += jump(random);
      if (step % 7 == 0) s.r = std::abs(s.r * (1 + 0.1 * jump(random)));
      crossed += left != (s.x < 10);
    }
    scene = scene.rounded();
  }
  EXPECT_GT(crossed, 1000);
  return cuts;
}

// Bodies of 30 spheres, some rods across many boxes, some without spheres; every fourth body is static.
struct Pile : TestBodies {
  std::mt19937_64 random{7};
  std::vector<std::uint32_t> moved;
  std::vector<Pose> poses;

  explicit Pile(int count) : poses(static_cast<std::size_t>(count)) {
    assets.resize(3);
    for (int k = 0; k < 30; k++) assets[0].push_back({unit(random), unit(random), unit(random), 0.1});
    for (int k = 0; k < 200; k++) assets[1].push_back({0.1 * k, 0, 0, 0.1});
    for (int k = 0; k < count; k++) {
      bodies.push_back(body_at(k % 40 == 7 ? 1 : k % 40 == 8 ? 2 : 0, anywhere(), anywhere(), anywhere()));
      bodies.back().is_static = k % 4 == 0, bodies.back().family = static_cast<std::uint32_t>(k % 7);
    }
  }
  double anywhere() { return 6 * unit(random); }
  // The input of a step of a sequence, in which bodies go elsewhere: some of them without saying so.
  Input step(int number) {
    moved.clear();
    for (std::uint32_t k = 0; k < bodies.size(); k++) {
      if (random() % 3 == 0)
        for (double& p : bodies[k].position) p = anywhere();
      if (random() % 3 == 0) moved.push_back(k);
      for (double& p : poses[k].position) p = anywhere();
    }
    Input in = input();
    in.revision = random() % 5 == 0 ? 0 : 1 + static_cast<std::uint64_t>(number) / 10, in.moved = moved;
    if (random() % 3 == 0) in.poses = poses.data();
    return in;
  }
};

}  // namespace padder::detect
