// SPDX-License-Identifier: MIT
// Files of robots, whichever their format: which they are, and what is in them.
#pragma once
#include "padding/robots/robot_tree.h"

namespace padder {

// Is it a robot to be padded, and not a file of spheres? A .urdf, a .xacro and a .xml are, in any case of
// letters, but for an MJCF that says no more than which spheres its bodies have, and has no joint in a body.
// A .xml that cannot be read counts, too.
bool is_robot_file(const std::filesystem::path& path);

// By read_mjcf if the file ends in .xml and is no URDF, otherwise by read_urdf.
RobotTree read_robot(const std::filesystem::path& path, const RobotReadOptions& options = {});

}  // namespace padder
