// SPDX-License-Identifier: MIT
// Spheres from other programs' files.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "padding/asset/cluster.h"
#include "padding/export/model.h"

namespace padder {

// Reads .spheres.json, .csv (DEM-Engine), .npz, .vtp, .yaml and .yml (cuRobo), .xrdf, .srdf, .urdf, .xml
// (MuJoCo), a MercuryDPM folder, and by their content LIGGGHTS and YADE sphere lists (.txt, .dat,
// .multisphere or any other ending). Reads the spheres in the frame and unit of the file, and family and mask
// where the file has them. Mass and accuracy stay 0; `bounds` is the box of the spheres. In a file of several
// links or clumps, `part` names the one wanted. Throws Error, which names the file and the place: the file
// cannot be read, has no sphere, a number that is none or not finite, a radius that is not positive (cuRobo
// switches a sphere off by one: there it is left out), several families in one body, or several parts when
// none is named (the message lists them).
Cluster read_spheres(const std::filesystem::path& path, const std::string& part = {});

// Is this a file of spheres by its ending, one that read_spheres reads and that no mesh has? Or the folder of
// a MercuryDPM clump?
bool is_sphere_file(const std::filesystem::path& path);

// What a file of spheres holds.
struct SphereModel {
  Model model;  // a body for each part; its unit is "" where the format has none
  // The parts are links, each in its own frame, and the file does not say where they are. Then only formats
  // that do not say it either can be written from it.
  bool links = false;
  std::uint64_t switched_off = 0;  // spheres of cuRobo without a radius, which were left out
};

// All parts of such a file, for write_model. Throws Error as read_spheres.
SphereModel read_sphere_model(const std::filesystem::path& path);

}  // namespace padder
