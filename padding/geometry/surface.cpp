// SPDX-License-Identifier: MIT
#include "padding/geometry/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <numeric>

#include "padding/geometry/random.h"
#include "padding/geometry/triangle.h"

namespace padder {
namespace {

constexpr std::uint32_t leaf_triangles = 4;
constexpr std::uint32_t parallel_size = 4096;  // fewer triangles than these are not worth another thread
constexpr int triangle_stack = 128;            // depth is bounded by the median fallback in build()

enum Feature : int { face = 0, vertex0 = 1, vertex1 = 2, vertex2 = 3, edge01 = 4, edge12 = 5, edge20 = 6 };

// A triangle is thin where the sine squared of its angle at a is below this. There, the products of four
// lengths that Ericson's test subtracts cancel: points would be off by some 1e-16 of the triangle's length
// over the sine squared, which is 1e-4 in a needle of 1e6 : 1.
constexpr double kThin = 1e-4;

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
  const double squares = (d1 - d3) * (d2 - d6), product = d1 - d5;  // of the lengths of ab and ac; ab . ac
  if (!(squares - product * product > kThin * squares)) return closest_of_thin(p, a, ab, ac, q, feature);
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

inline double box_distance2(const double* low, const double* high, const Point& p) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    const double d = std::max({low[k] - p[k], 0.0, p[k] - high[k]});
    sum += d * d;
  }
  return sum;
}

double half_area(const Box& b) {
  if (b.empty()) return 0;
  const Vector e = b.high - b.low;
  return e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
}

}  // namespace

Surface::Surface(const Mesh& mesh, SideBy side, std::shared_ptr<const Surface> solid)
    : mesh_(mesh), side_(side), solid_(std::move(solid)) {
  const std::size_t n = mesh_.triangles.size();
  bounds_ = mesh_.bounds();
  std::vector<Box> boxes(n);
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
#pragma omp parallel for if (n > parallel_size)
  for (std::size_t t = 0; t < n; t++)
    for (int k = 0; k < 3; k++) boxes[t].add(mesh_.corner(t, k));
  if (n > 0) {
    if (n <= leaf_triangles) {  // one leaf: a root whose second child is empty
      Node root{};
      for (int k = 0; k < 3; k++) {
        root.low[0][k] = bounds_.low[k], root.high[0][k] = bounds_.high[k];
        root.low[1][k] = std::numeric_limits<double>::infinity(), root.high[1][k] = -root.low[1][k];
      }
      root.count[0] = static_cast<std::uint32_t>(n);
      nodes_.push_back(root);
    } else {
#pragma omp parallel if (n > parallel_size)
#pragma omp single
      build(nodes_, order, boxes, 0, static_cast<std::uint32_t>(n));
    }
  }
  slots_.resize(n);
#pragma omp parallel for if (n > parallel_size)
  for (std::size_t k = 0; k < n; k++) {
    const Point& a = mesh_.corner(order[k], 0);
    slots_[k] = {a, mesh_.corner(order[k], 1) - a, mesh_.corner(order[k], 2) - a, order[k]};
  }
  find_normals();
}

// The sums run over the triangles in their order, whatever the number of threads.
void Surface::find_normals() {
  const std::size_t n = mesh_.triangles.size(), points = mesh_.points.size();
  face_normals_.resize(n);
  vertex_normals_.assign(points, Vector::Zero());
  edge_normals_.resize(n);
#pragma omp parallel for if (n > parallel_size)
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
#pragma omp parallel for schedule(dynamic, 1024) reduction(+ : open) if (n > parallel_size)
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
  for (std::size_t k = 0; k < slots_.size(); k++) slot_standoff_[k] = standoff[slots_[k].triangle];
  node_standoff_.assign(nodes_.size(), {0, 0});
  // Children stand behind their parents.
  for (std::size_t n = nodes_.size(); n-- > 0;)
    for (int side_of = 0; side_of < 2; side_of++) {
      double& largest = node_standoff_[n][side_of];
      const std::uint32_t child = nodes_[n].child[side_of], count = nodes_[n].count[side_of];
      for (std::uint32_t k = 0; k < count; k++) largest = std::max(largest, slot_standoff_[child + k]);
      if (count == 0 && child > n) largest = std::max(node_standoff_[child][0], node_standoff_[child][1]);
    }
}

