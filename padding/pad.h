// SPDX-License-Identifier: GPL-3.0-or-later
// The padding pipeline in one call: a mesh in, a cluster and a report out. Each step is a file of a room:
//
//   by depth ratio: read - repair - remesh - fit - refit - cull - accuracy   (cull only with a tolerance)
//   by tolerance:   read - repair                        - cull - accuracy   (cull makes its own balls)
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/geometry/repaired.h"
#include "padding/input/read.h"
#include "padding/meshing/remesh.h"
#include "padding/meshing/repair.h"
#include "padding/pad_options.h"
#include "padding/verify/wrapped.h"

namespace padder {

// Time spent in each step.
struct PadSeconds {
  double read = 0, repair = 0, remesh = 0, fit = 0, refit = 0, cull = 0, accuracy = 0;
  double lower_bound = 0;  // not part of the total
  double total() const { return read + repair + remesh + fit + refit + cull + accuracy; }
};

// What happened on the way.
struct PadReport {
  std::uint64_t triangles_in = 0, triangles_remeshed = 0;
  double edge_length = 0;  // that was used; 0 when nothing was remeshed
  double tolerance = 0;    // that was asked for, in the mesh's unit; 0: none
  // Proved: no cover has fewer spheres whose errors the certificate bounds by the ones that were asked for,
  // or with a count alone by the ones that were found (padding/by_tolerance/lower_bound.h); 0: not asked for.
  std::uint64_t fewest = 0;
  // Proved: no point of the body lies outside the spheres. Only a gap of 0 asks for it. False where some of
  // the surface is a sheet: it has no inside, and its triangles alone are covered.
  bool filled_body = false;
  // Do protrusion_max and gap_max of every level of detail keep its tolerance? True when none was asked for.
  // Of an open sheet the protrusion is sampled, so this is no proof; Accuracy::certified is.
  bool within = true;
  std::vector<std::string> notes;     // what reading left out or changed (ReadResult::notes)
  std::vector<std::string> warnings;  // one sentence each, about what was probably not meant
  std::string reason;                 // why the cluster is not certified, in words; empty when it is
  double grid_entries = 0;  // of the spheres in the detector's grid, with bins as wide as the largest sphere
  double diagonal = 0;      // of the input's bounding box
  double buried = 0;  // share of the input's surface that nothing outside can touch, so it stays uncovered
  BodyKind kind = BodyKind::solid;
  RepairSteps steps;              // what repair did, in numbers, in the mesh's unit
  std::uint64_t filled = 0;       // number of holes that repair closed, of a solid
  double filled_area = 0;         // of the patches that close them, in the mesh's unit squared
  std::vector<Patch> patches;     // one for each of these holes; in the mesh's unit and frame
  std::vector<ClosedSlot> slots;  // that the wrap closes and the tolerance does not allow, the widest first
  RemeshQuality quality;
  PadSeconds seconds;
};

// What pad() gives.
struct Padded {
  Cluster cluster;
  PadReport report;
  // cluster.triangle holds indices of triangles of this surface, which is in the input's frame and unit: by
  // depth ratio the remeshed one; by tolerance the repaired one, or the input where it had to be wrapped.
  // write_mesh (padding/meshing/write_mesh.h) writes it.
  Mesh mesh;
  std::vector<Mark> marks;  // what repair did, to be shown; in the input's frame and unit
};

// Called before each step, and several times within a long one, with the step's name and how far the work is:
// `done` of `of`. For a progress bar. It may throw, which ends the work with what it threw. Never called from
// two threads at once.
using PadProgress = std::function<void(const char* step, int done, int of)>;

// Pads in a unit frame (padding/geometry/unit_frame.h), so a moved or scaled mesh gives the same cluster,
// moved or scaled. The cluster is in the mesh's own frame and unit. The same bytes and options give it bit
// for bit again, for any number of threads. Throws Error, with the name of `file` in the sentence, for what
// read.h, repair.h and pad_options.h refuse.
Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress = {});

// The same for a file, which is read first. Fills report.seconds.read and report.notes, too.
Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress = {});

}  // namespace padder
