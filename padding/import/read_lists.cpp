// SPDX-License-Identifier: MIT
// Reads spheres from lines of numbers (DEM-Engine, LIGGGHTS, YADE, MercuryDPM) and from NumPy arrays.
#include <array>
#include <charconv>
#include <map>

#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "padding/import/readers.h"

namespace padder::importing {
namespace {

// Columns of a line, between commas or (comma = false) blanks.
std::vector<std::string_view> columns(std::string_view line, bool comma) {
  std::vector<std::string_view> out;
  for (std::size_t k = 0; k <= line.size();) {
    const std::size_t end = comma ? std::min(line.find(',', k), line.size())
                                  : std::min(line.find_first_of(" \t", k), line.size());
    if (comma || end > k) out.push_back(trimmed(line.substr(k, end - k)));
    k = end + 1;
  }
  return out;
}

// The lines of the text, each with its number; the first is 1.
template <class Each>
void each_line(std::string_view text, Each&& each) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  for (std::size_t begin = 0, number = 1; begin < text.size(); number++) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    each(trimmed(text.substr(begin, end - begin)), number);
    begin = end + 1;
  }
}

struct Lines {
  const std::string& where;

  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw Error(where + ", line " + std::to_string(line) + ": " + what);
  }
  double number(std::string_view text, std::size_t line) const {
    double value = 0;
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || code != std::errc() || end != text.data() + text.size())
      fail(line, "\"" + excerpt(text) + "\" is not a number");
    return value;
  }
  void sphere(Part& part, const std::vector<std::string_view>& c, const std::array<std::size_t, 4>& at,
              std::size_t line) const {
    part.centers.emplace_back(number(c[at[0]], line), number(c[at[1]], line), number(c[at[2]], line));
    part.radii.push_back(number(c[at[3]], line));
  }
  void x_y_z_r(Part& part, const std::vector<std::string_view>& c, std::size_t line) const {
    if (c.size() != 4) fail(line, "four numbers are wanted");
    sphere(part, c, {0, 1, 2, 3}, line);
  }
};

std::vector<std::uint32_t> bits(const Npz& arrays, const char* name, std::size_t n,
                                const std::string& where) {
  const auto it = arrays.find(name);
  if (it == arrays.end()) return {};
  return whole_numbers(it->second, n, where + ": " + name);
}

}  // namespace

Content read_csv(std::string_view text, const std::string& where) {
  Parts parts(1);
  const Lines lines{where};
  bool header = false;
  each_line(text, [&](std::string_view line, std::size_t number) {
    if (line.empty() || line.front() == '#') return;
    const auto c = columns(line, true);
    if (!header) {
      if (c != std::vector<std::string_view>{"x", "y", "z", "r"})
        lines.fail(number, "the header must be x,y,z,r");
      header = true;
      return;
    }
    lines.x_y_z_r(parts[0], c, number);
  });
  return {std::move(parts)};
}

// LIGGGHTS: x y z r and # comments. YADE says its columns in the first line.
Content read_list(std::string_view text, const std::string& where) {
  const Lines lines{where};
  std::map<std::string, Part> parts;
  std::array<std::size_t, 4> at{0, 1, 2, 3};
  std::size_t wanted = 4, clump = 4;
  each_line(text, [&](std::string_view line, std::size_t number) {
    if (number == 1 && line.starts_with("#format ")) {
      std::map<std::string, std::size_t, std::less<>> names;
      std::string_view words = trimmed(line.substr(8));
      wanted = 0;
      while (!words.empty()) {
        const std::size_t end = std::min(words.find('_'), words.size());
        names.emplace(words.substr(0, end), wanted++);
        words.remove_prefix(std::min(end + 1, words.size()));
      }
      for (std::size_t k = 0; k < 4; k++) {
        const auto it = names.find(std::string_view("xyzr").substr(k, 1));
        if (it == names.end()) lines.fail(1, "the format must name x, y, z and r");
        at[k] = it->second;
      }
      const auto it = names.find("clumpId");
      clump = it == names.end() ? wanted : it->second;
      return;
    }
    if (line.empty() || line.front() == '#') return;
    const auto c = columns(line, false);
    if (c.size() != wanted)
      lines.fail(number,
                 std::to_string(wanted) + " numbers are wanted, and there are " + std::to_string(c.size()));
    const std::string name = clump < wanted ? std::string(c[clump]) : "";
    Part& part = parts[name];
    part.name = name;
    lines.sphere(part, c, at, number);
  });
  Parts out;
  for (auto& [name, part] : parts) out.push_back(std::move(part));
  if (out.size() == 1) out[0].name.clear();  // one clump: the file's name is a better name than a number
  return {std::move(out)};
}

std::filesystem::path mercury_spheres(const std::filesystem::path& folder) {
  std::error_code code;
  for (const char* name : {"Clump/Clump.txt", "clump/clump.txt"})  // the latter of earlier versions
    if (std::filesystem::exists(folder / name, code)) return folder / name;
  return {};
}

Content read_mercury(const std::filesystem::path& folder) {
  const std::filesystem::path file = mercury_spheres(folder);
  if (file.empty())
    throw Error(folder.string() +
                " is a folder without Clump/Clump.txt: name a file, or the folder of a MercuryDPM clump");
  const std::string where = file.string(), text = read_file(file);
  Parts parts(1);
  const Lines lines{where};
  parts[0].name =
      std::filesystem::absolute(folder / ".").lexically_normal().parent_path().filename().string();
  each_line(text, [&](std::string_view line, std::size_t number) {
    if (!line.empty()) lines.x_y_z_r(parts[0], columns(line, true), number);
  });
  return {std::move(parts)};
}

Parts parts_by_body(Part all, const std::vector<std::uint32_t>& body) {
  if (body.empty()) return {std::move(all)};
  std::map<std::uint32_t, Part> parts;
  for (std::size_t k = 0; k < body.size(); k++) {
    Part& p = parts[body[k]];
    p.name = std::to_string(body[k]);
    p.centers.push_back(all.centers[k]), p.radii.push_back(all.radii[k]);
    if (!all.family.empty()) p.family.push_back(all.family[k]);
    if (!all.mask.empty()) p.mask.push_back(all.mask[k]);
  }
  Parts out;
  for (auto& [name, part] : parts) out.push_back(std::move(part));
  return out;
}

Content read_npz(std::string_view bytes, const std::string& where) {
  const Npz arrays = npz_from_bytes(bytes, where);
  const auto array = [&](const char* name) -> const NpyArray& {
    const auto it = arrays.find(name);
    if (it == arrays.end()) throw Error(where + ": there is no array called " + name);
    return it->second;
  };
  const NpyArray& centers = array("centers");
  Part all;
  all.radii = array("radii").as<double>();
  const std::size_t n = all.radii.size();
  if (centers.shape != std::vector<std::uint64_t>{n, 3})
    throw Error(where + ": centers must be of the shape (" + std::to_string(n) +
                ", 3), three for each of radii");
  const std::vector<double> xyz = centers.as<double>();
  for (std::size_t k = 0; k < n; k++) all.centers.emplace_back(xyz[3 * k], xyz[3 * k + 1], xyz[3 * k + 2]);
  all.family = bits(arrays, "family", n, where), all.mask = bits(arrays, "mask", n, where);
  Content out{parts_by_body(std::move(all), bits(arrays, "body", n, where))};
  if (const auto unit = arrays.find(kUnitInMetres); unit != arrays.end())
    out.unit = unit_of(unit->second.as<double>(), where);
  return out;
}

}  // namespace padder::importing
