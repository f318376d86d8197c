// SPDX-License-Identifier: GPL-3.0-or-later
// What a sphere and a contact cost in scenes that are sparse, uneven or of very different sizes, relative to
// the scene dense with as many spheres. Standing: the same spheres in each call. Moving: each call gets other
// positions, a little different from those of the call before.
#include <algorithm>
#include <memory>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

struct Times {
  double median, worst;
};

// The same call on one input after another, in turn. The first calls are not counted: the second finds its
// memory, the third records its graph.
Times times_of(detect::Detector& d, const std::vector<std::unique_ptr<DeviceSpheres>>& inputs, int repeat) {
  std::vector<double> times;
  std::size_t at = 0;
  for (int k = -4; k < repeat; k++) {
    const detect::Input& input = inputs[at++ % inputs.size()]->input();
    const double t = seconds_of([&] { detect_watched(d, input); });
    if (k >= 0) times.push_back(t);
  }
  std::sort(times.begin(), times.end());
  return {times[times.size() / 2], times.back()};
}

struct SceneRows {
  const Settings& settings;
  Json rows = Json::array();
  Json table = Json::array(
      {{"scene", "spheres", "contacts", "backend", "standing [ms]", "moving [ms]", "worst moving [ms]",
        "a sphere or contact, dense = 1", "at most", "moving / standing", "worst / median"}});
  // Of the scene dense: seconds for each sphere and contact, by backend and number of spheres.
  std::vector<std::pair<std::pair<detect::BackendKind, std::uint64_t>, double>> dense{};

  void row(const SceneEntry& scene, std::uint64_t n, detect::BackendKind backend) {
    using detect::BackendKind;
    const bool cuda = backend == BackendKind::cuda;
    say(settings, std::string(scene.name) + " " + std::to_string(n) + (cuda ? " cuda" : " omp"));
    std::vector<detect::FloatSphere> spheres = uneven_scene(scene.name, n);
    const std::vector<detect::FloatSphere> first = spheres;
    std::vector<std::vector<detect::FloatSphere>> frames;  // DeviceSpheres borrows them
    std::vector<std::unique_ptr<DeviceSpheres>> standing, moving;
    standing.push_back(std::make_unique<DeviceSpheres>(first, cuda));
    const std::uint64_t wanted = cuda ? 100 : 5, most = std::max<std::uint64_t>(2, 300000000 / n);
    for (std::uint64_t k = 0; k < std::min(wanted, most); k++) {
      move_a_little(spheres, k);
      frames.push_back(spheres);
    }
    for (const auto& frame : frames) moving.push_back(std::make_unique<DeviceSpheres>(frame, cuda));

    detect::CallOptions o;
    o.threads = settings.threads;
    if (cuda) o.output = detect::Memory::device;
    detect::Detector d({backend}, o);
    const int repeat = std::max(settings.repeat, cuda ? 100 : 5);
    const Times stand = times_of(d, standing, repeat), move = times_of(d, moving, repeat);
    const std::uint64_t contacts = detect_watched(d, standing[0]->input()).count, hash = hash_watched(d);
    check(scene.name, n, backend, *standing[0], contacts, hash);

    const double each = stand.median / static_cast<double>(n + contacts);
    if (std::string(scene.name) == "dense") dense.push_back({{backend, n}, each});
    double relative = 0;
    for (const auto& [what, seconds] : dense)
      if (what == std::pair{backend, n}) relative = each / seconds;
    rows.push_back({{"scene", scene.name},
                    {"spheres", n},
                    {"contacts", contacts},
                    {"hash", std::to_string(hash)},
                    {"backend", d.backend()},
                    {"seconds_standing", stand.median},
                    {"seconds_moving", move.median},
                    {"seconds_moving_worst", move.worst},
                    {"relative", relative}});
    table.push_back({scene.name, std::to_string(n), std::to_string(contacts), d.backend(),
                     number(stand.median * 1e3, "%.3f"), number(move.median * 1e3, "%.3f"),
                     number(move.worst * 1e3, "%.3f"), relative > 0 ? number(relative, "%.2f") : "",
                     number(cuda ? scene.at_most : 2.5, "%.1f"), number(move.median / stand.median, "%.2f"),
                     number(move.worst / move.median, "%.2f")});
  }

  // The contacts of a row against those of the other backend's path: on the GPU the grid path of the
  // processor, on the processor the nine stages.
  void check(const char* scene, std::uint64_t n, detect::BackendKind backend, const DeviceSpheres& spheres,
             std::uint64_t contacts, std::uint64_t hash) {
    detect::CallOptions o;
    o.threads = settings.threads, o.width = detect::Width::pairs;
    const bool cuda = backend == detect::BackendKind::cuda;
    if (!cuda) o.path = detect::Path::nine_stages;
    detect::Detector reference({detect::BackendKind::omp}, o);
    if (detect_watched(reference, spheres.host()).count != contacts || hash_watched(reference) != hash)
      throw Error("the fast path and the reference differ at " + std::string(scene) + " " +
                  std::to_string(n));
  }
};

}  // namespace

Json scenes(const Settings& s) {
  if (!s.scene.empty()) uneven_scene(s.scene, 1);  // throws if there is no such scene
  SceneRows t{s};
  std::vector<std::uint64_t> sizes = s.spheres;
  if (sizes.empty()) sizes = {100000, 1000000, 5000000};
  for (const std::uint64_t n : sizes)
    for (const detect::BackendKind backend : backends(s))
      for (const SceneEntry& scene : uneven_scenes())
        if (s.scene.empty() || s.scene == scene.name || std::string("dense") == scene.name)
          t.row(scene, n, backend);
  Json result = {{"bench", "scenes"},    {"record", "i, j, normal, depth in float"},
                 {"machine", machine()}, {"device", device_name()},
                 {"threads", s.threads}, {"rows", t.rows},
                 {"table", t.table}};
  write_result(s, result);
  return result;
}

}  // namespace padder::bench
