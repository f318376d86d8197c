// SPDX-License-Identifier: MIT
#include "padding/robots/robot_tree.h"

#include <algorithm>

#include "padding/asset/excerpt.h"
#include "padding/export/families.h"

namespace padder {
namespace {

// The rigid groups, parents first. Links that fixed joints connect are one group.
struct Groups {
  std::vector<std::size_t> of;  // for each link its group
  std::vector<char> shapes;     // has the group any?
  std::vector<int> above;       // for each group the nearest one with shapes that holds it; -1: none

  explicit Groups(const RobotTree& robot) {
    std::vector<int> parent;  // for each group the one right above it; -1: none, or it does not hold this one
    for (std::size_t k = 0; k < robot.links.size(); k++) {
      const Body& b = robot.model.bodies[k];
      if (b.parent >= 0 && b.joint.type == Joint::Type::fixed) {
        of.push_back(of[static_cast<std::size_t>(b.parent)]);
      } else {
        of.push_back(parent.size());
        const int up = b.parent < 0 ? -1 : static_cast<int>(of[static_cast<std::size_t>(b.parent)]);
        const bool free = b.joint.type == Joint::Type::floating || (robot.root_is_world && up == 0);
        parent.push_back(free ? -1 : up);
        shapes.push_back(0);
      }
      if (!robot.links[k].shapes.empty()) shapes[of[k]] = 1;
    }
    for (std::size_t g = 0; g < parent.size(); g++) {
      int up = parent[g];
      while (up >= 0 && !shapes[static_cast<std::size_t>(up)]) up = parent[static_cast<std::size_t>(up)];
      above.push_back(up);
    }
  }
};

}  // namespace

std::string first_few(const std::vector<std::string>& names) {
  constexpr std::size_t most = 5;
  std::string text;
  for (std::size_t k = 0; k < std::min(most, names.size()); k++)
    text += (k > 0 ? ", " : "") + excerpt(names[k]);
  return names.size() > most ? text + " and others" : text;
}

void note_bare(RobotTree& robot, const std::vector<std::string>& links, bool visual) {
  if (links.empty()) return;
  robot.notes.push_back(
      (visual ? "links that have collision geometry alone get no spheres: "
              : "links that have visual geometry alone get no spheres (--visual pads the visual geometry of "
                "all links instead): ") +
      first_few(links));
}

std::vector<std::pair<std::size_t, std::size_t>> neighbours(const RobotTree& robot) {
  const Groups groups(robot);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < robot.links.size(); i++)
    for (std::size_t j = i + 1; j < robot.links.size(); j++) {
      if (robot.links[i].shapes.empty() || robot.links[j].shapes.empty()) continue;
      const std::size_t a = groups.of[i], b = groups.of[j];
      if (a == b || groups.above[a] == static_cast<int>(b) || groups.above[b] == static_cast<int>(a))
        pairs.emplace_back(i, j);
    }
  return pairs;
}

void keep_neighbours_apart(RobotTree& robot) {
  for (const auto& [i, j] : neighbours(robot)) robot.model.apart.push_back({i, j});
  const auto with_shapes = [](const RobotLink& link) { return !link.shapes.empty(); };
  if (std::ranges::count_if(robot.links, with_shapes) < 2) return;  // nobody to be kept apart from
  const Groups groups(robot);
  std::vector<std::size_t> number(groups.above.size());  // counts the groups with shapes
  std::size_t count = 0;
  for (std::size_t g = 0; g < number.size(); g++)
    if (groups.shapes[g]) number[g] = count++;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t g = 0; g < number.size(); g++)
    if (groups.shapes[g] && groups.above[g] >= 0)
      pairs.emplace_back(number[static_cast<std::size_t>(groups.above[g])], number[g]);
  const auto families = families_of(count, pairs);
  if (!families) return;
  for (std::size_t k = 0; k < robot.links.size(); k++) {
    if (robot.links[k].shapes.empty()) continue;
    const CollisionFilter& f = (*families)[number[groups.of[k]]];
    robot.model.bodies[k].cluster.family = f.family, robot.model.bodies[k].cluster.mask = f.mask;
  }
}

}  // namespace padder
