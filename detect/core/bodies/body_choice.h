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
  // Where loose spheres are static: once, and for each ball and loose sphere that moves, which then searches
  // the table of the static ones.
  double static_call = 0, static_each = 0;
};

// Must bodies be searched first, or is it faster? Static loose spheres cost nothing then: they are in a table
// that is kept with the revision. `spheres`: all of them, loose ones too. `moving_loose`: those that are not
// static. `pieces`: of the shapes. Poses and loose spheres that lie in device memory are not read: then as if
// no balls touched.
//
// A stable list has another order either way, and must be that of a new detector that is given the scene
// without a revision. So a stable order needs a decision that depends on nothing but where everything is now,
// or, with costs.pair 0, not even on that.
bool bodies_first(const Input& input, double margin, std::uint64_t spheres, std::uint64_t moving_loose,
                  const BodyCosts& costs, const Pieces& pieces);

// How many pairs of balls touch, of pieces of two bodies, or of a piece and a loose sphere. Long and hollow
// bodies have many such pairs with few contacts. Estimated from a sample: of n bodies, the larger of 128 and
// 2 sqrt(n) are seen, each with one of its pieces, and as many loose spheres. Costs 10 to 100 us.
double touching_balls(const Input& input, double margin, const Pieces& pieces);

}  // namespace padder::detect
