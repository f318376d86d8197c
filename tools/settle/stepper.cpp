// SPDX-License-Identifier: MIT
#include "tools/settle/stepper.h"

#include <omp.h>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder::settle {
namespace {

detect::DeviceChoice host() { return {detect::BackendKind::omp, 0}; }

std::string number(double v) { return short_number(v, 4); }

// Below so many spheres a step on a GPU is mostly the start of its kernels, and two cores are as fast.
constexpr std::uint64_t kGpuPays = 10000;

bool wants_device(const StepperOptions& o, std::uint64_t spheres) {
  if (o.backend != detect::BackendKind::automatic) return o.backend == detect::BackendKind::cuda;
  return spheres >= kGpuPays && detect::cuda_present();
}

}  // namespace

Stepper::Stepper(System system, const StepperOptions& options) : s_(std::move(system)), detector_(host()) {
  if (s_.first_sphere.empty()) s_.first_sphere.push_back(0);
  check();
  body_spheres_ = static_cast<std::uint32_t>(s_.body_spheres());
  grain_shift_ = body_spheres_ - static_cast<std::uint32_t>(s_.bodies.size());
  for (std::size_t b = 0; b < s_.bodies.size(); b++)
    owner_.insert(owner_.end(), s_.first_sphere[b + 1] - s_.first_sphere[b], static_cast<std::uint32_t>(b));
  centers_.resize(s_.spheres()), reference_.resize(s_.spheres());
  smallest_ = INFINITY;
  for (std::uint64_t k = 0; k < s_.spheres(); k++) {
    const double r = s_.radius_of(k);
    centers_[k].r = r, smallest_ = std::min(smallest_, r), mean_ += r / static_cast<double>(s_.spheres());
  }
  check_rims();
  asked_threads_ = options.threads;
  fixed_skin_ = options.skin >= 0;
  skin_ = fixed_skin_ ? options.skin : 0.1 * mean_;
  detector_.options().width = detect::Width::pairs;
  detector_.options().order = detect::Order::any;  // candidates are sorted anyway
  starts_.assign(s_.spheres() + 1, 0), wall_starts_.assign(s_.spheres() + 1, 0);
  bushing_loads_.resize(s_.bodies.size());
  place();
  if (wants_device(options, s_.spheres())) device_ = make_device_stepper(s_);
}

void Stepper::check() const {
  if (s_.spheres() == 0) throw Error("the scene has no spheres: give it bodies or grains");
  if (s_.spheres() >= 0xffffffffu)
    throw Error("the scene has more spheres than one detector can number (2^32 - 2)");
  const StepLimits limits = step_limits(s_);
  if (!(s_.law.stiffness > 0) || !std::isfinite(s_.law.stiffness))
    throw Error("the stiffness of contacts must be a positive number, not " + number(s_.law.stiffness));
  if (!(s_.step > 0) || !(s_.step <= limits.longest))
    throw Error("a time step of " + number(s_.step) +
                " is unstable for this stiffness and these masses: use at most " + number(limits.longest) +
                ", or leave it out, which gives " + number(limits.chosen));
  for (std::size_t m = 0; m < s_.movers(); m++)
    if (!finite(s_.position[m]) || !finite(s_.velocity[m]) || !finite(s_.spin[m]))
      throw Error("the position or velocity of mover " + std::to_string(m) + " is not finite");
}

// integrate() looks at the centres of what moves freely. Here are the spheres of bodies, which a spin moves,
// too, and driven bodies, which keep their speed. A body may have finer spheres than what it meets, so that
// grains count where there are any.
void Stepper::check_rims() const {
  double smallest = INFINITY;
  for (std::uint64_t k = body_spheres_; k < s_.spheres(); k++) smallest = std::min(smallest, s_.radius_of(k));
  if (body_spheres_ == s_.spheres()) smallest = smallest_;
  for (std::size_t b = 0; b < s_.bodies.size(); b++) {
    if (s_.inverse_mass[b] == 0 && !s_.driven[b]) continue;
    double reach = 0;
    for (const detect::Sphere& q : s_.shapes[s_.bodies[b].shape])
      reach = std::max(reach, length(center_of(q)) + q.r);
    const double moved = s_.step * (length(s_.velocity[b]) + length(s_.spin[b]) * reach);
    if (!(moved <= 0.5 * smallest))
      throw Error(
          "body " + std::to_string(b) + " moves by up to " + number(moved) +
          " in a step, which is more than half the radius " + number(smallest) +
          " of the smallest sphere that it may meet: use a shorter time step, or a lower velocity and spin");
  }
}

