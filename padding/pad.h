// The padding pipeline in one call: mesh in, cluster and report out.
//   read - repair - remesh - fit - refit - accuracy
#pragma once
#include <functional>
#include <string>

#include "padding/cluster.h"
#include "padding/read.h"
#include "padding/remesh.h"
#include "padding/repair.h"

namespace padder {

// Lengths in the mesh's unit.
struct PadOptions {
  double depth = 0.2;          // cap height over circumradius, 0 < depth <= 1
  double edge_length = 0;      // of the remeshed triangles; 0: see edge_share
  double edge_share = 0;       // the same as a share of the diagonal; both 0: so that caps are a 400th of the diagonal high
  double sharp_angle = 40;     // degrees; edges sharper than this are kept by remeshing (not on a wrap, whose edges are noise)
  RepairMode repair = RepairMode::automatic;
  std::uint32_t family = 0;    // of the asset; 0: none
  std::uint32_t mask = 0;      // bit k: no contact with family k + 1
};

struct PadSeconds {
  double read = 0, repair = 0, remesh = 0, fit = 0, refit = 0, cull = 0, accuracy = 0;
  double total() const { return read + repair + remesh + fit + refit + cull + accuracy; }
};

struct PadReport {
  std::uint64_t triangles_in = 0, triangles_remeshed = 0;
  double edge_length = 0;  // used
  double diagonal = 0;     // of the input's bounding box
  double buried = 0;       // share of the input's surface that cannot be touched from outside (wraps only)
  BodyKind kind = BodyKind::solid;
  RemeshQuality quality;
  PadSeconds seconds;
};

struct Padded {
  Cluster cluster;
  PadReport report;
};

// Called before each step with its name; steps so far done and all of them, for a progress bar.
using PadProgress = std::function<void(const char* step, int done, int of)>;

// Works in a frame of its own, centred and scaled to a diagonal of 1, with coordinates rounded to 2^-36 of it (1.5e-11), so
// that a moved or scaled mesh gives the same cluster moved or scaled. The cluster is in the mesh's own frame and unit, made
// anew from the same bytes and options it is equal bit for bit, for any number of threads.
// Throws Error (see padding/read.h, repair.h) with `file` in the sentence.
Padded pad(const ReadResult& file, const PadOptions& options, const PadProgress& progress = {});

// Reads the file first; report.seconds.read is then filled.
Padded pad_file(const std::filesystem::path& path, const ReadOptions& reading, const PadOptions& options,
                const PadProgress& progress = {});

}  // namespace padder
