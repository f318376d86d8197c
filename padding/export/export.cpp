// SPDX-License-Identifier: MIT
#include "padding/export/export.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <deque>
#include <string_view>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/export/new_folders.h"
#include "padding/export/writers.h"

namespace padder {
namespace {

using exporting::Files;
using exporting::Job;
namespace fs = std::filesystem;

struct Entry {
  Format format;
  Files (*write)(const Job&);
};

using F = Format::Filter;
constexpr std::array<Entry, 18> kEntries{{
    {{"dem-engine", ".csv", true, "DEM-Engine", F::none, 0, false, false, true}, exporting::write_csv},
    {{"liggghts", ".txt", false, "LIGGGHTS", F::none, 0, false, false, false}, exporting::write_liggghts},
    {{"yade", ".txt", false, "YADE", F::none, 0, false, false, false}, exporting::write_yade},
    {{"mercury", "", false, "MercuryDPM", F::none, 0, false, false, true}, exporting::write_mercury},
    {{"chrono", ".h", false, "Chrono", F::bits, kChronoFamilies, true, false, true}, exporting::write_chrono},
    {{"npz", ".npz", true, "NumPy", F::numbers, 0, true, false, false}, exporting::write_npz},
    {{"vtp", ".vtp", true, "VTK and ParaView", F::numbers, 0, true, false, false}, exporting::write_vtp},
    {{"glb", ".glb", true, "glTF viewers", F::numbers, 0, true, true, false}, exporting::write_glb},
    {{"glb-instanced", ".glb", false, "glTF viewers that draw instances", F::numbers, 0, true, true, false},
     exporting::write_glb_instanced},
    {{"stl", ".stl", true, "mesh programs", F::ignored, 0, true, false, false}, exporting::write_stl},
    {{"ply", ".ply", true, "mesh programs", F::ignored, 0, true, false, false}, exporting::write_ply},
    {{"obj", ".obj", true, "mesh programs", F::ignored, 0, true, false, false}, exporting::write_obj},
    {{"urdf", ".urdf", true, "ROS", F::pairs, 0, true, true, false}, exporting::write_urdf},
    {{"mujoco", ".xml", true, "MuJoCo", F::both, kMujocoFamilies, true, true, false},
     exporting::write_mujoco},
    {{"curobo", ".yaml", true, "cuRobo", F::pairs, 0, true, true, false}, exporting::write_curobo},
    {{"xrdf", ".xrdf", true, "Isaac cuMotion", F::pairs, 0, true, true, false}, exporting::write_xrdf},
    {{"srdf", ".srdf", true, "MoveIt", F::pairs, 0, true, true, false}, exporting::write_srdf},
    {{"usd", ".usda", true, "USD", F::pairs, 0, true, false, false}, exporting::write_usda},
}};

const std::vector<Format>& table() {
  static const auto all = [] {
    std::vector<Format> list;
    for (const Entry& e : kEntries) list.push_back(e.format);
    return list;
  }();
  return all;
}

// Every pair that may not touch: of families and masks, and those that the model lists.
std::vector<std::pair<std::size_t, std::size_t>> pairs_apart(const Model& model) {
  auto pairs = filtered_pairs(exporting::filters_of(model));
  for (const Apart& p : model.apart) pairs.push_back(std::minmax(p.a, p.b));
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

// Pairs of neighbours that the families and masks do not keep apart.
std::size_t neighbours_beyond_families(const Model& model) {
  const std::vector<CollisionFilter> filters = exporting::filters_of(model);
  return static_cast<std::size_t>(std::ranges::count_if(model.apart, [&](const Apart& p) {
    return p.reason == Apart().reason && may_touch(filters[p.a], filters[p.b]);
  }));
}

// The longest chain of bodies that hang on each other.
std::size_t deepest(const Model& model) {
  std::vector<std::size_t> depth;
  for (const Body& b : model.bodies)
    depth.push_back(b.parent < 0 ? 1 : depth[static_cast<std::size_t>(b.parent)] + 1);
  return depth.empty() ? 0 : *std::ranges::max_element(depth);
}

// MuJoCo reads XML of fewer than 500 elements inside each other, and up to version 2.2 of fewer than 100.
// Three of them are not bodies.
constexpr std::size_t kMujocoDeepest = 496, kOldMujocoDeepest = 96;

// Does a body stand inside the one that it hangs on?
bool nested(const Format& format) { return std::string_view(format.name) == "mujoco"; }

constexpr const char* kNoFilter = "take family 0 and mask 0 (--family 0 --mask 0)";

void check(const Model& model, const Format& format, const std::string& where) {
  const auto fail = [&](const std::string& what) { throw Error("cannot write " + where + ": " + what); };
  if (model.spheres() == 0) fail("there is no sphere in it");
  if (nested(format) && deepest(model) > kMujocoDeepest)
    fail("its bodies hang on each other in a chain of " + std::to_string(deepest(model)) +
         ", and MuJoCo reads " + std::to_string(kMujocoDeepest) +
         " at most: write another format, or shorten the chain");
  check_filters(model, format);
  const auto with_spheres = std::count_if(model.bodies.begin(), model.bodies.end(),
                                          [](const Body& b) { return b.cluster.size() > 0; });
  for (const Body& b : model.bodies) {
    const Cluster& c = b.cluster;
    const std::string name = b.name.empty() ? "a body without a name" : b.name;
    if (c.centers.size() != c.size()) fail(name + " has not one radius for each centre");
    for (std::size_t k = 0; k < c.size(); k++)
      if (!c.centers[k].allFinite() || !std::isfinite(c.radii[k]) || !(c.radii[k] > 0))
        fail("sphere " + std::to_string(k) + " of " + name + " is not finite or has no positive radius");
    if (format.mass_frame && c.size() > 0 && !(c.mass.volume > 0))
      fail(name + " has no volume (an open sheet, or spheres without a mesh), and " + format.program +
           " wants mass and moments: close the mesh, or pad it with --repair wrap");
    if (exporting::states_mass(format) && !b.inertial && c.mass.volume > 0 && !possible(c.mass))
      fail("no body has the mass properties of " + name +
           " (moments below 0, axes that are no rotation, or an inertia of others): pad its mesh again");
    if (format.filter == F::none && (c.family != 0 || c.mask != 0))
      fail(name + " has a family or a mask, which the file cannot hold (" + format.program +
           " sets who may touch whom in its own script): " + kNoFilter);
    // A robot's families only say which of its links may touch, and the file says that in its own way.
    if (format.filter == F::pairs && with_spheres == 1 && !model.robot() && (c.family != 0 || c.mask != 0))
      fail(name + " has a family or a mask, which the file cannot hold (" + format.program +
           " names pairs of bodies in one file, and there is one): " + kNoFilter +
           ", or write .spheres.json, .npz, .vtp, .xml or Chrono's header");
    if ((format.filter == F::bits || format.filter == F::both) && with_spheres == 1 && !model.robot() &&
        c.family > static_cast<std::uint32_t>(format.bits))
      fail(name + " is of family " + std::to_string(c.family) + ", and " + format.program +
           " has bits for families 1 to " + std::to_string(format.bits) + ": take one of those (--family)");
  }
}

// One sentence for each body whose mass is that of a wrap around the mesh. Such a mass can be far from the
// mass of the body itself.
std::vector<std::string> mass_warnings(const Model& model, const Format& format) {
  std::vector<std::string> out;
  if (!exporting::states_mass(format)) return out;
  for (const Body& b : model.bodies)
    if (b.cluster.size() > 0 && b.cluster.mass_of == SurfaceKind::wrap && !b.inertial &&
        b.cluster.mass.volume > 0)
      out.push_back("the mass and moments of " + b.name + " for " + format.program +
                    " are those of a wrap around the mesh, which is no closed body, and can be far from the "
                    "true ones: set them by hand, or mend the mesh");
  return out;
}

}  // namespace

std::span<const Format> formats() { return table(); }

const Format& find_format(const fs::path& path, const std::string& name) {
  std::string known;
  for (const Format& f : table()) {
    if (name.empty() ? (f.own_ending && ending_of(path) == f.ending) : name == f.name) return f;
    if (name.empty() && f.own_ending) known += std::string(known.empty() ? "" : " ") + f.ending;
    if (!name.empty()) known += std::string(known.empty() ? "" : " ") + f.name;
  }
  if (name.empty())
    throw Error("cannot tell the format of " + path.string() + ": end it with .spheres.json or one of " +
                known);
  throw Error("no format is called \"" + name + "\": there are " + known);
}

void check_filters(const Model& model, const Format& format) {
  const std::string where = "cannot write " + model.name + " for " + format.program + ": ";
  if (!format.several && model.bodies.size() > 1)
    throw Error(where + "it takes one body a file and there are " + std::to_string(model.bodies.size()) +
                ": write each as .spheres.json (-o FOLDER/), and these one by one");
  if (format.filter != F::bits) return;
  if (const std::size_t n = neighbours_beyond_families(model); n > 0)
    throw Error(where + "its families cannot keep " + std::to_string(n) +
                " pairs of neighbours apart; write a format that lists pairs, as .xml for MuJoCo or .urdf");
  if (!chrono_bits(exporting::filters_of(model)))
    throw Error(where + "its bodies are told apart by more than the " + std::to_string(format.bits) +
                " families that " + format.program + " has for them");
}

std::vector<std::string> write_model(const Model& model, const fs::path& path, const Format& format,
                                     const ExportOptions& options) {
  check(model, format, path.string());
  if (!(options.density > 0) || !std::isfinite(options.density)) throw Error("the density must be positive");
  Model converted =
      scaled(model, format.in_metres ? metres(model.unit) : 1, format.in_metres ? "m" : model.unit);
  if (!converted.robot()) {  // the names are those of files, which hold any bytes
    converted.name = excerpt(converted.name, std::string::npos);
    for (Body& b : converted.bodies) b.name = excerpt(b.name, std::string::npos);
  }
  Job job{converted, options, {}};
  if (format.filter == F::pairs || format.filter == F::both) job.pairs = pairs_apart(model);
  const auto entry = std::find_if(kEntries.begin(), kEntries.end(), [&](const Entry& e) {
    return std::string_view(e.format.name) == format.name;
  });
  if (entry == kEntries.end()) throw Error("no format is called \"" + std::string(format.name) + "\"");
  NewFolders folders;              // outlive the writers, which remove what is half-written
  std::deque<FileWriter> writers;  // all are written before the first is put in its place
  for (const auto& [name, bytes] : entry->write(job)) {
    fs::path file = path;
    if (name.starts_with('*')) {  // beside, with another ending
      file.replace_extension(name.substr(1));
    } else if (!name.empty()) {
      file /= name;
      folders.make(file.parent_path());
    }
    writers.emplace_back(file).append(bytes);
  }
  for (FileWriter& writer : writers) writer.commit();
  std::vector<std::string> warnings = mass_warnings(model, format);
  const auto ball =
      std::ranges::find(model.bodies, Joint::Type::ball, [](const Body& b) { return b.joint.type; });
  if (std::string_view(format.name) == "urdf" && model.urdf.empty() && ball != model.bodies.end())
    warnings.push_back("URDF has no ball joint: in " + path.string() + " " + excerpt(ball->joint.name) +
                       " and any other one are floating joints, whose links may also move away");
  if (std::string_view(format.name) == "urdf")
    if (const auto joints = exporting::joints_with_unknown_limits(model); !joints.empty())
      warnings.push_back("nobody states how fast or how strong some joints may be, so " + path.string() +
                         " says 1e6, without a limit: set effort and velocity of " + excerpt(joints[0]) +
                         (joints.size() > 1 ? " and " + std::to_string(joints.size() - 1) + " more" : ""));
  if (std::string_view(format.name) == "curobo" && model.robot() && model.bodies.size() > 1 &&
      options.urdf.empty() && exporting::urdf_of(model, options) != model.file)
    warnings.push_back(path.string() + " names " + exporting::urdf_of(model, options) +
                       ", which cuRobo needs beside it: write it, too, with another -o");
  if (const std::size_t n = neighbours_beyond_families(model); n > 0 && format.filter == F::numbers)
    warnings.push_back(model.name + " has more moving parts than 32 families can tell apart: in " +
                       path.string() + " " + std::to_string(n) + " pairs of neighbours may touch");
  if (nested(format) && deepest(model) > kOldMujocoDeepest)
    warnings.push_back("the bodies of " + model.name + " hang on each other in a chain of " +
                       std::to_string(deepest(model)) + ": MuJoCo 2.2 reads " +
                       std::to_string(kOldMujocoDeepest) + " at most");
  return warnings;
}

namespace exporting {

bool states_mass(const Format& format) {
  const std::string_view stating[] = {"dem-engine", "yade", "mercury", "chrono", "urdf", "mujoco", "usd"};
  return std::find(std::begin(stating), std::end(stating), format.name) != std::end(stating);
}

std::string urdf_of(const Model& model, const ExportOptions& options) {
  const std::string ending = fs::path(model.file).extension().string();
  if (ending == ".urdf" || ending == ".URDF") return model.file;
  if (!options.urdf.empty()) return options.urdf;
  const std::string stem = model.file.empty() ? model.name : fs::path(model.file).stem().string();
  return stem.ends_with(".urdf") ? stem : stem + ".urdf";  // NAME.urdf.xacro
}

bool is_world(const Model& model, int body) {
  if (body < 0 || !model.robot()) return false;
  const Body& b = model.bodies[static_cast<std::size_t>(body)];
  return b.parent < 0 && b.name == "world" && b.pose.matrix().isIdentity(0);
}

void check_floats(const Body& body, const Eigen::Isometry3d& pose, const char* ending) {
  const Cluster& c = body.cluster;
  for (std::size_t k = 0; k < c.size(); k++) {
    const double reach = (pose * c.centers[k]).cwiseAbs().maxCoeff() + c.radii[k];
    const bool is_held =
        std::isfinite(static_cast<float>(reach)) && std::isnormal(static_cast<float>(c.radii[k]));
    if (!is_held)
      throw Error(std::string("a ") + ending + " holds numbers as float32, which cannot hold sphere " +
                  std::to_string(k) + " of " + excerpt(body.name) + ", of radius " + number(c.radii[k]) +
                  ": give the mesh a --unit or a --scale");
  }
}

std::string number(double value) {
  if (value == 0) return "0";  // not -0
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

std::string numbers(const Vector& v, const char* between) {
  return number(v.x()) + between + number(v.y()) + between + number(v.z());
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : one_line(text)) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 32) c = ' ';
  return text;
}

std::string identifier(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    const bool digit = c >= '0' && c <= '9';
    if (digit && out.empty()) out = "_";
    out += letter || digit ? c : '_';
  }
  return out.empty() ? "_" : out;
}

std::vector<CollisionFilter> filters_of(const Model& model) {
  std::vector<CollisionFilter> filters;
  for (const Body& b : model.bodies) filters.push_back({b.cluster.family, b.cluster.mask});
  return filters;
}

std::vector<std::string> identifiers(const Model& model) {
  std::vector<std::string> out;
  for (const Body& b : model.bodies) {
    const std::string base = identifier(b.name);
    std::string name = base;
    for (int k = 2; std::find(out.begin(), out.end(), name) != out.end(); k++)
      name = base + "_" + std::to_string(k);
    out.push_back(name);
  }
  return out;
}

std::string origin(const Model& model) {
  std::string inside;
  if (!model.bodies.empty()) {
    const Cluster& c = model.bodies[0].cluster;
    inside = c.program;
    if (model.bodies.size() == 1 && !c.source.file.empty())
      inside += (inside.empty() ? "from " : ", from ") + c.source.file;
  }
  return excerpt(model.name + (inside.empty() ? "" : " (" + inside + ")"), std::string::npos);
}

std::vector<Point> centers_in_mass_frame(const Cluster& c) {
  std::vector<Point> out;
  out.reserve(c.size());
  for (const Point& p : c.centers) out.push_back(c.mass.axes.transpose() * (p - c.mass.center));
  return out;
}

}  // namespace exporting
}  // namespace padder
