// SPDX-License-Identifier: MIT
// A bounding-volume hierarchy over the triangles of a mesh: which of them are near a point, in a box, or near
// each other. Surface asks it; whoever asks for distances or sides asks Surface.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Built by the binned surface-area heuristic (Wald, On fast construction of SAH-based bounding volume
// hierarchies, 2007) in O(n log n) on all threads, and the same for any number of them. It keeps no reference
// to the mesh, and does not change after construction.
class TriangleTree {
 public:
  // The boxes are those of the children.
  struct Node : BoxPair {
    std::uint32_t child[2];  // node, or first slot when count > 0; a child stands behind its parent
    std::uint32_t count[2];

    // A mesh of one leaf has a root whose second child is empty.
    bool empty(int side) const { return low[0][side] > high[0][side]; }
  };
  static constexpr int kStackSize = 128;  // no walk that goes down one child at a time needs more

  explicit TriangleTree(const Mesh& mesh);

  // Makes visit_near() rule out more. `triangles`: of `mesh`, the one that each slot stands for.
  void find_slabs(const Mesh& mesh, const std::vector<std::uint32_t>& triangles);

  const std::vector<Node>& nodes() const { return nodes_; }  // the root first; none for a mesh of none
  // The triangle in each slot. Those of a leaf stand side by side.
  const std::vector<std::uint32_t>& triangles() const { return triangles_; }

  // Calls visit(slot) for those in leaves closer to p than the root of `limit2`, nearest first. `visit` may
  // shrink `limit2`, and returns true to stop. Slabs change nothing but which slots are left out that lie
  // farther away.
  template <class Visit>
  void visit_near(const Point& p, double& limit2, Visit&& visit) const;

  // Calls visit(t) for each triangle near the box, among them all whose own boxes touch it.
  void visit(const Box& box, const std::function<void(std::uint32_t)>& visit) const;

  // Calls visit(s, t) once for each two triangles whose own boxes touch, s < t, in no order and from all
  // threads. When it returns true, the walk ends early. `mesh` is that of the tree, which is walked against
  // itself: neighbours are found together, so this costs a fifth of asking for each triangle.
  void visit_pairs(const Mesh& mesh, const std::function<bool(std::uint32_t, std::uint32_t)>& visit) const;

 private:
  // Two parallel planes for each child of a node, across the mean normal of the triangles below, which lie
  // between them. A patch of a round surface is as thick as the square of its size, and its box as its size.
  // So from the centre, where all of the surface is about as near, boxes rule out little, and slabs nearly
  // all.
  struct SlabPair {
    Eigen::Array2d normal[3], low, high;  // a normal of no length rules out nothing

    void set(int side, std::span<const std::array<Point, 3>> triangles);
    // No point of the triangles is nearer to p than the roots of these. `doubt`: more than rounding moves
    // a distance.
    Eigen::Array2d distance2(const Point& p, double doubt) const {
      const Eigen::Array2d along = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2];
      const Eigen::Array2d distance = ((low - along).max(along - high) - doubt).max(0.0);
      return distance * distance;
    }
  };
  // A share of the coordinates: more than rounding moves the nearest point of any triangle.
  static constexpr double kSlabDoubt = 1e-12;

  std::vector<Node> nodes_;
  std::vector<SlabPair> slabs_;  // none, or one for each node
  double extent_ = 0;            // no corner of a slab's triangles has a larger sum of coordinates
  std::vector<std::uint32_t> triangles_;
};

template <class Visit>
void TriangleTree::visit_near(const Point& p, double& limit2, Visit&& visit) const {
  if (nodes_.empty()) return;
  const double doubt = kSlabDoubt * (p.cwiseAbs().sum() + extent_);
  struct Entry {
    double distance2;
    std::uint32_t child, count;
  };
  Entry stack[kStackSize];
  int top = 0;
  stack[top++] = {0, 0, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.distance2 >= limit2) continue;
    if (entry.count > 0) {
      for (std::uint32_t k = 0; k < entry.count; k++)
        if (visit(entry.child + k)) return;
      continue;
    }
    const Node& node = nodes_[entry.child];
    const Eigen::Array2d distance2 = node.distance2(p);
    const int near = distance2[1] < distance2[0];
    double near2 = distance2[near], far2 = distance2[1 - near];
    // On the way down to the first leaf nothing is ruled out.
    if (!slabs_.empty() && near2 < limit2 && limit2 < std::numeric_limits<double>::infinity()) {
      const Eigen::Array2d slab2 = slabs_[entry.child].distance2(p, doubt);
      near2 = std::max(near2, slab2[near]), far2 = std::max(far2, slab2[1 - near]);
    }
    if (far2 < limit2) stack[top++] = {far2, node.child[1 - near], node.count[1 - near]};
    if (near2 < limit2) stack[top++] = {near2, node.child[near], node.count[near]};
  }
}

}  // namespace padder
