// pad: triangle meshes to clusters of spheres. Arguments and printing only; the work is padder::pad.
#include "padding/pad.h"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "padding/error.h"
#include "padding/export/export.h"
#include "padding/view/page.h"
#include "tools/cli.h"
#include "tools/pad_robot.h"

namespace padder {

// "0.01" is in the mesh's unit, "1%" a share of its diagonal. Found by CLI11 through its argument.
bool lexical_cast(const std::string& text, Length& out) {
  std::string number = text;
  out.share = !number.empty() && number.back() == '%';
  if (out.share) number.pop_back();
  if (!CLI::detail::lexical_cast(number, out.value) || !std::isfinite(out.value) || out.value <= 0)
    return false;
  if (out.share) out.value /= 100;
  return true;
}

}  // namespace padder

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> meshes;
  std::string output, unit, format, preview;
  double scale = 1, density = padder::ExportOptions().density;
  padder::PadOptions options;
  int threads = 0;
  bool json = false, quiet = false;
};

using padder::cli::UsageError;

void declare(CLI::App& app, Arguments& a) {
  app.add_option(
         "MESH", a.meshes,
         "mesh files: " +
             [] {
               std::string endings;
               for (const auto& e : padder::mesh_endings())
                 endings += (endings.empty() ? "" : " ") + e.substr(1);
               return endings;
             }())
      ->required();
  app.add_option("-o", a.output,
                 "file to write, its ending tells the format (docs/formats.md), or folder for several "
                 "(default: NAME.spheres.json here)")
      ->type_name("FILE|DIR");
  app.add_option("--format", a.format,
                 [] {
                   std::string names = "another program's format, where the ending does not tell:";
                   for (const auto& f : padder::formats()) names += std::string(" ") + f.name;
                   return names;
                 }())
      ->type_name("NAME");
  app.add_option("--density", a.density, "for formats that state a mass (default: 1000, kg/m^3 in metres)")
      ->check(CLI::PositiveNumber);
  app.add_option("--depth", a.options.depth,
                 "one sphere a triangle: cap height over circumradius, above 0, at most 1 (default: 0.2)")
      ->check(CLI::Range(1e-6, 1.));
  app.add_option("--edge-length", a.options.edge_length,
                 "of the remeshed triangles: in the mesh's unit, or a share of its diagonal as 2%")
      ->type_name("LENGTH");
  app.add_option(
         "--tolerance", a.options.tolerance,
         "the fewest spheres with protrusion and gap proved to be within it; with --depth: thin those")
      ->type_name("LENGTH");
  app.add_option("--max-spheres", a.options.max_spheres, "the smallest error that so many spheres can keep")
      ->check(CLI::PositiveNumber);
  app.add_option("--max-radius", a.options.max_radius, "no larger sphere")->type_name("LENGTH");
  app.add_option("--min-radius", a.options.min_radius,
                 "no smaller sphere, even where the tolerance asks for it")
      ->type_name("LENGTH");
  const std::map<std::string, padder::Balance> balances{
      {"none", padder::Balance::none}, {"volume", padder::Balance::volume}, {"mean", padder::Balance::mean}};
  app.add_option("--balance", a.options.balance,
                 "within the tolerance: none (fewest, the default), volume (of the union as the mesh's), "
                 "mean (smallest means)")
      ->transform(CLI::CheckedTransformer(balances))
      ->type_name("WHAT");
  app.add_option("--smooth", a.options.smooth, "mean normal error asked for, degrees")
      ->check(CLI::PositiveNumber);
  app.add_option("--effort", a.options.effort, "0 to 3: search longer for fewer spheres")
      ->capture_default_str()
      ->check(CLI::Range(0, 3));
  app.add_option("--reach", a.options.reach,
                 "radius of the smallest grain: what it cannot touch is not padded")
      ->type_name("LENGTH");
  app.add_option("--lod", a.options.lod, "a ladder of tolerances in one asset, as 2%,1%,0.5%")
      ->delimiter(',')
      ->type_name("LENGTHS");
  app.add_option("--sharp-angle", a.options.sharp_angle, "keep edges whose faces turn by more degrees")
      ->capture_default_str()
      ->check(CLI::Range(1., 180.));
  const std::map<std::string, padder::RepairMode> modes{{"auto", padder::RepairMode::automatic},
                                                        {"never", padder::RepairMode::never},
                                                        {"wrap", padder::RepairMode::wrap}};
  app.add_option("--repair", a.options.repair, "auto (the default), never or wrap")
      ->transform(CLI::CheckedTransformer(modes))
      ->type_name("MODE");
  app.add_option("--family", a.options.family, "of the asset: no contact inside a family; 0 is none");
  app.add_option("--mask", a.options.mask, "bit k: no contact with family k + 1");
  app.add_option("--preview", a.preview, "show mesh and spheres: a page (.html) or a picture (.png)")
      ->type_name("FILE");
  app.add_option("--scale", a.scale, "factor on every coordinate")->check(CLI::PositiveNumber);
  app.add_option("--unit", a.unit, "m, cm, mm or in: the unit of the asset")
      ->type_name("UNIT")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}));
  app.add_option("--threads", a.threads, "threads to use, 1 to 1024 (default: all)")
      ->check(CLI::Range(1, padder::cli::kMostThreads));
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.set_version_flag("--version", "pad (padder) " PADDER_VERSION);
}

