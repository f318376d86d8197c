// SPDX-License-Identifier: MIT
// A cluster of spheres: what padding makes of a mesh and what the detector reads, and its JSON form
// (assets/cluster.schema.json). Needs neither CGAL nor assimp.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "padding/asset/mesh.h"

namespace padder {

// The surface that a figure was measured or proved against.
enum class SurfaceKind {
  none,    // no surface: the protrusion is not proved
  input,   // the input's own triangles
  filled,  // these, and the patches over holes that repair closed
  wrap     // the input's triangles; what a wrap around them encloses counts as body
};

// The errors of a cluster against the input mesh. Lengths are in the mesh's unit. docs/padding.md defines the
// terms.
struct Accuracy {
  // Of the union's outer surface, where it lies outside the mesh.
  double protrusion_max = 0, protrusion_mean = 0, protrusion_p95 = 0;
  // Of the mesh's surface, where it lies outside the union.
  double gap_max = 0, gap_mean = 0, gap_p95 = 0;
  double coverage = 0;  // share of the mesh surface inside the union, 0 to 1
  double normal_error_mean_deg = 0, normal_error_p95_deg = 0;
  double volume_ratio = 0;  // volume of the union over the volume of the body; 0 for a sheet
  double protrusion_bound = 0, gap_bound = 0;  // upper bounds against the input, whatever repair did to it
  double wrap_distance = 0;  // no point of the wrap is farther from the input; 0 unless wrapped
  // What counts as body in the proof: what the input encloses, what it encloses with patches over its holes,
  // or what a wrap around it encloses. protrusion_max and gap_max are the bounds. For `none` (an open sheet)
  // gap_max and gap_bound are proved, protrusion_max is sampled and protrusion_bound is an estimate.
  SurfaceKind proved_against = SurfaceKind::none;
  bool certified = false;  // both bounds are proved, and within what was asked for

  void scale(double factor);  // its lengths
  bool operator==(const Accuracy&) const = default;
};

// Where a cluster came from.
struct Provenance {
  std::string file;             // its name, without folders
  std::string sha256;           // of its bytes
  std::uint64_t triangles = 0;  // as read
  std::string repair;           // what repair did, in words
  bool operator==(const Provenance&) const = default;
};

// A coarser level of detail of the same part.
struct Lod {
  double tolerance = 0;     // that was asked for
  double volume_union = 0;  // overlaps counted once
  Accuracy accuracy;
  std::vector<Point> centers;
  std::vector<double> radii;
  std::vector<std::int64_t> triangle;

  void scale(double factor);
  bool operator==(const Lod&) const = default;
};

// The asset.
struct Cluster {
  std::string name;
  std::string unit;     // "m", "cm", "mm", "in", or "" when the user gave none
  std::string program;  // name and version that made it
  Provenance source;
  std::string settings = "{}";  // a JSON object with all that is needed to make the cluster again
  std::uint32_t family = 0;     // 0: none
  std::uint32_t mask = 0;       // bit k: no contact with family k + 1
  Box bounds;                   // of the input mesh; left out of the file when empty
  MassProperties mass;          // of the body that `mass_of` bounds, density 1; no volume: unknown
  SurfaceKind mass_of = SurfaceKind::input;  // a wrap's mass can be far from the body's
  double volume_union = 0;                   // of the spheres, overlaps counted once
  Accuracy accuracy;
  std::vector<Point> centers;  // N
  std::vector<double> radii;   // N, > 0
  // N: for each sphere the triangle that it was made for, of the surface in Padded::mesh (pad --write-mesh);
  // -1 for none.
  std::vector<std::int64_t> triangle;

  std::vector<Lod> lods;  // the coarsest first; empty unless asked for

  std::size_t size() const { return radii.size(); }
  void scale(double factor);  // its lengths, those of `settings` too; areas and the like by their powers
  bool operator==(const Cluster&) const = default;
};

// Metres in a unit of length, of which Cluster::unit tells the words; 1 for "". Throws Error for another
// word.
double metres(const std::string& unit);

// "input", "filled", "wrap"; "" for none.
const char* name_of(SurfaceKind kind);

// The JSON document as text. Keys have a fixed order, and numbers have the digits that give the same double
// back, so equal clusters give equal bytes. Throws Error when arrays differ in length, a number is not finite
// or a radius is not positive.
std::string to_json(const Cluster& cluster);

std::string to_json(const Accuracy& accuracy);  // its block alone

// Reads what to_json wrote, or a file written by hand with at least `format`, `version` and `spheres`.
// `where` names the file in error messages. Ignores keys that the format does not have. Throws Error, which
// names the place at fault, for text that is not JSON, for a key twice in one object, for a number too large
// for a double, for a value of the wrong type and for an unknown unit.
Cluster cluster_from_json(std::string_view text, const std::string& where);

// Both throw Error. Writing replaces the file as a whole or not at all.
void write_cluster(const Cluster& cluster, const std::filesystem::path& path);
Cluster read_cluster(const std::filesystem::path& path);

}  // namespace padder