Surface::Surface(Surface triangles, std::shared_ptr<const Surface> hull) : Surface(std::move(triangles)) {
  solid_ = std::move(hull);
}

// Binned surface-area heuristic; returns the node's index.
std::uint32_t Surface::build(std::vector<Node>& nodes, std::vector<std::uint32_t>& order,
                             const std::vector<Box>& boxes, std::uint32_t begin, std::uint32_t end) {
  constexpr int bins = 16;
  Box centers;
  for (auto k = begin; k < end; k++) centers.add(boxes[order[k]].center());
  int axis;
  const double width = (centers.high - centers.low).maxCoeff(&axis);
  std::uint32_t middle = begin;
  if (width > 0) {
    std::array<Box, bins> box;
    std::array<std::uint32_t, bins> count{};
    const auto bin_of = [&](std::uint32_t t) {
      const double x = (boxes[t].center()[axis] - centers.low[axis]) / width * bins;
      return std::clamp(static_cast<int>(x), 0, bins - 1);
    };
    for (auto k = begin; k < end; k++) {
      const int b = bin_of(order[k]);
      count[b]++, box[b].add(boxes[order[k]].low), box[b].add(boxes[order[k]].high);
    }
    std::array<double, bins> right{};  // cost of bins b and above
    Box sweep;
    std::uint32_t total = 0;
    for (int b = bins - 1; b > 0; b--) {
      if (count[b]) sweep.add(box[b].low), sweep.add(box[b].high);
      total += count[b], right[b] = half_area(sweep) * total;
    }
    sweep = Box(), total = 0;
    double best = std::numeric_limits<double>::infinity();
    int split = 0;
    for (int b = 1; b < bins; b++) {
      if (count[b - 1]) sweep.add(box[b - 1].low), sweep.add(box[b - 1].high);
      total += count[b - 1];
      const double cost = half_area(sweep) * total + right[b];
      if (cost < best && total > 0 && total < end - begin) best = cost, split = b;
    }
    if (split > 0)
      middle = static_cast<std::uint32_t>(std::partition(order.begin() + begin, order.begin() + end,
                                                         [&](auto t) { return bin_of(t) < split; }) -
                                          order.begin());
  }
  // Uneven splits could make the tree as deep as there are triangles: below 1/32 the median splits instead.
  const std::uint32_t smaller = std::min(middle - begin, end - middle);
  if (smaller == 0 || (end - begin > 4 * leaf_triangles && smaller < (end - begin) / 32)) {
    middle = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end, [&](auto s, auto t) {
      const double x = boxes[s].center()[axis], y = boxes[t].center()[axis];
      return x != y ? x < y : s < t;
    });
  }
  const auto index = static_cast<std::uint32_t>(nodes.size());
  nodes.emplace_back();
  const std::uint32_t from[2] = {begin, middle}, to[2] = {middle, end};
  // The halves of a large node are built side by side, each into nodes of its own that are then appended.
  const bool apart = end - begin > parallel_size;
  std::vector<Node> own[2];
  const auto build_side = [&](int side) {
    Box box;
    for (auto k = from[side]; k < to[side]; k++) box.add(boxes[order[k]].low), box.add(boxes[order[k]].high);
    std::uint32_t child = from[side], count = to[side] - from[side];
    if (count > leaf_triangles)
      child = build(apart ? own[side] : nodes, order, boxes, from[side], to[side]), count = 0;
    Node& node = nodes[index];
    for (int k = 0; k < 3; k++) node.low[side][k] = box.low[k], node.high[side][k] = box.high[k];
    node.child[side] = child, node.count[side] = count;
  };
  if (!apart) return build_side(0), build_side(1), index;
#pragma omp task shared(build_side)
  build_side(0);
  build_side(1);
#pragma omp taskwait
  for (int side = 0; side < 2; side++) {
    const auto offset = static_cast<std::uint32_t>(nodes.size());
    for (Node& node : own[side]) {
      for (int k = 0; k < 2; k++) node.child[k] += node.count[k] == 0 ? offset : 0;
      nodes.push_back(node);
    }
    if (nodes[index].count[side] == 0) nodes[index].child[side] += offset;
  }
  return index;
}

