// SPDX-License-Identifier: GPL-3.0-or-later
// pad for a robot: the links of a URDF, and what is printed of them.
#pragma once
#include <nlohmann/json.hpp>

#include "padding/export/export.h"
#include "padding/robot.h"

namespace padder {

struct RobotJob {
  std::filesystem::path urdf, output;
  const Format* format;
  const PadOptions& options;
  ExportOptions exporting;
  bool clusters;  // also LINK.spheres.json for each link, beside the output
};

// Pads, writes, and reports: input, output, spheres, and for each link its spheres, family, mask, errors and
// seconds.
nlohmann::ordered_json run_robot(const RobotJob& job, const RobotProgress& progress);

void print_robot(const nlohmann::ordered_json& report);  // for people, on stdout

}  // namespace padder
