// SPDX-License-Identifier: GPL-3.0-or-later
// Random meshes, whole and damaged: each gives a cluster whose report is true, as measured from outside
// (measure.h), or one sentence; none crashes, takes more than 2 GiB or longer than three minutes, beside
// other tests. Environment:
//   PADDER_MESHES       how many; 500, which take some 6 s of processor time
//   PADDER_MESHES_SEED  of the first; drawn when not set, and printed. The k-th has this seed + k
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <map>
#include <vector>

#include "padding/asset/error.h"
#include "padding/pad.h"
#include "tests/tools/audit/measure.h"
#include "tests/tools/audit/random_mesh.h"
#include "tools/watchdog.h"

namespace padder::audit {
namespace {

std::uint64_t number_from(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

std::atomic<std::uint64_t> current{0};
void crashed(int signal) {
  char text[80];
  const int n = std::snprintf(text, sizeof text, "\ncrashed: PADDER_MESHES_SEED=%llu\n",
                              static_cast<unsigned long long>(current.load()));
  if (::write(2, text, static_cast<std::size_t>(n)) < 0) return;
  std::signal(signal, SIG_DFL), std::raise(signal);
}

PadOptions options_of(RandomMesh& random) {
  PadOptions o;
  o.effort = 0;
  if (random.chance(0.1)) {
    o.depth_ratio = 0.3, o.edge_length = Length::share(0.2);
  } else {
    o.tolerance = Length::share(random.chance(0.05) ? 0.04 : random.chance(0.5) ? 0.1 : 0.2);
    if (random.chance(0.1))
      o.gap = Length::of(0);
    else if (random.chance(0.1))
      o.protrusion = Length::of(0);
  }
  constexpr RepairMode kModes[] = {RepairMode::united, RepairMode::fill, RepairMode::sheet};
  if (random.chance(0.2)) o.repair = kModes[random.below(3)];
  o.force = true;  // a tolerance may be large for a thin part
  return o;
}

// What became of a mesh: "certified", "not certified", "refused"; or what is wrong with it.
std::string fault_of(const ReadResult& file, const PadOptions& options, const Padded& p, unsigned seed) {
  const Accuracy& a = p.cluster.accuracy;
  const bool filled = a.proved_against == SurfaceKind::filled;
  // A ray may escape through a crack, beside a triangle that is turned inside out.
  const bool cracked = filled || (options.by_tolerance() && p.report.steps.joined > 0);
  const Measured m =
      measure(file.mesh, cracked ? &p.mesh : nullptr, p.cluster, 200, seed, p.report.steps.joined_width);
  const auto text = [](double v) { return std::to_string(v); };
  const double d = p.report.diagonal;
  if (!m.gap_holds) return "a gap of " + text(m.gap / d) + ", reported " + text(a.gap_max / d);
  // By depth ratio p.mesh is remeshed: its patches lie a little off those that the proof is against.
  if (!m.protrusion_holds && !(filled && options.by_depth()))
    return "a protrusion of " + text(m.protrusion / d) + ", reported " + text(a.protrusion_max / d);
  if (!a.certified || !options.by_tolerance()) return "";
  const double most = p.report.tolerance * (1 + 1e-6);
  if (!options.protrusion && !(a.protrusion_max <= most)) return "certified, but the protrusion is too large";
  if (!options.gap && !(a.gap_max <= most)) return "certified, but the gap is too large";
  if (filled && options.by_tolerance() && m.patch_area > 1.001 * p.report.filled_area + 1e-9 * d * d)
    return "patches of " + text(m.patch_area) + ", reported " + text(p.report.filled_area);
  return "";
}

// A ball beside one ten million times larger: all its triangles are small.
TEST(Audit, SmallTrianglesAreSurfaceToo) {
  Mesh mesh = shapes::sphere(2), small = shapes::sphere(2);
  for (Point& p : small.points) p = 1e-7 * p + Point(3, 0, 0);
  mesh = shapes::joined(mesh, small);
  Cluster cluster;
  cluster.centers = {{0, 0, 0}, {3, 0, 0}}, cluster.radii = {1, 1e-7};
  EXPECT_LT(measure(mesh, nullptr, cluster, 1000, 1).protrusion, 0.1);
}

TEST(RandomMeshes, EachGivesATrueReportOrASentence) {
  const std::uint64_t first = number_from("PADDER_MESHES_SEED", std::uint64_t(std::random_device{}()) << 16),
                      count = number_from("PADDER_MESHES", 500);
  std::printf("seeds %llu to %llu\n", static_cast<unsigned long long>(first),
              static_cast<unsigned long long>(first + count - 1));
  std::fflush(stdout);
  // They found a wrong body, a crash of CGAL, and an audit that took the inside of a cracked box for outside.
  std::vector<std::uint64_t> seeds = {27336322188326, 999002220, 218425248055498};
  for (std::uint64_t k = 0; k < count; k++) seeds.push_back(first + k);
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, crashed);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers reserve terabytes
  const rlimit memory = {rlim_t(2) << 30, RLIM_INFINITY};
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
  std::map<std::string, int> outcomes;
  int wrong = 0;
  for (const std::uint64_t seed : seeds) {
    if (wrong == 5) break;
    current = seed;
    const std::string name = "PADDER_MESHES_SEED=" + std::to_string(seed);
    const Watchdog watchdog(name.c_str(), 180);
    RandomMesh random(seed);
    const PadOptions options = options_of(random);
    ReadResult file;
    file.mesh = random.mesh(), file.source.file = "random.off";
    try {
      const Padded p = pad(file, options);
      outcomes[p.cluster.accuracy.certified ? "certified" : "not certified"]++;
      const std::string fault = fault_of(file, options, p, static_cast<unsigned>(seed));
      if (fault.empty()) continue;
      wrong++;
      ADD_FAILURE() << name << ": " << fault << "\n  " << random.story() << "; " << p.cluster.source.repair
                    << "\n  " << p.cluster.settings << "\n  proved against "
                    << name_of(p.cluster.accuracy.proved_against) << ", " << p.cluster.size() << " spheres, "
                    << p.report.reason;
    } catch (const std::bad_alloc&) {
      wrong++;
      ADD_FAILURE() << name << ": takes more than 2 GiB\n  " << random.story();
    } catch (const Error& e) {
      const std::string said = e.what();
      outcomes["refused"]++;
      if (std::getenv("PADDER_MESHES_VERBOSE")) std::printf("%s: %s\n", name.c_str(), said.c_str());
      EXPECT_TRUE(said.size() > 20 && said.size() < 1000 && said.find('\n') == said.npos)
          << name << ": " << said;
    }
  }
  for (const auto& [what, times] : outcomes) std::printf("%d %s\n", times, what.c_str());
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, SIG_DFL);
}

}  // namespace
}  // namespace padder::audit