// Visits leaves nearest first; `visit(slot)` may shrink `limit2` and returns true to stop.
template <class Visit>
static void traverse(const auto& nodes, const Point& p, double& limit2, Visit&& visit) {
  if (nodes.empty()) return;
  struct Entry {
    double distance2;
    std::uint32_t child, count;
  };
  Entry stack[triangle_stack];
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
    const auto& node = nodes[entry.child];
    const double d0 = box_distance2(node.low[0], node.high[0], p),
                 d1 = box_distance2(node.low[1], node.high[1], p);
    const int near = d1 < d0;
    const double near2 = near ? d1 : d0, far2 = near ? d0 : d1;
    if (far2 < limit2) stack[top++] = {far2, node.child[1 - near], node.count[1 - near]};
    if (near2 < limit2) stack[top++] = {near2, node.child[near], node.count[near]};
  }
}

Nearest Surface::nearest(const Point& p, double limit) const {
  Nearest best;
  double limit2 = limit * limit;
  bool found = false;
  traverse(nodes_, p, limit2, [&](std::uint32_t k) {
    Point q;
    int feature;
    const Slot& slot = slots_[k];
    const double d2 = closest(p, slot.a, slot.ab, slot.ac, q, feature);
    if (d2 < limit2) limit2 = d2, best.point = q, best.triangle = slot.triangle, found = true;
    return false;
  });
  if (found) best.distance = std::sqrt(limit2);
  return best;
}

Nearest Surface::clearance(const Point& p, double limit) const {
  if (hull()) return solid_->clearance(p, limit);
  if (slot_standoff_.empty() || nodes_.empty()) return nearest(p, limit);
  Nearest best;
  struct Entry {
    double least;  // no triangle below has less clearance
    std::uint32_t child, count;
  };
  Entry stack[triangle_stack];
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
      limit = best.distance = distance - slot_standoff_[k], best.triangle = slot.triangle;
      best.point = limit > 0 ? Point(q + slot_standoff_[k] / distance * (p - q)) : p;
    }
    if (entry.count > 0) continue;
    const Node& node = nodes_[entry.child];
    double least[2];
    for (int side = 0; side < 2; side++)
      least[side] =
          std::sqrt(box_distance2(node.low[side], node.high[side], p)) - node_standoff_[entry.child][side];
    const int near = least[1] < least[0];
    for (const int side : {1 - near, near})
      if (least[side] < limit && node.low[side][0] <= node.high[side][0])
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
  if (!hull() && inside) return -clearance(p).distance;
  if (!hull()) {
    const Nearest at = nearest(p);
    return at.distance - half_thickness(at.triangle);
  }
  const double apart = nearest(p).distance;
  return inside ? std::min(apart, -clearance(p).distance) : apart;
}

// With a hull, the direction outwards is the hull's: the triangles inside may be turned at random.
Nearest Surface::signed_nearest_in_hull(const Point& p) const {
  const Nearest outer = solid_->signed_nearest(p);
  Nearest best = nearest(p);
  best.normal = face_normals_[best.triangle];
  if (best.normal.dot(outer.normal) < 0) best.normal = -best.normal;
  if (!(outer.distance < 0)) return best;
  const Nearest clear = clearance(p);
  if (-clear.distance < best.distance) best.distance = -clear.distance, best.point = clear.point;
  return best;
}

Nearest Surface::signed_nearest(const Point& p) const {
  if (hull()) return signed_nearest_in_hull(p);
  Nearest best = nearest(p);
  if (!(best.distance < std::numeric_limits<double>::infinity())) return best;
  const auto& t = mesh_.triangles[best.triangle];
  const Point& a = mesh_.points[t[0]];
  Point q;
  int feature;
  closest(p, a, mesh_.points[t[1]] - a, mesh_.points[t[2]] - a, q, feature);
  if (feature == face)
    best.normal = face_normals_[best.triangle];
  else if (feature <= vertex2)
    best.normal = vertex_normals_[t[feature - vertex0]];
  else
    best.normal = edge_normals_[best.triangle][feature - edge01];
  bool inside = (p - best.point).dot(best.normal) < 0;
  if (side_ == SideBy::winding && best.distance > 0)
    if (const auto winding = winding_number(p)) inside = *winding > 0;
  best.distance = inside ? -best.distance : best.distance - half_thickness(best.triangle);
  return best;
}

