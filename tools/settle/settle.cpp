// SPDX-License-Identifier: GPL-3.0-or-later
// settle: the detector inside a stepper. Arguments and printing only; the work is in tools/settle/.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/detect/launch.h"
#include "tools/progress_bar.h"
#include "tools/run_files.h"
#include "tools/settle/files.h"
#include "tools/settle/make_scene.h"
#include "tools/settle/page/page.h"
#include "tools/settle/read_scene.h"
#include "tools/streams.h"

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

namespace detect = padder::detect;
using padder::cli::UsageError;
using padder::settle::Stepper;
using padder::settle::Watch;

constexpr std::uint64_t kMostSteps = 1'000'000'000'000'000;
constexpr std::uint64_t kMostFrames = 1'000'000;

struct Arguments {
  std::string scene, output, checkpoint, resume, make, cluster, backend = "auto", lod = "0";
  std::optional<std::uint64_t> steps;
  std::uint64_t frames = 0, count = 2000, seed = 1;
  double skin = -1;
  int threads = 0;
  bool until_rest = false, json = false, quiet = false;
};

void declare(CLI::App& app, Arguments& a) {
  using padder::cli::add_whole;
  app.add_option("SCENE", a.scene,
                 "a scene (.json) with an object \"settle\": docs/detector/settle.md; - reads it from stdin")
      ->check(padder::cli::scene_file({".csv", ".npy", ".npz"}));
  app.add_option("-o", a.output,
                 "frames: .html for a page that plays, .npz or .vtp for NAME_0000 and so on; with --make the "
                 "scene (.json); - writes a page to stdout")
      ->type_name("FILE");
  add_whole(app, "--frames", a.frames,
            "how many frames (default: 100 for a page, fewer where it would be above 30 MB; else the last "
            "state alone)",
            1, kMostFrames);
  add_whole(app, "--steps", a.steps, "steps to take (default: the scene's duration)");
  app.add_flag("--until-rest", a.until_rest,
               "end as soon as everything is at rest; the duration is the most that it may take");
  app.add_option("--checkpoint", a.checkpoint, "write the state with each frame and at the end (.npz)")
      ->type_name("FILE");
  app.add_option("--resume", a.resume, "begin with the state of such a file; the bits are those of one run")
      ->type_name("FILE");
  add_whole(app, "--threads", a.threads, "threads (default: all, if the scene is large enough)", 0,
            padder::cli::kMostThreads);
  app.add_option("--backend", a.backend,
                 "auto (a GPU if there is one and the scene is large enough for it), omp or cuda")
      ->check(CLI::IsMember({"auto", "omp", "cuda"}))
      ->capture_default_str();
  app.add_option("--skin", a.skin,
                 "keep candidates while nothing has moved half of this length; 0: detect in every step "
                 "(default: chosen; the motion is the same)")
      ->check(padder::cli::distance())
      ->check(CLI::NonNegativeNumber)
      ->type_name("X");
  app.add_option(
         "--lod", a.lod,
         "level of detail of the bodies (pad --lod): 0 the finest, 1 the next coarser …; auto: for each "
         "body from the smallest thing in the scene")
      ->check(padder::cli::rung())
      ->capture_default_str()
      ->type_name("K|auto");
  app.add_option("--make", a.make,
                 "make the scene: silo, ball or track. -o FILE.json writes it, and anything else settles it")
      ->check(CLI::IsMember(padder::settle::scene_makers()))
      ->type_name("NAME");
  add_whole(app, "--count", a.count, "--make: grains of the silo and the track, bodies of the ball", 1,
            100000000)
      ->capture_default_str();
  app.add_option("--cluster", a.cluster, "--make: the padded part of the ball's bodies or the track's shoes")
      ->type_name("FILE");
  add_whole(app, "--seed", a.seed, "--make: of the random numbers", 0, padder::settle::kMostSeed)
      ->capture_default_str();
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.set_version_flag("--version", "settle (padder) " PADDER_VERSION);
}