bool is_robot(const std::string& file) { return fs::path(file).extension() == ".urdf"; }

// Where each result goes and as what; null is our own format. Two meshes must not write one file.
struct Target {
  fs::path path;
  const padder::Format* format = nullptr;
  bool in_folder = false;  // -o names a folder, not the file
};

std::vector<Target> targets(const Arguments& a) {
  const bool folder =
      !a.output.empty() && (fs::is_directory(a.output) || a.output.back() == '/') && a.format != "mercury";
  if (a.meshes.size() > 1 && !a.output.empty() && !folder)
    throw UsageError("-o must name a folder when there are several meshes: make it, or end it with /");
  std::vector<Target> out;
  std::map<fs::path, std::string> owner;
  for (const auto& mesh : a.meshes) {
    Target t;
    t.in_folder = folder;
    try {
      if (!a.format.empty())
        t.format = &padder::find_format({}, a.format);
      else if (!a.output.empty() && !folder && !a.output.ends_with(".json"))
        t.format = &padder::find_format(a.output);
      else if (is_robot(mesh))
        t.format = &padder::find_format({}, "urdf");
    } catch (const padder::Error& e) {
      throw UsageError(e.what());
    }
    if (is_robot(mesh) && a.output.ends_with(".json"))
      throw UsageError(
          "a robot has several links and a .spheres.json is one body: -o a folder gets one for each link");
    t.path = fs::path(mesh).stem().string() +
             (!t.format ? ".spheres.json" : std::string(is_robot(mesh) ? ".spheres" : "") + t.format->ending);
    if (folder)
      t.path = fs::path(a.output) / t.path;
    else if (!a.output.empty())
      t.path = a.output;
    const auto [it, fresh] = owner.emplace(t.path, mesh);
    if (!fresh)
      throw UsageError(mesh + " and " + it->second + " would both write " + t.path.string() +
                       ": pad them one by one with -o");
    out.push_back(t);
  }
  if (!a.preview.empty() && std::any_of(a.meshes.begin(), a.meshes.end(), is_robot))
    throw UsageError("--preview shows a mesh, not a robot: give it one of the robot's meshes");
  if (!a.preview.empty() && (a.meshes.size() > 1 || !padder::is_preview(a.preview)))
    throw UsageError("--preview shows one mesh in one file that ends in .html or .png");
  if (a.preview.ends_with(".html")) padder::page_script();  // before the work, not after it
  return out;
}

// One line on a terminal, nothing elsewhere.
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

Json report_json(const std::string& input, const fs::path& output, const Arguments& a,
                 const padder::Padded& p) {
  const auto& r = p.report;
  const auto& s = r.seconds;
  const bool depth_mode = a.options.depth || !a.options.by_tolerance();
  Json lods = Json::array();
  for (const auto& lod : p.cluster.lods)
    lods.push_back({{"tolerance", lod.tolerance},
                    {"spheres", lod.radii.size()},
                    {"accuracy", Json::parse(padder::to_json(lod.accuracy))}});
  const auto [least, most] = std::minmax_element(p.cluster.radii.begin(), p.cluster.radii.end());
  return {{"input", input},
          {"output", output.string()},
          {"triangles_in", r.triangles_in},
          {"triangles_remeshed", r.triangles_remeshed},
          {"repair", p.cluster.source.repair},
          {"depth", depth_mode ? Json(a.options.depth_used()) : Json(nullptr)},
          {"tolerance", r.tolerance > 0 ? Json(r.tolerance) : Json(nullptr)},
          {"within", r.within},
          {"grid_entries", r.grid_entries},
          {"lods", lods},
          {"edge_length", r.edge_length},
          {"spheres", p.cluster.size()},
          {"diagonal", r.diagonal},
          {"radius_min", *least},
          {"radius_max", *most},
          {"accuracy", Json::parse(padder::to_json(p.cluster.accuracy))},
          {"buried", r.buried},
          {"quality",
           {{"min_angle_deg", r.quality.min_angle_deg},
            {"share_under_20_deg", r.quality.share_under_20_deg},
            {"share_non_delaunay", r.quality.share_non_delaunay},
            {"circumradius_max", r.quality.circumradius_max},
            {"sharp_edges", r.quality.sharp_edges}}},
          {"seconds",
           {{"read", s.read},
            {"repair", s.repair},
            {"remesh", s.remesh},
            {"fit", s.fit},
            {"refit", s.refit},
            {"cull", s.cull},
            {"accuracy", s.accuracy},
            {"total", s.total()}}}};
}

