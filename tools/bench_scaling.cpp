// Fig. 26 of the paper: time against the number of contacts. On the GPU spheres and contacts lie in its
// memory, as in a simulation that runs there; what is timed is the whole call, with the count read back by
// the host.
#include <algorithm>

#include "padding/error.h"
#include "padding/file.h"
#include "tools/bench.h"
#include "tools/bench_device.h"

namespace padder::bench {
namespace {

struct Case {
  const char* scene;
  bool random_order;
  std::vector<std::uint64_t> sizes;
};

}  // namespace

Json scaling(const Settings& s) {
  std::vector<Case> cases;
  for (const char* scene : {"dense", "dilute", "poly35", "poly100"}) {
    if (!s.scene.empty() && s.scene != scene) continue;
    std::vector<std::uint64_t> sizes = s.spheres;
    if (sizes.empty()) sizes = {100000, 1000000, 5000000};
    if (s.spheres.empty() && s.backend == "cuda" && std::string(scene) != "poly100")
      sizes.push_back(20000000);
    cases.push_back({scene, true, sizes});
  }
  if (s.spheres.empty() && s.backend == "cuda" && s.scene.empty())
    cases.push_back({"dense", false, {20000000}});
  if (cases.empty()) throw Error("scaling has the scenes dense, dilute, poly35 and poly100");
  Json rows = Json::array();
  Json table =
      Json::array({{"scene", "order", "spheres", "contacts", "backend", "fast [ms]", "exact [ms]",
                    "exact, fixed order [ms]", "exact, points [ms]", "ns a sphere", "bytes a sphere"}});
  std::string data;
  for (const Case& c : cases)
    for (const std::uint64_t n : c.sizes) {
      const std::vector<detect::FloatSphere> spheres = detect::generate(c.scene, n, c.random_order);
      for (const detect::Choice backend : backends(s)) {
        if (backend == detect::Choice::omp && n > 5000000) continue;
        say(s, std::string(c.scene) + " " + std::to_string(n) +
                   (backend == detect::Choice::omp ? " omp" : " cuda"));
        detect::Options o;
        o.backend = backend, o.threads = s.threads;
        if (backend == detect::Choice::cuda) o.output = detect::Memory::device;
        const DeviceSpheres device(spheres, backend == detect::Choice::cuda);
        detect::Detector d(o);
        const int repeat = std::max(s.repeat, backend == detect::Choice::cuda ? 11 : 3);
        const auto timed = [&](detect::Precision p, detect::Order order, detect::Width w) {
          d.options().precision = p, d.options().order = order, d.options().width = w;
          d.detect(device.input());  // the second call finds its memory, the third records its graph
          d.detect(device.input());
          return median_seconds(repeat, [&] { d.detect(device.input()); });
        };
        using detect::Order, detect::Precision, detect::Width;
        const double fast = timed(Precision::fast, Order::any, Width::normals);
        const double exact = timed(Precision::exact, Order::any, Width::normals);
        const double fixed = timed(Precision::exact, Order::fixed, Width::normals);
        const std::uint64_t contacts = d.detect(device.input()).count, held = d.memory();
        const double points = timed(Precision::exact, Order::any, Width::points);
        const std::uint64_t hash = d.hash();
        if (backend == detect::Choice::cuda) {
          // The nine stages decide every pair in double. Lists of a billion leave them no memory: the CPU
          // then.
          const bool huge = n > 100000000;
          o.path = huge ? detect::Path::fast : detect::Path::nine_stages, o.width = Width::pairs;
          if (huge) o.backend = detect::Choice::omp, o.output = detect::Memory::host;
          detect::Detector reference(o);
          if (reference.detect(huge ? input_of(spheres) : device.input()).count != contacts ||
              reference.hash() != hash)
            throw Error("the fast path and its reference differ at " + std::string(c.scene) + " " +
                        std::to_string(n));
        }
        const double bytes =
            (static_cast<double>(held) - 24.0 * static_cast<double>(contacts)) / static_cast<double>(n);
        rows.push_back({{"scene", c.scene},
                        {"random_order", c.random_order},
                        {"spheres", n},
                        {"contacts", contacts},
                        {"hash", std::to_string(hash)},
                        {"backend", d.backend()},
                        {"seconds_fast", fast},
                        {"seconds_exact", exact},
                        {"seconds_exact_fixed", fixed},
                        {"seconds_exact_points", points},
                        {"bytes_held", held}});
        table.push_back({c.scene, c.random_order ? "random" : "coherent", std::to_string(n),
                         std::to_string(contacts), d.backend(), number(fast * 1e3, "%.3f"),
                         number(exact * 1e3, "%.3f"), number(fixed * 1e3, "%.3f"),
                         number(points * 1e3, "%.3f"), number(exact * 1e9 / static_cast<double>(n), "%.3f"),
                         number(bytes, "%.0f")});
        data += number(static_cast<double>(contacts) / 1e6, "%g") + " " + number(exact * 1e3, "%g") + "\n";
      }
    }
  Json result = {
      {"bench", "scaling"},   {"record", "i, j, normal, depth in float (points: + both contact points)"},
      {"machine", machine()}, {"device", device_name()},
      {"threads", s.threads}, {"rows", rows},
      {"table", table}};
  if (!s.folder.empty()) {
    write_file(s.folder / "scaling.json", result.dump(2) + "\n");
    const std::filesystem::path file = s.folder / ".scaling.dat";
    write_file(file, data);
    plot(
        s,
        "set terminal svg size 800,500 font 'sans,14'\nset output '" + (s.folder / "scaling.svg").string() +
            "'\nset xlabel 'Contacts [millions]'\nset ylabel 'Time [ms]'\nset logscale xy\nset grid\nplot '" +
            file.string() + "' using 1:2 with points pt 7 title 'exact'\n");
    std::filesystem::remove(file);
  }
  return result;
}

}  // namespace padder::bench
