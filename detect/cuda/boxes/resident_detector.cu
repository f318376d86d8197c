// SPDX-License-Identifier: MIT
#include "detect/boxes/resident_detector.h"

#include <chrono>
#include <exception>
#include <numeric>
#include <string>

#include "detect/core/backend.h"
#include "detect/core/bodies/body_choice.h"
#include "detect/core/errors.h"
#include "detect/core/input.h"
#include "detect/cuda/boxes/resident_work.h"
#include "detect/cuda/tuning.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

ResidentDetector::Work::Work(const ResidentOptions& options)
    : options_(options.detector), ranks_(options.ranks) {
  together([&] { choose_devices(options.devices); });
  if (ranks_) first_box_ = static_cast<std::size_t>(ranks_->rank());
  regions_.resize(ranks_ ? static_cast<std::size_t>(ranks_->count()) : places_.size());
  density_.assign(regions_.size(), 1);
}

void ResidentDetector::Work::choose_devices(std::vector<int> devices) {
  const int gpus = devices.empty() ? cuda_device_count() : 0;
  for (int k = 0; k < gpus; k++)
    if (cuda_absence(k).empty()) devices.push_back(k);
  if (devices.empty()) throw Error(cuda_absence(0));
  if (ranks_ && gpus) devices = {devices[static_cast<std::size_t>(ranks_->rank_on_host()) % devices.size()]};
  if (ranks_ && devices.size() > 1)
    throw Error(std::to_string(devices.size()) + " GPUs were given to one rank: start a rank for each GPU");
  for (const int d : devices) places_.push_back(std::make_unique<Place>(d));
  read_each_other_ = devices.size() <= std::min(cuda::kMostComing, kMostPoseParts);
  for (const auto& place : places_) {
    const cuda::OnDevice on(place->device);
    for (const int other : devices)
      if (!cuda::let_access(place->device, other)) read_each_other_ = false;
  }
  crew_ = std::make_unique<cuda::Crew>(devices.size());
}

// A thread for each GPU, with its context. Throws what the first of them throws.
void ResidentDetector::Work::each_place(const std::function<void(Place&, std::size_t)>& work) {
  std::vector<std::exception_ptr> failures(places_.size());
  crew_->run([&](std::size_t k) {
    try {
      const cuda::OnDevice on(places_[k]->device);
      on.require();
      work(*places_[k], k);
    } catch (const Error& e) {
      failures[k] =
          std::make_exception_ptr(Error("GPU " + std::to_string(places_[k]->device) + ": " + e.what()));
    } catch (...) {
      failures[k] = std::current_exception();
    }
  });
  for (const std::exception_ptr& f : failures)
    if (f) std::rethrow_exception(f);
}

// What there is to each place, or why it cannot be.
std::vector<cuda::Given> ResidentDetector::Work::check(std::span<const Spheres> parts,
                                                       std::span<const ResidentPoses> poses) const {
  check_options(options_), check_boxed_options(options_);
  if (parts.size() != places_.size() || (!poses.empty() && poses.size() != places_.size()))
    throw Error(std::to_string(parts.size()) + " parts of the scene and " + std::to_string(poses.size()) +
                " parts of the poses were given for " + std::to_string(places_.size()) +
                " GPUs: give one for each, or no poses");
  if (!poses.empty() && bodies_.poses) throw Error("poses are given in parts or with the bodies, not both");
  std::vector<cuda::Given> given;
  for (const Spheres& s : parts) {
    Input input;
    input.spheres = s;
    check_input(input, true);
    cuda::Given g{s.count, bodies_.bodies.size(), body_spheres_, 0, !poses.empty(), {}};
    if (!poses.empty()) g.poses = poses[given.size()].count;
    if (s.count) g.form = cuda::Form::of(s);
    given.push_back(g);
  }
  return given;
}

void ResidentDetector::Work::check_bodies(const Input& bodies) {
  if (bodies.spheres.count)
    throw Error("loose spheres are given in parts, one for each GPU, and not with the bodies");
  if (bodies.poses && bodies.pose_memory == Memory::device)
    throw Error("poses on several GPUs are given in parts, one for each GPU, and not with the bodies");
  const bool known = bodies.revision != 0 && bodies.revision == revision_;
  revision_ = 0;  // set when the call is done
  bodies_ = bodies;
  const BodyTally tally = check_input(bodies, false, known);
  if (known) return;
  body_spheres_ = tally.spheres;
  have_worlds_ = tally.have_worlds;
  // However many balls touch: the poses may be given in parts.
  bodies_first_ = most_touching_balls(census_of(bodies.shapes, tally, pieces_), body_spheres_, 0, 0,
                                      cuda::tuning::kKnownBodies) > 0;
}

