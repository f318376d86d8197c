// SPDX-License-Identifier: MIT
// What Bodies::automatic means: are bodies searched first, or is every sphere expanded and searched? Host
// code that both backends use. Internal.
#pragma once
#include "detect/core/bodies/pieces.h"
#include "detect/core/input.h"
#include "detect/detector.h"

namespace padder::detect {

// What it costs to search bodies first, in spheres of one size that are expanded and searched in the same
// time.
struct BodyCosts {
  double octave = 0;   // how much longer an expanded sphere takes for each of BodyCensus::octaves
  double loose = 1;    // a loose sphere, searched as it is
  double call = 0;     // once
  double body = 0;     // less what its pose costs where its spheres are expanded
  double ball = 0;     // about a piece of a body
  double pair = 0;     // of balls that touch: the spheres of two pieces are tested
  double crowd = 0;    // for each ball that a ball touches on average: all wait for who has the most
  double contact = 0;  // for each contact that such a pair may have (BodyCensus::contacts)
  // Where something is static: once, and for each ball and loose sphere that moves, which then searches the
  // table of what is static.
  double static_call = 0, static_each = 0;
};

// What the choice asks of the bodies. It stays within a revision.
struct BodyCensus {
  std::uint64_t bodies = 0, balls = 0;  // balls: about the pieces of bodies that move
  bool some_static = false;
  double filled = 1;  // the volume of the spheres, as a share of that of the balls about their pieces
  // Of two pieces alike whose balls lie one on the other, how many pairs of spheres would touch if they were
  // strewn there: n^2 (r / R)^3 with n spheres of radius r in a ball of radius R, on average over the pieces.
  double contacts = 1;
  double octaves = 0;  // from the mean radius of the spheres to the largest
};
// `pieces` are brought up to date. Costs a pass over the spheres of the shapes.
BodyCensus census_of(std::span<const Shape> shapes, const BodyTally& bodies, Pieces& pieces);

// How many pairs of balls that touch are worth it to search bodies first, if that may take `times` as long as
// to expand them. 0: however few; infinity: however many, since they cost nothing. What is static costs
// nothing then: it is in a table that is kept with the revision. `spheres`: all of them; `loose` of these are
// loose, and `moving_loose` are not static either. Does not depend on where anything is.
double most_touching_balls(const BodyCensus& census, std::uint64_t spheres, std::uint64_t loose,
                           std::uint64_t moving_loose, const BodyCosts& costs, double times = 1);

// How many pairs of balls touch, of pieces of two bodies, or of a piece and a loose sphere. Long and hollow
// bodies have many such pairs with few contacts. Estimated from a sample: of n bodies, the larger of 128 and
// 2 sqrt(n) are seen, each with one of its pieces, and as many loose spheres. Poses and loose spheres that
// lie in device memory are not read, as if no balls touched. Costs 10 to 100 us.
//
// A stable list has another order either way, and must be that of a new detector that is given the scene
// without a revision. So a stable order needs a decision that depends on nothing but where everything is now.
double touching_balls(const Input& input, double margin, const Pieces& pieces);

}  // namespace padder::detect
