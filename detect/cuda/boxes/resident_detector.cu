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

// What the GPUs learn of each other at the beginning of a call.
struct Given {
  std::uint64_t spheres = 0;  // of the part
  std::uint64_t bodies = 0, body_spheres = 0, poses = 0;
  bool poses_on_device = false;
  Form form;
};

// And at its end.
struct Done {
  double work = 0;
  std::uint64_t contacts = 0, doubtful = 0, copies = 0, moved_bytes = 0;
};

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
  Region region(std::size_t k) const { return regions_[first_box_ + k]; }
  std::size_t devices() const { return places_.size(); }
  CallOptions& options() { return options_; }

 private:
  void choose_devices(std::vector<int> devices);
  void each_place(const std::function<void(Place&, std::size_t)>& work);
  void together(const std::function<void()>& work) const { ranks_ ? ranks_->together(work) : work(); }
  template <class T>
  std::vector<T> of_all(const std::vector<T>& mine) const;
  bool alone() const { return regions_.size() == 1; }
  std::size_t box_of(std::size_t place) const { return first_box_ + place; }
  std::vector<cuda::Given> check(std::span<const Spheres> parts, std::span<const ResidentPoses> poses) const;
  void check_bodies(const Input& bodies);
  void agree(const std::vector<cuda::Given>& given, bool poses_in_parts);
  void bring(std::span<const Spheres> parts);
  void pack(Place& p) const;
  void bring(std::span<const ResidentPoses> poses);
  void bring_from_ranks(const ResidentPoses& poses);
  void sample_bodies(std::vector<WeightedPoint>& points);
  void deal();
  void deal_once();
  void learn_coming();
  void check_faults();
  bool has_room();
  void cut();
  double expected_imbalance() const;
  bool stays_in_place(const Place& p) const;
  void exchange(Place& p, std::size_t k);
  void exchange_with_ranks(Place& p);
  void gather_own(Place& p);
  Input input_of(Place& p, std::size_t k);
  void send_and_detect();
  void finish();

  CallOptions options_;
  std::shared_ptr<ResidentRanks> ranks_;        // null: this process alone
  std::vector<std::unique_ptr<Place>> places_;  // of this process
  std::size_t first_box_ = 0;                   // that of the first place
  cuda::Form form_;
  Input bodies_;                                   // of the call
  std::uint64_t body_spheres_ = 0, revision_ = 0;  // of the bodies; of the call before
  bool failed_ = false;                            // the call before
  std::vector<std::uint64_t> poses_of_;            // in each part; empty: they come with the bodies
  std::vector<Region> regions_;                    // the boxes of all GPUs, those of other ranks too
  std::vector<double> density_;                    // of each box: work for each sphere, in the call before
  BoxTree tree_;
  bool has_tree_ = false, known_density_ = false, informed_ = false;
  double settled_imbalance_ = 1;  // what the last cut could reach
  double imbalance_ = 1;          // in the call before
  double halo_radius_ = 0;        // at least the largest radius of the scene
  std::vector<ResidentContacts> found_;
  ResidentReport report_;
  std::unique_ptr<cuda::Crew> crew_;
};

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
  for (const auto& place : places_) {
    const cuda::OnDevice on(place->device);
    for (const int other : devices) cuda::let_access(place->device, other);
  }
  crew_ = std::make_unique<cuda::Crew>(devices.size());
}

// What each place has, of the places of all ranks.
template <class T>
std::vector<T> ResidentDetector::Work::of_all(const std::vector<T>& mine) const {
  if (!ranks_) return mine;
  std::vector<T> all(regions_.size());
  ranks_->gather(mine.data(), all.data(), sizeof(T));
  return all;
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
    if (options_.margin > 0 || loose_have_worlds(input))
      throw Error("spheres that stay on several GPUs have neither a margin nor worlds: use one Detector");
    cuda::Given g{s.count, bodies_.bodies.size(), body_spheres_, 0, !poses.empty(), {}};
    if (!poses.empty()) g.poses = poses[given.size()].count;
    if (s.count) g.form = {s.scalar, s.family != nullptr, s.mask != nullptr, s.is_static != nullptr};
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
  check_input(bodies, false, known);
  if (!known) body_spheres_ = sphere_count(bodies);
}

