// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of a manifest, of folders and of patterns.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tools/pad/arguments.h"

namespace padder {

// What holds for a part: the command line's arguments, with those of its line in their place.
struct PartSettings {
  PadArguments arguments;
  std::map<std::string, std::string> given;  // settings_of: part of the key
};

// One mesh or robot to be padded.
struct Part {
  std::string mesh;                              // as it can be opened from here
  std::string output;                            // below the output folder, with slashes
  std::filesystem::path pairs;                   // pairs_file() of the output
  std::shared_ptr<const PartSettings> settings;  // shared by all parts with the same options
};

// Are the parts listed, rather than named one by one: by a manifest, a folder, or a pattern (* ? [) in
// quotes?
bool lists_parts(const PadArguments& a);

// In the order in which they are listed; those of a folder are sorted.
//
// A line of a manifest is what would be typed behind pad for this part: its mesh, then options. Paths are
// relative to the manifest's folder. A line that names a file as a whole needs no quotes; empty lines and
// those that begin with # are skipped. The output keeps the mesh's folders, unless the line says -o.
//
// Throws cli::UsageError for options that do not exist (with the line), for two parts with one output, and
// for outputs outside the output folder; Error for a manifest or folder that cannot be read or holds no part.
std::vector<Part> list_parts(const PadArguments& a, const std::map<std::string, std::string>& given);

// The I-th of N portions of the parts, counted from 1. A part's portion depends on its output's name and N
// alone, so parts that are added to a manifest move no other.
struct Shard {
  std::uint32_t index = 1, of = 1;
  bool holds(const Part& part) const;
  std::string name() const { return std::to_string(index) + "-of-" + std::to_string(of); }
};

// Of "3/8", and of "" the whole. Throws cli::UsageError.
Shard shard_of(const std::string& text);

}  // namespace padder
