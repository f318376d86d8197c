// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/facing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "padding/meshing/holes/corner_tree.h"
#include "padding/meshing/pieces.h"
#include "padding/meshing/turns.h"

namespace padder {
namespace {

// Of two triangles at a crack whose sides lead away from it in directions with a larger cosine, one lies on
// the other.
constexpr double kLiesOn = 0.999;

struct BorderEdge {
  std::uint32_t from, to;  // as its triangle has it
  std::uint32_t piece;
  Vector away;  // from the edge into the triangle; of length 1
};

// Where a number stands in a list that ascends.
std::uint32_t place_in(const std::vector<std::uint32_t>& ascending, std::uint32_t number) {
  return static_cast<std::uint32_t>(std::ranges::lower_bound(ascending, number) - ascending.begin());
}

class Facing {
 public:
  Facing(Mesh& mesh, const std::vector<std::uint32_t>& open, double width)
      : mesh_(mesh), open_(open), width_(width) {}

  std::size_t run() {
    find_border();
    if (pieces_ < 2 || border_.empty()) return 0;
    std::vector<std::uint32_t> ends;
    for (const BorderEdge& e : border_) ends.push_back(e.from), ends.push_back(e.to);
    const CornerTree corners(mesh_, std::move(ends));
    std::vector<std::vector<std::uint32_t>> edges_at(corners.corners.size());
    for (std::uint32_t e = 0; e < border_.size(); e++)
      for (const auto v : {border_[e].from, border_[e].to})
        edges_at[place_in(corners.corners, v)].push_back(e);
    std::vector<std::uint32_t> near, last(border_.size(), ~0u);  // last: the edge that saw this one last
    for (std::uint32_t e = 0; e < border_.size(); e++) {
      const Point &a = mesh_.points[border_[e].from], &b = mesh_.points[border_[e].to];
      near.clear();
      corners.tree.find(0.5 * (a + b), 0.5 * (b - a).norm() + width_, near);
      for (const auto k : near)
        for (const auto f : edges_at[k])
          if (std::exchange(last[f], e) != e && border_[f].piece != border_[e].piece)
            vote(border_[e], border_[f]);
    }
    return turn_pieces();
  }

 private:
  void find_border() {
    std::vector<std::uint32_t> parent = numbered(open_.size());
    const auto local = [&](std::uint32_t t) { return place_in(order_, t); };
    order_ = open_;
    sort_unique(order_);
    const std::vector<Side> sides = sides_of(mesh_, order_);
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin + 1; k < end; k++)
        join(parent, local(sides[begin].triangle), local(sides[k].triangle));
    });
    piece_of_.resize(order_.size());
    for (std::uint32_t k = 0; k < order_.size(); k++) {
      const std::uint32_t root = root_of(parent, k);  // no larger than k
      piece_of_[k] = root == k ? pieces_++ : piece_of_[root];
    }
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      if (end - begin > 1) return;
      const auto [low, high] = ends_of(sides[begin].edge);
      BorderEdge e{low, high, piece_of_[local(sides[begin].triangle)], Vector::Zero()};
      if (sides[begin].direction < 0) std::swap(e.from, e.to);
      const Point& a = mesh_.points[e.from];
      const Vector along = (mesh_.points[e.to] - a).normalized();
      for (const auto v : mesh_.triangles[sides[begin].triangle]) e.away += mesh_.points[v] - a;
      e.away -= mesh_.points[e.to] - a;  // to the third corner
      e.away = (e.away - e.away.dot(along) * along).normalized();
      border_.push_back(e);
    });
  }

  // Two pieces face alike by the length of their edges that run beside each other in opposite directions,
  // less that of those that run in one direction.
  void vote(const BorderEdge& e, const BorderEdge& f) {
    if (e.away.dot(f.away) > kLiesOn) return;
    const Point &a = mesh_.points[e.from], &c = mesh_.points[f.from];
    const Vector along = mesh_.points[e.to] - a, other = mesh_.points[f.to] - c;
    const double length = along.norm(), ahead = along.dot(other) / length;
    if (ahead == 0) return;
    const double first = along.dot(c - a) / length, second = first + ahead,  // along e
        low = std::max(0.0, std::min(first, second)), high = std::min(length, std::max(first, second));
    if (high - low <= width_) return;
    for (const double at : {low, high}) {
      const Point on_e = a + at / length * along, on_f = c + (at - first) / ahead * other;
      if ((on_e - on_f).norm() > width_) return;
    }
    votes_[{std::min(e.piece, f.piece), std::max(e.piece, f.piece)}] += ahead < 0 ? high - low : low - high;
  }

  // The longest borders first: where not all can face alike, they do. Fewer triangles are turned.
  std::size_t turn_pieces() {
    std::vector<std::pair<double, std::pair<std::uint32_t, std::uint32_t>>> borders;
    for (const auto& [two, length] : votes_)
      if (length != 0) borders.push_back({length, two});
    std::stable_sort(borders.begin(), borders.end(),
                     [](const auto& a, const auto& b) { return std::abs(a.first) > std::abs(b.first); });
    Turns turns(pieces_);
    for (const auto& [length, two] : borders) turns.join(two.first, two.second, length > 0);
    std::vector<long> more(pieces_, 0);  // at each root: triangles turned against it, less others
    for (const auto piece : piece_of_) {
      const auto [root, turned] = turns.root(piece);
      more[root] += turned ? 1 : -1;
    }
    std::size_t count = 0;
    for (std::size_t k = 0; k < order_.size(); k++) {
      const auto [root, turned] = turns.root(piece_of_[k]);
      if (turned == (more[root] > 0)) continue;
      auto& t = mesh_.triangles[order_[k]];
      std::swap(t[1], t[2]), count++;
    }
    return count;
  }

  Mesh& mesh_;
  const std::vector<std::uint32_t>& open_;
  const double width_;
  std::vector<std::uint32_t> order_, piece_of_;  // the triangles, ascending, and the piece of each
  std::uint32_t pieces_ = 0;
  std::vector<BorderEdge> border_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, double> votes_;
};

}  // namespace

std::size_t face_alike(Mesh& mesh, const std::vector<std::uint32_t>& open, double width) {
  return Facing(mesh, open, width).run();
}

}  // namespace padder
