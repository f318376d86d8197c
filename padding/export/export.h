// SPDX-License-Identifier: MIT
// Clusters and robots as other programs' files. The table of formats, with what each cannot hold:
// docs/formats.md.
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "padding/export/model.h"

namespace padder {

// A foreign format and what it can hold.
struct Format {
  // What becomes of families and masks.
  enum class Filter {
    numbers,  // kept as they are
    bits,     // translated to bit fields (padding/export/families.h): so many families keep their own
    pairs,    // translated to a list of the pairs of bodies that may not touch; of a part alone not held
    both,     // bit fields, and a list of the pairs that these cannot keep apart
    none,     // cannot be held: a model that has any is refused
    ignored   // not held, and nobody asks for them: a file to look at or to print
  };
  const char* name;     // "dem-engine", "mujoco" …: for --format
  const char* ending;   // with its dot; "" for a folder
  bool own_ending;      // no other format has this ending
  const char* program;  // who reads it
  Filter filter;
  int bits;         // for Filter::bits and Filter::both
  bool several;     // more than one body a file
  bool in_metres;   // the format's unit is the metre: lengths are converted
  bool mass_frame;  // written about the centre of mass along the principal axes: a body with volume is wanted
};

// All of them, in the order of docs/formats.md.
std::span<const Format> formats();

// By name, or by the path's ending when name is "". Throws Error that lists what there is.
const Format& find_format(const std::filesystem::path& path, const std::string& name = {});

// What a format needs and a cluster does not hold.
struct ExportOptions {
  // For formats that state a mass, and bodies that have none: kg/m^3 where the format is in metres, else mass
  // per cubic unit of the model.
  double density = 1000;
  std::string urdf =
      {};  // of the same robot, which is written as well: for cuRobo, if the robot was read from none
};

// Throws what write_model would throw about several bodies, families, masks and pairs. It needs no spheres,
// so a robot can be refused before its links are padded.
void check_filters(const Model& model, const Format& format);

// Writes the model as one file. MercuryDPM gets a folder; a URDF gets NAME.srdf beside it, with the pairs
// that may not touch, when it is a robot's or there are such pairs. All files are written whole, or none.
// Throws Error, one sentence, when the format cannot hold the model (families, several bodies, no volume, a
// sphere of radius 0, no sphere); then nothing is written. Numbers have as many digits as the same double
// needs to be read back; .glb holds float32. Equal models give equal bytes. Returns what the file states that
// is not exact and that its reader should know, one sentence each.
std::vector<std::string> write_model(const Model& model, const std::filesystem::path& path,
                                     const Format& format, const ExportOptions& options = {});

}  // namespace padder
