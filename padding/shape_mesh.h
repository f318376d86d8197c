// SPDX-License-Identifier: GPL-3.0-or-later
// Triangle meshes of the shapes that a robot's file describes by their sizes.
#pragma once
#include "padding/asset/mesh.h"
#include "padding/robots/robot_tree.h"

namespace padder {

// A closed mesh that lies within its shape.
struct ShapeMesh {
  Mesh mesh;
  double chord_error = 0;  // proved: no point of the shape is farther from the mesh; 0 for a box
};

// In the frame of the shape, which is no mesh. A round shape has its corners on its surface, so many that the
// chord error is at most `wanted`, but at least 64 around, so that the volume is off by at most 0.5 %, and at
// most 512.
ShapeMesh shape_mesh(const RobotShape& shape, double wanted);

}  // namespace padder
