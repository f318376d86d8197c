// SPDX-License-Identifier: GPL-3.0-or-later
// The benches: each a function, registered by one line in bench.cpp. It prints a table on stdout (or one JSON
// document with --json) and writes its files into a folder when one is named.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/generate.h"

namespace padder::bench {

using Json = nlohmann::ordered_json;

struct Settings {
  std::vector<std::uint64_t> spheres;   // sizes asked for; empty: the bench's own
  std::string scene;                    // scaling, scenes, boxes: this one only
  std::vector<std::string> files;       // meshes, for those benches that pad; documents to draw
  std::string backend = "auto";         // auto: each that is there
  int threads = 0;                      // 0: all
  int devices = 0;                      // boxes: GPUs; 0: one, two and so on
  int repeat = 5;                       // measured calls after a warm-up; the median counts
  double within = 0.03;                 // compare: how much slower a time may be, as a fraction
  bool moving = false, stable = false;  // scenes: spheres move between calls as well; a stable order
  double margin = 0;                    // scenes: measured as well, in mean radii
  bool history = false;                 // scenes: the same with a history as well
  std::uint64_t count = 50, seed = 1;   // mixtures: so many, from this seed on
  bool json = false, quiet = false;
  std::filesystem::path folder;  // empty: no files
};

// Gives the bench's result as JSON, "table" in it as printed (rows of text cells, the first the header).
using Run = std::function<Json(const Settings&)>;

Json table2(const Settings&);      // table2.cpp
Json speedup(const Settings&);     // speedup.cpp
Json scaling(const Settings&);     // scaling.cpp
Json bodies(const Settings&);      // scaling.cpp; its rows of bodies alone
Json piles(const Settings&);       // piles.cpp
Json shapes(const Settings&);      // shapes.cpp
Json stages(const Settings&);      // stages.cpp
Json scenes(const Settings&);      // scenes/scenes.cpp
Json motions(const Settings&);     // scenes/motions.cpp
Json mixtures(const Settings&);    // scenes/mixtures.cpp
Json boxes(const Settings&);       // boxes.cpp
Json ranks(const Settings&);       // ranks.cpp; to be started by mpirun
Json worlds(const Settings&);      // worlds.cpp
Json table3(const Settings&);      // table3.cpp
Json precision(const Settings&);   // stability/precision.cpp
Json frontier(const Settings&);    // frontier.cpp; only where padder::padding is built
Json shoe(const Settings&);        // shoe/shoe.cpp; the same
Json hard(const Settings&);        // stability/hard.cpp; only where padder::padding is built
Json draw_files(const Settings&);  // draw.cpp; no measurement: the plots of documents
Json compare(const Settings&);     // compare.cpp; no measurement: two documents; "passed" tells the outcome

// --- What benches share (common.cpp) ---

double seconds_of(const std::function<void()>& work);
double median(std::vector<double> values);                             // of an even number the upper one
double median_seconds(int repeat, const std::function<void()>& work);  // one call before, not measured
void say(const Settings&, const std::string& sentence);                // progress, on stderr
// Throws what ends the program with exit code 2.
[[noreturn]] void wrong_usage(const std::string& sentence);
// Calls it where --scene names none of these.
void check_scene(const Settings&, const char* bench, std::vector<std::string> names);

// detector.detect(input) and detector.hash() under a watchdog: the process ends with a sentence when there is
// no answer within a minute. On the CPU, which cannot hang, each million spheres adds a second.
const detect::Contacts& detect_watched(detect::Detector& detector, const detect::Input& input);
std::uint64_t hash_watched(const detect::Detector& detector);

// Those asked for that are there. Throws Error where CUDA alone is asked for and is not there.
std::vector<detect::BackendKind> backends(const Settings&);
const char* name_of(detect::BackendKind backend);  // "omp" or "cuda"
// What --spheres says, or else the bench's own.
std::vector<std::uint64_t> sizes_or(const Settings&, std::vector<std::uint64_t> own);
std::uint64_t size_or(const Settings&, std::uint64_t own);
// These borrow.
detect::Spheres view_of(const detect::FloatSphere* spheres, std::uint64_t count);
detect::Input input_of(const std::vector<detect::FloatSphere>& spheres);

// The yardstick and oracle: a plain uniform grid, one thread, double arithmetic. Pairs (i < j), unsorted.
std::vector<detect::Pair> plain_grid(const std::vector<detect::FloatSphere>& spheres);
std::uint64_t hash_of(const std::vector<detect::Pair>& pairs);

// A straight line through points (x, y) by least squares. r2: the share of the spread of y that it explains.
struct FittedLine {
  double offset = 0, slope = 0, r2 = 1;
};
using Points = std::vector<std::pair<double, double>>;
FittedLine fitted_line(const Points& points);

std::string machine();  // processor and threads, in words
std::string number(double value, const char* format);

// If a folder is named, writes the result there as NAME.json, and its plots. Says so on stderr when gnuplot
// is not installed.
void write_result(const Settings&, const Json& result);  // draw.cpp

}  // namespace padder::bench
