// SPDX-License-Identifier: GPL-3.0-or-later
// What pad reports of a mesh.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "padding/pad.h"
#include "tools/pad/arguments.h"
#include "tools/pad/target.h"

namespace padder {

// The document of --json.
nlohmann::ordered_json report_json(const PadArguments& a, const std::string& file, const PadTarget& target,
                                   const Padded& padded, const std::vector<std::string>& warnings);

// For people, on stdout.
void print_report(const PadArguments& a, const std::string& file, const PadTarget& target,
                  const Padded& padded);
// For -v: a line for each step, on stderr.
void print_seconds(const nlohmann::ordered_json& report);

}  // namespace padder
