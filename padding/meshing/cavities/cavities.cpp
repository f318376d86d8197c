// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/cavities/cavities.h"

#include <Eigen/Geometry>
#include <cmath>

#include "padding/geometry/random.h"
#include "padding/meshing/cavities/shells.h"
#include "padding/meshing/pieces.h"

namespace padder {
namespace {

class CavityFinder {
 public:
  CavityFinder(const Surface& surface, const Units& units, double diagonal)
      : surface_(surface),
        soup_(surface.mesh()),
        roles_(units.roles),
        unit_(units.unit_of),
        count_(units.count),
        inward_(units.inward),
        diagonal_(diagonal) {}

  Cavities run(const Contacts& contacts) const {
    std::vector<char> meets(count_, 0);
    for (const auto& [s, t] : contacts.pairs)
      if (unit_[s] != unit_[t] && roles_[s] != TriangleRole::sheet && roles_[t] != TriangleRole::sheet)
        meets[unit_[s]] = meets[unit_[t]] = 1;
    Cavities out = find_nested(meets);
    find_cuts(meets, out.cavity);
    return out;
  }

 private:
  Cavities find_nested(const std::vector<char>& meets) const {
    std::vector<NestedShell> shells(count_);
    for (std::uint32_t t = 0; t < unit_.size(); t++)
      if (roles_[t] != TriangleRole::sheet) shells[unit_[t]].triangles.push_back(t);
    const auto is_sheet = [&](std::uint32_t t) { return roles_[t] == TriangleRole::sheet; };
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t u = 0; u < count_; u++) {
      NestedShell& shell = shells[u];
      if (shell.triangles.empty()) continue;
      shell.inward = u < inward_.size() && inward_[u];
      shell.volume = std::abs(signed_volume(soup_, shell.triangles));
      if (!meets[u]) shell.around = shells_around(surface_, shell.triangles, unit_, is_sheet);
    }
    Cavities out{std::vector<char>(count_, 0), find_repeats(soup_, shells)};
    for (std::size_t u = 0; u < count_; u++) {
      std::erase_if(shells[u].around, [&](std::uint32_t a) { return out.copy[a]; });
      out.cavity[u] = !out.copy[u] && shells[u].around.size() % 2 != 0;
    }
    return out;
  }

  // A closed unit that faces inward and meets others was cut out of them: the winding number of the file is 0
  // or less within it. It is a cavity, if no more than half of it sticks out, and it has walls in the others:
  // the copy of a body that faces the other way has none. Where it sticks out, walls count if they are deep,
  // which those of a copy that is moved a little are not; nor is a copy of one of several bodies that touch a
  // cavity, though it has the others for walls. Points on the unit tell, at even steps of its area.
  void find_cuts(const std::vector<char>& meets, std::vector<char>& cavity) const {
    constexpr double least_wall = 0.01;    // share of the area
    constexpr double deep_wall = 1e-3;     // of the diagonal
    constexpr double most_between = 0.05;  // of the volume; what sticks out is the more surely no cavity
    constexpr std::size_t wanted = 1024;
    struct Probe {
      std::uint32_t unit;
      Point place;
      Vector out;  // of length 1
      bool within = false, wall = false, deep = false;
    };
    const std::size_t units = inward_.size();
    const auto is_inward = [&](std::uint32_t t) { return unit_[t] < units && inward_[unit_[t]]; };
    std::vector<double> area(units, 0);
    struct Count {
      std::size_t all = 0, outside = 0, walls = 0, deep = 0;
    };
    std::vector<Count> count(units);
    for (std::uint32_t t = 0; t < unit_.size(); t++)
      if (is_inward(t) && meets[unit_[t]]) area[unit_[t]] += soup_.area_normal(t).norm();
    std::vector<EvenSteps> steps;
    for (const double a : area) steps.emplace_back(a, wanted);
    std::vector<Probe> probes;
    Random random(1);
    for (std::uint32_t t = 0; t < unit_.size(); t++) {
      const auto u = unit_[t];
      if (!is_inward(t) || !(area[u] > 0)) continue;
      const Vector normal = soup_.area_normal(t);
      const std::size_t more = steps[u].next(normal.norm());
      for (std::size_t k = 0; k < more; k++)
        probes.push_back({u, random_point(random, soup_.corners(t)), normal.normalized()});
      count[u].all += more;
    }
    const auto in_others = [&](const Point& p) {
      const auto skip = [&](std::uint32_t t) { return roles_[t] == TriangleRole::sheet || is_inward(t); };
      for (const Vector& d : Surface::ray_directions())
        if (const auto around = surface_.crossings(p, d, skip)) return *around > 0;
      return false;
    };
#pragma omp parallel for schedule(dynamic, 16)
    for (std::size_t k = 0; k < probes.size(); k++) {
      Probe& probe = probes[k];
      const auto at = [&](double step) { return in_others(probe.place + step * diagonal_ * probe.out); };
      probe.within = at(-1e-7), probe.wall = at(1e-7), probe.deep = probe.wall && at(deep_wall);
    }
    for (const Probe& probe : probes) {
      Count& c = count[probe.unit];
      c.outside += !probe.within, c.walls += probe.wall, c.deep += probe.deep;
    }
    std::vector<std::vector<std::uint32_t>> cuts(units);
    for (std::uint32_t t = 0; t < unit_.size(); t++) {
      if (!is_inward(t) || !meets[unit_[t]]) continue;
      const Count& c = count[unit_[t]];
      if (2 * c.outside <= c.all && double(c.outside > 0 ? c.deep : c.walls) > least_wall * double(c.all))
        cuts[unit_[t]].push_back(t);
    }
    for (std::size_t u = 0; u < units; u++)
      if (!cuts[u].empty() &&
          (count[u].outside == 0 || !is_copy(surface_, cuts[u], most_between, [&](std::uint32_t t) {
             return roles_[t] != TriangleRole::sheet && !is_inward(t);
           })))
        cavity[u] = 1;
  }

  const Surface& surface_;
  const Mesh& soup_;
  const std::vector<TriangleRole>& roles_;
  const std::vector<std::uint32_t>& unit_;
  const std::size_t count_;
  const std::vector<char>& inward_;
  const double diagonal_;
};

}  // namespace

Cavities find_cavities(const Surface& surface, const Units& units, const Contacts& contacts,
                       double diagonal) {
  return CavityFinder(surface, units, diagonal).run(contacts);
}

}  // namespace padder
