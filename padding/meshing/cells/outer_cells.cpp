// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cells/outer_cells.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <numeric>
#include <optional>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "padding/geometry/point_tree.h"
#include "padding/geometry/surface.h"
#include "padding/meshing/cells/meeting_place.h"
#include "padding/meshing/pieces.h"

namespace padder {
namespace {

constexpr std::uint32_t kNone = ~0u;

// Points that differ by rounding alone are one.
constexpr double kSamePoint = 1e-13;  // of the diagonal

class Cutter {
 public:
  Cutter(const Surface& soup, const std::vector<TriangleRole>& roles, const Contacts& contacts,
         std::size_t limit)
      : soup_(soup.mesh()),
        roles_(roles),
        contacts_(contacts),
        limit_(limit),
        surface_(soup),
        points_(soup_.points),
        near_(kSamePoint * soup_.bounds().diagonal()) {}

  OuterCells run() {
    name_points();
    mark_overlaps();
    if (!cut()) {
      OuterCells out;
      out.too_many = true;
      return out;
    }
    find_regions();
    decide();
    return collect();
  }

 private:
  struct Region {
    std::uint32_t triangle = 0;
    Point place;                     // in the region
    double room = -1;                // how far inside, about
    std::optional<int> front, back;  // winding numbers on the two sides of the triangle
    bool twice = false;              // another triangle has the same region
  };

  struct EdgePoint {
    std::uint64_t edge = 0;
    double along = 0;  // the edge, from its smaller vertex
    std::uint32_t point = 0;
  };

  // --- points ---

  // Gives each meeting point its index, and each edge the points on it.
  void name_points() {
    std::vector<MeetingPoint> all;
    all.reserve(2 * contacts_.cuts.size());
    for (const Cut& cut : contacts_.cuts)
      for (const MeetingPoint& m : cut.ends)
        if (!m.is_vertex()) all.push_back(m);
    const auto edge = [](const MeetingPoint& m) { return m.what; };
    const auto less = [](const MeetingPoint& a, const MeetingPoint& b) { return a.with < b.with; };
    sort_by_edge(all, soup_.points.size(), edge, less);
    all.erase(std::unique(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.same(b); }),
              all.end());
    const std::size_t first = points_.size();
    points_.resize(first + all.size());
#pragma omp parallel for if (all.size() > 1024)
    for (std::size_t k = 0; k < all.size(); k++) points_[first + k] = place_of(all[k], soup_, near_);

    // An edge meets triangles in one plane at one point. Taken as several, it would make cuts that all but
    // coincide.
    std::vector<char> used(points_.size(), 0);
    for (const Cut& cut : contacts_.cuts)
      for (const auto v : soup_.triangles[cut.triangle]) used[v] = 1;
    std::fill(used.begin() + static_cast<std::ptrdiff_t>(first), used.end(), 1);
    join_equal_points(used);

    cuts_of_.assign(soup_.triangles.size() + 1, 0);
    for (const Cut& cut : contacts_.cuts) cuts_of_[cut.triangle + 1]++;
    std::partial_sum(cuts_of_.begin(), cuts_of_.end(), cuts_of_.begin());
    cuts_.resize(contacts_.cuts.size());
    std::vector<std::uint32_t> next(cuts_of_), place(contacts_.cuts.size());
    for (std::size_t k = 0; k < place.size(); k++) place[k] = next[contacts_.cuts[k].triangle]++;
    const auto before = [](const MeetingPoint& a, const MeetingPoint& b) {
      return a.what != b.what ? a.what < b.what : a.with < b.with;
    };
#pragma omp parallel for if (place.size() > 1024)
    for (std::size_t k = 0; k < place.size(); k++) {
      TriangleCut& c = cuts_[place[k]];
      for (int i = 0; i < 2; i++) {
        const MeetingPoint& m = contacts_.cuts[k].ends[i];
        c.point[i] = m.is_vertex()
                         ? static_cast<std::uint32_t>(m.what)
                         : static_cast<std::uint32_t>(
                               first + (std::lower_bound(all.begin(), all.end(), m, before) - all.begin()));
        c.point[i] = same_[c.point[i]], c.place[i] = m.place;
      }
    }
    find_points_on_edges();
  }

