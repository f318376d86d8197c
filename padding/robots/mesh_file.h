// SPDX-License-Identifier: MIT
// The mesh file that a robot's file names. Not installed.
#pragma once
#include <filesystem>
#include <string>

namespace padder::reading {

// With / for each backslash: what separates folders on Windows. Ask first for a file of the name as it is.
std::string slashed(std::string name);

// For the end of a sentence on a file that is not there: names the file that is there under this name but for
// the case of letters. "" where none is.
std::string in_other_case(const std::filesystem::path& file);

}  // namespace padder::reading
