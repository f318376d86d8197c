// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/search/room.h"

#include <vector>

#include "padding/by_tolerance/cube.h"

namespace padder {
namespace {

constexpr double kSmallestCube = 1.0 / 8;  // its radius as a share of the balls'
constexpr std::size_t kMostCubes = 2'000;  // that are cut

struct MeasuredCube : Cube {
  double distance = 0;  // of its centre to the surface
};

}  // namespace

// Distances to the surface change by no more than the way. So a cube whose centre has a distance d holds no
// centre of a ball of more than d + R, with the radius R of the cube, and what such balls hold lies within
// d + 2 R of the cube's centre.
Room::Room(const Surface& surface, double radius)
    : known_(radius > 0 && surface.closed() && !(surface.half_thickness() > 0)) {
  if (!known_) return;
  const auto may_hold = [&](MeasuredCube& cube) {
    cube.distance = surface.clearance(cube.center).distance;
    if (cube.distance + cube.radius() < radius) return false;
    if (cube.distance <= cube.radius() || surface.signed_nearest(cube.center).inside) return true;
    const auto winding = surface.winding_number(cube.center);
    return !winding || *winding > 0;  // all of the cube is on one side
  };
  const Box box = surface.bounds();
  std::vector<MeasuredCube> cubes = {{{box.center(), 0.5 * (box.high - box.low).maxCoeff()}}}, next;
  if (!may_hold(cubes[0])) cubes.clear();
  while (!cubes.empty() && cubes.size() <= kMostCubes && cubes[0].radius() > kSmallestCube * radius) {
    next.clear();
    for (const MeasuredCube& cube : cubes)
      for (int corner = 0; corner < 8; corner++)
        if (MeasuredCube eighth{cube.eighth(corner)}; may_hold(eighth)) next.push_back(eighth);
    cubes.swap(next);
  }
  std::vector<Ball> reach;
  for (const MeasuredCube& cube : cubes) reach.push_back({cube.center, cube.distance + 2 * cube.radius()});
  reach_ = BallSet(std::move(reach));
}

}  // namespace padder
