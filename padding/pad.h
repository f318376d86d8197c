// The padding pipeline in one call: mesh in, cluster and report out.
//   read - repair - remesh - fit - refit - accuracy         by depth ratio (cull before accuracy with a
//   tolerance) read - repair - cull - accuracy                         by tolerance: the cull makes its own
//   samples and balls
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "padding/cluster.h"
#include "padding/cull.h"
#include "padding/read.h"
#include "padding/remesh.h"
#include "padding/repair.h"

namespace padder {

// In the mesh's unit, or as a share of its bounding box's diagonal.
struct Length {
  double value = 0;    // 0: not given
  bool share = false;  // value is a share: 0.01 is 1 %

  bool given() const { return value != 0; }
  double of(double diagonal) const { return share ? value * diagonal : value; }
};

// Two ways to say what is wanted. A depth ratio: one sphere a triangle, as in the paper. A tolerance, a count
// or a ladder: the fewest spheres that keep it. Both a depth and a tolerance: the spheres of the depth,
// thinned to those that the tolerance needs.
struct PadOptions {
  std::optional<double>
      depth;           // cap height over circumradius, 0 < depth <= 1; 0.2 when nothing else is asked for
  Length edge_length;  // of the remeshed triangles; not given: caps a 400th of the diagonal high
  double sharp_angle = 40;  // degrees; remeshing keeps edges that turn by more (a wrap's are noise: none)

  Length tolerance;               // of protrusion and gap alike
  std::uint64_t max_spheres = 0;  // 0: no limit; else the best error for a count
  Length min_radius, max_radius;
  Balance balance = Balance::none;  // what the freedom within the tolerance is spent on
  double smooth = 0;                // degrees of mean normal error asked for; 0: not asked
  int effort = 1;                   // 0 to 3: longer search, fewer spheres
  std::vector<Length> lod;          // tolerances of a ladder: the finest is the cluster, the others its lods

  Length reach;  // radius of the smallest grain: what it cannot touch is not padded
  RepairMode repair = RepairMode::automatic;
  std::uint32_t family = 0;  // of the asset; 0: none
  std::uint32_t mask = 0;    // bit k: no contact with family k + 1

  bool by_tolerance() const { return tolerance.given() || max_spheres > 0 || !lod.empty(); }
  double depth_used() const { return depth.value_or(0.2); }
};

// Time spent in each step.
struct PadSeconds {
  double read = 0, repair = 0, remesh = 0, fit = 0, refit = 0, cull = 0, accuracy = 0;
  double total() const { return read + repair + remesh + fit + refit + cull + accuracy; }
};

// What happened on the way.
struct PadReport {
  std::uint64_t triangles_in = 0, triangles_remeshed = 0;
  double edge_length = 0;   // used; 0 when nothing was remeshed
  double tolerance = 0;     // asked for, in the mesh's unit; 0: none
  bool within = true;       // false when max_spheres or a radius limit did not allow the tolerance
  double grid_entries = 0;  // of the spheres in the detector's grid, with bins as wide as the largest sphere
  double diagonal = 0;      // of the input's bounding box
  double buried = 0;        // share of the input's surface that cannot be touched from outside (wraps only)
  BodyKind kind = BodyKind::solid;
  RemeshQuality quality;
  PadSeconds seconds;
};

// What pad() gives.
struct Padded {
  Cluster cluster;
  PadReport report;
};

// Called before each step with its name; steps so far done and all of them, for a progress bar.
using PadProgress = std::function<void(const char* step, int done, int of)>;

// Works in a frame of its own, centred and scaled to a diagonal of 1, with coordinates rounded to 2^-36 of it
// (1.5e-11), so that a moved or scaled mesh gives the same cluster moved or scaled. The cluster is in the
// mesh's own frame and unit, made anew from the same bytes and options it is equal bit for bit, for any
// number of threads. Throws Error (see padding/read.h, repair.h) with `file` in the sentence.
Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress = {});

// Reads the file first; report.seconds.read is then filled.
Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress = {});

}  // namespace padder