// What has to be the same on all GPUs, and where each part begins in the scene.
void ResidentDetector::Work::agree(const std::vector<cuda::Given>& given) {
  const bool poses_in_parts = given[0].poses_in_parts;
  form_ = {};
  poses_of_.clear();
  std::uint64_t first = 0, poses = 0;
  bool any = false;
  for (std::size_t b = 0; b < given.size(); b++) {
    const cuda::Given& g = given[b];
    if (g.bodies != given[0].bodies || g.body_spheres != given[0].body_spheres ||
        g.poses_in_parts != poses_in_parts)
      throw Error(
          "the ranks were given different bodies or poses: give all of them the same bodies, and each "
          "its part of the poses or none");
    if (b >= first_box_ && b < first_box_ + places_.size()) places_[b - first_box_]->first = first;
    first += g.spheres, poses += g.poses;
    if (poses_in_parts) poses_of_.push_back(g.poses);
    if (g.spheres == 0) continue;
    if (any && g.form.scalar != form_.scalar)
      throw Error("the parts of a scene must be all in float or all in double");
    form_.world |= g.form.world || (any && g.form.world_of_all != form_.world_of_all);
    form_.scalar = g.form.scalar, form_.world_of_all = g.form.world_of_all, any = true;
    form_.family |= g.form.family, form_.mask |= g.form.mask, form_.is_static |= g.form.is_static;
  }
  report_.spheres = body_spheres_ + first;
  if (poses_in_parts && poses != bodies_.bodies.size())
    throw Error(std::to_string(poses) + " poses in " + std::to_string(given.size()) +
                " parts were given for " + std::to_string(bodies_.bodies.size()) +
                " bodies: give one pose for each body");
}

// What the GPU's detector is given, and found_[k] as far as it tells of that.
Input ResidentDetector::Work::input_of(Place& p, std::size_t k) {
  ResidentContacts& f = found_[k];
  Input input = bodies_;
  f.device = p.device;
  if (alone()) {
    f.own = input.spheres = p.part;
    return input;
  }
  const cuda::DealTarget at = p.others->from(0, form_);
  const std::uint64_t first_own = body_spheres_ + p.first;
  if (stays_in_place(p)) {
    f.own = input.spheres = p.part;
    f.others = p.others->view(p.before + p.behind, form_);
    p.around = {f.others, p.before};
    if (f.others.count) input.around = &p.around;
    f.numbers = {body_spheres_, p.before, p.part.count, first_own, at.ids};
  } else {
    f.others = input.spheres = p.others->view(p.loaded, form_);
    f.numbers = {body_spheres_, p.loaded, 0, 0, at.ids};
  }
  return input;
}

void ResidentDetector::Work::send_and_detect() {
  const double start = now();
  found_.assign(places_.size(), {});
  std::vector<Region> boxes;
  for (const Region& r : regions_) boxes.push_back(common(options_.own, r));
  for (const auto& p : places_) {
    p->listed.clear();
    p->poses_around.boxes = boxes, p->poses_around.largest_radius = halo_radius_;
  }
  if (ranks_ && !alone()) exchange_with_ranks(*places_[0]);
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      if (!ranks_ && !alone()) exchange(p, k);
      if (alone()) p.loaded = p.own = p.part.count, p.before = p.behind = 0;
      if (k == 0) report_.deal_seconds += now() - start;
      Input input = input_of(p, k);
      // Other static spheres may have come; after a call that failed, the detectors differ in what they know.
      if (form_.is_static || failed_) input.revision = 0;
      if (p.all_poses) input.poses = p.all_poses, input.pose_memory = Memory::device;
      CallOptions options = options_;
      // All GPUs go the same way, since each finds which of its bodies the others need.
      if (poses_stay_) {
        input.poses_around = &p.poses_around, options.bodies = Bodies::first;
        const PosePart& own = p.poses_around.parts[k];
        if (own.count) cuda::check_device_memory(own.poses, p.device, "the poses");
      }
      options.stream = nullptr, options.output = Memory::device;
      options.own = common(options.own, regions_[box_of(k)]);
      // Where the box owns nothing, too: a detector that missed a call would not know what has moved.
      p.detector.options() = options;
      found_[k].contacts = p.detector.detect(input);
    });
  });
}

