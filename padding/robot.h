// SPDX-License-Identifier: GPL-3.0-or-later
// Every link of a robot padded: a URDF in, a model of spheres out (padding/export/export.h writes it).
#pragma once
#include <filesystem>

#include "padding/input/urdf.h"
#include "padding/pad.h"

namespace padder {

// A robot whose links are clusters.
struct PaddedRobot {
  Model model;  // metres; each cluster in its link's frame, with the families of set_families
  std::vector<PadReport> reports;  // one a body; of links without shapes as it is made
  std::vector<std::string> notes;
};

// Called before each link with its name, the links so far done and all of them.
using RobotProgress = std::function<void(const std::string& link, std::size_t done, std::size_t of)>;

// The link's shapes as if they had been one mesh file, in the link's frame and metres. A mesh is scaled
// (turned over where the scale mirrors), COLLADA and glTF go from Y up to Z up; cylinders become polygons
// whose chords stay within a 400th of the link's diagonal. Throws Error as read_mesh.
ReadResult read_link(const UrdfLink& link, const std::filesystem::path& urdf);

// A link's shapes are one body: overlapping meshes, boxes and cylinders are united by repair; a link that is
// nothing but spheres keeps them as they are (several: without mass properties). `options` holds for each
// link by itself: a share is of the link's own diagonal; family and mask in it are not used. Throws Error
// with link and file in the sentence.
PaddedRobot pad_robot(const std::filesystem::path& urdf, const PadOptions& options,
                      const RobotProgress& progress = {});

}  // namespace padder
