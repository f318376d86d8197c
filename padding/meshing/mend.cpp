// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/mend.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>

#include "padding/geometry/medial.h"
#include "padding/geometry/random.h"
#include "padding/meshing/contacts.h"
#include "padding/meshing/holes.h"
#include "padding/meshing/outer_cells.h"
#include "padding/meshing/pieces.h"

namespace padder {
namespace {

// Border edges that lie closer than this share of the diagonal are one edge, but never farther apart than
// this share of the tolerance: covers make up for the width of the cracks that were closed.
constexpr double kCrackWidth = 1e-4, kCrackShare = 0.25;
// Corners may be joined over the same share of the tolerance. Each width that is tried is wider by this
// factor.
constexpr double kJoinStep = 5;
// Corners lie on an edge if they are off it by rounding, as a share of the largest coordinate: that of a unit
// frame, that of a file in float.
constexpr double kFrameRounding = 2e-11, kFloatRounding = 2.5e-7;
// A hole as narrow as this share of the diagonal is closed however long it is.
constexpr double kNarrowHole = 1e-3;
// An open piece is a solid with holes if the mean winding number of what is there, over what the patches
// would enclose, is at least this: the larger for any opening, the smaller for one of at most so many
// diagonals of the piece around. A cube without its lid has 0.8 and 2.0 diagonals, half of a ball 0.7
// and 2.2.
constexpr double kSureWinding = 0.9, kLeastWinding = 0.8, kWidestOpening = 1.5;
// An open piece that encloses less than this share of (its area)^1.5 encloses nothing, nor does one that
// encloses less than this share of (the mesh's diagonal)^3, as what is left of a sheet between its cracks.
constexpr double kLeastVolume = 1e-7, kLeastSolid = 1e-15;
// A piece that encloses less than this share of (its area)^1.5 is flat: neither the inner wall of one around
// it, nor a solid whose hole another one covers.
constexpr double kLeastWallVolume = 1e-3;

// Pieces that hang together by points, one of them open.
struct OpenGroup {
  std::vector<std::uint32_t> triangles;  // of the input, then those that close it
  std::size_t own = 0;                   // of the input
  std::vector<DirectedEdge> missing;     // once the cracks are closed
  std::vector<std::vector<std::uint32_t>> rims;
  std::vector<Triangles> patches;  // of each rim
  std::vector<char> is_long;       // of each rim: it is not closed without asking
  Triangles cracks;
  double crack_width = 0;
  // The widest hole that is not closed anyway: the circumference of a circle of its area. The length of its
  // rim would say little, because a seam that is open is long.
  double opening = 0, diagonal = 0;
  double winding = 0;                  // mean, without the patches of such rims
  bool solid = false, inward = false;  // inward: with its patches it faced so in the file
};

class Mender {
 public:
  Mender(const Mesh& input, const RepairOptions& options)
      : options_(options), pieces_(find_pieces(input)), mesh_(pieces_.mesh), input_(input) {
    diagonal_ = input.bounds().diagonal();
    split_pieces();
    join_pieces();
  }
  Mender(std::shared_ptr<const Surface> piece, const RepairOptions& options)
      : options_(options), mesh_(pieces_.mesh), input_(piece->mesh()), surface_(std::move(piece)) {
    diagonal_ = surface_->bounds().diagonal();
    pieces_.mesh = input_;
    Piece& all = pieces_.pieces.emplace_back();
    all.triangles.resize(mesh_.triangles.size()), all.closed = true;
    std::iota(all.triangles.begin(), all.triangles.end(), 0u);
  }

  // Nothing where the pieces make no body; why_not() says why.
  std::optional<Repaired> run() {
    out_.thickness = options_.thickness;
    out_.steps.pieces = pieces_.pieces.size();
    out_.steps.repeated = pieces_.repeated, out_.steps.turned = pieces_.turned;
    collect_groups();
    turn_units();
    for (OpenGroup& group : groups_) close(group);
    judge();
    if (parts_of_one_) {
      why_not_ = "its open pieces enclose a body together, but not one by one";
      return std::nullopt;
    }
    assemble();
    return finish();
  }

  const std::string& why_not() const { return why_not_; }

 private:
  // --- open pieces ---

  std::vector<std::uint32_t> open_triangles(std::size_t* pieces = nullptr) const {
    std::vector<std::uint32_t> open;
    for (const Piece& piece : pieces_.pieces) {
      if (piece.closed || piece.bounds_nothing) continue;
      open.insert(open.end(), piece.triangles.begin(), piece.triangles.end());
      if (pieces) ++*pieces;
    }
    return open;
  }

