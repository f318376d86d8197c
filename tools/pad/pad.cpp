// SPDX-License-Identifier: GPL-3.0-or-later
// pad: triangle meshes to clusters of spheres. Arguments and printing only; the work is padder::pad.
#include "padding/pad.h"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/export/export.h"
#include "padding/import/import.h"
#include "padding/meshing/write_mesh.h"
#include "padding/view/page.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/json_failure.h"
#include "tools/pad/convert.h"
#include "tools/pad/report.h"
#include "tools/pad/robot.h"

namespace padder {

// CLI11 finds this function by its argument's namespace.
bool lexical_cast(const std::string& text, Length& out) {
  const auto length =
      text == "0" ? Length::of(0) : length_of(text);  // where 0 is no length, a check refuses it
  if (length) out = *length;
  return length.has_value();
}

}  // namespace padder

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> meshes;
  std::vector<std::string> outputs;
  std::string unit, format, preview, write_mesh;
  double scale = 1, density = padder::ExportOptions().density;
  padder::PadOptions options;
  padder::RobotOptions robot;
  std::vector<std::string> package_folders, joints;
  int threads = 0;
  bool json = false, quiet = false;

  std::string output() const { return outputs.empty() ? "" : outputs[0]; }
};

using namespace padder::cli;

// "obj stl ply …"
std::string mesh_endings_text() {
  std::string endings;
  for (const auto& e : padder::mesh_endings()) endings += (endings.empty() ? "" : " ") + e.substr(1);
  return endings;
}

std::string format_names_text() {
  std::string names;
  for (const auto& f : padder::formats()) names += std::string(" ") + f.name;
  return names;
}

// What is read and what is written. --help lists options in the order in which they are declared.
void declare_files(CLI::App& app, Arguments& a) {
  app.add_option("MESH", a.meshes,
                 "mesh files (" + mesh_endings_text() +
                     "), robots (urdf xacro), or files of spheres, which are converted")
      ->required();
  app.add_option("-o", a.outputs,
                 "file to write, its ending tells the format (docs/formats.md), or folder for several "
                 "(default: NAME.spheres.json here). Again for each further format")
      ->allow_extra_args(false)
      ->type_name("FILE|DIR");
  app.add_option("--format", a.format,
                 "another program's format, where the ending does not tell:" + format_names_text())
      ->type_name("NAME");
  app.add_option("--density", a.density, "for formats that state a mass (default: 1000, kg/m^3 in metres)")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
}

// How the spheres are chosen: by depth ratio, by tolerance, or by number.
void declare_spheres(CLI::App& app, Arguments& a) {
  app.add_option("--depth", a.options.depth_ratio,
                 "one sphere a triangle: cap height over circumradius, above 0, at most 1 (default: 0.2)")
      ->check(decimal())
      ->check(CLI::Range(1e-6, 1.));
  app.add_option("--edge-length", a.options.edge_length,
                 "of the remeshed triangles: in the mesh's unit, or a share of its diagonal as 2%")
      ->type_name("LENGTH")
      ->check(length());
  app.add_option(
         "--tolerance", a.options.tolerance,
         "the fewest spheres with protrusion and gap proved to be within it; with --depth: thin those")
      ->type_name("LENGTH")
      ->check(length());
  app.add_option("--protrusion", a.options.protrusion,
                 "no sphere stands out of the body by more; 0: none does at all. With --gap or --tolerance")
      ->type_name("LENGTH")
      ->check(length_or_zero());
  app.add_option(
         "--gap", a.options.gap,
         "no surface lies farther outside the spheres; 0: all of the body is inside them. With --protrusion "
         "or --tolerance")
      ->type_name("LENGTH")
      ->check(length_or_zero());
  app.add_option("--max-spheres", a.options.max_spheres, "the smallest error that so many spheres can keep")
      ->check(whole())
      ->check(CLI::PositiveNumber);
  app.add_option("--max-radius", a.options.max_radius, "no larger sphere")
      ->type_name("LENGTH")
      ->check(length());
  app.add_option("--min-radius", a.options.min_radius,
                 "no smaller sphere, even where the tolerance asks for it")
      ->type_name("LENGTH")
      ->check(length());
  const std::map<std::string, padder::Balance> balances{
      {"none", padder::Balance::none}, {"volume", padder::Balance::volume}, {"mean", padder::Balance::mean}};
  app.add_option("--balance", a.options.balance,
                 "within the tolerance: none (fewest, the default), volume (of the union as the mesh's), "
                 "mean (smallest means)")
      ->transform(CLI::CheckedTransformer(balances))
      ->type_name("WHAT");
  app.add_option("--smooth", a.options.smooth, "mean normal error asked for, degrees")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
  app.add_option("--effort", a.options.effort, "0 to 3: search longer for fewer spheres")
      ->capture_default_str()
      ->check(whole())
      ->check(CLI::Range(0, 3));
  app.add_flag("--lower-bound", a.options.lower_bound,
               "also prove how few spheres could do: some seconds more");
  app.add_option("--reach", a.options.min_grain_radius,
                 "radius of the smallest grain: what it cannot touch is not padded")
      ->type_name("LENGTH")
      ->check(length());
  app.add_option("--lod", a.options.lod, "a ladder of tolerances in one asset, as 2%,1%,0.5%")
      ->delimiter(',')
      ->type_name("LENGTHS")
      ->check(length());
}

