// SPDX-License-Identifier: GPL-3.0-or-later
// Runs gnuplot, and the files of the benches: each its document, and its plots where gnuplot is installed.
#include "tools/bench/report/draw.h"

#include <cstdlib>
#include <set>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/export/new_folders.h"
#include "tools/bench/report/document.h"
#include "tools/cli.h"

namespace padder::bench {
namespace {

namespace fs = std::filesystem;

const char* const kNoGnuplot = "gnuplot is not installed (Debian: gnuplot-nox)";

// A folder of its own for gnuplot, gone afterwards.
struct Workshop {
  Workshop() {
    std::error_code code;  // set when TMPDIR names no folder
    std::string name = (fs::temp_directory_path(code) / "padder-plot-XXXXXX").string();
    if (code || !::mkdtemp(name.data()))
      throw Error(name + ": a temporary folder cannot be made: set TMPDIR to another");
    path = name;
  }
  ~Workshop() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  fs::path path;
};

std::string for_shell(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

// gnuplot says "line N: what" below the line itself and a caret.
std::string complaint(const std::string& log) {
  const std::size_t at = log.find("line ");
  return at == std::string::npos ? "" : ": " + log.substr(at, log.find('\n', at) - at);
}

}  // namespace

bool have_gnuplot() { return std::system("command -v gnuplot >/dev/null 2>&1") == 0; }

std::vector<fs::path> draw(const std::vector<Plot>& plots, const fs::path& folder, const std::string& stem) {
  if (!plots.empty() && !have_gnuplot()) throw Error(std::string("no plot: ") + kNoGnuplot);
  NewFolders folders;
  folders.make(folder);
  std::vector<fs::path> files;
  for (const Plot& plot : plots) {
    const fs::path file = folder / (stem + plot.name + ".svg");
    const Workshop workshop;
    write_file(workshop.path / "script", "set terminal svg size " + std::to_string(plot.width) + "," +
                                             std::to_string(plot.height) +
                                             " font 'sans,14' background rgb 'white'\n" + plot.script);
    const int status = std::system(
        ("cd " + for_shell(workshop.path.string()) + " && gnuplot script >plot.svg 2>log </dev/null")
            .c_str());
    if (status != 0)
      throw Error("gnuplot failed on " + file.string() + complaint(read_file(workshop.path / "log")));
    write_file(file, read_file(workshop.path / "plot.svg"));
    files.push_back(file);
  }
  return files;
}

void write_result(const Settings& s, const Json& result) {
  if (s.folder.empty()) return;
  NewFolders folders;
  folders.make(s.folder);
  const std::string name = result["bench"];
  const fs::path file = s.folder / (name + ".json");
  write_file(file, text_of(result));
  const std::vector<Plot> plots = plots_of(result, file.string());
  if (plots.empty() || have_gnuplot())
    draw(plots, s.folder, name);
  else
    say(s,
        std::string("no plot: ") + kNoGnuplot + "; where it is, bench draw " + file.string() + " draws it");
}

Json draw_files(const Settings& s) {
  if (s.files.empty()) throw cli::UsageError("name at least one file that a bench wrote: bench draw FILE...");
  struct Drawing {
    fs::path folder, stem;
    std::vector<Plot> plots;
  };
  // All are read before any is drawn: what is wrong with the last should not come to light after the first.
  std::vector<Drawing> drawings;
  std::set<fs::path> names;
  for (const std::string& file : s.files) {
    Drawing d{s.folder.empty() ? fs::path(file).parent_path() : s.folder, fs::path(file).stem(),
              plots_of(read_document(file), file)};
    if (d.plots.empty())
      throw Error(
          file +
          ": this bench has no plot; scaling, bodies, stages, boxes, speedup, frontier, table3, shoe, "
          "precision and hard have");
    for (const Plot& p : d.plots)
      if (!names.insert((d.folder / (d.stem.string() + p.name)).lexically_normal()).second)
        throw Error(file +
                    ": another file is drawn under the same name: give each a folder of its own with -o");
    drawings.push_back(std::move(d));
  }
  Json rows = Json::array(), table = Json::array({{"file", "plot"}});
  for (std::size_t k = 0; k < drawings.size(); k++)
    for (const fs::path& plot : draw(drawings[k].plots, drawings[k].folder, drawings[k].stem.string())) {
      rows.push_back({{"file", s.files[k]}, {"plot", plot.string()}});
      table.push_back({s.files[k], plot.string()});
    }
  return {{"bench", "draw"}, {"rows", rows}, {"table", table}};
}

}  // namespace padder::bench