  // Where corners lie on edges, as where triangles repeat that are divided differently, or where a scrap
  // stands on a surface with T-junctions, nothing says which triangles are the skin. There the edges are
  // split, if fewer stay open then. Corners that are off by rounding lie on an edge, first by that of double
  // and then by that of float; corners of a copy that is moved a little must not.
  void split_pieces() {
    if (options_.mode == RepairMode::sheet) return;
    const double farthest =
        std::max(input_.bounds().low.cwiseAbs().maxCoeff(), input_.bounds().high.cwiseAbs().maxCoeff());
    for (const double rounding : {kFrameRounding, kFloatRounding}) {
      const double width = std::min({rounding * farthest, crack_limit(), options_.join_width});
      while (width > 0 && split_pieces(width)) {
      }
    }
  }

  // Returns whether edges were split.
  bool split_pieces(double width) {
    const std::vector<std::uint32_t> open = open_triangles();
    if (open.empty()) return false;
    // Those that repeat and are left out so far are split with them.
    std::vector<char> closed(mesh_.triangles.size(), 0);
    for (const Piece& piece : pieces_.pieces)
      for (const auto t : piece.triangles) closed[t] = piece.closed;
    std::vector<std::uint32_t> loose;
    for (std::uint32_t t = 0; t < closed.size(); t++)
      if (!closed[t]) loose.push_back(t);
    const std::vector<Side> sides = sides_of(mesh_, loose);
    std::vector<DirectedEdge> odd;
    bool crowded = false;
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      crowded |= end - begin > 2;
      if ((end - begin) % 2 == 1)
        odd.push_back({static_cast<std::uint32_t>(sides[begin].edge >> 32),
                       static_cast<std::uint32_t>(sides[begin].edge)});
    });
    if (!crowded) return false;
    SplitEdges split = split_edges(mesh_, loose, odd, width);
    if (split.count == 0) return false;
    Pieces before = std::exchange(pieces_, find_pieces(split.mesh));
    if (missing_edges(mesh_, open_triangles()).size() >= missing_edges(before.mesh, open).size()) {
      pieces_ = std::move(before);
      return false;
    }
    out_.steps.split += split.count, out_.steps.joined_width += split.farthest;
    split_ = std::move(split.mesh);
    return true;
  }

  // Where each triangle, or each half of a body, has corners of its own that miss those of its neighbours by
  // a little, cracks run all round it, triangles cross their neighbours, and nothing says which way they
  // face. So the corners are joined, if that leaves at most half as many open pieces and edges: within the
  // width of a crack, or, where edges stay open, within the wider one that leaves the fewest. Two copies of
  // an open piece must not be joined, which would close them to a shell without thickness.
  void join_pieces() {
    std::size_t apart = 0;
    const std::vector<std::uint32_t> open = open_triangles(&apart);
    const double widest = std::min(options_.join_width, join_limit());
    if (apart < 2 || !(widest > 0) || options_.mode == RepairMode::sheet) return;
    const std::vector<DirectedEdge> missing = missing_edges(mesh_, open);
    const Mesh given = mesh_;
    const double few = 0.01 * part(open).area(), split_width = out_.steps.joined_width;
    std::size_t least = missing.size() / 2 + 1;
    for (double width = crack_limit(); least > 0; width *= kJoinStep) {
      const bool last = width > 0.99 * widest;
      if (last) width = widest;
      const JoinedCorners joined = join_corners(split_ ? *split_ : input_, given, missing, width);
      if (joined.count > 0) {
        const double thin = thin_area(width) + few;
        Pieces before = std::exchange(pieces_, find_pieces(joined.mesh));
        std::size_t together = 0;
        const std::size_t left = missing_edges(mesh_, open_triangles(&together)).size();
        if (left < least && 2 * together <= apart && thin_area(width) <= thin)
          least = left, out_.steps.joined = joined.count,
          out_.steps.joined_width = split_width + joined.farthest;
        else
          pieces_ = std::move(before);
      }
      if (last) return;
    }
  }

  // The area of closed pieces that are thinner than the width.
  double thin_area(double width) const {
    double sum = 0;
    for (const Piece& piece : pieces_.pieces) {
      if (!piece.closed) continue;
      double area = 0;
      for (const auto t : piece.triangles) area += mesh_.area_normal(t).norm();
      if (std::abs(signed_volume(mesh_, piece.triangles)) < 0.5 * width * area) sum += area;
    }
    return sum;
  }

  double join_limit() const {
    const double error = options_.tolerance > 0  ? options_.tolerance
                         : options_.accuracy > 0 ? options_.accuracy
                                                 : diagonal_ / 500;
    return kCrackShare * error;
  }

  double crack_limit() const {
    const double share = options_.tolerance > 0 ? kCrackShare * options_.tolerance : diagonal_;
    return std::min(kCrackWidth * diagonal_, share);
  }

