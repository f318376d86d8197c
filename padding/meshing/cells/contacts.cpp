// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cells/contacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <mutex>
#include <numeric>
#include <optional>

#include "padding/meshing/cgal_mesh.h"
#include "padding/meshing/pieces.h"

namespace padder {
namespace {

int axis_across(const Mesh& mesh, std::uint32_t t) {
  int axis;
  mesh.area_normal(t).cwiseAbs().maxCoeff(&axis);
  return axis;
}

// The exact predicates, on the points of a mesh.
class Signs {
 public:
  explicit Signs(const Mesh& mesh) : mesh_(mesh) {}
  const Mesh& mesh() const { return mesh_; }

  // Is d above the plane through a, b, c (1), below (-1) or in it (0)?
  int side(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const {
    return static_cast<int>(CGAL::orientation(at(a), at(b), at(c), at(d)));
  }
  // How a, b, c turn where `drop` is left out of their coordinates, which rounds nothing.
  int turn(int drop, std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return static_cast<int>(CGAL::orientation(flat(drop, a), flat(drop, b), flat(drop, c)));
  }
  // Where is v, a point in the plane of t: the place as in MeetingPoint, or -1 outside?
  int place(std::uint32_t t, int drop, std::uint32_t v) const {
    const Corners& c = mesh_.triangles[t];
    for (int k = 0; k < 3; k++)
      if (c[k] == v) return k;
    int low = 1, high = -1, edge = -1;
    for (int k = 0; k < 3; k++) {
      const int s = turn(drop, c[k], c[(k + 1) % 3], v);
      low = std::min(low, s), high = std::max(high, s);
      if (s == 0) edge = 3 + k;
    }
    return low < 0 && high > 0 ? -1 : edge < 0 ? 6 : edge;
  }

 private:
  CgalPoint at(std::uint32_t v) const { return to_cgal(mesh_.points[v]); }
  CgalKernel::Point_2 flat(int drop, std::uint32_t v) const {
    const Point& p = mesh_.points[v];
    return {p[(drop + 1) % 3], p[(drop + 2) % 3]};
  }
  const Mesh& mesh_;
};

// Compares one pair after another and collects what it finds.
class PairTest {
 public:
  explicit PairTest(const Mesh& mesh) : signs_(mesh), mesh_(mesh) {}

  // Returns whether the triangles meet. Then their cuts are in `found`.
  bool meet(std::uint32_t s, std::uint32_t t, Contacts& found) const {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    int shared = 0;
    for (const auto v : b) shared += std::count(a.begin(), a.end(), v) > 0;
    std::array<int, 3> above_s, above_t;
    if (!straddles(a, b, above_s)) return false;
    if (above_s == std::array{0, 0, 0}) return overlap(s, t, found);
    if (shared >= 2) return false;
    if (!straddles(b, a, above_t)) return false;
    std::vector<std::array<MeetingPoint, 2>> points;  // of each the place in s and in t
    add_corners(s, t, above_t, false, points), add_corners(t, s, above_s, true, points);
    add_crossings(s, t, above_t, false, points), add_crossings(t, s, above_s, true, points);
    const auto is_shared = [](const auto& p) { return p[0].is_vertex() && p[0].place < 3 && p[1].place < 3; };
    if (std::all_of(points.begin(), points.end(), is_shared)) return false;
    found.cuts.push_back({s, {points.front()[0], points.back()[0]}});
    found.cuts.push_back({t, {points.front()[1], points.back()[1]}});
    return true;
  }

 private:
  using Points = std::vector<std::array<MeetingPoint, 2>>;

  // On which side of triangle a lie the corners of b? False if all that a does not share lie strictly on one
  // side: then b has no more than these in the plane of a.
  bool straddles(const Corners& a, const Corners& b, std::array<int, 3>& side) const {
    int low = 2, high = -2;
    for (int k = 0; k < 3; k++) {
      side[k] = 0;
      if (std::count(a.begin(), a.end(), b[k]) > 0) continue;
      side[k] = signs_.side(a[0], a[1], a[2], b[k]);
      low = std::min(low, side[k]), high = std::max(high, side[k]);
    }
    return low > 1 || (low <= 0 && high >= 0);
  }

  static void add(Points& points, MeetingPoint point, int place_own, int place_other, bool swapped) {
    std::array<MeetingPoint, 2> both = {point, point};
    both[swapped].place = place_own, both[!swapped].place = place_other;
    for (const auto& p : points)
      if (p[0].same(point)) return;
    points.push_back(both);
  }

