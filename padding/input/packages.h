// SPDX-License-Identifier: MIT
// Where the files are that a URI names: what package://NAME/rest in a URDF stands for.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace padder {

// A URI writes what it cannot hold, as a space, as % and two hexadecimal digits.
std::string unescaped(std::string_view uri);

// The places where package://NAME/rest may be, best first, for a URDF in the folder `home`. They need not
// exist. A package NAME is looked for in `folders`, in `home` and the folders above it, in those that
// ROS_PACKAGE_PATH lists, and as PREFIX/share/NAME in those that AMENT_PREFIX_PATH lists. It is the folder of
// that name, or a folder whose package.xml names the package NAME: the folder looked in, or one right in it.
// In `folders` and those of ROS_PACKAGE_PATH it may lie up to four folders deep, but not inside another
// package.
std::vector<std::filesystem::path> places_in_package(const std::string& name,
                                                     const std::filesystem::path& rest,
                                                     const std::filesystem::path& home,
                                                     const std::vector<std::filesystem::path>& folders);

}  // namespace padder
