// SPDX-License-Identifier: GPL-3.0-or-later
// What pad() shares with its two ways to make spheres: by depth ratio (pad_by_depth.cpp) and by tolerance
// (pad_by_tolerance.cpp). Not installed.
#pragma once
#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "padding/geometry/unit_frame.h"
#include "padding/pad.h"

namespace padder {

class StepClock {
 public:
  double lap() {  // seconds since the last lap
    const auto now = std::chrono::steady_clock::now();
    const double s = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return s;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// What every step works on, in the unit frame.
struct PadJob {
  const PadOptions& options;
  const ReadResult& file;  // as it was read
  const Mesh& input;
  const Repaired& body;
  const Surface& surface;
  const UnitFrame& frame;
  double edge_length;  // of the remeshed triangles; 0: nothing is remeshed
  PadReport& report;
  const std::function<void(const char*, int)>& step;
  const TellShare& within_cull;
  StepClock& clock;

  double chord_error() const { return file.chord_error / frame.scale(); }
};

// The spheres of one level of detail, in the unit frame.
struct RungSpheres {
  std::vector<Ball> balls;
  std::vector<std::int64_t> triangle;  // for each ball, the triangle that it was made for
  Mesh mesh;                           // the remeshed surface; empty when nothing was remeshed
  WhyOpen open = WhyOpen::nothing;
  std::string why;  // what prevents that they keep the tolerance, if they cannot
};

// Of the remeshed triangles, in the unit frame.
double edge_length_by_depth(const PadOptions& options, double diagonal);

// One sphere for each triangle, as in the paper; with a tolerance those of them that it needs.
RungSpheres spheres_by_depth(const PadJob& job, const Length& tolerance);

// The fewest spheres that keep a tolerance or a count.
RungSpheres spheres_by_tolerance(const PadJob& job, const Length& tolerance);

// A round shape reaches out of its mesh by the chord error, so the gap is so much smaller. A gap above 0
// stays above 0, and one of 0 covers what is so far outside, too.
inline double gap_left(double gap, double chord_error) {
  return gap > 0 ? std::max(gap - chord_error, 0.5 * gap) : gap - chord_error;
}

}  // namespace padder
