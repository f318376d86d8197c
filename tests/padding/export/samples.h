// SPDX-License-Identifier: MIT
// Clusters and a robot to export, a folder to do it in, and programs to show the result to.
#pragma once
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "padding/asset/file.h"
#include "padding/export/export.h"
#include "padding/import/import.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder::samples {

namespace fs = std::filesystem;

// A turned box with no two moments alike, away from the origin, and three overlapping spheres inside.
inline Cluster brick() {
  Cluster c;
  c.name = "brick";
  c.unit = "m";
  c.program = "padder test";
  c.source.file = "brick.obj";
  const Eigen::Isometry3d place =
      Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(0.7, Vector(1, 2, 3).normalized());
  const Mesh mesh =
      shapes::moved(shapes::box({-0.3, -0.2, -0.1}, {0.3, 0.2, 0.1}), place.linear(), place.translation());
  c.bounds = mesh.bounds();
  c.mass = mass_properties(mesh);
  for (const double x : {-0.2, 1 / 30., 0.2}) {
    c.centers.push_back(place * Point(x, 0.01, -0.02));
    c.radii.push_back(0.15 + x * x / 7);
    c.triangle.push_back(c.triangle.empty() ? 0 : c.triangle.back() + 1);
  }
  return c;
}

// An arm: base, upper (revolute), a frame without geometry (fixed), hand (fixed to it), finger (prismatic).
// Neighbours must not touch.
inline Model arm() {
  Model m;
  m.name = "arm";
  m.unit = "m";
  const auto add = [&](const char* name, int parent, Joint::Type type, double z, bool spheres) {
    Body b;
    b.name = name;
    b.parent = parent;
    b.pose = Eigen::Translation3d(0, 0, z) * Eigen::AngleAxisd(parent < 0 ? 0 : 0.3, Vector::UnitY());
    b.joint.name = std::string(name) + "_joint";
    b.joint.type = type;
    b.joint.axis = Vector(0, 1, 0);
    b.joint.lower = -0.5, b.joint.upper = 0.25;
    if (spheres) b.cluster = brick();
    b.cluster.name = name;
    m.bodies.push_back(std::move(b));
  };
  add("base", -1, Joint::Type::fixed, 0, true);
  add("upper", 0, Joint::Type::revolute, 0.5, true);
  add("frame", 1, Joint::Type::fixed, 0.5, false);
  add("hand", 2, Joint::Type::fixed, 0.1, true);
  add("finger", 3, Joint::Type::prismatic, 0.2, true);
  const auto family = [&](int body, std::uint32_t f, std::uint32_t mask) {
    m.bodies[static_cast<std::size_t>(body)].cluster.family = f;
    m.bodies[static_cast<std::size_t>(body)].cluster.mask = mask;
  };
  // base 1 - (upper, hand) 2 - finger 3
  family(0, 1, 0b010), family(1, 2, 0b101), family(3, 2, 0b101), family(4, 3, 0b010);
  return m;
}

inline Body body_of(const Model& model, const std::string& name) {
  return *std::ranges::find(model.bodies, name, &Body::name);
}

const std::string kTet = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

struct Ran {
  int status;
  std::string output;  // stdout and stderr
};
inline Ran run(const std::string& command) {
  Ran r{-1, ""};
  FILE* pipe = popen(("(" + command + ") 2>&1").c_str(), "r");
  if (!pipe) return r;
  std::array<char, 4096> part;
  for (std::size_t n; (n = fread(part.data(), 1, part.size(), pipe)) > 0;) r.output.append(part.data(), n);
  const int status = pclose(pipe);
  r.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128;
  return r;
}
inline bool have(const std::string& program) { return run("command -v " + program).status == 0; }
inline bool python_has(const std::string& module) {
  return run("'" PADDER_PYTHON "' -c 'import " + module + "'").status == 0;
}

class ExportTest : public testing::Test, protected TemporaryFolder {
 protected:
  // Written by the format of that name.
  fs::path write(const Model& model, const std::string& file, const std::string& format = {}) {
    write_model(model, folder_ / file, find_format(file, format));
    return folder_ / file;
  }
  std::string text(const Model& model, const std::string& file, const std::string& format = {}) {
    return read_file(write(model, file, format));
  }
  // In the folder of the test.
  Ran run_here(const std::string& command) const {
    return run("cd '" + folder_.string() + "' && " + command);
  }
  // What the Python script prints, without its last end of line.
  std::string python(const std::string& script) const {
    put("script.py", script);
    std::string said = run_here("'" PADDER_PYTHON "' script.py").output;
    if (said.ends_with('\n')) said.pop_back();
    return said;
  }
};

inline void expect_same_spheres(const Cluster& a, const Cluster& b, double tolerance = 0) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); k++) {
    EXPECT_LE((a.centers[k] - b.centers[k]).norm(), tolerance) << k;
    EXPECT_LE(std::abs(a.radii[k] - b.radii[k]), tolerance) << k;
  }
}

}  // namespace padder::samples