void print_errors(const padder::Accuracy& a, double diagonal, std::size_t spheres) {
  const auto percent = [&](double length) { return 100 * length / diagonal; };
  std::printf(
      "  %zu spheres: protrusion at most %.3f %% (mean %.3f %%), gap at most %.3f %% (mean %.4f %%)%s\n",
      spheres, percent(a.protrusion_max), percent(a.protrusion_mean), percent(a.gap_max), percent(a.gap_mean),
      a.certified ? ", both proved" : "");
}

void print_report(const std::string& input, const fs::path& output, const padder::Padded& p) {
  const auto& r = p.report;
  std::printf("%s: %llu triangles", input.c_str(), (unsigned long long)r.triangles_in);
  if (r.triangles_remeshed > 0) std::printf(", remeshed to %llu", (unsigned long long)r.triangles_remeshed);
  std::printf("; repair: %s\n", p.cluster.source.repair.c_str());
  for (const auto& lod : p.cluster.lods) print_errors(lod.accuracy, r.diagonal, lod.radii.size());
  print_errors(p.cluster.accuracy, r.diagonal, p.cluster.size());
  if (r.kind == padder::BodyKind::wrap)
    std::printf("  proofs hold against the wrap, which lies up to %.3f %% outside the input\n",
                100 * p.cluster.accuracy.wrap_distance / r.diagonal);
  if (r.kind == padder::BodyKind::sheet)
    std::printf("  an open sheet has no inside: its errors are measured, not proved\n");
  if (!r.within) std::printf("  the count or the radius limits did not allow the tolerance asked for\n");
  std::printf("  of the diagonal %g%s; normals off by %.1f degrees in the mean; %.2f s\n", r.diagonal,
              (p.cluster.unit.empty() ? "" : " " + p.cluster.unit).c_str(),
              p.cluster.accuracy.normal_error_mean_deg, r.seconds.total());
  std::printf("  wrote %s\n", output.c_str());
}

int run(Arguments& a) {
  if (a.threads > 0) omp_set_num_threads(a.threads);
  const std::vector<Target> goals = targets(a);
  Json all = Json::array();
  bool failed = false;
  ProgressBar bar(!a.quiet);
  for (std::size_t k = 0; k < a.meshes.size(); k++) {
    const std::string& mesh = a.meshes[k];
    try {
      const auto& [path, format, in_folder] = goals[k];
      if (path.has_parent_path()) {
        std::error_code code;
        fs::create_directories(path.parent_path(), code);  // write_cluster says what is wrong with it
      }
      if (is_robot(mesh)) {
        if (a.scale != 1 || (!a.unit.empty() && a.unit != "m"))
          throw padder::Error(mesh + ": a URDF is in metres: leave out --scale and --unit");
        padder::RobotJob job{mesh, path, format, a.options, {a.density}, in_folder};
        const Json report =
            padder::run_robot(job, [&](const std::string& link, std::size_t done, std::size_t of) {
              bar.show(mesh + ", " + link, k, a.meshes.size(), "", int(done), int(of));
            });
        bar.clear();
        if (a.json)
          all.push_back(report);
        else if (!a.quiet)
          padder::print_robot(report);
        continue;
      }
      padder::ReadOptions reading{a.scale, a.unit};
      const padder::Padded padded =
          padder::pad_file(mesh, reading, a.options, [&](const char* step, int done, int steps) {
            bar.show(mesh, k, a.meshes.size(), step, done, steps);
          });
      if (format)
        padder::write_model(padder::model_of(padded.cluster), path, *format, {a.density});
      else
        padder::write_cluster(padded.cluster, path);
      if (!a.preview.empty())
        padder::write_preview(padder::view_of(padded.cluster, padder::mesh_of(padded.cluster, path, mesh)),
                              a.preview);
      bar.clear();
      if (a.json)
        all.push_back(report_json(mesh, path, a, padded));
      else if (!a.quiet)
        print_report(mesh, path, padded);
    } catch (const padder::Error& e) {
      bar.clear();
      std::fprintf(stderr, "pad: %s\n", e.what());
      if (a.json) all.push_back({{"input", mesh}, {"error", e.what()}});
      failed = true;
    } catch (const std::bad_alloc&) {
      bar.clear();
      const std::string what = mesh + ": not enough memory: use a longer --edge-length";
      std::fprintf(stderr, "pad: %s\n", what.c_str());
      if (a.json) all.push_back({{"input", mesh}, {"error", what}});
      failed = true;
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
      "  pad part.obj --edge-length 1% --json         finer, with the report as JSON\n\n"
      "Covers a triangle mesh with spheres: repairs it, remeshes it isotropically, fits one sphere a "
      "triangle at the\n"
      "depth ratio, refits what would stand out, measures the result and writes it as a cluster. A LENGTH is "
      "in the\n"
      "mesh's own unit, or a share of the diagonal of its bounding box when it ends in %.\n",
      "pad");
  Arguments arguments;
  declare(app, arguments);
  return padder::cli::run(app, argc, argv, [&] { return run(arguments); });
}
