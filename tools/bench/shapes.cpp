// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies of many shapes, strewn so that they go through each other: searched first, expanded, and as
// Bodies::automatic decides. Each row once with a revision, poses on the GPU, and once with all read anew.
// "mixtures" are random scenes of one to four shapes, which --scene asks for.
#include <algorithm>
#include <cmath>
#include <functional>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

using detect::Sphere;

// Of n spheres of radius 0.5, neighbours a diameter apart.
std::vector<Sphere> shape_of(const std::string& name, std::size_t n) {
  std::vector<Sphere> s;
  if (name == "rod")
    for (std::size_t k = 0; k < n; k++) s.push_back({double(k) - double(n) / 2, 0, 0, 0.5});
  if (name == "star")  // six arms
    for (std::size_t k = 0; k < n; k++) {
      double at[3] = {0, 0, 0};
      at[k / 2 % 3] = (k % 2 ? 1.0 : -1.0) * double(k / 6 + 1);
      s.push_back({at[0], at[1], at[2], 0.5});
    }
  if (name == "shell") {
    detect::SplitMix64 random(n);
    const double radius = std::sqrt(double(n) / 12.5);
    while (s.size() < n) {
      const double x = random.signed_unit(), y = random.signed_unit(), z = random.signed_unit(),
                   length = std::sqrt(x * x + y * y + z * z);
      if (length < 1 && length > 0.01)
        s.push_back({radius * x / length, radius * y / length, radius * z / length, 0.5});
    }
  }
  const auto edge =
      static_cast<std::size_t>(name == "plate" ? std::sqrt(double(n)) + 0.5 : std::cbrt(double(n)) + 0.5);
  if (name == "plate" || name == "block")
    for (std::size_t k = 0; k < n; k++)
      s.push_back({double(k % edge), double(k / edge % edge), double(k / edge / edge), 0.5});
  return s;
}

// In a cube of this edge.
std::vector<detect::Body> strewn(std::uint64_t count, double edge, std::uint64_t seed) {
  detect::SplitMix64 random(seed);
  std::vector<detect::Body> bodies(count);
  for (detect::Body& b : bodies) {
    double q[4];
    for (double& v : q) v = random.signed_unit() + random.signed_unit() + random.signed_unit();
    detect::rotation_of(q[0], q[1], q[2], q[3], b.rotation);
    for (double& p : b.position) p = 0.5 * edge * random.signed_unit();
  }
  return bodies;
}

struct Case {
  const char* shape;
  std::size_t spheres;
  std::uint32_t bodies;
  double spacing = 2.2;  // edge of the cube in which each sphere has its place
};

constexpr Case kCases[] = {
    {"rod", 10, 5000},     {"rod", 100, 500},    {"rod", 100, 5000},    {"rod", 100, 5000, 4},
    {"rod", 1000, 1000},   {"star", 60, 1000},   {"star", 300, 300},    {"star", 300, 3000},
    {"star", 300, 300, 4}, {"shell", 60, 5000},  {"shell", 200, 5000},  {"plate", 100, 1000},
    {"plate", 400, 500},   {"block", 8, 10000},  {"block", 8, 100000},  {"block", 27, 3000},
    {"block", 64, 1000},   {"block", 64, 10000}, {"block", 64, 30000},  {"block", 216, 1000},
    {"block", 216, 10000}, {"block", 1000, 300}, {"block", 1000, 3000}, {"block", 1000, 300, 1.4},
    {"block", 8000, 100},  {"block", 8000, 1000}};

struct Scene {
  std::string what;
  std::vector<std::vector<Sphere>> shapes;
  std::vector<detect::Body> bodies;
};

Scene scene_of(const Case& c) {
  const double edge = c.spacing * std::cbrt(double(c.bodies) * double(c.spheres));
  return {std::string(c.shape) + " of " + std::to_string(c.spheres) + " at " + number(c.spacing, "%g"),
          {shape_of(c.shape, c.spheres)},
          strewn(c.bodies, edge, c.bodies)};
}

