// SPDX-License-Identifier: MIT
#include "padding/geometry/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "padding/geometry/random.h"
#include "padding/geometry/triangle.h"

namespace padder {
namespace {

constexpr std::uint32_t kParallelSize = 4096;  // fewer triangles than these are not worth another thread

enum Feature : int { face = 0, vertex0 = 1, vertex1 = 2, vertex2 = 3, edge01 = 4, edge12 = 5, edge20 = 6 };

// A triangle is thin where the sine squared of its angle at a is below this. There, the products of four
// lengths that Ericson's test subtracts cancel: points would be off by some 1e-16 of the triangle's length
// over the sine squared, which is 1e-4 in a needle of 1e6 : 1.
constexpr double kThin = 1e-4;
// It is also thin where its area squared is below this share of the fourth power of its length: beside a
// short side the products cancel, too, and points would be off by some 1e-16 of the length over the sine.
constexpr double kNeedle = 1e-8;

// The same as closest() for a thin triangle: the point below p if that is inside, or the nearest of the
// edges. Triple products with an accurate normal keep the distance right to some 1e-16 of the length.
[[gnu::noinline]] double closest_of_thin(const Point& p, const Point& a, const Vector& ab, const Vector& ac,
                                         Point& q, int& feature) {
  const Vector bc = ac - ab, ap = p - a, bp = ap - ab, cp = ap - ac;
  const Vector n = Triangle3{Point::Zero(), ab, ac}.normal_of_sliver();
  const double nn = n.squaredNorm();
  if (nn > 0 && n.dot(ap.cross(bp)) >= 0 && n.dot(bp.cross(cp)) >= 0 && n.dot(cp.cross(ap)) >= 0) {
    const Vector down = n.dot(ap) / nn * n;
    q = p - down, feature = face;
    return down.squaredNorm();
  }
  const Point corners[] = {a, a + ab, a + ac};
  const Vector edges[] = {ab, bc, -ac}, from[] = {ap, bp, cp};
  double best = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; k++) {
    const double along = edges[k].dot(from[k]), whole = edges[k].squaredNorm();
    const bool low = !(along > 0), high = !low && along >= whole;
    const Point at = low    ? corners[k]
                     : high ? corners[(k + 1) % 3]
                            : Point(corners[k] + along / whole * edges[k]);
    const double d2 = (p - at).squaredNorm();
    if (d2 < best) best = d2, q = at, feature = low ? vertex0 + k : high ? vertex0 + (k + 1) % 3 : edge01 + k;
  }
  return best;
}

// Closest point of triangle (a, a+ab, a+ac) to p, by Voronoi region of its features (Ericson, Real-Time
// Collision Detection, 2005, section 5.1.5).
inline double closest(const Point& p, const Point& a, const Vector& ab, const Vector& ac, Point& q,
                      int& feature) {
  const Vector ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return q = a, feature = vertex0, ap.squaredNorm();
  const Vector bp = ap - ab, cp = ap - ac;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const double ab2 = d1 - d3, ac2 = d2 - d6, squares = ab2 * ac2, product = d1 - d5;  // ab . ac
  const double area2 = squares - product * product, length2 = ab2 + ac2;
  if (!(area2 > kThin * squares && area2 > kNeedle * length2 * length2))
    return closest_of_thin(p, a, ab, ac, q, feature);
  if (d3 >= 0 && d4 <= d3) return q = a + ab, feature = vertex1, bp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    q = a + d1 / (d1 - d3) * ab, feature = edge01;
    return (p - q).squaredNorm();
  }
  if (d6 >= 0 && d5 <= d6) return q = a + ac, feature = vertex2, cp.squaredNorm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    q = a + d2 / (d2 - d6) * ac, feature = edge20;
    return (p - q).squaredNorm();
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    q = a + ab + w * (ac - ab), feature = edge12;
    return (p - q).squaredNorm();
  }
  const double scale = 1 / (va + vb + vc);
  q = a + ab * (vb * scale) + ac * (vc * scale), feature = face;
  return (p - q).squaredNorm();
}