  void find_points_on_edges() {
    for (std::uint32_t t = 0; t < soup_.triangles.size(); t++)
      for (const TriangleCut& c : cuts_of(t)) {
        for (int k = 0; k < 2; k++) {
          if (c.place[k] < 3 || c.place[k] >= 6) continue;
          const std::uint64_t edge = edge_of(t, c.place[k] - 3);
          const auto [from, to] = ends_of(edge);
          if (c.point[k] == from || c.point[k] == to) continue;
          const Vector along = soup_.points[to] - soup_.points[from];
          on_edges_.push_back({edge, along.dot(points_[c.point[k]] - soup_.points[from]), c.point[k]});
        }
      }
    const auto less = [](const EdgePoint& a, const EdgePoint& b) {
      return a.along != b.along ? a.along < b.along : a.point < b.point;
    };
    const auto same = [](const EdgePoint& a, const EdgePoint& b) {
      return a.edge == b.edge && a.point == b.point;
    };
    const auto edge = [](const EdgePoint& p) { return p.edge; };
    sort_by_edge(on_edges_, soup_.points.size(), edge, less);
    on_edges_.erase(std::unique(on_edges_.begin(), on_edges_.end(), same), on_edges_.end());
    on_edges_of_.assign(soup_.points.size() + 1, 0);
    for (const EdgePoint& p : on_edges_) on_edges_of_[(p.edge >> 32) + 1]++;
    std::partial_sum(on_edges_of_.begin(), on_edges_of_.end(), on_edges_of_.begin());
    find_touched_edges();
  }

  // By the points themselves: one that was found inside a triangle, or on another edge, may have become one
  // with a point of this edge.
  void find_touched_edges() {
    for (std::uint32_t t = 0; t < soup_.triangles.size(); t++) {
      if (cuts_of(t).empty()) continue;
      for (int k = 0; k < 3; k++) {
        const std::uint64_t edge = edge_of(t, k);
        const std::span<const EdgePoint> between = on_edge(edge);
        const auto lies_on = [&](std::uint32_t p) {
          return p == same_[soup_.triangles[t][k]] || p == same_[soup_.triangles[t][(k + 1) % 3]] ||
                 std::any_of(between.begin(), between.end(), [p](auto& q) { return q.point == p; });
        };
        for (const TriangleCut& c : cuts_of(t))
          if (c.point[0] != c.point[1] && lies_on(c.point[0]) && lies_on(c.point[1])) touched_.insert(edge);
      }
    }
  }

  // The points on an edge, from its smaller vertex on.
  std::span<const EdgePoint> on_edge(std::uint64_t edge) const {
    const auto from = edge >> 32;
    const std::span<const EdgePoint> all(on_edges_.data() + on_edges_of_[from],
                                         on_edges_of_[from + 1] - on_edges_of_[from]);
    const auto begin = std::partition_point(all.begin(), all.end(), [&](auto& p) { return p.edge < edge; });
    return {begin, std::partition_point(begin, all.end(), [&](auto& p) { return p.edge == edge; })};
  }

  std::span<const TriangleCut> cuts_of(std::uint32_t t) const {
    return {cuts_.data() + cuts_of_[t], cuts_of_[t + 1] - cuts_of_[t]};
  }

  std::uint64_t edge_of(std::uint32_t t, int k) const {
    return padder::edge_of(soup_.triangles[t][k], soup_.triangles[t][(k + 1) % 3]);
  }

  void mark_overlaps() {
    // What lies on a triangle that bounds the body does not cut it, so only the sheet knows of the two.
    for (const auto& [s, t] : contacts_.overlaps) {
      if (solid(t)) overlaps_[s].push_back(t);
      if (solid(s)) overlaps_[t].push_back(s);
    }
    for (auto& [t, others] : overlaps_) std::sort(others.begin(), others.end());
  }

