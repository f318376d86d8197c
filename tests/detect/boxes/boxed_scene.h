// SPDX-License-Identifier: MIT
// What the tests of the boxes share: comparing a BoxedDetector with one Detector and with brute force.
#pragma once
#include <map>

#include "detect/boxes/boxed_detector.h"
#include "tests/detect/oracle.h"

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
// many along each edge; grains of which some are far away; one across all boxes.
inline std::vector<TestScene> odd_scenes(int edge, std::uint32_t grains) {
  std::vector<TestScene> scenes(6);
  for (int k = 0; k < 40; k++) scenes[0].spheres.push_back({1, 2, 3, 0.5});
  scenes[1].spheres.push_back({0, 0, 0, 1});
  for (int x = 0; x < edge; x++)
    for (int y = 0; y < edge; y++)
      for (int z = 0; z < edge; z++) scenes[3].spheres.push_back({double(x), double(y), double(z), 0.5});
  scenes[4] = random_scene(grains, 3, 0.5, 9);
  for (const double far : {1e6, -1e12, 1e30, -1e99})
    scenes[4].spheres.push_back({far, 0, 1, 1}), scenes[4].spheres.push_back({far, 1, 1, 1});
  scenes[5] = random_scene(grains, 3, 0.5, 11);
  scenes[5].spheres.push_back({5, 5, 5, 100});
  return scenes;
}

// One detector, to compare with.
inline Detector one_on_the_cpu(const CallOptions& options) {
  return Detector(DeviceChoice{BackendKind::omp}, options);
}

// The records of contacts by their pair, as bytes.
inline std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> records_of(const Contacts& c) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> records;
  for (std::uint64_t k = 0; k < c.count; k++) {
    std::string bytes;
    bytes.append(reinterpret_cast<const char*>(&c.normal_span<double>()[k]), sizeof(Normal<double>));
    bytes.append(reinterpret_cast<const char*>(&c.point_span<double>()[k]), sizeof(Points<double>));
    const bool fresh = records.emplace(std::pair(c.pairs[k].i, c.pairs[k].j), bytes).second;
    EXPECT_TRUE(fresh) << "pair " << c.pairs[k].i << ", " << c.pairs[k].j << " was reported twice";
  }
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

}  // namespace padder::detect
