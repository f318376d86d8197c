// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/wrap_kernel.h"

#include "tests/padding/random_input.h"

namespace padder {
namespace {

using Triangle = CgalKernel::Triangle_3;

const CgalKernel::Do_intersect_3 by_cgal = CgalKernel().do_intersect_3_object();
const WrapKernel::Do_intersect_3 by_plane = WrapKernel().do_intersect_3_object();

CGAL::Bbox_3 box_at(const Point& low, const Point& size) {
  const Point high = low + size;
  return {low.x(), low.y(), low.z(), high.x(), high.y(), high.z()};
}

TEST(WrapKernel, NoBoxIsPassedOverThatTheTriangleMeets) {
  shapes::RandomInput random(91);
  int met = 0;
  for (int k = 0; k < 100'000; k++) {
    const double size = std::pow(10, random.uniform(-6, 0)), needle = std::pow(10, random.uniform(-12, 0));
    const Point away = k % 3 == 0 ? random.point(1e3) : random.point(1);
    const Vector along = random.direction();
    const Point a = away, b = away + size * along,
                c = a + random.uniform(0, 1) * (b - a) + needle * size * random.direction();
    const Triangle triangle(to_cgal(a), to_cgal(b), to_cgal(c));
    // Corners of the box lie on the triangle, but for rounding.
    const Point on = a + random.uniform(0, 0.5) * (b - a) + random.uniform(0, 0.5) * (c - a);
    const Point extent = size * std::pow(10, random.uniform(-9, 0)) * (random.point(1).cwiseAbs());
    const Point low = on - extent.cwiseProduct(Point(k & 1, k >> 1 & 1, k >> 2 & 1));
    const CGAL::Bbox_3 box = box_at(low, extent);
    if (!by_cgal(triangle, box)) continue;
    met++;
    ASSERT_TRUE(by_plane(triangle, box)) << "try " << k;
  }
  EXPECT_GT(met, 50'000);
}

TEST(WrapKernel, ABoxOnOneSideOfThePlaneIsPassedOver) {
  const Triangle triangle({0, 0, 0}, {1, 0, 0.5}, {0, 1, 0.25});
  const Vector up = Vector(-0.5, -0.25, 1).normalized();
  for (const double side : {-1, 1}) {
    const Point low = Point(0.3, 0.3, 0.225) + side * 1e-6 * up;
    const Point size(-1e-3 * side, -1e-3 * side, 1e-3 * side);
    const CGAL::Bbox_3 box = box_at(low, Point::Zero()) + box_at(low + size, Point::Zero());
    EXPECT_FALSE(by_cgal(triangle, box));
    EXPECT_FALSE(by_plane(triangle, box));
  }
}

}  // namespace
}  // namespace padder
