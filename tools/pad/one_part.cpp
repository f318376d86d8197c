// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/one_part.h"

#include <algorithm>
#include <set>

#include "padding/import/import.h"
#include "padding/input/read_internal.h"
#include "padding/meshing/write_mesh.h"
#include "padding/robots/robot_file.h"
#include "padding/view/page.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/pad/convert.h"
#include "tools/pad/report.h"
#include "tools/pad/robot.h"
#include "tools/streams.h"

namespace padder {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

bool is_robot(const std::string& file) {
  static std::map<std::string, bool> known;  // to tell, an .xml must be parsed
  const auto [at, fresh] = known.try_emplace(file);
  if (fresh) at->second = is_robot_file(file);
  return at->second;
}

bool is_folder(const std::string& path) {
  return !path.empty() && (fs::is_directory(path) || path.back() == '/');
}

const Format* format_of(const PadArguments& a, const std::string& mesh) {
  const std::string output = a.output();
  const bool named = !output.empty() && (!is_folder(output) || a.format == "mercury");
  if (is_robot(mesh) && ending_of(output) == ".json")
    throw cli::UsageError(
        "a robot has several links and a .spheres.json is one body: -o a folder gets one for each link");
  try {
    if (!a.format.empty()) return &find_format({}, a.format);
    if (named && ending_of(output) != ".json") return &find_format(output);
    return is_robot(mesh) ? &find_format({}, "urdf") : nullptr;
  } catch (const Error& e) {
    if (std::error_code code; a.format.empty() && !fs::exists(mesh, code))  // the first that must be mended
      throw Error("cannot open " + mesh + ": check the name and that it may be read");
    throw cli::UsageError(e.what());
  }
}

std::string output_name(const std::string& mesh, const Format* format) {
  const fs::path path = mesh.ends_with('/') ? fs::path(mesh).parent_path() : fs::path(mesh);
  if (!format && mesh.ends_with(".spheres.json")) return path.filename().string();
  return path.stem().string() +
         (!format ? ".spheres.json" : std::string(is_robot(mesh) ? ".spheres" : "") + format->ending);
}

void check_conversion(const PadArguments& a, const std::map<std::string, std::string>& given,
                      const std::string& file) {
  // A conversion takes these, or the robots beside it do. All others are about padding.
  static const std::set<std::string> fit = {
      "--format", "--density",       "--scale",        "--unit",  "--family",        "--mask",
      "--visual", "--robot-spheres", "--package-path", "--xacro", "--self-collision"};
  if (!is_sphere_file(file) || is_robot(file)) return;
  if (std::error_code code; !fs::exists(file, code)) return;  // its reader says so
  if (a.outputs.empty() && a.format.empty())
    throw cli::UsageError(file + " is a file of spheres, by its ending: name with -o what to convert it to");
  std::vector<std::string> unfit;
  for (const auto& [option, value] : given)
    if (!fit.contains(option)) unfit.push_back(option);
  if (!a.preview.empty()) unfit.push_back("--preview");
  if (!a.write_mesh.empty()) unfit.push_back("--write-mesh");
  if (!unfit.empty())
    throw cli::UsageError(
        file + " is a file of spheres, by its ending, which is converted and not padded again: leave out " +
        cli::listed(unfit));
}

void check_robot_options(const CLI::App& app, const std::vector<std::string>& files) {
  if (std::ranges::any_of(files, is_robot)) {
    cli::refuse_options(app, {"--family", "--mask"},
                        ": the links of a robot get theirs from its joints, leave it out");
    return;
  }
  // Its reader says that no robot is read from it, and what to do.
  if (std::ranges::any_of(files, [](const std::string& file) { return file.ends_with(".sdf"); })) return;
  cli::refuse_options(
      app, {"--robot-spheres", "--visual", "--package-path", "--xacro", "--self-collision", "--joint"},
      " is for a robot, and " + cli::StreamFiles::spoken(files[0]) + " is none");
}

fs::path pairs_file(const std::string& input, const OutputFile& output) {
  if (!output.is("urdf") || !(is_robot(input) || is_sphere_file(input)))
    return {};  // a mesh is one body, without pairs
  return fs::path(output.path).replace_extension(".srdf");
}

std::shared_future<RobotTree> robot_of(const std::string& file, const PadArguments& a) {
  return std::async(std::launch::deferred,
                    [file, reading = a.robot.reading] { return read_robot(file, reading); });
}

std::vector<fs::path> further_inputs(const std::string& file, const std::shared_future<RobotTree>& robot) {
  if (file.ends_with(".gltf")) return reading::files_beside_gltf(file);
  std::vector<fs::path> files;
  if (!is_robot(file)) return files;
  files = robot.get().included;
  for (const RobotLink& link : robot.get().links)
    for (const RobotShape& shape : link.shapes)
      if (shape.type == RobotShape::Type::mesh) files.push_back(shape.file);
  return files;
}

void note_inputs(const std::string& file, const std::shared_future<RobotTree>& robot, cli::RunFiles& files) {
  files.reads(file);
  try {
    for (const fs::path& further : further_inputs(file, robot)) files.reads(further);
  } catch (const Error&) {
  }
}

void note_outputs(const PadArguments& a, const std::string& file, const PadTarget& target,
                  cli::RunFiles& files) {
  const bool several = a.meshes.size() > 1;
  const std::string remedy = several ? "pad them one by one, each with its own -o" : "name another file";
  const auto write = [&](const fs::path& path, const char* option) {
    files.writes(path, several || !*option ? file : option + path.string(), remedy);
  };
  for (const OutputFile& output : target.outputs) write(output.path, a.outputs.empty() ? "" : "-o ");
  for (const OutputFile& output : target.outputs) {
    const fs::path pairs = pairs_file(file, output);
    const bool named = std::ranges::any_of(a.outputs, [&](const fs::path& path) { return path == pairs; });
    if (!pairs.empty() && !named) write(pairs, "");
  }
  if (!target.mesh.empty()) write(target.mesh, "--write-mesh ");
  if (!target.preview.empty()) write(target.preview, "--preview ");
  if (!target.in_folder || !is_robot(file)) return;
  try {
    for (const RobotLink& link : target.robot.get().links)
      if (!link.shapes.empty())
        files.writes(link_file(target.outputs[0].path.parent_path(), link.name),
                     "link " + excerpt(link.name) + " of " + file, remedy);
  } catch (const Error&) {  // its reader says so
  }
}

Json pad_one(const PadArguments& a, const std::string& file, const PadTarget& target,
             const PadProgress& progress, const std::function<void()>& done) {
  const bool robot = is_robot(file), print = !a.json && !a.quiet;
  if (robot || is_sphere_file(file)) {
    Json report = robot ? run_robot(a, file, target, progress) : run_convert(a, file, target);
    done();
    if (print) robot ? print_robot(report) : print_convert(report);
    return report;
  }
  PadOptions options = a.options;
  for (const OutputFile& out : target.outputs)
    if (out.format && out.format->mass_frame) options.volume_for = out.format->program;
  const Padded padded = pad_file(file, {a.scale, a.unit}, options, progress);
  std::vector<std::string> warnings = padded.report.warnings;
  NewFolders folders;
  target.make(folders);
  for (const OutputFile& out : target.outputs) {
    if (!out.format) {
      write_cluster(padded.cluster, out.path);
      continue;
    }
    for (auto& sentence : write_model(model_of(padded.cluster), out.path, *out.format, {a.density}))
      warnings.push_back(std::move(sentence));
  }
  target.tell_levels_left_out(!padded.cluster.lods.empty(), warnings);
  if (!target.mesh.empty()) write_mesh(padded.mesh, target.mesh);
  if (!target.preview.empty()) {
    View view = view_of(padded.cluster, mesh_of(padded.cluster, target.outputs[0].path, file));
    view.marks = padded.marks;
    write_preview(view, target.preview, a.colour);
  }
  done();
  if (print) print_report(a, file, target, padded);
  Json report = report_json(a, file, target, padded, warnings);
  if (a.verbose) print_seconds(report);
  return report;
}

}  // namespace padder
