// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/pieces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "padding/geometry/random.h"
#include "padding/meshing/holes/holes.h"
#include "padding/meshing/turns.h"

namespace padder {
namespace {

// What encloses less than this share of (its area)^1.5 encloses nothing.
constexpr double kLeastEnclosed = 1e-6;

bool closes(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  return missing_edges(mesh, triangles).empty();
}

// The triangles that hang together by the edges for which joins(number of triangles) holds, in their order.
template <class Joins>
std::vector<std::vector<std::uint32_t>> connected(const Mesh& mesh,
                                                  const std::vector<std::uint32_t>& triangles,
                                                  Joins&& joins) {
  std::vector<std::uint32_t> parent = numbered(mesh.triangles.size());
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    if (!joins(end - begin)) return;
    for (std::size_t k = begin + 1; k < end; k++) join(parent, sides[begin].triangle, sides[k].triangle);
  });
  std::vector<std::vector<std::uint32_t>> members(mesh.triangles.size());
  for (const auto t : triangles) members[root_of(parent, t)].push_back(t);
  std::erase_if(members, [](const auto& m) { return m.empty(); });
  return members;
}

// Each point gets the first index of the points that are equal to it.
Mesh merged(const Mesh& soup) {
  std::size_t slots = 16;
  while (slots < 2 * soup.points.size()) slots *= 2;
  std::vector<std::uint32_t> table(slots, ~0u), index(soup.points.size());
  for (std::uint32_t v = 0; v < soup.points.size(); v++) {
    std::uint64_t hash = 0;
    for (const double x : soup.points[v])  // + 0.0 makes one of the two zeros
      hash = Random(hash ^ std::bit_cast<std::uint64_t>(x + 0.0)).next();
    std::size_t at = hash & (slots - 1);
    while (table[at] != ~0u && soup.points[table[at]] != soup.points[v]) at = (at + 1) & (slots - 1);
    if (table[at] == ~0u) table[at] = v;
    index[v] = table[at];
  }
  Mesh out;
  out.points = soup.points;
  for (const auto& t : soup.triangles) {
    const Corners c = {index[t[0]], index[t[1]], index[t[2]]};
    if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) out.triangles.push_back(c);
  }
  return out;
}

