// SPDX-License-Identifier: MIT
#include "tools/settle/make_scene.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"

namespace padder::settle {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr double kPi = std::numbers::pi;

OrderedJson start(const std::string& name) {
  return {{"format", "padder.scene"}, {"version", 1}, {"name", name}, {"unit", "m"}};
}

// The number without the digits that nobody needs, so that a scene can be read.
double rounded(double v) { return std::round(v * 1e9) / 1e9; }

OrderedJson place(double x, double y, double z) { return {rounded(x), rounded(y), rounded(z)}; }

OrderedJson floor_at(double z) { return {{{"point", {0, 0, z}}, {"normal", {0, 0, 1}}}}; }

// Grains stand on a lattice that is looser than they will be: the cylinder is higher than they fill it.
OrderedJson silo(const MakeOptions& o) {
  if (o.count < 300)
    throw Error("the silo needs at least 300 grains, not " + std::to_string(o.count) +
                ": in a narrower column of its height they do not fit side by side");
  OrderedJson scene = start("silo");
  const double radius = silo_radius(o.count), top = 2 * kSiloHeight + 1;
  scene["settle"] = {{"material", {{"density", 2500}, {"friction", 0.3}, {"restitution", 0.3}}},
                     {"seed", o.seed},
                     {"duration", 1.5},
                     {"planes", floor_at(0)},
                     {"cylinder", {{"point", {0, 0, 0}}, {"axis", {0, 0, 1}}, {"radius", rounded(radius)}}},
                     {"grains",
                      {{{"count", o.count},
                        {"radius", kSiloGrain},
                        {"low", place(-radius, -radius, 0)},
                        {"high", place(radius, radius, top)}}}}};
  return scene;
}

struct Part {
  Cluster cluster;
  Box box;
  double volume = 0;
};
Part part_of(const MakeOptions& o) {
  Part p{read_cluster(o.cluster), {}, 0};
  if (p.cluster.unit != "m" && !p.cluster.unit.empty())
    throw Error(o.cluster.string() + ": the scene is in metres, and the cluster in " + p.cluster.unit +
                ": pad it with --unit m");
  if (!(p.cluster.mass.volume > 0))
    throw Error(o.cluster.string() + ": the cluster has no mass: pad it from a closed mesh");
  for (std::size_t k = 0; k < p.cluster.size(); k++) p.box.add_ball(p.cluster.centers[k], p.cluster.radii[k]);
  p.volume = p.cluster.mass.volume;
  return p;
}

// A light ball above a bed of padded bodies in a cylinder. The bed is about half as deep as wide, and at most
// 30 bodies deep: a deeper one takes as many times more steps to come to rest.
OrderedJson ball(const MakeOptions& o, const std::filesystem::path& folder) {
  const Part part = part_of(o);
  OrderedJson scene = start("ball");
  scene["clusters"] = {
      {"grain", std::filesystem::relative(o.cluster, folder.empty() ? "." : folder).string()}};
  const double edge = 1.02 * part.box.diagonal(),
               n = static_cast<double>(std::max<std::uint64_t>(o.count, 1));
  const double radius =
      std::max({0.75 * edge * std::cbrt(2 * n / kPi), edge * std::sqrt(n / (30 * kPi)), 2 * edge});
  const double ball = std::min(0.3 * radius, 10 * edge), inner = radius - edge;
  const double top = edge * (std::ceil(1.1 * n * edge * edge / (kPi * inner * inner)) + 2);
  const double over = 1.03 * ball;
  scene["settle"] = {{"material", {{"density", 2500}, {"friction", 0.5}, {"restitution", 0.3}}},
                     {"seed", o.seed},
                     {"duration", 1},
                     {"planes", floor_at(0)},
                     {"cylinder", {{"point", {0, 0, 0}}, {"axis", {0, 0, 1}}, {"radius", rounded(radius)}}},
                     {"grains",
                      {{{"count", o.count},
                        {"cluster", "grain"},
                        {"low", place(-radius, -radius, 0)},
                        {"high", place(radius, radius, top)}},
                       {{"count", 1},
                        {"radius", rounded(ball)},
                        {"density", 250},
                        {"low", place(-over, -over, top)},
                        {"high", place(over, over, top + 2 * over)}}}}};
  return scene;
}

// Shoes in a row along x, their pins along y between them, dropped on a bed of gravel. Two bushings at the
// ends of a pin hold its neighbours as a hinge does. Five shoes in one track; much gravel gets two tracks
// that are as long as a bed ten grains deep can bear.
OrderedJson track(const MakeOptions& o, const std::filesystem::path& folder) {
  const Part part = part_of(o);
  OrderedJson scene = start("track");
  scene["clusters"] = {
      {"shoe", std::filesystem::relative(o.cluster, folder.empty() ? "." : folder).string()}};
  const Vector size = part.box.high - part.box.low;
  const Point middle = part.box.center();
  // The pin runs along the shoe's long side, and the next shoe begins where this one ends.
  const int along = size.x() < size.y() ? 0 : 1, across = 1 - along;
  const double pitch = 1.03 * size[along], grain = 0.03 * size.maxCoeff(), lane = size[across] + 12 * grain;
  const double bulk = static_cast<double>(o.count) * 8 * grain * grain * grain * 1.06;
  const int tracks = bulk > 20 * grain * 2 * lane * 5 * pitch ? 2 : 1;
  const int shoes = std::max(5, static_cast<int>((bulk / (20 * grain * tracks * lane) - 12 * grain) / pitch));
  const double half = 0.5 * shoes * pitch + 6 * grain, wide = 0.5 * tracks * lane;
  // Above the gravel there is room for covers that reach out of the shoe.
  const double top = bulk / (4 * half * wide) + 3.3 * grain, bottom = top + 3 * grain;
  const double weight = 9.81 * 7800 * part.volume, stiffness = weight / (0.01 * pitch) * 10,
               damping = 0.2 * std::sqrt(stiffness * weight / 9.81);
  OrderedJson bodies = OrderedJson::array(), settings = OrderedJson::array(), bushings = OrderedJson::array();
  for (int t = 0; t < tracks; t++)
    for (int k = 0; k < shoes; k++) {
      const auto body = static_cast<int>(bodies.size());
      double at[3] = {0, 0, 0};
      at[along] = (k - 0.5 * (shoes - 1)) * pitch, at[across] = (t - 0.5 * (tracks - 1)) * lane;
      bodies.push_back(
          {{"cluster", "shoe"},
           {"family", 33},  // shoes do not touch each other: what joins them overlaps
           {"position", place(at[0] - middle.x(), at[1] - middle.y(), bottom - part.box.low.z())}});
      settings.push_back({{"body", body}, {"density", 7800}});
      for (const double end : {-0.4, 0.4}) {
        if (k + 1 == shoes) continue;
        double pin[3] = {0, 0, bottom + 0.5 * size.z()};
        pin[along] = at[along] + 0.5 * pitch, pin[across] = at[across] + end * size[across];
        bushings.push_back({{"bodies", {body, body + 1}},
                            {"at", place(pin[0], pin[1], pin[2])},
                            {"stiffness", stiffness},
                            {"damping", damping}});
      }
    }
  scene["bodies"] = std::move(bodies);
  const double x = along == 0 ? half : wide, y = along == 0 ? wide : half;
  OrderedJson planes = floor_at(0);
  for (const double sign : {-1.0, 1.0}) {
    planes.push_back({{"point", place(sign * x, 0, 0)}, {"normal", {-sign, 0, 0}}});
    planes.push_back({{"point", place(0, sign * y, 0)}, {"normal", {0, -sign, 0}}});
  }
  // A shoe's weight presses a grain in by a fiftieth of its radius, whatever the padding is.
  scene["settle"] = {{"material",
                      {{"density", 2500},
                       {"friction", 0.6},
                       {"restitution", 0.2},
                       {"stiffness", weight / (0.02 * 0.7 * grain)}}},
                     {"seed", o.seed},
                     {"duration", 0.6},
                     {"planes", planes},
                     {"grains",
                      {{{"count", o.count},
                        {"radius", {rounded(0.7 * grain), rounded(grain)}},
                        {"low", place(-x, -y, 0)},
                        {"high", place(x, y, top)}}}},
                     {"bodies", settings},
                     {"bushings", bushings}};
  return scene;
}

}  // namespace

double silo_radius(std::uint64_t grains) {
  const double volume = static_cast<double>(grains) * 4 / 3 * kPi * kSiloGrain * kSiloGrain * kSiloGrain;
  return std::sqrt(volume / (kPi * kSiloHeight * kSiloPacking));
}

const std::vector<std::string>& scene_makers() {
  static const std::vector<std::string> names = {"silo", "ball", "track"};
  return names;
}

std::string make_scene(const std::string& name, const MakeOptions& options,
                       const std::filesystem::path& folder) {
  const OrderedJson scene = name == "silo"   ? silo(options)
                            : name == "ball" ? ball(options, folder)
                                             : track(options, folder);
  return scene.dump(1) + "\n";
}

}  // namespace padder::settle
