// SPDX-License-Identifier: MIT
// Spheres from other programs' files.
#pragma once
#include <filesystem>
#include <string>

#include "padding/asset/cluster.h"

namespace padder {

// Reads .spheres.json, .csv (DEM-Engine), .npz, .vtp, .yaml and .yml (cuRobo), .xrdf, .srdf, .urdf, .xml
// (MuJoCo), a MercuryDPM folder, and by their content LIGGGHTS and YADE sphere lists (.txt, .dat,
// .multisphere or any other ending). Reads the spheres in the frame and unit of the file, and family and mask
// where the file has them. Mass and accuracy stay 0; `bounds` is the box of the spheres. In a file of several
// links or clumps, `part` names the one wanted. Throws Error, which names the file and the place: the file
// cannot be read, has no sphere, a number that is none or not finite, a radius that is not positive, several
// families in one body, or several parts when none is named (the message lists them).
Cluster read_spheres(const std::filesystem::path& path, const std::string& part = {});

}  // namespace padder
