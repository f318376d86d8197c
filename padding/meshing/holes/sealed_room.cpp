// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/sealed_room.h"

#include <algorithm>
#include <cmath>

#include "padding/geometry/triangle.h"

namespace padder {

SealedRoom::SealedRoom(const Mesh& walls, double width) {
  constexpr double most_cubes = 256;
  const Box box = walls.bounds();
  const Vector extent = box.high - box.low;
  width_ = std::max(width, extent.maxCoeff() / most_cubes);
  low_ = box.low - Vector::Constant(width_);
  for (int k = 0; k < 3; k++) size_[k] = static_cast<int>(std::floor(extent[k] / width_)) + 3;
  cubes_.assign(std::size_t(size_[0]) * std::size_t(size_[1]) * std::size_t(size_[2]), sealed);
  add_walls(walls);
  flood();
}

bool SealedRoom::holds(const Point& p) const { return cubes_[index_of(place_of(p))] == sealed; }

SealedRoom::Place SealedRoom::place_of(const Point& p) const {
  Place at;
  for (int k = 0; k < 3; k++)
    at[k] = static_cast<int>(std::clamp((p[k] - low_[k]) / width_, 0.0, double(size_[k] - 1)));
  return at;
}

// All cubes that the box of a small part of a wall touches: more than the wall itself, so that no step from
// face to face leads through it.
void SealedRoom::add_walls(const Mesh& walls) {
  std::vector<TrianglePart> parts;
  for (std::uint32_t t = 0; t < walls.triangles.size(); t++) {
    parts.push_back({walls.corners(t), t});
    while (!parts.empty()) {
      const TrianglePart part = parts.back();
      parts.pop_back();
      if (part.size() > width_) {
        for (const TrianglePart& half : bisect(part)) parts.push_back(half);
        continue;
      }
      Box box;
      for (const Point& p : part.corner) box.add(p);
      const Place from = place_of(box.low), to = place_of(box.high);
      for (int z = from[2]; z <= to[2]; z++)
        for (int y = from[1]; y <= to[1]; y++)
          for (int x = from[0]; x <= to[0]; x++) cubes_[index_of({x, y, z})] = wall;
    }
  }
}

void SealedRoom::flood() {
  std::vector<Place> reached = {{0, 0, 0}};
  cubes_[0] = open;
  while (!reached.empty()) {
    const Place at = reached.back();
    reached.pop_back();
    for (int axis = 0; axis < 3; axis++)
      for (const int step : {-1, 1}) {
        Place next = at;
        next[axis] += step;
        if (next[axis] < 0 || next[axis] >= size_[axis] || cubes_[index_of(next)] != sealed) continue;
        cubes_[index_of(next)] = open, reached.push_back(next);
      }
  }
}

}  // namespace padder
