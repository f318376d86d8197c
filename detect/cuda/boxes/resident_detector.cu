// SPDX-License-Identifier: MIT
#include "detect/boxes/resident_detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <functional>
#include <numeric>
#include <string>
#include <utility>

#include "detect/core/backend.h"
#include "detect/core/errors.h"
#include "detect/core/input.h"
#include "detect/cuda/boxes/crew.h"
#include "detect/cuda/boxes/deal.h"
#include "detect/cuda/boxes/place.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace cuda {
namespace {

constexpr double kMostImbalance = 1.1;  // of the heaviest GPU's work over the mean, before space is cut anew
constexpr std::uint64_t kSampleOfDevice = 1 << 13;  // the host sorts the sample while the GPUs wait
// A part of which one sphere of so many is not needed where it lies is copied without those: to read them
// with the rest, and to find their contacts in vain, costs more.
constexpr std::uint64_t kMostAstray = 8;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double imbalance_of(const std::vector<double>& work) {
  double sum = 0, most = 0;
  for (const double w : work) sum += w, most = std::max(most, w);
  return sum > 0 ? most * static_cast<double>(work.size()) / sum : 1;
}

}  // namespace
}  // namespace cuda

using cuda::DealTarget;
using cuda::Place;

class ResidentDetector::Work {
 public:
  explicit Work(const ResidentOptions& options);
  const ResidentReport& run(std::span<const Spheres> parts, const Input& bodies,
                            std::span<const ResidentPoses> poses);
  std::span<const ResidentContacts> found() const { return found_; }
  const ResidentReport& report() const { return report_; }
  std::uint64_t hash();
  Region region(std::size_t k) const { return regions_.of[k]; }
  std::size_t devices() const { return places_.size(); }
  CallOptions& options() { return options_; }

 private:
  void each_place(const std::function<void(Place&, std::size_t)>& work);
  cuda::Form check(std::span<const Spheres> parts) const;
  void check_bodies(const Input& bodies, std::span<const ResidentPoses> poses);
  void bring(std::span<const Spheres> parts);
  void pack(Place& p) const;
  void bring(std::span<const ResidentPoses> poses);
  void sample_bodies(std::vector<WeightedPoint>& points);
  void deal();
  void check_faults();
  bool has_room();
  void cut();
  double expected_imbalance() const;
  bool stays_in_place(const Place& p) const;
  void exchange(Place& p, std::size_t k);
  Input input_of(Place& p, std::size_t k);
  void send_and_detect();
  void finish();

  CallOptions options_;
  std::vector<std::unique_ptr<Place>> places_;
  cuda::Form form_;
  Input bodies_;                                   // of the call
  std::uint64_t body_spheres_ = 0, revision_ = 0;  // of the bodies; of the call before
  bool failed_ = false;                            // the call before
  cuda::DealRegions regions_;
  BoxTree tree_;
  bool has_tree_ = false, known_density_ = false, informed_ = false;
  double settled_imbalance_ = 1;  // what the last cut could reach
  double imbalance_ = 1;          // in the call before
  double halo_radius_ = 0;        // at least the largest radius of the scene
  std::vector<ResidentContacts> found_;
  ResidentReport report_;
  std::unique_ptr<cuda::Crew> crew_;
};