void Stepper::place() {
  fetch();
  place_and_measure();
}

// Places all spheres. Returns how far one is at most from where it was when candidates were found.
double Stepper::place_and_measure() {
  const auto bodies = static_cast<std::int64_t>(s_.bodies.size()),
             grains = static_cast<std::int64_t>(s_.grain_radius.size());
  double moved = 0;
#pragma omp parallel num_threads(threads_) reduction(max : moved)
  {
    const auto measure = [&](std::size_t k) {
      const Vec3 d = center_of(centers_[k]) - reference_[k];
      moved = std::max(moved, dot(d, d));
    };
#pragma omp for schedule(dynamic, 16)
    for (std::int64_t b = 0; b < bodies; b++) {
      const auto body = static_cast<std::size_t>(b);
      if (s_.inverse_mass[body] != 0 || s_.driven[body] || !found_) place_body(s_, body);
      const auto& shape = s_.shapes[s_.bodies[body].shape];
      for (std::size_t q = 0, k = s_.first_sphere[body]; q < shape.size(); q++, k++)
        centers_[k] = detect::placed(s_.bodies[body], shape[q]), measure(k);
    }
#pragma omp for schedule(static)
    for (std::int64_t g = 0; g < grains; g++) {
      const auto k = static_cast<std::size_t>(g) + body_spheres_;
      const Vec3& p = s_.position[static_cast<std::size_t>(g) + s_.bodies.size()];
      centers_[k].x = p.x, centers_[k].y = p.y, centers_[k].z = p.z, measure(k);
    }
  }
  return std::sqrt(moved);
}

// A wider skin makes candidates last longer, but each step then tries more that do not touch. Both together
// cost least where a detection costs as much as trying those that do not touch in all the steps that it
// served. To try one is taken to cost a third of what a detection costs for each sphere and candidate; near
// the least the sum is flat, so nothing depends on the exact share. All this follows from the motion alone,
// so that a run can be repeated.
void Stepper::choose_skin() {
  if (fixed_skin_) return;
  const double most = 0.5 * mean_;
  if (pause_ > 0) {
    if (--pause_ == 0) skin_ = most;
    return;
  }
  const std::uint64_t lasted = steps_ - steps_of_find_, candidates = effort_.candidates;
  const std::uint64_t apart = candidates - std::min(contacts_, candidates);
  const double tried = static_cast<double>(lasted * apart),
               found = static_cast<double>(candidates + s_.spheres());
  if (lasted < 2 && skin_ >= most && found_)
    skin_ = 0, pause_ = 64;
  else if (tried < 2 * found)
    skin_ = std::min(1.3 * skin_, most);
  else if (tried > 4 * found)
    skin_ = std::max(0.8 * skin_, 0.02 * mean_);
}

// Candidates: all pairs whose gap is at most the skin.
void Stepper::detect_pairs() {
  std::vector<detect::Shape> shapes;
  for (const auto& shape : s_.shapes) shapes.push_back({shape.data(), shape.size()});
  detect::Input input;
  input.shapes = shapes, input.bodies = s_.bodies;
  if (const std::size_t grains = s_.grain_radius.size(); grains > 0) {
    const detect::Sphere& first = centers_[body_spheres_];
    input.spheres = detect::spheres_of<double>(grains, &first.x, &first.r);
    input.spheres.center_stride = input.spheres.radius_stride = 4;
    if (!s_.grain_family.empty()) input.spheres.family = s_.grain_family.data();
    if (!s_.grain_mask.empty()) input.spheres.mask = s_.grain_mask.data();
    if (!s_.grain_static.empty()) input.spheres.is_static = s_.grain_static.data();
  }
  detector_.options().threads = threads_, detector_.options().margin = skin_;
  take_sorted(detector_.detect(input).pair_span());
}

