// SPDX-License-Identifier: MIT
// Cuts space among the GPUs of a ResidentDetector, and finds which of them needs which sphere.
#include <cmath>
#include <numeric>
#include <string>

#include "detect/core/errors.h"
#include "detect/core/input.h"
#include "detect/cuda/boxes/resident_work.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr double kMostImbalance = 1.1;  // of the heaviest GPU's work over the mean, before space is cut anew
constexpr std::uint64_t kSampleOfDevice = 1 << 13;  // the host sorts the sample while the GPUs wait
// A part of which one sphere of so many is not needed where it lies is copied without those: to read them
// with the rest, and to find their contacts in vain, costs more.
constexpr std::uint64_t kMostAstray = 8;

}  // namespace

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
  return imbalance_of(of_all(work));
}

// A body counts with all of its spheres where its origin is.
void ResidentDetector::Work::sample_bodies(std::vector<WeightedPoint>& points) {
  const std::uint64_t count = bodies_.bodies.size(), step = count / (kSampleOfDevice * regions_.size()) + 1;
  const std::uint64_t drawn = (count + step - 1) / step;
  std::vector<double> at(3 * drawn);
  // Those numbered k * step among the bodies whose poses a GPU has.
  const auto read = [&](int device, const double* poses, std::uint64_t first, std::uint64_t number) {
    const std::uint64_t begin = (first + step - 1) / step, end = (first + number + step - 1) / step;
    if (begin == end) return;
    const cuda::OnDevice on(device);
    cuda::cuda_check(
        cudaMemcpy2D(&at[3 * begin], 3 * sizeof(double), poses + 12 * (begin * step - first) + 9,
                     step * sizeof(Pose), 3 * sizeof(double), end - begin, cudaMemcpyDeviceToHost),
        "draw a sample of the bodies");
  };
  if (places_[0]->all_poses)
    read(places_[0]->device, places_[0]->all_poses->rotation, 0, count);
  else if (poses_stay_)
    for (std::size_t k = 0; k < places_.size(); k++) {
      const PosePart& part = places_[k]->poses_around.parts[k];
      read(places_[k]->device, part.poses, part.first, part.count);
    }
  else
    for (std::uint64_t k = 0; k < drawn; k++) std::copy_n(body_at(bodies_, k * step).position, 3, &at[3 * k]);
  for (std::uint64_t k = 0; k < drawn; k++) {
    const Shape& shape = bodies_.shapes[bodies_.bodies[k * step].shape];
    if (std::isfinite(at[3 * k] + at[3 * k + 1] + at[3 * k + 2]))  // else detection will say what is wrong
      points.push_back({{at[3 * k], at[3 * k + 1], at[3 * k + 2]},
                        static_cast<double>(shape.count) * static_cast<double>(step)});
  }
}

void ResidentDetector::Work::deal_once() {
  const auto deal_part = [&](Place& p, std::size_t) {
    p.counts = p.dealer->deal(p.part, halos(), p.away_room, p.stream);
    if (p.counts.away > 0 && p.counts.away <= p.away_room) {
      p.away->reserve(p.away_room, form_);
      p.dealer->gather_away(p.part, p.counts.away, body_spheres_ + p.first, p.away->from(0, form_), p.stream);
      cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy the spheres for other boxes");
    }
  };
  // Where there are only bodies the GPUs have nothing to do.
  if (std::all_of(places_.begin(), places_.end(), [](const auto& p) { return p->part.count == 0; }))
    for (const auto& p : places_) deal_part(*p, 0);
  else
    each_place(deal_part);
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
    else if (!report_.cut && expected_imbalance() > std::max(kMostImbalance, 1.05 * settled_imbalance_))
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
  return p.counts.astray * kMostAstray < p.part.count;
}

// Each sphere weighs what spheres of its box cost in the call before: itself, and its contacts.
void ResidentDetector::Work::cut() {
  std::vector<std::vector<WeightedPoint>> drawn(places_.size());
  together([&] {
    each_place(
        [&](Place& p, std::size_t k) { drawn[k] = p.dealer->sample(p.part, kSampleOfDevice, p.stream); });
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
  has_tree_ = false;  // until each GPU knows the boxes
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      p.body_spheres = sums[2 * boxes + box_of(k)];
      p.dealer->set_boxes(regions_, box_of(k), p.stream);
    });
  });
  has_tree_ = true, informed_ = known_density_, report_.cut = true;
}

}  // namespace padder::detect
