// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/manifest/part_list.h"

#include <glob.h>

#include <algorithm>
#include <unordered_map>

#include "padding/asset/crc32.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/import/import.h"
#include "padding/input/read.h"
#include "padding/input/text.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/pad/one_part.h"
#include "tools/streams.h"

namespace padder {

namespace fs = std::filesystem;
using cli::UsageError;

namespace {

bool is_pattern(const std::string& text) {
  std::error_code code;
  return text.find_first_of("*?[") != std::string::npos && !fs::exists(text, code);
}

// One list of parts in the making.
class List {
 public:
  List(const PadArguments& a, const std::map<std::string, std::string>& given) : a_(a) {
    auto common = std::make_shared<PartSettings>();
    common->arguments = a;
    common->arguments.json = true;  // a worker prints nothing
    common->arguments.preview.clear(), common->arguments.meshes.clear();
    common->given = given;
    common_ = common;
  }

  void add_manifest() {
    const bool piped = a_.manifest == "-";
    const std::string text = piped ? cli::read_stdin(kMostText) : read_file(a_.manifest, kMostText);
    const fs::path folder = piped ? fs::path() : fs::path(a_.manifest).parent_path();
    const std::string name = piped ? "the manifest on stdin" : a_.manifest;
    if (text.find('\0') != std::string::npos)
      throw UsageError(name + ": it holds zero bytes, so it is no list of parts: save it as UTF-8");
    reading::Lines lines(text);
    for (std::string_view line; lines.next(line);)
      if (!line.empty() && line[0] != '#')
        add_line(std::string(line), folder, name + ", line " + std::to_string(lines.number()));
  }

  // Every mesh below a folder, without hidden files and what was written before.
  void add_folder(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code code;
    const fs::path written = fs::weakly_canonical(a_.output(), code);
    for (auto it = fs::recursive_directory_iterator(folder); it != fs::recursive_directory_iterator(); ++it) {
      const bool hidden = it->path().filename().string().starts_with('.');
      if (it->is_directory() && (hidden || fs::weakly_canonical(it->path(), code) == written))
        it.disable_recursion_pending();
      else if (!hidden && has_mesh_ending(it->path()) && it->is_regular_file(code))
        files.push_back(it->path());
    }
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files)
      add(file.string(), file.lexically_relative(folder).string(), common_, file.string());
  }

  void add_pattern(const std::string& pattern) {
    if (pattern.find("**") != std::string::npos)
      throw UsageError(excerpt(pattern) +
                       ": ** is no pattern here: * is the name of one folder; to take every mesh below a "
                       "folder, name the folder");
    glob_t found{};
    const int failed = ::glob(pattern.c_str(), 0, nullptr, &found);
    std::vector<std::string> files;
    if (!failed) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
    if (files.empty()) throw Error("no file fits the pattern " + excerpt(pattern) + ": check it");
    // The tree begins where the pattern does.
    const fs::path base = fs::path(pattern.substr(0, pattern.find_first_of("*?["))).parent_path();
    for (const std::string& file : files)
      if (has_mesh_ending(file))
        add(file, base.empty() ? file : fs::path(file).lexically_relative(base).string(), common_, file);
  }

  void add_file(const std::string& mesh) { add(mesh, fs::path(mesh).filename().string(), common_, mesh); }

  // Throws UsageError if two parts would write one file, or one a file that is read.
  std::vector<Part> take() {
    cli::RunFiles files;
    if (!a_.manifest.empty()) files.reads(a_.manifest);
    for (const Part& part : parts_)
      note_inputs(part.mesh, robot_of(part.mesh, part.settings->arguments), files);
    for (std::size_t k = 0; k < parts_.size(); k++)
      for (const fs::path& output : {fs::path(parts_[k].output), parts_[k].pairs})
        if (!output.empty())
          files.writes(fs::path(a_.output()) / output, where_[k],
                       "give -o another folder, or list the parts in a manifest, each with its own -o");
    return std::move(parts_);
  }

