// SPDX-License-Identifier: MIT
// Every reader of files. What one returns must be sound: indices in range, numbers finite where that is
// promised, and a cluster that is written reads back as the same cluster. An Error must be a sentence of sane
// length.

#include <array>
#include <cmath>
#include <filesystem>

#include "detect/scene/loose.h"
#include "detect/scene/scene.h"
#include "padding/asset/child.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/import/readers.h"
#include "padding/input/read.h"
#include "padding/input/read_internal.h"
#include "padding/robots/mjcf.h"
#include "padding/robots/urdf.h"
#include "tests/fuzz/targets.h"
#include "tests/temporary_folder.h"

namespace padder::fuzz {
namespace {

namespace fs = std::filesystem;

template <class Work>
void expect_answer(const Work& work) {
  try {
    read_here(true);  // so that the fuzzer sees which branches an input takes
    work();
  } catch (const Error& e) {
    const std::string said = e.what();
    if (said.size() < 10 || said.size() > 6000)
      wrong("an Error of " + std::to_string(said.size()) + " bytes");
    if (said.find('\n') != std::string::npos) wrong("an Error of several lines: " + said);
  }
}

// A folder of this process, for readers that take a path.
const fs::path& folder() {
  static const TemporaryFolder made;
  return made.path();
}

fs::path put(std::string_view bytes, const char* name) {
  write_file(folder() / name, bytes);
  return folder() / name;
}

void check(const Mesh& mesh) {
  if (mesh.triangles.empty()) wrong("a mesh without triangles");
  for (const Point& p : mesh.points)
    if (!p.allFinite()) wrong("a point that is not finite");
  for (const auto& t : mesh.triangles)
    for (const auto v : t)
      if (v >= mesh.points.size()) wrong("a triangle names a point that is not there");
}

void check(const Cluster& c) {
  if (c.centers.size() != c.size()) wrong("centres and radii differ in number");
  for (std::size_t k = 0; k < c.size(); k++)
    if (!c.centers[k].allFinite() || !std::isfinite(c.radii[k]) || !(c.radii[k] > 0))
      wrong("sphere " + std::to_string(k) + " is none");
}

// The formats that are read here, with the triangulation behind the reader.
template <const char* Ending>
void read_format(std::string_view bytes) {
  expect_answer([&] {
    std::string own(bytes);
    check(reading::parse(own, {}, "file", Ending).mesh);
  });
}
constexpr char kObj[] = ".obj", kOff[] = ".off", kPly[] = ".ply", k3mf[] = ".3mf", kStl[] = ".stl",
               kMsh[] = ".msh";

// Files that assimp reads, the format told by the first bytes: what is looked at before assimp sees them,
// where the fuzzer sees the branches, and then the whole file in a child, where a crash of assimp is a
// sentence. What comes back must be sound.
void read_by_assimp(std::string_view bytes) {
  const std::string name = bytes.starts_with("glTF")      ? "a.glb"
                           : bytes.starts_with("{")       ? "a.gltf"
                           : bytes.starts_with("<")       ? "a.dae"
                           : bytes.starts_with("Kaydara") ? "a.fbx"
                           : bytes.starts_with("; FBX")   ? "a.fbx"
                                                          : "a.3ds";
  expect_answer([&] {
    if (name == "a.gltf" || name == "a.glb") {
      std::string text(bytes);
      std::vector<std::string> notes;
      reading::check_gltf(text, "file", name.substr(1), notes);
    }
    read_here(false);
    check(read_mesh(put(bytes, name.c_str())).mesh);
  });
}

// Robots, and the spheres that such a file may hold instead.
template <RobotTree (*Read)(const std::filesystem::path&, const RobotReadOptions&), const char* Name>
void read_robot_file(std::string_view bytes) {
  expect_answer([&] {
    RobotTree robot = Read(put(bytes, Name), {});
    if (robot.links.size() != robot.model.bodies.size()) wrong("links and bodies differ in number");
    keep_neighbours_apart(robot);
  });
  expect_answer([&] { importing::read_xml(std::string(bytes), "file"); });
}
constexpr char kUrdf[] = "a.urdf", kMjcf[] = "a.xml";

void read_cluster_json(std::string_view bytes) {
  expect_answer([&] {
    const Cluster c = cluster_from_json(bytes, "file");
    check(c);
    const std::string text = to_json(c);
    if (to_json(cluster_from_json(text, "its own")) != text) wrong("a cluster does not come back");
  });
}

void check_input(const detect::Scene& scene) {
  const detect::Input input = scene.input();
  if (scene.size() > 100000) return;
  detect::CallOptions options;
  options.threads = 1;
  detect::Detector({detect::BackendKind::omp}, options).detect(input);
}
void read_scene(std::string_view bytes) {
  expect_answer([&] { check_input(detect::scene_from_json(bytes, "file", folder())); });
}

template <detect::LooseSpheres (*Read)(std::string_view, const std::string&)>
void read_loose(std::string_view bytes) {
  expect_answer([&] {
    const detect::LooseSpheres loose = Read(bytes, "file");
    for (const std::size_t n : {loose.family.size(), loose.mask.size(), loose.world.size()})
      if (n != 0 && n != loose.size()) wrong("an array has not one number for each sphere");
  });
}

template <auto Read>
void import_parts(std::string_view bytes) {
  expect_answer([&] {
    const std::string own(bytes);
    for (const importing::Part& part : Read(own, "file").parts)
      if (part.centers.size() != part.radii.size()) wrong("centres and radii differ in number");
  });
}

// Both readers of NumPy's archives, and all of lines of numbers.
void read_npz(std::string_view bytes) {
  read_loose<detect::loose_from_npz>(bytes), import_parts<importing::read_npz>(bytes);
}
void read_lines(std::string_view bytes) {
  read_loose<detect::loose_from_csv>(bytes), import_parts<importing::read_csv>(bytes),
      import_parts<importing::read_list>(bytes);
}

constexpr std::array<Target, 15> kReaders{{
    {"obj", read_format<kObj>, ".obj"},
    {"off", read_format<kOff>, ".off"},
    {"ply", read_format<kPly>, ".ply"},
    {"3mf", read_format<k3mf>, ".3mf"},
    {"stl", read_format<kStl>, ".stl"},
    {"msh", read_format<kMsh>, ".msh"},
    {"assimp", read_by_assimp, ".gltf .glb .dae .fbx .3ds"},
    {"urdf", read_robot_file<read_urdf, kUrdf>, ".urdf .srdf"},
    {"mjcf", read_robot_file<read_mjcf, kMjcf>, ".xml"},
    {"cluster", read_cluster_json, ".spheres.json"},
    {"scene", read_scene, ".scene.json"},
    {"npz", read_npz, ".npz"},
    {"lines", read_lines, ".csv .txt"},
    {"vtp", import_parts<importing::read_vtp>, ".vtp"},
    {"yaml", import_parts<importing::read_yaml>, ".yaml .xrdf"},
}};

}  // namespace

std::span<const Target> readers() { return kReaders; }

}  // namespace padder::fuzz
