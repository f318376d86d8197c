// SPDX-License-Identifier: GPL-3.0-or-later
// Milliseconds of each stage: of the nine stages as in the paper, and of what the grid path has of them. The
// host waits for the GPU after each stage, so the sum is more than the time of a call.
#include <algorithm>

#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {

Json stages(const Settings& s) {
  const std::vector<std::uint64_t> sizes =
      s.spheres.empty() ? std::vector<std::uint64_t>{1000000} : s.spheres;
  Json rows = Json::array();
  Json header = {"backend", "path", "spheres", "contacts", "place"};
  for (int k = 1; k <= 9; k++) header.push_back("stage " + std::to_string(k));
  header.push_back("total [ms]");
  Json table = Json::array({header});
  for (const std::uint64_t n : sizes) {
    const std::vector<detect::FloatSphere> spheres = detect::generate("dense", n);
    for (const detect::BackendKind backend : backends(s))
      for (const detect::Path path : {detect::Path::nine_stages, detect::Path::grid}) {
        detect::CallOptions o;
        o.threads = s.threads, o.path = path, o.timings = true;
        if (backend == detect::BackendKind::cuda) o.output = detect::Memory::device;
        const DeviceSpheres device(spheres, backend == detect::BackendKind::cuda);
        detect::Detector d({backend}, o);
        std::vector<detect::Seconds> runs;
        std::uint64_t contacts = 0;
        for (int k = 0; k <= s.repeat; k++) {
          const detect::Contacts& c = detect_watched(d, device.input());
          contacts = c.count;
          if (k) runs.push_back(c.seconds);
        }
        const auto median = [&](auto part) {
          std::vector<double> v;
          for (const detect::Seconds& r : runs) v.push_back(part(r));
          std::sort(v.begin(), v.end());
          return v[v.size() / 2];
        };
        const char* name = path == detect::Path::grid ? "fast" : "nine stages";
        const double place = median([](const detect::Seconds&r) { return r.place; }),
                     total = median([](const detect::Seconds&r) { return r.total; });
        Json row = {d.backend(), name, std::to_string(n), std::to_string(contacts),
                    number(place * 1e3, "%.3f")};
        Json seconds = {{"place", place}};
        for (std::size_t k = 0; k < 9; k++) {
          const double t = median([k](const detect::Seconds& r) { return r.stage[k]; });
          row.push_back(t > 0 ? number(t * 1e3, "%.3f") : "");
          seconds["stage" + std::to_string(k + 1)] = t;
        }
        row.push_back(number(total * 1e3, "%.3f"));
        seconds["total"] = total;
        table.push_back(row);
        rows.push_back({{"backend", d.backend()},
                        {"path", name},
                        {"spheres", n},
                        {"contacts", contacts},
                        {"seconds", seconds}});
      }
  }
  return {{"bench", "stages"},    {"scene", "dense"}, {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", rows},     {"table", table}};
}

}  // namespace padder::bench
