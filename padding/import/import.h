// SPDX-License-Identifier: MIT
// Spheres from other programs' files.
#pragma once
#include <filesystem>
#include <string>

#include "padding/asset/cluster.h"

namespace padder {

// Reads .spheres.json, .csv (DEM-Engine), .npz, .vtp, .yaml and .yml (cuRobo), .xrdf, .srdf, .urdf, .xml
// (MuJoCo), a MercuryDPM folder, and by their content LIGGGHTS and YADE sphere lists (.txt, .dat,
// .multisphere or any other ending). Only spheres are read, in the frame and unit of the file: mass and
// accuracy stay 0, `bounds` is the box of the spheres. Family and mask where the file has them. In a file of
// several links or clumps, `part` names the one wanted. Throws Error that names the file and the place: not
// readable, no sphere, a number that is not one or not finite, a radius that is not positive, several parts
// and none named (they are listed), several families in one body.
Cluster read_spheres(const std::filesystem::path& path, const std::string& part = {});

}  // namespace padder