// What has to be the same on all GPUs, and where each part begins in the scene.
void ResidentDetector::Work::agree(const std::vector<cuda::Given>& given, bool poses_in_parts) {
  form_ = {};
  poses_of_.clear();
  std::uint64_t first = 0, poses = 0;
  bool any = false;
  for (std::size_t b = 0; b < given.size(); b++) {
    const cuda::Given& g = given[b];
    if (g.bodies != given[0].bodies || g.body_spheres != given[0].body_spheres ||
        g.poses_on_device != given[0].poses_on_device)
      throw Error(
          "the ranks were given different bodies or poses: give all of them the same bodies, and each "
          "its part of the poses or none");
    if (b >= first_box_ && b < first_box_ + places_.size()) places_[b - first_box_]->first = first;
    first += g.spheres, poses += g.poses;
    if (poses_in_parts) poses_of_.push_back(g.poses);
    if (g.spheres == 0) continue;
    if (any && g.form.scalar != form_.scalar)
      throw Error("the parts of a scene must be all in float or all in double");
    form_.scalar = g.form.scalar, any = true;
    form_.family |= g.form.family, form_.mask |= g.form.mask, form_.is_static |= g.form.is_static;
  }
  report_.spheres = body_spheres_ + first;
  if (poses_in_parts && poses != bodies_.bodies.size())
    throw Error(std::to_string(poses) + " poses in " + std::to_string(given.size()) +
                " parts were given for " + std::to_string(bodies_.bodies.size()) +
                " bodies: give one pose for each body");
}

// Every GPU gets the poses of all bodies. Those on other GPUs travel from there.
void ResidentDetector::Work::bring(std::span<const ResidentPoses> poses) {
  for (const auto& p : places_) p->all_poses = nullptr;
  if (poses.empty() || bodies_.bodies.empty()) return;
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      if (poses[k].count) cuda::check_device_memory(poses[k].poses, p.device, "the poses");
      p.all_poses = alone() ? poses[0].poses : p.poses.reserve(bodies_.bodies.size());
    });
  });
  if (alone()) return;
  report_.moved_bytes += (regions_.size() - 1) * bodies_.bodies.size() * sizeof(Pose);
  if (ranks_) return bring_from_ranks(poses[0]);
  each_place([&](Place& p, std::size_t) {
    Pose* to = p.poses.data();
    for (std::size_t from = 0; from < poses.size(); to += poses[from++].count)
      if (poses[from].count)
        cuda::cuda_check(cudaMemcpyPeerAsync(to, p.device, poses[from].poses, places_[from]->device,
                                             poses[from].count * sizeof(Pose), p.stream),
                         "copy poses to another GPU");
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy poses to another GPU");
  });
}

