// SPDX-License-Identifier: GPL-3.0-or-later
// What the program detect is asked to do, and what the ways of doing it share.
#pragma once
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "detect/scene/scene.h"
#include "tools/cli.h"
#include "tools/detect/launch.h"

namespace padder::tool {

using Json = nlohmann::ordered_json;
using namespace padder::detect;  // NOLINT(google-build-using-namespace): this program is about nothing else
using padder::cli::UsageError;

// An option whose value is one of some words. Each word stands for a value; the first one is the default.
template <class T>
class Choices {
 public:
  Choices(std::initializer_list<std::pair<const char*, T>> words)
      : words_(words.begin(), words.end()), word(words_[0].first) {}
  void add(CLI::App& app, const char* name, const char* what) {
    std::string all;
    std::vector<std::string> words;
    for (const auto& [text, unused] : words_)
      all += (all.empty() ? "" : "|") + std::string(text), words.push_back(text);
    app.add_option(name, word, what)->type_name(all)->capture_default_str()->check(CLI::IsMember(words));
  }
  T value() const {
    for (const auto& [text, v] : words_)
      if (word == text) return v;
    return words_[0].second;
  }

 private:
  std::vector<std::pair<const char*, T>> words_;

 public:
  std::string word;
};

struct Arguments {
  std::string scene, output;  // "-": the standard input, the standard output
  std::string format;         // of the output, where it has no name
  std::uint64_t copies = 0;
  std::string lod = "0";     // level of detail of the bodies: a number or "auto"
  std::string devices;       // a number or "all"; empty: one, and no boxes
  std::uint64_t memory = 0;  // bytes; 0: no limit, and no boxes
  bool hash = false, stages = false, json = false, quiet = false, verbose = false;
  Choices<BackendKind> backend{
      {"auto", BackendKind::automatic}, {"omp", BackendKind::omp}, {"cuda", BackendKind::cuda}};
  Choices<Path> path{{"fast", Path::grid}, {"nine-stages", Path::nine_stages}};
  Choices<Precision> precision{{"exact", Precision::exact}, {"fast", Precision::float32}};
  CallOptions options;
};

// What was found, whichever way it was searched.
struct Found {
  std::uint64_t spheres, bodies, contacts, hash, doubtful;
  const char* backend;
};
// How every report begins: what was found, and how exactly.
Json report_of(const Arguments& arguments, const Found& found);

// The report with --json, or else `lines` and what was written; the hash where it is wanted. With -v a line
// for each stage, on stderr.
void print_result(const Arguments& arguments, const Json& report, const std::function<void()>& lines);

// The first lines on stdout. `place`: what else stands in brackets, as ", 4 ranks".
void print_found(const Arguments& arguments, const Found& found, const std::string& place, double seconds);
void print_doubtful(const Arguments& arguments, const Found& found);

// The scene that the arguments name. Throws UsageError if -o would replace a file that it is read from.
// `check_file`: look at the checksums of a mapped file, for which it is read as a whole.
Scene read_input(const Arguments& arguments, LooseAs loose = LooseAs::memory, bool check_file = true);

// --devices, --memory, or a mapped file: contacts are found box by box. Prints the result.
bool wants_boxes(const Arguments& arguments);
int run_boxes(const Arguments& arguments);

// The same as one of several ranks, which all call it. Rank 0 prints the result.
int run_ranks(const Arguments& arguments, const Launch& launch);

// What all ranks say the same, rank 0 alone prints. True on the others, which are silent from now on.
bool silence_other_ranks();

}  // namespace padder::tool
