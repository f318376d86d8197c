// SPDX-License-Identifier: GPL-3.0-or-later
// CGAL's kernel with a faster test of a triangle against a box, for the alpha wrap.
#pragma once
#include <algorithm>
#include <cmath>

#include "padding/meshing/cgal_mesh.h"

namespace padder {

// The alpha wrap asks whether a cell of its tetrahedra meets the input, and looks for an answer in a tree of
// boxes. CGAL compares each face of the cell with each box exactly, which takes half of the time of a wrap.
// But a box only says where to look: the answer comes from the triangles in it. So here a box is passed over
// where it lies on one side of the face's plane for certain, and looked into otherwise. The wrap is the same.
struct WrapKernel : CgalKernel {
  struct Do_intersect_3 : CgalKernel::Do_intersect_3 {
    using CgalKernel::Do_intersect_3::operator();

    bool operator()(const CgalKernel::Triangle_3& triangle, const CGAL::Bbox_3& box) const {
      const CgalPoint &a = triangle.vertex(0), &b = triangle.vertex(1), &c = triangle.vertex(2);
      const Vector u(b.x() - a.x(), b.y() - a.y(), b.z() - a.z());
      const Vector v(c.x() - a.x(), c.y() - a.y(), c.z() - a.z());
      const Vector low(box.xmin() - a.x(), box.ymin() - a.y(), box.zmin() - a.z());
      const Vector high(box.xmax() - a.x(), box.ymax() - a.y(), box.zmax() - a.z());
      const Vector normal = u.cross(v);
      const Vector at_low = normal.cwiseProduct(low), at_high = normal.cwiseProduct(high);
      // Rounding is below 2e-15 times the product of the three lengths.
      const double slack = 1e-14 * u.lpNorm<1>() * v.lpNorm<1>() * (low.lpNorm<1>() + high.lpNorm<1>());
      return !(at_low.cwiseMin(at_high).sum() > slack || at_low.cwiseMax(at_high).sum() < -slack);
    }
  };
  Do_intersect_3 do_intersect_3_object() const { return {}; }
};

}  // namespace padder
