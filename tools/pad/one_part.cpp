// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/one_part.h"

#include "padding/meshing/write_mesh.h"
#include "padding/view/page.h"
#include "tools/cli.h"
#include "tools/pad/report.h"
#include "tools/pad/robot.h"

namespace padder {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

bool is_robot(const std::string& file) { return fs::path(file).extension() == ".urdf"; }

bool is_folder(const std::string& path) {
  return !path.empty() && (fs::is_directory(path) || path.back() == '/');
}

const Format* format_of(const PadArguments& a, const std::string& mesh) {
  const bool named = !a.output.empty() && (!is_folder(a.output) || a.format == "mercury");
  if (is_robot(mesh) && a.output.ends_with(".json"))
    throw cli::UsageError(
        "a robot has several links and a .spheres.json is one body: -o a folder gets one for each link");
  try {
    if (!a.format.empty()) return &find_format({}, a.format);
    if (named && !a.output.ends_with(".json")) return &find_format(a.output);
    return is_robot(mesh) ? &find_format({}, "urdf") : nullptr;
  } catch (const Error& e) {
    throw cli::UsageError(e.what());
  }
}

std::string output_name(const std::string& mesh, const Format* format) {
  return fs::path(mesh).stem().string() +
         (!format ? ".spheres.json" : std::string(is_robot(mesh) ? ".spheres" : "") + format->ending);
}

namespace {

void make_folder_of(const fs::path& file) {
  std::error_code code;  // if this fails, writing the file fails and names the reason
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), code);
}

Json pad_urdf(const PadArguments& a, const std::string& file, const PadTarget& target,
              const PadProgress& progress, const std::function<void()>& done) {
  if (a.scale != 1 || (!a.unit.empty() && a.unit != "m"))
    throw Error(file + ": a URDF is in metres: leave out --scale and --unit");
  const RobotJob job{file, target.path, target.format, a.options, {a.density}, target.in_folder};
  Json report = run_robot(job, [&](const std::string& link, std::size_t at, std::size_t of) {
    if (progress) progress(link.c_str(), int(at), int(of));
  });
  done();
  if (!a.json && !a.quiet) print_robot(report);
  return report;
}

}  // namespace

Json pad_one(const PadArguments& a, const std::string& file, const PadTarget& target,
             const PadProgress& progress, const std::function<void()>& done) {
  make_folder_of(target.path);
  if (is_robot(file)) return pad_urdf(a, file, target, progress, done);
  const Padded padded = pad_file(file, {a.scale, a.unit}, a.options, progress);
  std::vector<std::string> warnings = padded.report.warnings;
  if (target.format)
    for (auto& sentence : write_model(model_of(padded.cluster), target.path, *target.format, {a.density}))
      warnings.push_back(std::move(sentence));
  else
    write_cluster(padded.cluster, target.path);
  if (!target.mesh.empty()) {
    make_folder_of(target.mesh);
    write_mesh(padded.mesh, target.mesh);
  }
  if (!a.preview.empty()) {
    View view = view_of(padded.cluster, mesh_of(padded.cluster, target.path, file));
    view.marks = padded.marks;
    write_preview(view, a.preview);
  }
  done();
  const PadFiles files{file, target.path, target.mesh};
  if (!a.json && !a.quiet) print_report(files, padded);
  return report_json(files, a.options, padded, warnings);
}

}  // namespace padder
