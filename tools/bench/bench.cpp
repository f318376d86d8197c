// SPDX-License-Identifier: GPL-3.0-or-later
// bench: the measurements behind the figures of docs/. Arguments and printing only.
#include "tools/bench/bench.h"

#include "tools/arguments.h"
#include "tools/bench/report/document.h"
#include "tools/cli.h"
#include "tools/run_files.h"

#include <cstdio>
#include <iostream>

namespace {

using namespace padder::bench;

struct Entry {
  const char* name;
  const char* what;
  Run run;
  const char* reads;  // the options that it reads, but for --json and -q
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> all{
      {"table2", "errors against Bullet in double, beside the paper's Table 2", table2,
       "-o --spheres --backend --threads"},
      {"speedup", "speedup over a warm Bullet step, the paper's Fig. 25", speedup,
       "-o --spheres --backend --threads --repeat"},
      {"scaling", "time against contacts for every scene, the paper's Fig. 26", scaling,
       "-o --spheres --backend --threads --repeat --scene"},
      {"bodies", "the rows of scaling that are made of bodies, and a few that move among many", bodies,
       "-o --spheres --backend --threads --repeat"},
      {"scenes", "sparse and uneven scenes beside dense, standing and (--moving) moving", scenes,
       "-o --spheres --backend --threads --repeat --scene --moving --stable --history --margin"},
      {"motions", "scenes that travel, turn, draw together, fly apart, come and go", motions,
       "-o --spheres --backend --threads --repeat --scene --stable"},
      {"mixtures", "random scenes beside dense, the slowest of them with their seeds", mixtures,
       "-o --spheres --backend --threads --repeat --stable --count --seed"},
      {"piles", "piles of padded bodies, from those that barely touch to packed ones", piles,
       "-o --spheres --backend --threads --repeat --scene FILE"},
      {"shapes", "bodies of many shapes: searched first, expanded, and as the detector decides", shapes,
       "-o --backend --threads --repeat --scene --stable --count --seed"},
      {"worlds", "many worlds in one call, and answers for each: beside Bullet and FCL on the CPU", worlds,
       "-o --spheres --backend --threads --repeat FILE"},
      {"stages", "milliseconds of each stage, the nine stages and the fast path", stages,
       "-o --spheres --backend --threads --repeat"},
      {"boxes", "time against contacts on one and several GPUs, the paper's Fig. 27", boxes,
       "-o --spheres --backend --threads --repeat --scene --devices"},
      {"ranks", "one scene in repeated calls, by ranks of MPI (mpirun -n 2 bench ranks) and by threads",
       ranks, "-o --spheres --backend --threads --repeat"},
      {"table3", "a step of a settled silo beside the paper's Table 3, its Figs. 29 and 30", table3,
       "-o --spheres --backend --threads --scene"},
      {"precision", "error against time of float, exact and double on hard scenes", precision,
       "-o --spheres --backend --threads --repeat --scene"},
#ifdef PADDER_BENCH_PADDING
      {"frontier", "spheres against error of meshes, the paper's fit beside ours", frontier, "-o FILE"},
      {"shoe", "speed against error: a part padded at six tolerances, dropped on gravel", shoe,
       "-o --spheres --backend --threads FILE"},
      {"hard", "padding on hard meshes: what comes out, and whether that is right", hard, "-o --scene"},
#endif
      {"draw", "no measurement: the plots of such benches, from the JSON files they wrote", draw_files,
       "-o FILE"},
      {"compare", "no measurement: the times of two such JSON files; fails when the second is slower",
       compare, "--within FILE"},
  };
  return all;
}

bool reads(const Entry& e, const std::string& option) {
  return (' ' + std::string(e.reads) + ' ').find(' ' + option + ' ') != std::string::npos;
}

// "boxes and scenes": the benches that read an option.
std::string readers_of(const std::string& option) {
  std::vector<std::string> names;
  for (const Entry& e : entries())
    if (reads(e, option)) names.emplace_back(e.name);
  return padder::cli::listed(names);
}

const Entry& entry_of(const std::string& name) {
  for (const Entry& e : entries())
    if (name == e.name) return e;
  throw padder::cli::UsageError("no bench is called '" + name + "': see bench --list");
}

// Throws UsageError for what the bench would leave unread: its figures would be taken for others.
void refuse_unread(const CLI::App& app, const Entry& e) {
  for (const CLI::Option* option : app.get_options()) {
    const std::string name = option->get_name(), benches = readers_of(name);
    if (option->count() == 0 || benches.empty() || reads(e, name)) continue;
    if (name == "FILE")
      throw padder::cli::UsageError(std::string(e.name) + " reads no file: leave " + option->results()[0] +
                                    " out");
    throw padder::cli::UsageError(name + " is for " + benches + ": leave it out");
  }
}

void print_table(const Json& table) {
  std::vector<std::size_t> width;
  for (const Json& row : table)
    for (std::size_t k = 0; k < row.size(); k++) {
      if (k >= width.size()) width.push_back(0);
      width[k] = std::max(width[k], row[k].get<std::string>().size());
    }
  for (std::size_t r = 0; r < table.size(); r++) {
    std::string line = "|";
    for (std::size_t k = 0; k < width.size(); k++) {
      std::string cell = k < table[r].size() ? table[r][k].get<std::string>() : "";
      line += " " + cell + std::string(width[k] - cell.size(), ' ') + " |";
    }
    std::puts(line.c_str());
    if (r) continue;
    line = "|";
    for (const std::size_t w : width) line += " " + std::string(std::max<std::size_t>(w, 3), '-') + " |";
    std::puts(line.c_str());
  }
}

int run(const Entry& e, const Settings& settings) {
  if (!settings.folder.empty())
    padder::cli::check_writable(settings.folder / (std::string(e.name) + ".json"), true);
  if (reads(e, "--backend")) backends(settings);  // refused before anything is measured
  const Json result = e.run(settings);
  const bool measured = result.contains("machine");
  if (measured && result["rows"].empty())
    throw padder::Error(
        "nothing was measured, because no size of the bench's own is of this scene and backend: name one by "
        "--spheres");
  // Before it is written: what took hours to measure must not be lost to a disk that is full.
  if (!settings.json) print_table(result["table"]), padder::cli::flush_results();
  if (measured) write_result(settings, result);
  if (settings.json) std::cout << text_of(result) << std::flush;
  return result.value("passed", true) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Examples:\n"
      "  bench --list                                  the benches\n"
      "  bench table2 --spheres 1000000 -o figures/    one size, its files into a folder\n"
      "  bench speedup --backend omp --threads 2       on the CPU only\n"
      "  bench frontier part.obj -o figures/           a table, JSON and a plot\n"
      "  bench draw figures/frontier.json              the plot again from its JSON, on any machine\n"
      "  bench compare old.json new.json --within 3%   fails when a time is more than 3 % slower\n\n"
      "Measures what the figures of docs/ are made of. Prints a table for Markdown. With -o also NAME.json "
      "and,\n"
      "where gnuplot is installed, NAME.svg; draw makes the same NAME.svg from NAME.json, beside it or in "
      "DIR.\n",
      "bench");
  using padder::cli::add_whole;
  std::string name;
  Settings s;
  bool list = false;
  app.add_option("NAME", name, "which bench");
  app.add_option("FILE", s.files,
                 "meshes (frontier; shoe: one), clusters (piles; of an arm's links: worlds), JSON files that "
                 "benches wrote (draw, compare)");
  app.add_flag("--list", list, "name the benches");
  // Of more spheres than a detector takes, a scene cannot be measured.
  add_whole(app, "--spheres", s.spheres, "sizes, instead of the bench's own", 1, 0xfffffffe)
      ->delimiter(',')
      ->type_name("N,N,...");
  app.add_option(
         "--scene", s.scene,
         "one scene, spacing, shape or mesh only (scaling, motions, piles, shapes, boxes, precision, hard); "
         "this one and dense (scenes); clumps of three spheres instead of grains (table3)")
      ->type_name("NAME");
  app.add_flag("--moving", s.moving, "measure a scene in motion as well (scenes)");
  app.add_flag("--stable", s.stable, "a list of stable order (scenes, motions, mixtures, shapes)");
  app.add_flag("--history", s.history, "measure a list with a history as well (scenes)");
  app.add_option("--margin", s.margin, "measure with a margin of so many mean radii as well (scenes)")
      ->type_name("X")
      ->check(CLI::Range(0.0, 1000.0))
      ->check(padder::cli::decimal());
  add_whole(app, "--count", s.count, "so many random scenes (mixtures; shapes --scene mixtures)", 1, 1000000)
      ->capture_default_str();
  add_whole(app, "--seed", s.seed, "of the first of them; the next ones follow", 0, 1'000'000'000)
      ->capture_default_str();
  app.add_option("--backend", s.backend, "auto (each that is there, the default), omp or cuda")
      ->type_name("WHICH")
      ->check(CLI::IsMember({"auto", "omp", "cuda"}));
  add_whole(app, "--threads", s.threads, "CPU threads, 1 to 1024 (default: all)", 1,
            padder::cli::kMostThreads);
  add_whole(app, "--devices", s.devices, "GPUs, instead of one, two, four and so on (boxes)", 1);
  add_whole(app, "--repeat", s.repeat, "measured calls; the median counts", 1)->capture_default_str();
  std::string within = "3%";
  app.add_option("--within", within, "how much slower a time may be, as 3% or 0.03 (compare)")
      ->type_name("FRACTION")
      ->check(padder::cli::fraction())
      ->capture_default_str();
  app.add_option("-o", s.folder, "write the bench's files into this folder")->type_name("DIR");
  app.add_flag("--json", s.json, "print one JSON document on stdout");
  app.add_flag("-q", s.quiet, "print nothing but results and errors");
  app.set_version_flag("--version", "bench (padder) " PADDER_VERSION);
  const auto work = [&] {
    if (list) {
      for (const Entry& e : entries()) std::printf("%-10s %s\n", e.name, e.what);
      return 0;
    }
    if (name.empty()) throw padder::cli::UsageError("name a bench: see bench --list");
    const Entry& entry = entry_of(name);
    refuse_unread(app, entry);
    s.within = *padder::cli::fraction_of(within);
    return run(entry, s);
  };
  return padder::cli::run(app, argc, argv, work, [&](const std::string& error) {
    if (s.json) padder::cli::print_failure(name, error);
  });
}
