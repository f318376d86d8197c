// SPDX-License-Identifier: MIT
// Reads the URDF of a robot.
#pragma once
#include "padding/robots/robot_tree.h"

namespace padder {

// In metres and radians, as in the file. The shapes are those of `collision`. When no link has any, they are
// those of `visual`, and a note says so. A file that ends in .xacro is expanded by the program xacro first.
// References to meshes:
//   package://PKG/rest  as places_in_package (padding/input/packages.h) says
//   $(find PKG)/rest    the same, after file:// or not
//   file:///rest        as it stands, after localhost or not; file://rest beside the URDF
//   rest                beside the URDF
// In URIs, %20 and the like stand for a byte, unless only a file with the text as it is exists. Where no file
// is named so, a backslash separates folders.
// An `<inertial>` without a mass counts as none, and one without moments gives the mass alone, with a note.
// Only meshes that will be padded must exist. Throws Error, which names the link or joint, for a file that is
// no robot, holds elements of xacro, has no link, has a name twice, has a joint to a missing link or joints
// that form no tree, for a mesh that was not found (with the places where it was looked for), and for text
// where a number should be.
RobotTree read_urdf(const std::filesystem::path& path, const RobotReadOptions& options = {});

}  // namespace padder