// One to four shapes of 1 to 2,000 spheres, of sizes up to 1:100, in one cube.
Scene mixture_of(std::uint64_t seed) {
  detect::SplitMix64 random(seed);
  const auto by_decades = [&](double low, double high) { return low * std::pow(high / low, random.unit()); };
  constexpr const char* kShapes[] = {"rod", "star", "shell", "plate", "block"};
  Scene scene{"seed " + std::to_string(seed), {}, {}};
  const std::size_t shapes = 1 + random.bits() % 4;
  const double spheres = by_decades(1e4, 1e6) / double(shapes), spacing = by_decades(1.2, 5);
  double volume = 0;
  for (std::uint32_t k = 0; k < shapes; k++) {
    const char* const name = kShapes[random.bits() % std::size(kShapes)];
    const double scale = shapes > 1 ? by_decades(0.1, 10) : 1;
    std::vector<Sphere>& shape =
        scene.shapes.emplace_back(shape_of(name, static_cast<std::size_t>(by_decades(1, 2000))));
    for (Sphere& s : shape) s.x *= scale, s.y *= scale, s.z *= scale, s.r *= scale;
    const auto bodies = static_cast<std::uint64_t>(std::max(1.0, spheres / double(shape.size())));
    volume += double(bodies * shape.size()) * scale * scale * scale;
    scene.what += "; " + std::to_string(bodies) + " times " + name + " of " + std::to_string(shape.size());
    if (scale != 1) scene.what += ", size " + number(scale, "%.2g");
    for (detect::Body b : strewn(bodies, 1, random.bits())) b.shape = k, scene.bodies.push_back(b);
  }
  for (detect::Body& b : scene.bodies)
    for (double& p : b.position) p *= spacing * std::cbrt(volume);
  return scene;
}

double median_of(const Settings& s, detect::BackendKind backend, detect::Bodies way,
                 const detect::Input& input, std::uint64_t& contacts) {
  detect::CallOptions o = options_of(s, backend);
  o.width = detect::Width::normals, o.bodies = way;
  o.order = s.stable ? detect::Order::stable : detect::Order::any;
  detect::Detector d({backend}, o);
  std::uint64_t count = 0;
  const auto call = [&] { count = detect_watched(d, input).count; };
  // In any order a GPU's detector tries the other way after 200 calls, and may choose it.
  const bool tries = backend == detect::BackendKind::cuda && way == detect::Bodies::automatic && !s.stable;
  for (int k = 0; k < (tries ? 230 : 2); k++) call();
  const double seconds = median_seconds(s.repeat, call);
  if (contacts != ~std::uint64_t(0) && contacts != count) throw Error("two ways find different contacts");
  contacts = count;
  return seconds;
}

}  // namespace

Json shapes(const Settings& s) {
  check_scene(s, "shapes", {"rod", "star", "shell", "plate", "block", "mixtures"});
  std::vector<std::function<Scene()>> scenes;
  for (const Case& c : kCases)
    if (s.scene.empty() || s.scene == c.shape) scenes.emplace_back([&c] { return scene_of(c); });
  for (std::uint64_t k = 0; s.scene == "mixtures" && k < s.count; k++)
    scenes.emplace_back([seed = s.seed + k] { return mixture_of(seed); });
  Json rows = Json::array(),
       table = Json::array({{"backend", "shape", "bodies", "read", "contacts", "first [ms]", "expanded",
                             "automatic", "over the faster"}});
  for (const detect::BackendKind backend : backends(s))
    for (const auto& make : scenes) {
      const bool cuda = backend == detect::BackendKind::cuda;
      const Scene scene = make();
      for (const bool anew : {false, true}) {
        say(s, scene.what);
        const DeviceBodies bodies(scene.shapes, scene.bodies, ~0u, cuda && !anew);
        detect::Input input = bodies.input();
        if (anew) input.revision = 0;
        std::uint64_t contacts = ~std::uint64_t(0);
        const double first = median_of(s, backend, detect::Bodies::first, input, contacts),
                     expanded = median_of(s, backend, detect::Bodies::expanded, input, contacts),
                     automatic = median_of(s, backend, detect::Bodies::automatic, input, contacts),
                     over = automatic / std::min(first, expanded);
        rows.push_back({{"backend", name_of(backend)},
                        {"shape", scene.what},
                        {"bodies", scene.bodies.size()},
                        {"anew", anew},
                        {"contacts", contacts},
                        {"seconds_first", first},
                        {"seconds_expanded", expanded},
                        {"seconds_automatic", automatic}});
        table.push_back({name_of(backend), scene.what, std::to_string(scene.bodies.size()),
                         anew ? "anew" : "moving", std::to_string(contacts), number(first * 1e3, "%.3f"),
                         number(expanded * 1e3, "%.3f"), number(automatic * 1e3, "%.3f"),
                         number(over, "%.2f")});
      }
    }
  return {{"bench", "shapes"},    {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", rows},         {"table", table}};
}

}  // namespace padder::bench