// The skin of a piece: those of its triangles that part what lies outside from what it encloses. Each
// triangle has two sides. Around an edge, the sides that face each other belong together, so the sides form
// shells, each around one cell of space. A shell that faces away from what it encloses has the outside before
// it.
class Skin {
 public:
  // Turns the triangles of the skin outward, if it encloses a volume.
  Skin(Mesh& mesh, const std::vector<std::uint32_t>& triangles) : mesh_(mesh), triangles_(triangles) {
    const std::size_t given = mesh_.triangles.size();
    const std::vector<Side> sides = sides_of(mesh_, triangles_);
    bool crowded = false;
    for_edges(sides, [&](std::size_t begin, std::size_t end) { crowded |= end - begin > 2; });
    if (!crowded) return;
    // Holes are closed for the time being, or the outside would come in.
    for (const auto& rim : round_rims(sides))
      for (const auto& t : fill_rim(mesh_, rim)) {
        triangles_.push_back(static_cast<std::uint32_t>(mesh_.triangles.size()));
        mesh_.triangles.push_back(t);
      }
    find_shells();
    double area = 0, area_outside = 0;
    std::vector<std::uint32_t> inward;
    for (std::size_t k = 0; k < triangles_.size(); k++) {
      const std::uint32_t t = triangles_[k];
      const bool front = is_outside(2 * k), back = is_outside(2 * k + 1);
      if (front != back) enclosed += front ? volume(k) : -volume(k);
      if (t >= given) continue;
      (front != back ? skin : front ? outside : inside).push_back(t);
      (front && back ? area_outside : area) += mesh_.area_normal(t).norm();
      if (back && !front) inward.push_back(t);
    }
    mesh_.triangles.resize(given);
    found = enclosed > kLeastEnclosed * std::pow(area, 1.5) && area > area_outside;
    if (!found) return;
    for (const auto t : inward) std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]);
    turned = inward.size();
  }

  // More than two triangles meet in an edge, and the piece is mostly skin and what is in it.
  bool found = false;
  double enclosed = 0;
  std::vector<std::uint32_t> skin, inside, outside;
  std::size_t turned = 0;  // triangles of the skin

 private:
  // Closed paths of edges of one triangle, without those that branch.
  static std::vector<std::vector<std::uint32_t>> round_rims(const std::vector<Side>& sides) {
    std::map<std::uint32_t, std::vector<std::uint32_t>> ways;
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      if (end - begin != 1) return;
      const auto [low, high] = ends_of(sides[begin].edge);
      ways[low].push_back(high), ways[high].push_back(low);
    });
    std::vector<std::vector<std::uint32_t>> rims;
    while (!ways.empty()) {
      std::vector<std::uint32_t> rim;
      bool branches = false, closes = false;
      std::uint32_t at = ways.begin()->first;
      for (auto way = ways.begin(); way != ways.end(); way = ways.find(at)) {
        const std::vector<std::uint32_t> next = way->second;
        branches |= next.size() != 2;
        rim.push_back(at);
        closes = std::find(next.begin(), next.end(), rim.front()) != next.end();
        ways.erase(way);
        at = ways.count(next[0]) ? next[0] : next.back();
      }
      if (!branches && closes && rim.size() > 2) rims.push_back(std::move(rim));
    }
    return rims;
  }

  // A triangle at an edge, as one turns round it.
  struct Leaf {
    static constexpr double kSame = 1e-9;  // angles that differ by rounding alone
    double angle;
    std::uint32_t face;
    bool faces_ahead;             // its front looks to where one turns
    std::uint32_t ahead, behind;  // its sides
  };

  // By angle. Of triangles that lie on each other, as where a face is given twice, cut along one diagonal and
  // along the other, it must be the same face along all edges that is nearer to the body: the first of two
  // faces lies behind the other one, seen from its front.
  static void sort_round(std::vector<Leaf>& leaves) {
    const auto by_angle = [](const Leaf& a, const Leaf& b) { return a.angle < b.angle; };
    std::stable_sort(leaves.begin(), leaves.end(), by_angle);
    for (auto begin = leaves.begin(), end = begin; begin != leaves.end(); begin = end) {
      while (end != leaves.end() && end->angle - begin->angle < Leaf::kSame) end++;
      std::stable_sort(begin, end, [](const Leaf& a, const Leaf& b) {
        return a.face < b.face ? a.faces_ahead : a.face > b.face && !b.faces_ahead;
      });
    }
  }

  void find_shells() {
    parent_ = numbered(2 * triangles_.size());
    std::map<std::uint32_t, std::uint32_t> local;
    for (const auto t : triangles_) local.emplace(t, static_cast<std::uint32_t>(local.size()));
    const std::vector<Side> sides = sides_of(mesh_, triangles_);
    std::vector<std::uint32_t> face =
        numbered(triangles_.size());  // those that two-sided edges hold together
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      if (end - begin == 2) join(face, local.at(sides[begin].triangle), local.at(sides[begin + 1].triangle));
    });
    std::vector<Leaf> leaves;
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      const auto [from, to] = ends_of(sides[begin].edge);
      const Point &low = mesh_.points[from], &high = mesh_.points[to];
      const Vector along = (high - low).normalized();
      leaves.clear();
      Vector x = Vector::Zero();
      for (std::size_t k = begin; k < end; k++) {
        Vector away = Vector::Zero();
        for (const auto v : mesh_.triangles[sides[k].triangle]) away += mesh_.points[v] - low;
        away -= high - low;  // to the third corner
        if (k == begin) x = (away - away.dot(along) * along).normalized();
        const Vector y = along.cross(x);
        double angle = std::atan2(away.dot(y), away.dot(x));  // from the first one on
        if (angle < -Leaf::kSame) angle += 2 * std::numbers::pi;
        const std::uint32_t at = local.at(sides[k].triangle), front = 2 * at;
        const bool ahead = sides[k].direction > 0;
        leaves.push_back(
            {angle, root_of(face, at), ahead, ahead ? front : front + 1, ahead ? front + 1 : front});
      }
      sort_round(leaves);
      for (std::size_t k = 0; k < leaves.size(); k++)
        join(parent_, leaves[k].ahead, leaves[(k + 1) % leaves.size()].behind);
    });
    shell_volume_.assign(parent_.size(), 0);
    for (std::size_t k = 0; k < triangles_.size(); k++)
      for (const std::uint32_t side : {0u, 1u})
        shell_volume_[root_of(parent_, static_cast<std::uint32_t>(2 * k + side))] +=
            side ? -volume(k) : volume(k);
  }

  bool is_outside(std::size_t side) {
    return shell_volume_[root_of(parent_, static_cast<std::uint32_t>(side))] > 0;
  }

  double volume(std::size_t k) const {  // from a point to the triangle
    const Point& origin = mesh_.corner(triangles_[0], 0);
    const auto corner = [&](int c) -> Vector { return mesh_.corner(triangles_[k], c) - origin; };
    return corner(0).dot(corner(1).cross(corner(2))) / 6;
  }

  Mesh& mesh_;                            // for the time being with patches
  std::vector<std::uint32_t> triangles_;  // with the patches
  std::vector<std::uint32_t> parent_;     // of sides: 2 k is the front of triangle k, 2 k + 1 its back
  std::vector<double> shell_volume_;      // of a root
};