ResidentDetector::Work::Work(const ResidentOptions& options) : options_(options.detector) {
  std::vector<int> devices = options.devices;
  if (devices.empty())
    for (int k = 0; k < cuda_device_count(); k++)
      if (cuda_absence(k).empty()) devices.push_back(k);
  if (devices.empty()) throw Error(cuda_absence(0));
  if (devices.size() > kMostResidentDevices)
    throw Error(std::to_string(devices.size()) + " GPUs are more than " +
                std::to_string(kMostResidentDevices) +
                ", the most that one detector uses: start a rank of MPI for each");
  for (const int d : devices) places_.push_back(std::make_unique<Place>(d));
  for (const auto& place : places_) {
    const cuda::OnDevice on(place->device);
    for (const int other : devices) cuda::let_access(place->device, other);
  }
  regions_.count = static_cast<int>(devices.size());
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

cuda::Form ResidentDetector::Work::check(std::span<const Spheres> parts) const {
  check_options(options_), check_boxed_options(options_);
  if (parts.size() != places_.size())
    throw Error(std::to_string(parts.size()) + " parts of the scene were given for " +
                std::to_string(places_.size()) + " GPUs: give one for each");
  cuda::Form form;
  bool first = true;
  for (const Spheres& s : parts) {
    Input input;
    input.spheres = s;
    check_input(input, true);
    if (options_.margin > 0 || loose_have_worlds(input))
      throw Error("spheres that stay on several GPUs have neither a margin nor worlds: use one Detector");
    if (s.count == 0) continue;
    if (!first && s.scalar != form.scalar)
      throw Error("the parts of a scene must be all in float or all in double");
    form.scalar = s.scalar, first = false;
    form.family |= s.family != nullptr, form.mask |= s.mask != nullptr,
        form.is_static |= s.is_static != nullptr;
  }
  return form;
}

void ResidentDetector::Work::check_bodies(const Input& bodies, std::span<const ResidentPoses> poses) {
  if (bodies.spheres.count)
    throw Error("loose spheres are given in parts, one for each GPU, and not with the bodies");
  if (bodies.poses && bodies.pose_memory == Memory::device)
    throw Error("poses on several GPUs are given in parts, one for each GPU, and not with the bodies");
  const bool known = bodies.revision != 0 && bodies.revision == revision_;
  revision_ = 0;  // set when the call is done
  bodies_ = bodies;
  check_input(bodies, false, known);
  if (!known) body_spheres_ = sphere_count(bodies);
  if (poses.empty()) return;
  std::uint64_t count = 0;
  for (const ResidentPoses& part : poses) count += part.count;
  if (poses.size() != places_.size() || count != bodies.bodies.size() || bodies.poses)
    throw Error(
        std::to_string(count) + " poses in " + std::to_string(poses.size()) + " parts were given for " +
        std::to_string(bodies.bodies.size()) + " bodies on " + std::to_string(places_.size()) +
        " GPUs: give one part for each GPU and one pose for each body, and none in the bodies' input");
}

// Every GPU gets the poses of all bodies. Those on other GPUs travel from there.
void ResidentDetector::Work::bring(std::span<const ResidentPoses> poses) {
  each_place([&](Place& p, std::size_t k) {
    p.all_poses = nullptr;
    if (poses.empty() || bodies_.bodies.empty()) return;
    if (poses[k].count) cuda::check_device_memory(poses[k].poses, p.device, "the poses");
    if (places_.size() == 1) {
      p.all_poses = poses[0].poses;
      return;
    }
    Pose* to = p.poses.reserve(bodies_.bodies.size());
    p.all_poses = to;
    for (std::size_t from = 0; from < poses.size(); to += poses[from++].count)
      if (poses[from].count)
        cuda::cuda_check(cudaMemcpyPeerAsync(to, p.device, poses[from].poses, places_[from]->device,
                                             poses[from].count * sizeof(Pose), p.stream),
                         "copy poses to another GPU");
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy poses to another GPU");
  });
  if (places_.size() > 1 && !poses.empty())
    report_.moved_bytes += (places_.size() - 1) * bodies_.bodies.size() * sizeof(Pose);
}

// Brings the part into the form in which it is read fastest, more than once.
void ResidentDetector::Work::pack(Place& p) const {
  const Spheres& s = p.part;
  const cuda::Form form{s.scalar, s.family != nullptr, s.mask != nullptr, s.is_static != nullptr, false};
  p.packed->reserve(s.count, form);
  p.dealer->pack(s, p.packed->from(0, form), p.stream);
  p.part = p.packed->view(s.count, form);
}

// Waits for what the caller does on the default streams, and copies what lies in host memory.
void ResidentDetector::Work::bring(std::span<const Spheres> parts) {
  std::uint64_t first = 0;
  for (std::size_t k = 0; k < parts.size(); k++)
    places_[k]->first = std::exchange(first, first + parts[k].count);
  report_.spheres = body_spheres_ + first;
  each_place([&](Place& p, std::size_t k) {
    cuda::cuda_check(cudaStreamSynchronize(nullptr), "finish the work given before");
    if (parts[k].memory == Memory::device && parts[k].count)
      cuda::check_device_memory(parts[k].centers, p.device, "the centres of the loose spheres");
    p.part = p.upload->run(parts[k], p.stream);
    if (places_.size() > 1 && p.part.count && !cuda::is_packed(p.part)) pack(p);
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy spheres to the GPU");
  });
}

void ResidentDetector::Work::check_faults() {
  for (const auto& p : places_) {
    if (p->counts.faulty == ~std::uint64_t(0)) continue;
    const std::uint64_t k = p->counts.faulty;
    const cuda::OnDevice on(p->device);
    const Spheres& one = p->part;
    const std::uint64_t real = one.scalar == Scalar::f32 ? 4 : 8;
    double v[4];
    const auto read = [&](double& to, const void* array, std::uint64_t at) {
      float narrow = 0;
      void* const there = real == 4 ? static_cast<void*>(&narrow) : &to;
      cuda::cuda_check(
          cudaMemcpy(there, static_cast<const char*>(array) + at * real, real, cudaMemcpyDeviceToHost),
          "read a sphere");
      if (real == 4) to = narrow;
    };
    for (std::uint64_t a = 0; a < 3; a++) read(v[a], one.centers, k * one.center_stride + a);
    read(v[3], one.radii, k * one.radius_stride);
    throw Error(fault_sentence(body_spheres_ + p->first + k, {v[0], v[1], v[2], v[3]}, bodies_));
  }
}

// Bodies are not dealt out, so what is known of them is the call before.
double ResidentDetector::Work::expected_imbalance() const {
  if (!bodies_.bodies.empty()) return imbalance_;
  std::vector<double> work(places_.size(), 0);
  for (std::size_t to = 0; to < places_.size(); to++)
    for (const auto& from : places_)
      work[to] += places_[to]->density * static_cast<double>(from->counts.to[to]);
  return cuda::imbalance_of(work);
}

// A body counts with all of its spheres where its origin is.
void ResidentDetector::Work::sample_bodies(std::vector<WeightedPoint>& points) {
  const std::uint64_t count = bodies_.bodies.size(), step = count / cuda::kSampleOfDevice + 1;
  const std::uint64_t drawn = (count + step - 1) / step;
  std::vector<double> at(3 * drawn);
  if (const Pose* const poses = places_[0]->all_poses) {
    const cuda::OnDevice on(places_[0]->device);
    cuda::cuda_check(cudaMemcpy2D(at.data(), 3 * sizeof(double), poses->position, step * sizeof(Pose),
                                  3 * sizeof(double), drawn, cudaMemcpyDeviceToHost),
                     "draw a sample of the bodies");
  } else {
    for (std::uint64_t k = 0; k < drawn; k++) std::copy_n(body_at(bodies_, k * step).position, 3, &at[3 * k]);
  }
  for (std::uint64_t k = 0; k < drawn; k++) {
    const Shape& shape = bodies_.shapes[bodies_.bodies[k * step].shape];
    if (std::isfinite(at[3 * k] + at[3 * k + 1] + at[3 * k + 2]))  // else detection will say what is wrong
      points.push_back({{at[3 * k], at[3 * k + 1], at[3 * k + 2]},
                        static_cast<double>(shape.count) * static_cast<double>(step)});
  }
}

// Deals again where the halos were made for a smaller radius than the scene has, where space has to be cut
// anew, and where there was too little room for what goes away.
void ResidentDetector::Work::deal() {
  if (!has_tree_) cut();
  for (;;) {
    each_place([&](Place& p, std::size_t k) {
      p.counts = p.dealer->deal(p.part, regions_, static_cast<int>(k), halo_radius_, p.away_room, p.stream);
      if (p.counts.away == 0 || p.counts.away > p.away_room) return;
      p.away->reserve(p.away_room, form_);
      p.dealer->gather_away(p.part, p.counts.away, body_spheres_ + p.first, p.away->from(0, form_), p.stream);
      cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy the spheres for other boxes");
    });
    check_faults();
    double radius = 0;
    for (const auto& p : places_) radius = std::max(radius, p->counts.largest_radius);
    if (radius > halo_radius_)
      halo_radius_ = 2 * radius;
    else if (!report_.cut && expected_imbalance() > std::max(cuda::kMostImbalance, 1.05 * settled_imbalance_))
      cut();
    else if (has_room())
      return;
  }
}

bool ResidentDetector::Work::has_room() {
  bool all = true;
  for (std::size_t k = 0; k < places_.size(); k++) {
    Place& p = *places_[k];
    p.before = p.behind = 0, p.own = p.counts.to[k];
    for (std::size_t from = 0; from < places_.size(); from++)
      if (from != k) (from < k ? p.before : p.behind) += places_[from]->counts.to[k];
    p.loaded = p.before + p.behind + (stays_in_place(p) ? p.part.count : p.own);
    if (p.loaded >= 0xffffffff)
      throw Error("the box of GPU " + std::to_string(p.device) + " holds " + std::to_string(p.loaded) +
                  " spheres, more than a detector numbers: use more GPUs");
    if (p.counts.away > p.away_room) p.away_room = p.counts.away + p.counts.away / 8 + 64, all = false;
  }
  return all;
}

bool ResidentDetector::Work::stays_in_place(const Place& p) const {
  return p.counts.astray * cuda::kMostAstray <= p.part.count;
}

// Each sphere weighs what spheres of its box cost in the call before: itself, and its contacts.
void ResidentDetector::Work::cut() {
  std::vector<std::vector<WeightedPoint>> drawn(places_.size());
  each_place(
      [&](Place& p, std::size_t k) { drawn[k] = p.dealer->sample(p.part, cuda::kSampleOfDevice, p.stream); });
  std::vector<WeightedPoint> points;
  std::vector<double> plain;
  sample_bodies(drawn.emplace_back());
  const std::size_t loose = std::accumulate(drawn.begin(), drawn.end() - 1, std::size_t(0),
                                            [](std::size_t n, const auto& some) { return n + some.size(); });
  for (const auto& some : drawn)
    for (WeightedPoint p : some) {
      plain.push_back(p.weight);
      if (has_tree_) p.weight *= places_[tree_.box_of(p.at)]->density;
      points.push_back(p);
    }
  tree_ = cut_space(points, static_cast<std::uint32_t>(places_.size()));
  std::vector<double> work(places_.size(), 0), weight(places_.size(), 0);
  for (const auto& p : places_) p->body_spheres = 0;
  for (std::size_t k = 0; k < points.size(); k++) {
    const std::uint32_t box = tree_.box_of(points[k].at);
    work[box] += points[k].weight, weight[box] += plain[k];
    if (k >= loose) places_[box]->body_spheres += plain[k];
  }
  for (std::uint32_t b = 0; b < tree_.boxes(); b++) {
    regions_.of[b] = tree_.region(b);
    places_[b]->density = weight[b] > 0 ? work[b] / weight[b] : 1;
  }
  has_tree_ = true, informed_ = known_density_, report_.cut = true;
}

// Brings what the other GPUs have for this one: spheres that come before its own, then its own where they are
// copied, then those that come behind.
void ResidentDetector::Work::exchange(Place& p, std::size_t k) {
  const std::uint64_t own = stays_in_place(p) ? 0 : p.own;
  std::uint64_t before = 0, behind = p.before + own;
  p.others->reserve(behind + p.behind, form_);
  for (std::size_t from = 0; from < places_.size(); from++) {
    if (from == k) continue;
    const Place& other = *places_[from];
    std::uint64_t there = 0;
    for (std::size_t to = 0; to < k; to++) there += to == from ? 0 : other.counts.to[to];
    const std::uint64_t count = other.counts.to[k];
    std::uint64_t& here = from < k ? before : behind;
    cuda::copy_to_peer(p.others->from(std::exchange(here, here + count), form_), p.device,
                       other.away->from(there, form_), other.device, count, form_.scalar, p.stream);
  }
  if (own)
    p.dealer->gather_own(p.part, regions_, static_cast<int>(k), halo_radius_, own, body_spheres_ + p.first,
                         p.others->from(p.before, form_), p.stream);
  cuda::cuda_check(cudaStreamSynchronize(p.stream), "bring spheres from the other GPUs");
}

// What the GPU's detector is given, and found_[k] as far as it tells of that.
Input ResidentDetector::Work::input_of(Place& p, std::size_t k) {
  ResidentContacts& f = found_[k];
  Input input = bodies_;
  f.device = p.device;
  if (places_.size() == 1) {
    f.own = input.spheres = p.part;
    return input;
  }
  const DealTarget at = p.others->from(0, form_);
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
  const bool alone = places_.size() == 1;
  const double start = cuda::now();
  found_.assign(places_.size(), {});
  each_place([&](Place& p, std::size_t k) {
    if (!alone) exchange(p, k);
    if (alone) p.loaded = p.own = p.part.count, p.before = p.behind = 0;
    if (k == 0) report_.deal_seconds += cuda::now() - start;
    Input input = input_of(p, k);
    // Other static spheres may have come; after a call that failed, the detectors differ in what they know.
    if (form_.is_static || failed_) input.revision = 0;
    if (p.all_poses) input.poses = p.all_poses, input.pose_memory = Memory::device;
    CallOptions options = options_;
    options.stream = nullptr, options.output = Memory::device;
    options.own = common(options.own, alone ? Region{} : regions_.of[k]);
    ResidentContacts& f = found_[k];
    f.contacts.memory = Memory::device, f.contacts.width = options.width, f.contacts.scalar = options.scalar;
    if (is_empty(options.own)) return;
    p.detector.options() = options;
    f.contacts = p.detector.detect(input);
  });
}

void ResidentDetector::Work::finish() {
  std::vector<double> work;
  for (std::size_t k = 0; k < places_.size(); k++) {
    const Place& p = *places_[k];
    const double spheres = static_cast<double>(p.before + p.own + p.behind) + p.body_spheres;
    const Contacts& c = found_[k].contacts;
    work.push_back(spheres + static_cast<double>(c.count));
    places_[k]->density = spheres > 0 ? work.back() / spheres : 1;
    report_.contacts += c.count, report_.doubtful += c.doubtful, report_.copies += places_[k]->loaded;
    report_.moved_bytes += places_[k]->counts.away * form_.bytes_of_one();
  }
  known_density_ = true, report_.copies += body_spheres_;
  report_.imbalance = imbalance_ = cuda::imbalance_of(work);
  if (report_.cut) settled_imbalance_ = informed_ ? report_.imbalance : 1;
}

const ResidentReport& ResidentDetector::Work::run(std::span<const Spheres> parts, const Input& bodies,
                                                  std::span<const ResidentPoses> poses) {
  report_ = {}, found_.clear();
  try {
    const double start = cuda::now();
    form_ = check(parts);
    check_bodies(bodies, poses);
    bring(parts);
    bring(poses);
    const double brought = cuda::now();
    if (places_.size() > 1) deal();
    report_.upload_seconds = brought - start, report_.deal_seconds = cuda::now() - brought;
    send_and_detect();
    finish();
    report_.detect_seconds = cuda::now() - brought - report_.deal_seconds;
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
  each_place([&](Place& p, std::size_t k) {
    const ResidentContacts& f = found_[k];
    sums[k] = cuda::hash_of_numbered_pairs(f.contacts.pairs, f.contacts.count, f.numbers, p.sum, p.stream);
  });
  std::uint64_t sum = 0;
  for (const std::uint64_t s : sums) sum += s;
  return sum;
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
