// SPDX-License-Identifier: MIT
#include "padding/self_collision.h"

#include <algorithm>
#include <numbers>
#include <random>
#include <set>

namespace padder {
namespace {

constexpr double kAlways = 0.95;  // of all poses, as MoveIt's setup has it
constexpr int kBlock = 256;       // poses between two looks at which pairs are decided
constexpr std::uint64_t kSeed = 1000003;

// A body's spheres and the ball around them, in its own frame.
struct Part {
  const Cluster* cluster;
  Point center;
  double radius = 0;
};

Part part_of(const Cluster& c) {
  Part part{&c, Point::Zero()};
  Box box;
  for (std::size_t k = 0; k < c.size(); k++) box.add_ball(c.centers[k], c.radii[k]);
  if (c.size() > 0) part.center = 0.5 * (box.low + box.high);
  for (std::size_t k = 0; k < c.size(); k++)
    part.radius = std::max(part.radius, (c.centers[k] - part.center).norm() + c.radii[k]);
  return part;
}

bool touch(const Part& a, const Part& b, const Eigen::Isometry3d& b_in_a) {
  const Point center = b_in_a * b.center;
  if ((center - a.center).norm() > a.radius + b.radius) return false;
  const Cluster &ca = *a.cluster, &cb = *b.cluster;
  for (std::size_t j = 0; j < cb.size(); j++) {
    const Point p = b_in_a * cb.centers[j];
    const double r = cb.radii[j], reach = a.radius + r;
    if ((p - a.center).squaredNorm() > reach * reach) continue;
    for (std::size_t i = 0; i < ca.size(); i++) {
      const double sum = ca.radii[i] + r;
      if ((ca.centers[i] - p).squaredNorm() <= sum * sum) return true;
    }
  }
  return false;
}

// The joints' values of one pose. The bits of the generator are used as they are: the library's distributions
// differ from one standard library to the other.
std::vector<double> random_values(const Model& model, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> out;
  for (const Body& b : model.bodies) {
    const double share = static_cast<double>(random() >> 11) * 0x1p-53;
    double low = b.joint.first_value(), high = low;
    if (b.joint.turns()) low = -std::numbers::pi, high = std::numbers::pi;
    if (b.joint.limited()) low = b.joint.lower, high = b.joint.upper;
    out.push_back(low + share * (high - low));
  }
  return out;
}

// The body at the root of each body's part of the tree, if the tree is cut at the joints that `cut` names.
std::vector<std::size_t> parts_of(const Model& model, bool (*cut)(const Model&, std::size_t)) {
  std::vector<std::size_t> out;
  for (std::size_t b = 0; b < model.bodies.size(); b++) {
    const int parent = model.bodies[b].parent;
    out.push_back(parent < 0 || cut(model, b) ? b : out[static_cast<std::size_t>(parent)]);
  }
  return out;
}

bool is_free(const Model& model, std::size_t body) {
  return model.bodies[body].joint.type == Joint::Type::floating;
}

// Random poses leave the joint where it is, though it moves.
bool is_not_tried(const Model& model, std::size_t body) {
  const Joint& leader = model.bodies[leader_of(model, body).body].joint;
  switch (model.bodies[body].joint.type) {
    case Joint::Type::planar:
    case Joint::Type::floating:
    case Joint::Type::ball:
      return true;
    default:
      return model.bodies[body].joint.moves_one_way() && leader.type == Joint::Type::prismatic &&
             !leader.limited();
  }
}

struct Pair {
  std::size_t a, b;
  int hits = 0;
  bool decided = false;  // it touches in some poses, and not in nearly all: it must be tested
};

}  // namespace

std::vector<Apart> self_collisions(const Model& model, int poses) {
  std::set<std::pair<std::size_t, std::size_t>> known;
  for (const Apart& p : model.apart) known.insert({std::min(p.a, p.b), std::max(p.a, p.b)});
  std::vector<Part> parts;
  for (const Body& b : model.bodies) parts.push_back(part_of(b.cluster));
  std::vector<Pair> pairs;
  for (std::size_t a = 0; a < parts.size(); a++)
    for (std::size_t b = a + 1; b < parts.size(); b++)
      if (parts[a].radius > 0 && parts[b].radius > 0 && !known.contains({a, b})) pairs.push_back({a, b});

  std::vector<Apart> out;
  const auto meets = [&](const Pair& pair, const std::vector<Eigen::Isometry3d>& pose) {
    return touch(parts[pair.a], parts[pair.b], pose[pair.a].inverse() * pose[pair.b]);
  };
  const std::vector<Eigen::Isometry3d> first = poses_at(model, first_values(model));
  const std::vector<std::size_t> held = parts_of(model, is_free);
  for (Pair& pair : pairs)
    if (held[pair.a] == held[pair.b] && meets(pair, first))
      out.push_back({pair.a, pair.b, "Default"}), pair.decided = true;
  const std::vector<std::size_t> tried = parts_of(model, is_not_tried);
  for (Pair& pair : pairs) pair.decided |= tried[pair.a] != tried[pair.b];
  const int most_misses = static_cast<int>((1 - kAlways) * poses);
  for (int begin = 0; begin < poses; begin += kBlock) {
    const int end = std::min(begin + kBlock, poses);
    std::vector<std::vector<Eigen::Isometry3d>> block;
    for (int k = begin; k < end; k++)
      block.push_back(poses_at(model, random_values(model, kSeed + static_cast<std::uint64_t>(k))));
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t p = 0; p < pairs.size(); p++) {
      if (pairs[p].decided) continue;
      for (const auto& pose : block) pairs[p].hits += meets(pairs[p], pose);
      if (pairs[p].hits > 0 && end - pairs[p].hits > most_misses) pairs[p].decided = true;
    }
  }
  for (const Pair& pair : pairs)
    if (!pair.decided && poses > 0) out.push_back({pair.a, pair.b, pair.hits > 0 ? "Always" : "Never"});
  std::sort(out.begin(), out.end(),
            [](const Apart& p, const Apart& q) { return std::pair(p.a, p.b) < std::pair(q.a, q.b); });
  return out;
}

}  // namespace padder
