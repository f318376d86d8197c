// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cavities/shells.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "padding/meshing/pieces.h"

namespace padder {
namespace {

// A level of detail holds at least this share of what the level around it does (a ball of 48 triangles holds
// 0.76 of a round one), and has at most this share of its triangles.
constexpr double kLeastLevel = 0.7, kCoarser = 0.5;
// Corners lie on a shell that is nearer than this share of the diagonal, and much nearer than the middles of
// triangles at this share of their distance. Along a wall the two are about equal.
constexpr double kOnShell = 1e-4, kMuchNearer = 0.3;

// Mean distances of the corners and of the middles of triangles, over the area.
struct ShellDistance {
  double corners = 0, middles = 0;
};
ShellDistance distance_between(const Mesh& mesh, const std::vector<std::uint32_t>& shell,
                               const Surface& other) {
  constexpr std::size_t wanted = 256;
  EvenSteps steps(area_of(mesh, shell), wanted);
  ShellDistance out;
  for (const auto t : shell) {
    const std::size_t asked = steps.next(mesh.area_normal(t).norm());
    if (asked == 0) continue;
    const double weight = double(asked) / wanted;
    for (const Point& p : mesh.corners(t)) out.corners += weight * other.nearest(p).distance / 3;
    out.middles += weight * other.nearest(mesh.middle(t)).distance;
  }
  return out;
}

}  // namespace

bool is_copy(const Surface& surface, const std::vector<std::uint32_t>& triangles, double between,
             const std::function<bool(std::uint32_t)>& other) {
  const Mesh& mesh = surface.mesh();
  const double width = between * std::abs(signed_volume(mesh, triangles)) / area_of(mesh, triangles);
  const auto follows = [&](const Point& p) {
    bool near = false;
    surface.visit({p - Vector::Constant(width), p + Vector::Constant(width)},
                  [&](std::uint32_t t) { near = near || (other(t) && surface.distance_to(t, p) <= width); });
    return near;
  };
  return std::all_of(triangles.begin(), triangles.end(), [&](std::uint32_t t) {
    return std::ranges::all_of(mesh.corners(t), follows) && follows(mesh.middle(t));
  });
}

std::vector<std::uint32_t> shells_around(const Surface& surface, const std::vector<std::uint32_t>& shell,
                                         const std::vector<std::uint32_t>& shell_of,
                                         const std::function<bool(std::uint32_t)>& skip) {
  const Mesh& mesh = surface.mesh();
  const auto t = shell[0], own = shell_of[t];
  // Others may have its corners and edges.
  const Point p = mesh.middle(t);
  std::map<std::uint32_t, int> windings;  // of each shell
  const auto left_out = [&](std::uint32_t s) { return shell_of[s] == own || skip(s); };
  std::vector<std::uint32_t> around;
  for (const Vector& d : Surface::ray_directions()) {
    windings.clear();
    const auto visit = [&](std::uint32_t s, int crossing) { windings[shell_of[s]] += crossing; };
    if (!surface.crossings(p, d, left_out, visit)) continue;
    // A shell that repeats winds twice around what it encloses.
    for (const auto& [other, winding] : windings)
      if (winding != 0) around.push_back(other);
    break;
  }
  return around;
}

std::vector<char> find_repeats(const Mesh& mesh, const std::vector<NestedShell>& shells) {
  constexpr std::uint32_t none = ~0u;
  const auto count = static_cast<std::uint32_t>(shells.size());
  // The shell next around each one, if it may be a level of that one.
  std::vector<std::uint32_t> next(count, none);
  for (std::uint32_t k = 0; k < count; k++) {
    const NestedShell& shell = shells[k];
    for (const auto a : shell.around)
      if (next[k] == none || shells[a].volume < shells[next[k]].volume) next[k] = a;
    if (next[k] != none &&
        (shells[next[k]].inward != shell.inward || shell.volume < kLeastLevel * shells[next[k]].volume))
      next[k] = none;
  }
  const auto coarser = [&](std::uint32_t k) {
    return next[k] != none &&
           double(shells[k].triangles.size()) <= kCoarser * double(shells[next[k]].triangles.size());
  };
  std::vector<char> repeats(count, 0);
  for (std::uint32_t k = 0; k < count; k++)
    if (coarser(k) && coarser(next[k])) repeats[k] = repeats[next[k]] = 1;
  for (std::uint32_t k = 0; k < count; k++) {
    if (repeats[k] || next[k] == none) continue;
    const Surface around(part_of(mesh, shells[next[k]].triangles));
    const ShellDistance distance = distance_between(mesh, shells[k].triangles, around);
    repeats[k] = distance.corners <= kOnShell * bounds_of(mesh, shells[k].triangles).diagonal() ||
                 (coarser(k) && distance.corners <= kMuchNearer * distance.middles);
  }
  return repeats;
}

}  // namespace padder
