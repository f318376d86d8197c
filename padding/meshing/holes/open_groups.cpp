// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/open_groups.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>

#include "padding/geometry/medial.h"
#include "padding/geometry/random.h"
#include "padding/meshing/holes/cracks.h"
#include "padding/meshing/holes/facing.h"
#include "padding/meshing/holes/sealed_room.h"

namespace padder {
namespace {

// A hole whose rim is at most this share of the diagonal is always closed.
constexpr double kSmallHole = 0.15;
// A hole as narrow as this share of the diagonal is closed however long it is.
constexpr double kNarrowHole = 1e-3;
// An open piece is a solid with holes if the mean winding number of what is there, over what the patches
// would enclose, is at least this: the larger for any opening, the smaller for one of at most so many
// diagonals of the piece around. A cube without its lid has 0.86 and 2.05 diagonals, half of a ball 0.7
// and 2.2.
constexpr double kSureWinding = 0.9, kLeastWinding = 0.8, kWidestOpening = 1.5;
// An open piece that encloses less than this share of (its area)^1.5 encloses nothing, nor does one that
// encloses less than this share of (the mesh's diagonal)^3, as what is left of a sheet between its cracks.
constexpr double kLeastVolume = 1e-7, kLeastSolid = 1e-15;
// A piece that encloses less than this share of (its area)^1.5 is flat: neither the inner wall of one around
// it, nor a solid whose hole another one covers.
constexpr double kLeastWallVolume = 1e-3;

class PieceCloser {
 public:
  PieceCloser(Mesh& mesh, const std::vector<std::vector<std::uint32_t>>& units, const RepairOptions& options,
              double diagonal, RepairSteps& steps)
      : mesh_(mesh), units_(units), options_(options), diagonal_(diagonal), steps_(steps) {}

  OpenGroups run(const std::vector<std::uint32_t>& open) {
    collect_groups(open);
    for (OpenGroup& group : groups_) close(group);
    judge();
    return {std::move(groups_), parts_of_one_};
  }

 private:
  // Open pieces belong together where they share points or a crack between them is closed.
  void collect_groups(const std::vector<std::uint32_t>& open) {
    std::vector<std::uint32_t> parent = numbered(mesh_.points.size());
    const auto root = [&](std::uint32_t v) { return root_of(parent, v); };
    const auto join_corners = [&](const Corners& t) { join(parent, t[0], t[1]), join(parent, t[0], t[2]); };
    for (const auto t : open) join_corners(mesh_.triangles[t]);
    const double width = crack_limit(options_, diagonal_);
    if (options_.mode != RepairMode::sheet) steps_.turned += face_alike(mesh_, open, width);
    std::vector<DirectedEdge> missing = missing_edges(mesh_, open);
    std::vector<CrackTriangle> cracks;
    if (options_.mode != RepairMode::sheet) cracks = close_cracks(mesh_, missing, width);
    for (const CrackTriangle& crack : cracks) join_corners(crack.triangle);
    if (options_.mode != RepairMode::sheet) find_bridges(open, missing, root);
    for (const auto& [a, b] : bridges_) join(parent, a, b);

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

  struct Filled {  // a piece with its rims filled
    double volume = 0, area = 0;
  };

  // Which rims bound one hole together: those of rings at the ends of pipes, and those of bands.
  template <class Root>
  void find_bridges(const std::vector<std::uint32_t>& open, std::vector<DirectedEdge>& missing, Root&& root) {
    auto rims = trace_rims(mesh_, open, missing);
    if (rims.size() < 2) return;
    std::vector<Filled> filled(mesh_.points.size());  // at the root of each piece
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      const Point &p = mesh_.points[a], &q = mesh_.points[b], &r = mesh_.points[c];
      Filled& piece = filled[root(a)];
      piece.volume += p.dot(q.cross(r)) / 6, piece.area += (q - p).cross(r - p).norm() / 2;
    };
    for (const auto t : open) add(mesh_.triangles[t][0], mesh_.triangles[t][1], mesh_.triangles[t][2]);
    for (const auto& rim : rims)
      for (std::size_t k = 1; k + 1 < rim.size(); k++) add(rim[0], rim[k], rim[k + 1]);

    std::vector<Ring> rings = find_rings(mesh_, rims);
    std::vector<std::uint32_t> piece;
    for (const auto& rim : rims) piece.push_back(root(rim[0]));
    for (const Ring& ring : rings) piece[ring.outer] = piece[ring.inner] = kNone;
    if (!rings.empty()) find_pipes(rims, rings, filled, open, missing, root);
    for (auto& rim : rims)
      if (filled[root(rim[0])].volume < 0) std::reverse(rim.begin(), rim.end());  // as if it faced outward
    PieceTriangles triangles_of;
    for (const auto t : open) triangles_of[root(mesh_.triangles[t][0])].push_back(t);
    const auto bands = find_bands(mesh_, rims, piece, triangles_of);
    bridges_.insert(bridges_.end(), bands.begin(), bands.end());
  }

