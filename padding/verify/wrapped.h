// SPDX-License-Identifier: MIT
// What a wrap does to the surface that it goes around, proved: how far it stands off, which slots it closes,
// and which surface it hides. docs/tolerance.md has the proofs.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// For each triangle of `mesh` an upper bound of the distance of its points to `input`, above the true maximum
// by at most `slack`. Branch and bound: the distance to one triangle of the input is a convex function, so
// over a part it is largest at a corner. Runs on all threads; the result does not depend on their number.
std::vector<double> standoffs(const Mesh& mesh, const Surface& input, double slack);

// A place where a wrap bridges the input: it goes across from one side to the other.
struct ClosedSlot {
  double width = 0;                      // twice the largest standoff: the sides are at most so far apart
  double area = 0;                       // of the triangles that close it
  Point place = Point::Zero();           // where the standoff is largest, to a triangle
  std::vector<std::uint32_t> triangles;  // of the wrap
};

// The triangles that stand off by more than `allowed`, by connected pieces, the widest first.
std::vector<ClosedSlot> closed_slots(const Mesh& wrap, const std::vector<double>& standoff, double allowed);

// The part of a surface that can be touched from outside a wrap.
struct Touchable {
  Mesh mesh, buried;  // what is kept, what is left out
};

// Leaves out what lies deeper than `depth` below the wrap. Triangles are bisected until they are on one side,
// or smaller than `grain`; what is then undecided stays. A triangle that stays whole is not cut.
Touchable touchable(const Mesh& input, const Surface& wrap, double depth, double grain);

}  // namespace padder
