// SPDX-License-Identifier: GPL-3.0-or-later
// Padding on hard meshes: what comes out, and whether that is right. Each mesh has a process of its own with
// a limit of time and memory, so a crash or an endless loop is a row of the table. The gap is measured once
// more: by points of the input, and all balls. With a folder, the meshes are written there as well, for
// tools/survey, which audits both errors from outside.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>

#include "padding/asset/error.h"
#include "padding/meshing/write_mesh.h"
#include "padding/pad.h"
#include "tools/bench/bench.h"
#include "tools/bench/stability/hard_meshes.h"

namespace padder::bench {
namespace {

constexpr double kSeconds = 300;        // a mesh may take
constexpr std::size_t kSamples = 4000;  // points of the input

// The largest distance of points of the mesh to the union of the balls: all corners of the first triangles,
// and points at random.
double sampled_gap(const Mesh& mesh, const Cluster& c) {
  detect::SplitMix64 random(1);
  double largest = 0;
  for (std::size_t k = 0; k < kSamples; k++) {
    const std::size_t t = k < mesh.triangles.size() ? k : random.bits() % mesh.triangles.size();
    double u = random.unit(), v = random.unit();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    if (k % 2) u = v = 0;
    const Point a = mesh.corner(t, 0), p = a + u * (mesh.corner(t, 1) - a) + v * (mesh.corner(t, 2) - a);
    double least = INFINITY;
    for (std::size_t b = 0; b < c.size(); b++)
      least = std::min(least, (p - c.centers[b]).norm() - c.radii[b]);
    largest = std::max(largest, least);
  }
  return largest;
}

const char* kind_of(BodyKind kind) {
  return kind == BodyKind::solid ? "solid" : kind == BodyKind::wrap ? "wrap" : "sheet";
}

Json padded(const HardMesh& hard, const Mesh& mesh, double tolerance) {
  ReadResult file;
  file.mesh = mesh;
  file.source.file = hard.name, file.source.triangles = mesh.triangles.size();
  PadOptions options;
  options.tolerance = Length::share(tolerance), options.effort = 0;
  Json row;
  const double seconds = seconds_of([&] {
    try {
      const Padded p = pad(file, options);
      const Accuracy& a = p.cluster.accuracy;
      const double d = p.report.diagonal;
      row = {{"spheres", p.cluster.size()},    {"protrusion", a.protrusion_max / d},
             {"gap", a.gap_max / d},           {"gap_sampled", sampled_gap(mesh, p.cluster) / d},
             {"kind", kind_of(p.report.kind)}, {"certified", a.certified},
             {"within", p.report.within},      {"reason", p.report.reason}};
    } catch (const Error& e) {
      row = {{"sentence", e.what()}};
    }
  });
  row["seconds"] = seconds;
  return row;
}

// The row as a child process makes it, or what became of the child.
Json in_child(const std::function<Json()>& work) {
  int ends[2];
  if (::pipe(ends) != 0) throw Error(std::string("no pipe: ") + std::strerror(errno));
  const pid_t child = ::fork();
  if (child < 0) throw Error(std::string("no process: ") + std::strerror(errno));
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it ends with whoever waits for it
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers reserve terabytes
    constexpr rlim_t most = rlim_t(8) << 30;                         // bytes a mesh may take
    const rlimit memory = {most, most};
    ::setrlimit(RLIMIT_DATA, &memory);
#endif
    ::alarm(static_cast<unsigned>(kSeconds));
    std::string text;
    try {
      text = work().dump();
    } catch (const std::exception& e) {
      text = Json({{"fault", std::string("unexpected: ") + e.what()}}).dump();
    }
    const bool sent = ::write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size());
    ::_exit(sent ? 0 : 1);
  }
  ::close(ends[1]);
  std::string text;
  char piece[4096];
  for (ssize_t n; (n = ::read(ends[0], piece, sizeof piece)) > 0;)
    text.append(piece, static_cast<std::size_t>(n));
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFSIGNALED(status))
    return {{"fault", WTERMSIG(status) == SIGALRM ? "no answer after " + number(kSeconds, "%g s")
                                                  : "ended by signal " + std::to_string(WTERMSIG(status))}};
  return Json::parse(text);
}

// A certified answer must also hold at the points that were looked at.
bool right(const HardMesh& hard, const Json& row, double tolerance) {
  if (row.contains("fault")) return false;
  if (row.contains("sentence")) return hard.right == Right::refused;
  const double slack = 1e-9 + tolerance * 1e-6;
  if (hard.right == Right::not_certified) return !row["certified"].get<bool>();
  return hard.right == Right::certified && row["certified"].get<bool>() && row["within"].get<bool>() &&
         row["protrusion"] <= tolerance + slack && row["gap_sampled"] <= row["gap"].get<double>() + slack;
}

Json cells_of(const HardMesh& hard, const Json& row) {
  std::string got, tail = row.value("right", false) ? "" : " **wrong**";
  if (row.contains("fault"))
    return {hard.name, hard.hard, "", "", "", "", "", row["fault"].get<std::string>() + tail};
  if (row.contains("sentence"))
    return {hard.name,
            hard.hard,
            "",
            "",
            "",
            "",
            number(row["seconds"], "%.2f"),
            "refused: " + row["sentence"].get<std::string>() + tail};
  if (!row["certified"].get<bool>()) got = "not certified: " + row["reason"].get<std::string>();
  return {hard.name,
          hard.hard,
          std::to_string(row["triangles"].get<std::size_t>()),
          std::to_string(row["spheres"].get<std::size_t>()),
          number(100 * row["protrusion"].get<double>(), "%.3f"),
          number(100 * row["gap"].get<double>(), "%.3f"),
          number(row["seconds"], "%.2f"),
          (got.empty() ? "certified, " + row["kind"].get<std::string>() : got) + tail};
}

}  // namespace

Json hard(const Settings& s) {
  std::vector<std::string> names;
  for (const HardMesh& hard : hard_meshes()) names.push_back(hard.name);
  check_scene(s, "hard", names);
  Json rows = Json::array(), table = Json::array({{"mesh", "what is hard", "triangles", "spheres",
                                                   "protrusion <= [%]", "gap <= [%]", "s", "what we get"}});
  bool passed = true;
  for (const HardMesh& hard : hard_meshes()) {
    if (!s.scene.empty() && s.scene != hard.name) continue;
    say(s, hard.name);
    const double tolerance = hard.tolerance;
    const Mesh mesh = hard.make();
    if (!s.folder.empty()) {
      std::filesystem::create_directories(s.folder / "meshes");
      write_mesh(mesh, s.folder / "meshes" / (hard.name + ".off"));
    }
    Json row = in_child([&] { return padded(hard, mesh, tolerance); });
    row["mesh"] = hard.name, row["hard"] = hard.hard, row["triangles"] = mesh.triangles.size();
    row["tolerance"] = tolerance;
    row["right"] = right(hard, row, tolerance);
    passed = passed && row["right"];
    table.push_back(cells_of(hard, row)), rows.push_back(row);
  }
  return {{"bench", "hard"}, {"machine", machine()}, {"passed", passed}, {"rows", rows}, {"table", table}};
}

}  // namespace padder::bench