std::optional<int> Surface::winding_number(const Point& p) const {
  if (hull()) return solid_->winding_number(p);
  if (solid_) return winding_in_solid(p);
  if (!closed()) return std::nullopt;
  if ((p.array() < bounds_.low.array()).any() || (p.array() > bounds_.high.array()).any()) return 0;
  // Directions without a pattern, so that no mesh has faces along them. A ray that grazes an edge gives no
  // result; this hardly ever happens to the next ray, too. For a point on the surface all of them fail.
  for (const Vector& d : ray_directions())
    if (const auto sum = crossings(p, d)) return sum;
  return std::nullopt;
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
bool meets(const double* low, const double* high, const Point& p, const Vector& inverse) {
  if (low[0] > high[0]) return false;  // the empty child of a root with a single leaf
  double from = 0, to = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; k++) {
    const double s = (low[k] - p[k]) * inverse[k], t = (high[k] - p[k]) * inverse[k];
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
                                      const std::function<bool(std::uint32_t)>& skip) const {
  if (nodes_.empty()) return 0;
  const Vector inverse = direction.cwiseInverse();
  std::uint32_t stack[triangle_stack];
  int top = 0, sum = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = nodes_[stack[--top]];
    for (int side = 0; side < 2; side++) {
      if (!meets(node.low[side], node.high[side], p, inverse)) continue;
      if (node.count[side] == 0) stack[top++] = node.child[side];
      for (std::uint32_t k = 0; k < node.count[side]; k++) {
        const std::uint32_t triangle = slots_[node.child[side] + k].triangle;
        if (skip && skip(triangle)) continue;
        const auto& t = mesh_.triangles[triangle];
        const auto one =
            crossing(direction, mesh_.points[t[0]] - p, mesh_.points[t[1]] - p, mesh_.points[t[2]] - p);
        if (!one) return std::nullopt;
        sum += *one;
      }
    }
  }
  return sum;
}

void Surface::visit(const Box& box, const std::function<void(std::uint32_t)>& visit) const {
  if (nodes_.empty()) return;
  std::uint32_t stack[triangle_stack];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = nodes_[stack[--top]];
    for (int side = 0; side < 2; side++) {
      bool apart = node.low[side][0] > node.high[side][0];  // the empty child of a root with a single leaf
      for (int k = 0; k < 3; k++) apart |= node.low[side][k] > box.high[k] || node.high[side][k] < box.low[k];
      if (apart) continue;
      if (node.count[side] == 0) stack[top++] = node.child[side];
      for (std::uint32_t k = 0; k < node.count[side]; k++) visit(slots_[node.child[side] + k].triangle);
    }
  }
}

// A work item is two parts of the tree whose boxes touch, or twice the same part. A part is a child of a
// node.
class Surface::PairWalk {
 public:
  using Visit = std::function<bool(std::uint32_t, std::uint32_t)>;
  PairWalk(const Surface& surface, const Visit& visit)
      : mesh_(surface.mesh_), nodes_(surface.nodes_), slots_(surface.slots_), visit_(visit) {}

  void run() {
    std::vector<Item> items, next;
    push_node(0, items);
    constexpr std::size_t enough = 4096;  // for even work on all threads
    for (int level = 0; level < triangle_stack && !items.empty() && items.size() < enough; level++) {
      next.clear();
      for (const Item& item : items) step(item, next);
      items.swap(next);
    }
#pragma omp parallel
    {
      std::vector<Item> stack;
#pragma omp for schedule(dynamic, 8)
      for (std::size_t k = 0; k < items.size(); k++) {
        stack.push_back(items[k]);
        while (!stack.empty()) {
          const Item item = stack.back();
          stack.pop_back();
          step(item, stack);
        }
      }
    }
  }

 private:
  struct Part {
    std::uint32_t node, side;
    bool operator==(const Part&) const = default;
  };
  struct Item {
    Part a, b;
  };