  // The corners of `own` that lie in `other`.
  void add_corners(std::uint32_t own, std::uint32_t other, const std::array<int, 3>& above, bool swapped,
                   Points& points) const {
    const int drop = axis_across(mesh_, other);
    for (int k = 0; k < 3; k++) {
      if (above[k] != 0) continue;
      const auto v = mesh_.triangles[own][k];
      const int place = signs_.place(other, drop, v);
      if (place >= 0) add(points, {v, MeetingPoint::kNoOther}, k, place, swapped);
    }
  }

  // The inner points of edges of `own` that lie in `other`, but for its corners.
  void add_crossings(std::uint32_t own, std::uint32_t other, const std::array<int, 3>& above, bool swapped,
                     Points& points) const {
    const Corners &c = mesh_.triangles[own], &o = mesh_.triangles[other];
    for (int k = 0; k < 3; k++) {
      if (above[k] * above[(k + 1) % 3] >= 0) continue;
      const auto u = c[k], v = c[(k + 1) % 3];
      int low = 1, high = -1, zeros = 0, edge = 0;
      for (int i = 0; i < 3; i++) {
        const int s = signs_.side(u, v, o[i], o[(i + 1) % 3]);
        low = std::min(low, s), high = std::max(high, s);
        if (s == 0) zeros++, edge = i;
      }
      if ((low < 0 && high > 0) || zeros > 1) continue;
      const std::uint64_t e = edge_of(u, v), f = edge_of(o[edge], o[(edge + 1) % 3]);
      if (zeros == 0)
        add(points, {e, MeetingPoint::kTriangle + other}, 3 + k, 6, swapped);
      else
        add(points, {std::min(e, f), std::max(e, f)}, 3 + k, 3 + edge, swapped);
    }
  }

  // Both triangles lie in one plane.
  bool overlap(std::uint32_t s, std::uint32_t t, Contacts& found) const {
    const int drop = axis_across(mesh_, s);
    if (!areas_meet(s, t, drop) || !areas_meet(t, s, drop)) return false;
    found.overlaps.push_back({s, t});
    cut_by_edges(s, t, drop, found), cut_by_edges(t, s, drop, found);
    return true;
  }

  // False if an edge of s has all of t on its other side.
  bool areas_meet(std::uint32_t s, std::uint32_t t, int drop) const {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    const int way = signs_.turn(drop, a[0], a[1], a[2]);
    for (int k = 0; k < 3; k++) {
      int most = -1;
      for (const auto v : b) most = std::max(most, way * signs_.turn(drop, a[k], a[(k + 1) % 3], v));
      if (most <= 0) return false;
    }
    return true;
  }

  // Cuts s by the parts of the edges of t that lie in it.
  void cut_by_edges(std::uint32_t s, std::uint32_t t, int drop, Contacts& found) const {
    const Corners &a = mesh_.triangles[s], &b = mesh_.triangles[t];
    for (int k = 0; k < 3; k++) {
      const auto u = b[k], v = b[(k + 1) % 3];
      const Vector along = mesh_.points[v] - mesh_.points[u];
      std::vector<std::pair<double, MeetingPoint>> on;
      const auto add_vertex = [&](std::uint32_t w, int place) {
        if (place >= 0)
          on.push_back({along.dot(mesh_.points[w] - mesh_.points[u]), {w, MeetingPoint::kNoOther, place}});
      };
      add_vertex(u, signs_.place(s, drop, u)), add_vertex(v, signs_.place(s, drop, v));
      std::array<int, 3> side;
      for (int i = 0; i < 3; i++) side[i] = a[i] == u || a[i] == v ? 0 : signs_.turn(drop, u, v, a[i]);
      for (int i = 0; i < 3; i++) {
        const auto p = a[i], q = a[(i + 1) % 3];
        if (side[i] == 0 && p != u && p != v) {
          const double at = along.dot(mesh_.points[p] - mesh_.points[u]);
          if (at > 0 && at < along.squaredNorm()) add_vertex(p, i);
        }
        if (side[i] * side[(i + 1) % 3] >= 0) continue;
        if (signs_.turn(drop, p, q, u) * signs_.turn(drop, p, q, v) >= 0) continue;
        const std::uint64_t e = edge_of(p, q), f = edge_of(u, v);
        const Vector across = mesh_.points[q] - mesh_.points[p];
        const double x = std::abs(double(along.cross(mesh_.points[p] - mesh_.points[u]).norm())),
                     y = std::abs(double(along.cross(mesh_.points[q] - mesh_.points[u]).norm()));
        const Point meet = mesh_.points[p] + across * (x + y > 0 ? x / (x + y) : 0.5);
        on.push_back({along.dot(meet - mesh_.points[u]), {std::min(e, f), std::max(e, f), 3 + i}});
      }
      if (on.size() < 2) continue;
      const auto [first, last] = std::minmax_element(
          on.begin(), on.end(), [](const auto& x, const auto& y) { return x.first < y.first; });
      found.cuts.push_back({s, {first->second, last->second}});
    }
  }