// Settles one piece: which triangles count, and which way they face.
class PieceWork {
 public:
  PieceWork(Mesh& mesh, std::vector<std::uint32_t> triangles, Pieces& all)
      : mesh_(mesh), triangles_(std::move(triangles)), all_(all) {}

  std::vector<Piece> run() {
    const std::vector<std::uint32_t> once = without_repeats(false);
    if (closes(mesh_, once)) return keep(once, true);
    const std::vector<Corners> given = corners(once);
    orient(once);
    const bool closed = closes(mesh_, once);
    if (!closed) {
      const std::vector<Corners> turned = corners(once);
      set_corners(once, given);
      const bool repeats = once.size() < triangles_.size();
      if (const auto both_ways = without_repeats(true); repeats && is_body(both_ways))
        return keep(both_ways, true);
      // A body that faces inward repeats walls of its neighbours in the same direction. All edges close with
      // them, but its volume is taken away.
      const double enclosed = repeats && is_body(triangles_) ? std::abs(signed_volume(mesh_, triangles_)) : 0;
      Skin skin(mesh_, once);
      if (skin.found && skin.enclosed > (1 + kLeastEnclosed) * enclosed)
        return keep_skin(std::move(skin), once.size());
      set_corners(once, enclosed > 0 ? given : turned);
      if (enclosed > 0) return keep(triangles_, true);
    }
    for (std::size_t k = 0; k < once.size(); k++) all_.turned += given[k] != mesh_.triangles[once[k]];
    return keep(once, closed);
  }

  // The same for triangles that run() has left outside: they have no walls and do not repeat.
  Piece run_outside() {
    const std::vector<Corners> given = corners(triangles_);
    orient(triangles_);
    for (std::size_t k = 0; k < given.size(); k++) all_.turned += given[k] != mesh_.triangles[triangles_[k]];
    return {triangles_, closes(mesh_, triangles_)};
  }

  // After run(): what stands on the pieces from outside.
  const std::vector<std::uint32_t>& outside() const { return outside_; }

 private:
  std::vector<Corners> corners(const std::vector<std::uint32_t>& triangles) const {
    std::vector<Corners> out;
    for (const auto t : triangles) out.push_back(mesh_.triangles[t]);
    return out;
  }

  void set_corners(const std::vector<std::uint32_t>& triangles, const std::vector<Corners>& corners) {
    for (std::size_t k = 0; k < triangles.size(); k++) mesh_.triangles[triangles[k]] = corners[k];
  }

  std::vector<Piece> keep(const std::vector<std::uint32_t>& triangles, bool closed) {
    all_.repeated += triangles_.size() - triangles.size();
    return {{triangles, closed}};
  }

  std::vector<Piece> keep_skin(Skin skin, std::size_t count) {
    all_.repeated += triangles_.size() - count;
    all_.turned += skin.turned;
    outside_ = std::move(skin.outside);
    std::vector<Piece> pieces = {{skin.skin, closes(mesh_, skin.skin)}};
    if (!skin.inside.empty()) pieces.push_back({skin.inside, false, true});
    return pieces;
  }

  // Repeated triangles are walls of bodies that touch or share a face, if all edges close with them, as
  // given, and the piece encloses a volume then: a surface whose triangles face both ways closes, too.
  bool is_body(const std::vector<std::uint32_t>& triangles) const {
    return closes(mesh_, triangles) && std::abs(signed_volume(mesh_, triangles)) >
                                           kLeastEnclosed * std::pow(area_of(mesh_, triangles_), 1.5);
  }

  // Without triangles that have the same corners as one before; with `both_ways`, the same direction, too.
  std::vector<std::uint32_t> without_repeats(bool both_ways) const {
    std::vector<std::pair<Corners, std::uint32_t>> named;
    for (const auto t : triangles_) {
      Corners c = mesh_.triangles[t];
      if (both_ways)
        std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
      else
        std::sort(c.begin(), c.end());
      named.push_back({c, t});
    }
    std::sort(named.begin(), named.end());
    std::vector<std::uint32_t> kept;
    for (std::size_t k = 0; k < named.size(); k++)
      if (k == 0 || named[k].first != named[k - 1].first) kept.push_back(named[k].second);
    std::sort(kept.begin(), kept.end());
    return kept;
  }

