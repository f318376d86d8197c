// SPDX-License-Identifier: MIT
// A union of balls and the questions every later step asks it: how far is a point from the union, which ball
// is nearest.
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// A sphere as padding works with it, in the frame of the part.
struct Ball {
  Point center = Point::Zero();
  double radius = 0;
};

// Signed gap of a point to one ball of a union: |x - center| - radius, negative inside.
struct BallGap {
  double value = std::numeric_limits<double>::infinity();
  std::uint32_t ball = 0;  // index in BallSet::balls; undefined when value is infinite
};

inline double gap_to(const Ball& ball, const Point& x) { return (x - ball.center).norm() - ball.radius; }

// Bounding-volume hierarchy over balls: boxes of centres with the largest radius below, split in (x, y, z,
// radius), so that a few large balls do not spoil the bounds of many small ones. Keeps a copy of the balls;
// immutable after construction, so any number of threads may ask. Building costs O(n log n), about 1 s a
// million balls. At most 2^32 - 1 balls.
class BallSet {
 public:
  BallSet() = default;
  explicit BallSet(std::vector<Ball> balls);

  // The smallest signed gap among the balls, if it is below `limit`; else value stays infinite. This is the
  // distance to the union for x outside of it. Inside, it is minus the depth below the surface of the deepest
  // single ball, which is at most the depth below the surface of the union. Of equal gaps the ball of the
  // lowest index wins.
  BallGap gap(const Point& x, double limit = std::numeric_limits<double>::infinity()) const;

  // Is |x - center| <= radius - margin for any ball? Stops at the first. A negative margin dilates the balls.
  bool any_contains(const Point& x, double margin = 0) const;

  // Appends to `found` the index of each ball with |x - center| < radius + reach, in no particular order.
  void find(const Point& x, double reach, std::vector<std::uint32_t>& found) const;

  const std::vector<Ball>& balls() const { return balls_; }
  std::size_t size() const { return balls_.size(); }
  bool empty() const { return balls_.empty(); }

 private:
  struct Node {                               // two children side by side, so that one visit decides on both
    double low[2][3], high[2][3], radius[2];  // box of the centres and the largest radius
    std::uint32_t child[2];                   // node, or first slot when count > 0
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
