// SPDX-License-Identifier: GPL-3.0-or-later
// The padding pipeline in one call: mesh in, cluster and report out.
//   read - repair - remesh - fit - refit - accuracy         by depth ratio (cull before accuracy with a
//   tolerance) read - repair - cull - accuracy                         by tolerance: the cull makes its own
//   samples and balls
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/input/read.h"
#include "padding/meshing/remesh.h"
#include "padding/meshing/repair.h"
#include "padding/pad_options.h"

namespace padder {

// Time spent in each step.
struct PadSeconds {
  double read = 0, repair = 0, remesh = 0, fit = 0, refit = 0, cull = 0, accuracy = 0;
  double total() const { return read + repair + remesh + fit + refit + cull + accuracy; }
};

// What happened on the way.
struct PadReport {
  std::uint64_t triangles_in = 0, triangles_remeshed = 0;
  double edge_length = 0;  // used; 0 when nothing was remeshed
  double tolerance = 0;    // asked for, in the mesh's unit; 0: none
  // Does each rung's protrusion_max and gap_max, against the input, keep its tolerance? True when none was
  // asked for. Where these are samples (Accuracy::proved_against) it is no proof: `certified` is.
  bool within = true;
  std::vector<std::string> warnings;  // one sentence each: what is likely not as it was meant
  std::string reason;                 // why the cluster is not certified, in words; empty when it is
  double grid_entries = 0;  // of the spheres in the detector's grid, with bins as wide as the largest sphere
  double diagonal = 0;      // of the input's bounding box
  double buried = 0;        // share of the input's surface that cannot be touched from outside (wraps only)
  BodyKind kind = BodyKind::solid;
  std::uint64_t filled = 0;  // holes that repair closed, of a solid
  double filled_area = 0;    // of their patches, in the mesh's unit squared
  RemeshQuality quality;
  PadSeconds seconds;
};

// What pad() gives.
struct Padded {
  Cluster cluster;
  PadReport report;
  // The surface that cluster.triangle counts the triangles of, in the input's frame and unit: remeshed by
  // depth, repaired by tolerance (write_mesh, padding/meshing/write_mesh.h).
  Mesh mesh;
};

// Called before each step with its name; steps so far done and all of them, for a progress bar.
using PadProgress = std::function<void(const char* step, int done, int of)>;

// Works in a frame of its own, centred and scaled to a diagonal of 1, with coordinates rounded to 2^-36 of it
// (1.5e-11), so that a moved or scaled mesh gives the same cluster moved or scaled. The cluster is in the
// mesh's own frame and unit, made anew from the same bytes and options it is equal bit for bit, for any
// number of threads. Throws Error (see padding/input/read.h, repair.h, pad_options.h) with `file` in the
// sentence.
Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress = {});

// Reads the file first; report.seconds.read is then filled.
Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress = {});

}  // namespace padder