void ResidentDetector::Work::finish() {
  std::vector<cuda::Done> mine;
  for (std::size_t k = 0; k < places_.size(); k++) {
    const Place& p = *places_[k];
    const double spheres = static_cast<double>(p.before + p.own + p.behind) + p.body_spheres;
    const Contacts& c = found_[k].contacts;
    const double work = spheres + static_cast<double>(c.count);
    mine.push_back({work, spheres > 0 ? work / spheres : 1, c.count, c.doubtful, p.loaded,
                    p.counts.away * form_.bytes_of_one()});
  }
  std::vector<double> work;
  density_.clear();
  for (const cuda::Done& d : of_all(mine)) {
    work.push_back(d.work), density_.push_back(d.density);
    report_.contacts += d.contacts, report_.doubtful += d.doubtful, report_.copies += d.copies;
    report_.moved_bytes += d.moved_bytes;
  }
  known_density_ = true, report_.copies += body_spheres_;
  report_.imbalance = imbalance_ = imbalance_of(work);
  if (report_.cut) settled_imbalance_ = informed_ ? report_.imbalance : 1;
}

const ResidentReport& ResidentDetector::Work::run(std::span<const Spheres> parts, const Input& bodies,
                                                  std::span<const ResidentPoses> poses) {
  report_ = {}, found_.clear();
  try {
    const double start = now();
    std::vector<cuda::Given> given;
    together([&] {
      check_bodies(bodies);
      given = check(parts, poses);
    });
    agree(of_all(given));
    poses_stay_ = !poses.empty() && !bodies_.bodies.empty() && !alone() && !ranks_ && read_each_other_ &&
                  goes_bodies_first();
    const bool poses_alone = poses_stay_ && report_.spheres == body_spheres_;  // nothing else is read
    for (std::size_t k = 0; k < places_.size(); k++) places_[k]->part = parts[k];
    if (!poses_alone) together([&] { bring(parts); });
    bring_poses(poses);
    const double brought = now();
    if (!alone()) deal();
    report_.upload_seconds = brought - start, report_.deal_seconds = now() - brought;
    send_and_detect();
    finish();
    report_.detect_seconds = now() - brought - report_.deal_seconds;
    revision_ = failed_ ? 0 : bodies.revision, failed_ = false;
  } catch (...) {
    failed_ = true;
    report_ = {}, found_.clear();
    throw;
  }
  return report_;
}

std::uint64_t ResidentDetector::Work::hash() {
  std::vector<std::uint64_t> sums(places_.size(), 0);
  if (found_.empty()) return 0;
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      const ResidentContacts& f = found_[k];
      sums[k] = cuda::hash_of_numbered_pairs(f.contacts.pairs, f.contacts.count, f.numbers, p.sum, p.stream);
    });
  });
  sums = of_all(sums);
  return std::accumulate(sums.begin(), sums.end(), std::uint64_t(0));
}

ResidentDetector::ResidentDetector(const ResidentOptions& options) : work_(std::make_unique<Work>(options)) {}
ResidentDetector::~ResidentDetector() = default;
ResidentDetector::ResidentDetector(ResidentDetector&&) noexcept = default;
ResidentDetector& ResidentDetector::operator=(ResidentDetector&&) noexcept = default;
const ResidentReport& ResidentDetector::detect(std::span<const Spheres> parts) {
  return work_->run(parts, {}, {});
}
const ResidentReport& ResidentDetector::detect(std::span<const Spheres> parts, const Input& bodies,
                                               std::span<const ResidentPoses> poses) {
  return work_->run(parts, bodies, poses);
}
std::span<const ResidentContacts> ResidentDetector::found() const { return work_->found(); }
const ResidentReport& ResidentDetector::report() const { return work_->report(); }
std::uint64_t ResidentDetector::hash() const { return work_->hash(); }
Region ResidentDetector::region(std::size_t device) const { return work_->region(device); }
std::size_t ResidentDetector::devices() const { return work_->devices(); }
CallOptions& ResidentDetector::options() { return work_->options(); }

}  // namespace padder::detect
