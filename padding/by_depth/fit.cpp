// SPDX-License-Identifier: MIT
#include "padding/by_depth/fit.h"

#include "padding/asset/error.h"
#include "padding/geometry/triangle.h"

namespace padder {

std::vector<FittedBall> fit(const Mesh& mesh, double depth_ratio, double sliver_limit) {
  if (!(depth_ratio > 0 && depth_ratio <= 1)) throw Error("the depth ratio must be above 0 and at most 1");
  std::vector<FittedBall> out(mesh.triangles.size());
  for (std::size_t t = 0; t < out.size(); t++) {
    const Triangle3 tri{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
    Triangle3::Circle circle{tri.circumcenter(), tri.circumradius()};
    const bool sliver = !(circle.radius <= sliver_limit);
    if (sliver) circle = tri.enclosing_circle();
    const double cap = depth_ratio * circle.radius,
                 radius = circle.radius * (1 + depth_ratio * depth_ratio) / (2 * depth_ratio);
    // Zero for a line: then the centre lies on it.
    const Vector normal = (sliver ? tri.normal_of_sliver() : tri.area_normal()).normalized();
    out[t] = {{circle.center - (radius - cap) * normal, radius}, cap, static_cast<std::uint32_t>(t)};
  }
  return out;
}

}  // namespace padder
