// SPDX-License-Identifier: MIT
// A cluster of spheres: what padding makes of a mesh and what the detector consumes. With its JSON form
// (assets/cluster.schema.json). Needs neither CGAL nor assimp.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// Which surface a figure was taken from.
enum class SurfaceKind {
  none,    // of no surface: nothing is proved
  input,   // the input's own triangles
  filled,  // these and the patches over holes that repair closed
  wrap     // a surface around the input, in its place
};

// Errors of a cluster against the input mesh; lengths in the mesh's unit. The words are defined in
// docs/padding.md.
struct Accuracy {
  double protrusion_max = 0, protrusion_mean = 0,
         protrusion_p95 = 0;                      // union's outer surface outside the mesh
  double gap_max = 0, gap_mean = 0, gap_p95 = 0;  // mesh surface outside the union
  double coverage = 0;                            // share of the mesh surface inside the union, 0 to 1
  double normal_error_mean_deg = 0, normal_error_p95_deg = 0;
  double volume_ratio = 0;  // volume of the union over the volume of the body; 0 for a sheet
  double protrusion_bound = 0, gap_bound = 0;  // maxima against the surface of `proved_against`
  double wrap_distance = 0;  // farthest a wrap lies from the input where it was sampled; 0 unless wrapped
  // The surface that both bounds are proved against. For input and filled, protrusion_max and gap_max are
  // these bounds. For a wrap they are the largest of the samples, no bounds. For none (an open sheet)
  // protrusion_max is sampled and protrusion_bound an estimate; gap_max and gap_bound still are proved.
  SurfaceKind proved_against = SurfaceKind::none;
  bool certified = false;  // proved against the input itself, and within what was asked
};

// Where a cluster came from.
struct Source {
  std::string file;             // its name, without folders
  std::string sha256;           // of its bytes
  std::uint64_t triangles = 0;  // as read
  std::string repair;           // what repair did, in words
};

// A coarser rung of a ladder of the same part.
struct Lod {
  double tolerance = 0;     // asked for
  double volume_union = 0;  // overlaps counted once
  Accuracy accuracy;
  std::vector<Point> centers;
  std::vector<double> radii;
  std::vector<std::int64_t> triangle;
};

// The asset.
struct Cluster {
  std::string name;
  std::string unit;     // "m", "cm", "mm", "in", or "" when the user gave none
  std::string program;  // name and version that made it
  Source source;
  std::string settings = "{}";  // a JSON object: all that is needed to make the cluster again
  std::uint32_t family = 0;     // 0: none
  std::uint32_t mask = 0;       // bit k: no contact with family k + 1
  Box bounds;                   // of the input mesh; left out of the file when empty
  MassProperties mass;          // of the body that `mass_of` bounds, density 1; no volume: unknown
  SurfaceKind mass_of = SurfaceKind::input;  // a wrap's mass can be far from the body's
  double volume_union = 0;                   // of the spheres, overlaps counted once
  Accuracy accuracy;
  std::vector<Point> centers;  // N
  std::vector<double> radii;   // N, > 0
  // N: the triangle that each sphere was made for, of the surface in Padded::mesh (pad --write-mesh); -1:
  // none.
  std::vector<std::int64_t> triangle;

  std::vector<Lod> lods;  // coarser versions of these spheres, coarsest first; empty unless asked for

  std::size_t size() const { return radii.size(); }
};

// "input", "filled", "wrap"; "" for none.
const char* name_of(SurfaceKind kind);

// The JSON document as text, keys in a fixed order, numbers with the digits that give the same double back:
// equal clusters give equal bytes. Throws Error when arrays differ in length, a number is not finite or a
// radius not positive.
std::string to_json(const Cluster& cluster);

std::string to_json(const Accuracy& accuracy);  // its block alone

// Reads what to_json wrote, or a file by hand with at least `format`, `version` and `spheres`. `where` names
// the file in messages. Throws Error that names the place at fault: no JSON, a key twice in one object, a
// number beyond a double's, a value of another type than the format's. Other keys than the format's are not
// looked at.
Cluster cluster_from_json(std::string_view text, const std::string& where);

void write_cluster(const Cluster& cluster,
                   const std::filesystem::path& path);    // whole or not at all; throws Error
Cluster read_cluster(const std::filesystem::path& path);  // throws Error

}  // namespace padder