  // --- pieces ---

  // A point on an edge cuts all triangles that have the edge.
  bool is_cut(std::uint32_t t) const {
    bool cut = !cuts_of(t).empty() || overlaps_.count(t) > 0;
    for (int k = 0; k < 3 && !cut; k++) cut = !on_edge(edge_of(t, k)).empty();
    return cut && !is_flat(soup_, t);
  }

  // The corners of t and the points on its edges, in order round it.
  std::array<std::vector<std::uint32_t>, 3> rim_of(std::uint32_t t) const {
    std::array<std::vector<std::uint32_t>, 3> rim;
    for (int k = 0; k < 3; k++) {
      for (const EdgePoint& p : on_edge(edge_of(t, k))) rim[k].push_back(p.point);
      if (soup_.triangles[t][k] > soup_.triangles[t][(k + 1) % 3]) std::reverse(rim[k].begin(), rim[k].end());
    }
    return rim;
  }

  // False if the cuts cross at too many places.
  bool cut() {
    piece_of_.assign(soup_.triangles.size(), kNone);
    std::vector<char> is_cut_one(soup_.triangles.size());
#pragma omp parallel for schedule(static)
    for (std::size_t t = 0; t < is_cut_one.size(); t++) is_cut_one[t] = is_cut(static_cast<std::uint32_t>(t));
    for (std::uint32_t t = 0; t < soup_.triangles.size(); t++)
      if (is_cut_one[t]) piece_of_[t] = static_cast<std::uint32_t>(cut_.size()), cut_.push_back(t);
    pieces_.resize(cut_.size());
    std::atomic<std::size_t> crossings = 0;  // once above the limit it stays there, in whatever order
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t k = 0; k < cut_.size(); k++) {
      if (crossings > limit_) continue;
      const std::uint32_t t = cut_[k];
      pieces_[k] = cut_triangle(soup_, t, points_, rim_of(t), cuts_of(t), near_, limit_);
      crossings += pieces_[k].too_many ? limit_ + 1 : pieces_[k].fresh.size();
    }
    if (crossings > limit_) return false;
    // Where cuts cross inside a triangle there are new points.
    for (TrianglePieces& p : pieces_) {
      const auto first = static_cast<std::uint32_t>(points_.size());
      points_.insert(points_.end(), p.fresh.begin(), p.fresh.end());
      for (auto& face : p.faces)
        for (auto& v : face)
          if (v & TrianglePieces::kFresh) v = first + (v & ~TrianglePieces::kFresh);
    }
    return true;
  }