// The new candidates, sorted by i and then j, with the springs of those that were candidates before. The sum
// over a mover's contacts then has the same order whatever the detector's order and the skin are: a candidate
// that does not touch adds 0.
void Stepper::take_sorted(std::span<const detect::Pair> found) {
  const auto spheres = static_cast<std::int64_t>(centers_.size());
  std::vector<std::uint64_t> starts(centers_.size() + 1, 0);
  const auto moves = [&](const detect::Pair& p) {
    return s_.inverse_mass[mover(p.i)] != 0 || s_.inverse_mass[mover(p.j)] != 0;
  };
  for (const detect::Pair& p : found) starts[p.i + 1] += moves(p);
  for (std::size_t k = 1; k < starts.size(); k++) starts[k] += starts[k - 1];
  std::vector<detect::Pair> pairs(starts.back());
  std::vector<Vec3> springs(starts.back());
  std::vector<std::uint64_t> next(starts.begin(), starts.end() - 1);
  for (const detect::Pair& p : found)
    if (moves(p)) pairs[next[p.i]++] = p;
#pragma omp parallel for schedule(dynamic, 1024) num_threads(threads_)
  for (std::int64_t i = 0; i < spheres; i++) {
    const auto k = static_cast<std::size_t>(i);
    const auto less = [](const detect::Pair& a, const detect::Pair& b) { return a.j < b.j; };
    std::sort(pairs.begin() + static_cast<std::ptrdiff_t>(starts[k]),
              pairs.begin() + static_cast<std::ptrdiff_t>(starts[k + 1]), less);
    std::uint64_t old = starts_[k];
    for (std::uint64_t c = starts[k]; c < starts[k + 1]; c++) {
      while (old < starts_[k + 1] && pairs_[old].j < pairs[c].j) old++;
      if (old < starts_[k + 1] && pairs_[old].j == pairs[c].j) springs[c] = springs_[old];
    }
  }
  pairs_.swap(pairs), springs_.swap(springs), starts_.swap(starts);
  pushes_.resize(pairs_.size());
  if (pairs_.size() >= 0xffffffffu)
    throw Error(std::to_string(pairs_.size()) +
                " candidate pairs are more than a step can number (2^32 - 2)");
  second_starts_.assign(centers_.size() + 1, 0);
  for (const detect::Pair& p : pairs_) second_starts_[p.j + 1]++;
  for (std::size_t k = 1; k < second_starts_.size(); k++) second_starts_[k] += second_starts_[k - 1];
  by_second_.resize(pairs_.size());
  next.assign(second_starts_.begin(), second_starts_.end() - 1);
  for (std::size_t c = 0; c < pairs_.size(); c++)
    by_second_[next[pairs_[c].j]++] = static_cast<std::uint32_t>(c);
}

void Stepper::find_wall_pairs() {
  std::vector<WallPair> pairs;
  std::vector<Vec3> springs;
  std::vector<std::uint64_t> starts(centers_.size() + 1, 0);
  for (std::uint32_t k = 0; k < centers_.size(); k++) {
    if (s_.inverse_mass[mover(k)] != 0)
      for (std::uint32_t w = 0; w < s_.walls.size(); w++) {
        if (contact_with(s_.walls[w], center_of(centers_[k]), centers_[k].r).depth < -0.5 * skin_) continue;
        pairs.push_back({k, w}), springs.push_back({});
        for (std::uint64_t old = wall_starts_[k]; old < wall_starts_[k + 1]; old++)
          if (wall_pairs_[old].wall == w) springs.back() = wall_springs_[old];
      }
    starts[k + 1] = pairs.size();
  }
  wall_pairs_.swap(pairs), wall_springs_.swap(springs), wall_starts_.swap(starts);
  wall_pushes_.resize(wall_pairs_.size());
}

void Stepper::find_candidates() {
  const double before = omp_get_wtime();
  choose_skin();
  if (device_) {
    effort_.candidates = device_->find(skin_);
  } else {
    detect_pairs();
    find_wall_pairs();
    for (std::size_t k = 0; k < centers_.size(); k++) reference_[k] = center_of(centers_[k]);
    effort_.candidates = pairs_.size();
  }
  found_ = true, steps_of_find_ = steps_;
  effort_.detections++, effort_.skin = skin_;
  effort_.detection_seconds += omp_get_wtime() - before;
}

