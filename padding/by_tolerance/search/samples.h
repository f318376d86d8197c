// SPDX-License-Identifier: MIT
// Samples a surface: places where balls are grown, and points that a cover must reach.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <unordered_set>
#include <vector>

#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

constexpr double kMedialTolerance = 0.05;  // share of the tolerance sum: by so much a ball may miss its point

// A place on the surface with its ball.
struct Sample {
  Point point;                 // inside a triangle, where the normal is the triangle's own
  std::uint32_t triangle = 0;  // that the point lies on
  Ball ball;  // the inner medial ball there: its radius is the distance of its centre to the surface
};

// A point that must be covered. It stands for the surface around it.
struct CoverPoint {
  Point point;
  double margin = 0;  // about the distance to the farthest surface that has no point of its own
};

// What sample_surface() gives.
struct Samples {
  std::vector<Sample> grown;
  std::vector<CoverPoint> coarse, fine;  // of two densities; neither list contains the other
};

// How densely to sample. Densities count samples along the radius of the disc that a sphere covers on a flat.
struct SampleOptions {
  double tolerance_sum = 0;   // protrusion and gap together: so far beyond its medial ball a sphere covers
  double coarse_density = 4;  // of the coarse points
  double fine_density = 5;    // of the fine points; at least coarse_density
  double largest = std::numeric_limits<double>::infinity();  // radius of medial balls
};

// Takes one place for each cell of a grid and each direction along an axis that the surface faces there. So a
// stack of layers, or slivers side by side, give no more places than one surface would.
class FirstOfCell {
 public:
  // Is it the first one there?
  bool take(const Point& place, const Vector& normal, double cell);

 private:
  struct Hash {
    std::size_t operator()(const std::array<std::int64_t, 4>& key) const;
  };
  std::unordered_set<std::array<std::int64_t, 4>, Hash> taken_;
};

// The radius of the disc that a medial ball of radius r covers on the flat it touches, when it covers
// `tolerance_sum` beyond its own radius: sqrt((r + tolerance_sum)^2 - r^2).
double covered_disc(double r, double tolerance_sum);

// The spacing follows the local thickness: around each ball there is no other one with about the same normal
// within covered_disc / density. The same holds for the points. Large triangles are cut into parts for that;
// of small triangles only some get a sample. The result does not depend on the number of threads. Costs a few
// medial balls for each sample, and O(n log n) for n triangles. Throws Error when the tolerance is so small
// that the surface would have to be cut into more than 20 million parts.
Samples sample_surface(const Surface& surface, const SampleOptions& options);

}  // namespace padder