  // Open pieces belong together where they share points or a crack between them is closed.
  void collect_groups() {
    std::vector<std::uint32_t> parent(mesh_.points.size()), open;
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t v) {
      while (parent[v] != v) v = parent[v] = parent[parent[v]];
      return v;
    };
    const auto join = [&](const std::array<std::uint32_t, 3>& t) {
      for (int k = 1; k < 3; k++) {
        const auto a = root(t[0]), b = root(t[k]);
        parent[std::max(a, b)] = std::min(a, b);
      }
    };
    for (const Piece& piece : pieces_.pieces) {
      if (piece.bounds_nothing)
        walls_.insert(walls_.end(), piece.triangles.begin(), piece.triangles.end());
      else if (piece.closed)
        units_.push_back(piece.triangles);
      else
        open.insert(open.end(), piece.triangles.begin(), piece.triangles.end());
    }
    for (const auto t : open) join(mesh_.triangles[t]);
    std::vector<DirectedEdge> missing = missing_edges(mesh_, open);
    std::vector<CrackTriangle> cracks;
    if (options_.mode != RepairMode::sheet) cracks = close_cracks(mesh_, missing, crack_limit());
    for (const CrackTriangle& crack : cracks) join(crack.triangle);
    if (options_.mode != RepairMode::sheet) find_bridges(open, missing, root);
    for (const auto& [a, b] : bridges_) join({a, b, b});

