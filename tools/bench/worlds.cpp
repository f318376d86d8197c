// SPDX-License-Identifier: GPL-3.0-or-later
// Many worlds in one call, as reinforcement learning and motion planning have them: pairs of bodies in 8,192
// worlds, and 100,000 configurations of a robot arm against obstacles that are given once. Beside them, one
// configuration after another: Bullet and FCL on the CPU. And loose spheres of many worlds at one place,
// beside as many without worlds.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/asset/cluster.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/bench/peers/bodies.h"

namespace padder::bench {
namespace {

using detect::Body;
using detect::Sphere;

// A scene of worlds. The bodies of world w are bodies[w * each] to bodies[(w + 1) * each - 1].
struct WorldScene {
  std::string name;
  std::vector<SphereList> spheres;  // of each shape
  std::vector<Body> bodies;
  SphereList obstacles;  // loose spheres of every world
  std::uint32_t worlds = 0, each = 0;
};

// Two bodies of 64 spheres in each world, which stand at the same place.
WorldScene pairs_of_bodies(std::uint32_t worlds) {
  WorldScene s{"two bodies", {detect::generate_bodies(1).shape}, {}, {}, worlds, 2};
  detect::SplitMix64 random(12345 + worlds);
  for (std::uint32_t w = 0; w < worlds; w++)
    for (int k = 0; k < 2; k++) {
      Body b;
      double q[4];
      for (double& c : q) c = random.signed_unit();
      detect::rotation_of(q[0], q[1], q[2], q[3], b.rotation);
      for (double& c : b.position) c = 4 * random.signed_unit();
      b.world = w;
      s.bodies.push_back(b);
    }
  return s;
}

// The arm has the lengths of Franka Emika's Panda, by the parameters of its joints in the form of Craig (a,
// d, alpha): seven joints, the hand at the flange, and two fingers in it.
struct Joint {
  double a, d, alpha, low, high;
};
constexpr double kQuarter = std::numbers::pi / 2;
constexpr Joint kJoints[] = {{0, 0.333, 0, -2.8973, 2.8973},
                             {0, 0, -kQuarter, -1.7628, 1.7628},
                             {0, 0.316, kQuarter, -2.8973, 2.8973},
                             {0.0825, 0, kQuarter, -3.0718, -0.0698},
                             {-0.0825, 0.384, -kQuarter, -2.8973, 2.8973},
                             {0, 0, kQuarter, -0.0175, 3.7525},
                             {0.088, 0, kQuarter, -2.8973, 2.8973},
                             {0, 0.107, 0, -std::numbers::pi / 4, -std::numbers::pi / 4}};
constexpr std::uint32_t kHand = 8, kLinks = 11;  // link 0 is the base

// `body` in the frame that turns by `angle` about the joint which stands in it.
Body after(const Body& body, const Joint& j, double angle) {
  const double ca = std::cos(j.alpha), sa = std::sin(j.alpha), ct = std::cos(angle), st = std::sin(angle);
  const double r[9] = {ct, -st, 0, st * ca, ct * ca, -sa, st * sa, ct * sa, ca},
               p[3] = {j.a, -sa * j.d, ca * j.d};
  Body out;
  for (int row = 0; row < 3; row++) {
    out.position[row] = body.position[row];
    for (int k = 0; k < 3; k++) {
      out.position[row] += body.rotation[3 * row + k] * p[k];
      out.rotation[3 * row + k] = 0;
      for (int q = 0; q < 3; q++) out.rotation[3 * row + k] += body.rotation[3 * row + q] * r[3 * q + k];
    }
  }
  return out;
}

// Where the bench was given no clusters: 73 spheres on a capsule about each link, 803 together.
SphereList capsule(double length) {
  SphereList spheres;
  for (int k = 0; k < 73; k++) {
    const double around = k * std::numbers::pi * (3 - std::sqrt(5.0));
    spheres.push_back({0.04 * std::cos(around), 0.04 * std::sin(around), length * (k + 0.5) / 73, 0.03});
  }
  return spheres;
}

// Finger 0 or 1 of a hand that is open by `width`.
Body finger(const Body& hand, int which, double width) {
  const Sphere at = placed(hand, {0, which == 0 ? width : -width, 0.0584, 0});
  Body out = hand;
  out.position[0] = at.x, out.position[1] = at.y, out.position[2] = at.z;
  return out;
}

WorldScene arm(const Settings& s, std::uint32_t worlds) {
  WorldScene scene{"Panda", {}, {}, {}, worlds, kLinks};
  if (s.files.empty()) {
    for (const double length : {0.2, -0.2, 0.2, -0.12, 0.12, -0.38, 0.1, 0.1, 0.06, 0.05, 0.05})
      scene.spheres.push_back(capsule(length));
    scene.name = "arm of capsules";
  } else if (s.files.size() != kLinks) {
    wrong_usage(
        "the clusters of the Panda's links are wanted: link 0 to 7, hand, left finger and right finger");
  }
  for (const std::string& file : s.files) {
    const Cluster c = read_cluster(file);
    SphereList& to = scene.spheres.emplace_back();
    for (std::size_t k = 0; k < c.size(); k++)
      to.push_back({c.centers[k].x(), c.centers[k].y(), c.centers[k].z(), c.radii[k]});
  }
  detect::SplitMix64 random(12345 + worlds);
  for (std::uint32_t w = 0; w < worlds; w++) {
    Body link, hand;
    for (std::uint32_t k = 0; k < kLinks; k++) {
      if (k > kHand) {
        link = finger(hand, static_cast<int>(k - kHand - 1), 0.04 * random.unit());
      } else if (k > 0) {
        const Joint& j = kJoints[k - 1];
        link = after(link, j, j.low + (j.high - j.low) * random.unit());
      }
      if (k == kHand) hand = link;
      link.shape = k, link.family = 1,
      link.world = w;  // one family: the links are not tested with each other
      scene.bodies.push_back(link);
    }
  }
  while (scene.obstacles.size() < 200) {
    const double x = random.signed_unit(), y = random.signed_unit(), z = 0.3 + random.signed_unit();
    if (std::hypot(x, y) < 0.3) continue;  // no obstacle stands in the base
    scene.obstacles.push_back({x, y, z, 0.02 + 0.03 * random.unit()});
  }
  return scene;
}

// The scene as the detector takes it: poses, and obstacles, on the device if there is one.
class WorldInput {
 public:
  WorldInput(const WorldScene& scene, bool on_device) {
    for (const auto& s : scene.spheres) shapes_.push_back({s.data(), s.size()});
    input_.shapes = shapes_, input_.bodies = scene.bodies, input_.revision = 1;
    if (!scene.obstacles.empty())
      input_.spheres =
          detect::spheres_of<double>(scene.obstacles.size(), &scene.obstacles[0].x, &scene.obstacles[0].r);
    input_.spheres.center_stride = input_.spheres.radius_stride = 4;
    input_.spheres.world_of_all = detect::kEveryWorld;
    if (!kWithCuda || !on_device) return;
    input_.poses = poses_.copy(scene.bodies, "the worlds"), input_.pose_memory = detect::Memory::device;
    detect::Spheres& s = input_.spheres;
    s.centers =
        obstacles_.copy(scene.obstacles.data(), scene.obstacles.size() * sizeof(Sphere), "the worlds");
    s.radii = static_cast<const double*>(s.centers) + 3, s.memory = detect::Memory::device;
  }
  const detect::Input& input() const { return input_; }

