// SPDX-License-Identifier: MIT
// SHA-256 by OpenSSL. Not installed.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace padder {

// 64 hexadecimal digits.
std::string sha256(std::string_view bytes);

// Of a regular file, read piece by piece, so that its size does not matter. Throws Error when it cannot be
// read, or is a folder, a device or a pipe.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace padder
