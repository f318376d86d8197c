// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/pieces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "padding/geometry/random.h"

namespace padder {
namespace {

bool closes(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  return missing_edges(mesh, triangles).empty();
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

// Triangles that are joined, and which of them are turned against the first of theirs.
class Turns {
 public:
  explicit Turns(std::size_t count) : parent_(count), turned_(count, 0) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  // The first triangle of k's, and whether k is turned against it.
  std::pair<std::uint32_t, bool> root(std::uint32_t k) {
    bool turned = false;
    while (parent_[k] != k) {  // shortens the way for later calls, as root_of does
      const std::uint32_t above = parent_[k];
      turned_[k] = turned_[k] != turned_[above];
      turned = turned != static_cast<bool>(turned_[k]);
      k = parent_[k] = parent_[above];
    }
    return {k, turned};
  }
  // Says how the two face each other, unless they are joined already.
  void join(std::uint32_t a, std::uint32_t b, bool alike) {
    const auto [root_a, turned_a] = root(a);
    const auto [root_b, turned_b] = root(b);
    if (root_a == root_b) return;
    const std::uint32_t low = std::min(root_a, root_b);
    parent_[std::max(root_a, root_b)] = low;
    turned_[std::max(root_a, root_b)] = (turned_a != turned_b) == alike;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<char> turned_;  // against the parent; 0 for a root
};

// Settles one piece: which triangles count, and which way they face.
class PieceWork {
 public:
  PieceWork(Mesh& mesh, std::vector<std::uint32_t> triangles, Pieces& all)
      : mesh_(mesh), triangles_(std::move(triangles)), all_(all) {}

  Piece run() {
    const std::vector<std::uint32_t> once = without_repeats(false);
    if (closes(mesh_, once)) return keep(once, true);
    std::vector<Corners> given, turned;
    for (const auto t : once) given.push_back(mesh_.triangles[t]);
    orient(once);
    const std::size_t missing = missing_edges(mesh_, once).size();
    const double volume = std::abs(signed_volume(mesh_, once));
    if (missing > 0 && once.size() < triangles_.size()) {
      for (std::size_t k = 0; k < once.size(); k++)
        turned.push_back(std::exchange(mesh_.triangles[once[k]], given[k]));
      if (const auto more = with_repeats(missing / 2, volume / 2)) return keep(*more, closes(mesh_, *more));
      for (std::size_t k = 0; k < once.size(); k++) mesh_.triangles[once[k]] = turned[k];
    }
    for (std::size_t k = 0; k < once.size(); k++) all_.turned += given[k] != mesh_.triangles[once[k]];
    return keep(once, missing == 0);
  }

 private:
  Piece keep(const std::vector<std::uint32_t>& triangles, bool closed) {
    all_.repeated += triangles_.size() - triangles.size();
    return {triangles, closed};
  }

  // Repeated triangles are walls of bodies that touch or share a face, if at most `most` edges do not close
  // with them, as given, and if the piece encloses a volume then, where edges are left at least `volume`: a
  // surface whose triangles face both ways closes, too.
  std::optional<std::vector<std::uint32_t>> with_repeats(std::size_t most, double volume) const {
    double area = 0;
    for (const auto t : triangles_) area += mesh_.area_normal(t).norm();
    std::optional<std::vector<std::uint32_t>> best;
    for (auto& kept : {without_repeats(true), triangles_}) {
      const std::size_t missing = missing_edges(mesh_, kept).size();
      if (missing > most || (best && missing == most)) continue;
      const double least = std::max(1e-6 * std::pow(area, 1.5), missing > 0 ? volume : 0);
      if (std::abs(signed_volume(mesh_, kept)) > least) best = kept, most = missing;
    }
    return best;
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
  Pieces& all_;
};

}  // namespace

std::optional<Mesh> one_closed_piece(const Mesh& soup) {
  Mesh mesh = merged(soup);
  if (mesh.triangles.empty() || mesh.triangles.size() < soup.triangles.size()) return std::nullopt;
  std::vector<std::uint32_t> all(mesh.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<Side> sides = sides_of(mesh, all);
  // Triangles that meet in an edge have one root, and so have their corners at each end of it.
  std::vector<std::uint32_t> piece(all), round(3 * all.size());
  std::iota(round.begin(), round.end(), 0u);
  std::size_t pieces = piece.size(), rounds = round.size();
  const auto join = [](std::vector<std::uint32_t>& parent, std::uint32_t a, std::uint32_t b) {
    a = root_of(parent, a), b = root_of(parent, b);
    parent[std::max(a, b)] = std::min(a, b);
    return a != b;
  };
  const auto corner = [&](std::uint32_t t, std::uint32_t v) {
    const Corners& c = mesh.triangles[t];
    return 3 * t + (c[0] == v ? 0 : c[1] == v ? 1 : 2);
  };
  for (std::size_t k = 0; k < sides.size(); k += 2) {
    if (k + 1 == sides.size() || sides[k].edge != sides[k + 1].edge ||
        sides[k].direction == sides[k + 1].direction ||
        (k + 2 < sides.size() && sides[k + 2].edge == sides[k].edge))
      return std::nullopt;
    const auto s = sides[k].triangle, t = sides[k + 1].triangle;
    pieces -= join(piece, s, t);
    for (const auto v :
         {static_cast<std::uint32_t>(sides[k].edge >> 32), static_cast<std::uint32_t>(sides[k].edge)})
      rounds -= join(round, corner(s, v), corner(t, v));
  }
  // Points in the order in which triangles use them.
  std::vector<std::uint32_t> index(mesh.points.size(), ~0u);
  Mesh out;
  out.triangles = std::move(mesh.triangles);
  for (auto& t : out.triangles)
    for (auto& v : t) {
      if (index[v] == ~0u)
        index[v] = static_cast<std::uint32_t>(out.points.size()), out.points.push_back(mesh.points[v]);
      v = index[v];
    }
  if (pieces > 1 || rounds > out.points.size()) return std::nullopt;
  return out;
}

std::vector<Side> sides_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  const auto side = [&](std::uint32_t t, int k) -> Side {
    const auto u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
    return {std::uint64_t(std::min(u, v)) << 32 | std::max(u, v), t, u < v ? 1 : -1};
  };
  const auto less = [](const Side& a, const Side& b) {
    return a.edge != b.edge ? a.edge < b.edge : a.triangle < b.triangle;
  };
  std::vector<Side> sides(3 * triangles.size());
  if (4 * triangles.size() < mesh.points.size()) {  // a small piece of a large mesh
    for (std::size_t k = 0; k < sides.size(); k++) sides[k] = side(triangles[k / 3], static_cast<int>(k % 3));
    std::sort(sides.begin(), sides.end(), less);
    return sides;
  }
  // Those with the same smaller vertex are put together first. They are few.
  std::vector<std::size_t> begin(mesh.points.size() + 1);
  for (std::size_t k = 0; k < sides.size(); k++)
    begin[(side(triangles[k / 3], static_cast<int>(k % 3)).edge >> 32) + 1]++;
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t k = 0; k < sides.size(); k++) {
    const Side s = side(triangles[k / 3], static_cast<int>(k % 3));
    sides[next[s.edge >> 32]++] = s;
  }
#pragma omp parallel for schedule(static) if (sides.size() > 16384)
  for (std::size_t v = 0; v < mesh.points.size(); v++)
    std::sort(sides.begin() + static_cast<std::ptrdiff_t>(begin[v]),
              sides.begin() + static_cast<std::ptrdiff_t>(begin[v + 1]), less);
  return sides;
}

double signed_volume(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  if (triangles.empty()) return 0;
  const Point origin = mesh.corner(triangles[0], 0);
  double sum = 0;
  for (const auto t : triangles)
    sum += (mesh.corner(t, 0) - origin).dot((mesh.corner(t, 1) - origin).cross(mesh.corner(t, 2) - origin));
  return sum / 6;
}

std::vector<DirectedEdge> missing_edges(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  std::vector<DirectedEdge> missing;
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    int sum = 0;
    for (std::size_t k = begin; k < end; k++) sum += sides[k].direction;
    const auto low = static_cast<std::uint32_t>(sides[begin].edge >> 32),
               high = static_cast<std::uint32_t>(sides[begin].edge);
    for (; sum > 0; sum--) missing.push_back({high, low});
    for (; sum < 0; sum++) missing.push_back({low, high});
  });
  return missing;
}

namespace {

// The triangles that hang together by the edges for which join(number of triangles) holds, in their order.
template <class Join>
std::vector<std::vector<std::uint32_t>> connected(const Mesh& mesh,
                                                  const std::vector<std::uint32_t>& triangles, Join&& join) {
  std::vector<std::uint32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const std::vector<Side> sides = sides_of(mesh, triangles);
  for_edges(sides, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin + 1; k < end && join(end - begin); k++) {
      const auto a = root_of(parent, sides[begin].triangle), b = root_of(parent, sides[k].triangle);
      parent[std::max(a, b)] = std::min(a, b);
    }
  });
  std::vector<std::vector<std::uint32_t>> members(mesh.triangles.size());
  for (const auto t : triangles) members[root_of(parent, t)].push_back(t);
  std::erase_if(members, [](const auto& m) { return m.empty(); });
  return members;
}

}  // namespace

Pieces find_pieces(const Mesh& soup) {
  Pieces out;
  out.mesh = merged(soup);
  std::vector<std::uint32_t> all(out.mesh.triangles.size()), rest;
  std::iota(all.begin(), all.end(), 0u);
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
    Piece piece = PieceWork(out.mesh, part, out).run();
    if (piece.closed && piece.triangles.size() == part.size()) {
      out.pieces.push_back(std::move(piece));
      continue;
    }
    for (std::size_t k = 0; k < part.size(); k++) out.mesh.triangles[part[k]] = given[k];
    out.repeated = repeated, out.turned = turned;
    rest.insert(rest.end(), part.begin(), part.end());
  }
  std::sort(rest.begin(), rest.end());
  for (auto& part : connected(out.mesh, rest, [](std::size_t) { return true; }))
    out.pieces.push_back(PieceWork(out.mesh, std::move(part), out).run());
  return out;
}

}  // namespace padder
