// SPDX-License-Identifier: GPL-3.0-or-later
// The nearest point of a mesh, by CGAL's AABB tree: the oracle that contacts with a padded part are compared
// with. It shares no code with padding's own search.
#pragma once
#include <memory>

#include "padding/asset/mesh.h"

namespace padder::bench {

class ExactMesh {
 public:
  explicit ExactMesh(const Mesh& mesh);
  ~ExactMesh();
  Point nearest(const Point& to) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace padder::bench
