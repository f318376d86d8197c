// SPDX-License-Identifier: GPL-3.0-or-later
// pad: triangle meshes to clusters of spheres. Arguments and printing only; the work is padder::pad.
#include "padding/pad.h"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/meshing/write_mesh.h"
#include "padding/view/page.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/pad/arguments.h"
#include "tools/pad/manifest/part_list.h"
#include "tools/pad/manifest/run_parts.h"
#include "tools/pad/manifest/workers.h"
#include "tools/pad/one_part.h"
#include "tools/progress_bar.h"
#include "tools/streams.h"

namespace padder {
namespace {

using Json = nlohmann::ordered_json;
using cli::UsageError;
namespace fs = std::filesystem;

// For --write-mesh.
fs::path surface_file(const PadArguments& a, const std::string& mesh) {
  if (a.write_mesh.empty()) return {};
  if (is_robot(mesh))
    throw UsageError("--write-mesh writes the surface of a mesh, not of a robot: give it one of its meshes");
  if (is_folder(a.write_mesh))
    return fs::path(a.write_mesh) / (fs::path(mesh).stem().string() + ".surface.obj");
  if (a.meshes.size() > 1)
    throw UsageError(
        "--write-mesh must name a folder when there are several meshes: make it, or end it with /");
  if (!can_write_mesh(a.write_mesh))
    throw UsageError("--write-mesh must name a file that ends in .obj, .off, .ply or .stl, or a folder");
  return a.write_mesh;
}

// What --preview names, or NAME.png in its folder.
fs::path preview_file(const PadArguments& a, const std::string& mesh) {
  if (!is_folder(a.preview)) return a.preview;
  return fs::path(a.preview) / (fs::path(mesh).stem().string() + ".png");
}

// Adds the files of -o after the first: of one input, and each tells its format by its ending.
void add_further_outputs(const PadArguments& a, std::vector<OutputFile>& out) {
  for (std::size_t k = 1; k < a.outputs.size(); k++) {
    const std::string& path = a.outputs[k];
    if (a.meshes.size() > 1 || is_folder(a.outputs[0]) || is_folder(path))
      throw UsageError("several -o are files, and for one input: end each with the ending of its format");
    const bool own = ending_of(path) == ".json";
    if (own && is_robot(a.meshes[0]))
      throw UsageError("a robot has several links and a .spheres.json is one body: -o a folder for these");
    try {
      out.push_back({path, own ? nullptr : &find_format(path)});
    } catch (const Error& e) {
      throw UsageError(e.what());
    }
  }
}

// Where the results go: no two to one file, and none over what the run reads.
std::vector<PadTarget> targets(const PadArguments& a, const std::map<std::string, std::string>& given) {
  const std::string output = a.output();
  const bool folder = is_folder(output) && a.format != "mercury";
  if (a.meshes.size() > 1 && !output.empty() && !folder)
    throw UsageError("-o must name a folder when there are several meshes: make it, or end it with /");
  std::vector<PadTarget> out;
  cli::RunFiles files;
  for (const auto& mesh : a.meshes) {
    if (mesh == "%")
      throw UsageError("a % stands alone: write a share of the diagonal as one word, as in --tolerance 5%");
    PadTarget t;
    t.in_folder = folder;
    check_conversion(a, given, mesh);
    t.mesh = surface_file(a, mesh);
    t.preview = preview_file(a, mesh);
    t.robot = robot_of(mesh, a);
    const Format* format = format_of(a, mesh);
    fs::path path = output_name(mesh, format);
    if (folder)
      path = fs::path(output) / path;
    else if (!output.empty())
      path = output;
    t.outputs = {{path, format}};
    add_further_outputs(a, t.outputs);
    note_inputs(mesh, t.robot, files);
    out.push_back(t);
  }
  for (std::size_t k = 0; k < out.size(); k++) note_outputs(a, a.meshes[k], out[k], files);
  for (const PadTarget& t : out) {
    for (const OutputFile& file : t.outputs)
      if (!file.format || *file.format->ending)
        cli::check_writable(file.path, true);  // the other is a folder
    for (const fs::path& file : {t.mesh, t.preview})
      if (!file.empty()) cli::check_writable(file, true);
  }
  if (!a.preview.empty() && !is_folder(a.preview) && (a.meshes.size() > 1 || !is_preview(a.preview)))
    throw UsageError("--preview " + cli::in_quotes(a.preview) +
                     (a.meshes.size() > 1
                          ? " is no folder, which several meshes need: make it, or end it with /"
                          : " ends neither in .html nor in .png: name one of these, or a folder"));
  if (ending_of(a.preview) == ".html") page_script();  // before the work, not after it
  return out;
}

// One mesh after the other, in this process.
int pad_meshes(const PadArguments& a, const std::vector<PadTarget>& goals, const cli::StreamFiles& files) {
  Json all = Json::array();
  bool failed = false;
  ProgressBar bar("pad", !a.quiet);
  bar.tell_between_calls();
  const auto fail = [&](const std::string& mesh, const std::string& what) {
    bar.clear();
    const std::string sentence = files.spoken(what);
    std::fprintf(stderr, "pad: %s\n", excerpt(sentence, 4000).c_str());
    all.push_back({{"input", files.spoken(mesh)}, {"error", sentence}});
    failed = true;
  };
  for (std::size_t k = 0; k < a.meshes.size(); k++) {
    const std::string& mesh = a.meshes[k];
    const auto show = [&](const char* step, int done, int of) {
      bar.show((double(k) + double(done) / of) / double(a.meshes.size()), mesh + ": " + step);
    };
    try {
      Json report = pad_one(a, mesh, goals[k], show, [&] { bar.clear(); });
      if (!a.quiet)
        for (const auto& sentence : report["warnings"])
          std::fprintf(stderr, "pad: warning: %s\n", excerpt(files.spoken(sentence), 4000).c_str());
      all.push_back(std::move(report));
    } catch (const Error& e) {
      fail(mesh, e.what());
    } catch (const std::bad_alloc&) {
      fail(mesh, mesh + ": not enough memory: use a " +
                     (a.options.by_tolerance() ? "larger --tolerance" : "longer --edge-length") +
                     (a.memory.empty() ? "" : ", or give it more with --memory"));
    }
  }
  if (a.json) cli::print_json(a.meshes.size() == 1 ? all[0] : all);
  return failed ? 1 : 0;
}

// Puts files in the place of "-".
void use_streams(PadArguments& a, cli::StreamFiles& files) {
  const auto given = std::count_if(a.meshes.begin(), a.meshes.end(), cli::is_stream);
  const auto taken = std::count_if(a.outputs.begin(), a.outputs.end(), cli::is_stream);
  if (given == 0 && !a.input_format.empty())
    throw UsageError("--input-format is for MESH -: the ending of a file tells its format");
  if (given > 1 || taken > 1)
    throw UsageError("- is given twice: stdin holds one mesh, and stdout takes one file");
  if (taken > 0 && (a.json || a.meshes.size() > 1))
    throw UsageError("-o - writes the file of one mesh to stdout: leave out --json and further meshes");
  if (taken > 0 && lists_parts(a))
    throw UsageError(
        "-o - writes the file of one mesh to stdout, and a folder, a pattern or a manifest is for many: give "
        "-o FOLDER");
  for (std::string& output : a.outputs) {
    if (!cli::is_stream(output)) continue;
    const Format* format = a.format.empty() ? nullptr : &find_format({}, a.format);
    output = files.output("stdout" + std::string(format ? format->ending : ".spheres.json"));
    a.quiet = true;
  }
  for (std::string& mesh : a.meshes) {
    if (!cli::is_stream(mesh)) continue;
    if (a.input_format.empty())
      throw UsageError("MESH - has no ending that tells the format: name it, as --input-format stl");
    mesh = files.spool("stdin." + a.input_format);
  }
}

// What no mesh could satisfy is wrong usage. A robot's number of spheres excludes what that of a part does.
void check_options(const PadArguments& a) {
  PadOptions options = a.options;
  if (a.robot.max_spheres > 0) options.max_spheres = a.robot.max_spheres;
  try {
    check(options);
  } catch (const Error& e) {
    throw UsageError(e.what());
  }
}

// Ends the program with a sentence if it is still at work after --seconds. A thread and no signal: it may
// print.
void end_after(const PadArguments& a) {
  std::thread([&a] {
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(a.seconds, 1e9)));
    cli::remove_all_unfinished();
    const std::string sentence =
        "no result after " + short_number(a.seconds, 6) + " s: give it more with --seconds";
    std::fprintf(stderr, "pad: %s\n", sentence.c_str());
    if (a.json) cli::print_failure(a.meshes[0], sentence);
    std::fflush(stdout);
    ::_exit(1);
  }).detach();
}

