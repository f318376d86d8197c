// SPDX-License-Identifier: GPL-3.0-or-later
// preview: a cluster or a scene as a page or a picture. Arguments and printing only.
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>

#include "padding/asset/file.h"
#include "padding/view/page.h"
#include "padding/view/picture.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/colour_option.h"
#include "tools/preview/scene_view.h"
#include "tools/run_files.h"
#include "tools/settle/read_scene.h"
#include "tools/streams.h"

namespace {

namespace fs = std::filesystem;

using padder::cli::UsageError;

constexpr double kMostAround = 36000;  // degrees: a hundred turns, of which float still tells the angle

struct Arguments {
  std::string input, output, format, mesh, contacts, size;
  std::uint64_t copies = 0;
  std::size_t rung = 0;
  std::string up = "z";
  std::pair<double, double> from{-60, 30};
  padder::PictureOptions picture;
  bool json = false, quiet = false;
};

void declare(CLI::App& app, Arguments& a) {
  const std::map<std::string, padder::Show> shows{{"mesh", padder::Show::mesh},
                                                  {"spheres", padder::Show::spheres},
                                                  {"wire", padder::Show::wire},
                                                  {"both", padder::Show::both},
                                                  {"side", padder::Show::side}};
  app.add_option("INPUT", a.input, "a cluster (.spheres.json) or a scene (.json); - reads it from stdin")
      ->required()
      ->check(padder::cli::scene_file({".csv"}));
  app.add_option("-o", a.output, "file to write: .html for a page, .png for a picture; - writes to stdout")
      ->required()
      ->type_name("FILE");
  app.add_option("--format", a.format, "of -o -: html or png")->check(CLI::IsMember({"html", "png"}));
  app.add_option("--mesh", a.mesh,
                 "the mesh of the cluster (default: by its name and sha256, beside the cluster or here)")
      ->type_name("MESH");
  app.add_option("--contacts", a.contacts, "contacts of the scene as detect wrote them, .csv or .npz: arrows")
      ->type_name("FILE");
  using padder::cli::add_whole;
  add_whole(app, "--copies", a.copies, "of a cluster: the pile of N bodies that detect --copies N makes", 1,
            0xfffffffe);
  add_whole(app, "--lod", a.rung,
            "which level of detail of a ladder (pad --lod): 0 the finest, 1 the next coarser …; a picture "
            "draws it, a page opens with it")
      ->capture_default_str()
      ->type_name("K");
  app.add_option("--from", a.from, "where the camera stands: degrees around, degrees above")
      ->check(padder::cli::decimal())
      ->type_name("AROUND ABOVE");
  app.add_option("--up", a.up, "the axis that points up: x, y or z")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->type_name("AXIS")
      ->capture_default_str();
  app.add_option("--show", a.picture.show,
                 "picture: mesh, spheres, wire (mesh edges over spheres), both, side (by side, the default)")
      ->transform(CLI::CheckedTransformer(shows))
      ->type_name("WHAT");
  padder::cli::add_colour(
      app, a.picture.colour,
      "by family (the default), radius, protrusion, gap, triangle or body; the errors also on the mesh");
  app.add_option("--size", a.size, "picture: pixels (default: 1600x800)")->type_name("WxH");
  add_whole(app, "--samples", a.picture.samples, "picture: rays a pixel", 1, 4096)->capture_default_str();
  app.add_flag("--dark", a.picture.dark, "picture: on a dark background; a page follows the system");
  app.add_flag("--plain", a.picture.plain, "picture: without legend, scale bar and axes");
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.set_version_flag("--version", "preview (padder) " PADDER_VERSION);
}

// What the options say that CLI11 does not check: before any work is done.
void check(Arguments& a) {
  const std::string ending = padder::ending_of(a.output);
  if (ending != ".html" && ending != ".png")
    throw UsageError("cannot tell what to write to " + a.output + ": end it with .html or .png");
  if (!a.size.empty()) {
    int w = 0, h = 0, end = 0;
    if (std::sscanf(a.size.c_str(), "%5dx%5d%n", &w, &h, &end) != 2 || std::size_t(end) != a.size.size() ||
        w < 16 || h < 16 || w > 16384 || h > 16384)
      throw UsageError("--size is WIDTHxHEIGHT, each 16 to 16384, as 1600x800");
    a.picture.width = w, a.picture.height = h;
  }
  if (!(std::abs(a.from.first) <= kMostAround) || !(std::abs(a.from.second) <= 89))
    throw UsageError("--from takes degrees around from -36000 to 36000, and degrees above from -89 to 89");
  if (a.copies && !a.mesh.empty()) throw UsageError("--mesh shows one body: leave --copies out");
}

// By the name of the format: parsing a document of a million spheres twice would take seconds.
bool is_cluster(std::string_view text) {
  return text.find("\"padder.cluster\"") < text.find("\"padder.scene\"");
}

// `note` becomes what is to be said once the work is done.
padder::View view_of(const Arguments& a, std::string& note) {
  const bool piped = padder::cli::is_stream(a.input);
  const fs::path path = piped ? "stdin.json" : a.input;
  const std::string where = piped ? "the standard input" : a.input;
  const std::string text = piped ? padder::cli::read_stdin() : a.copies ? "" : padder::read_file(path);
  if (!a.copies && is_cluster(text)) {
    const padder::Cluster cluster = padder::cluster_from_json(text, where);
    const padder::Mesh mesh = padder::mesh_of(cluster, path, a.mesh);
    if (mesh.triangles.empty() && !cluster.source.file.empty())
      note = "the mesh of " + where + " was not found: spheres alone are shown (--mesh MESH names it)";
    return padder::view_of(cluster, mesh);
  }
  if (!a.mesh.empty()) throw UsageError("--mesh is for a cluster, and " + where + " is none");
  const bool has_grains = path.extension() == ".json" && text.find("\"settle\"") != std::string::npos;
  const padder::detect::Scene scene =
      has_grains ? padder::settle::scene_at_start(text, where, path.parent_path())
      : piped    ? padder::detect::scene_or_cluster_from_json(text, where, ".", a.copies)
                 : padder::detect::read_scene_or_cluster(path, a.copies);
  return padder::view_of(scene, path.stem().stem().string());
}

// Puts a file in the place of -o -.
void use_stdout(Arguments& a, padder::cli::StreamFiles& files) {
  if (!padder::cli::is_stream(a.output)) {
    if (!a.format.empty()) throw UsageError("--format is for -o -: the ending of a file tells its format");
    return;
  }
  if (a.format.empty())
    throw UsageError("-o - has no ending that tells the format: name it, as --format html");
  if (a.json) throw UsageError("-o - writes the page or the picture to stdout: leave out --json");
  a.output = files.output("stdout." + a.format);
  a.quiet = true;
}

// A picture that was asked to show a mesh, and has none, would be empty.
void check_mesh(const Arguments& a, const CLI::App& app, const padder::View& view) {
  const bool mesh_alone = a.picture.show == padder::Show::mesh || a.picture.show == padder::Show::wire;
  if (app.count("--show") > 0 && mesh_alone && view.mesh.triangles.empty())
    throw padder::Error(
        "--show: " + a.input +
        " has no mesh to show: name it with --mesh (a cluster has one), or take --show spheres");
}

int run(Arguments& a, const CLI::App& app, padder::cli::StreamFiles& files) {
  // OMP_NUM_THREADS may ask for more than OpenMP's own stack holds.
  omp_set_num_threads(std::min(omp_get_max_threads(), padder::cli::kMostThreads));
  use_stdout(a, files);
  check(a);
  const bool page = padder::ending_of(a.output) == ".html";
  if (page)
    padder::cli::refuse_options(app, {"--samples", "--size", "--show", "--plain", "--dark"},
                                " is for a picture (.png), and a page is drawn by the browser: leave it out");
  padder::cli::check_writable(a.output);
  const auto began = std::chrono::steady_clock::now();
  std::string note;
  padder::View view = view_of(a, note);
  check_mesh(a, app, view);
  if (!a.contacts.empty()) padder::add_contacts(view, a.contacts);
  if (page) {
    padder::write_page(view, a.output, {a.from.first, a.from.second, a.up[0], a.rung, a.picture.colour, {}});
  } else {
    a.picture.rung = a.rung;
    a.picture.azimuth = a.from.first, a.picture.elevation = a.from.second, a.picture.up = a.up[0];
    padder::write_png(padder::render(view, a.picture), a.output);
  }
  if (!note.empty() && !a.quiet) std::fprintf(stderr, "preview: %s\n", note.c_str());
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  const auto bytes = fs::file_size(a.output);
  const std::uint64_t shown = view.rungs.empty() ? view.size() : view.rungs[a.rung].count;
  if (a.json)
    padder::cli::print_json({{"input", a.input},
                             {"output", a.output},
                             {"kind", page ? "page" : "picture"},
                             {"spheres", shown},
                             {"levels", std::max<std::size_t>(1, view.rungs.size())},
                             {"triangles", view.mesh.triangles.size()},
                             {"bodies", view.bodies.size()},
                             {"contacts", view.contacts.size()},
                             {"bytes", bytes},
                             {"seconds", seconds}});
  else if (!a.quiet)
    std::printf("%s: %s, %s, %s; %.1f MB, %.2f s\n", a.output.c_str(),
                padder::counted(shown, "sphere").c_str(),
                padder::counted(view.mesh.triangles.size(), "triangle").c_str(),
                padder::counted(view.contacts.size(), "contact").c_str(), double(bytes) / 1e6, seconds);
  files.deliver();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Examples:\n"
      "  preview track_shoe.spheres.json -o shoe.html                    a page to open in a browser\n"
      "  preview track_shoe.spheres.json -o shoe.png --size 1600x800     a picture, mesh left and spheres "
      "right\n"
      "  preview scene.json --contacts contacts.npz -o scene.html        bodies, families, contacts as "
      "arrows\n"
      "  preview track_shoe.spheres.json -o gap.png --colour gap         where the spheres leave the mesh "
      "bare\n\n"
      "Shows a cluster with its mesh, or a scene: as one HTML file that needs no network, or as a PNG.\n",
      "preview");
  Arguments arguments;
  padder::cli::StreamFiles files;
  declare(app, arguments);
  return padder::cli::run(
      app, argc, argv,
      [&] {
        padder::detect::SphereFile::end_program_if_shortened("preview", padder::cli::remove_all_unfinished);
        return run(arguments, app, files);
      },
      [&](const std::string& error) {
        if (arguments.json) padder::cli::print_failure(arguments.input, error);
      });
}