// The boxes of the parts between even steps along the longest edge.
std::vector<Box> slices(const std::array<Point, 3>& corners, int count) {
  const auto [length2, from] = TrianglePart{corners}.longest_edge();
  const Point &low = corners[from], &high = corners[(from + 1) % 3], &apex = corners[(from + 2) % 3];
  const Vector along = high - low;
  const double at_apex = length2 > 0 ? std::clamp(along.dot(apex - low) / length2, 0.0, 1.0) : 0;
  std::vector<Box> boxes(static_cast<std::size_t>(count));
  // Where the plane across the longest edge cuts that edge and the two others.
  const auto add = [&](Box& box, double at) {
    box.add(low + at * along);
    box.add(at < at_apex  ? Point(low + at / at_apex * (apex - low))
            : at_apex < 1 ? Point(high + (1 - at) / (1 - at_apex) * (apex - high))
                          : high);
  };
  for (int k = 0; k < count; k++) {
    Box& box = boxes[static_cast<std::size_t>(k)];
    const double begin = double(k) / count, end = double(k + 1) / count;
    add(box, begin), add(box, end);
    if (begin <= at_apex && at_apex <= end) box.add(apex);
  }
  boxes.front().add(low), boxes.back().add(high);  // despite rounding
  return boxes;
}

}  // namespace

Surface::Surface(const Mesh& mesh, SideBy side, std::shared_ptr<const Surface> solid)
    : mesh_(mesh), side_(side), solid_(std::move(solid)), bounds_(mesh_.bounds()), tree_(mesh_) {
  const std::size_t n = mesh_.triangles.size();
  slots_.resize(n);
#pragma omp parallel for if (n > kParallelSize)
  for (std::size_t k = 0; k < n; k++) {
    const std::uint32_t t = tree_.triangles()[k];
    const Point& a = mesh_.corner(t, 0);
    Slot& slot = slots_[k];
    slot.a = a, slot.ab = mesh_.corner(t, 1) - a, slot.ac = mesh_.corner(t, 2) - a;
  }
  cut_needles();
  if (!parts_) tree_.find_slabs(mesh_, tree_.triangles());
  find_normals();
}

// A needle that lies across the axes has a box of many times its area. The centre of a star of thousands of
// them lies in all these boxes, and a query near it would look at each triangle. So needles are cut across
// their length, and the tree has a box for each part. Each part stands for its whole triangle, so that
// distances stay those of the triangles.
void Surface::cut_needles() {
  constexpr double most_cuts = 64;
  constexpr std::size_t most_parts = 4'000'000;
  constexpr double large_box = 5;  // times the area; that of an equilateral triangle is at most 3.5
  constexpr double worth_it = 2;
  const auto boxes_of = [&](const Slot& slot) {  // the half area of its box, and how large it is
    const Vector zero = Vector::Zero();
    const Box box{zero.cwiseMin(slot.ab).cwiseMin(slot.ac), zero.cwiseMax(slot.ab).cwiseMax(slot.ac)};
    const double half = box.half_area();
    return std::array{half, half / (large_box * 0.5 * slot.ab.cross(slot.ac).norm())};
  };
  double before = 0, whole = 0, after = 0;
  for (const Slot& slot : slots_) {
    const auto [half, excess] = boxes_of(slot);
    before += half, whole += excess <= 1 ? half : 0;
  }
  if (!(before > worth_it * whole)) return;
  Mesh boxes;  // each as a triangle with two corners at one point
  std::vector<std::uint32_t> slot_of;
  const double most = std::clamp(double(most_parts) / double(slots_.size()), 1.0, most_cuts);
  for (std::uint32_t k = 0; k < slots_.size(); k++) {
    const Point& a = slots_[k].a;
    const Vector &ab = slots_[k].ab, &ac = slots_[k].ac;
    const double excess = boxes_of(slots_[k])[1];
    // The steps are rounded, and a ray must not slip through between two boxes.
    const Vector slack = 1e-15 * (a.cwiseAbs() + ab.cwiseAbs() + ac.cwiseAbs());
    const int cuts = static_cast<int>(excess < most ? std::max(1.0, std::ceil(excess)) : most);
    for (Box& box : slices({a, a + ab, a + ac}, cuts)) {
      box.low -= slack, box.high += slack;
      const auto v = static_cast<std::uint32_t>(boxes.points.size());
      boxes.points.push_back(box.low), boxes.points.push_back(box.high);
      boxes.triangles.push_back({v, v + 1, v + 1}), slot_of.push_back(k);
      after += box.half_area();
    }
  }
  if (!(before > worth_it * after)) return;
  Parts cut{TriangleTree(boxes), {}};
  std::vector<std::uint32_t> triangles;
  for (const std::uint32_t t : cut.tree.triangles())
    cut.slot.push_back(slot_of[t]), triangles.push_back(tree_.triangles()[slot_of[t]]);
  cut.tree.find_slabs(mesh_, triangles);
  parts_ = std::make_shared<const Parts>(std::move(cut));
}

