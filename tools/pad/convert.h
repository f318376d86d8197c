// SPDX-License-Identifier: GPL-3.0-or-later
// pad for a file that holds spheres already: written in other formats, without padding again.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "tools/pad/arguments.h"
#include "tools/pad/target.h"

namespace padder {

// Reads `file` (is_sphere_file, padding/import/import.h), writes, and reports: input, outputs, parts,
// spheres, warnings. Throws Error.
nlohmann::ordered_json run_convert(const PadArguments& a, const std::string& file, const PadTarget& target);

void print_convert(const nlohmann::ordered_json& report);  // for people, on stdout

}  // namespace padder
