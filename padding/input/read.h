// SPDX-License-Identifier: MIT
// Mesh files to a triangle soup: OBJ, STL, PLY, OFF, glTF and GLB, FBX, COLLADA, 3DS, 3MF. Only geometry is
// read: no material, texture, bone, animation, camera or light.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/mesh.h"

namespace padder {

// How the numbers of a file are to be taken.
struct ReadOptions {
  double scale = 1;  // factor on every coordinate, > 0
  std::string unit;  // "m", "cm", "mm", "in": the unit wanted; "" keeps the file's own
};

// The soup in the order of the file, not repaired: the faces may be open, doubled, turned or without area.
// Every point is finite and some triangle uses it; equal positions are not merged.
struct ReadResult {
  Mesh mesh;
  Source source;     // file, sha256 and triangles; repair is left empty
  std::string unit;  // of the coordinates: "" when neither the file nor the options say it
  std::vector<std::string>
      notes;  // what was left out or changed on the way, one clause each; most often empty
};

// Reads the file by its ending (any case). What happens on the way:
//
//   polygons   are split into triangles inside themselves, concave ones too (padding/input/polygon.h).
//   nodes      of a scene: each instance of a mesh is placed by the transforms above it; where these mirror,
//   the faces
//              are turned over so that outside stays outside.
//   numbers    OBJ, OFF, PLY and 3MF in double precision (of what a PLY declares as float, a float). The
//              others pass through assimp, which keeps float32: about seven digits, and beyond 3.4e38
//              nothing; in a binary STL that is all the file has.
//   unit       3MF says its unit (millimetres unless it says another; microns come as mm, feet as in). glTF
//   and
//              COLLADA come in metres and with Y up (COLLADA's own unit and up axis are converted), FBX in
//              the unit it names. When options.unit differs from the file's, coordinates are converted. OBJ,
//              STL, PLY, OFF and 3DS name no unit: there options.unit is a label only.
//   scale      multiplies last; without options.unit the result's unit is then unknown.
//   strips     of PLY and glTF are triangles, every second one turned.
//   3MF        what is to be built, with components and transforms; supports are left out.
//   left out   faces of one or two corners, lines, edges, points that no face uses (also those that are not
//              finite): see notes.
//   refused    what has a shape that is not read: free-form surfaces of OBJ, faces of a PLY under another
//   name
//              than face or tristrips, extensions that a 3MF or glTF needs.
//   sha256     of the named file alone, not of the buffers that a .gltf refers to.
//
// OBJ is read by tinyobjloader; OFF, PLY and 3MF here (assimp 5.2 drops faces of an OFF of more than nine
// corners, takes strips of a PLY for one triangle, and does not tell the unit of a 3MF), the rest by assimp.
// What assimp or zlib see is read in a process of its own. Assimp reads one file at a time, whatever the
// number of threads.
//
// Throws Error, one sentence that names the file and the place: absent or empty file, unknown ending,
// malformed or truncated content, an index out of range, a used vertex that is not finite, no triangle at
// all, more points or triangles than 32-bit indices name, an unknown unit, a scale that is not positive.
ReadResult read_mesh(const std::filesystem::path& path, const ReadOptions& options = {});

// Every ending read_mesh knows, lower case with its dot: ".obj", ".stl" …
const std::vector<std::string>& mesh_endings();

}  // namespace padder
