// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/room.h"

#include <cmath>
#include <vector>

namespace padder {
namespace {

constexpr double kSmallestCube = 1.0 / 8;  // its radius as a share of the balls'
constexpr std::size_t kMostCubes = 2'000;  // that are cut

struct Cube {
  Point center;
  double half;      // of its edge
  double distance;  // of its centre to the surface

  double radius() const { return std::sqrt(3.0) * half; }  // of the ball around it
};

}  // namespace

// Distances to the surface change by no more than the way. So a cube whose centre has a distance d holds no
// centre of a ball of more than d + R, with the radius R of the cube, and what such balls hold lies within
// d + 2 R of the cube's centre.
Room::Room(const Surface& surface, double radius)
    : known_(radius > 0 && surface.closed() && !(surface.half_thickness() > 0)) {
  if (!known_) return;
  const auto may_hold = [&](Cube& cube) {
    cube.distance = surface.clearance(cube.center).distance;
    if (cube.distance + cube.radius() < radius) return false;
    if (cube.distance <= cube.radius() || surface.signed_nearest(cube.center).inside) return true;
    const auto winding = surface.winding_number(cube.center);
    return !winding || *winding > 0;  // all of the cube is on one side
  };
  const Box box = surface.bounds();
  std::vector<Cube> cubes = {{box.center(), 0.5 * (box.high - box.low).maxCoeff(), 0}}, next;
  if (!may_hold(cubes[0])) cubes.clear();
  while (!cubes.empty() && cubes.size() <= kMostCubes && cubes[0].radius() > kSmallestCube * radius) {
    next.clear();
    for (const Cube& cube : cubes)
      for (int corner = 0; corner < 8; corner++) {
        const double half = 0.5 * cube.half;
        const Vector step((corner & 1) ? half : -half, (corner & 2) ? half : -half,
                          (corner & 4) ? half : -half);
        if (Cube eighth{cube.center + step, half, 0}; may_hold(eighth)) next.push_back(eighth);
      }
    cubes.swap(next);
  }
  std::vector<Ball> reach;
  for (const Cube& cube : cubes) reach.push_back({cube.center, cube.distance + 2 * cube.radius()});
  reach_ = BallSet(std::move(reach));
}

}  // namespace padder
