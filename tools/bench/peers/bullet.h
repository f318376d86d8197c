// SPDX-License-Identifier: GPL-3.0-or-later
// Bullet in double precision, as an independent reference for results and times. Left out of the build where
// the library is not installed.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/generate.h"

namespace padder::bench {

// One contact as Bullet has it, turned so that i < j and the normal points from i to j.
struct BulletContact {
  std::uint32_t i, j;
  double normal[3], depth, on_i[3], on_j[3];
};

class BulletWorld {
 public:
  explicit BulletWorld(
      const std::vector<detect::FloatSphere>& spheres);  // throws Error in a build without Bullet
  ~BulletWorld();
  BulletWorld(const BulletWorld&) = delete;

  void step();  // performDiscreteCollisionDetection: bounds, broad phase, narrow phase
  std::vector<BulletContact> contacts() const;  // sorted by i, then j
  std::uint64_t count() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

bool have_bullet();

}  // namespace padder::bench
