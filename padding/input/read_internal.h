// SPDX-License-Identifier: MIT
// What the readers of mesh files share. Not installed.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/mesh.h"
#include "padding/input/read.h"
#include "padding/input/text.h"

namespace padder {

// SHA-256 by OpenSSL, 64 hexadecimal digits. That of a regular file is read piece by piece, so that its size
// does not matter; throws Error when it cannot be read, or is a folder, a device or a pipe.
std::string sha256(std::string_view bytes);
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace padder

namespace padder::reading {

// Polygons as a file has them.
struct Soup {
  std::vector<Point> points;
  std::vector<std::uint32_t> corners;  // indices of the corners of all faces, one face after the other
  std::vector<std::uint64_t> ends;     // the corners of face f end before ends[f]
  std::vector<std::uint32_t> lines;    // for each point its line in a text file; may be empty
  std::uint64_t thin = 0;              // number of faces with one or two corners, which are left out
  std::string unit;                    // the file's own, or ""
  std::vector<std::string> notes;

  void close_face() { ends.push_back(corners.size()); }
};

// Files in memory, by their path in normal form.
using FilesBeside = std::map<std::filesystem::path, std::string>;

// Throws when 32-bit indices do not suffice.
void check_counts(std::uint64_t points, std::uint64_t triangles, const std::string& where);

Soup read_obj(std::string& bytes, const std::string& where);
Soup read_off(const std::string& bytes, const std::string& where);
Soup read_ply(const std::string& bytes, const std::string& where);
Soup read_stl(const std::string& bytes, const std::string& where);
Soup read_3mf(const std::string& bytes, const std::string& where);
Soup read_msh(std::string_view bytes, const std::string& where);
// By assimp, which sees these bytes and these files, and opens nothing.
Soup read_scene(const std::string& bytes, const FilesBeside& beside, const std::filesystem::path& path,
                const std::string& ending);

// The text of a COLLADA file as assimp reads it rightly: without looks, with true counts of its arrays, with
// all meshes in its scene where it shows none. Refuses what assimp would crash on or read past the end of.
std::string plain_collada(const std::string& bytes, std::vector<std::string>& notes,
                          const std::string& where);

// Refuses parts of a glTF that change its shape and that assimp would skip in silence, and gives one without
// a scene a scene of all that is in it. Returns the buffers that lie beside it: those that are files, and in
// its folder or below.
FilesBeside check_gltf(std::string& bytes, const std::filesystem::path& path, const std::string& ending,
                       std::vector<std::string>& notes);
// The same files by their names, and nothing checked. Throws for what is no JSON.
std::vector<std::filesystem::path> files_beside_gltf(const std::filesystem::path& path);

// Mesh, unit and notes of the format that `ending` names. Reads no file. May change `bytes`.
ReadResult parse(std::string& bytes, const FilesBeside& beside, const std::filesystem::path& path,
                 const std::string& ending);

// Calls `read` in a child (padding/asset/child.h), and brings its mesh, unit and notes, or its Error, here.
ReadResult mesh_from_child(const std::function<ReadResult()>& read, std::size_t file_size,
                           const std::string& where);

}  // namespace padder::reading