void Stepper::push_pairs() {
  const auto n = static_cast<std::int64_t>(pairs_.size());
  std::uint64_t contacts = 0;
  double deepest = 0, ratio = 0;
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(+ : contacts) reduction(max : deepest, ratio)
  for (std::int64_t at = 0; at < n; at++) {
    const auto k = static_cast<std::size_t>(at);
    const detect::Sphere &a = centers_[pairs_[k].i], &b = centers_[pairs_[k].j];
    if (!detect::touching(a, b)) {
      springs_[k] = {}, pushes_[k] = {};
      continue;
    }
    const Contact c = push_spheres(s_.law, s_.step, a, b, state_of(mover(pairs_[k].i)),
                                   state_of(mover(pairs_[k].j)), springs_[k]);
    pushes_[k] = c.push;
    contacts++, deepest = std::max(deepest, c.depth), ratio = std::max(ratio, c.depth / std::min(a.r, b.r));
  }
  contacts_ = contacts, deepest_ = deepest, deepest_ratio_ = ratio;
}

void Stepper::push_walls() {
  const auto n = static_cast<std::int64_t>(wall_pairs_.size());
  std::uint64_t contacts = 0;
  double deepest = deepest_, ratio = deepest_ratio_;
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(+ : contacts) reduction(max : deepest, ratio)
  for (std::int64_t at = 0; at < n; at++) {
    const auto k = static_cast<std::size_t>(at);
    const detect::Sphere& a = centers_[wall_pairs_[k].sphere];
    const Wall& wall = s_.walls[wall_pairs_[k].wall];
    const WallContact w = contact_with(wall, center_of(a), a.r);
    if (w.depth < 0) {
      wall_springs_[k] = {}, wall_pushes_[k] = {};
      continue;
    }
    wall_pushes_[k] =
        push_wall(s_.law, s_.step, a, wall, w, state_of(mover(wall_pairs_[k].sphere)), wall_springs_[k]).push;
    contacts++, deepest = std::max(deepest, w.depth), ratio = std::max(ratio, w.depth / a.r);
  }
  contacts_ += contacts, deepest_ = deepest, deepest_ratio_ = ratio;
}

void Stepper::push_bushings() {
  if (s_.bushings.empty()) return;
  std::fill(bushing_loads_.begin(), bushing_loads_.end(), Load{});
  for (const Bushing& u : s_.bushings)
    add_bushing(u, state_of(u.a), state_of(u.b), s_.bodies[u.a].rotation, s_.bodies[u.b].rotation,
                &bushing_loads_[u.a], &bushing_loads_[u.b]);
}

// Force and torque on a mover, its contacts by the partner's number, walls last.
Load Stepper::load_of(std::size_t m) const {
  const bool body = m < s_.bodies.size();
  const std::size_t first = body ? s_.first_sphere[m] : m + grain_shift_,
                    last = body ? s_.first_sphere[m + 1] : first + 1;
  Load load = body && !s_.bushings.empty() ? bushing_loads_[m] : Load{};
  const auto add = [&](const Push& p, double sign) {
    if (p.force != Vec3{}) add_push(load, sign * p.force, p.point, s_.position[m]);
  };
  for (std::uint64_t c = second_starts_[first]; c < second_starts_[last]; c++)
    add(pushes_[by_second_[c]], -1);
  for (std::uint64_t c = starts_[first]; c < starts_[last]; c++) add(pushes_[c], 1);
  for (std::uint64_t c = wall_starts_[first]; c < wall_starts_[last]; c++) add(wall_pushes_[c], 1);
  return load;
}