// The sums run over the triangles in their order, whatever the number of threads.
void Surface::find_normals() {
  const std::size_t n = mesh_.triangles.size(), points = mesh_.points.size();
  face_normals_.resize(n);
  vertex_normals_.assign(points, Vector::Zero());
  edge_normals_.resize(n);
#pragma omp parallel for if (n > kParallelSize)
  for (std::size_t t = 0; t < n; t++) {
    face_normals_[t] = mesh_.area_normal(t).normalized();
    if (!face_normals_[t].allFinite()) face_normals_[t].setZero();
  }
  // The corners of each vertex, and the edges that start at the smaller of their two vertices, as lists.
  std::vector<std::uint32_t> corner_begin(points + 1), edge_begin(points + 1), corners(3 * n), edges(3 * n);
  for (std::uint32_t c = 0; c < 3 * n; c++) {
    const auto v = mesh_.triangles[c / 3][c % 3], w = mesh_.triangles[c / 3][(c % 3 + 1) % 3];
    corner_begin[v + 1]++, edge_begin[std::min(v, w) + 1]++;
  }
  std::partial_sum(corner_begin.begin(), corner_begin.end(), corner_begin.begin());
  std::partial_sum(edge_begin.begin(), edge_begin.end(), edge_begin.begin());
  {
    std::vector<std::uint32_t> corner_at(corner_begin), edge_at(edge_begin);
    for (std::uint32_t c = 0; c < 3 * n; c++) {
      const auto v = mesh_.triangles[c / 3][c % 3], w = mesh_.triangles[c / 3][(c % 3 + 1) % 3];
      corners[corner_at[v]++] = c, edges[edge_at[std::min(v, w)]++] = c;
    }
  }
  std::size_t open = 0;
#pragma omp parallel for schedule(dynamic, 1024) reduction(+ : open) if (n > kParallelSize)
  for (std::size_t v = 0; v < points; v++) {
    for (auto k = corner_begin[v]; k < corner_begin[v + 1]; k++) {
      const std::uint32_t t = corners[k] / 3;
      const int i = static_cast<int>(corners[k] % 3);
      const Vector e = mesh_.corner(t, (i + 1) % 3) - mesh_.corner(t, i);
      const Vector f = mesh_.corner(t, (i + 2) % 3) - mesh_.corner(t, i);
      vertex_normals_[v] += std::atan2(e.cross(f).norm(), e.dot(f)) * face_normals_[t];
    }
    vertex_normals_[v].normalize();  // a zero vector stays zero
    const auto other = [&](std::uint32_t c) {
      return std::max(mesh_.triangles[c / 3][c % 3], mesh_.triangles[c / 3][(c % 3 + 1) % 3]);
    };
    const auto begin = edges.begin() + edge_begin[v], end = edges.begin() + edge_begin[v + 1];
    std::sort(begin, end, [&](auto c, auto d) { return other(c) != other(d) ? other(c) < other(d) : c < d; });
    for (auto first = begin; first != end;) {
      auto last = first;
      Vector normal = Vector::Zero();
      int direction = 0;  // triangles that run along the edge upwards, less those that run downwards
      for (; last != end && other(*last) == other(*first); ++last) {
        normal += face_normals_[*last / 3];
        const auto from = mesh_.triangles[*last / 3][*last % 3];
        direction += other(*last) == from ? -1 : 1;
      }
      if (other(*first) == v) direction = 0;  // an edge of no length
      normal.normalize();
      for (; first != last; ++first) edge_normals_[*first / 3][*first % 3] = normal;
      open += direction != 0;
    }
  }
  open_edges_ = open;
}

Surface::Surface(const Mesh& mesh, SideBy side, std::vector<double> standoff) : Surface(mesh, side) {
  slot_standoff_.resize(slots_.size());
  for (std::size_t k = 0; k < slots_.size(); k++) slot_standoff_[k] = standoff[tree_.triangles()[k]];
  const std::vector<TriangleTree::Node>& nodes = tree_.nodes();
  node_standoff_.assign(nodes.size(), {0, 0});
  // Children stand behind their parents.
  for (std::size_t n = nodes.size(); n-- > 0;)
    for (int side_of = 0; side_of < 2; side_of++) {
      double& largest = node_standoff_[n][side_of];
      const std::uint32_t child = nodes[n].child[side_of], count = nodes[n].count[side_of];
      for (std::uint32_t k = 0; k < count; k++) largest = std::max(largest, slot_standoff_[child + k]);
      if (count == 0 && child > n) largest = std::max(node_standoff_[child][0], node_standoff_[child][1]);
    }
}