  void turn(std::uint32_t t) { std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]); }

  // Turns neighbours alike over the edges of two triangles. The parts between other edges then face as most
  // of their triangles did, or so that more edges close. Where no turning makes all alike, as at a twist of a
  // few triangles in a closed body, those that face alike already stay so.
  void orient(const std::vector<std::uint32_t>& triangles) {
    const std::vector<Side> sides = sides_of(mesh_, triangles);
    std::map<std::uint32_t, std::uint32_t> local;
    for (const auto t : triangles) local.emplace(t, static_cast<std::uint32_t>(local.size()));
    Turns turns(triangles.size());
    for (const bool alike : {true, false})
      for_edges(sides, [&](std::size_t begin, std::size_t end) {
        const Side &a = sides[begin], &b = sides[end - 1];
        if (end - begin == 2 && alike == (a.direction != b.direction))
          turns.join(local[a.triangle], local[b.triangle], alike);
      });
    std::vector<int> part(triangles.size(), -1), way(triangles.size(), 1), of_root(triangles.size(), -1);
    std::vector<long> votes;
    for (std::uint32_t k = 0; k < triangles.size(); k++) {
      const auto [root, turned] = turns.root(k);
      if (of_root[root] < 0) of_root[root] = static_cast<int>(votes.size()), votes.push_back(0);
      part[k] = of_root[root], way[k] = turned ? -1 : 1;
      votes[static_cast<std::size_t>(part[k])] += way[k];
    }
    std::vector<int> sign;
    for (const long vote : votes) sign.push_back(vote < 0 ? -1 : 1);
    if (sign.size() > 1) close_more(sides, local, part, way, sign);
    for (std::size_t k = 0; k < triangles.size(); k++)
      if (way[k] * sign[part[k]] < 0) turn(triangles[k]);
  }

  // Turns whole parts as long as that closes more edges.
  static void close_more(const std::vector<Side>& sides, const std::map<std::uint32_t, std::uint32_t>& local,
                         const std::vector<int>& part, const std::vector<int>& way, std::vector<int>& sign) {
    // For each edge the sum of directions of each part that has it.
    std::vector<std::vector<std::pair<int, int>>> edges;
    std::vector<std::vector<std::size_t>> edges_of(sign.size());
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      std::map<int, int> sums;
      for (std::size_t k = begin; k < end; k++) {
        const auto t = local.at(sides[k].triangle);
        sums[part[t]] += sides[k].direction * way[t];
      }
      if (sums.size() < 2) return;
      for (const auto& [p, sum] : sums) edges_of[p].push_back(edges.size());
      edges.emplace_back(sums.begin(), sums.end());
    });
    for (int round = 0, better = 1; better && round < 20; round++) {
      better = 0;
      for (std::size_t p = 0; p < sign.size(); p++) {
        long gain = 0;
        for (const auto e : edges_of[p]) {
          long sum = 0, own = 0;
          for (const auto& [q, s] : edges[e])
            sum += sign[q] * s, own += q == static_cast<int>(p) ? sign[q] * s : 0;
          gain += std::abs(sum) - std::abs(sum - 2 * own);
        }
        if (gain > 0) sign[p] = -sign[p], better = 1;
      }
    }
  }

  Mesh& mesh_;
  const std::vector<std::uint32_t> triangles_;
  std::vector<std::uint32_t> outside_;
  Pieces& all_;
};

}  // namespace

std::optional<Mesh> one_closed_piece(const Mesh& soup) {
  Mesh mesh = merged(soup);
  if (mesh.triangles.empty() || mesh.triangles.size() < soup.triangles.size()) return std::nullopt;
  const std::vector<Side> sides = sides_of(mesh, numbered(mesh.triangles.size()));
  // Triangles that meet in an edge have one root, and so have their corners at each end of it.
  std::vector<std::uint32_t> piece = numbered(mesh.triangles.size()), round = numbered(3 * piece.size());
  std::size_t pieces = piece.size(), rounds = round.size();
  for (std::size_t k = 0; k < sides.size(); k += 2) {
    if (k + 1 == sides.size() || sides[k].edge != sides[k + 1].edge ||
        sides[k].direction == sides[k + 1].direction ||
        (k + 2 < sides.size() && sides[k + 2].edge == sides[k].edge))
      return std::nullopt;
    const auto s = sides[k].triangle, t = sides[k + 1].triangle;
    pieces -= join(piece, s, t);
    for (const auto v : ends_of(sides[k].edge))
      rounds -= join(round, corner_with(mesh.triangles, s, v), corner_with(mesh.triangles, t, v));
  }
  mesh.drop_unused_points();
  if (pieces > 1 || rounds > mesh.points.size()) return std::nullopt;
  return mesh;
}

