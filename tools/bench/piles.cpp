// SPDX-License-Identifier: GPL-3.0-or-later
// Piles of padded bodies, from those that barely touch to those that are pressed into each other. The poses
// lie in the GPU's memory and are a little different in each call, as in a simulation that runs there.
#include <algorithm>
#include <memory>

#include "detect/scene/scene.h"
#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

// `spacing`: the edge of a cell of the lattice, in radii of the bounding sphere.
struct Case {
  std::uint32_t bodies;
  double spacing;
};

struct Part {
  std::string name;
  std::vector<detect::Sphere> spheres;  // around the origin
  double bound = 0;                     // the radius of the bounding sphere
};

Part part_of(std::string name, std::vector<detect::Sphere> spheres) {
  const detect::Sphere ball = detect::ball_around(spheres);
  for (detect::Sphere& s : spheres) s.x -= ball.x, s.y -= ball.y, s.z -= ball.z;
  return {std::move(name), std::move(spheres), ball.r};
}

// Sets of poses that follow each other in turn: each body moves by up to a hundredth of its bounding sphere.
std::vector<detect::BodyScene> poses_of(const detect::BodyScene& scene, double bound, int count) {
  std::vector<detect::BodyScene> sets(static_cast<std::size_t>(count), scene);
  detect::SplitMix64 random(scene.bodies.size());
  for (std::size_t k = 1; k < sets.size(); k++)
    for (detect::Body& b : sets[k].bodies)
      for (double& p : b.position) p += 0.01 * bound * random.signed_unit();
  return sets;
}

class Table {
 public:
  explicit Table(const Settings& s) : settings_(s) {}

  void row(const Part& part, const Case& c, detect::BackendKind backend) {
    using detect::Bodies, detect::Order;
    const Settings& s = settings_;
    const bool cuda = backend == detect::BackendKind::cuda;
    const std::uint64_t spheres = std::uint64_t(c.bodies) * part.spheres.size();
    say(s, part.name + " " + std::to_string(c.bodies) + " at " + number(c.spacing, "%g"));
    const std::vector<detect::BodyScene> scenes =
        poses_of({part.spheres, detect::pile(c.bodies, part.bound, c.spacing)}, part.bound, cuda ? 4 : 1);
    std::vector<std::unique_ptr<DeviceBodies>> sets;
    for (const detect::BodyScene& scene : scenes)
      sets.push_back(std::make_unique<DeviceBodies>(scene, ~0u, cuda));
    Json row = {{"scene", part.name}, {"bodies", c.bodies}, {"spacing", c.spacing}, {"spheres", spheres}};
    std::vector<std::string> cells = {part.name, std::to_string(c.bodies), number(c.spacing, "%g")};
    std::uint64_t count = 0, hash = 0;
    const auto measure = [&](const char* key, Bodies bodies, Order order, bool moving) {
      detect::CallOptions o = options_of(s, backend);
      o.width = detect::Width::normals, o.bodies = bodies, o.order = order;
      detect::Detector d({backend}, o);
      std::size_t next = 0;
      const auto call = [&]() -> const detect::Contacts& {
        return detect_watched(d, sets[moving ? next++ % sets.size() : 0]->input());
      };
      for (std::size_t k = 0; k < 2 * sets.size() + 3; k++) call();
      std::vector<double> times;
      for (int k = 0; k < (moving ? 20 * s.repeat : s.repeat); k++) times.push_back(seconds_of(call));
      row[key] = median(times);
      cells.push_back(number(median(times) * 1e3, "%.3f"));
      if (moving) {
        const double worst = *std::max_element(times.begin(), times.end());
        row[std::string(key) + "_worst"] = worst;
        cells.push_back(number(worst * 1e3, "%.3f"));
        return;
      }
      const std::uint64_t found = call().count, found_hash = hash_watched(d);
      if (count && (found != count || found_hash != hash))
        throw Error("bodies first and the expanded bodies differ at " + part.name + " " +
                    std::to_string(c.bodies));
      count = found, hash = found_hash;
    };
    measure("seconds_first", Bodies::first, Order::any, false);
    cells.insert(cells.begin() + 3, {std::to_string(spheres), std::to_string(count)});
    cells.push_back(number(row["seconds_first"].get<double>() * 1e9 / static_cast<double>(count), "%.3f"));
    measure("seconds_moving", Bodies::first, Order::any, true);
    measure("seconds_stable", Bodies::first, Order::stable, false);
    measure("seconds_expanded", Bodies::expanded, Order::any, false);
    measure("seconds_automatic", Bodies::automatic, Order::any, false);
    if (cuda) stages(cells, row, sets.front()->input());
    row["contacts"] = count, row["hash"] = std::to_string(hash), row["backend"] = name_of(backend);
    rows.push_back(row);
    table.push_back(cells);
  }

