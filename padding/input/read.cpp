// SPDX-License-Identifier: MIT
#include "padding/input/read.h"

#include <cmath>
#include <limits>
#include <span>

#include "padding/asset/child.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/input/polygon.h"
#include "padding/input/read_internal.h"

namespace padder {
namespace reading {

void check_counts(std::uint64_t points, std::uint64_t triangles, const std::string& where) {
  constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
  if (points > most || triangles > most)
    fail(where, "it holds " + std::to_string(points) + " points and " + std::to_string(triangles) +
                    " triangles, more than the 4294967295 that 32-bit indices name: split the mesh");
}

}  // namespace reading

namespace {

using reading::fail;
using reading::Soup;

// Splits the polygons into triangles. Keeps only the points that they use, which must be finite.
Mesh to_mesh(Soup& soup, const std::string& where, std::vector<std::string>& notes) {
  reading::check_counts(soup.points.size(),
                        soup.corners.size() - std::min(2 * soup.ends.size(), soup.corners.size()), where);
  std::vector<bool> used(soup.points.size(), false);
  for (const std::uint32_t v : soup.corners) {
    if (!used[v] && !soup.points[v].allFinite())
      fail(where, (soup.lines.empty() ? "" : reading::at_line(soup.lines[v])) + "vertex " +
                      std::to_string(v + 1) +
                      " (counted from 1), which a face uses, is not finite or too large to read: "
                      "mend its coordinates or remove its faces");
    used[v] = true;
  }
  Mesh mesh;
  std::vector<std::uint32_t> new_index(soup.points.size());
  for (std::size_t v = 0; v < used.size(); v++) {
    new_index[v] = static_cast<std::uint32_t>(mesh.points.size());
    if (used[v]) mesh.points.push_back(soup.points[v]);
  }
  if (const std::size_t unused = soup.points.size() - mesh.points.size())
    notes.push_back(counted(unused, "point that no face uses", "points that no face uses") + " left out");
  if (soup.thin) notes.push_back(counted(soup.thin, "face") + " of fewer than three corners left out");

  std::vector<Point> polygon;
  std::vector<std::array<std::uint32_t, 3>> pieces;
  std::uint64_t begin = 0;
  for (const std::uint64_t end : soup.ends) {
    const std::span<const std::uint32_t> corners(soup.corners.data() + begin, end - begin);
    begin = end;
    pieces.clear(), polygon.clear();
    if (corners.size() > 3)
      for (const std::uint32_t v : corners) polygon.push_back(soup.points[v]);
    if (corners.size() == 3)
      pieces.push_back({0, 1, 2});
    else
      triangulate_polygon(polygon, pieces);
    for (const auto& t : pieces)
      mesh.triangles.push_back(
          {new_index[corners[t[0]]], new_index[corners[t[1]]], new_index[corners[t[2]]]});
  }
  if (mesh.triangles.empty())
    fail(where, std::string("it holds no triangle") +
                    (soup.points.empty() ? "" : ", only " + counted(soup.points.size(), "point")) +
                    (soup.thin ? " and faces of fewer than three corners" : "") +
                    ": a mesh with faces is wanted");
  return mesh;
}

void apply_units(ReadResult& result, const ReadOptions& options, const std::string& where) {
  double factor = options.scale;
  const std::string own = result.unit;
  result.unit = options.unit.empty() && options.scale == 1 ? own : options.unit;
  if (!options.unit.empty() && !own.empty() && own != options.unit) {
    factor *= metres(own) / metres(options.unit);
    result.notes.push_back("converted from " + own + " to " + options.unit);
  }
  if (!own.empty() && result.unit.empty())
    result.notes.push_back("its lengths, in " + own +
                           ", were scaled and are in no unit that is known now: --unit " + own + " keeps it");
  if (factor == 1) return;
  for (Point& p : result.mesh.points) {
    p *= factor;
    if (!p.allFinite()) fail(where, "its coordinates overflow when they are scaled: choose a smaller scale");
  }
}

// Refuses what a download may have left in the place of the mesh.
void check_is_no_stand_in(const std::string& bytes, const std::string& where) {
  if (bytes.starts_with("version https://git-lfs"))
    fail(where, "it is a pointer of Git LFS, not the mesh: get the mesh with git lfs pull");
  const std::string start = lower_case(bytes.substr(0, 14));
  if (start.starts_with("<!doctype html") || start.starts_with("<html"))
    fail(where, "it is a web page, not a mesh: download the file itself");
}

}  // namespace

ReadResult reading::parse(std::string& bytes, const FilesBeside& beside, const std::filesystem::path& path,
                          const std::string& ending) {
  const std::string where = path.string();
  ReadResult result;
  Soup soup = ending == ".obj"   ? read_obj(bytes, where)
              : ending == ".off" ? read_off(bytes, where)
              : ending == ".ply" ? read_ply(bytes, where)
              : ending == ".stl" ? read_stl(bytes, where)
              : ending == ".3mf" ? read_3mf(bytes, where)
              : ending == ".msh" ? read_msh(bytes, where)
                                 : read_scene(bytes, beside, path, ending);
  bytes = {};
  std::ranges::move(soup.notes, std::back_inserter(result.notes));
  result.unit = soup.unit;
  result.mesh = to_mesh(soup, where, result.notes);
  return result;
}

ReadResult reading::mesh_from_child(const std::function<ReadResult()>& read, std::size_t file_size,
                                    const std::string& where) {
  ReadResult result;
  std::string notes;  // one line each
  Mesh& mesh = result.mesh;
  const auto send = [&](ChildPipe& pipe) {
    for (const std::string& note : result.notes) notes += note + '\n';
    return pipe.put_array(mesh.points) && pipe.put_array(mesh.triangles) && pipe.put_array(result.unit) &&
           pipe.put_array(notes);
  };
  const auto receive = [&](ChildPipe& pipe) {
    bool sound = pipe.get_array(mesh.points) && pipe.get_array(mesh.triangles) &&
                 pipe.get_array(result.unit) && pipe.get_array(notes);
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t corner : triangle) sound = sound && corner < mesh.points.size();
    Lines lines(notes);
    for (std::string_view note; lines.next(note);) result.notes.emplace_back(note);
    return sound;
  };
  in_child([&] { result = read(); }, send, receive, file_size, where);
  return result;
}

