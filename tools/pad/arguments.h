// SPDX-License-Identifier: GPL-3.0-or-later
// What pad takes on its command line, and on a line of a manifest.
#pragma once
#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "padding/export/export.h"
#include "padding/pad_options.h"
#include "padding/robot.h"
#include "padding/view/view.h"

namespace padder {

// The arguments as they were given. Those of a part: what a line of a manifest may set for one part.
struct PadArguments {
  std::vector<std::string> meshes;
  std::vector<std::string> outputs;  // of -o
  std::string unit, format;
  std::string input_format;  // of the mesh from the standard input
  double scale = 1, density = ExportOptions().density;
  PadOptions options;
  bool family_given = false, mask_given = false;  // a conversion keeps those of the file otherwise
  RobotOptions robot;
  std::vector<std::string> joints;
  double seconds = 3600;  // that one part of a manifest may take, or a call if given; 0: any time
  std::string memory;     // that a process may hold, as 2G; empty: the worker's portion

  // Of the whole run.
  std::string manifest, shard, preview, write_mesh;
  ColourBy colour = ColourBy::family;  // of the preview
  int threads = 0, workers = 0;        // 0: chosen
  bool page = false, json = false, quiet = false, verbose = false;

  std::string output() const { return outputs.empty() ? "" : outputs[0]; }  // the first
};

// Declares the options of a part, with MESH and -o.
void declare_part(CLI::App& app, PadArguments& a);

// Declares everything, in the order in which --help lists it.
void declare_all(CLI::App& app, PadArguments& a);

// The options that were given and that the asset's bytes depend on, with their values as they were typed.
std::map<std::string, std::string> settings_of(const CLI::App& app);

}  // namespace padder