void check(const Arguments& a, const CLI::App& app) {
  using padder::cli::refuse_options;
  const std::string ending = fs::path(a.output).extension().string();
  if (a.make.empty()) refuse_options(app, {"--count", "--cluster", "--seed"}, " is for --make: leave it out");
  if (a.output.empty()) refuse_options(app, {"--frames"}, " counts what -o writes: name a file with -o");
  if (!a.make.empty()) {
    if (!a.scene.empty()) throw UsageError("--make makes the scene: leave " + a.scene + " out");
    if (a.make != "silo" && a.cluster.empty())
      throw UsageError("--make " + a.make + " is made of a padded part: name it with --cluster");
    if (a.make == "silo")
      refuse_options(app, {"--cluster"}, " is for the ball and the track: the silo has grains, leave it out");
    if (ending == ".json")
      return refuse_options(app,
                            {"--steps", "--frames", "--until-rest", "--checkpoint", "--resume", "--skin",
                             "--lod", "--backend", "--threads"},
                            " is for settling, and -o FILE.json writes the scene alone: leave it out");
    if (a.output.empty())
      throw UsageError("--make: name with -o what to write: FILE.json for the scene, FILE.html to settle it");
  } else if (a.scene.empty()) {
    throw UsageError("a scene is wanted");
  }
  if (!a.output.empty() && ending != ".html" && ending != ".npz" && ending != ".vtp")
    throw UsageError("cannot tell what to write to " + a.output + ": end it with .html, .npz or .vtp");
  if (a.steps && *a.steps > kMostSteps) throw UsageError("--steps is at most 10^15");
  if (!a.checkpoint.empty() && fs::path(a.checkpoint).extension() != ".npz")
    throw UsageError("a checkpoint ends with .npz, and " + a.checkpoint + " does not");
}

// Watches a run from outside: the energy must not grow, unless somebody drives a body.
class EnergyGuard {
 public:
  explicit EnergyGuard(Stepper& stepper) : stepper_(stepper), last_(stepper.watch()) {
    for (const auto d : stepper.system().driven) driven_ |= d != 0;
  }
  Watch check() {
    const Watch now = stepper_.watch();
    motion_ = std::max({motion_, now.kinetic + now.elastic, last_.kinetic + last_.elastic});
    const double gain = now.total() - last_.total();
    if (!driven_ && !(gain <= 0.1 * motion_))
      throw padder::Error("the energy grew by " + std::to_string(gain) + " until step " +
                          std::to_string(stepper_.steps()) +
                          ", which no such scene can do: use a \"time_step\" of less than " +
                          padder::short_number(stepper_.time_step(), 4));
    if (now.total() < last_.total() || driven_) last_ = now;
    return now;
  }
  bool driven() const { return driven_; }

 private:
  Stepper& stepper_;
  Watch last_;
  double motion_ = 0;
  bool driven_ = false;
};

Json report_of(const Stepper& stepper, const detect::RungChoice& rungs, const Watch& w, double first_energy) {
  const auto& s = stepper.system();
  const auto& e = stepper.effort();
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx", (unsigned long long)padder::settle::state_hash(stepper));
  return {
      {"backend", stepper.backend()},
      {"spheres", s.spheres()},
      {"bodies", s.bodies.size()},
      {"grains", s.grain_radius.size()},
      {"lod",
       {{"spheres_finest", rungs.finest},
        {"spheres", rungs.taken},
        {"error", std::isfinite(rungs.error) ? Json(rungs.error) : Json()}}},
      {"steps", stepper.steps()},
      {"time", stepper.time()},
      {"time_step", s.step},
      {"stiffness", s.law.stiffness},
      {"contacts", stepper.contacts()},
      {"at_rest", stepper.at_rest()},
      {"energy",
       {{"first", first_energy}, {"kinetic", w.kinetic}, {"potential", w.potential}, {"elastic", w.elastic}}},
      {"momentum", {w.momentum.x, w.momentum.y, w.momentum.z}},
      {"fastest", w.fastest},
      {"penetration", stepper.deepest_so_far()},
      {"penetration_ratio", stepper.deepest_ratio_so_far()},
      {"state", hash},
      {"detections", e.detections},
      {"candidates", e.candidates},
      {"skin", e.skin},
      {"seconds", {{"total", e.seconds}, {"detection", e.detection_seconds}}}};
}