Surface::Surface(Surface triangles, std::shared_ptr<const Surface> hull) : Surface(std::move(triangles)) {
  solid_ = std::move(hull);
}

Nearest Surface::nearest(const Point& p, double limit) const {
  Nearest best;
  double limit2 = limit * limit;
  bool found = false;
  near_tree().visit_near(p, limit2, [&](std::uint32_t part) {
    Point q;
    int feature;
    const std::uint32_t k = parts_ ? parts_->slot[part] : part;
    const Slot& slot = slots_[k];
    const double d2 = closest(p, slot.a, slot.ab, slot.ac, q, feature);
    if (d2 < limit2) limit2 = d2, best.point = q, best.triangle = tree_.triangles()[k], found = true;
    return false;
  });
  if (found) best.distance = std::sqrt(limit2);
  return best;
}

Nearest Surface::clearance(const Point& p, double limit) const {
  if (hull()) return solid_->clearance(p, limit);
  if (slot_standoff_.empty() || slots_.empty()) return nearest(p, limit);
  Nearest best;
  struct Entry {
    double least;  // no triangle below has less clearance
    std::uint32_t child, count;
  };
  Entry stack[TriangleTree::kStackSize];
  int top = 0;
  stack[top++] = {-std::numeric_limits<double>::infinity(), 0, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.least >= limit) continue;
    for (std::uint32_t k = entry.child; k < entry.child + entry.count; k++) {
      const Slot& slot = slots_[k];
      Point q;
      int feature;
      const double distance = std::sqrt(closest(p, slot.a, slot.ab, slot.ac, q, feature));
      if (distance - slot_standoff_[k] >= limit) continue;
      limit = best.distance = distance - slot_standoff_[k], best.triangle = tree_.triangles()[k];
      best.point = limit > 0 ? Point(q + slot_standoff_[k] / distance * (p - q)) : p;
    }
    if (entry.count > 0) continue;
    const TriangleTree::Node& node = tree_.nodes()[entry.child];
    const std::array<double, 2>& standoff = node_standoff_[entry.child];
    const Eigen::Array2d least = node.distance2(p).sqrt() - Eigen::Array2d(standoff[0], standoff[1]);
    const int near = least[1] < least[0];
    for (const int side : {1 - near, near})
      if (least[side] < limit && !node.empty(side))
        stack[top++] = {least[side], node.child[side], node.count[side]};
  }
  return best;
}

double Surface::distance_to(std::uint32_t triangle, const Point& p) const {
  const auto& t = mesh_.triangles[triangle];
  const Point& a = mesh_.points[t[0]];
  Point q;
  int feature;
  return std::sqrt(closest(p, a, mesh_.points[t[1]] - a, mesh_.points[t[2]] - a, q, feature));
}

double Surface::certified_distance(const Point& p) const {
  const auto winding = winding_number(p);
  const bool inside = winding && *winding > 0;
  if (!hull() && !inside) return outside_of_sheet(p, nearest(p)).distance;
  if (!hull()) {
    const double depth = -clearance(p).distance;
    return sheet_ ? std::min(depth, sheet_->nearest(p).distance - half_thickness_) : depth;
  }
  const double apart = nearest(p).distance;
  return inside ? std::min(apart, -clearance(p).distance) : apart;
}

// With a hull, the direction outwards is the hull's: the triangles inside may be turned at random.
Nearest Surface::signed_nearest_in_hull(const Point& p, const Nearest& nearest) const {
  const Nearest outer = solid_->signed_nearest(p);
  Nearest best = nearest;
  best.normal = face_normals_[best.triangle];
  if (best.normal.dot(outer.normal) < 0) best.normal = -best.normal;
  if (!(outer.distance < 0)) return best;
  const Nearest clear = clearance(p);
  if (-clear.distance < best.distance) best.distance = -clear.distance, best.point = clear.point;
  best.inside = best.distance < 0;
  return best;
}

Nearest Surface::signed_nearest(const Point& p) const { return with_side(p, nearest(p)); }

