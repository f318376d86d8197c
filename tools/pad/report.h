// SPDX-License-Identifier: GPL-3.0-or-later
// What pad reports of a mesh.
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "padding/pad.h"

namespace padder {

// The files that were read and written; `mesh` is empty without --write-mesh.
struct PadFiles {
  std::string input;
  std::filesystem::path output, mesh;
  double density = 1000;  // for the mass
};

// The document of --json.
nlohmann::ordered_json report_json(const PadFiles& files, const PadOptions& options, const Padded& padded,
                                   const std::vector<std::string>& warnings);

// For people, on stdout.
void print_report(const PadFiles& files, const Padded& padded);
// For -v: a line for each step, on stderr.
void print_seconds(const nlohmann::ordered_json& report);

// The two largest errors in percent of the diagonal, each with what stands behind it: "protrusion at most
// 0.43 % (mean 0.17 %), gap at most 0.37 % (mean 0.004 %), both proved against the input".
std::string errors_text(const Accuracy& accuracy, double diagonal);

}  // namespace padder
