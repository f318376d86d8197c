// SPDX-License-Identifier: MIT
// Which links of a robot need no test against each other, found by random poses, as MoveIt's setup does.
#pragma once
#include <vector>

#include "padding/export/model.h"

namespace padder {

// The pairs of bodies with spheres that are not in model.apart, and that
//   touch with all joints at their first values (Joint::first_value)  "Default"
//   touch in at least 95 % of the poses                               "Always"
//   touch in none of the poses                                        "Never"
// in ascending order. The poses are random, uniform between the limits of the joints, and the same in every
// call and for any number of threads. Bodies that a floating joint parts may touch wherever they stand. Pairs
// with a joint between them whose places are not tried, because it has several ways to move (planar,
// floating, ball) or slides without limits, are never said to touch always or never. Joints that turn without
// limits turn all the way. The spheres decide what touches, so pairs that come nearer than the tolerance
// count as touching. "Never" is an estimate: of a pair that touches in a share p of all poses, it is said
// with the probability (1 - p)^poses. Cost: a few seconds for a robot of ten links and a thousand spheres.
std::vector<Apart> self_collisions(const Model& model, int poses);

}  // namespace padder
