// SPDX-License-Identifier: GPL-3.0-or-later
// pad for a file that holds spheres already: written in other formats, without padding again.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/pad/robot.h"

namespace padder {

struct ConvertJob {
  std::filesystem::path input;  // is_sphere_file (padding/import/import.h)
  std::vector<OutputFile> outputs;
  double scale = 1;
  std::string unit;                    // "": that of the file
  std::uint32_t family = 0, mask = 0;  // 0: those of the file
  ExportOptions exporting;
};

// Reads, writes, and reports: input, outputs, parts, spheres, warnings. Throws Error.
nlohmann::ordered_json run_convert(const ConvertJob& job);

void print_convert(const nlohmann::ordered_json& report);  // for people, on stdout

}  // namespace padder