void Stepper::integrate() {
  const auto n = static_cast<std::int64_t>(s_.movers());
  const double longest = 0.5 * smallest_ / s_.step;
  std::int64_t wild = n;  // the first mover that is too fast
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(min : wild)
  for (std::int64_t k = 0; k < n; k++) {
    const auto m = static_cast<std::size_t>(k);
    const bool body = m < s_.bodies.size();
    if (s_.inverse_mass[m] == 0 && (!body || !s_.driven[m])) continue;
    MoverState state = state_of(static_cast<std::uint32_t>(m));
    const Load load = state.inverse_mass == 0 ? Load{} : load_of(m);
    if (body)
      advance_body(state, s_.momentum[m], s_.orientation[m], load, s_.inverse_inertia[m], s_.gravity,
                   s_.step);
    else
      advance_grain(state, s_.momentum[m], load, s_.inverse_inertia[m].x, s_.gravity, s_.step);
    s_.position[m] = state.position, s_.velocity[m] = state.velocity, s_.spin[m] = state.spin;
    if (state.inverse_mass == 0) continue;
    if (!(length(s_.velocity[m]) <= longest)) wild = std::min(wild, k);
  }
  if (wild < n) explode_wild(static_cast<std::size_t>(wild));
}

std::string Stepper::name_of(std::size_t m) const {
  return m < s_.bodies.size() ? "body " + std::to_string(m) : "grain " + std::to_string(m - s_.bodies.size());
}

void Stepper::explode_wild(std::size_t m) const {
  fetch();
  explode(name_of(m) + " has a speed of " + number(length(s_.velocity[m])) +
          ", which is more than half the smallest radius in a step");
}

// Names the two that overlap by the most radii as they lie now. A GPU may have moved them since.
void Stepper::explode_deep() {
  place();
  std::string both = "two spheres, or a sphere and a wall,";
  double depth = deepest_, worst = 1;
  const auto look = [&](double by, double radius, const auto& names) {
    if (by > worst * radius) both = names(), depth = by, worst = by / radius;
  };
  const auto [pairs, walls] = candidates();
  for (const SpringMemory& m : pairs)
    if (const detect::Sphere& a = centers_[m.i], &b = centers_[m.j]; detect::touching(a, b))
      look(detect::geometry(a, b).depth, std::min(a.r, b.r),
           [&] { return name_of(mover(m.i)) + " and " + name_of(mover(m.j)); });
  for (const SpringMemory& m : walls) {
    const Wall& wall = s_.walls[m.j];
    const detect::Sphere& a = centers_[m.i];
    look(contact_with(wall, center_of(a), a.r).depth, a.r, [&] {
      return name_of(mover(m.i)) + " and " +
             (wall.kind == Wall::Kind::plane ? "plane " + std::to_string(m.j) : "the cylinder");
    });
  }
  explode(both + " overlap by " + number(depth) + ", more than a radius");
}

void Stepper::explode(const std::string& what) const {
  throw Error(
      "the run exploded in step " + std::to_string(steps_) + " (time " + number(time()) + "): " + what +
      ": look for spheres that overlap at the start, or use a shorter time step or a larger stiffness");
}

void Stepper::step_on_host() {
  threads_ = chosen_.choose(asked_threads_, s_.spheres());
  const double moved = place_and_measure();
  // A hair less than half the skin, for the rounding of positions.
  if (!found_ || skin_ == 0 || !(moved < 0.499999 * skin_)) find_candidates();
  push_pairs();
  push_walls();
  keep_deepest(deepest_, deepest_ratio_);
  if (deepest_ratio_ > 1) explode_deep();
  push_bushings();
  integrate();
  chosen_.done();
  steps_++;
}

void Stepper::step_on_device(std::uint64_t count) {
  for (std::uint64_t left = count; left > 0;) {
    const StepsTaken taken = device_->step(left);
    newer_there_ = true;
    left -= taken.steps, steps_ += taken.steps;
    if (taken.steps > 0) contacts_ = taken.contacts;
    deepest_ = taken.deepest, deepest_ratio_ = taken.ratio;
    keep_deepest(taken.most, taken.most_ratio);
    if (taken.ratio > 1) explode_deep();
    if (taken.wild != ~0u) explode_wild(taken.wild);
    if (taken.detect && left > 0) find_candidates();
  }
}

void Stepper::fetch() const {
  if (!newer_there_) return;
  device_->get(s_);
  newer_there_ = false;
}

void Stepper::step(std::uint64_t count) {
  const double begun = omp_get_wtime();
  if (device_)
    step_on_device(count);
  else
    for (std::uint64_t k = 0; k < count; k++) step_on_host();
  effort_.seconds += omp_get_wtime() - begun;
}

}  // namespace padder::settle
