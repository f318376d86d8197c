// SPDX-License-Identifier: GPL-3.0-or-later
// pad for a robot: the links of a URDF, and what is printed of them.
#pragma once
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "padding/export/export.h"
#include "padding/robot.h"
#include "padding/view/view.h"

namespace padder {

// A file to write, and its format; null is our own.
struct OutputFile {
  std::filesystem::path path;
  const Format* format = nullptr;
};

// A URDF brings a .srdf of its pairs along, and one that is asked for by name, which has the spheres as well,
// must not be lost to it: it comes last.
std::vector<OutputFile> in_writing_order(std::vector<OutputFile> files);

struct RobotJob {
  std::filesystem::path urdf;
  std::vector<OutputFile> outputs;
  const PadOptions& options;
  RobotOptions whole;
  ExportOptions exporting;
  bool clusters;                         // also LINK.spheres.json for each link, beside the first output
  std::string preview;                   // a picture or a page; empty: none
  ColourBy colour;                       // of the preview
  std::map<std::string, double> joints;  // where they stand in it, in radians or metres; 0 where not named
};

// Where the spheres of a link go that have a file of their own.
std::filesystem::path link_file(const std::filesystem::path& folder, const std::string& link);

// Pads, writes, and reports: input, output, spheres, and for each link its spheres, family, mask, errors and
// seconds.
nlohmann::ordered_json run_robot(const RobotJob& job, const RobotProgress& progress);

void print_robot(const nlohmann::ordered_json& report);  // for people, on stdout

}  // namespace padder
