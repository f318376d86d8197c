// SPDX-License-Identifier: MIT
// What can be asked of a stepper between two steps: energies, contacts, a snapshot.
#include <algorithm>
#include <cmath>

#include "padding/asset/error.h"
#include "tools/settle/stepper.h"

namespace padder::settle {

Watch Stepper::watch() {
  place();
  Watch w;
  for (std::size_t m = 0; m < s_.movers(); m++) {
    w.fastest = std::max(w.fastest, length(s_.velocity[m]));
    if (s_.inverse_mass[m] == 0) continue;
    const double mass = 1 / s_.inverse_mass[m];
    w.kinetic += 0.5 * mass * dot(s_.velocity[m], s_.velocity[m]) + 0.5 * dot(s_.spin[m], s_.momentum[m]);
    w.potential -= mass * dot(s_.gravity, s_.position[m]);
    w.momentum = w.momentum + mass * s_.velocity[m];
  }
  const auto stored = [&](double depth, const Vec3& spring) {
    if (depth >= 0)
      w.elastic +=
          0.5 * s_.law.stiffness * depth * depth + 0.5 * s_.law.tangential_stiffness * dot(spring, spring);
  };
  for (std::size_t c = 0; c < pairs_.size(); c++) {
    const detect::Sphere &a = centers_[pairs_[c].i], &b = centers_[pairs_[c].j];
    if (detect::touching(a, b)) stored(detect::geometry(a, b).depth, springs_[c]);
  }
  for (std::size_t c = 0; c < wall_pairs_.size(); c++) {
    const detect::Sphere& a = centers_[wall_pairs_[c].sphere];
    stored(contact_with(s_.walls[wall_pairs_[c].wall], {a.x, a.y, a.z}, a.r).depth, wall_springs_[c]);
  }
  for (const Bushing& u : s_.bushings) {
    const Vec3 apart = s_.position[u.a] + times(s_.bodies[u.a].rotation, u.on_a) - s_.position[u.b] -
                       times(s_.bodies[u.b].rotation, u.on_b);
    w.elastic += 0.5 * u.stiffness * dot(apart, apart);
  }
  w.deepest = deepest_, w.deepest_ratio = deepest_ratio_;
  return w;
}

std::vector<detect::Pair> Stepper::touching_pairs() const {
  std::vector<detect::Pair> found;
  for (const detect::Pair& p : pairs_)
    if (detect::touching(centers_[p.i], centers_[p.j])) found.push_back(p);
  return found;
}

Snapshot Stepper::snapshot() const {
  Snapshot s{steps_, s_.position, s_.velocity, s_.momentum, s_.spin, s_.orientation, {}, {}};
  for (std::size_t c = 0; c < pairs_.size(); c++)
    if (springs_[c] != Vec3{}) s.contacts.push_back({pairs_[c].i, pairs_[c].j, springs_[c]});
  for (std::size_t c = 0; c < wall_pairs_.size(); c++)
    if (wall_springs_[c] != Vec3{})
      s.walls.push_back({wall_pairs_[c].sphere, wall_pairs_[c].wall, wall_springs_[c]});
  return s;
}

void Stepper::resume(const Snapshot& s) {
  const auto bad = [&](const SpringMemory& m, std::size_t others) {
    return m.i >= centers_.size() || m.j >= others;
  };
  bool fits = s.position.size() == s_.movers() && s.velocity.size() == s_.movers() &&
              s.momentum.size() == s_.movers() && s.spin.size() == s_.movers() &&
              s.orientation.size() == s_.bodies.size();
  for (const SpringMemory& m : s.contacts) fits &= !bad(m, centers_.size());
  for (const SpringMemory& m : s.walls) fits &= !bad(m, s_.walls.size());
  if (!fits) throw Error("the checkpoint is of another scene: it has other bodies, grains or walls");
  s_.position = s.position, s_.velocity = s.velocity, s_.momentum = s.momentum, s_.spin = s.spin;
  s_.orientation = s.orientation;
  steps_ = s.steps;
  pairs_.clear(), springs_.clear(), wall_pairs_.clear(), wall_springs_.clear();
  starts_.assign(centers_.size() + 1, 0), wall_starts_.assign(centers_.size() + 1, 0);
  for (const SpringMemory& m : s.contacts)
    pairs_.push_back({m.i, m.j}), springs_.push_back(m.spring), starts_[m.i + 1]++;
  for (const SpringMemory& m : s.walls)
    wall_pairs_.push_back({m.i, m.j}), wall_springs_.push_back(m.spring), wall_starts_[m.i + 1]++;
  for (std::size_t k = 1; k < starts_.size(); k++)
    starts_[k] += starts_[k - 1], wall_starts_[k] += wall_starts_[k - 1];
  found_ = false;
  place();
}

}  // namespace padder::settle