  Json rows = Json::array();
  Json table = Json::array(
      {{"part", "bodies", "spacing", "spheres", "contacts", "first [ms]", "ns a contact", "moving", "worst",
        "stable", "expanded", "automatic", "place, survey, order, broad, narrow, write"}});

 private:
  // Where the time goes. The host waits for the GPU after each part, so the sum is more than that of a call.
  void stages(std::vector<std::string>& cells, Json& row, const detect::Input& input) {
    detect::CallOptions o;
    o.timings = true, o.bodies = detect::Bodies::first, o.order = detect::Order::any;
    o.width = detect::Width::normals, o.output = detect::Memory::device;
    detect::Detector d({detect::BackendKind::cuda}, o);
    std::vector<double> parts[6];
    for (int k = 0; k < 7; k++) {
      const detect::Seconds& t = detect_watched(d, input).seconds;
      const double of[6] = {t.place, t.stage[0], t.stage[3], t.stage[6], t.stage[7], t.stage[8]};
      for (int p = 0; p < 6; p++)
        if (k > 1) parts[p].push_back(of[p]);
    }
    std::string text;
    Json medians = Json::array();
    for (const std::vector<double>& p : parts) {
      medians.push_back(median(p));
      text += (text.empty() ? "" : " ") + number(median(p) * 1e3, "%.3f");
    }
    row["seconds_of_parts"] = medians;
    cells.push_back(text);
  }

  const Settings& settings_;
};

// --spheres N: piles of N spheres together, at each spacing. --scene: one spacing only.
std::vector<Case> cases_of(const Settings& s, const Part& part, detect::BackendKind backend) {
  const std::pair<const char*, double> spacings[] = {{"loose", 1.5}, {"pressed", 1.0}, {"packed", 0.6}};
  std::vector<Case> cases;
  for (const std::uint64_t n : s.spheres)
    for (const auto& [name, spacing] : spacings)
      cases.push_back(
          {static_cast<std::uint32_t>(std::max<std::uint64_t>(n / part.spheres.size(), 1)), spacing});
  if (cases.empty() && part.spheres.size() > 2000)
    cases = {{10000, 1.5}, {100, 0.6}};
  else if (cases.empty())
    cases = {{20000, 1.5}, {200000, 1.0}, {1000, 0.6}, {200000, 0.6}};
  if (s.spheres.empty() && backend == detect::BackendKind::omp)
    std::erase_if(cases, [](const Case& c) { return c.bodies > 1000; });
  for (const auto& [name, spacing] : spacings)
    if (s.scene == name)
      std::erase_if(cases, [spacing = spacing](const Case& c) { return c.spacing != spacing; });
  return cases;
}

}  // namespace

Json piles(const Settings& s) {
  check_scene(s, "piles", {"loose", "pressed", "packed"});
  std::vector<Part> parts;
  for (const std::string& file : s.files) {
    std::vector<detect::Sphere> spheres = std::move(detect::rungs_of(read_cluster(file))[0].spheres);
    if (spheres.empty()) throw Error(file + " has no spheres: there is nothing to pile");
    parts.push_back(part_of(std::filesystem::path(file).stem().stem().string(), std::move(spheres)));
  }
  if (parts.empty()) parts.push_back(part_of("shell of 64", detect::generate_bodies(1).shape));
  Table t(s);
  for (const Part& part : parts)
    for (const detect::BackendKind backend : backends(s))
      for (const Case& c : cases_of(s, part, backend)) t.row(part, c, backend);
  return {{"bench", "piles"},     {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", t.rows},       {"table", t.table}};
}

}  // namespace padder::bench
