// SPDX-License-Identifier: MIT
// Mass and moments of solid shapes, by their closed formulas. Not installed.
#pragma once
#include <vector>

#include "padding/robots/robot_tree.h"

namespace padder::reading {

// Of every shape but a mesh.
double volume_of(const RobotShape& shape);

// A shape, but for a mesh, that is filled evenly, in the link's frame.
Inertial solid_inertia(const RobotShape& shape, double mass);

// Of the parts together; the centre is 0 where none has a mass.
Inertial sum_of(const std::vector<Inertial>& parts);

}  // namespace padder::reading
