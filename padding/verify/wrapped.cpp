// SPDX-License-Identifier: MIT
#include "padding/verify/wrapped.h"

#include <algorithm>
#include <array>
#include <map>

#include "padding/geometry/indices.h"
#include "padding/geometry/triangle.h"

namespace padder {
namespace {

constexpr double kSmallestPart = 1e-9;  // share of the mesh's diagonal: below it, rounding decides

TrianglePart part_of(const Mesh& mesh, std::size_t t) {
  return {mesh.corners(t), static_cast<std::uint32_t>(t)};
}

double standoff(const TrianglePart& whole, const Surface& input, double slack, double smallest) {
  double lower = 0, upper = 0;
  std::vector<TrianglePart> stack = {whole};
  while (!stack.empty()) {
    const TrianglePart part = stack.back();
    stack.pop_back();
    const Nearest at = input.nearest(part.centroid());
    lower = std::max(lower, at.distance);
    // Either bound is proved: the triangle nearest to the centroid, or that distances grow no faster than the
    // way. The second saves a cut where the input's triangles are far smaller than the part.
    double bound = 0;
    for (const Point& p : part.corner) bound = std::max(bound, input.distance_to(at.triangle, p));
    bound = std::min(bound, at.distance + part.radius());
    if (bound <= lower + slack || part.size() <= smallest) {
      upper = std::max(upper, bound);
      continue;
    }
    for (const TrianglePart& half : bisect(part)) stack.push_back(half);
  }
  return upper;
}

// Divides a part into what is not deeper than `depth`, sides[0], and what is. A part that is all on one side
// is appended as one, so that cuts stay only along the limit.
void divide(const TrianglePart& part, const Surface& wrap, double depth, double grain,
            std::array<std::vector<TrianglePart>, 2>& sides) {
  const double radius = part.radius(), distance = wrap.nearest(part.centroid(), depth + radius).distance;
  const bool deep = !(distance < depth + radius);
  if (!deep && distance + radius > depth && part.size() > grain) {
    const std::size_t before[2] = {sides[0].size(), sides[1].size()};
    for (const TrianglePart& half : bisect(part)) divide(half, wrap, depth, grain, sides);
    if (sides[0].size() > before[0] && sides[1].size() > before[1]) return;
    const bool all_deep = sides[1].size() > before[1];
    sides[all_deep].resize(before[all_deep]);
    sides[all_deep].push_back(part);
  } else {
    sides[deep].push_back(part);
  }
}

}  // namespace

std::vector<double> standoffs(const Mesh& mesh, const Surface& input, double slack) {
  const double smallest = kSmallestPart * mesh.bounds().diagonal();
  std::vector<double> found(mesh.triangles.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t t = 0; t < found.size(); t++)
    found[t] = standoff(part_of(mesh, t), input, slack, smallest);
  return found;
}

std::vector<ClosedSlot> closed_slots(const Mesh& wrap, const std::vector<double>& standoff, double allowed) {
  std::vector<std::uint32_t> far;
  for (std::uint32_t t = 0; t < standoff.size(); t++)
    if (standoff[t] > allowed) far.push_back(t);
  std::vector<std::uint32_t> pieces = numbered(far.size());
  std::map<std::uint64_t, std::uint32_t> first_at;  // edge: the first triangle with it
  for (std::uint32_t k = 0; k < far.size(); k++)
    for (int side = 0; side < 3; side++) {
      const std::uint32_t v = wrap.triangles[far[k]][side], w = wrap.triangles[far[k]][(side + 1) % 3];
      const auto [at, fresh] = first_at.emplace(edge_of(v, w), k);
      if (!fresh) join(pieces, at->second, k);
    }
  std::map<std::uint32_t, ClosedSlot> slots;
  for (std::uint32_t k = 0; k < far.size(); k++) {
    ClosedSlot& slot = slots[root_of(pieces, k)];
    slot.triangles.push_back(far[k]);
    slot.area += wrap.area_normal(far[k]).norm();
    if (2 * standoff[far[k]] > slot.width)
      slot.width = 2 * standoff[far[k]], slot.place = wrap.middle(far[k]);
  }
  std::vector<ClosedSlot> sorted;
  for (auto& [piece, slot] : slots) sorted.push_back(std::move(slot));
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const ClosedSlot& a, const ClosedSlot& b) { return a.width > b.width; });
  return sorted;
}

Touchable touchable(const Mesh& input, const Surface& wrap, double depth, double grain) {
  std::vector<std::array<std::vector<TrianglePart>, 2>> sides(input.triangles.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t t = 0; t < sides.size(); t++) divide(part_of(input, t), wrap, depth, grain, sides[t]);
  Touchable found;
  for (const auto& [kept, buried] : sides) {
    for (const TrianglePart& part : kept) found.mesh.add(part.corner);
    for (const TrianglePart& part : buried) found.buried.add(part.corner);
  }
  return found;
}

}  // namespace padder