 private:
  void add_line(const std::string& line, const fs::path& folder, const std::string& where) {
    std::error_code code;
    if (line.find(' ') == std::string::npos || fs::is_regular_file(folder / line, code))
      return add((folder / line).string(), line, common_, where);
    auto settings = std::make_shared<PartSettings>(*common_);
    PadArguments& a = settings->arguments;
    a.meshes.clear(), a.outputs.clear();
    CLI::App app("", where);
    app.set_help_flag();
    declare_part(app, a);
    try {
      app.parse(line);
    } catch (const CLI::ParseError& e) {
      throw UsageError(where + ": " + cli::usage_sentence(app, e));
    }
    if (a.meshes.size() != 1)
      throw UsageError(where +
                       ": a line names one mesh, and its options behind it; quote a name with blanks");
    for (const auto& [name, value] : settings_of(app)) settings->given[name] = value;
    const std::string mesh = a.meshes[0];
    try {
      check_robot_options(app, {(folder / mesh).string()});
    } catch (const UsageError& e) {
      throw UsageError(where + ": " + e.what());
    }
    // Equal options are stored once: a manifest may have very many lines.
    std::string text = std::to_string(a.seconds) + '\n' + a.memory + '\n' + a.output() + '\n';
    for (const auto& [name, value] : settings->given) text += name + '=' + value + '\n';
    add((folder / mesh).string(), mesh, known_.emplace(text, settings).first->second, where);
  }

  void add(const std::string& mesh, const fs::path& place, std::shared_ptr<const PartSettings> settings,
           const std::string& where) {
    // The command line's -o is the folder of all; a line's names this part's file below it.
    const bool own = settings != common_ && !settings->arguments.outputs.empty();
    PadArguments a = settings->arguments;
    if (!own) a.outputs.clear();
    const Format* format = nullptr;
    try {
      if (a.outputs.size() > 1) throw UsageError("a part of a list is one file: give one -o");
      check_conversion(a, settings->given, mesh);
      format = format_of(a, mesh);
    } catch (const UsageError& e) {
      throw UsageError(where + ": " + e.what());
    }
    if (format && !*format->ending)
      throw UsageError(where + ": " + format->name +
                       " is a folder, and a part of a list is one file: pad it by itself");
    const fs::path output =
        (own ? fs::path(a.output()) : place.parent_path() / output_name(mesh, format)).lexically_normal();
    if (output.is_absolute() || output == "." || *output.begin() == ".." || !output.has_filename())
      throw UsageError(where + ": its output " + output.string() +
                       " is no file below the output folder: give the line -o with a name below it");
    parts_.push_back(
        {mesh, output.generic_string(), pairs_file(mesh, {output, format}), std::move(settings)});
    where_.push_back(where);
    for (const fs::path& file : {output, parts_.back().pairs}) refuse_own(file, where);
  }

  // What pad itself keeps in the output folder.
  void refuse_own(const fs::path& output, const std::string& where) const {
    if (output.empty()) return;
    const fs::path first = *output.begin();
    if (first == ".pad" || (a_.page && first == "index.html"))
      throw UsageError(where + ": its output " + output.string() + " is what pad itself writes there (" +
                       first.string() + "): give the line -o with another name");
  }

  const PadArguments& a_;
  std::shared_ptr<const PartSettings> common_;
  std::unordered_map<std::string, std::shared_ptr<const PartSettings>> known_;
  std::vector<Part> parts_;
  std::vector<std::string> where_;  // each is listed
};

}  // namespace

bool lists_parts(const PadArguments& a) {
  std::error_code code;
  return !a.manifest.empty() || std::ranges::any_of(a.meshes, [&](const std::string& mesh) {
    return (fs::is_directory(mesh, code) && !is_sphere_file(mesh)) || is_pattern(mesh);
  });
}

std::vector<Part> list_parts(const PadArguments& a, const std::map<std::string, std::string>& given) {
  List list(a, given);
  if (!a.manifest.empty()) list.add_manifest();
  std::error_code code;
  for (const std::string& mesh : a.meshes) try {
      if (fs::is_directory(mesh, code) && !is_sphere_file(mesh))
        list.add_folder(mesh);
      else if (is_pattern(mesh))
        list.add_pattern(mesh);
      else
        list.add_file(mesh);
    } catch (const fs::filesystem_error& e) {
      throw Error("cannot read the folder " + mesh + " (" + e.code().message() +
                  "): check that it may be read");
    }
  std::vector<Part> parts = list.take();
  if (parts.empty())
    throw Error((a.manifest.empty() ? a.meshes[0] : a.manifest) + " lists no mesh: check it");
  return parts;
}

bool Shard::holds(const Part& part) const { return crc32(part.output) % of == index - 1; }

Shard shard_of(const std::string& text) {
  if (text.empty()) return {};
  const std::size_t slash = std::min(text.find('/'), text.size());
  const auto index = cli::number_of<std::uint32_t>(std::string_view(text).substr(0, slash)),
             of = cli::number_of<std::uint32_t>(
                 std::string_view(text).substr(std::min(slash + 1, text.size())));
  if (!index || !of || *index < 1 || *index > *of)
    throw UsageError("--shard takes the number of a portion and how many there are, as 1/8 to 8/8, not \"" +
                     excerpt(text) + '"');
  return {*index, *of};
}

}  // namespace padder