  Signs signs_;
  const Mesh& mesh_;
};

// Triangles around one vertex, the tip, as seen from there: arcs on a sphere. All their boxes touch at the
// tip and many of them elsewhere, so boxes would not tell which of them meet. But what meets one of them is
// seen from the tip where the triangle is.
class Fan {
 public:
  Fan(const Mesh& mesh, std::uint32_t tip, const std::vector<std::uint32_t>& triangles)
      : tip_(tip), triangles_(triangles), view_(arcs(mesh)) {
    box_.add(mesh.points[tip]);
    for (const auto t : triangles)
      for (int k = 0; k < 3; k++) box_.add(mesh.corner(t, k));
  }

  const Box& box() const { return box_; }

  // Appends the triangles of the fan that s may meet.
  void find(const Mesh& mesh, std::uint32_t s, std::vector<std::uint32_t>& found) const {
    constexpr double narrow = 0.99;  // cosine: a piece that looks wider is cut in two
    constexpr int most_pieces = 256;
    std::array<Vector, 3> first;
    for (int k = 0; k < 3; k++) first[k] = mesh.corner(s, k) - mesh.points[tip_];
    for (int k = 0; k < 3; k++)
      if (mesh.triangles[s][k] == tip_) first[k] = first[(k + 1) % 3];
    std::vector<std::array<Vector, 3>> pieces = {first};
    const std::size_t before = found.size();
    for (int count = 0; !pieces.empty(); count++) {
      const std::array<Vector, 3> piece = pieces.back();
      pieces.pop_back();
      std::array<double, 3> length;
      for (int k = 0; k < 3; k++) length[k] = piece[k].norm();
      double cosine = 2;
      int widest = 0;
      for (int k = 0; k < 3; k++) {
        const double c = piece[k].dot(piece[(k + 1) % 3]) / (length[k] * length[(k + 1) % 3]);
        if (!(c >= cosine)) cosine = c, widest = k;
      }
      if (!(std::min({length[0], length[1], length[2]}) > 1e-9 * box_.diagonal()) || count == most_pieces) {
        found.resize(before);
        found.insert(found.end(), triangles_.begin(), triangles_.end());
        return;
      }
      if (cosine < narrow) {
        const int next = (widest + 1) % 3;
        // Seen from the tip, this point halves the edge.
        const Vector middle =
            (length[next] * piece[widest] + length[widest] * piece[next]) / (length[widest] + length[next]);
        pieces.push_back(piece), pieces.back()[widest] = middle;
        pieces.push_back(piece), pieces.back()[next] = middle;
        continue;
      }
      Box seen;  // of the chords; the piece bulges beyond them
      for (int k = 0; k < 3; k++) seen.add(piece[k] / length[k]);
      const double bulge = 1 - cosine + 1e-12;
      seen.low -= Vector::Constant(bulge), seen.high += Vector::Constant(bulge);
      view_.visit(seen, [&](std::uint32_t k) { found.push_back(triangles_[k]); });
    }
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end());
    found.erase(std::unique(found.begin() + static_cast<std::ptrdiff_t>(before), found.end()), found.end());
  }

 private:
  // For each triangle one that holds the arc: its ends, and where the tangents at them meet.
  Mesh arcs(const Mesh& mesh) const {
    Mesh arcs;
    for (const auto t : triangles_) {
      std::vector<Vector> ends;
      for (const auto v : mesh.triangles[t])
        if (v != tip_) ends.push_back((mesh.points[v] - mesh.points[tip_]).normalized());
      const double apart = 1 + ends[0].dot(ends[1]);
      if (apart > 0.1)
        arcs.add({ends[0], ends[1], (ends[0] + ends[1]) / apart});
      else
        arcs.add({ends[0], Vector::Constant(-1), Vector::Constant(1)});
    }
    return arcs;
  }

