// SPDX-License-Identifier: MIT
// The files that a robot's file names. Not installed.
#pragma once
#include <filesystem>
#include <string>

namespace padder::reading {

// With / for each backslash: what separates folders on Windows. Ask first for a file of the name as it is.
std::string slashed(std::string name);

// The file of this name, or else what the name means with its backslashes taken so; it need not be there.
std::filesystem::path file_in(const std::filesystem::path& folder, const std::string& name);

// For the end of a sentence on a file that is not there: names the file that is there under this name but for
// the case of letters, or says that a folder is. "" where nothing is.
std::string in_other_case(const std::filesystem::path& file);

}  // namespace padder::reading