void ResidentDetector::Work::bring_from_ranks(const ResidentPoses& poses) {
  Place& p = *places_[0];
  const bool direct = ranks_->reads_device_memory();
  const std::size_t count = bodies_.bodies.size();
  const auto copy = [&](Pose* to, const Pose* from, std::uint64_t n) {
    const cuda::OnDevice on(p.device);
    cuda::cuda_check(cudaMemcpyAsync(to, from, n * sizeof(Pose), cudaMemcpyDefault, p.stream), "copy poses");
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy poses");
  };
  Pose* all = nullptr;
  std::uint64_t mine = 0;
  for (std::size_t b = 0; b < first_box_; b++) mine += poses_of_[b];
  together([&] {
    all = direct ? p.poses.data() : p.poses_on_host.reserve(count);
    copy(all + mine, poses.poses, poses.count);
  });
  std::vector<RankMessage> to, from;
  std::uint64_t first = 0;
  for (std::size_t b = 0; b < regions_.size(); first += poses_of_[b++]) {
    if (b == first_box_) continue;
    to.push_back({static_cast<int>(b), all + mine, poses.count * sizeof(Pose)});
    from.push_back({static_cast<int>(b), all + first, poses_of_[b] * sizeof(Pose)});
  }
  ranks_->exchange(to, from);
  together([&] {
    if (!direct) copy(p.poses.data(), all, count);
  });
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
  each_place([&](Place& p, std::size_t k) {
    cuda::cuda_check(cudaStreamSynchronize(nullptr), "finish the work given before");
    if (parts[k].memory == Memory::device && parts[k].count)
      cuda::check_device_memory(parts[k].centers, p.device, "the centres of the loose spheres");
    p.part = p.upload->run(parts[k], p.stream);
    if (!alone() && p.part.count && !cuda::is_packed(p.part)) pack(p);
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
  std::vector<double> work;
  for (std::size_t k = 0; k < places_.size(); k++)
    work.push_back(density_[box_of(k)] *
                   static_cast<double>(std::accumulate(places_[k]->coming.begin(), places_[k]->coming.end(),
                                                       std::uint64_t(0))));
  return cuda::imbalance_of(of_all(work));
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

void ResidentDetector::Work::deal_once() {
  each_place([&](Place& p, std::size_t) {
    p.counts = p.dealer->deal(p.part, halo_radius_, p.away_room, p.stream);
    if (p.counts.away == 0 || p.counts.away > p.away_room) return;
    p.away->reserve(p.away_room, form_);
    p.dealer->gather_away(p.part, p.counts.away, body_spheres_ + p.first, p.away->from(0, form_), p.stream);
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy the spheres for other boxes");
  });
  check_faults();
}

// How many spheres each GPU needs from each.
void ResidentDetector::Work::learn_coming() {
  for (std::size_t k = 0; k < places_.size(); k++) {
    Place& p = *places_[k];
    p.coming.resize(regions_.size());
    if (ranks_) ranks_->transpose(p.counts.to.data(), p.coming.data());
    for (std::size_t from = 0; !ranks_ && from < places_.size(); from++)
      p.coming[from] = places_[from]->counts.to[k];
    const auto own = p.coming.begin() + static_cast<std::ptrdiff_t>(box_of(k));
    p.before = std::accumulate(p.coming.begin(), own, std::uint64_t(0)), p.own = *own;
    p.behind = std::accumulate(own + 1, p.coming.end(), std::uint64_t(0));
  }
}

// Deals again where the halos were made for a smaller radius than the scene has, where space has to be cut
// anew, and where there was too little room for what goes away.
void ResidentDetector::Work::deal() {
  if (!has_tree_) cut();
  for (;;) {
    together([&] { deal_once(); });
    learn_coming();
    std::vector<double> radii;
    for (const auto& p : places_) radii.push_back(p->counts.largest_radius);
    radii = of_all(radii);
    const double radius = *std::max_element(radii.begin(), radii.end());
    if (radius > halo_radius_)
      halo_radius_ = 2 * radius;
    else if (!report_.cut && expected_imbalance() > std::max(cuda::kMostImbalance, 1.05 * settled_imbalance_))
      cut();
    else if (has_room())
      return;
  }
}

bool ResidentDetector::Work::has_room() {
  std::vector<char> enough;
  together([&] {
    for (const auto& place : places_) {
      Place& p = *place;
      p.loaded = p.before + p.behind + (stays_in_place(p) ? p.part.count : p.own);
      if (p.loaded >= 0xffffffff)
        throw Error("the box of GPU " + std::to_string(p.device) + " holds " + std::to_string(p.loaded) +
                    " spheres, more than a detector numbers: use more GPUs");
      enough.push_back(p.counts.away <= p.away_room);
      if (!enough.back()) p.away_room = p.counts.away + p.counts.away / 8 + 64;
    }
  });
  enough = of_all(enough);
  return std::find(enough.begin(), enough.end(), 0) == enough.end();
}

bool ResidentDetector::Work::stays_in_place(const Place& p) const {
  return p.counts.astray * cuda::kMostAstray <= p.part.count;
}

// Each sphere weighs what spheres of its box cost in the call before: itself, and its contacts.
void ResidentDetector::Work::cut() {
  std::vector<std::vector<WeightedPoint>> drawn(places_.size());
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      drawn[k] = p.dealer->sample(p.part, cuda::kSampleOfDevice, p.stream);
    });
    drawn.emplace_back();
    if (first_box_ == 0) sample_bodies(drawn.back());  // all ranks know all bodies
  });
  std::vector<WeightedPoint> points;
  std::vector<double> plain;
  for (const auto& some : drawn)
    for (WeightedPoint p : some) {
      plain.push_back(p.weight);
      if (has_tree_) p.weight *= density_[tree_.box_of(p.at)];
      points.push_back(p);
    }
  const std::size_t boxes = regions_.size(), loose = points.size() - drawn.back().size();
  tree_ = ranks_ ? ranks_->cut(points) : cut_space(points, static_cast<std::uint32_t>(boxes));
  // Of each box: the work, the weight, and that of bodies.
  std::vector<double> sums(3 * boxes, 0);
  for (std::size_t k = 0; k < points.size(); k++) {
    const std::uint32_t box = tree_.box_of(points[k].at);
    sums[box] += points[k].weight, sums[boxes + box] += plain[k];
    if (k >= loose) sums[2 * boxes + box] += plain[k];
  }
  if (ranks_) ranks_->add_up(sums);
  for (std::uint32_t b = 0; b < tree_.boxes(); b++) {
    regions_[b] = tree_.region(b);
    density_[b] = sums[boxes + b] > 0 ? sums[b] / sums[boxes + b] : 1;
  }
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      p.body_spheres = sums[2 * boxes + box_of(k)];
      p.dealer->set_boxes(regions_, box_of(k), p.stream);
    });
  });
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
  gather_own(p);
  cuda::cuda_check(cudaStreamSynchronize(p.stream), "bring spheres from the other GPUs");
}