std::vector<Side> sides_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  const auto side = [&](std::uint32_t t, int k) -> Side {
    const auto u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
    return {edge_of(u, v), t, u < v ? 1 : -1};
  };
  std::vector<Side> sides(3 * triangles.size());
#pragma omp parallel for schedule(static) if (sides.size() > 16384)
  for (std::size_t k = 0; k < sides.size(); k++) sides[k] = side(triangles[k / 3], static_cast<int>(k % 3));
  const auto before = [](const Side& a, const Side& b) { return a.triangle < b.triangle; };
  if (4 * triangles.size() < mesh.points.size())  // a small piece of a large mesh
    std::sort(sides.begin(), sides.end(), [&](const Side& a, const Side& b) {
      return a.edge != b.edge ? a.edge < b.edge : before(a, b);
    });
  else
    sort_by_edge(
        sides, mesh.points.size(), [](const Side& s) { return s.edge; }, before);
  return sides;
}

double area_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  double sum = 0;
  for (const auto t : triangles) sum += mesh.area_normal(t).norm();
  return sum;
}

double signed_volume(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  if (triangles.empty()) return 0;
  const Point origin = mesh.corner(triangles[0], 0);
  double sum = 0;
  for (const auto t : triangles)
    sum += (mesh.corner(t, 0) - origin).dot((mesh.corner(t, 1) - origin).cross(mesh.corner(t, 2) - origin));
  return sum / 6;
}

bool turn_outward(Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  if (!(signed_volume(mesh, triangles) < 0)) return false;
  for (const auto t : triangles) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  return true;
}

Box bounds_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  Box box;
  for (const auto t : triangles)
    for (const auto v : mesh.triangles[t]) box.add(mesh.points[v]);
  return box;
}

Mesh part_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  Mesh out;
  out.points = mesh.points;
  for (const auto t : triangles) out.triangles.push_back(mesh.triangles[t]);
  return out;
}

std::vector<DirectedEdge> missing_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  std::vector<DirectedEdge> missing;
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    int sum = 0;
    for (std::size_t k = begin; k < end; k++) sum += sides[k].direction;
    const auto [low, high] = ends_of(sides[begin].edge);
    for (; sum > 0; sum--) missing.push_back({high, low});
    for (; sum < 0; sum++) missing.push_back({low, high});
  });
  return missing;
}

Pieces find_pieces(const Mesh& soup) {
  Pieces out;
  out.mesh = merged(soup);
  const std::vector<std::uint32_t> all = numbered(out.mesh.triangles.size());
  std::vector<std::uint32_t> rest;
  // A part that closes without the others that share an edge with it is a body of its own.
  for (auto& part : connected(out.mesh, all, [](std::size_t n) { return n == 2; })) {
    const auto sides = sides_of(out.mesh, part);
    bool pairs = true;
    for_edges(sides, [&](std::size_t begin, std::size_t end) { pairs = pairs && (end - begin) % 2 == 0; });
    if (!pairs) {
      rest.insert(rest.end(), part.begin(), part.end());
      continue;
    }
    const std::size_t repeated = out.repeated, turned = out.turned;
    std::vector<Corners> given;
    for (const auto t : part) given.push_back(out.mesh.triangles[t]);
    std::vector<Piece> made = PieceWork(out.mesh, part, out).run();
    if (made[0].closed && made[0].triangles.size() == part.size()) {
      out.pieces.push_back(std::move(made[0]));
      continue;
    }
    for (std::size_t k = 0; k < part.size(); k++) out.mesh.triangles[part[k]] = given[k];
    out.repeated = repeated, out.turned = turned;
    rest.insert(rest.end(), part.begin(), part.end());
  }
  std::sort(rest.begin(), rest.end());
  std::vector<std::uint32_t> outside;
  for (auto& part : connected(out.mesh, rest, [](std::size_t) { return true; })) {
    PieceWork work(out.mesh, std::move(part), out);
    for (Piece& piece : work.run()) out.pieces.push_back(std::move(piece));
    outside.insert(outside.end(), work.outside().begin(), work.outside().end());
  }
  std::sort(outside.begin(), outside.end());
  for (auto& part : connected(out.mesh, outside, [](std::size_t) { return true; }))
    out.pieces.push_back(PieceWork(out.mesh, std::move(part), out).run_outside());
  return out;
}

}  // namespace padder
