// SPDX-License-Identifier: GPL-3.0-or-later
// Fig. 25 of the paper: how many times faster than Bullet, against the number of contacts. Bullet's step is
// measured warm (the second and later steps, nothing moved: its pairs and manifolds are kept, which favours
// it).
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/peers/bullet.h"

namespace padder::bench {

Json speedup(const Settings& s) {
  if (!have_bullet()) BulletWorld{{}};
  Json rows = Json::array();
  Json table = Json::array({{"spheres", "contacts", "Bullet, first [s]", "Bullet, warm [s]",
                             "plain grid, 1 thread [ms]", "backend", "[ms]", "pairs only [ms]", "speedup"}});
  for (const std::uint64_t n : sizes_or(s, {30000, 100000, 300000, 1000000})) {
    const std::vector<detect::FloatSphere> spheres = detect::generate("dense", n);
    say(s, std::to_string(n) + " spheres: Bullet");
    double first, warm;
    std::uint64_t bullet_contacts;
    {
      BulletWorld world(spheres);
      first = seconds_of([&] { world.step(); });
      warm = median_seconds(3, [&] { world.step(); });
      bullet_contacts = world.count();
    }
    std::vector<detect::Pair> oracle;
    const double plain = median_seconds(3, [&] { oracle = plain_grid(spheres); });
    for (const detect::BackendKind backend : backends(s)) {
      detect::CallOptions o;
      o.threads = s.threads;
      detect::Detector detector({backend}, o);
      const detect::Input input = input_of(spheres);
      const double full = median_seconds(s.repeat, [&] { detect_watched(detector, input); });
      if (hash_watched(detector) != hash_of(oracle))
        throw Error("the pairs differ from those of double arithmetic");
      const std::string name = detector.backend();
      detector.options().width = detect::Width::pairs;
      const double pairs = median_seconds(s.repeat, [&] { detect_watched(detector, input); });
      rows.push_back({{"spheres", n},
                      {"contacts", oracle.size()},
                      {"contacts_bullet", bullet_contacts},
                      {"bullet_first_s", first},
                      {"bullet_warm_s", warm},
                      {"plain_grid_s", plain},
                      {"backend", name},
                      {"seconds", full},
                      {"seconds_pairs", pairs},
                      {"speedup", warm / full}});
      table.push_back({std::to_string(n), std::to_string(oracle.size()), number(first, "%.2f"),
                       number(warm, "%.3f"), number(plain * 1e3, "%.1f"), name, number(full * 1e3, "%.2f"),
                       number(pairs * 1e3, "%.2f"), number(warm / full, "%.0f")});
      say(s, "Bullet " + number(warm, "%.3f") + " s warm, " + number(first, "%.2f") + " s first; " + name +
                 " " + number(full * 1e3, "%.2f") + " ms, pairs only " + number(pairs * 1e3, "%.2f") +
                 " ms; plain grid " + number(plain * 1e3, "%.1f") + " ms");
    }
  }
  return {{"bench", "speedup"},   {"scene", "dense"},     {"record", "i, j, normal, depth in float"},
          {"machine", machine()}, {"threads", s.threads}, {"rows", rows},
          {"table", table}};
}

}  // namespace padder::bench
