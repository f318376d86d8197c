// SPDX-License-Identifier: GPL-3.0-or-later
// Writes meshes to files, for what users want to look at beside a cluster.
#pragma once
#include <filesystem>

#include "padding/asset/mesh.h"

namespace padder {

// Writes the format of the path's ending: .obj, .off and .ply (binary) with the digits that give the same
// double back, .stl (binary) in float32. Triangle k of the mesh is face k of the file. The file is replaced
// as a whole or not at all. Throws Error for another ending and when the file cannot be written.
void write_mesh(const Mesh& mesh, const std::filesystem::path& path);

// Does write_mesh know the ending?
bool can_write_mesh(const std::filesystem::path& path);

}  // namespace padder