  std::uint32_t tip_;
  std::vector<std::uint32_t> triangles_;
  Box box_;
  Surface view_;
};

// Finds the pairs of triangles that may meet.
class NearPairs {
 public:
  NearPairs(const Surface& surface, const std::vector<char>& flat)
      : surface_(surface), mesh_(surface.mesh()), flat_(flat), fan_at_(mesh_.points.size(), kNone) {
    std::vector<std::uint32_t> degree(mesh_.points.size());
    for (std::size_t t = 0; t < flat.size(); t++)
      for (const auto v : mesh_.triangles[t]) degree[v] += !flat[t];
    std::vector<std::uint32_t> tips;
    for (std::uint32_t v = 0; v < degree.size(); v++)
      if (degree[v] > kLeastFan) fan_at_[v] = static_cast<std::uint32_t>(tips.size()), tips.push_back(v);
    if (tips.empty()) return;
    std::vector<std::vector<std::uint32_t>> members(tips.size());
    Mesh loose;
    loose.points = mesh_.points;
    for (std::uint32_t t = 0; t < flat.size(); t++) {
      if (flat[t]) continue;
      if (fan_of(t) != kNone)
        members[fan_of(t)].push_back(t);
      else
        loose.triangles.push_back(mesh_.triangles[t]), loose_.push_back(t);
    }
    loose_surface_.emplace(loose);
    Mesh boxes;
    fans_.reserve(tips.size());
    for (std::uint32_t f = 0; f < tips.size(); f++) {
      const Box& box = fans_.emplace_back(mesh_, tips[f], members[f]).box();
      boxes.points.push_back(box.low), boxes.points.push_back(box.high);
      boxes.triangles.push_back({2 * f, 2 * f + 1, 2 * f + 1});
    }
    fan_boxes_.emplace(boxes);
  }

  // Calls look(s, t) once for each two triangles whose boxes touch, s < t, none of them flat; of a fan, only
  // for those that may meet. In no order, from all threads. Ends when it returns true.
  template <class Look>
  void visit(Look&& look) const {
    if (fans_.empty())
      return surface_.visit_pairs([&](auto s, auto t) { return !flat_[s] && !flat_[t] && look(s, t); });
    loose_surface_->visit_pairs([&](auto s, auto t) { return look(loose_[s], loose_[t]); });
    std::atomic<bool> stop = false;
#pragma omp parallel for schedule(dynamic, 64)
    for (std::size_t k = 0; k < flat_.size(); k++) {
      const auto s = static_cast<std::uint32_t>(k);
      if (flat_[s] || stop) continue;
      Box box;
      for (int c = 0; c < 3; c++) box.add(mesh_.corner(s, c));
      const std::uint32_t own = fan_of(s);
      std::vector<std::uint32_t> found;
      fan_boxes_->visit(box, [&](std::uint32_t f) {
        if (own < f) return;  // the pair is found in the first fan that either of the two belongs to
        found.clear(), fans_[f].find(mesh_, s, found);
        for (const auto t : found)
          if ((own > f || t > s) && touches(box, t) && look(std::min(s, t), std::max(s, t))) stop = true;
      });
    }
  }

 private:
  static constexpr std::uint32_t kNone = ~0u;
  static constexpr std::uint32_t kLeastFan = 64;  // triangles; fewer are compared pair by pair

  // The first fan that t belongs to.
  std::uint32_t fan_of(std::uint32_t t) const {
    const Corners& c = mesh_.triangles[t];
    return std::min({fan_at_[c[0]], fan_at_[c[1]], fan_at_[c[2]]});
  }

  bool touches(const Box& box, std::uint32_t t) const {
    for (int axis = 0; axis < 3; axis++) {
      const double x = mesh_.corner(t, 0)[axis], y = mesh_.corner(t, 1)[axis], z = mesh_.corner(t, 2)[axis];
      if (std::min({x, y, z}) > box.high[axis] || std::max({x, y, z}) < box.low[axis]) return false;
    }
    return true;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const std::vector<char>& flat_;
  std::vector<std::uint32_t> fan_at_;  // of each vertex that is a tip, its fan
  std::vector<Fan> fans_;
  std::optional<Surface> fan_boxes_;
  std::optional<Surface> loose_surface_;  // of the triangles of no fan, where there are fans
  std::vector<std::uint32_t> loose_;      // their indices
};

std::vector<char> flat_ones(const Mesh& mesh) {
  std::vector<char> flat(mesh.triangles.size());
#pragma omp parallel for
  for (std::size_t t = 0; t < flat.size(); t++) flat[t] = is_flat(mesh, static_cast<std::uint32_t>(t));
  return flat;
}

// Tells pairs of triangles between which the surface leads on a short way from others.
class FoldTest {
 public:
  FoldTest(const Mesh& mesh, double size)
      : mesh_(mesh), size2_(size * size), begin_(mesh.points.size() + 1), around_(3 * mesh.triangles.size()) {
    for (const Corners& c : mesh.triangles)
      for (const auto v : c) begin_[v + 1]++;
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    std::vector<std::uint32_t> next(begin_);
    for (std::uint32_t t = 0; t < mesh.triangles.size(); t++)
      for (const auto v : mesh.triangles[t]) around_[next[v]++] = t;
  }

