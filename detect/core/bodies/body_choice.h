// SPDX-License-Identifier: MIT
// What Bodies::automatic means: are bodies searched first, or is every sphere expanded and searched? Host
// code that both backends use. Internal.
#pragma once
#include "detect/core/bodies/pieces.h"
#include "detect/detector.h"

namespace padder::detect {

// What it costs to search bodies first, in spheres that are expanded and searched in the same time.
struct BodyCosts {
  double call = 0;  // once
  double body = 0;
  double ball = 0;  // about a piece of a body
  double pair = 0;  // of balls that touch: the spheres of two pieces are tested. 0: these are not counted
  // Where something is static: once, and for each ball and loose sphere that moves, which then searches the
  // table of what is static.
  double static_call = 0, static_each = 0;
};

// How many pairs of balls that touch are worth it to search bodies first. 0: however few; infinity: however
// many, since costs.pair is 0. What is static costs nothing then: it is in a table that is kept with the
// revision. `spheres`: all of them, loose ones too. `moving_loose`: those that are not static. Does not
// depend on where anything is.
double most_touching_balls(const Input& input, std::uint64_t spheres, std::uint64_t moving_loose,
                           const BodyCosts& costs);

// Is it faster to search bodies first? By touching_balls(): poses and loose spheres that lie in device memory
// are not read, as if no balls touched. `pieces` are brought up to date where the answer depends on them.
//
// A stable list has another order either way, and must be that of a new detector that is given the scene
// without a revision. So a stable order needs a decision that depends on nothing but where everything is now.
bool bodies_first(const Input& input, double margin, std::uint64_t spheres, std::uint64_t moving_loose,
                  const BodyCosts& costs, Pieces& pieces);

// How many pairs of balls touch, of pieces of two bodies, or of a piece and a loose sphere. Long and hollow
// bodies have many such pairs with few contacts. Estimated from a sample: of n bodies, the larger of 128 and
// 2 sqrt(n) are seen, each with one of its pieces, and as many loose spheres. Costs 10 to 100 us.
double touching_balls(const Input& input, double margin, const Pieces& pieces);

// The volume of the spheres of all bodies, as a share of that of the balls about their pieces.
double filled(const Input& input, const Pieces& pieces);

}  // namespace padder::detect
