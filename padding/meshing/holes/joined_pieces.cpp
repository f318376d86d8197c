// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/holes/joined_pieces.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "padding/meshing/holes/cracks.h"

namespace padder {
namespace {

// Corners may be joined over this share of the tolerance. Each width that is tried is wider by this factor.
constexpr double kJoinStep = 5;
// Corners lie on an edge if they are off it by rounding, as a share of the largest coordinate: that of a unit
// frame, that of a file in float.
constexpr double kFrameRounding = 2e-11, kFloatRounding = 2.5e-7;

class PieceJoiner {
 public:
  PieceJoiner(const Mesh& input, const RepairOptions& options, double diagonal, RepairSteps& steps)
      : input_(input), options_(options), diagonal_(diagonal), steps_(steps), pieces_(find_pieces(input)) {}

  Pieces run() {
    if (options_.mode == RepairMode::sheet) return std::move(pieces_);
    split_pieces();
    join_pieces();
    return std::move(pieces_);
  }

 private:
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
    const double farthest =
        std::max(input_.bounds().low.cwiseAbs().maxCoeff(), input_.bounds().high.cwiseAbs().maxCoeff());
    for (const double rounding : {kFrameRounding, kFloatRounding}) {
      const double width =
          std::min({rounding * farthest, crack_limit(options_, diagonal_), options_.join_width});
      while (width > 0 && split_pieces(width)) {
      }
    }
  }

  // Returns whether edges were split: at the corners of those with an odd number of triangles, or, where more
  // than two meet in an edge, as in the walls of bodies that touch, at all corners.
  bool split_pieces(double width) {
    const std::vector<std::uint32_t> open = open_triangles();
    if (open.empty()) return false;
    // Those that repeat and are left out so far are split with them.
    std::vector<char> closed(pieces_.mesh.triangles.size(), 0);
    for (const Piece& piece : pieces_.pieces)
      for (const auto t : piece.triangles) closed[t] = piece.closed;
    std::vector<std::uint32_t> loose;
    for (std::uint32_t t = 0; t < closed.size(); t++)
      if (!closed[t]) loose.push_back(t);
    const std::vector<Side> sides = sides_of(pieces_.mesh, loose);
    std::vector<DirectedEdge> edges;
    bool crowded = false;
    for_edges(sides, [&](std::size_t begin, std::size_t end) { crowded |= end - begin > 2; });
    for_edges(sides, [&](std::size_t begin, std::size_t end) {
      const auto [from, to] = ends_of(sides[begin].edge);
      if (crowded || (end - begin) % 2 == 1) edges.push_back({from, to});
    });
    SplitEdges split = split_edges(pieces_.mesh, loose, edges, width);
    if (split.count == 0) return false;
    Pieces before = std::exchange(pieces_, find_pieces(split.mesh));
    if (missing_edges(pieces_.mesh, open_triangles()).size() >= missing_edges(before.mesh, open).size()) {
      pieces_ = std::move(before);
      return false;
    }
    steps_.split += split.count, steps_.joined_width += split.farthest;
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
    if (apart < 2 || !(widest > 0)) return;
    const std::vector<DirectedEdge> missing = missing_edges(pieces_.mesh, open);
    const Mesh given = pieces_.mesh;
    const double few = 0.01 * area_of(pieces_.mesh, open), split_width = steps_.joined_width;
    std::size_t least = missing.size() / 2 + 1;
    for (double width = crack_limit(options_, diagonal_); least > 0; width *= kJoinStep) {
      const bool last = width > 0.99 * widest;
      if (last) width = widest;
      const JoinedCorners joined = join_corners(split_ ? *split_ : input_, given, missing, width);
      if (joined.count > 0) {
        const double thin = thin_area(width) + few;
        Pieces before = std::exchange(pieces_, find_pieces(joined.mesh));
        std::size_t together = 0;
        const std::size_t left = missing_edges(pieces_.mesh, open_triangles(&together)).size();
        if (left < least && 2 * together <= apart && thin_area(width) <= thin)
          least = left, steps_.joined = joined.count, steps_.joined_width = split_width + joined.farthest;
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
      const double area = area_of(pieces_.mesh, piece.triangles);
      if (std::abs(signed_volume(pieces_.mesh, piece.triangles)) < 0.5 * width * area) sum += area;
    }
    return sum;
  }

  double join_limit() const {
    const double error = options_.tolerance > 0  ? options_.tolerance
                         : options_.accuracy > 0 ? options_.accuracy
                                                 : diagonal_ / 500;
    return kCrackShare * error;
  }

  const Mesh& input_;
  const RepairOptions& options_;
  const double diagonal_;
  RepairSteps& steps_;
  Pieces pieces_;
  std::optional<Mesh> split_;  // input_ with edges split
};

}  // namespace

Pieces find_joined_pieces(const Mesh& input, const RepairOptions& options, double diagonal,
                          RepairSteps& steps) {
  return PieceJoiner(input, options, diagonal, steps).run();
}

}  // namespace padder
