// SPDX-License-Identifier: GPL-3.0-or-later
// One mesh or robot: what its run reads and writes, and the padding itself.
#pragma once
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "padding/pad.h"
#include "tools/pad/arguments.h"
#include "tools/pad/target.h"
#include "tools/run_files.h"

namespace padder {

bool is_robot(const std::string& file);   // by its ending, or MJCF with other geoms than spheres
bool is_folder(const std::string& path);  // it is one, or ends with /

// If it is a file of spheres, it is converted: so it must be said to what, and nothing about padding. `given`
// is settings_of() what holds for it. Throws cli::UsageError.
void check_conversion(const PadArguments& a, const std::map<std::string, std::string>& given,
                      const std::string& file);

// Options of robots do not fit where none of the files is one. Throws cli::UsageError.
void check_robot_options(const CLI::App& app, const std::vector<std::string>& files);

// The format of what is made of `mesh`: that of --format or, where -o names a file, that of its ending.
// Throws cli::UsageError when there is none.
const Format* format_of(const PadArguments& a, const std::string& mesh);

// NAME.spheres.json, or with the ending of the format.
std::string output_name(const std::string& mesh, const Format* format);

// The .srdf of pairs that is written beside the URDF of a robot or of spheres; empty: `output` is no such
// URDF.
std::filesystem::path pairs_file(const std::string& input, const OutputFile& output);

// The robot in `file`, if it is one. It is read when it is first asked for, and once: get() returns it, or
// throws the Error of its reader, each time.
std::shared_future<RobotTree> robot_of(const std::string& file, const PadArguments& a);

// The files that `file` refers to and that its shape depends on: buffers of a .gltf, meshes of a robot.
// Throws Error where the file cannot be read.
std::vector<std::filesystem::path> further_inputs(const std::string& file,
                                                  const std::shared_future<RobotTree>& robot);

// Notes in `files` that the run reads `file` and what it refers to. A file that cannot be read is not
// complained about here.
void note_inputs(const std::string& file, const std::shared_future<RobotTree>& robot, cli::RunFiles& files);

// Notes what the target of `file` writes. Throws cli::UsageError, with the remedy, where the run reads a file
// of that name or writes it already.
void note_outputs(const PadArguments& a, const std::string& file, const PadTarget& target,
                  cli::RunFiles& files);

// Pads or converts `file`, writes its files, and returns the report. `done` is called before anything is
// printed, and nothing is printed with a.json or a.quiet. Makes the folder of the output where it is absent.
// Throws Error.
nlohmann::ordered_json pad_one(const PadArguments& a, const std::string& file, const PadTarget& target,
                               const PadProgress& progress, const std::function<void()>& done);

}  // namespace padder