// An impact presses spheres in by as much as its speed times the root of mass over stiffness, and a stiffness
// that is chosen knows of weights alone.
void warn_of_soft_contacts(const Stepper& stepper) {
  constexpr double kSoft = 0.1;
  const double ratio = stepper.deepest_ratio_so_far(), stiffness = stepper.system().law.stiffness;
  // As it is printed below: an overlap of 0.101 would be "0.1", and the stiffness that helps the one that is.
  if (ratio < 1.05 * kSoft) return;
  const auto number = [](double v) { return padder::short_number(v, 2); };
  std::fprintf(stderr,
               "settle: two spheres, or a sphere and a wall, overlapped by %s of the smaller radius: a "
               "\"stiffness\" of about %s in \"material\", where it was %s, would keep that below %s\n",
               number(ratio).c_str(), number(stiffness * ratio * ratio / (kSoft * kSoft)).c_str(),
               number(stiffness).c_str(), number(kSoft).c_str());
}

void print(const Json& r) {
  const double seconds = r["seconds"]["total"], detection = r["seconds"]["detection"];
  using padder::counted;
  std::printf("%s (%s, %s), %s of %.3g: time %.4g\n", counted(r["spheres"], "sphere").c_str(),
              counted(r["bodies"], "body", "bodies").c_str(), counted(r["grains"], "grain").c_str(),
              counted(r["steps"], "step").c_str(), r["time_step"].get<double>(), r["time"].get<double>());
  const Json& lod = r["lod"];
  if (lod["spheres"] != lod["spheres_finest"])
    std::printf("levels of detail: %llu of %llu spheres of bodies; %s\n",
                lod["spheres"].get<unsigned long long>(), lod["spheres_finest"].get<unsigned long long>(),
                lod["error"].is_null() ? "their error is not proved"
                                       : ("within " + lod["error"].dump() + " of the finest").c_str());
  std::printf("%s; fastest %.3g; deepest penetration %.2g of a radius; kinetic energy %.3g%s\n",
              counted(r["contacts"], "contact").c_str(), r["fastest"].get<double>(),
              r["penetration_ratio"].get<double>(), r["energy"]["kinetic"].get<double>(),
              r["at_rest"].get<bool>() ? "; at rest" : "");
  if (r.contains("page"))
    std::printf("%s: %llu frames, %llu spheres that can be seen, %.1f MB\n",
                r["output"].get<std::string>().c_str(), r["frames"].get<unsigned long long>(),
                r["page"]["spheres"].get<unsigned long long>(), r["page"]["bytes"].get<double>() / 1e6);
  std::printf("%.2f s (%s), of which %.2f s in %s; state %s\n", seconds,
              r["backend"].get<std::string>().c_str(), detection,
              counted(r["detections"], "detection").c_str(), r["state"].get<std::string>().c_str());
}

// Where the frames of a run go.
class Frames {
 public:
  Frames(const Arguments& a, const padder::settle::SettleScene& scene) : a_(a), title_(scene.name) {}
  void take(Stepper& stepper) {
    if (!a_.checkpoint.empty()) padder::settle::write_checkpoint(stepper, a_.checkpoint);
    if (a_.output.empty()) return;
    stepper.place();
    if (page())
      movie_.add(stepper);
    else
      padder::settle::write_frame(stepper, padder::settle::frame_path(a_.output, number_));
    number_++;
  }
  void finish(const Stepper& stepper, Json& report) const {
    if (a_.output.empty()) return;
    report["frames"] = number_, report["output"] = a_.output;
    if (!page()) return;
    const auto written =
        movie_.write(title_, stepper.system(), a_.output, a_.frames ? 0 : padder::settle::Movie::kUsualBytes);
    report["frames"] = written.frames;
    report["page"] = {{"spheres", written.spheres}, {"bytes", written.bytes}};
  }
  // Programs that show NAME_0000, NAME_0001 and so on would show the end of a longer run behind this one.
  void warn_of_older() const {
    const fs::path next = padder::settle::frame_path(a_.output, number_);
    if (std::error_code code; a_.output.empty() || page() || !fs::exists(next, code)) return;
    std::fprintf(stderr,
                 "settle: %s is no frame of this run and was there before: remove it and what follows it\n",
                 next.string().c_str());
  }
  bool page() const { return a_.output.ends_with(".html"); }