  // The outer wall of a pipe faces outward and the inner one inward, or the other way round where no pipe is
  // so. Where there are none, both walls may face outward, as those of a helmet: then the inner one is
  // turned.
  template <class Root>
  void find_pipes(const std::vector<std::vector<std::uint32_t>>& rims, std::vector<Ring>& rings,
                  const std::vector<Filled>& filled, const std::vector<std::uint32_t>& open,
                  std::vector<DirectedEdge>& missing, Root&& root) {
    for (const int sign : {1, -1}) {
      for (const Ring& ring : rings)
        if (!ring.alike && sign * filled[root(ring.bridge[0])].volume > 0 &&
            sign * filled[root(ring.bridge[1])].volume < 0)
          bridges_.push_back(ring.bridge);
      if (!bridges_.empty()) return;
    }
    std::erase_if(rings, [&](const Ring& ring) {
      const auto encloses = [&](std::uint32_t v) {
        const Filled& piece = filled[root(v)];
        return std::abs(piece.volume) > kLeastWallVolume * std::pow(piece.area, 1.5);
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
        std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]), steps_.turned++;
    for (DirectedEdge& e : missing)
      if (inner.count(root(e.from))) std::swap(e.from, e.to);
  }

  static double patch_area(const Mesh& mesh, const Triangles& patch) {
    double area = 0;
    for (const auto& [a, b, c] : patch)
      area += 0.5 * (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).norm();
    return area;
  }

  void close(OpenGroup& group) {
    group.own = group.triangles.size(), group.diagonal = bounds_of(mesh_, group.triangles).diagonal();
    if (options_.mode == RepairMode::sheet) return;
    group.rims = trace_rims(mesh_, group.triangles, group.missing);
    for (const auto& bridge : bridges_) join_rims(group.rims, bridge);
    for (const auto& rim : group.rims) {
      group.patches.push_back(fill_rim(mesh_, rim));
      const double length = rim_length(mesh_, rim), area = patch_area(mesh_, group.patches.back());
      const bool is_long = length > kSmallHole * diagonal_ && 4 * area > kNarrowHole * diagonal_ * length;
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
    group.inward = turn_outward(mesh_, group.triangles);
    if (group.inward)
      for (Triangles& patch : group.patches)
        for (auto& t : patch) std::swap(t[1], t[2]);
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
      units.emplace(part_of(mesh_, in_units), SideBy::winding),
          groups.emplace(part_of(mesh_, in_groups), SideBy::winding);
      for (OpenGroup& group : groups_) find_covered(group, *units);
    }
    bool opened = false;
    for (OpenGroup& group : groups_) {
      const double area = area_of(mesh_, group.triangles), volume = signed_volume(mesh_, group.triangles);
      // Copies that lie as close as cracks are wide are closed to a shell without thickness, which is no
      // body.
      const double thinnest = group.crack_width * area;
      if (!(volume >
            std::max({kLeastVolume * std::pow(area, 1.5), kLeastSolid * std::pow(diagonal_, 3), thinnest})))
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
    return signed_volume(mesh_, group.triangles) <=
           kLeastWallVolume * std::pow(area_of(mesh_, group.triangles), 1.5);
  }

  // A hole that a closed piece covers needs no evidence: nothing comes in there.
  void find_covered(OpenGroup& group, const Surface& units) const {
    constexpr double nearly_all = 0.85;
    constexpr std::size_t wanted = 256;
    if (group.opening == 0 || units_.empty() || is_flat_wall(group)) return;
    group.opening = 0;
    Random random(1);
    for (std::size_t r = 0; r < group.rims.size(); r++) {
      if (!group.is_long[r]) continue;
      const double area = patch_area(mesh_, group.patches[r]);
      EvenSteps steps(area, wanted);
      std::size_t points = 0, covered = 0;
      for (const auto& triangle : group.patches[r]) {
        const std::size_t more = steps.next(patch_area(mesh_, {triangle}));
        points += more;
        for (std::size_t k = 0; k < more; k++) {
          const auto& [a, b, c] = triangle;
          const Point p = random_point(random, {mesh_.points[a], mesh_.points[b], mesh_.points[c]});
          covered += units.any_within(p, kCrackWidth * diagonal_) || units.winding_number(p).value_or(0) > 0;
        }
      }
      if (double(covered) >= nearly_all * double(points))
        group.is_long[r] = false;
      else
        group.opening = std::max(group.opening, 2 * std::sqrt(std::numbers::pi * area));
    }
  }

  // Do the open groups together enclose more than each with its own patches, as strips of a scan do that
  // overlap? Then these patches lie within the body, and a wrap is right; but only as far as it encloses that
  // body: it goes into a car through the windows.
  bool enclose_more(const Surface& units, const Surface& groups) const {
    constexpr int points = 4096;
    Mesh walls = units.mesh(), solids;
    Box box;
    solids.points = mesh_.points;
    for (const OpenGroup& group : groups_)
      for (std::size_t k = 0; k < group.triangles.size(); k++) {
        const auto& triangle = mesh_.triangles[group.triangles[k]];
        if (k < group.own + group.cracks.size()) walls.triangles.push_back(triangle);
        if (!group.solid) continue;
        solids.triangles.push_back(triangle);
        for (const auto v : triangle) box.add(mesh_.points[v]);
      }
    const SealedRoom room(walls, wrap_alpha(options_, diagonal_));
    const Surface closed(solids, SideBy::winding);
    int each = 0, more = 0;
#pragma omp parallel for schedule(dynamic, 64) reduction(+ : each, more)
    for (int k = 0; k < points; k++) {
      Random random(static_cast<std::uint64_t>(k) + 1);
      const Vector at(random.uniform(), random.uniform(), random.uniform());
      const Point p = box.low + at.cwiseProduct(box.high - box.low);
      if (closed.winding_number(p).value_or(0) > 0)
        each++;
      else if (room.holds(p) && units.winding_number(p).value_or(0) <= 0 && open_winding(groups, p) > 0.5)
        more++;
    }
    return more > each;
  }

  // The mean over inner medial balls of the group once it is closed, of the winding number without the
  // patches. Where groups lie within each other, as the walls of a helmet that both face outward, it is the
  // share of what it would be with them. A ball in a closed piece is inside in any case.
  double mean_winding(const OpenGroup& group, const Surface& units, const Surface& groups) const {
    const Surface own(part_of(mesh_, group.triangles), SideBy::winding);
    constexpr std::size_t wanted = 256;
    double area = 0;
    for (std::size_t k = 0; k < group.own; k++) area += mesh_.area_normal(group.triangles[k]).norm();
    std::vector<std::uint32_t> chosen;
    EvenSteps steps(area, wanted);
    for (std::size_t k = 0; k < group.own; k++)
      chosen.insert(chosen.end(), steps.next(mesh_.area_normal(group.triangles[k]).norm()),
                    group.triangles[k]);
    std::vector<double> windings(chosen.size());
#pragma omp parallel for schedule(dynamic, 8)
    for (std::size_t k = 0; k < chosen.size(); k++) {
      const auto t = chosen[k];
      const Point p = mesh_.middle(t);
      const Ball ball =
          inner_medial_ball(own, p, mesh_.area_normal(t).normalized(), group.diagonal, 1e-3 * group.diagonal);
      if (ball.radius == 0) continue;
      windings[k] = units.winding_number(ball.center).value_or(0) > 0 ? 1 : open_winding(groups, ball.center);
    }
    return std::accumulate(windings.begin(), windings.end(), 0.0) / double(wanted);
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

  static constexpr std::uint32_t kNone = ~0u;
  Mesh& mesh_;  // gets the patches
  const std::vector<std::vector<std::uint32_t>>& units_;
  const RepairOptions& options_;
  const double diagonal_;
  RepairSteps& steps_;
  std::vector<OpenGroup> groups_;
  std::vector<std::array<std::uint32_t, 2>> bridges_;  // of rings (holes.h)
  bool parts_of_one_ = false;
};

}  // namespace

OpenGroups close_open_pieces(Mesh& mesh, const std::vector<std::uint32_t>& open,
                             const std::vector<std::vector<std::uint32_t>>& units,
                             const RepairOptions& options, double diagonal, RepairSteps& steps) {
  return PieceCloser(mesh, units, options, diagonal, steps).run(open);
}

}  // namespace padder