 private:
  std::vector<detect::Shape> shapes_;
  detect::Input input_;
  DeviceArray poses_, obstacles_;
};

class Table {
 public:
  explicit Table(const Settings& s) : settings_(s) {}

  void rows_of(const WorldScene& scene, bool list) {
    // One configuration after another takes the CPU long enough: its time for one is that of some of them.
    WorldScene some = scene;
    some.worlds = std::min(scene.worlds, 2000u);
    some.bodies.resize(std::size_t(some.worlds) * some.each);
    std::vector<std::pair<std::string, std::uint64_t>> by_peers;
    for (const auto make : {make_bullet_bodies, make_fcl_bodies})
      if (const auto peer = make(some.spheres, some.obstacles))
        by_peers.emplace_back(peer->name(), peer_row(some, *peer, list));
    for (const detect::BackendKind backend : backends(settings_)) {
      const bool cuda = backend == detect::BackendKind::cuda;
      const std::uint64_t found = row(cuda ? scene : some, backend, list);
      for (const auto& [name, by_peer] : by_peers)
        if (!cuda && by_peer != found)
          say(settings_,
              name + " found " + std::to_string(by_peer) + ", the detector " + std::to_string(found));
    }
  }

  // Loose spheres, as dense as those of `bench scaling`: of many worlds at one place, or as many of one. The
  // first `obstacles` of them are of every world.
  void loose_row(std::uint32_t worlds, std::uint32_t each, std::size_t obstacles,
                 detect::BackendKind backend) {
    const bool cuda = backend == detect::BackendKind::cuda;
    std::vector<detect::FloatSphere> spheres(std::size_t(worlds) * each);
    std::vector<std::uint32_t> world(spheres.size());
    const double edge = std::cbrt(11.5 * each);
    detect::SplitMix64 random(12345 + each);
    const auto at = [&] { return static_cast<float>(edge * random.unit()); };
    for (std::size_t k = 0; k < spheres.size(); k++)
      spheres[k] = {at(), at(), at(), 1}, world[k] = static_cast<std::uint32_t>(k % worlds);
    std::fill_n(world.begin(), obstacles, detect::kEveryWorld);
    const DeviceSpheres on_device(spheres, cuda);
    detect::Input input = on_device.input();
    DeviceArray worlds_on_device;
    if (worlds > 1) {
      const void* copy =
          cuda ? worlds_on_device.copy(world.data(), world.size() * sizeof world[0], "the worlds")
               : world.data();
      input.spheres.world = static_cast<const std::uint32_t*>(copy);
    }
    detect::Detector d({backend}, options_of(settings_, backend));
    for (int k = 0; k < 3; k++) detect_watched(d, input);
    const double t =
        median_seconds(std::max(settings_.repeat, cuda ? 21 : 5), [&] { detect_watched(d, input); });
    add(obstacles ? "loose spheres, some of every world" : "loose spheres", each, "list", worlds,
        detect_watched(d, input).count, name_of(backend), t);
  }