// What happens to the surface first, and what the asset says of itself.
void declare_asset(CLI::App& app, Arguments& a) {
  app.add_option("--sharp-angle", a.options.sharp_angle, "keep edges whose faces turn by more degrees")
      ->capture_default_str()
      ->check(decimal())
      ->check(CLI::Range(1., 180.));
  const std::map<std::string, padder::RepairMode> modes{
      {"auto", padder::RepairMode::automatic}, {"union", padder::RepairMode::united},
      {"fill", padder::RepairMode::fill},      {"sheet", padder::RepairMode::sheet},
      {"never", padder::RepairMode::never},    {"wrap", padder::RepairMode::wrap}};
  app.add_option("--repair", a.options.repair, "auto (the default), union, fill, sheet, never or wrap")
      ->transform(CLI::CheckedTransformer(modes))
      ->type_name("MODE");
  app.add_option("--thickness", a.options.thickness, "of sheets, half on either side (default 0)")
      ->check(length());
  app.add_option("--family", a.options.family, "of the asset: no contact inside a family; 0 is none")
      ->check(whole());
  app.add_option("--mask", a.options.mask, "bit k: no contact with family k + 1")->check(bits());
  app.add_flag("--force", a.options.force,
               "take lengths that can hardly be meant, as a tolerance beyond half the thinnest extent");
}

// Of robots alone.
void declare_robot(CLI::App& app, Arguments& a) {
  app.add_option(
         "--robot-spheres", a.robot.max_spheres,
         "of a robot: the smallest tolerance, the same for all links, that so many spheres in all can keep")
      ->check(whole())
      ->check(CLI::PositiveNumber);
  app.add_flag("--visual", a.robot.reading.visual,
               "of a robot: pad the visual geometry, not the collision geometry");
  app.add_option("--package-path", a.package_folders,
                 "of a robot: a folder where package:// is looked for first; may be given again")
      ->allow_extra_args(false)
      ->type_name("DIR");
  app.add_option("--self-collision", a.robot.poses,
                 "of a robot: random poses that are tried for links that never or always touch; 0: none")
      ->capture_default_str()
      ->check(whole())
      ->check(CLI::Range(0, 100000000));
  app.add_option("--joint", a.joints, "of a robot in --preview: where a joint stands, in radians or metres")
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
}

void declare_output(CLI::App& app, Arguments& a) {
  app.add_option("--write-mesh", a.write_mesh,
                 "write the surface that the spheres were made on, whose faces spheres.triangle counts: .obj "
                 ".off .ply .stl, or a folder for NAME.surface.obj")
      ->type_name("FILE|DIR");
  app.add_option("--preview", a.preview, "show mesh and spheres: a page (.html) or a picture (.png)")
      ->type_name("FILE");
  app.add_option("--scale", a.scale, "factor on every coordinate")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
  app.add_option("--unit", a.unit, "m, cm, mm or in: the unit of the asset")
      ->type_name("UNIT")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}));
  app.add_option("--threads", a.threads, "threads to use, 1 to 1024 (default: all)")
      ->check(whole())
      ->check(CLI::Range(1, padder::cli::kMostThreads));
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.set_version_flag("--version", "pad (padder) " PADDER_VERSION);
}