 private:
  const Arguments& a_;
  std::string title_;
  padder::settle::Movie movie_;
  std::uint64_t number_ = 0;
};

std::string progress_of(const Stepper& stepper, std::uint64_t last) {
  char text[160];
  std::snprintf(text, sizeof text, "step %llu of %llu, time %.4g, %llu contacts",
                (unsigned long long)stepper.steps(), (unsigned long long)last, stepper.time(),
                (unsigned long long)stepper.contacts());
  return text;
}

std::string made_scene(const Arguments& a, const fs::path& folder) {
  return padder::settle::make_scene(a.make, {a.count, a.cluster, a.seed}, folder);
}

// Nothing that the run reads is overwritten by what it writes. A checkpoint may take the place of that which
// is resumed.
void keep_inputs(const Arguments& a, const std::vector<fs::path>& inputs, const Frames& frames,
                 std::uint64_t wanted) {
  padder::cli::RunFiles files;
  for (const fs::path& input : inputs) files.reads(input);
  const auto write = [&](const fs::path& file, const char* option) {
    files.writes(file, option, std::string("name another one with ") + option);
  };
  if (!a.checkpoint.empty()) padder::cli::check_writable(a.checkpoint);
  if (!a.output.empty())
    padder::cli::check_writable(frames.page() ? fs::path(a.output) : padder::settle::frame_path(a.output, 0));
  if (!a.checkpoint.empty()) write(a.checkpoint, "--checkpoint");
  if (!a.resume.empty()) files.reads(a.resume);
  if (a.output.empty()) return;
  if (frames.page()) return write(a.output, "-o");
  for (std::uint64_t k = 0; k < wanted; k++) write(padder::settle::frame_path(a.output, k), "-o");
}

