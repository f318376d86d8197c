// SPDX-License-Identifier: MIT
// What a picture (picture.h) and a page (page.h) draw of a cluster or a scene: the spheres at their places,
// what they can be coloured by, and the mesh that they cover.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/colours.h"
#include "padding/asset/mesh.h"
#include "padding/geometry/repaired.h"

namespace padder {

// A body of a scene: `count` spheres from `first` on.
struct ViewBody {
  std::string cluster;  // the name of its asset
  std::uint64_t first = 0, count = 0;
  std::uint32_t family = 0, mask = 0;
};

// A contact between the spheres i and j.
struct ViewContact {
  std::uint64_t i = 0, j = 0;
  Point at = Point::Zero();        // halfway between the deepest points of the two
  Vector normal = Vector::Zero();  // unit, from i to j
  double depth = 0;
};

// The spheres of one level of detail: `count` from `first` on. Rungs share no sphere, and one of them is
// shown at a time.
struct ViewRung {
  std::string name;
  std::uint64_t first = 0, count = 0;
  std::vector<Accuracy> accuracy;  // none or one
};

// The gap of the mesh to the spheres at every point of it, finely enough to be drawn. The triangles of `mesh`
// divide those of the view's mesh, whose points come first. Inside one, the gap is interpolated between its
// corners, which is right to a few hundredths of the largest error.
struct ErrorMap {
  Mesh mesh;
  // By level of detail, for each point: BallSet::gap. Above 0 the point lies so far outside the spheres.
  // Below 0 it lies so deep inside them that they stand out of the surface there by at least as much, and by
  // no more than the protrusion of the sphere it is in.
  std::vector<std::vector<float>> gap;
};

// All lengths in one unit and one frame. N spheres; an array that may be empty has N entries otherwise.
struct View {
  std::string title;
  std::string unit;         // "" when nobody said
  std::string note;         // where it came from, one line
  Mesh mesh;                // without triangles when there is none
  std::vector<Mark> marks;  // shown with the mesh, each kind in its colour: what repair did (Padded::marks)
  std::vector<Point> centers;
  std::vector<double> radii;
  std::vector<std::uint32_t> family;   // N; 0: none
  std::vector<std::int64_t> triangle;  // may be empty
  std::vector<float> protrusion;       // may be empty: how far the sphere can stand out of the mesh
  std::vector<float> gap;           // may be empty: the largest gap of surface that is nearest to the sphere
  ErrorMap errors;                  // may be empty
  std::vector<std::uint32_t> body;  // may be empty: index into bodies; bodies.size() for a loose sphere
  std::vector<ViewBody> bodies;     // of a scene
  std::vector<ViewContact> contacts;  // of a scene
  std::vector<ViewRung> rungs;        // finest first; empty: all spheres are one level
  std::vector<Accuracy> accuracy;     // none or one: of the first rung
  std::uint32_t mask = 0;             // of a cluster

  std::size_t size() const { return radii.size(); }
  bool has_mesh() const { return !mesh.triangles.empty(); }
  Box bounds() const;  // of mesh and spheres
};

// The view of a cluster, with the mesh that it was made from or without one. With a mesh, each sphere gets
// its protrusion: its radius less the distance from its centre to the mesh. No point of a sphere whose centre
// lies inside stands out farther (certify.h). The value is at least 0 and at most the largest protrusion that
// the cluster reports. The gap of the mesh is found, too (add_errors). This takes one nearest-point query for
// each sphere, and one for each point of the error map, on all threads. A ladder becomes rungs: the cluster's
// own spheres, then its lods from fine to coarse, each named by its tolerance in percent of the diagonal.
View view_of(const Cluster& cluster, const Mesh& mesh = {});

// Fills `errors` and `gap` of a view with a mesh. Triangles are divided until their edges are at most a
// fiftieth of the diagonal, and further, down to a 200th, where the gap is not linear; but no more than until
// there are 100,000.
void add_errors(View& view);

// The spheres of one rung alone, as a view of one level: 0 is the finest. Throws Error when there is no such
// rung; a view without rungs has rung 0.
View one_rung(const View& view, std::size_t rung);

// The mesh that `cluster` was made from, with the same scale. An empty `path` means: look for it by its
// recorded name beside the cluster, in the current folder, and in the folder `assets` of either. Only a file
// with the recorded sha256 is taken; if there is none, the mesh is empty. Throws Error when `path` cannot be
// read, or when its bounds are not those of the cluster.
Mesh mesh_of(const Cluster& cluster, const std::filesystem::path& cluster_path,
             const std::filesystem::path& path = {});
// The same of a mesh that is at hand. `name` is for the message.
Mesh mesh_of(const Cluster& cluster, Mesh mesh, const std::string& name);

// What the colour of a sphere stands for.
enum class ColourBy : std::uint8_t { family, radius, protrusion, gap, triangle, body };
inline constexpr ColourBy kColourings[] = {ColourBy::family, ColourBy::radius,   ColourBy::protrusion,
                                           ColourBy::gap,    ColourBy::triangle, ColourBy::body};
const char* name_of(ColourBy by);  // "protrusion"

// The lengths that a ramp of colours runs over: from 0 to the largest error of spheres and mesh, or from the
// smallest to the largest radius. None for colours of kinds.
struct ColourRange {
  double low = 0, high = 0;
  double share(double length) const { return high > low ? (length - low) / (high - low) : 0; }
};
std::optional<ColourRange> range_of(const View& view, ColourBy by);

// One colour for each sphere. Throws Error when the view lacks what the colours are to show.
std::vector<Colour> colours_of(const View& view, ColourBy by);

// The error at each point of errors.mesh, of the first level: the gap, or the protrusion. Empty for colours
// that the mesh does not share.
std::vector<float> mesh_errors(const View& view, ColourBy by);

// The colours themselves, which the page shares. Families and bodies take kinds[(number - 1) % size], `none`
// is number 0; lengths run through the stops of the ramp from 0 or the smallest to the largest.
struct Palette {
  Colour none, mesh, background;
  std::array<Colour, 4> marks;  // by MarkKind
  std::vector<Colour> kinds, ramp;
  Colour ink, dark_background, dark_ink;  // of text and lines, on either background
};
const Palette& palette();
Colour along_ramp(double share);  // the colour at 0 to 1 of the ramp

// What a legend says of a mark: "patch over a hole".
const char* name_of(MarkKind kind);

}  // namespace padder
