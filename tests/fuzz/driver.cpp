// SPDX-License-Identifier: MIT
// Fuzzing without a fuzzer: runs the targets on a corpus, and on random changes of it. No coverage guides it;
// that is libfuzzer.cpp's (preset fuzz). This one needs no clang and is a test.
//
//   fuzz_driver CORPUS [--runs N] [--seconds S] [--seed S] [TARGET...]
//       CORPUS is a folder; the seeds of a target are the files with its endings. Ends each target after N
//       changes or S seconds; without both, after 0.1 s or what PADDER_FUZZ_SECONDS says
//   fuzz_driver --file FILE TARGET
//       one input, as a finding is made again
//
// Before each input its bytes are written to fuzz-input in the current folder, so a crash leaves what caused
// it.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <map>
#include <random>
#include <vector>

#include "padding/asset/file.h"
#include "tests/fuzz/targets.h"

namespace {

namespace fs = std::filesystem;
using padder::fuzz::Target;

class Mutator {
 public:
  Mutator(std::uint64_t seed, const std::vector<std::string>& corpus) : random_(seed), corpus_(corpus) {}
  std::string next() {
    std::string bytes =
        corpus_.empty() || below(50) == 0 ? noise(1 + below(600)) : corpus_[below(corpus_.size())];
    for (std::size_t k = 1 + below(6); k-- > 0;) change(bytes);
    return bytes;
  }

 private:
  std::size_t below(std::size_t most) { return most ? random_() % most : 0; }
  std::string noise(std::size_t size) {
    std::string bytes(size, 0);
    for (char& c : bytes) c = static_cast<char>(random_());
    return bytes;
  }
  void change(std::string& bytes) {
    static const char* const words[] = {"-1", "nan",  "inf", "1e999",  "4294967296", "18446744073709551615",
                                        "0",  "\n",   "\0",  "{",      "[",          "<",
                                        "\"", "&",    "../", "1e-400", ",",          " ",
                                        "-",  "\xff", "NaN", "true",   "null",       "<!--",
                                        "]]>"};
    const std::size_t at = below(bytes.size() + 1),
                      length = below(std::min<std::size_t>(bytes.size() - at, 1 + below(64)) + 1);
    switch (below(7)) {
      case 0:
        bytes.erase(at, length);
        break;
      case 1:
        bytes.insert(at, words[below(std::size(words))]);
        break;
      case 2:
        bytes.insert(below(bytes.size() + 1), bytes.substr(at, length));
        break;
      case 3:
        if (at < bytes.size()) bytes[at] ^= static_cast<char>(1 << below(8));
        break;
      case 4:
        if (at < bytes.size()) bytes[at] = static_cast<char>(random_());
        break;
      case 5:
        bytes.resize(at);
        break;
      default:
        bytes.replace(at, length, noise(length));
    }
  }
  std::mt19937_64 random_;
  const std::vector<std::string>& corpus_;
};

void run(const Target& target, const std::string& bytes) {
  // Written by the kernel at once, and kept open: opening it anew takes longer than most inputs.
  static const int file = ::open("fuzz-input", O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (::pwrite(file, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()) ||
      ::ftruncate(file, static_cast<off_t>(bytes.size())) != 0)
    std::perror("fuzz_driver: fuzz-input"), std::exit(2);
  target.run(bytes);
}

std::vector<std::string> seeds_of(const Target& target, const fs::path& corpus) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(corpus))
    if (entry.is_regular_file() && entry.file_size() < 100000) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> seeds;
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    std::string endings = target.endings;
    for (std::size_t at = 0; at < endings.size();) {
      const std::size_t end = std::min(endings.find(' ', at), endings.size());
      if (name.ends_with(endings.substr(at, end - at))) seeds.push_back(padder::read_file(file));
      at = end + 1;
    }
  }
  return seeds;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 3 && words[0] == "--file") {
    const Target* target = padder::fuzz::find_target(words[2]);
    if (!target) return 2;
    target->run(padder::read_file(words[1]));
    return 0;
  }
  constexpr double kNoLimit = 1e18;
  std::map<std::string, double> options = {
      {"--runs", kNoLimit}, {"--seconds", kNoLimit}, {"--seed", double(std::random_device()() % 1000000)}};
  for (std::size_t k = 1; k + 1 < words.size();)
    if (options.contains(words[k])) {
      options[words[k]] = std::strtod(words[k + 1].c_str(), nullptr);
      words.erase(words.begin() + static_cast<std::ptrdiff_t>(k),
                  words.begin() + static_cast<std::ptrdiff_t>(k) + 2);
    } else {
      k++;
    }
  if (words.empty()) return std::fputs("fuzz_driver CORPUS [--runs N] [--seconds S]\n", stderr), 2;
  if (options["--runs"] == kNoLimit && options["--seconds"] == kNoLimit) {
    const char* seconds = std::getenv("PADDER_FUZZ_SECONDS");
    options["--seconds"] = seconds ? std::strtod(seconds, nullptr) : 0.1;
  }
  std::printf("seed %.0f\n", options["--seed"]);
  for (const Target& target : padder::fuzz::targets()) {
    if (words.size() > 1 && std::find(words.begin() + 1, words.end(), target.name) == words.end()) continue;
    const std::vector<std::string> seeds = seeds_of(target, words[0]);
    const bool any = !*target.endings;
    if (seeds.empty() && !any) {
      std::fprintf(stderr, "no seed for %s (%s)\n", target.name, target.endings);
      return 1;
    }
    for (const std::string& seed : seeds) run(target, seed);
    Mutator mutator(static_cast<std::uint64_t>(options["--seed"]), seeds);
    const auto began = std::chrono::steady_clock::now();
    const auto seconds = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    };
    double runs = 0;
    for (; runs < options["--runs"] && seconds() < options["--seconds"]; runs++) run(target, mutator.next());
    std::printf("%-12s %zu seeds, %.0f changes, %.1f s\n", target.name, seeds.size(), runs, seconds());
    std::fflush(stdout);
  }
  fs::remove("fuzz-input");
  return 0;
}
