// Whole files in and out. Writing is all or nothing: beside the target first, then renamed over it.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace padder {

// The bytes of the file. Throws Error when it cannot be read.
std::string read_file(const std::filesystem::path& path);

// Writes `bytes` to a temporary file in the same folder and renames it to `path`: a reader sees the old file
// or the new one, never half of it. Throws Error (nothing is left behind) when the folder is absent, full or
// not writable.
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace padder