Nearest Surface::with_side(const Point& p, const Nearest& nearest, bool known_inside) const {
  if (hull()) return signed_nearest_in_hull(p, nearest);
  Nearest best = nearest;
  if (!(best.distance < std::numeric_limits<double>::infinity())) return best;
  best.normal = normal_at(p, best);
  best.inside = (p - best.point).dot(best.normal) < 0;
  if (side_ == SideBy::winding && best.distance > 0) {
    if (known_inside && closed())
      best.inside = true;
    else if (const auto winding = winding_number(p))
      best.inside = *winding > 0;
  }
  if (best.inside)
    best.distance = -best.distance;
  else
    best = outside_of_sheet(p, best);
  return best;
}

Vector Surface::normal_at(const Point& p, const Nearest& nearest) const {
  const auto& t = mesh_.triangles[nearest.triangle];
  const Point& a = mesh_.points[t[0]];
  Point q;
  int feature;
  closest(p, a, mesh_.points[t[1]] - a, mesh_.points[t[2]] - a, q, feature);
  if (feature == face) return face_normals_[nearest.triangle];
  if (feature <= vertex2) return vertex_normals_[t[feature - vertex0]];
  return edge_normals_[nearest.triangle][feature - edge01];
}

void Surface::set_sheet(std::size_t first, double thickness) {
  first_sheet_ = first, half_thickness_ = 0.5 * thickness;
  sheet_.reset();
  if (!(half_thickness_ > 0) || first == 0 || first >= mesh_.triangles.size()) return;
  Mesh sheet;
  for (std::size_t t = first; t < mesh_.triangles.size(); t++) sheet.add(mesh_.corners(t));
  sheet_ = std::make_shared<const Surface>(sheet);
}

// For a point that nothing bounds, its nearest triangle: how far it is from the body, half of whose thickness
// is taken off the distance to a sheet. A sheet may so be nearer than a nearer triangle of a solid.
Nearest Surface::outside_of_sheet(const Point& p, const Nearest& nearest) const {
  Nearest best = nearest;
  best.distance -= half_thickness(nearest.triangle);
  if (!sheet_ || nearest.triangle >= first_sheet_) return best;
  Nearest other = sheet_->nearest(p, nearest.distance + half_thickness_);
  if (!std::isfinite(other.distance)) return best;
  other.distance -= half_thickness_, other.triangle += static_cast<std::uint32_t>(first_sheet_);
  other.normal = normal_at(p, other);
  return other;
}

std::optional<int> Surface::winding_number(const Point& p) const {
  if (hull()) return solid_->winding_number(p);
  if (solid_) return winding_in_solid(p);
  if (!closed()) return std::nullopt;
  if ((p.array() < bounds_.low.array()).any() || (p.array() > bounds_.high.array()).any()) return 0;
  // Directions without a pattern, so that no mesh has faces along them. A ray that grazes an edge gives no
  // result; this hardly ever happens to the next ray, too. For a point on the surface all of them fail.
  if (const auto sum = crossings(p, *shortest_ray(p, Vector::Zero()))) return sum;
  for (const Vector& d : ray_directions())
    if (const auto sum = crossings(p, d)) return sum;
  return std::nullopt;
}

std::optional<Vector> Surface::shortest_ray(const Point& p, const Vector& n) const {
  constexpr std::size_t tried = 6;  // more cost more than they save
  std::optional<Vector> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 2 * tried; k++) {
    const Vector d = k % 2 == 0 ? ray_directions()[k / 2] : Vector(-ray_directions()[k / 2]);
    if (d.dot(n) < kGrazing * n.norm()) continue;
    double steps = std::numeric_limits<double>::infinity();  // of d, until it leaves the bounds
    for (int axis = 0; axis < 3; axis++)
      steps = std::min(steps, ((d[axis] > 0 ? bounds_.high : bounds_.low)[axis] - p[axis]) / d[axis]);
    if (steps * d.norm() < least) least = steps * d.norm(), best = d;
  }
  return best;
}

