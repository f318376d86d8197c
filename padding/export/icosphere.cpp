// SPDX-License-Identifier: MIT
#include "padding/export/icosphere.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace padder::exporting {

Icosphere icosphere(int levels) {
  Icosphere s;
  const double g = (1 + std::sqrt(5.0)) / 2;
  for (const auto& [a, b] : {std::pair(1.0, g), {1.0, -g}, {-1.0, g}, {-1.0, -g}})
    for (int k = 0; k < 3; k++) {
      Vector v = Vector::Zero();
      v[k] = a, v[(k + 1) % 3] = b;
      s.points.push_back(v.normalized());
    }
  // Its faces: the triples at the edge's length, turned outwards.
  const double edge = 2 / std::sqrt(1 + g * g) + 1e-9;
  for (std::uint16_t i = 0; i < 12; i++)
    for (std::uint16_t j = i + 1; j < 12; j++)
      for (std::uint16_t k = j + 1; k < 12; k++) {
        const Vector &a = s.points[i], &b = s.points[j], &c = s.points[k];
        if ((a - b).norm() > edge || (b - c).norm() > edge || (c - a).norm() > edge) continue;
        const bool outwards = (b - a).cross(c - a).dot(a) > 0;
        s.corners.insert(s.corners.end(), {i, outwards ? j : k, outwards ? k : j});
      }
  for (int level = 0; level < levels; level++) {
    std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint16_t> middles;
    const auto middle = [&](std::uint16_t a, std::uint16_t b) {
      const auto [it, fresh] =
          middles.emplace(std::minmax({a, b}), static_cast<std::uint16_t>(s.points.size()));
      if (fresh) s.points.push_back((s.points[a] + s.points[b]).normalized());
      return it->second;
    };
    std::vector<std::uint16_t> finer;
    for (std::size_t t = 0; t < s.corners.size(); t += 3) {
      const std::uint16_t a = s.corners[t], b = s.corners[t + 1], c = s.corners[t + 2];
      const std::uint16_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
    }
    s.corners = std::move(finer);
  }
  return s;
}

}  // namespace padder::exporting
