// SPDX-License-Identifier: MIT
// Levels of detail, or rungs: covers of one part from fine to coarse, and the choice among them for each body
// from the smallest thing that can touch it. docs/scenes.md says what is proved of the contacts.
#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// A ball around spheres, about the middle of their box. Without spheres a point at the origin.
Sphere ball_around(std::span<const Sphere> spheres);

// One cover of a part. Both errors are proved bounds: no sphere reaches farther out of the part than
// `protrusion`, and no point of its surface is farther from the spheres than `gap`. Infinite: not proved.
struct Rung {
  std::vector<Sphere> spheres;
  double protrusion = std::numeric_limits<double>::infinity();
  double gap = std::numeric_limits<double>::infinity();
};
// If a thing touches a part at one of the rungs, it is at most this far from the part at the other. This does
// not hold if the whole thing lies inside the part, or the whole part inside the thing. If the thing is a
// part too, add both errors.
double error_between(const Rung& finest, const Rung& coarse);

// Which rung of its part each body takes.
struct RungRule {
  // numbered: rung `number`, or the coarsest if there are fewer. chosen: the coarsest rung whose error is at
  // most `share` times the size of the smallest thing that can touch the body.
  enum class Kind : std::uint8_t { numbered, chosen };
  Kind kind = Kind::numbered;
  std::uint32_t number = 0;  // 0: the finest
  double share = 0.1;
};
// Reads "auto" or a number. Throws Error for another text.
RungRule rung_rule(const std::string& text);

// In RungChoice::rungs: nothing can touch this body, and none of its spheres is needed.
inline constexpr std::uint32_t kLeftOut = 0xffffffffu;

// The rung of each body, and what that saves.
struct RungChoice {
  std::vector<std::uint32_t> rungs;  // of each body
  // Numbers of spheres: if all bodies took the finest rung; of the rungs that they take; of the bodies that
  // are left out.
  std::uint64_t finest = 0, taken = 0, out_of_reach = 0;
  std::uint64_t left_out = 0;  // bodies that nothing can touch
  std::uint64_t fewer = 0;     // bodies that have no rung of the number asked for and take their coarsest
  double error = 0;            // the largest error_between() of a body's rung; infinite: not proved
};

// For a scene that stands still: a body's partners are the bodies and loose spheres whose bounding balls come
// within `margin` of its own and that may touch it; with RungRule::chosen a body without partners is left
// out. The size of a loose sphere is its radius, and that of a body the radius of its largest sphere.
// `shapes[k]` are the rungs of shape k. Finds the partners with a detector on `device`, in a call for one
// ball for each body and all loose spheres. Throws Error as Detector::detect() does.
RungChoice choose_rungs(std::span<const std::span<const Rung>> shapes, std::span<const Body> bodies,
                        const Spheres& loose, const RungRule& rule, double margin = 0,
                        const DeviceChoice& device = {});

// For a scene that moves: everything can touch every body, so no body is left out. `smallest` is the radius
// of the smallest loose sphere, or infinity if there is none.
RungChoice choose_rungs_anywhere(std::span<const std::span<const Rung>> shapes, std::span<const Body> bodies,
                                 double smallest, const RungRule& rule);

// A shape that some bodies take: the spheres of one rung of shape `of`; none for kLeftOut.
struct TakenShape {
  std::uint32_t of, rung;
};
// Lets each body take the rung that was chosen for it. Bodies of another rung than the finest get new shapes,
// which are returned and numbered from `first` on.
std::vector<TakenShape> take_rungs(std::span<Body> bodies, const RungChoice& choice, std::uint32_t first);

}  // namespace padder::detect