namespace {

// How a ray crosses a triangle: +1 where it leaves through the front, -1 where it enters, 0 where it misses,
// and nothing where a sign is smaller than its rounding error. Corners are relative to the ray's origin, and
// each component of d is at most 1. The error: the differences a, b, c are off by 2^-53 of themselves, so
// each of the 6 products below is off by less than 12 times that.
std::optional<int> crossing(const Vector& d, const Vector& a, const Vector& b, const Vector& c) {
  constexpr double error = 72 * 0x1p-53;
  const double size_a = a.cwiseAbs().maxCoeff(), size_b = b.cwiseAbs().maxCoeff(),
               size_c = c.cwiseAbs().maxCoeff();
  const auto sign = [](double value, double bound) { return value > bound ? 1 : value < -bound ? -1 : 0; };
  const int ab = sign(d.dot(a.cross(b)), error * size_a * size_b),
            bc = sign(d.dot(b.cross(c)), error * size_b * size_c),
            ca = sign(d.dot(c.cross(a)), error * size_c * size_a);
  if (std::min({ab, bc, ca}) < 0 && std::max({ab, bc, ca}) > 0) return 0;  // the line passes beside it
  if (ab == 0 || bc == 0 || ca == 0) return std::nullopt;
  const int ahead = sign(a.dot(b.cross(c)), error * size_a * size_b * size_c);
  if (ahead == 0) return std::nullopt;
  return ahead == ab ? ab : 0;
}

// Does the ray meet the box? The range is widened by more than the rounding error, so a hit is never missed.
bool meets(const TriangleTree::Node& node, int side, const Point& p, const Vector& inverse) {
  if (node.empty(side)) return false;
  double from = 0, to = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; k++) {
    const double s = (node.low[k][side] - p[k]) * inverse[k], t = (node.high[k][side] - p[k]) * inverse[k];
    from = std::max(from, std::min(s, t)), to = std::min(to, std::max(s, t));
  }
  return from * (1 - 1e-14) <= to * (1 + 1e-14);
}

}  // namespace

// A point on a wall inside the body has no winding number. All points nearer to it than `mesh` is lie on the
// same side of the body's boundary.
std::optional<int> Surface::winding_in_solid(const Point& p) const {
  if (solid_->slots_.empty()) return 0;
  if (const auto winding = solid_->winding_number(p)) return winding;
  const double apart = nearest(p).distance;
  if (!(apart > 0) || !std::isfinite(apart)) return std::nullopt;
  for (const Vector& d : ray_directions())
    if (const auto winding = solid_->winding_number(p + 0.5 * apart * d)) return winding;
  return std::nullopt;
}

const std::vector<Vector>& Surface::ray_directions() {
  static const std::vector<Vector> directions = [] {
    std::vector<Vector> all;
    Random random(7);
    while (all.size() < 16) {
      const Vector d(2 * random.uniform() - 1, 2 * random.uniform() - 1, 2 * random.uniform() - 1);
      if (d.cwiseAbs().minCoeff() > 0.1) all.push_back(d);
    }
    return all;
  }();
  return directions;
}

std::optional<int> Surface::crossings(const Point& p, const Vector& direction,
                                      const std::function<bool(std::uint32_t)>& skip,
                                      const std::function<void(std::uint32_t, int)>& visit) const {
  if (slots_.empty()) return 0;
  const Vector inverse = direction.cwiseInverse();
  const TriangleTree& tree = near_tree();
  std::vector<std::uint32_t> crossed;  // the ray may meet the boxes of two parts of one triangle
  std::uint32_t stack[TriangleTree::kStackSize];
  int top = 0, sum = 0;
  stack[top++] = 0;
  while (top > 0) {
    const TriangleTree::Node& node = tree.nodes()[stack[--top]];
    for (int side = 0; side < 2; side++) {
      if (!meets(node, side, p, inverse)) continue;
      if (node.count[side] == 0) stack[top++] = node.child[side];
      for (std::uint32_t k = 0; k < node.count[side]; k++) {
        const std::uint32_t triangle = triangle_at(node.child[side] + k);
        if (skip && skip(triangle)) continue;
        const auto& t = mesh_.triangles[triangle];
        const auto one =
            crossing(direction, mesh_.points[t[0]] - p, mesh_.points[t[1]] - p, mesh_.points[t[2]] - p);
        if (!one) return std::nullopt;
        if (parts_ && *one != 0) {
          if (std::find(crossed.begin(), crossed.end(), triangle) != crossed.end()) continue;
          crossed.push_back(triangle);
        }
        sum += *one;
        if (visit && *one != 0) visit(triangle, *one);
      }
    }
  }
  return sum;
}

bool Surface::any_within(const Point& p, double limit) const {
  if (limit <= 0) return false;
  double limit2 = limit * limit;
  bool found = false;
  near_tree().visit_near(p, limit2, [&](std::uint32_t part) {
    Point q;
    int feature;
    const Slot& slot = slots_[parts_ ? parts_->slot[part] : part];
    return found = closest(p, slot.a, slot.ab, slot.ac, q, feature) < limit2;
  });
  return found;
}

}  // namespace padder
