// SPDX-License-Identifier: GPL-3.0-or-later
// The program detect: finds the contacts of a scene. Only arguments and printing are here; padder::detect
// does the work.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>

#include "detect/core/nine_stages.h"
#include "detect/scene/contact_file.h"
#include "padding/asset/error.h"
#include "tools/arguments.h"
#include "tools/detect/arguments.h"
#include "tools/run_files.h"
#include "tools/streams.h"

namespace padder::tool {
namespace {

constexpr std::uint64_t kShown = 512;  // --stages prints scenes of at most this many spheres

CLI::Validator device_count() {
  return padder::cli::accepting(
      [](auto& text) {
        return text == "all" || (padder::cli::is_whole(text) && text != "0" && text.size() < 5);
      },
      "number of devices: write a whole number from 1 to 9999, or all");
}

const std::set<std::string>& format_names() {
  static const std::set<std::string> all{"csv", "npz", "vtp", "npy"};
  return all;
}

void declare(CLI::App& app, Arguments& a, std::string& memory) {
  app.add_option("SCENE", a.scene,
                 "a scene (.json), a cluster (.spheres.json), or a file of spheres (.npy, .npz); - reads a "
                 "scene or a cluster from stdin")
      ->required()
      ->check(padder::cli::scene_file({".csv"}));
  padder::cli::add_whole(app, "--copies", a.copies, "of a cluster: a jittered pile of N bodies", 1,
                         0xfffffffe);
  a.backend.add(app, "--backend", "auto takes the GPU when there is one");
  app.add_option("--devices", a.devices,
                 "detect in boxes on N GPUs, or on all that there are; with --backend omp N detectors share "
                 "the CPU")
      ->check(device_count())
      ->type_name("N|all");
  app.add_option("--memory", memory,
                 "hold at most this much, as 20G (2^30 bytes each), 512M or 8192K: detect in boxes, and map "
                 "files instead of reading them")
      ->check(padder::cli::bytes())
      ->type_name("BYTES");
  app.add_option(
         "--lod", a.lod,
         "level of detail of the bodies (pad --lod): 0 the finest, 1 the next coarser …; auto: for each "
         "body from the smallest thing that can touch it, and none where nothing can")
      ->check(padder::cli::rung())
      ->capture_default_str()
      ->type_name("K|auto");
  a.path.add(app, "--path", "the fast path, or the nine stages as in the paper");
  a.precision.add(app, "--precision", "exact: the contacts of double arithmetic; fast: float only");
  app.add_option("--bin-size", a.options.bin_size, "edge of a bin, in the scene's unit (default: chosen)")
      ->check(padder::cli::not_tiny())
      ->check(CLI::PositiveNumber)
      ->check(padder::cli::distance())
      ->type_name("S");
  app.add_option(
         "-o", a.output,
         "write the contacts: .csv, .npz or .vtp, sorted; .npy as they come, which takes no memory; - "
         "writes to stdout")
      ->type_name("FILE");
  app.add_option("--format", a.format, "of -o -: csv, npz, vtp or npy")
      ->check(CLI::IsMember(format_names()))
      ->type_name("NAME");
  app.add_option("--margin", a.options.margin, "contacts are all pairs whose gap is at most M")
      ->check(padder::cli::not_tiny())
      ->check(CLI::NonNegativeNumber)
      ->check(padder::cli::distance())
      ->type_name("M");
  app.add_flag("--hash", a.hash, "print the order-free hash of the pairs");
  app.add_flag("--stages", a.stages, "print the arrays T, S, B, C, D, E, F of a small scene");
  static_assert(padder::cli::kMostThreads == kMostThreads);
  padder::cli::add_whole(app, "--threads", a.options.threads, "CPU threads, 1 to 1024 (default: all)", 1,
                         kMostThreads);
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.add_flag("-v", a.verbose, "print the seconds of each stage on stderr");
  app.set_version_flag("--version", "detect (padder) " PADDER_VERSION);
}

std::string bin_name(std::uint64_t bin, const StageGrid& g) {
  const std::uint64_t x = bin % g.side[0], y = bin / g.side[0] % g.side[1], z = bin / g.side[0] / g.side[1];
  return "(" + std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(z) + ")";
}

template <class T, class Print>
void print_row(const char* label, const std::vector<T>& values, Print print) {
  std::string line = label;
  for (std::size_t k = 0; k < values.size(); k++) {
    const std::string word = " " + print(values[k], k);
    if (line.size() + word.size() > 110) std::puts(line.c_str()), line = "   ";
    line += word;
  }
  std::puts(line.c_str());
}

void print_stages(const Arrays& a) {
  const StageGrid& g = a.grid;
  const auto number = [](auto v, std::size_t) { return std::to_string(v); };
  const auto entry = [&](const BinEntry& e, std::size_t) {
    return bin_name(e.bin, g) + ":" + std::to_string(e.object);
  };
  const auto start = [&](const BinStart& s, std::size_t) {
    return bin_name(s.bin, g) + ":" + (s.start == kInactive ? "inactive" : std::to_string(s.start));
  };
  std::printf(
      "grid of %llu x %llu x %llu bins of edge %.9g; bin (x,y,z) has number x + y SIDE.x + z SIDE.x SIDE.y\n",
      (unsigned long long)g.side[0], (unsigned long long)g.side[1], (unsigned long long)g.side[2], g.size);
  std::puts("stage 1, T: bins each object touches"), print_row("  T", a.T, number);
  std::puts("stage 2, S: inclusive scan of T"), print_row("  S", a.S, number);
  std::puts("stage 3, B: bin:object"), print_row("  B", a.B, entry);
  std::puts("stage 4, B sorted by bin"), print_row("  B", a.B_sorted, entry);
  std::puts("stage 5, C: bin:start in B, of the bins that are touched"), print_row("  C", a.C, start);
  std::printf("stage 6, C with inactive bins at the end: %llu active\n", (unsigned long long)a.active);
  print_row("  C", a.C_sorted, start);
  std::puts("stage 7, D: contacts of each active bin"), print_row("  D", a.D, number);
  std::puts("stage 8, E: inclusive scan of D"), print_row("  E", a.E, number);
  std::puts("stage 9, F: contacts");
  print_row("  F", a.F, [](const Pair& p, std::size_t) {
    return "(" + std::to_string(p.i) + "," + std::to_string(p.j) + ")";
  });
}

Json stages_json(const Arrays& a) {
  const auto entries = [](const std::vector<BinEntry>& from) {
    Json to = Json::array();
    for (const BinEntry& e : from) to.push_back({e.bin, e.object});
    return to;
  };
  const auto starts = [](const std::vector<BinStart>& from) {
    Json to = Json::array();
    for (const BinStart& s : from) to.push_back({s.bin, s.start == kInactive ? Json() : Json(s.start)});
    return to;
  };
  Json f = Json::array();
  for (const Pair& p : a.F) f.push_back({p.i, p.j});
  return {{"bin_size", a.grid.size},
          {"side", a.grid.side},
          {"T", a.T},
          {"S", a.S},
          {"B", entries(a.B)},
          {"B_sorted", entries(a.B_sorted)},
          {"C", starts(a.C)},
          {"C_sorted", starts(a.C_sorted)},
          {"active", a.active},
          {"D", a.D},
          {"E", a.E},
          {"F", f}};
}

// What was taken of the bodies. The scene is that with the levels of detail in it.
Json lod_json(const Scene& scene, const RungChoice& choice) {
  Json rungs = Json::array(), first = Json::array();
  std::uint64_t next = 0;
  for (std::size_t b = 0; b < scene.bodies.size(); b++) {
    const std::uint32_t rung = choice.rungs[b];
    rungs.push_back(rung == kLeftOut ? Json() : Json(rung)), first.push_back(next);
    next += scene.assets[scene.bodies[b].shape].spheres.size();
  }
  return {{"spheres_finest", choice.finest},
          {"spheres", choice.taken},
          {"spheres_out_of_reach", choice.out_of_reach},
          {"bodies_left_out", choice.left_out},
          {"error", std::isfinite(choice.error) ? Json(choice.error) : Json()},
          {"rungs", rungs},
          {"first_sphere", first}};
}

void print_lod(const RungChoice& choice) {
  std::printf(
      "levels of detail: %llu of %llu spheres of bodies; left out, as nothing can touch them: %llu bodies "
      "with %llu spheres\n",
      (unsigned long long)choice.taken, (unsigned long long)choice.finest,
      (unsigned long long)choice.left_out, (unsigned long long)choice.out_of_reach);
  if (!std::isfinite(choice.error))
    std::printf("how far these levels are from the finest is not proved\n");
  else if (choice.error > 0)
    std::printf("what touches a body is within %.3g of its finest level\n", choice.error);
}

int find_contacts(Arguments& a) {
  const Launch launch = launch_of_environment();
  const bool is_whole = a.lod == "0";
  if (!is_whole && (launch.ranks > 1 || wants_boxes(a)))
    throw UsageError(
        "--lod is for bodies and one detector: leave out --devices, --memory, mpirun and files of spheres");
  if (launch.ranks > 1) return run_ranks(a, launch);
  if (wants_boxes(a)) return run_boxes(a);
  Scene scene = read_input(a);
  const RungChoice choice =
      is_whole ? RungChoice() : choose_rungs(scene, rung_rule(a.lod), a.options.margin, {a.backend.value()});
  if (!is_whole) take_rungs(scene, choice);
  if (!a.quiet) padder::cli::tell_fewer_levels("detect", a.lod, choice.fewer);
  if (a.stages && scene.size() > kShown)
    throw padder::Error(a.scene + " has " + std::to_string(scene.size()) +
                        " spheres: --stages prints scenes of at most " + std::to_string(kShown));
  const Input input = scene.input();
  a.options.path = a.path.value(), a.options.precision = a.precision.value();
  a.options.timings = true;
  a.options.width = a.output.empty() ? Width::normals : Width::pairs;
  a.options.scalar = a.output.empty() ? Scalar::f32 : Scalar::f64;
  if (scene.loose.scalar == Scalar::f64 || !scene.bodies.empty()) a.options.scalar = Scalar::f64;
  Detector detector({a.backend.value()}, a.options);
  const Contacts& c = detector.detect(input);
  const Found found{c.spheres, scene.bodies.size(), c.count, detector.hash(), c.doubtful, detector.backend()};
  if (!a.output.empty()) write_contacts(c, input, a.output, a.options.threads);
  Json seconds = Json::object();
  for (int k = 0; k < 9; k++) seconds["stage" + std::to_string(k + 1)] = c.seconds.stage[k];
  seconds["place"] = c.seconds.place, seconds["total"] = c.seconds.total;
  Json report = report_of(a, found);
  report["seconds"] = seconds;
  if (!is_whole) report["lod"] = lod_json(scene, choice);
  if (a.stages && a.json) report["stages"] = stages_json(detector.stages(input));
  print_result(a, report, [&] {
    print_found(a, found, "", c.seconds.total);
    print_doubtful(a, found);
    if (!is_whole) print_lod(choice);
  });
  if (a.stages && !a.json) print_stages(detector.stages(input));
  return 0;
}

int run(Arguments& a) {
  padder::cli::StreamFiles files;
  const bool printed = padder::cli::is_stream(a.output);
  if (printed && (a.format.empty() || a.json || a.hash || a.stages))
    throw UsageError(a.format.empty()
                         ? "-o - has no ending that tells the format: name it, as --format csv"
                         : "-o - writes the contacts to stdout: leave out what else is printed there "
                           "(--json, --hash, --stages)");
  if ((printed || padder::cli::is_stream(a.scene)) && launch_of_environment().ranks > 1)
    throw UsageError("- is stdin or stdout of one process, and there are several ranks: name files");
  if (!printed && !a.format.empty())
    throw UsageError("--format is for -o -: the ending of a file tells its format");
  if (a.copies > 0 && (a.scene.ends_with(".npy") || a.scene.ends_with(".npz")))
    throw UsageError("--copies is for a cluster, and " + a.scene + " is a file of spheres: leave it out");
  const std::string ending = std::filesystem::path(a.output).extension().string();
  if (!printed && !a.output.empty() && (ending.empty() || !format_names().contains(ending.substr(1))))
    throw UsageError("cannot tell the format of " + a.output + ": end it with .csv, .npz, .vtp or .npy");
  // The nine stages and a margin are always exact.
  if (a.path.value() == Path::nine_stages || a.options.margin > 0) a.precision.word = "exact";
  if (!printed && !a.output.empty() && launch_of_environment().ranks <= 1)
    padder::cli::check_writable(a.output);
  if (printed) a.quiet = true, a.output = files.output("contacts." + a.format);
  const int code = find_contacts(a);
  files.deliver();
  return code;
}

}  // namespace

Scene read_input(const Arguments& a, LooseAs loose, bool check_file) {
  Scene scene =
      padder::cli::is_stream(a.scene)
          ? scene_or_cluster_from_json(padder::cli::read_stdin(), "the standard input", ".", a.copies, loose)
          : read_scene_or_cluster(a.scene, a.copies, loose);
  if (scene.mapped && check_file) scene.mapped->check();
  padder::cli::RunFiles files;
  for (const std::filesystem::path& file : scene.files) files.reads(file);
  if (!a.output.empty()) files.writes(a.output, "-o", "name another one with -o");
  return scene;
}

Json report_of(const Arguments& a, const Found& f) {
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx", (unsigned long long)f.hash);
  return {{"spheres", f.spheres},          {"bodies", f.bodies},    {"contacts", f.contacts},
          {"hash", std::string(hash)},     {"backend", f.backend},  {"path", a.path.word},
          {"precision", a.precision.word}, {"doubtful", f.doubtful}};
}

void print_found(const Arguments& a, const Found& f, const std::string& place, double seconds) {
  using padder::counted;
  std::printf("%s, %s: %s (%s, %s%s) in %.4f s\n", counted(f.spheres, "sphere").c_str(),
              counted(f.bodies, "body", "bodies").c_str(), counted(f.contacts, "contact").c_str(), f.backend,
              a.precision.word.c_str(), place.c_str(), seconds);
}

void print_doubtful(const Arguments& a, const Found& f) {
  if (a.precision.value() == Precision::float32)
    std::printf("float only: off from double arithmetic by at most %llu pairs\n",
                (unsigned long long)f.doubtful);
}

void print_result(const Arguments& a, const Json& report, const std::function<void()>& lines) {
  if (a.verbose)
    for (const auto& [stage, time] : report["seconds"].items())
      std::fprintf(stderr, "detect: %-7s %.6f s\n", stage.c_str(), time.get<double>());
  if (a.json) return padder::cli::print_json(report);
  if (!a.quiet) {
    lines();
    if (!a.output.empty()) std::printf("wrote %s\n", a.output.c_str());
  }
  if (a.hash) std::printf("%s\n", report["hash"].get<std::string>().c_str());
}

}  // namespace padder::tool