int run(PadArguments& a, const CLI::App& app, cli::StreamFiles& files) {
  use_streams(a, files);
  if (a.colour != PadArguments().colour && a.preview.empty())
    throw UsageError("--colour is of --preview, and there is none: leave it out, or name a preview");
  if (lists_parts(a)) return run_parts(a, settings_of(app));
  if (a.meshes.empty())
    throw UsageError("name a mesh, a folder of meshes, or --manifest FILE (see pad --help)");
  check_options(a);
  cli::refuse_options(app, {"--shard", "--workers", "--page"},
                      " is for a folder of meshes or a --manifest, and there is neither");
  check_robot_options(app, a.meshes);
  for (const fs::path& folder : a.robot.reading.package_folders)
    if (std::error_code code; !fs::is_directory(folder, code))
      throw UsageError("--package-path: there is no folder " + cli::in_quotes(folder.string()));
  // OMP_NUM_THREADS may ask for more than OpenMP's own stack holds.
  omp_set_num_threads(a.threads > 0 ? a.threads : std::min(omp_get_max_threads(), cli::kMostThreads));
  limit_memory(a.memory.empty() ? machine_memory() : cli::bytes_of(a.memory).value());
  try {  // what the program holds already may be more
    ::operator delete(::operator new(std::size_t(4) << 20));
  } catch (const std::bad_alloc&) {
    throw Error("--memory " + a.memory + " is less than the program itself needs: give it more");
  }
  if (app.count("--seconds") > 0 && a.seconds > 0) end_after(a);
  const int code = pad_meshes(a, targets(a, settings_of(app)), files);
  if (code == 0) files.deliver();
  return code;
}

