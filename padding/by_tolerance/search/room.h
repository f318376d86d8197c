// SPDX-License-Identifier: MIT
// Where a body has room for large balls.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// All centres of balls inside of the body that have at least a given radius. It is known in cubes, so that it
// is rather too much: what it denies is proved.
class Room {
 public:
  // Knows nothing, and denies nothing, of a surface that bounds no body and of one with a thick sheet.
  Room(const Surface& surface, double radius);

  // There is no such ball.
  bool none() const { return known_ && reach_.empty(); }
  // No such ball comes within this distance of p.
  bool none_within(const Point& p, double distance) const {
    return known_ && !(reach_.gap(p, distance).value <= distance);
  }

 private:
  bool known_;
  BallSet reach_;  // that holds all these balls
};

}  // namespace padder