  std::uint32_t count(Part p) const { return nodes_[p.node].count[p.side]; }
  Part child(Part p, std::uint32_t side) const { return {nodes_[p.node].child[p.side], side}; }
  const double* low(Part p) const { return nodes_[p.node].low[p.side]; }
  const double* high(Part p) const { return nodes_[p.node].high[p.side]; }

  static bool touch(const double* low_a, const double* high_a, const double* low_b, const double* high_b) {
    bool apart = false;
    for (int k = 0; k < 3; k++) apart |= low_a[k] > high_b[k] || high_a[k] < low_b[k];
    return !apart;
  }

  void push_node(std::uint32_t node, std::vector<Item>& items) const {
    const Part a{node, 0}, b{node, 1};
    items.push_back({a, a});
    if (low(b)[0] > high(b)[0]) return;  // the empty child of a root with a single leaf
    items.push_back({b, b});
    if (touch(low(a), high(a), low(b), high(b))) items.push_back({a, b});
  }

  double size(Part p) const {
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += high(p)[k] - low(p)[k];
    return sum;
  }

  void step(const Item& item, std::vector<Item>& items) {
    if (stop_.load(std::memory_order_relaxed)) return;
    const auto [a, b] = item;
    if (a == b && count(a) == 0) return push_node(nodes_[a.node].child[a.side], items);
    if (count(a) > 0 && count(b) > 0) return compare(a, b);
    const bool cut_a = count(b) > 0 || (count(a) == 0 && size(a) >= size(b));
    const Part whole = cut_a ? b : a;
    for (const std::uint32_t side : {0u, 1u}) {
      const Part half = child(cut_a ? a : b, side);
      if (touch(low(half), high(half), low(whole), high(whole))) items.push_back({half, whole});
    }
  }

  // The triangles of a leaf whose boxes touch that of the other leaf.
  struct Leaf {
    std::array<std::uint32_t, leaf_triangles> triangle;
    std::array<std::array<double, 3>, leaf_triangles> low, high;
    std::size_t count = 0;
  };
  Leaf leaf(Part p, Part other) const {
    Leaf out;
    const std::uint32_t first = nodes_[p.node].child[p.side];
    for (std::uint32_t k = first; k < first + count(p); k++) {
      const std::uint32_t t = slots_[k].triangle;
      auto &l = out.low[out.count], &h = out.high[out.count];
      for (int axis = 0; axis < 3; axis++) {
        const auto [least, most] =
            std::minmax({mesh_.corner(t, 0)[axis], mesh_.corner(t, 1)[axis], mesh_.corner(t, 2)[axis]});
        l[axis] = least, h[axis] = most;
      }
      if (touch(l.data(), h.data(), low(other), high(other))) out.triangle[out.count++] = t;
    }
    return out;
  }

  void compare(Part a, Part b) {
    const Leaf s = leaf(a, b), t = a == b ? s : leaf(b, a);
    for (std::size_t i = 0; i < s.count; i++)
      for (std::size_t j = a == b ? i + 1 : 0; j < t.count; j++) {
        if (!touch(s.low[i].data(), s.high[i].data(), t.low[j].data(), t.high[j].data())) continue;
        const auto [first, second] = std::minmax(s.triangle[i], t.triangle[j]);
        if (visit_(first, second)) stop_ = true;
      }
  }

  const Mesh& mesh_;
  const std::vector<Node>& nodes_;
  const std::vector<Slot>& slots_;
  const Visit& visit_;
  std::atomic<bool> stop_ = false;
};

void Surface::visit_pairs(const std::function<bool(std::uint32_t, std::uint32_t)>& visit) const {
  if (!nodes_.empty()) PairWalk(*this, visit).run();
}

bool Surface::any_within(const Point& p, double limit) const {
  double limit2 = limit * limit;
  bool found = false;
  traverse(nodes_, p, limit2, [&](std::uint32_t k) {
    Point q;
    int feature;
    const Slot& slot = slots_[k];
    return found = closest(p, slot.a, slot.ab, slot.ac, q, feature) < limit2;
  });
  return found;
}

}  // namespace padder
