// SPDX-License-Identifier: MIT
// A union of balls, and the questions that later steps ask: how far is a point from the union, which ball is
// nearest?
#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// A sphere as padding works with it, in the frame of the part.
struct Ball {
  Point center = Point::Zero();
  double radius = 0;
};

// The signed gap of a point x to one ball of a union: |x - center| - radius, negative inside.
struct BallGap {
  double value = std::numeric_limits<double>::infinity();
  std::uint32_t ball = 0;  // index in BallSet::balls; undefined when value is infinite
};

inline double gap_to(const Ball& ball, const Point& x) { return (x - ball.center).norm() - ball.radius; }

// A bounding-volume hierarchy over balls. A node has the box of the centres and the largest radius below it.
// Nodes are split along x, y, z or the radius, so that a few large balls do not spoil the bounds of many
// small ones. Keeps a copy of the balls and does not change after construction, so any number of threads may
// ask. Building takes O(n log n), about 1 s for a million balls. At most 2^32 - 1 balls.
class BallSet {
 public:
  BallSet() = default;
  explicit BallSet(std::vector<Ball> balls);

  // The smallest signed gap among the balls, if it is below `limit`; otherwise the value stays infinite. For
  // x outside the union, this is the distance to the union. For x inside, it is minus the largest distance of
  // x to the surface of a ball that contains it, which is at most its distance to the surface of the union.
  // Of equal gaps the ball with the lowest index counts.
  BallGap gap(const Point& x, double limit = std::numeric_limits<double>::infinity()) const;

  // A ball with |x - center| <= radius - margin, if there is any. A negative margin dilates the balls.
  std::optional<std::uint32_t> containing(const Point& x, double margin = 0) const;
  bool any_contains(const Point& x, double margin = 0) const { return containing(x, margin).has_value(); }

  // Appends to `found` the index of each ball with |x - center| < radius + distance, in no particular order.
  void find(const Point& x, double distance, std::vector<std::uint32_t>& found) const;

  const std::vector<Ball>& balls() const { return balls_; }
  std::size_t size() const { return balls_.size(); }
  bool empty() const { return balls_.empty(); }

 private:
  struct Node : BoxPair {    // of the centres
    Eigen::Array2d radius;   // the largest
    std::uint32_t child[2];  // node, or first slot when count > 0
    std::uint32_t count[2];
  };
  struct Slot {
    Ball ball;
    std::uint32_t index;
  };

  std::uint32_t build(std::uint32_t begin, std::uint32_t end);
  template <class Visit>
  void traverse(const Point& x, double& limit, Visit&& visit) const;

  std::vector<Ball> balls_;
  std::vector<Slot> slots_;
  std::vector<Node> nodes_;
};

}  // namespace padder
