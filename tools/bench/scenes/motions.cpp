// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes in other motion than that of `bench scenes --moving`: what a detector keeps from call to call must
// fit spheres that travel, turn, draw together, fly apart, come and go. Spheres and contacts are in the
// memory of the device; bringing them there between calls is not timed.
#include <algorithm>
#include <cmath>

#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/bench/scenes/shown_spheres.h"
#include "tools/bench/scenes/uneven_scenes.h"

namespace padder::bench {
namespace {

using detect::FloatSphere;
using Spheres = std::vector<FloatSphere>;

constexpr int kCalls = 100, kFrames = kCalls + 8;

// What motions measure their steps by.
struct Start {
  Spheres spheres;
  double radius = 0;      // on average
  double middle[3] = {};  // of the centres' bounds
};

Start start_of(Spheres spheres) {
  Start s{std::move(spheres)};
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (const FloatSphere& f : s.spheres) {
    const float c[3] = {f.x, f.y, f.z};
    for (int a = 0; a < 3; a++) low[a] = std::min(low[a], c[a]), high[a] = std::max(high[a], c[a]);
    s.radius += f.r / static_cast<double>(s.spheres.size());
  }
  for (int a = 0; a < 3; a++) s.middle[a] = 0.5 * low[a] + 0.5 * high[a];
  return s;
}

// Each coordinate as far from the middle as `place` says: place(k, x, y, z) changes the last three.
template <class Place>
Spheres moved(const Start& start, const Place& place) {
  Spheres s = start.spheres;
  for (std::size_t k = 0; k < s.size(); k++) {
    double x = s[k].x - start.middle[0], y = s[k].y - start.middle[1], z = s[k].z - start.middle[2];
    place(k, x, y, z);
    s[k].x = static_cast<float>(x + start.middle[0]), s[k].y = static_cast<float>(y + start.middle[1]),
    s[k].z = static_cast<float>(z + start.middle[2]);
  }
  return s;
}

Spheres shaken(const Start& start, int frame) {
  return moved(start, [&](std::size_t k, double& x, double& y, double& z) {
    detect::SplitMix64 random(k + start.spheres.size() * static_cast<std::size_t>(frame));
    const double step = 0.02 * start.spheres[k].r;
    x += step * random.signed_unit(), y += step * random.signed_unit(), z += step * random.signed_unit();
  });
}
Spheres drifted(const Start& start, int frame) {
  const double far = 0.5 * start.radius * frame;
  return moved(start, [&](std::size_t, double& x, double& y, double& z) {
    x += 0.8 * far, y += 0.55 * far, z += 0.24 * far;
  });
}
Spheres turned(const Start& start, int frame) {
  const double c = std::cos(0.002 * frame), s = std::sin(0.002 * frame);
  return moved(start, [&](std::size_t, double& x, double& y, double&) {
    const double before = x;
    x = c * x - s * y, y = s * before + c * y;
  });
}
Spheres scaled(const Start& start, double by) {
  return moved(start, [&](std::size_t, double& x, double& y, double& z) { x *= by, y *= by, z *= by; });
}
Spheres expanded(const Start& start, int frame) { return scaled(start, std::pow(1.001, frame)); }
Spheres shrunk(const Start& start, int frame) { return scaled(start, std::pow(1.001, -frame)); }
Spheres pressed(const Start& start, int frame) {
  return moved(start, [&](std::size_t, double&, double&, double& z) { z *= std::pow(0.998, frame); });
}
// One sphere in 1,000 flies away from the middle.
Spheres flying(const Start& start, int frame) {
  const double far = 2 * start.radius * frame;
  return moved(start, [&](std::size_t k, double& x, double& y, double& z) {
    if (k % 1000 != 0) return;
    const double length = std::hypot(x, y, z) + start.radius * 1e-3;
    x += far * x / length, y += far * y / length, z += far * z / length;
  });
}
Spheres first_of(const Start& start, double share) {
  const auto n = static_cast<double>(start.spheres.size());
  return {start.spheres.begin(), start.spheres.begin() + static_cast<std::ptrdiff_t>(std::ceil(share * n))};
}
Spheres coming(const Start& start, int frame) { return first_of(start, 1 - 0.0005 * (kFrames - 1 - frame)); }
Spheres coming_and_going(const Start& start, int frame) {
  detect::SplitMix64 random(static_cast<std::uint64_t>(frame));
  return first_of(start, 1 - 0.05 * random.unit());
}

struct Motion {
  const char* name;
  const char* what;  // from one call to the next
  Spheres (*at)(const Start& start, int frame);
};

constexpr Motion kMotions[] = {
    {"shaken", "each sphere lies within a fiftieth of its radius about its place", shaken},
    {"drifting", "all go on by half a radius", drifted},
    {"turning", "all turn by a 500th of a radian about an axis", turned},
    {"expanding", "all lie 0.1 % further from the middle", expanded},
    {"shrinking", "all lie 0.1 % nearer to the middle", shrunk},
    {"pressed", "all lie 0.2 % lower", pressed},
    {"flying", "one in 1,000 flies off by a diameter", flying},
    {"coming", "0.05 % more spheres", coming},
    {"coming and going", "0 to 5 % of the spheres are left out", coming_and_going},
};

struct Measured {
  Times standing, moving;
  std::uint64_t contacts = 0;
};

// Standing: at the first, the middle and the last frame; the mean, since contacts become more or fewer. The
// spheres are brought there anew, too, since a call takes longer after the processor has done other work.
Measured measured(const Start& start, const Motion& motion, const Settings& s, detect::BackendKind backend,
                  const UnevenScene& scene) {
  const bool cuda = backend == detect::BackendKind::cuda;
  detect::CallOptions o = options_of(s, backend);
  o.order = s.stable ? detect::Order::stable : detect::Order::any;
  ShownSpheres shown(start.spheres.size(), cuda);
  Measured m;
  for (const int frame : {0, kFrames / 2, kFrames - 1}) {
    const Spheres spheres = motion.at(start, frame);
    detect::Detector d({backend}, o);
    const Times t =
        timed(d, shown.input(), std::max(s.repeat, cuda ? 21 : 3), [&](int) { shown.show(spheres); });
    m.standing.median += t.median / 3, m.standing.processor += t.processor / 3;
  }
  detect::Detector d({backend}, o);
  m.moving = timed(d, shown.input(), kCalls, [&](int k) { shown.show(motion.at(start, k)); });
  m.contacts = detect_watched(d, shown.input()).count;
  check_contacts(d, m.contacts, shown.input(), shown.host_input(),
                 {std::string(scene.name) + ", " + motion.name, scene.crowds_nine_stages});
  return m;
}

}  // namespace

Json motions(const Settings& s) {
  std::vector<std::string> names;
  for (const UnevenScene& scene : uneven_scenes()) names.emplace_back(scene.name);
  check_scene(s, "motions", names);
  Json rows = Json::array(),
       table = Json::array({{"backend", "scene", "spheres", "motion", "contacts at the end", "standing [ms]",
                             "moving [ms]", "over standing", "worst of 100 [ms]", "over the median"}});
  for (const detect::BackendKind backend : backends(s))
    for (const std::uint64_t n : sizes_or(s, {100000, 1000000}))
      for (const UnevenScene& scene : uneven_scenes()) {
        const std::string name = scene.name;
        if (s.scene.empty() ? name != "dense" && name != "poly100" : s.scene != name) continue;
        const Start start = start_of(uneven_scene(scene, n));
        for (const Motion& motion : kMotions) {
          say(s, name + " " + std::to_string(n) + ", " + motion.name + ": " + motion.what);
          const Measured m = measured(start, motion, s, backend, scene);
          rows.push_back({{"backend", name_of(backend)},
                          {"scene", name},
                          {"spheres", n},
                          {"motion", motion.name},
                          {"contacts", m.contacts},
                          {"seconds", m.standing.median},
                          {"seconds_moving", m.moving.median},
                          {"seconds_moving_worst", m.moving.worst}});
          const auto ms = [](double t) { return number(t * 1e3, "%.3f"); };
          table.push_back({name_of(backend), name, std::to_string(n), motion.name, std::to_string(m.contacts),
                           ms(m.standing.median), ms(m.moving.median),
                           number(m.moving.median / m.standing.median, "%.2f"), ms(m.moving.worst),
                           number(m.moving.worst / m.moving.median, "%.2f")});
        }
      }
  return {{"bench", "motions"},   {"stable", s.stable}, {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", rows},       {"table", table}};
}

}  // namespace padder::bench