  // Regions: triangles that nothing meets and that hang together, and the regions of each cut triangle.
  void find_regions() {
    const auto n = static_cast<std::uint32_t>(soup_.triangles.size());
    std::vector<std::uint32_t> parent = numbered(n);
    const std::vector<Side> sides = sides_of(soup_, parent);
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      const auto s = sides[begin].triangle, t = sides[end - 1].triangle;
      if (run_on(sides, begin, end) && piece_of_[s] == kNone && piece_of_[t] == kNone) join(parent, s, t);
    });
    region_of_.assign(n, kNone);
    for (std::uint32_t t = 0; t < n; t++) {
      if (piece_of_[t] != kNone || is_flat(soup_, t)) continue;
      const Point &a = soup_.corner(t, 0), &b = soup_.corner(t, 1), &c = soup_.corner(t, 2);
      const double room =
          2 * soup_.area_normal(t).norm() / ((b - a).norm() + (c - b).norm() + (a - c).norm());
      auto& region = region_of_[root_of(parent, t)];
      if (region == kNone) region = new_region(t, Point::Zero(), -1);
      Region& r = regions_[region];
      if (room > r.room) r.room = room, r.triangle = t, r.place = soup_.middle(t);
    }
    for (std::uint32_t t = 0; t < n; t++)
      if (piece_of_[t] == kNone) region_of_[t] = region_of_[root_of(parent, t)];
    for (std::size_t k = 0; k < cut_.size(); k++) {
      region_of_[cut_[k]] = static_cast<std::uint32_t>(regions_.size());
      for (std::size_t r = 0; r < pieces_[k].places.size(); r++)
        new_region(cut_[k], pieces_[k].places[r], pieces_[k].room[r]);
    }
    join_regions(sides);
  }

  // Does the surface run on over an edge, from the front of one triangle to the front of another one?
  bool run_on(const std::vector<Side>& sides, std::size_t begin, std::size_t end) const {
    return end - begin == 2 && sides[begin].direction != sides[begin + 1].direction &&
           roles_[sides[begin].triangle] == roles_[sides[begin + 1].triangle];
  }

  // Regions on both sides of an edge have the same before them, unless something touches the edge along a
  // part of it. Those of triangles that others lie on are decided one by one.
  void join_regions(const std::vector<Side>& sides) {
    leader_ = numbered(regions_.size());
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      const auto s = sides[begin].triangle, t = sides[end - 1].triangle;
      if (!run_on(sides, begin, end) || (piece_of_[s] == kNone && piece_of_[t] == kNone) ||
          overlaps_.count(s) || overlaps_.count(t) || touched_.count(sides[begin].edge))
        return;
      const std::vector<std::uint32_t> one = regions_along(s, sides[begin].edge),
                                       other = regions_along(t, sides[begin].edge);
      for (std::size_t k = 0; k < one.size() && one.size() == other.size(); k++)
        if (one[k] != kNone && other[k] != kNone) join(leader_, one[k], other[k]);
    });
  }

  // The regions of t along one of its edges, from the smaller vertex on.
  std::vector<std::uint32_t> regions_along(std::uint32_t t, std::uint64_t edge) const {
    if (piece_of_[t] == kNone) return {region_of_[t]};
    const TrianglePieces& p = pieces_[piece_of_[t]];
    std::size_t k = 0;
    while (edge_of(t, static_cast<int>(k)) != edge) k++;
    std::vector<std::uint32_t> along(p.rim.begin() + p.rim_of[k],
                                     k < 2 ? p.rim.begin() + p.rim_of[k + 1] : p.rim.end());
    for (auto& region : along)
      if (region != kNone) region += region_of_[t];
    if (soup_.triangles[t][k] != edge >> 32) std::reverse(along.begin(), along.end());
    return along;
  }

  std::uint32_t new_region(std::uint32_t triangle, const Point& place, double room) {
    regions_.push_back({triangle, place, room, {}, {}, false});
    return static_cast<std::uint32_t>(regions_.size() - 1);
  }

  // --- inside and outside ---

  bool solid(std::uint32_t t) const { return roles_[t] != TriangleRole::sheet; }

  // Is p, a point of the plane of t, in t?
  bool holds(std::uint32_t t, const Point& p) const {
    const Vector n = soup_.area_normal(t);
    for (int k = 0; k < 3; k++) {
      const Point& a = soup_.corner(t, k);
      if (n.dot((soup_.corner(t, (k + 1) % 3) - a).cross(p - a)) < 0) return false;
    }
    return true;
  }

  // A ray decides on all regions that are joined. Those of some others must agree, and at least one of them.
  void decide() {
    std::vector<std::uint32_t> joined = numbered(regions_.size());
    for (auto& leader : leader_) leader = leader_[leader];  // a leader stands before those that it leads
    std::stable_sort(joined.begin(), joined.end(), [&](auto a, auto b) { return leader_[a] < leader_[b]; });
    std::vector<std::size_t> begin;
    for (std::size_t k = 0; k < joined.size(); k++)
      if (leader_[joined[k]] == joined[k]) begin.push_back(k);
    const std::size_t groups = begin.size();
    begin.push_back(joined.size());
#pragma omp parallel for schedule(dynamic, 16)
    for (std::size_t g = 0; g < groups; g++) {
      const auto group = std::span(joined).subspan(begin[g], begin[g + 1] - begin[g]);
      if (group.size() > 1 && decide_together(group)) continue;
      for (const auto k : group) {
        const auto found = overlaps_.find(regions_[k].triangle);
        std::vector<std::uint32_t> others;
        if (found != overlaps_.end()) others = found->second;
        if (!decide(regions_[k], others) && add_near(regions_[k], others)) decide(regions_[k], others);
      }
    }
  }

  bool decide_together(std::span<const std::uint32_t> group) {
    constexpr std::size_t most_asked = 8;
    const auto largest = *std::max_element(
        group.begin(), group.end(), [&](auto a, auto b) { return regions_[a].room < regions_[b].room; });
    const Region first = decided(largest);
    if (!first.front) return false;
    bool agreed = false;
    for (std::size_t k = 0; k < group.size(); k += (group.size() + most_asked - 1) / most_asked) {
      if (group[k] == largest) continue;
      const auto front = decided(group[k]).front;
      if (front && front != first.front) return false;
      agreed |= front.has_value();
    }
    if (!agreed) return false;
    for (const auto k : group) regions_[k].front = first.front, regions_[k].back = first.back;
    return true;
  }

  Region decided(std::uint32_t k) const {
    Region region = regions_[k];
    decide(region, {});
    return region;
  }

  // `others` may lie on the region, in ascending order. False where rounding leaves open what lies before it.
  bool decide(Region& r, const std::vector<std::uint32_t>& others) const {
    const Vector n = soup_.area_normal(r.triangle);
    int jump = solid(r.triangle);
    bool twice = false;
    for (const auto t : others) {
      if (!holds(t, r.place)) continue;
      twice |= t < r.triangle || !solid(r.triangle);
      jump += soup_.area_normal(t).dot(n) > 0 ? 1 : -1;
    }
    const auto skip = [&](std::uint32_t t) {
      return t == r.triangle || !solid(t) || std::binary_search(others.begin(), others.end(), t);
    };
    if (const auto d = surface_.shortest_ray(r.place, n)) r.front = surface_.crossings(r.place, *d, skip);
    for (const Vector& d : Surface::ray_directions()) {
      if (r.front) break;
      if (std::abs(d.dot(n)) >= Surface::kGrazing * n.norm())
        r.front = surface_.crossings(r.place, d.dot(n) > 0 ? d : Vector(-d), skip);
    }
    r.twice = twice;
    if (r.front) r.back = *r.front + jump;
    return r.front.has_value();
  }

  // Adds the triangles that lie on the region but for rounding, as where a face repeats whose points were
  // computed in another way. Returns whether there are any.
  bool add_near(const Region& r, std::vector<std::uint32_t>& others) const {
    constexpr double parallel = 1e-6;
    const std::size_t before = others.size();
    const Vector n = soup_.area_normal(r.triangle).normalized();
    surface_.visit({r.place - Vector::Constant(near_), r.place + Vector::Constant(near_)},
                   [&](std::uint32_t t) {
                     const Vector m = soup_.area_normal(t).normalized();
                     if (t != r.triangle && solid(t) && n.cross(m).norm() < parallel &&
                         surface_.distance_to(t, r.place) < near_)
                       others.push_back(t);
                   });
    sort_unique(others);
    return others.size() > before;
  }

  // --- the result ---

  enum class Fate { boundary, turned, sheet, buried, dropped };

  Fate fate(const Region& r) const {
    if (r.twice) return Fate::dropped;
    if (!r.front) return Fate::sheet;
    if (*r.front > 0 && *r.back > 0) return Fate::buried;
    if (*r.front <= 0 && *r.back <= 0)
      return roles_[r.triangle] == TriangleRole::patch ? Fate::dropped : Fate::sheet;
    return *r.front > 0 ? Fate::turned : Fate::boundary;
  }

  OuterCells collect() {
    std::vector<char> used(points_.size(), 0);
    for (const TrianglePieces& p : pieces_)
      for (const auto& face : p.faces)
        for (const auto v : face) used[v] = 1;
    join_equal_points(used);
    OuterCells out;
    out.mesh.points = points_;
    for (const bool bounds : {true, false}) {
      const auto keep = [&](std::uint32_t t, std::array<std::uint32_t, 3> c, Fate f) {
        if (bounds && f == Fate::buried && roles_[t] != TriangleRole::patch)
          out.buried.add({points_[c[0]], points_[c[1]], points_[c[2]]});
        for (auto& v : c) v = same_[v];
        if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) return;
        if (bounds != (f == Fate::boundary || f == Fate::turned) || f == Fate::buried || f == Fate::dropped)
          return;
        if (f == Fate::turned) std::swap(c[1], c[2]);
        out.mesh.triangles.push_back(c), out.source.push_back(t);
      };
      for (std::uint32_t t = 0; t < soup_.triangles.size(); t++) {
        if (piece_of_[t] == kNone) {
          if (region_of_[t] != kNone) keep(t, soup_.triangles[t], fate(regions_[region_of_[t]]));
          continue;
        }
        const TrianglePieces& p = pieces_[piece_of_[t]];
        for (std::size_t f = 0; f < p.faces.size(); f++)
          keep(t, p.faces[f], fate(regions_[region_of_[t] + p.region[f]]));
      }
      if (bounds) out.boundary = out.mesh.triangles.size();
    }
    out.mesh.drop_unused_points();
    return out;
  }

  // Points that were computed in two ways differ by rounding. Each new point becomes the first one near it
  // that stays.
  void join_equal_points(const std::vector<char>& used) {
    same_ = numbered(points_.size());
    std::vector<std::uint32_t> some;
    std::vector<Point> places;
    for (std::uint32_t v = 0; v < points_.size(); v++)
      if (used[v]) some.push_back(v), places.push_back(points_[v]);
    const PointTree tree(std::move(places));
    // Calls visit(w) for the points near v that stand before it.
    const auto visit_near = [&](std::size_t v, auto&& visit) {
      std::vector<std::uint32_t> near;
      tree.find(points_[v], 1.01 * near_, near);
      for (const auto k : near)
        if (some[k] < v && (points_[some[k]] - points_[v]).norm() < near_) visit(some[k]);
    };
    std::vector<char> is_near(points_.size(), 0);
#pragma omp parallel for schedule(static)
    for (std::size_t v = soup_.points.size(); v < points_.size(); v++)
      if (used[v]) visit_near(v, [&](std::uint32_t) { is_near[v] = 1; });
    for (std::uint32_t v = 0; v < points_.size(); v++)
      if (is_near[v])
        visit_near(v, [&](std::uint32_t w) {
          if (same_[w] == w) same_[v] = std::min(same_[v], w);
        });
  }

  const Mesh& soup_;
  const std::vector<TriangleRole>& roles_;
  const Contacts& contacts_;
  const std::size_t limit_;
  const Surface& surface_;
  std::vector<Point> points_;  // of the soup, then the new ones
  const double near_;          // points that are closer are one
  std::vector<TriangleCut> cuts_;
  std::vector<std::uint32_t> cuts_of_;    // of triangle t: cuts_of_[t] up to cuts_of_[t + 1]
  std::vector<EdgePoint> on_edges_;       // in the order of the edges, and along each from its smaller vertex
  std::vector<std::size_t> on_edges_of_;  // where those of edges with this smaller vertex begin
  std::unordered_set<std::uint64_t> touched_;  // edges that something touches along a part of them
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> overlaps_;
  std::vector<std::uint32_t> cut_, piece_of_;  // the cut triangles; of each triangle its place among them
  std::vector<TrianglePieces> pieces_;
  std::vector<Region> regions_;
  std::vector<std::uint32_t> region_of_;  // of a cut triangle, the first
  std::vector<std::uint32_t> leader_;     // of each region the first that it is joined with
  std::vector<std::uint32_t> same_;
};

}  // namespace

OuterCells outer_cells(const Surface& soup, const std::vector<TriangleRole>& roles, const Contacts& contacts,
                       std::size_t limit) {
  return Cutter(soup, roles, contacts, limit).run();
}

}  // namespace padder
