// SPDX-License-Identifier: GPL-3.0-or-later
// pad for a robot: the links of a URDF, and what is printed of them.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "padding/robot.h"
#include "tools/pad/arguments.h"
#include "tools/pad/target.h"

namespace padder {

// Where the spheres of a link go that have a file of their own.
std::filesystem::path link_file(const std::filesystem::path& folder, const std::string& link);

// Pads, writes, and reports: input, output, spheres, and for each link its spheres, family, mask, errors and
// seconds. Throws Error.
nlohmann::ordered_json run_robot(const PadArguments& a, const std::string& file, const PadTarget& target,
                                 const PadProgress& progress);

void print_robot(const nlohmann::ordered_json& report);  // for people, on stdout

}  // namespace padder
