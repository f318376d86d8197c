// SPDX-License-Identifier: GPL-3.0-or-later
// Fig. 26 of the paper: time against the number of contacts. On the GPU, spheres and contacts are in its
// memory, as in a simulation that runs there. The time is that of the whole call, including the transfer of
// the number of contacts to the host.
#include <algorithm>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

struct Case {
  const char* scene;
  bool random_order;
  std::vector<std::uint64_t> sizes;
};

// Bodies of 64 spheres, posed from one asset, the first `moving` of which move.
struct BodyCase {
  const char* name;
  std::uint32_t bodies, moving;
};

// What a list of contacts is compared with: the nine stages, which decide every pair in double; the grid path
// with every body expanded to spheres; the grid path of the CPU.
enum class Against { nine_stages, expanded, processor };

class Table {
 public:
  explicit Table(const Settings& s) : settings_(s) {}

  // `order` says how the spheres lie in memory; `host` is the same input in host memory, for the processor.
  void row(const std::string& scene, const std::string& order, std::uint64_t n, const detect::Input& input,
           detect::BackendKind backend, Against against, const detect::Input& host) {
    using detect::Order, detect::Precision, detect::Width;
    const Settings& s = settings_;
    const bool cuda = backend == detect::BackendKind::cuda;
    say(s, scene + " " + std::to_string(n) + " " + name_of(backend));
    detect::CallOptions o = options_of(s, backend);
    detect::Detector d({backend}, o);
    const int repeat = std::max(s.repeat, cuda ? 11 : 3);
    const auto timed = [&](Precision p, Order how, Width w) {
      d.options().precision = p, d.options().order = how, d.options().width = w;
      // The second call finds its memory, the third records its graph.
      for (int k = 0; k < 3; k++) detect_watched(d, input);
      return median_seconds(repeat, [&] { detect_watched(d, input); });
    };
    const double fast = timed(Precision::float32, Order::any, Width::normals);
    const double exact = timed(Precision::exact, Order::any, Width::normals);
    const double fixed = timed(Precision::exact, Order::stable, Width::normals);
    const std::uint64_t contacts = detect_watched(d, input).count, held = d.memory();
    const double points = timed(Precision::exact, Order::any, Width::points);
    const std::uint64_t hash = hash_watched(d);
    if (cuda || against == Against::expanded) {
      o.width = Width::pairs;
      if (against == Against::expanded) o.bodies = detect::Bodies::expanded;
      if (against == Against::nine_stages) o.path = detect::Path::nine_stages;
      const bool processor = against == Against::processor;
      if (processor) o.output = detect::Memory::host;
      detect::Detector reference({processor ? detect::BackendKind::omp : backend}, o);
      if (detect_watched(reference, processor ? host : input).count != contacts ||
          hash_watched(reference) != hash)
        throw Error("the fast path and the reference differ at " + scene + " " + std::to_string(n));
    }
    const double bytes =
        (static_cast<double>(held) - 24.0 * static_cast<double>(contacts)) / static_cast<double>(n);
    rows.push_back({{"scene", scene},
                    {"random_order", order == "random"},
                    {"spheres", n},
                    {"contacts", contacts},
                    {"hash", std::to_string(hash)},
                    {"backend", d.backend()},
                    {"seconds_fast", fast},
                    {"seconds_exact", exact},
                    {"seconds_exact_fixed", fixed},
                    {"seconds_exact_points", points},
                    {"bytes_held", held}});
    table.push_back({scene, order, std::to_string(n), std::to_string(contacts), d.backend(),
                     number(fast * 1e3, "%.3f"), number(exact * 1e3, "%.3f"), number(fixed * 1e3, "%.3f"),
                     number(points * 1e3, "%.3f"), number(exact * 1e9 / static_cast<double>(n), "%.3f"),
                     number(bytes, "%.0f")});
  }

  Json rows = Json::array();
  Json table =
      Json::array({{"scene", "order", "spheres", "contacts", "backend", "fast [ms]", "exact [ms]",
                    "exact, fixed order [ms]", "exact, points [ms]", "ns a sphere", "bytes a sphere"}});

 private:
  const Settings& settings_;
};

void loose_rows(const Settings& s, Table& t) {
  std::vector<Case> cases;
  for (const char* scene : {"dense", "dilute", "poly35", "poly100"}) {
    if (!s.scene.empty() && s.scene != scene) continue;
    std::vector<std::uint64_t> sizes = sizes_or(s, {100000, 1000000, 5000000});
    if (s.spheres.empty() && s.backend == "cuda" && std::string(scene) != "poly100")
      sizes.push_back(20000000);
    cases.push_back({scene, true, sizes});
  }
  if (s.scene == "coherent")
    cases.push_back({"dense", false, sizes_or(s, {20000000})});
  else if (s.spheres.empty() && s.backend == "cuda" && s.scene.empty())
    cases.push_back({"dense", false, {20000000}});
  for (const Case& c : cases)
    for (const std::uint64_t n : c.sizes) {
      const std::vector<detect::FloatSphere> spheres = detect::generate(c.scene, n, c.random_order);
      for (const detect::BackendKind backend : backends(s)) {
        const DeviceSpheres device(spheres, backend == detect::BackendKind::cuda);
        // Lists of a billion leave the nine stages no memory.
        const bool huge = n > 100000000;
        const detect::Input host = input_of(spheres);
        t.row(c.scene, c.random_order ? "random" : "coherent", n, device.input(), backend,
              huge ? Against::processor : Against::nine_stages, host);
      }
    }
}

// --spheres N: bodies of N spheres together.
void body_rows(const Settings& s, Table& t) {
  std::vector<BodyCase> bodies;
  for (const std::uint64_t n : s.spheres)
    bodies.push_back({"cluster", static_cast<std::uint32_t>(std::max<std::uint64_t>(n / 64, 1)), ~0u});
  if (s.spheres.empty())
    bodies = {{"cluster", 10000, ~0u},
              {"cluster", 100000, ~0u},
              {"cluster", 10, ~0u},
              {"cluster, 10 bodies move", 1000, 10},
              {"cluster, 10 bodies move", 1000000, 10}};
  for (const BodyCase& c : bodies)
    for (const detect::BackendKind backend : backends(s)) {
      const bool cuda = backend == detect::BackendKind::cuda;
      if (s.spheres.empty() && !cuda && c.bodies > 100000) continue;
      detect::BodyScene scene = detect::generate_bodies(c.bodies);
      for (std::size_t b = 0; b < scene.bodies.size(); b++) scene.bodies[b].is_static = b >= c.moving;
      const DeviceBodies device(scene, c.moving, cuda);
      t.row(c.name, "bodies", 64 * std::uint64_t(c.bodies), device.input(), backend,
            c.moving < c.bodies ? Against::expanded : Against::nine_stages, device.input());
    }
}

Json result_of(const Settings& s, const char* name, const Table& t) {
  return {{"bench", name},        {"record", "i, j, normal, depth in float (points: + both contact points)"},
          {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", t.rows},
          {"table", t.table}};
}

}  // namespace

Json scaling(const Settings& s) {
  check_scene(s, "scaling", {"dense", "coherent", "dilute", "poly35", "poly100", "cluster"});
  Table t(s);
  loose_rows(s, t);
  if (s.scene.empty() || s.scene == "cluster") body_rows(s, t);
  return result_of(s, "scaling", t);
}

Json bodies(const Settings& s) {
  Table t(s);
  body_rows(s, t);
  return result_of(s, "bodies", t);
}

}  // namespace padder::bench
