// SPDX-License-Identifier: GPL-3.0-or-later
// The room behind a surface with openings, as far as nothing wide comes in.
#pragma once
#include <array>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Cubes of the width `width` fill the bounds of the walls, and one layer around them. Those that no wall
// touches and that are reached from outside, from face to face, are open. So an opening counts as closed
// where it is narrower than one to two widths, as in an alpha wrap of that alpha. There are at most 256 cubes
// along an axis, of a byte each, so that they may be wider than asked. The time is linear in these and in the
// area of the walls.
class SealedRoom {
 public:
  SealedRoom(const Mesh& walls, double width);

  // Is p in a cube that is not open and that no wall touches?
  bool holds(const Point& p) const;

 private:
  enum Cube : char { sealed, wall, open };
  using Place = std::array<int, 3>;

  Place place_of(const Point& p) const;
  std::size_t index_of(const Place& at) const {
    return (std::size_t(at[2]) * std::size_t(size_[1]) + std::size_t(at[1])) * std::size_t(size_[0]) +
           std::size_t(at[0]);
  }
  void add_walls(const Mesh& walls);
  void flood();

  Point low_;
  double width_;
  Place size_;
  std::vector<char> cubes_;
};

}  // namespace padder