int main(int argc, char** argv) {
  const bool is_silent = padder::tool::silence_other_ranks();
  CLI::App app(
      "Examples:\n"
      "  detect track_shoe.spheres.json --copies 1000     contacts of a pile of 1,000 bodies\n"
      "  detect scene.json -o contacts.csv                contacts of a scene, written\n"
      "  detect scene.json --stages --bin-size 1          the arrays of the nine stages of a small scene\n"
      "  detect spheres.npy --devices all --memory 20G    more than memory holds, on every GPU\n\n"
      "Finds every pair of spheres that touch, but for those that families and masks exclude. Exact by "
      "default: the\n"
      "contacts are those of double arithmetic, the same from every backend, path and number of threads.\n",
      "detect");
  padder::tool::Arguments arguments;
  std::string memory;
  padder::tool::declare(app, arguments, memory);
  const int code = padder::cli::run(
      app, argc, argv,
      [&] {
        padder::detect::SphereFile::end_program_if_shortened("detect", padder::cli::remove_all_unfinished);
        if (arguments.stages && app.count("--path") > 0 &&
            arguments.path.value() != padder::detect::Path::nine_stages)
          throw padder::cli::UsageError(
              "--stages prints the nine stages, which --path fast leaves out: leave out one of both");
        if (!memory.empty()) arguments.memory = *padder::cli::bytes_of(memory);
        return padder::tool::run(arguments);
      },
      [&](const std::string& error) {
        if (arguments.json) padder::cli::print_failure(arguments.scene, error);
      });
  // All ranks fail together. mpirun ends the others at the first code that is not 0, so that must be the code
  // of the rank that has printed the reason.
  return is_silent ? 0 : code;
}
