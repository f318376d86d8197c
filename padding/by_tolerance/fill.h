// SPDX-License-Identifier: MIT
// From balls that cover the surface of a body to balls that cover the body: proves that no hollow is left
// inside, and fills those that are.
#pragma once
#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// Lengths are in the surface's unit.
struct FillOptions {
  // Each surface point lies in a ball, at least so deep below its sphere; above 0. So all that is within
  // `depth` of the surface is covered. Where balls may move, wherever they are moved to.
  double depth = 0;
  double protrusion = 0;  // no ball that is added may stand out of the body by more; above 0
  double min_radius = 0;
  double max_radius = std::numeric_limits<double>::infinity();
  double moved = 0;  // the proof holds wherever each ball is moved by so much, or grown smaller
};

// What fill_body() found.
struct Filled {
  std::vector<Ball> balls;              // to add to those given
  std::vector<std::uint32_t> triangle;  // for each, the triangle that is nearest to its centre
  bool covered = false;                 // proved: with them, no point of the body lies outside the union
};

// Branch and bound over the cells of an octree around the surface. A cell is done when it lies outside the
// body, in one ball, or within `depth` of the surface. A small cell for which none of that can be shown is a
// hollow, or close to one: it gets the ball around its centre that stands out of the body by the whole
// protrusion. Of these balls, a greedy choice takes few. docs/tolerance.md has the proof.
//
// Inside is where the winding number is above 0, so an open surface is never covered, nor is what a hull
// encloses (Surface::hull), whose own surface the balls need not reach. Runs on all threads;
// the result does not depend on their number.
Filled fill_body(const Surface& surface, const BallSet& balls, const FillOptions& options);

}  // namespace padder