    std::vector<std::uint32_t> group_of(mesh_.points.size(), kNone);
    for (const auto t : open) {
      auto& g = group_of[root(mesh_.triangles[t][0])];
      if (g == kNone) g = static_cast<std::uint32_t>(groups_.size()), groups_.emplace_back();
      groups_[g].triangles.push_back(t);
    }
    for (const CrackTriangle& crack : cracks) {
      OpenGroup& group = groups_[group_of[root(crack.triangle[0])]];
      group.cracks.push_back(crack.triangle);
      group.crack_width = std::max(group.crack_width, crack.width);
    }
    for (const DirectedEdge& e : missing) groups_[group_of[root(e.from)]].missing.push_back(e);
  }

  // Rings at the ends of pipes, whose outer wall faces outward and whose inner wall faces inward, or the
  // other way round where no pipe is so. Where there are none, both walls may face outward, as those of a
  // helmet: then the inner one is turned.
  template <class Root>
  void find_bridges(const std::vector<std::uint32_t>& open, std::vector<DirectedEdge>& missing, Root&& root) {
    const auto rims = trace_rims(mesh_, open, missing);
    std::vector<Ring> rings = find_rings(mesh_, rims);
    if (rings.empty()) return;
    std::map<std::uint32_t, double> volume, area;  // of each piece with its rims filled
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      const Point &p = mesh_.points[a], &q = mesh_.points[b], &r = mesh_.points[c];
      volume[root(a)] += p.dot(q.cross(r)) / 6, area[root(a)] += (q - p).cross(r - p).norm() / 2;
    };
    for (const auto t : open) add(mesh_.triangles[t][0], mesh_.triangles[t][1], mesh_.triangles[t][2]);
    for (const auto& rim : rims)
      for (std::size_t k = 1; k + 1 < rim.size(); k++) add(rim[0], rim[k], rim[k + 1]);
    for (const int sign : {1, -1}) {
      for (const Ring& ring : rings)
        if (!ring.alike && sign * volume[root(ring.bridge[0])] > 0 && sign * volume[root(ring.bridge[1])] < 0)
          bridges_.push_back(ring.bridge);
      if (!bridges_.empty()) return;
    }
    std::erase_if(rings, [&](const Ring& ring) {
      const auto encloses = [&](std::uint32_t v) {
        return std::abs(volume[root(v)]) > kLeastWallVolume * std::pow(area[root(v)], 1.5);
      };
      return !ring.alike || !encloses(ring.bridge[0]) || !encloses(ring.bridge[1]);
    });
    turn_inner_walls(rims, rings, open, missing, root);
  }

  // A piece is the inner wall of another one that faces as it does, if nearly all of its border is in the
  // rings with it. Of walls within walls, every second one is turned.
  template <class Root>
  void turn_inner_walls(const std::vector<std::vector<std::uint32_t>>& rims, const std::vector<Ring>& rings,
                        const std::vector<std::uint32_t>& open, std::vector<DirectedEdge>& missing,
                        Root&& root) {
    constexpr double nearly_all = 0.9;
    struct Outer {
      double length = 0;  // of the inner rims
      std::vector<std::array<std::uint32_t, 2>> bridges;
    };
    std::map<std::uint32_t, double> border;
    std::map<std::uint32_t, std::map<std::uint32_t, Outer>> around;
    for (const auto& rim : rims) border[root(rim[0])] += rim_length(mesh_, rim);
    for (const Ring& ring : rings) {
      Outer& outer = around[root(ring.bridge[1])][root(ring.bridge[0])];
      outer.length += rim_length(mesh_, rims[ring.inner]), outer.bridges.push_back(ring.bridge);
    }
    std::erase_if(around, [&](const auto& wall) {
      return wall.second.size() > 1 || wall.second.begin()->second.length < nearly_all * border[wall.first];
    });
    const auto depth = [&](std::uint32_t wall) {
      std::size_t steps = 0;
      for (auto at = around.find(wall); at != around.end() && steps < rims.size(); steps++)
        at = around.find(at->second.begin()->first);
      return steps;
    };
    std::set<std::uint32_t> inner;
    for (const auto& [wall, outer] : around)
      if (depth(wall) % 2 == 1) {
        inner.insert(wall);
        const auto& bridges = outer.begin()->second.bridges;
        bridges_.insert(bridges_.end(), bridges.begin(), bridges.end());
      }
    for (const auto t : open)
      if (inner.count(root(mesh_.triangles[t][0])))
        std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]), out_.steps.turned++;
    for (DirectedEdge& e : missing)
      if (inner.count(root(e.from))) std::swap(e.from, e.to);
  }

  // Outward, so that judge() sees no inner shell take away from the winding number around it.
  void turn_units() {
    for (const auto& triangles : units_) inward_.push_back(turn_outward(triangles));
  }

  // Returns whether they faced inward.
  bool turn_outward(const std::vector<std::uint32_t>& triangles) {
    if (!(signed_volume(mesh_, triangles) < 0)) return false;
    for (const auto t : triangles) std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]);
    return true;
  }

  double diagonal_of(const std::vector<std::uint32_t>& triangles) const {
    Box box;
    for (const auto t : triangles)
      for (const auto v : mesh_.triangles[t]) box.add(mesh_.points[v]);
    return box.diagonal();
  }

  static double area_of(const Mesh& mesh, const Triangles& patch) {
    double area = 0;
    for (const auto& [a, b, c] : patch)
      area += 0.5 * (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).norm();
    return area;
  }

  void close(OpenGroup& group) {
    group.own = group.triangles.size(), group.diagonal = diagonal_of(group.triangles);
    if (options_.mode == RepairMode::sheet) return;
    group.rims = trace_rims(mesh_, group.triangles, group.missing);
    for (const auto& bridge : bridges_) join_rims(group.rims, bridge);
    for (const auto& rim : group.rims) {
      group.patches.push_back(fill_rim(mesh_, rim));
      const double length = rim_length(mesh_, rim), area = area_of(mesh_, group.patches.back());
      const bool is_long =
          length > options_.hole_size * diagonal_ && 4 * area > kNarrowHole * diagonal_ * length;
      group.is_long.push_back(is_long);
      if (is_long) group.opening = std::max(group.opening, 2 * std::sqrt(std::numbers::pi * area));
    }
    const auto add = [&](const Triangles& more) {
      for (const auto& t : more)
        group.triangles.push_back(static_cast<std::uint32_t>(mesh_.triangles.size())),
            mesh_.triangles.push_back(t);
    };
    add(group.cracks);
    for (const Triangles& patch : group.patches) add(patch);
    group.inward = turn_outward(group.triangles);
    if (group.inward)
      for (Triangles& patch : group.patches)
        for (auto& t : patch) std::swap(t[1], t[2]);
  }

  Mesh part(const std::vector<std::uint32_t>& triangles) const {
    Mesh out;
    out.points = mesh_.points;
    for (const auto t : triangles) out.triangles.push_back(mesh_.triangles[t]);
    return out;
  }

  // Which open groups are solids but for their holes?
  void judge() {
    if (options_.mode == RepairMode::sheet) return;
    std::vector<std::uint32_t> in_units, in_groups;
    for (const auto& unit : units_) in_units.insert(in_units.end(), unit.begin(), unit.end());
    bool asked = false;
    for (const OpenGroup& group : groups_) {
      in_groups.insert(in_groups.end(), group.triangles.begin(), group.triangles.end());
      asked |= group.opening > 0;
    }
    std::optional<Surface> units, groups;
    if (asked) {
      units.emplace(part(in_units), SideBy::winding), groups.emplace(part(in_groups), SideBy::winding);
      for (OpenGroup& group : groups_) find_covered(group, *units);
    }
    bool opened = false;
    for (OpenGroup& group : groups_) {
      double area = 0;
      for (const auto t : group.triangles) area += mesh_.area_normal(t).norm();
      const double volume = signed_volume(mesh_, group.triangles);
      if (!(volume > std::max(kLeastVolume * std::pow(area, 1.5), kLeastSolid * std::pow(diagonal_, 3))))
        continue;
      group.winding = 1;
      if (group.opening > 0) group.winding = mean_winding(group, *units, *groups);
      group.solid =
          options_.mode == RepairMode::fill ||
          group.winding >= (group.opening <= kWidestOpening * group.diagonal ? kLeastWinding : kSureWinding);
      opened |= group.solid && group.opening > 0;
    }
    if (opened && options_.mode == RepairMode::automatic) parts_of_one_ = enclose_more(*units, *groups);
  }

  // A wall inside a body lies with its rim in that body, too, and encloses nothing but its noise.
  bool is_flat_wall(const OpenGroup& group) const {
    double area = 0;
    for (const auto t : group.triangles) area += mesh_.area_normal(t).norm();
    return signed_volume(mesh_, group.triangles) <= kLeastWallVolume * std::pow(area, 1.5);
  }

  // A hole that a closed piece covers needs no evidence: nothing comes in there.
  void find_covered(OpenGroup& group, const Surface& units) const {
    constexpr double nearly_all = 0.95;
    constexpr std::size_t wanted = 256;
    if (group.opening == 0 || units_.empty() || is_flat_wall(group)) return;
    group.opening = 0;
    Random random(1);
    for (std::size_t r = 0; r < group.rims.size(); r++) {
      if (!group.is_long[r]) continue;
      const double area = area_of(mesh_, group.patches[r]);
      double sum = 0;
      std::size_t points = 0, covered = 0;
      for (const auto& triangle : group.patches[r]) {
        sum += area_of(mesh_, {triangle});
        for (; double(points) + 0.5 < sum / area * wanted; points++) {
          const double x = std::sqrt(random.uniform()), y = random.uniform();
          const Point p = (1 - x) * mesh_.points[triangle[0]] +
                          x * ((1 - y) * mesh_.points[triangle[1]] + y * mesh_.points[triangle[2]]);
          covered += units.any_within(p, kCrackWidth * diagonal_) || units.winding_number(p).value_or(0) > 0;
        }
      }
      if (double(covered) >= nearly_all * double(points))
        group.is_long[r] = false;
      else
        group.opening = std::max(group.opening, 2 * std::sqrt(std::numbers::pi * area));
    }
  }

  // Do the open groups together enclose more than each by itself, as strips of a scan do that overlap? Then
  // their patches lie within the body.
  bool enclose_more(const Surface& units, const Surface& groups) const {
    constexpr int points = 4096;
    Mesh solids;
    Box box;
    solids.points = mesh_.points;
    for (const OpenGroup& group : groups_)
      for (std::size_t k = 0; group.solid && k < group.triangles.size(); k++) {
        solids.triangles.push_back(mesh_.triangles[group.triangles[k]]);
        for (const auto v : solids.triangles.back()) box.add(mesh_.points[v]);
      }
    const Surface closed(solids, SideBy::winding);
    int each = 0, more = 0;
#pragma omp parallel for schedule(dynamic, 64) reduction(+ : each, more)
    for (int k = 0; k < points; k++) {
      Random random(static_cast<std::uint64_t>(k) + 1);
      const Vector at(random.uniform(), random.uniform(), random.uniform());
      const Point p = box.low + at.cwiseProduct(box.high - box.low);
      if (closed.winding_number(p).value_or(0) > 0)
        each++;
      else if (units.winding_number(p).value_or(0) <= 0 && open_winding(groups, p) > 0.5)
        more++;
    }
    return more > each;
  }

  // The mean over inner medial balls of the group once it is closed, of the winding number without the
  // patches. Where groups lie within each other, as the walls of a helmet that both face outward, it is the
  // share of what it would be with them. A ball in a closed piece is inside in any case.
  double mean_winding(const OpenGroup& group, const Surface& units, const Surface& groups) const {
    const Surface own(part(group.triangles), SideBy::winding);
    constexpr std::size_t wanted = 256;
    double area = 0;
    for (std::size_t k = 0; k < group.own; k++) area += mesh_.area_normal(group.triangles[k]).norm();
    std::vector<std::uint32_t> chosen;  // at even steps of the area
    double sum = 0;
    for (std::size_t k = 0; k < group.own; k++) {
      sum += mesh_.area_normal(group.triangles[k]).norm();
      while (double(chosen.size()) + 0.5 < sum / area * wanted && chosen.size() < wanted)
        chosen.push_back(group.triangles[k]);
    }
    std::vector<double> windings(chosen.size());
#pragma omp parallel for schedule(dynamic, 8)
    for (std::size_t k = 0; k < chosen.size(); k++) {
      const auto t = chosen[k];
      const Point p = (mesh_.corner(t, 0) + mesh_.corner(t, 1) + mesh_.corner(t, 2)) / 3;
      const Ball ball =
          inner_medial_ball(own, p, mesh_.area_normal(t).normalized(), group.diagonal, 1e-3 * group.diagonal);
      if (ball.radius == 0) continue;
      windings[k] = units.winding_number(ball.center).value_or(0) > 0 ? 1 : open_winding(groups, ball.center);
    }
    return std::accumulate(windings.begin(), windings.end(), 0.0) / double(std::max<std::size_t>(1, wanted));
  }

  // The winding number of the groups without their long patches, as a share of that with all patches.
  double open_winding(const Surface& groups, const Point& p) const {
    const double closed = groups.winding_number(p).value_or(0);
    double open = closed;
    for (const OpenGroup& group : groups_)
      for (std::size_t r = 0; r < group.rims.size(); r++)
        if (group.is_long[r])
          for (const auto& triangle : group.patches[r]) open -= solid_angle(mesh_, triangle, p);
    return std::clamp(open / std::max(1.0, closed), 0.0, 1.0);
  }

  // --- the closed soup ---

  void add(std::uint32_t t, TriangleRole role, std::uint32_t unit, std::uint32_t patch) {
    soup_.triangles.push_back(mesh_.triangles[t]);
    roles_.push_back(role), unit_.push_back(unit), patch_.push_back(patch);
  }

  void assemble() {
    soup_.points = mesh_.points;
    std::uint32_t unit = 0;
    for (const auto& triangles : units_) {
      for (const auto t : triangles) add(t, TriangleRole::bounds, unit, kNone);
      unit++;
    }
    for (const OpenGroup& group : groups_) {
      std::size_t k = 0;
      for (; k < group.own; k++)
        add(group.triangles[k], group.solid ? TriangleRole::bounds : TriangleRole::sheet, unit, kNone);
      unit++;
      inward_.push_back(group.solid && group.inward);
      if (!group.solid) {
        out_.steps.sheet_pieces++;
        if (group.winding >= out_.steps.sheet_winding)
          out_.steps.sheet_winding = group.winding, out_.steps.sheet_rim = group.opening / group.diagonal;
        continue;
      }
      for (std::size_t c = 0; c < group.cracks.size(); c++)
        add(group.triangles[k++], TriangleRole::patch, unit - 1, kNone);
      out_.steps.cracks += group.cracks.size();
      out_.steps.crack_width = std::max(out_.steps.crack_width, group.crack_width);
      for (std::size_t r = 0; r < group.rims.size(); r++) {
        for (std::size_t c = 0; c < group.patches[r].size(); c++)
          add(group.triangles[k++], TriangleRole::patch, unit - 1,
              static_cast<std::uint32_t>(out_.patches.size()));
        Patch& patch = out_.patches.emplace_back();
        patch.rim = rim_length(mesh_, group.rims[r]);
        for (const auto v : group.rims[r]) patch.place += mesh_.points[v] / double(group.rims[r].size());
      }
    }
    for (const auto t : walls_) add(t, TriangleRole::sheet, unit, kNone);
    count_ = unit + 1;
  }

  // A closed unit that faces inward and meets others was cut out of them: the winding number of the file is 0
  // or less within it. It is a cavity, if no more than half of it sticks out, and it has walls in the others:
  // the copy of a body that faces the other way has none. Where it sticks out, walls count if they are deep,
  // which those of a copy that is moved a little are not; nor is a copy of one of several bodies that touch a
  // cavity, though it has the others for walls. Points on the unit tell, at even steps of its area.
  void find_cuts(const Surface& surface, const std::vector<char>& meets, std::vector<char>& cavity) const {
    constexpr double least_wall = 0.01;    // share of the area
    constexpr double deep_wall = 1e-3;     // of the diagonal
    constexpr double most_between = 0.05;  // of the volume; what sticks out is the more surely no cavity
    constexpr std::size_t wanted = 1024;
    struct Probe {
      std::uint32_t unit;
      Point place;
      Vector out;  // of length 1
      bool within = false, wall = false, deep = false;
    };
    const std::size_t units = inward_.size();
    const auto is_inward = [&](std::uint32_t t) { return unit_[t] < units && inward_[unit_[t]]; };
    std::vector<double> area(units, 0), sum(units, 0);
    struct Count {
      std::size_t all = 0, outside = 0, walls = 0, deep = 0;
    };
    std::vector<Count> count(units);
    for (std::uint32_t t = 0; t < unit_.size(); t++)
      if (is_inward(t) && meets[unit_[t]]) area[unit_[t]] += soup_.area_normal(t).norm();
    std::vector<Probe> probes;
    Random random(1);
    for (std::uint32_t t = 0; t < unit_.size(); t++) {
      const auto u = unit_[t];
      if (!is_inward(t) || !(area[u] > 0)) continue;
      const Vector normal = soup_.area_normal(t);
      for (sum[u] += normal.norm(); double(count[u].all) + 0.5 < sum[u] / area[u] * wanted; count[u].all++) {
        const double r = std::sqrt(random.uniform()), s = random.uniform();
        const Point p =
            (1 - r) * soup_.corner(t, 0) + r * ((1 - s) * soup_.corner(t, 1) + s * soup_.corner(t, 2));
        probes.push_back({u, p, normal.normalized()});
      }
    }
    const auto in_others = [&](const Point& p) {
      const auto skip = [&](std::uint32_t t) { return roles_[t] == TriangleRole::sheet || is_inward(t); };
      for (const Vector& d : Surface::ray_directions())
        if (const auto around = surface.crossings(p, d, skip)) return *around > 0;
      return false;
    };
#pragma omp parallel for schedule(dynamic, 16)
    for (std::size_t k = 0; k < probes.size(); k++) {
      Probe& probe = probes[k];
      const auto at = [&](double step) { return in_others(probe.place + step * diagonal_ * probe.out); };
      probe.within = at(-1e-7), probe.wall = at(1e-7), probe.deep = probe.wall && at(deep_wall);
    }
    for (const Probe& probe : probes) {
      Count& c = count[probe.unit];
      c.outside += !probe.within, c.walls += probe.wall, c.deep += probe.deep;
    }
    std::vector<std::vector<std::uint32_t>> cuts(units);
    for (std::uint32_t t = 0; t < unit_.size(); t++) {
      if (!is_inward(t) || !meets[unit_[t]]) continue;
      const Count& c = count[unit_[t]];
      if (2 * c.outside <= c.all && double(c.outside > 0 ? c.deep : c.walls) > least_wall * double(c.all))
        cuts[unit_[t]].push_back(t);
    }
    for (std::size_t u = 0; u < units; u++)
      if (!cuts[u].empty() &&
          (count[u].outside == 0 || !is_copy(surface, cuts[u], most_between, [&](std::uint32_t t) {
             return roles_[t] != TriangleRole::sheet && !is_inward(t);
           })))
        cavity[u] = 1;
  }

  // A closed unit that meets no other one and lies inside others an odd number of times is a cavity, unless
  // it repeats one that faces as it does.
  void find_cavities(Contacts& contacts, const Surface& surface) {
    if (count_ < 2 || options_.mode == RepairMode::united) return;
    std::vector<char> meets(count_, 0), cavity(count_, 0);
    for (const auto& [s, t] : contacts.pairs)
      if (unit_[s] != unit_[t] && roles_[s] != TriangleRole::sheet && roles_[t] != TriangleRole::sheet)
        meets[unit_[s]] = meets[unit_[t]] = 1;
    std::vector<NestedShell> shells(count_);
    for (std::uint32_t t = 0; t < unit_.size(); t++)
      if (roles_[t] != TriangleRole::sheet) shells[unit_[t]].triangles.push_back(t);
    const auto is_sheet = [&](std::uint32_t t) { return roles_[t] == TriangleRole::sheet; };
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t u = 0; u < count_; u++) {
      NestedShell& shell = shells[u];
      if (shell.triangles.empty()) continue;
      shell.inward = u < inward_.size() && inward_[u];
      shell.volume = std::abs(signed_volume(soup_, shell.triangles));
      if (!meets[u]) shell.around = shells_around(surface, shell.triangles, unit_, is_sheet);
    }
    const std::vector<char> copy = find_repeats(soup_, shells);
    for (std::size_t u = 0; u < count_; u++) {
      out_.steps.copies += copy[u];
      std::erase_if(shells[u].around, [&](std::uint32_t a) { return copy[a]; });
      cavity[u] = !copy[u] && shells[u].around.size() % 2 != 0;
    }
    find_cuts(surface, meets, cavity);
    for (std::size_t t = 0; t < unit_.size(); t++) {
      if (cavity[unit_[t]]) std::swap(soup_.triangles[t][1], soup_.triangles[t][2]);
      if (copy[unit_[t]]) roles_[t] = TriangleRole::sheet;  // or it would fill a cavity of the other
    }
    // A cavity may cross itself, and its cuts name corners and edges by their place in a triangle.
    constexpr std::array turned = {0, 2, 1, 5, 4, 3, 6};
    for (Cut& cut : contacts.cuts)
      if (cavity[unit_[cut.triangle]])
        for (MeetingPoint& end : cut.ends) end.place = turned[static_cast<std::size_t>(end.place)];
    for (const char c : cavity) out_.steps.cavities += c;
    for (std::size_t u = 0; u < inward_.size(); u++) inward_[u] = inward_[u] && !cavity[u];
  }

  std::optional<Repaired> finish() {
    if (!surface_) surface_ = std::make_shared<const Surface>(soup_);
    const auto is_sheet = [](TriangleRole role) { return role == TriangleRole::sheet; };
    std::vector<char> passive(roles_.size());  // what bounds nothing has no cells
    std::transform(roles_.begin(), roles_.end(), passive.begin(), is_sheet);
    Contacts contacts = find_contacts(*surface_, options_.most_pairs, passive);
    why_not_ = "its triangles cross at more than " + std::to_string(options_.most_pairs) + " places";
    if (contacts.too_many) return std::nullopt;
    find_cavities(contacts, *surface_);
    if (out_.steps.cavities > 0) surface_ = std::make_shared<const Surface>(soup_);
    for (std::size_t u = 0; u < units_.size(); u++) out_.steps.turned_pieces += inward_[u];
    out_.steps.crossing_pairs = contacts.pairs.size();
    OuterCells cells = outer_cells(*surface_, roles_, contacts, options_.most_pairs);
    if (cells.too_many) return std::nullopt;
    out_.mesh = std::move(cells.mesh);
    out_.sheet = out_.mesh.triangles.size() - cells.boundary;
    out_.kind = cells.boundary > 0 ? BodyKind::solid : BodyKind::sheet;
    out_.steps.buried_area = cells.buried.area();
    if (!cells.buried.triangles.empty()) out_.marks.push_back({MarkKind::buried, std::move(cells.buried)});
    for (std::uint32_t t = 0; t < out_.mesh.triangles.size(); t++) {
      const auto from = cells.source[t];
      const double area = out_.mesh.area_normal(t).norm();
      if (t >= cells.boundary) out_.steps.sheet_area += area;
      if (patch_[from] == kNone) continue;
      Patch& patch = out_.patches[patch_[from]];
      patch.area += area, patch.triangles.push_back(t);
    }
    // A patch without area closes a crack, and one that is buried closes nothing outside.
    std::erase_if(out_.patches, [&](const Patch& p) { return !(p.area > 0); });
    out_.filled = out_.patches.size();
    for (const Patch& patch : out_.patches) out_.filled_area += patch.area;
    out_.solid = std::move(surface_);
    if (std::any_of(roles_.begin(), roles_.end(), is_sheet)) {
      Mesh solid;
      solid.points = soup_.points;
      for (std::size_t t = 0; t < roles_.size(); t++)
        if (!is_sheet(roles_[t])) solid.triangles.push_back(soup_.triangles[t]);
      out_.solid = std::make_shared<const Surface>(solid);
    }
    keep_flat();
    return std::move(out_);
  }

  // Triangles without area that lie neither in the surface nor inside the body.
  void keep_flat() {
    std::vector<std::array<std::uint32_t, 3>> flat;
    for (std::uint32_t t = 0; t < input_.triangles.size(); t++)
      if (is_flat(input_, t)) flat.push_back(input_.triangles[t]);
    if (flat.empty()) return;
    const Surface surface = out_.surface();
    const auto covered = [&](const Point& p) {
      return surface.any_within(p, 1e-9 * diagonal_) || surface.winding_number(p).value_or(0) > 0;
    };
    for (const auto& [a, b, c] : flat) {
      const Point &p = input_.points[a], &q = input_.points[b], &r = input_.points[c];
      bool all = true;
      for (const Point& x : {p, q, r, Point(0.5 * (p + q)), Point(0.5 * (q + r)), Point(0.5 * (r + p))})
        all = all && covered(x);
      if (!all) out_.flat.triangles.push_back({a, b, c});
    }
    if (!out_.flat.triangles.empty()) out_.flat.points = input_.points;
  }

  static constexpr std::uint32_t kNone = ~0u;
  const RepairOptions& options_;
  Pieces pieces_;
  Mesh& mesh_;  // of pieces_; gets the patches, too
  const Mesh& input_;
  std::optional<Mesh> split_;  // input_ with edges split
  double diagonal_ = 0;
  std::vector<std::vector<std::uint32_t>> units_;  // closed pieces
  std::vector<OpenGroup> groups_;
  std::vector<std::uint32_t> walls_;                   // triangles of pieces that bound nothing
  std::vector<std::array<std::uint32_t, 2>> bridges_;  // of rings (holes.h)
  Mesh soup_;
  std::shared_ptr<const Surface> surface_;  // of soup_
  std::vector<TriangleRole> roles_;
  std::vector<std::uint32_t> unit_, patch_;  // of each triangle of soup_
  std::size_t count_ = 0;                    // of units
  std::vector<char> inward_;  // for each closed unit and group: it faced inward, and is no cavity
  bool parts_of_one_ = false;
  std::string why_not_;
  Repaired out_;
};

}  // namespace

std::optional<Repaired> mend(const Mesh& input, const RepairOptions& options, std::string* why_not) {
  Mender mender(input, options);
  auto body = mender.run();
  if (why_not) *why_not = mender.why_not();
  return body;
}

std::optional<Repaired> mend_piece(std::shared_ptr<const Surface> piece, const RepairOptions& options,
                                   std::string* why_not) {
  Mender mender(std::move(piece), options);
  auto body = mender.run();
  if (why_not) *why_not = mender.why_not();
  return body;
}

}  // namespace padder