int settle(const Arguments& a) {
  padder::ProgressBar bar("settle", !a.quiet);
  bar.tell_between_calls(), bar.show(0, "reading the scene");
  const detect::RungRule rule = detect::rung_rule(a.lod);
  padder::settle::SettleScene scene =
      !a.make.empty() ? padder::settle::settle_scene_from_json(made_scene(a, "."), a.make, ".", rule)
      : padder::cli::is_stream(a.scene)
          ? padder::settle::settle_scene_from_json(padder::cli::read_stdin(), "the standard input", ".", rule)
          : padder::settle::read_settle_scene(a.scene, rule);
  if (!a.quiet) padder::cli::tell_fewer_levels("settle", a.lod, scene.rungs.fewer);
  using detect::BackendKind;
  const BackendKind backend = a.backend == "omp"    ? BackendKind::omp
                              : a.backend == "cuda" ? BackendKind::cuda
                                                    : BackendKind::automatic;
  Stepper stepper(std::move(scene.system), {a.threads, a.skin, backend});
  if (!a.resume.empty()) padder::settle::read_checkpoint(stepper, a.resume);
  const double whole = std::ceil(scene.duration / stepper.time_step() - 1e-9);
  if (!a.steps && !(whole < double(kMostSteps)))
    throw padder::Error("the duration is more than 10^15 steps long: give --steps");
  const std::uint64_t last = a.steps ? stepper.steps() + *a.steps : static_cast<std::uint64_t>(whole);
  Frames frames(a, scene);
  const std::uint64_t left = last > stepper.steps() ? last - stepper.steps() : 0;
  const std::uint64_t wanted =
      std::min(left + 1, a.frames        ? a.frames
                         : frames.page() ? padder::settle::Movie::usual_frames(stepper.system().spheres())
                                         : 1);
  keep_inputs(a, scene.files, frames, wanted);
  const std::uint64_t intervals = wanted > 1 ? wanted - 1 : 1;  // between frames
  // A look at the energies every hundredth of the run, and at least every thousand steps: a long run ends as
  // early as a short one when it comes to rest or goes wrong, and a look costs about as much as a step.
  const std::uint64_t between =
      std::clamp<std::uint64_t>(left / std::max<std::uint64_t>(intervals, 100), 1, 1000);
  bar.show(0, progress_of(stepper, last));
  EnergyGuard guard(stepper);
  Watch w = guard.check();
  const double first_energy = w.total();
  const std::uint64_t begun = stepper.steps();
  if (wanted > 1) frames.take(stepper);
  std::uint64_t taken = 1;
  while (stepper.steps() < last && !(stepper.at_rest() && a.until_rest)) {
    // To the next look, or the next frame if that is earlier; or to the end. What has become slow is looked
    // at again as soon as it can be at rest.
    std::uint64_t done = stepper.steps() - begun, look = (done / between + 1) * between;
    if (a.until_rest && stepper.rest_step() > stepper.steps())
      look = std::min(look, stepper.rest_step() - begun);
    std::uint64_t until = look;
    if (wanted > 1) until = std::min(until, (taken * left + intervals - 1) / intervals);
    stepper.step(std::max(std::min(until, left), done + 1) - done);
    done = stepper.steps() - begun;
    if (done >= look) w = guard.check();
    bar.show(double(done) / double(left), progress_of(stepper, last));
    if (wanted > 1 && done * intervals >= taken * left && stepper.steps() < last)
      frames.take(stepper), taken++;
  }
  w = guard.check();
  frames.take(stepper);
  Json report = report_of(stepper, scene.rungs, w, first_energy);
  if (frames.page()) bar.show(1, "writing " + a.output);
  frames.finish(stepper, report);
  bar.clear();
  if (!a.quiet) warn_of_soft_contacts(stepper), frames.warn_of_older();
  if (a.json)
    padder::cli::print_json(report);
  else if (!a.quiet)
    print(report);
  return 0;
}

int run(Arguments& a, const CLI::App& app) {
  if (const int ranks = padder::tool::launch_of_environment().ranks; ranks > 1)
    throw UsageError("settle runs as one process, and " + std::to_string(ranks) +
                     " were started, which would write the same files: start it without mpirun or srun");
  padder::cli::StreamFiles streams;
  if (padder::cli::is_stream(a.output)) {
    if (a.json) throw UsageError("-o - writes a page to stdout, where --json prints: leave one of them out");
    a.output = streams.output("stdout.html"), a.quiet = true;
  }
  check(a, app);
  if (a.make.empty() || fs::path(a.output).extension() != ".json") {
    const int code = settle(a);
    streams.deliver();
    return code;
  }
  padder::cli::RunFiles files;
  if (!a.cluster.empty()) files.reads(a.cluster);
  files.writes(a.output, "-o", "name another one with -o");
  padder::write_file(a.output, made_scene(a, fs::path(a.output).parent_path()));
  if (a.json)
    padder::cli::print_json({{"scene", a.make}, {"output", a.output}, {"count", a.count}, {"seed", a.seed}});
  else if (!a.quiet)
    std::printf("wrote %s\n", a.output.c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Examples:\n"
      "  settle --make silo --count 2000 -o silo.html            grains in a cylinder: a page that plays\n"
      "  settle --make silo --count 2000 -o silo.json            the scene alone\n"
      "  settle silo.json -o silo.vtp                            settled, for ParaView\n"
      "  settle silo.json --until-rest --checkpoint rest.npz     its state at rest, to go on from\n"
      "  settle silo.json --resume rest.npz --steps 1000 --json  goes on\n\n"
      "Moves grains and padded bodies by springs, dashpots and friction where the detector finds contacts.\n",
      "settle");
  Arguments arguments;
  declare(app, arguments);
  return padder::cli::run(
      app, argc, argv, [&] { return run(arguments, app); },
      [&](const std::string& error) {
        if (arguments.json) padder::cli::print_failure(arguments.scene, error);
      });
}
