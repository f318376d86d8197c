// SPDX-License-Identifier: GPL-3.0-or-later
// Milliseconds of each stage: of the nine stages as in the paper, and of what the grid path has of them. The
// host waits for the GPU after each stage, so the sum is more than the time of a call.
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {

Json stages(const Settings& s) {
  Json rows = Json::array();
  Json header = {"backend", "path", "spheres", "contacts", "place"};
  for (int k = 1; k <= 9; k++) header.push_back("stage " + std::to_string(k));
  header.push_back("total [ms]");
  Json table = Json::array({header});
  for (const std::uint64_t n : sizes_or(s, {1000000})) {
    const std::vector<detect::FloatSphere> spheres = detect::generate("dense", n);
    for (const detect::BackendKind backend : backends(s))
      for (const detect::Path path : {detect::Path::nine_stages, detect::Path::grid}) {
        detect::CallOptions o = options_of(s, backend);
        o.path = path, o.timings = true;
        const DeviceSpheres device(spheres, backend == detect::BackendKind::cuda);
        detect::Detector d({backend}, o);
        std::vector<detect::Seconds> runs;
        std::uint64_t contacts = 0;
        for (int k = 0; k <= s.repeat; k++) {
          const detect::Contacts& c = detect_watched(d, device.input());
          contacts = c.count;
          if (k) runs.push_back(c.seconds);
        }
        const auto median_of = [&](auto part) {
          std::vector<double> values;
          for (const detect::Seconds& r : runs) values.push_back(part(r));
          return median(values);
        };
        const char* name = path == detect::Path::grid ? "fast" : "nine stages";
        const double place = median_of([](const detect::Seconds&r) { return r.place; }),
                     total = median_of([](const detect::Seconds&r) { return r.total; });
        Json row = {d.backend(), name, std::to_string(n), std::to_string(contacts),
                    number(place * 1e3, "%.3f")};
        Json seconds = {{"place", place}};
        for (std::size_t k = 0; k < 9; k++) {
          const double t = median_of([k](const detect::Seconds& r) { return r.stage[k]; });
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