  bool is_fold(std::uint32_t s, std::uint32_t t) const {
    const Corners &from = mesh_.triangles[s], &to = mesh_.triangles[t];
    const Point middle = mesh_.middle(s);
    const auto leaves = [&](std::uint32_t v) { return (mesh_.points[v] - middle).squaredNorm() > size2_; };
    if (std::any_of(from.begin(), from.end(), leaves) || std::any_of(to.begin(), to.end(), leaves))
      return false;
    std::array<std::uint32_t, kMostCorners> seen;
    std::size_t count = 0;
    for (const auto v : from) seen[count++] = v;
    for (std::size_t k = 0; k < count; k++) {
      if (std::count(to.begin(), to.end(), seen[k]) > 0) return true;
      for (auto at = begin_[seen[k]]; at < begin_[seen[k] + 1]; at++)
        for (const auto v : mesh_.triangles[around_[at]]) {
          if (leaves(v) || std::find(&seen[0], &seen[count], v) != &seen[count]) continue;
          if (count == kMostCorners) return false;
          seen[count++] = v;
        }
    }
    return false;
  }

 private:
  static constexpr std::size_t kMostCorners = 1024;

  const Mesh& mesh_;
  const double size2_;
  std::vector<std::uint32_t> begin_, around_;  // the triangles around each vertex
};

}  // namespace

bool is_flat(const Mesh& mesh, std::uint32_t t) {
  const Point &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
  const double longest2 = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  return !(2 * mesh.area_normal(t).norm() > 1e-14 * longest2);
}

Contacts find_contacts(const Surface& surface, std::size_t limit, const std::vector<char>& passive) {
  const auto is_passive = [&](std::uint32_t t) { return !passive.empty() && passive[t]; };
  const std::vector<char> flat = flat_ones(surface.mesh());
  const PairTest test(surface.mesh());
  Contacts all;
  std::atomic<std::size_t> found = 0;
  std::mutex mutex;
  NearPairs(surface, flat).visit([&](std::uint32_t s, std::uint32_t t) {
    Contacts unused;
    if ((is_passive(s) && is_passive(t)) || !test.meet(s, t, unused)) return false;
    if (++found > limit) return true;
    const std::lock_guard lock(mutex);
    all.pairs.push_back({s, t});
    return false;
  });
  all.too_many = found > limit;
  if (all.too_many) {
    all.pairs.clear();
    return all;
  }
  // The tree gave them in its own order. They are few, so testing them again costs less than keeping track.
  std::sort(all.pairs.begin(), all.pairs.end());
  constexpr std::size_t block = 256;
  std::vector<Contacts> parts((all.pairs.size() + block - 1) / block);
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t b = 0; b < parts.size(); b++)
    for (std::size_t k = b * block; k < std::min(all.pairs.size(), (b + 1) * block); k++) {
      const auto [s, t] = all.pairs[k];
      const auto cuts = static_cast<std::ptrdiff_t>(parts[b].cuts.size());
      test.meet(s, t, parts[b]);
      if (is_passive(s) == is_passive(t)) continue;
      parts[b].cuts.erase(std::remove_if(parts[b].cuts.begin() + cuts, parts[b].cuts.end(),
                                         [&](const Cut& cut) { return !is_passive(cut.triangle); }),
                          parts[b].cuts.end());
    }
  for (Contacts& part : parts) {
    all.cuts.insert(all.cuts.end(), part.cuts.begin(), part.cuts.end());
    all.overlaps.insert(all.overlaps.end(), part.overlaps.begin(), part.overlaps.end());
  }
  return all;
}

bool any_contact(const Surface& surface) { return find_contacts(surface, 0).too_many; }

std::optional<std::size_t> count_folds(const Surface& surface, double size) {
  const std::vector<char> flat = flat_ones(surface.mesh());
  const PairTest test(surface.mesh());
  const FoldTest folds(surface.mesh(), size);
  std::atomic<std::size_t> count = 0;
  std::atomic<bool> all = true;
  NearPairs(surface, flat).visit([&](std::uint32_t s, std::uint32_t t) {
    Contacts unused;
    if (!test.meet(s, t, unused)) return false;
    count++;
    if (!folds.is_fold(s, t)) all = false;
    return !all;
  });
  if (!all) return std::nullopt;
  return count;
}

}  // namespace padder