ReadResult read_mesh(const std::filesystem::path& path, const ReadOptions& options) {
  const std::string where = path.string();
  if (!(options.scale > 0 && std::isfinite(options.scale)))
    throw Error("the scale must be a positive number");
  metres(options.unit);  // throws if it is unknown
  const std::string ending = ending_of(path);
  if (!has_mesh_ending(path)) {
    if (std::error_code code; !std::filesystem::exists(path, code)) read_file(path);  // says so
    if (ending == ".sdf" || ending == ".world" || ending.starts_with(".usd"))
      fail(where, "robots and scenes are read from .urdf, .xacro and MJCF (.xml), not from " + ending +
                      ": convert it to one of these, or name its mesh files");
    if (ending == ".urdf" || ending == ".xacro")
      fail(where, "it is a robot, and a mesh is wanted: pad_robot takes it, pad_urdf in Python");
    std::string known;
    for (const std::string& e : mesh_endings()) known += (known.empty() ? "" : ", ") + e;
    fail(where, (ending.empty() ? "it has no ending" : "no mesh format is known by the ending " + ending) +
                    ": convert it to one of " + known);
  }

  std::string bytes = read_file(path);
  Provenance source;
  source.file = path.filename().string();
  source.sha256 = sha256(bytes);
  if (bytes.empty()) fail(where, "the file is empty: export the mesh again");
  check_is_no_stand_in(bytes, where);
  reading::FilesBeside beside;
  std::vector<std::string> notes;
  if (ending == ".gltf" || ending == ".glb") beside = reading::check_gltf(bytes, path, ending, notes);
  ReadResult result = reading::mesh_from_child([&] { return reading::parse(bytes, beside, path, ending); },
                                               bytes.size(), where);
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  result.source = std::move(source);
  result.source.triangles = result.mesh.triangles.size();
  apply_units(result, options, where);
  return result;
}

}  // namespace padder