  Json rows = Json::array();
  Json table = Json::array(
      {{"scene", "answer", "worlds", "spheres in each", "found", "by", "call [ms]", "us a world"}});

 private:
  // Returns the contacts, or the worlds that have some.
  std::uint64_t row(const WorldScene& scene, detect::BackendKind backend, bool list) {
    const bool cuda = backend == detect::BackendKind::cuda;
    const WorldInput input(scene, cuda);
    const detect::CallOptions o = options_of(settings_, backend);
    detect::Detector d({backend}, o);
    const int repeat = std::max(settings_.repeat, cuda ? 21 : 3);
    const char* by = name_of(backend);
    if (list) {
      for (int k = 0; k < 3; k++) detect_watched(d, input.input());
      const double t = median_seconds(repeat, [&] { detect_watched(d, input.input()); });
      const std::uint64_t found = detect_watched(d, input.input()).count;
      add(scene, "list", found, by, t);
      return found;
    }
    std::uint64_t with_contacts = 0;
    for (const auto& [answer, name] : {std::pair(detect::Answer::any, "any"),
                                       {detect::Answer::count, "count"},
                                       {detect::Answer::distance, "distance"}}) {
      d.options().margin = answer == detect::Answer::distance ? 0.05 : 0;
      const auto ask = [&, which = answer] { d.detect_worlds(input.input(), scene.worlds, which); };
      ask(), ask();
      const double t = median_seconds(repeat, ask);
      if (answer == detect::Answer::any) {
        d.options().output = detect::Memory::host;
        const detect::WorldAnswers a = d.detect_worlds(input.input(), scene.worlds, answer);
        with_contacts = static_cast<std::uint64_t>(std::count(a.any, a.any + scene.worlds, 1));
        d.options().output = o.output;
      }
      add(scene, name, with_contacts, by, t);
    }
    return with_contacts;
  }

  std::uint64_t peer_row(const WorldScene& scene, BodyPeer& peer, bool list) {
    std::uint64_t found = 0;
    const auto all = [&] {
      found = 0;
      for (std::uint32_t w = 0; w < scene.worlds; w++)
        found += peer.contacts({&scene.bodies[std::size_t(w) * scene.each], scene.each}, !list);
    };
    const double t = median_seconds(3, all);
    add(scene, list ? "list" : "any", found, peer.name(), t);
    return found;
  }

  void add(const WorldScene& scene, const char* answer, std::uint64_t found, const char* by, double seconds) {
    std::size_t spheres = 0;
    for (std::uint32_t k = 0; k < scene.each; k++) spheres += scene.spheres[scene.bodies[k].shape].size();
    add(scene.name, spheres, answer, scene.worlds, found, by, seconds);
  }
  void add(const std::string& scene, std::size_t spheres, const char* answer, std::uint32_t worlds,
           std::uint64_t found, const char* by, double seconds) {
    const double each = seconds / worlds;
    rows.push_back({{"scene", scene},
                    {"answer", answer},
                    {"worlds", worlds},
                    {"spheres", spheres},
                    {"found", found},
                    {"by", by},
                    {"seconds", seconds},
                    {"seconds_each", each}});
    table.push_back({scene, answer, std::to_string(worlds), std::to_string(spheres), std::to_string(found),
                     by, number(seconds * 1e3, "%.3f"), number(each * 1e6, "%.4f")});
  }
  const Settings& settings_;
};

}  // namespace

Json worlds(const Settings& s) {
  const WorldScene of_arms = arm(s, static_cast<std::uint32_t>(size_or(s, 100000)));  // reads its files first
  Table t(s);
  t.rows_of(pairs_of_bodies(static_cast<std::uint32_t>(size_or(s, 8192))), true);
  t.rows_of(of_arms, false);
  for (const detect::BackendKind backend : backends(s))
    for (const auto& [of_world, obstacles] :
         {std::pair(100u, 0u), {10000u, 0u}, {1000000u, 0u}, {100u, 10u}, {10000u, 1000u}})
      t.loose_row(1000000 / of_world, of_world, obstacles, backend);
  return {{"bench", "worlds"},    {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", t.rows},       {"table", t.table}};
}

}  // namespace padder::bench
