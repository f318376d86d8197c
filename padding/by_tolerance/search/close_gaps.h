// SPDX-License-Identifier: MIT
// From a cover of points to one of the whole surface, with the proof.
#pragma once
#include "padding/by_tolerance/open_spot.h"
#include "padding/by_tolerance/search/attempt.h"
#include "padding/by_tolerance/watch.h"

namespace padder {

// The whole cover is searched in at most so many rounds, each of which is a step of the watch. Further rounds
// move the balls around the spots that are left, and add one where that fails; what is proved elsewhere stays
// so. The last only add, so that they end.
inline constexpr int kSearchedRounds = 5;

// The certificate finds spots that the balls leave open. These become points to cover, until it finds none.
// Returns the worst that stays open, if one does. In each searched round, the search makes `steps` exchanges
// for each ball and tries so many `places` around each; with 0 places, balls are only added. `also`, unless
// it is null, gets the same points and candidates.
OpenSpot close_gaps(Attempt& attempt, const BallGrower& grower, double steps, int places, Watch& watch,
                    CoverProblem* also);

}  // namespace padder