// Lets threads that wait for the others' work sleep at once, unless OMP_WAIT_POLICY or GOMP_SPINCOUNT says
// what they should do. By default those of libgomp first look for more work, some milliseconds each time,
// which other programs cannot use; OMP_WAIT_POLICY=active in the environment shows what that costs. libgomp
// reads the variable when it is loaded: so this starts the program again, with the variable, and returns
// where it is set or the program cannot be started.
void let_waiting_threads_sleep(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") || std::getenv("GOMP_SPINCOUNT")) return;
  if (setenv("OMP_WAIT_POLICY", "passive", 1) == 0) execv("/proc/self/exe", argv);
}

}  // namespace
}  // namespace padder

int main(int argc, char** argv) {
  padder::let_waiting_threads_sleep(argv);
  CLI::App app(
      "Examples:\n"
      "  pad track_shoe.obj --depth 0.2               writes track_shoe.spheres.json\n"
      "  pad track_shoe.obj --tolerance 0.5%          the fewest spheres within 0.5 % of the diagonal, "
      "proved\n"
      "  pad link*.stl -o clusters/ --unit m          a batch into a folder\n"
      "  pad --manifest parts.txt -o out/             every part it lists; again: what is missing or "
      "changed\n"
      "  pad part.obj -o part.vtp                     for ParaView; docs/formats.md lists the others\n"
      "  pad robot.urdf --tolerance 1%                every link; writes robot.spheres.urdf\n"
      "  pad part.spheres.json -o part.xml -o part.glb  in other formats, without padding again\n"
      "  pad - --input-format stl -o - < part.stl     from stdin to stdout\n"
      "  pad part.obj --edge-length 1% --json         finer, with the report as JSON\n\n"
      "Covers a triangle mesh with spheres: repairs it, remeshes it isotropically, fits one sphere a "
      "triangle at the\n"
      "depth ratio, refits what would stand out, measures the result and writes it as a cluster. A LENGTH is "
      "in the\n"
      "mesh's own unit, after --scale and --unit, or a share of the diagonal of its bounding box when it "
      "ends in %.\n",
      "pad");
  padder::PadArguments arguments;
  padder::cli::StreamFiles files;
  padder::declare_all(app, arguments);
  return padder::cli::run(
      app, argc, argv, [&] { return padder::run(arguments, app, files); },
      [&](const std::string& error) {
        if (arguments.json)
          padder::cli::print_failure(arguments.meshes.size() == 1 ? files.spoken(arguments.meshes[0]) : "",
                                     error);
      });
}
