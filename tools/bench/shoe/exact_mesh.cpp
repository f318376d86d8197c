// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/shoe/exact_mesh.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <vector>

namespace padder::bench {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;

struct ExactMesh::Tree {
  Triangles triangles;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree;
};

ExactMesh::ExactMesh(const Mesh& mesh) : tree_(std::make_unique<Tree>()) {
  const auto cgal = [](const Point& p) { return Kernel::Point_3(p.x(), p.y(), p.z()); };
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Kernel::Triangle_3 one(cgal(mesh.corner(t, 0)), cgal(mesh.corner(t, 1)), cgal(mesh.corner(t, 2)));
    if (!one.is_degenerate()) tree_->triangles.push_back(one);
  }
  tree_->tree.insert(tree_->triangles.begin(), tree_->triangles.end());
  tree_->tree.accelerate_distance_queries();
}
ExactMesh::~ExactMesh() = default;

Point ExactMesh::nearest(const Point& to) const {
  const Kernel::Point_3 p = tree_->tree.closest_point({to.x(), to.y(), to.z()});
  return {p.x(), p.y(), p.z()};
}

}  // namespace padder::bench
