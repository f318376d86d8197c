// Whole files in and out. Writing is all or nothing: beside the target first, then renamed over it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace padder {

// The most that read_file takes into memory: 8 GiB.
constexpr std::uintmax_t kMostBytes = std::uintmax_t(8) << 30;
// The most of a text that becomes many times as large in memory (JSON, YAML, XML): 1 GiB.
constexpr std::uintmax_t kMostText = std::uintmax_t(1) << 30;

// The bytes of a regular file. Throws Error when it cannot be read, is larger than `most`, or is a folder, a
// device, a pipe, a socket or one of the system's files without a size: these may have no end, or never
// answer.
std::string read_file(const std::filesystem::path& path, std::uintmax_t most = kMostBytes);

// Writes `bytes` to a temporary file in the same folder and renames it to `path`: a reader sees the old file
// or the new one, never half of it. Throws Error (nothing is left behind) when the folder is absent, full or
// not writable.
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace padder
