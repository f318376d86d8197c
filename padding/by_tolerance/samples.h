// SPDX-License-Identifier: MIT
// A surface as points with their inner medial balls: what a cover must reach, and what it may take.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/geometry/balls.h"
#include "padding/geometry/surface.h"

namespace padder {

// A point of the surface.
struct Sample {
  Point point;  // inside a triangle, where the normal is the triangle's own
  std::uint32_t triangle = 0;
  Ball ball;  // inner medial ball there; radius = distance of its centre to the surface
};

// A point to cover, and how much of the surface it stands for.
struct Row {
  Point point;
  double margin = 0;  // distance to the points that have no row of their own, about
};

// What sample() gives.
struct Samples {
  std::vector<Sample> grown;
  std::vector<Row> coarse, fine;  // rows of two densities; neither contains the other
};

// How densely to sample.
struct SampleOptions {
  double reach = 0;  // how far beyond its medial ball a sphere covers: the tolerances of both sides together
  double grown_density = 3;   // balls along the radius of the disc that a sphere covers on a flat
  double coarse_density = 4;  // the same for rows
  double fine_density = 6;    // the same, at least the coarse one
  double largest = std::numeric_limits<double>::infinity();  // radius of medial balls
};

// The radius of the disc that a medial ball of radius r covers on the flat it touches, when it covers `reach`
// beyond its own radius: sqrt((r + reach)^2 - r^2).
double covered_disc(double r, double reach);

// As dense as the local thickness asks for: around each ball none other of about its normal within
// covered_disc / density, and so for rows. Large triangles are cut in pieces for that, small ones are
// thinned. Deterministic for any number of threads. Costs a few medial balls for each grown, and O(n log n)
// for n triangles. Throws Error when the tolerance is so small that some 20 million pieces would be needed.
Samples sample_surface(const Surface& surface, const SampleOptions& options);

}  // namespace padder
