// SPDX-License-Identifier: GPL-3.0-or-later
// Where what is made of one input goes.
#pragma once
#include <algorithm>
#include <filesystem>
#include <future>
#include <string_view>
#include <vector>

#include "padding/export/export.h"
#include "padding/export/new_folders.h"
#include "padding/robots/robot_tree.h"

namespace padder {

// A file to write, and its format; null is our own.
struct OutputFile {
  std::filesystem::path path;
  const Format* format = nullptr;
  bool is(std::string_view name) const { return format && name == format->name; }
};

struct PadTarget {
  std::vector<OutputFile> outputs;      // one at least
  bool in_folder = false;               // -o names a folder, not the file
  std::filesystem::path mesh, preview;  // where --write-mesh and --preview go; empty without these
  std::shared_future<RobotTree> robot;  // robot_of() the input

  // A URDF brings a .srdf of its pairs along, and one that is asked for by name, which has the spheres as
  // well, must not be lost to it: it comes last.
  std::vector<OutputFile> in_writing_order() const {
    std::vector<OutputFile> files = outputs;
    std::stable_partition(files.begin(), files.end(),
                          [](const OutputFile& file) { return !file.is("srdf"); });
    return files;
  }
  void make(NewFolders& folders) const {
    for (const OutputFile& file : outputs) folders.make(file.path.parent_path());
    folders.make(mesh.parent_path()), folders.make(preview.parent_path());
  }
  // Levels of detail are in a .spheres.json alone: a warning where there are some and none is written.
  void tell_levels_left_out(bool levels, std::vector<std::string>& warnings) const {
    const auto keeps = [](const OutputFile& file) { return !file.format; };
    if (levels && std::none_of(outputs.begin(), outputs.end(), keeps))
      warnings.push_back("the levels of detail are left out of " + outputs[0].path.string() +
                         ": a .spheres.json keeps them, name one with -o as well");
  }
};

}  // namespace padder
