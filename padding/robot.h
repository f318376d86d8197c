// SPDX-License-Identifier: GPL-3.0-or-later
// Pads every link of a robot: a URDF or MJCF file in, a model of spheres out. padding/export/export.h writes
// the model.
#pragma once
#include <filesystem>

#include "padding/pad.h"
#include "padding/robots/robot_tree.h"

namespace padder {

// A robot whose links are clusters.
struct PaddedRobot {
  Model model;  // in metres; each cluster in its link's frame, with the families of keep_neighbours_apart
  std::vector<PadReport> reports;  // one for each body; left empty for links that were not padded
  std::vector<char> kept;          // for each body: were its shapes spheres, which stay as they were?
  std::vector<Mesh> meshes;        // for each body what was padded, in the link's frame
  double tolerance = 0;            // that RobotOptions::max_spheres led to; 0: not asked for
  std::vector<std::string> notes;
};

// What a user asks of a robot as a whole.
struct RobotOptions {
  RobotReadOptions reading;
  // Of all links together: the smallest tolerance, the same length for all, that so many spheres can keep. 0:
  // no limit. Only without a tolerance, a count or a depth ratio for each link.
  std::uint64_t max_spheres = 0;
  // Poses that are tried for pairs that never or always touch (padding/self_collision.h); 0: none.
  int poses = 10000;
};

// Returns the shapes of a link as if they had been one mesh file, in the link's frame and in metres. Meshes
// are scaled, and turned over where the scale mirrors them. glTF is turned from Y up to Z up. Round shapes
// become polyhedra inside them, whose chord error is about a twentieth of the gap that `options` allow, or a
// 2000th of the link's diagonal where they say nothing of it. Throws Error as read_mesh.
ReadResult read_link(const RobotLink& link, const std::filesystem::path& file,
                     const PadOptions& options = {});

// The shapes of a link are one body, their union: a shape inside another one adds nothing. Where one of
// several shapes is a mesh with a cavity of its own, other shapes inside it bound cavities, too. A link that
// has only spheres keeps them unmeasured, and several spheres get no mass properties. `options` holds for
// each link by itself: a Length::share() is of the link's own diagonal. Its family and mask are not used.
// Bounds are against the shapes themselves, and not only against the polyhedra that stand for round ones.
// Links are padded side by side on all threads, with the same result for any number of threads. model.apart
// lists neighbours, and what self_collisions() finds. A step of `progress` is a link. Throws Error, which
// names link and file.
PaddedRobot pad_robot(const std::filesystem::path& file, RobotTree robot, const PadOptions& options,
                      const RobotOptions& whole = {}, const PadProgress& progress = {});
PaddedRobot pad_robot(const std::filesystem::path& file, const PadOptions& options,
                      const RobotOptions& whole = {}, const PadProgress& progress = {});  // reads it first

}  // namespace padder