// Copies the part's own spheres between those of others, unless they are read where they lie.
void ResidentDetector::Work::gather_own(Place& p) {
  if (!stays_in_place(p))
    p.dealer->gather_own(p.part, halo_radius_, p.own, body_spheres_ + p.first,
                         p.others->from(p.before, form_), p.stream);
}

// The same between the GPUs of ranks, through pinned memory unless they read each other's.
void ResidentDetector::Work::exchange_with_ranks(Place& p) {
  const bool direct = ranks_->reads_device_memory();
  const std::uint64_t own = stays_in_place(p) ? 0 : p.own, come = p.before + p.behind;
  const auto on_gpu = [&](std::uint64_t k) { return p.others->from(k, form_); };
  const auto on_host = [&](std::uint64_t k) { return p.others_on_host->from(k, form_); };
  together([&] {
    const cuda::OnDevice on(p.device);
    p.others->reserve(p.before + own + p.behind, form_);
    gather_own(p);
    if (!direct) {
      p.away_on_host->reserve(p.counts.away, form_), p.others_on_host->reserve(come, form_);
      cuda::copy_spheres(p.away_on_host->from(0, form_), p.away->from(0, form_), p.counts.away, form_.scalar,
                         p.stream);
    }
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy the spheres for other ranks");
  });
  std::vector<RankMessage> to, from;
  const auto add = [&](std::vector<RankMessage>& messages, std::size_t rank, const DealTarget& at,
                       std::uint64_t count) {
    for (const cuda::SphereArray& a : cuda::arrays_of(at, form_.scalar))
      if (a.at && count) messages.push_back({static_cast<int>(rank), a.at, count * a.bytes_of_one});
  };
  std::uint64_t away = 0, come_first = 0;
  for (std::size_t b = 0; b < regions_.size(); b++) {
    if (b == first_box_) {
      if (direct) come_first += own;
      continue;
    }
    add(to, b, (direct ? p.away : p.away_on_host)->from(away, form_), p.counts.to[b]);
    add(from, b, direct ? on_gpu(come_first) : on_host(come_first), p.coming[b]);
    away += p.counts.to[b], come_first += p.coming[b];
  }
  ranks_->exchange(to, from);
  together([&] {
    if (direct) return;
    const cuda::OnDevice on(p.device);
    cuda::copy_spheres(on_gpu(0), on_host(0), p.before, form_.scalar, p.stream);
    cuda::copy_spheres(on_gpu(p.before + own), on_host(p.before), p.behind, form_.scalar, p.stream);
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "bring spheres from other ranks");
  });
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
  const double start = cuda::now();
  found_.assign(places_.size(), {});
  if (ranks_ && !alone()) exchange_with_ranks(*places_[0]);
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      if (!ranks_ && !alone()) exchange(p, k);
      if (alone()) p.loaded = p.own = p.part.count, p.before = p.behind = 0;
      if (k == 0) report_.deal_seconds += cuda::now() - start;
      Input input = input_of(p, k);
      // Other static spheres may have come; after a call that failed, the detectors differ in what they know.
      if (form_.is_static || failed_) input.revision = 0;
      if (p.all_poses) input.poses = p.all_poses, input.pose_memory = Memory::device;
      CallOptions options = options_;
      options.stream = nullptr, options.output = Memory::device;
      options.own = common(options.own, regions_[box_of(k)]);
      ResidentContacts& f = found_[k];
      f.contacts.memory = Memory::device, f.contacts.width = options.width,
      f.contacts.scalar = options.scalar;
      if (is_empty(options.own)) return;
      p.detector.options() = options;
      f.contacts = p.detector.detect(input);
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
    mine.push_back({work, c.count, c.doubtful, p.loaded, p.counts.away * form_.bytes_of_one()});
    density_[box_of(k)] = spheres > 0 ? work / spheres : 1;
  }
  std::vector<double> work, density;
  for (std::size_t k = 0; k < places_.size(); k++) density.push_back(density_[box_of(k)]);
  density_ = of_all(density);
  for (const cuda::Done& d : of_all(mine)) {
    work.push_back(d.work);
    report_.contacts += d.contacts, report_.doubtful += d.doubtful, report_.copies += d.copies;
    report_.moved_bytes += d.moved_bytes;
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
    std::vector<cuda::Given> given;
    together([&] {
      check_bodies(bodies);
      given = check(parts, poses);
    });
    agree(of_all(given), !poses.empty());
    together([&] { bring(parts); });
    bring(poses);
    const double brought = cuda::now();
    if (!alone()) deal();
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