bool is_robot(const std::string& file) {
  const std::string ending = fs::path(file).extension().string();
  return ending == ".urdf" || ending == ".xacro";
}

// Where a result goes, and in which format; null is our own. No two meshes may write the same file.
struct Target {
  fs::path path;
  const padder::Format* format = nullptr;
  std::vector<padder::OutputFile> more;  // of further -o
  bool in_folder = false;                // -o names a folder, not the file
  fs::path mesh;                         // where --write-mesh puts the surface; empty without it

  std::vector<padder::OutputFile> outputs() const {
    std::vector<padder::OutputFile> all{{path, format}};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

bool is_folder(const std::string& path) {
  return !path.empty() && (fs::is_directory(path) || path.back() == '/');
}

// For --write-mesh.
fs::path surface_file(const Arguments& a, const std::string& mesh) {
  if (a.write_mesh.empty()) return {};
  if (is_robot(mesh))
    throw UsageError("--write-mesh writes the surface of a mesh, not of a robot: give it one of its meshes");
  if (is_folder(a.write_mesh))
    return fs::path(a.write_mesh) / (fs::path(mesh).stem().string() + ".surface.obj");
  if (a.meshes.size() > 1)
    throw UsageError(
        "--write-mesh must name a folder when there are several meshes: make it, or end it with /");
  if (!padder::can_write_mesh(a.write_mesh))
    throw UsageError("--write-mesh must name a file that ends in .obj, .off, .ply or .stl, or a folder");
  std::error_code code;
  if (fs::equivalent(a.write_mesh, mesh, code))
    throw UsageError("--write-mesh would write over " + mesh + ": name another file");
  return a.write_mesh;
}

// The files of -o after the first: of one input, and each tells its format by its ending.
std::vector<padder::OutputFile> further_outputs(const Arguments& a) {
  std::vector<padder::OutputFile> out;
  for (std::size_t k = 1; k < a.outputs.size(); k++) {
    const std::string& path = a.outputs[k];
    if (a.meshes.size() > 1 || is_folder(a.outputs[0]) || is_folder(path))
      throw UsageError("several -o are files, and for one input: end each with the ending of its format");
    if (std::count(a.outputs.begin(), a.outputs.end(), path) > 1)
      throw UsageError("-o " + path + " is given twice: give it once");
    const bool own = path.ends_with(".json");
    if (own && is_robot(a.meshes[0]))
      throw UsageError("a robot has several links and a .spheres.json is one body: -o a folder for these");
    try {
      out.push_back({path, own ? nullptr : &padder::find_format(path)});
    } catch (const padder::Error& e) {
      throw UsageError(e.what());
    }
    if (std::error_code code; fs::equivalent(path, a.meshes[0], code))
      throw UsageError(path + " is the input itself: name another file with -o");
  }
  return out;
}

// A file of spheres is converted, so it must be said to what, and nothing about padding.
void check_conversion(const Arguments& a, const std::string& file) {
  if (a.outputs.empty() && a.format.empty())
    throw UsageError(file + " holds spheres already: name with -o what to convert it to");
  if (a.options.by_tolerance() || a.options.depth_ratio || !a.preview.empty() || !a.write_mesh.empty())
    throw UsageError(file +
                     " holds spheres already, which are converted and not padded again: leave out the "
                     "tolerance, the depth ratio, the count, --preview and --write-mesh");
}

std::vector<Target> targets(const Arguments& a) {
  const std::string output = a.output();
  const bool folder = is_folder(output) && a.format != "mercury";
  if (a.meshes.size() > 1 && !output.empty() && !folder)
    throw UsageError("-o must name a folder when there are several meshes: make it, or end it with /");
  std::vector<Target> out;
  std::map<fs::path, std::string> owner;
  for (const auto& mesh : a.meshes) {
    if (mesh == "%")
      throw UsageError("a % stands alone: write a share of the diagonal as one word, as in --tolerance 5%");
    Target t;
    t.in_folder = folder;
    if (padder::is_sphere_file(mesh)) check_conversion(a, mesh);
    t.mesh = surface_file(a, mesh);
    t.more = further_outputs(a);
    try {
      if (!a.format.empty())
        t.format = &padder::find_format({}, a.format);
      else if (!output.empty() && !folder && !output.ends_with(".json"))
        t.format = &padder::find_format(output);
      else if (is_robot(mesh))
        t.format = &padder::find_format({}, "urdf");
    } catch (const padder::Error& e) {
      throw UsageError(e.what());
    }
    if (is_robot(mesh) && output.ends_with(".json"))
      throw UsageError(
          "a robot has several links and a .spheres.json is one body: -o a folder gets one for each link");
    t.path = fs::path(mesh).stem().string() +
             (!t.format ? ".spheres.json" : std::string(is_robot(mesh) ? ".spheres" : "") + t.format->ending);
    if (folder)
      t.path = fs::path(output) / t.path;
    else if (!output.empty())
      t.path = output;
    if (std::error_code code; fs::equivalent(t.path, mesh, code))
      throw UsageError(t.path.string() + " is the input itself: name another file with -o");
    const auto [it, fresh] = owner.emplace(t.path, mesh);
    if (!fresh)
      throw UsageError(mesh + " and " + it->second + " would both write " + t.path.string() +
                       ": pad them one by one with -o");
    out.push_back(t);
  }
  if (!a.preview.empty() && (a.meshes.size() > 1 || !padder::is_preview(a.preview)))
    throw UsageError("--preview shows one mesh or robot in one file that ends in .html or .png");
  if (a.preview.ends_with(".html")) padder::page_script();  // before the work, not after it
  return out;
}

// One line on a terminal. Prints nothing when stderr is not a terminal.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted) : on_(wanted && isatty(STDERR_FILENO)) {}
  ~ProgressBar() { clear(); }

  void show(const std::string& mesh, std::size_t index, std::size_t of, const char* step, int done,
            int steps) {
    if (!on_) return;
    const int width = 30, filled = int(width * (double(index) + double(done) / steps) / double(of));
    std::fprintf(stderr, "\r[%s%s] %s: %s\033[K", std::string(filled, '=').c_str(),
                 std::string(width - filled, ' ').c_str(), mesh.c_str(), step);
    std::fflush(stderr);
  }
  void clear() {
    if (on_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool on_;
};

void make_folder_of(const fs::path& file) {
  std::error_code code;  // if this fails, writing the file fails and names the reason
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), code);
}

void warn(const Arguments& a, const std::string& sentence) {
  if (!a.quiet) std::fprintf(stderr, "pad: warning: %s\n", sentence.c_str());
}

Json pad_urdf(const Arguments& a, const std::string& file, const Target& goal,
              const padder::RobotProgress& show) {
  if (a.scale != 1 || (!a.unit.empty() && a.unit != "m"))
    throw padder::Error(file + ": a URDF is in metres: leave out --scale and --unit");
  padder::RobotJob job{file, goal.outputs(), a.options, a.robot, {a.density}, goal.in_folder, a.preview, {}};
  job.whole.reading.package_folders.assign(a.package_folders.begin(), a.package_folders.end());
  for (const std::string& joint : a.joints) {
    const std::size_t at = joint.rfind('=');
    double value = 0;
    const char* end = joint.data() + joint.size();
    const auto read = std::from_chars(joint.data() + std::min(at + 1, joint.size()), end, value);
    if (at == std::string::npos || read.ec != std::errc() || read.ptr != end || !std::isfinite(value))
      throw UsageError("--joint takes NAME=VALUE, as elbow=1.57, not \"" + joint + '"');
    job.joints[joint.substr(0, at)] = value;
  }
  return padder::run_robot(job, show);
}

Json convert(const Arguments& a, const std::string& file, const Target& goal) {
  return padder::run_convert(
      {file, goal.outputs(), a.scale, a.unit, a.options.family, a.options.mask, {a.density}});
}

// Pads one mesh, writes its files, and returns the report. `done` is called before anything is printed.
Json pad_mesh(const Arguments& a, const std::string& file, const Target& goal,
              const padder::PadProgress& show, const std::function<void()>& done) {
  const padder::Padded padded = padder::pad_file(file, {a.scale, a.unit}, a.options, show);
  std::vector<std::string> warnings = padded.report.warnings;
  for (const padder::OutputFile& out : goal.outputs()) {
    make_folder_of(out.path);
    if (!out.format) {
      padder::write_cluster(padded.cluster, out.path);
      continue;
    }
    for (auto& sentence :
         padder::write_model(padder::model_of(padded.cluster), out.path, *out.format, {a.density}))
      warnings.push_back(std::move(sentence));
  }
  if (!goal.mesh.empty()) {
    make_folder_of(goal.mesh);
    padder::write_mesh(padded.mesh, goal.mesh);
  }
  if (!a.preview.empty()) {
    padder::View view = padder::view_of(padded.cluster, padder::mesh_of(padded.cluster, goal.path, file));
    view.marks = padded.marks;
    padder::write_preview(view, a.preview);
  }
  done();
  const padder::PadFiles files{file, goal.path, goal.mesh};
  if (!a.json && !a.quiet) padder::print_report(files, padded);
  return padder::report_json(files, a.options, padded, warnings);
}

int run(Arguments& a) {
  if (a.threads > 0) omp_set_num_threads(a.threads);
  const std::vector<Target> goals = targets(a);
  Json all = Json::array();
  bool failed = false;
  ProgressBar bar(!a.quiet);
  const auto fail = [&](const std::string& mesh, const std::string& what) {
    bar.clear();
    std::fprintf(stderr, "pad: %s\n", what.c_str());
    all.push_back({{"input", mesh}, {"error", what}});
    failed = true;
  };
  for (std::size_t k = 0; k < a.meshes.size(); k++) {
    const std::string& mesh = a.meshes[k];
    try {
      make_folder_of(goals[k].path);
      const bool robot = is_robot(mesh);
      const bool spheres = padder::is_sphere_file(mesh);
      const Json report =
          spheres ? convert(a, mesh, goals[k])
          : robot ? pad_urdf(a, mesh, goals[k],
                             [&](const std::string& link, std::size_t done, std::size_t of) {
                               bar.show(mesh + ", " + link, k, a.meshes.size(), "", int(done), int(of));
                             })
                  : pad_mesh(
                        a, mesh, goals[k],
                        [&](const char* step, int done, int of) {
                          bar.show(mesh, k, a.meshes.size(), step, done, of);
                        },
                        [&] { bar.clear(); });
      bar.clear();
      if (robot && !a.json && !a.quiet) padder::print_robot(report);
      if (spheres && !a.json && !a.quiet) padder::print_convert(report);
      for (const auto& sentence : report["warnings"]) warn(a, sentence.get<std::string>());
      all.push_back(report);
    } catch (const padder::Error& e) {
      fail(mesh, e.what());
    } catch (const std::bad_alloc&) {
      fail(mesh, mesh + ": not enough memory: use a longer --edge-length");
    }
  }
  if (a.json) std::cout << (a.meshes.size() == 1 ? all[0] : all).dump(2) << std::endl;
  return failed ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Examples:\n"
      "  pad track_shoe.obj --depth 0.2               writes track_shoe.spheres.json\n"
      "  pad track_shoe.obj --tolerance 0.5%          the fewest spheres within 0.5 % of the diagonal, "
      "proved\n"
      "  pad link*.stl -o clusters/ --unit m          a batch into a folder\n"
      "  pad part.obj -o part.vtp                     for ParaView; docs/formats.md lists the others\n"
      "  pad robot.urdf --tolerance 1%                every link; writes robot.spheres.urdf\n"
      "  pad part.spheres.json -o part.xml -o part.glb  in other formats, without padding again\n"
      "  pad part.obj --edge-length 1% --json         finer, with the report as JSON\n\n"
      "Covers a triangle mesh with spheres: repairs it, remeshes it isotropically, fits one sphere a "
      "triangle at the\n"
      "depth ratio, refits what would stand out, measures the result and writes it as a cluster. A LENGTH is "
      "in the\n"
      "mesh's own unit, or a share of the diagonal of its bounding box when it ends in %.\n",
      "pad");
  Arguments arguments;
  declare_files(app, arguments);
  declare_spheres(app, arguments);
  declare_asset(app, arguments);
  declare_robot(app, arguments);
  declare_output(app, arguments);
  return padder::cli::run(
      app, argc, argv, [&] { return run(arguments); },
      [&](const std::string& error) {
        if (arguments.json)
          padder::cli::print_failure(arguments.meshes.size() == 1 ? arguments.meshes[0] : "", error);
      });
}
