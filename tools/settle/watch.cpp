// SPDX-License-Identifier: MIT
// What can be asked of a stepper between two steps: energies, contacts, a snapshot.
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "padding/asset/error.h"
#include "tools/settle/stepper.h"

namespace padder::settle {

// Before the first step, and after resume(), no candidates are known: without them the energy of contacts
// that press already would be missing, and so would the contacts.
void Stepper::find_first_candidates() {
  if (found_) return;
  const double begun = omp_get_wtime();
  threads_ = chosen_.choose(asked_threads_, s_.spheres());
  place();
  find_candidates();
  count_contacts();
  chosen_.done();
  effort_.seconds += omp_get_wtime() - begun;
}

// Those of the spheres as they lie, which the next step would find.
void Stepper::count_contacts() {
  contacts_ = 0, deepest_ = deepest_ratio_ = 0;
  const auto add = [&](double depth, double radius) {
    contacts_++;
    deepest_ = std::max(deepest_, depth), deepest_ratio_ = std::max(deepest_ratio_, depth / radius);
  };
  const auto [pairs, walls] = candidates();
  for (const SpringMemory& m : pairs) {
    const detect::Sphere &a = centers_[m.i], &b = centers_[m.j];
    if (detect::touching(a, b)) add(detect::geometry(a, b).depth, std::min(a.r, b.r));
  }
  for (const SpringMemory& m : walls) {
    const detect::Sphere& a = centers_[m.i];
    const double depth = contact_with(s_.walls[m.j], center_of(a), a.r).depth;
    if (!(depth < 0)) add(depth, a.r);
  }
  keep_deepest(deepest_, deepest_ratio_);
}

Watch Stepper::watch() {
  find_first_candidates();
  const Watch w = sums();
  judge_rest(w.liveliest);
  return w;
}

// As parts of slow(): the speed of what stands still, and by how much that may grow. Heaps of grains rock a
// little for long, since nothing resists their rolling.
constexpr double kStill = 0.01, kGrowth = 0.025;

// How long something that is not faster than this must be watched. What falls freely then changes its speed
// by three times what is slow, and a ball that rolls down a slope of 1 degree by 0.037 of it. What may be
// about to turn back is given three hundred times as long as falling takes to gain its speed: that ball would
// be more than twice as fast again.
std::uint64_t Stepper::rest_steps(double speed) const {
  const double steps = 3 * std::max(slow(), speed / kStill) / (gravity() * s_.step);
  return static_cast<std::uint64_t>(std::ceil(std::min(steps, 1e18)));
}

std::uint64_t Stepper::rest_step() const {
  return slow_since_ == kNever ? kNever : slow_since_ + rest_steps(slow_speed_);
}

void Stepper::judge_rest(double speed) {
  at_rest_ = false;
  if (steps_ == 0 || !(speed < slow())) {
    slow_since_ = kNever;
    return;
  }
  const bool faster = speed > slow_speed_ + kGrowth * slow();
  at_rest_ = slow_since_ != kNever && !faster && steps_ >= rest_step();
  // What has become slower is watched from here, where that ends earlier.
  if (slow_since_ == kNever || faster || (!at_rest_ && steps_ + rest_steps(speed) < rest_step()))
    slow_since_ = steps_, slow_speed_ = speed;
}

Watch Stepper::sums() {
  if (device_) {
    Watch w = device_->watch();
    w.deepest = deepest_, w.deepest_ratio = deepest_ratio_;
    return w;
  }
  place();
  Watch w;
  for (std::size_t m = 0; m < s_.movers(); m++)
    watch_mover(w, s_.gravity, s_.inverse_mass[m], s_.position[m], s_.velocity[m], s_.spin[m],
                s_.momentum[m]);
  for (std::size_t c = 0; c < pairs_.size(); c++) {
    const detect::Sphere &a = centers_[pairs_[c].i], &b = centers_[pairs_[c].j];
    const std::uint32_t i = material_of(mover(pairs_[c].i)), j = material_of(mover(pairs_[c].j));
    if (detect::touching(a, b))
      w.elastic +=
          stored_energy(s_.law, s_.law.surfaces[i][j].friction, detect::geometry(a, b).depth, springs_[c]);
  }
  for (std::size_t c = 0; c < wall_pairs_.size(); c++) {
    const detect::Sphere& a = centers_[wall_pairs_[c].sphere];
    const Wall& wall = s_.walls[wall_pairs_[c].wall];
    const double friction = friction_with(s_.law, wall, material_of(mover(wall_pairs_[c].sphere)));
    w.elastic +=
        stored_energy(s_.law, friction, contact_with(wall, center_of(a), a.r).depth, wall_springs_[c]);
  }
  for (const Bushing& u : s_.bushings) {
    Vec3 arm_a, arm_b;
    const Vec3 apart = stretch_of(u, s_.position[u.a], s_.position[u.b], s_.bodies[u.a].rotation,
                                  s_.bodies[u.b].rotation, arm_a, arm_b);
    w.elastic += 0.5 * u.stiffness * dot(apart, apart);
  }
  w.deepest = deepest_, w.deepest_ratio = deepest_ratio_;
  return w;
}

std::vector<detect::Pair> Stepper::touching_pairs() const {
  std::vector<detect::Pair> found;
  for (const SpringMemory& m : candidates().first)
    if (detect::touching(centers_[m.i], centers_[m.j])) found.push_back({m.i, m.j});
  return found;
}

// Candidates and their springs: pairs of spheres, and spheres with walls.
std::pair<std::vector<SpringMemory>, std::vector<SpringMemory>> Stepper::candidates() const {
  std::pair<std::vector<SpringMemory>, std::vector<SpringMemory>> found;
  if (device_) {
    device_->get(found.first, found.second);
    return found;
  }
  for (std::size_t c = 0; c < pairs_.size(); c++)
    found.first.push_back({pairs_[c].i, pairs_[c].j, springs_[c]});
  for (std::size_t c = 0; c < wall_pairs_.size(); c++)
    found.second.push_back({wall_pairs_[c].sphere, wall_pairs_[c].wall, wall_springs_[c]});
  return found;
}

Snapshot Stepper::snapshot() const {
  fetch();
  auto [contacts, walls] = candidates();
  std::erase_if(contacts, [](const SpringMemory& m) { return m.spring == Vec3{}; });
  std::erase_if(walls, [](const SpringMemory& m) { return m.spring == Vec3{}; });
  return {steps_,         s_.position, s_.velocity, s_.momentum, s_.spin,
          s_.orientation, contacts,    walls,       slow_since_, slow_speed_};
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
  bool sound = s.slow_since == kNever || (s.slow_since <= s.steps && s.slow_speed >= 0);
  for (const auto* vectors : {&s.position, &s.velocity, &s.momentum, &s.spin})
    for (const Vec3& v : *vectors) sound = sound && finite(v);
  for (const auto* springs : {&s.contacts, &s.walls})
    for (const SpringMemory& m : *springs) sound = sound && finite(m.spring);
  for (const Quaternion& q : s.orientation)
    sound = sound && std::abs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) < 1e-6;
  if (!sound)
    throw Error("the checkpoint is damaged: a number is not finite, or a body's orientation is no rotation");
  s_.position = s.position, s_.velocity = s.velocity, s_.momentum = s.momentum, s_.spin = s.spin;
  s_.orientation = s.orientation;
  steps_ = s.steps, slow_since_ = s.slow_since, slow_speed_ = s.slow_speed, at_rest_ = false;
  newer_there_ = false, most_ = most_ratio_ = 0;
  if (device_) device_->put(s);
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
