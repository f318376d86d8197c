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
    none      // cannot be held: a model that has any is refused
  };
  const char* name;     // "dem-engine", "mujoco" …: for --format
  const char* ending;   // with its dot; "" for a folder
  bool own_ending;      // the ending alone tells the format
  const char* program;  // who reads it
  Filter filter;
  int bits;         // for Filter::bits
  bool several;     // more than one body a file
  bool in_metres;   // the format's unit is the metre: lengths are converted
  bool mass_frame;  // written about the centre of mass along the principal axes: a body with volume is wanted
};

// All of them, in the order of docs/formats.md.
std::span<const Format> formats();

// By name, or by the path's ending when name is "". Throws Error that lists what there is.
const Format& find_format(const std::filesystem::path& path, const std::string& name = {});

// What a format needs to know and a cluster does not say.
struct ExportOptions {
  // Mass over volume, for formats that state a mass and bodies that come without one: kg/m^3 where the format
  // is in metres, else mass per cubed unit of the model.
  double density = 1000;
};

// Writes the model: one file, or a folder (MercuryDPM), or for URDF with pairs that may not touch also
// NAME.srdf beside it. Each file whole or not at all, and none when the model cannot be held: Error says what
// and why in one sentence (families, several bodies, no volume, a sphere of radius 0, nothing in it). Numbers
// carry the digits that give the same double back, but in .glb, which is float32. Equal models give equal
// bytes. Returns what the file's reader should be told, one sentence each (padding/export/warnings.h); most
// often nothing.
std::vector<std::string> write_model(const Model& model, const std::filesystem::path& path,
                                     const Format& format, const ExportOptions& options = {});

}  // namespace padder
