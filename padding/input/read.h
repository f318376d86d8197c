// SPDX-License-Identifier: MIT
// Reads mesh files into a triangle soup: OBJ, STL, PLY, OFF, glTF and GLB, FBX, COLLADA, 3DS, 3MF and
// MuJoCo's MSH. Only geometry is read: no material, texture, animation, camera or light.
#pragma once
#include <strings.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/mesh.h"

namespace padder {

// How to take the numbers of a file.
struct ReadOptions {
  double scale = 1;  // factor for all coordinates, above 0
  std::string unit;  // "m", "cm", "mm", "in": the unit wanted; "" keeps the file's own
};

// The soup in the order of the file, not repaired: faces may be open, doubled, turned or without area. Every
// point is finite and is used by a triangle. Equal positions are not merged.
struct ReadResult {
  Mesh mesh;
  Provenance source;  // file, sha256 and triangles; repair is left empty
  std::string unit;   // of the coordinates; "" when neither the file nor the options name it
  // What was left out or changed, one clause each; most often empty.
  std::vector<std::string> notes;
  // Of a mesh that stands for round shapes: it lies within them, and no point of theirs is farther from it.
  double chord_error = 0;
};

// The ending of the file, in any case, says its format.
//
// * Polygons are split into triangles inside themselves, concave ones too (padding/input/polygon.h).
// * Nodes of a scene: each instance of a mesh is placed by the transforms above it. Where these mirror, the
//   faces are turned over, so that outside stays outside. A glTF's skin stands where its joints hold it.
// * Numbers of OBJ, OFF, PLY, 3MF and a text STL are read in double precision (a PLY's floats as floats). A
//   binary STL and an MSH hold float32: about seven digits, and nothing beyond 3.4e38. The others pass
//   through assimp, which keeps no more than that.
// * Unit: 3MF names its unit, or means millimetres (microns are converted to mm, feet to in). glTF
//   comes in metres and with Y up. COLLADA's unit is converted to metres; its coordinates stay, whichever
//   axis it calls up, as ROS has it. FBX comes in the unit that it names. When options.unit is another one,
//   coordinates are converted. OBJ, STL, PLY, OFF, 3DS and MSH name no unit: for them options.unit is only
//   a label.
// * Scale multiplies last. Without options.unit, the unit of the result is then unknown.
// * Strips of PLY and glTF become triangles, every second one turned.
// * 3MF: only what is to be built is read, with its components and transforms, but without supports. The
//   attribute `printable` of some slicers is not 3MF's and does not count.
// * Left out, with a note: faces of one or two corners, lines, edges, and points that no face uses, also
//   those that are not finite.
// * Refused, because it has a shape that is not read: free-form surfaces of OBJ, faces of a PLY under another
//   name than face or tristrips, extensions that a 3MF or glTF needs.
// * sha256 is that of the named file alone, without the buffers that a .gltf refers to.
//
// tinyobjloader reads OBJ. OFF, PLY, STL, 3MF and MSH are read here, because assimp 5.2 keeps only floats,
// drops faces of an OFF with more than nine corners, takes the strips of a PLY for one triangle, does not
// tell the unit of a 3MF, and knows no MSH. assimp reads the rest. Each file is read in a process of its own
// (padding/asset/child.h).
//
// Throws Error, one sentence that names the file and the place, for: an absent or empty file, an unknown
// ending, malformed or truncated content, an index out of range, a used vertex that is not finite, no
// triangle at all, more points or triangles than 32-bit indices can name, an unknown unit, a scale that is
// not positive.
ReadResult read_mesh(const std::filesystem::path& path, const ReadOptions& options = {});

// All endings that read_mesh knows, in lower case with their dots: ".obj", ".stl" …
inline const std::vector<std::string>& mesh_endings() {
  static const std::vector<std::string> endings = {".obj", ".stl", ".ply", ".off", ".gltf", ".glb",
                                                   ".fbx", ".dae", ".3ds", ".3mf", ".msh"};
  return endings;
}

// Does its ending say that it is a mesh? So do endings in upper case.
inline bool has_mesh_ending(const std::filesystem::path& file) {
  return std::ranges::any_of(mesh_endings(), [ending = file.extension().string()](const std::string& known) {
    return strcasecmp(known.c_str(), ending.c_str()) == 0;
  });
}

}  // namespace padder
