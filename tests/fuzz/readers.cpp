// SPDX-License-Identifier: MIT
// Every reader of files. What one returns must be sound: indices in range, numbers finite where that is
// promised, and a cluster that is written reads back as the same cluster. An Error must be a sentence of sane
// length.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "detect/scene/loose.h"
#include "detect/scene/scene.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/import/import.h"
#include "padding/import/readers.h"
#include "padding/mjcf/mjcf.h"
#include "padding/input/read.h"
#include "padding/input/read_internal.h"
#include "padding/input/urdf.h"
#include "tests/fuzz/targets.h"

namespace padder::fuzz {
namespace {

namespace fs = std::filesystem;

template <class Work>
void expect_answer(const Work& work) {
  try {
    work();
  } catch (const Error& e) {
    const std::string said = e.what();
    if (said.size() < 10 || said.size() > 6000)
      wrong("an Error of " + std::to_string(said.size()) + " bytes");
    if (said.find('\n') != std::string::npos) wrong("an Error of several lines: " + said);
  }
}

// A folder of this process, for readers that take a path.
struct Folder {
  Folder() {
    std::string name = (fs::temp_directory_path() / "padder-fuzz-XXXXXX").string();
    if (!::mkdtemp(name.data())) wrong("no folder for files");
    path = name;
  }
  ~Folder() {
    std::error_code code;
    fs::remove_all(path, code);
  }
  fs::path path;
};
const fs::path& folder() {
  static const Folder made;
  return made.path;
}

fs::path put(std::string_view bytes, const char* name) {
  write_file(folder() / name, bytes);
  return folder() / name;
}

void check(const reading::Soup& soup) {
  for (const std::uint32_t v : soup.corners)
    if (v >= soup.points.size()) wrong("a corner names point " + std::to_string(v));
  if (!std::ranges::is_sorted(soup.ends) || (!soup.ends.empty() && soup.ends.back() > soup.corners.size()))
    wrong("faces end where there is no corner");
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

template <reading::Soup (*Read)(const std::string&, const std::string&)>
void read_soup(std::string_view bytes) {
  expect_answer([&] { check(Read(std::string(bytes), "file")); });
}
void read_obj(std::string_view bytes) {
  expect_answer([&] {
    std::string own(bytes);
    check(reading::read_obj(own, "file"));
  });
}
void check_stl(std::string_view bytes) {
  expect_answer([&] {
    std::string own(bytes);
    std::vector<std::string> notes;
    reading::check_stl(own, "file", notes);
  });
}

// Whole files, with the triangulation behind the reader. The formats of assimp run in a child there: a crash
// of assimp is a sentence here.
template <const char* Name>
void read_whole(std::string_view bytes) {
  expect_answer([&] { check(read_mesh(put(bytes, Name)).mesh); });
}
constexpr char kObj[] = "a.obj", kStl[] = "a.stl", kGltf[] = "a.gltf", kGlb[] = "a.glb", kDae[] = "a.dae";

void read_urdf_file(std::string_view bytes) {
  expect_answer([&] {
    Urdf urdf = read_urdf(put(bytes, "a.urdf"));
    if (urdf.links.size() != urdf.model.bodies.size()) wrong("links and bodies differ in number");
    keep_neighbours_apart(urdf);
  });
}

void read_mjcf_file(std::string_view bytes) {
  expect_answer([&] {
    const Urdf robot = read_mjcf(put(bytes, "a.xml"));
    if (robot.links.size() != robot.model.bodies.size()) wrong("links and bodies differ in number");
  });
}

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

template <const char* Name>
void import_file(std::string_view bytes) {
  expect_answer([&] { check(read_spheres(put(bytes, Name))); });
}
constexpr char kCsv[] = "i.csv", kNpz[] = "i.npz", kVtp[] = "i.vtp", kYaml[] = "i.yaml", kXml[] = "i.xml",
               kTxt[] = "i.txt";

constexpr std::array<Target, 22> kReaders{{
    {"obj", read_obj, ".obj"},
    {"off", read_soup<reading::read_off>, ".off"},
    {"ply", read_soup<reading::read_ply>, ".ply"},
    {"3mf", read_soup<reading::read_3mf>, ".3mf"},
    {"stl", check_stl, ".stl"},
    {"obj_file", read_whole<kObj>, ".obj"},
    {"stl_file", read_whole<kStl>, ".stl"},
    {"gltf_file", read_whole<kGltf>, ".gltf"},
    {"glb_file", read_whole<kGlb>, ".glb"},
    {"dae_file", read_whole<kDae>, ".dae"},
    {"urdf", read_urdf_file, ".urdf"},
    {"mjcf_robot", read_mjcf_file, ".xml"},
    {"cluster", read_cluster_json, ".spheres.json"},
    {"scene", read_scene, ".scene.json"},
    {"loose_npz", read_loose<detect::loose_from_npz>, ".npz"},
    {"loose_csv", read_loose<detect::loose_from_csv>, ".csv"},
    {"import_csv", import_file<kCsv>, ".csv"},
    {"import_npz", import_file<kNpz>, ".npz"},
    {"import_vtp", import_file<kVtp>, ".vtp"},
    {"import_yaml", import_file<kYaml>, ".yaml .xrdf"},
    {"import_xml", import_file<kXml>, ".xml .srdf .urdf"},
    {"import_list", import_file<kTxt>, ".txt"},
}};

}  // namespace

std::span<const Target> readers() { return kReaders; }

}  // namespace padder::fuzz
