// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes to files: for what others are to look at beside a cluster.
#pragma once
#include <filesystem>

#include "padding/asset/mesh.h"

namespace padder {

// By the path's ending: .obj, .off and .ply (binary) with the digits that give the same double back, .stl
// (binary) in float32. Triangle k of the mesh is face k of the file. Whole or not at all. Throws Error for
// another ending and when the file cannot be written.
void write_mesh(const Mesh& mesh, const std::filesystem::path& path);

// Does write_mesh know the ending?
bool can_write_mesh(const std::filesystem::path& path);

}  // namespace padder
