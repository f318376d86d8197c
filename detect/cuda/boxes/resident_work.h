// SPDX-License-Identifier: MIT
// What a ResidentDetector keeps and does. Internal; only .cu files include this.
#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "detect/boxes/resident_detector.h"
#include "detect/core/bodies/pieces.h"
#include "detect/cuda/boxes/crew.h"
#include "detect/cuda/boxes/deal.h"
#include "detect/cuda/boxes/place.h"

namespace padder::detect {
namespace cuda {

// What the GPUs learn of each other at the beginning of a call.
struct Given {
  std::uint64_t spheres = 0;  // of the part
  std::uint64_t bodies = 0, body_spheres = 0, poses = 0;
  bool poses_in_parts = false;
  Form form;
};

// And at its end.
struct Done {
  double work = 0, density = 1;  // spheres and contacts; that for each sphere
  std::uint64_t contacts = 0, doubtful = 0, copies = 0, moved_bytes = 0;
};

}  // namespace cuda

class ResidentDetector::Work {
  using Place = cuda::Place;

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
  // resident_detector.cu
  void choose_devices(std::vector<int> devices);
  void each_place(const std::function<void(Place&, std::size_t)>& work);
  void together(const std::function<void()>& work) const { ranks_ ? ranks_->together(work) : work(); }
  template <class T>
  std::vector<T> of_all(const std::vector<T>& mine) const;
  bool alone() const { return regions_.size() == 1; }
  std::size_t box_of(std::size_t place) const { return first_box_ + place; }
  std::vector<cuda::Given> check(std::span<const Spheres> parts, std::span<const ResidentPoses> poses) const;
  void check_bodies(const Input& bodies);
  void agree(const std::vector<cuda::Given>& given);
  Input input_of(Place& p, std::size_t k);
  void send_and_detect();
  void finish();

  // resident_deal.cu: which GPU needs which sphere
  void sample_bodies(std::vector<WeightedPoint>& points);
  void cut();
  void deal();
  void deal_once();
  void check_faults();
  void learn_coming();
  double expected_imbalance() const;
  bool has_room();
  bool stays_in_place(const Place& p) const;
  cuda::HaloWidth halos() const { return {halo_radius_, options_.margin}; }

  // resident_travel.cu: what comes to a GPU from the host, from other GPUs and from other ranks
  void bring(std::span<const Spheres> parts);
  void pack(Place& p) const;
  void bring_poses(std::span<const ResidentPoses> poses);
  void let_poses_stay(std::span<const ResidentPoses> poses);
  bool goes_bodies_first() const;
  std::vector<ListedElements> exchange_elements(Place& p, std::size_t k, std::vector<ListedElements> mine);
  void bring_from_ranks(const ResidentPoses& poses);
  void exchange(Place& p, std::size_t k);
  void exchange_with_ranks(Place& p);
  void gather_own(Place& p);

  CallOptions options_;
  std::shared_ptr<ResidentRanks> ranks_;        // null: this process alone
  std::vector<std::unique_ptr<Place>> places_;  // of this process
  std::size_t first_box_ = 0;                   // that of the first place
  cuda::Form form_;
  Input bodies_;                                   // of the call
  std::uint64_t body_spheres_ = 0, revision_ = 0;  // of the bodies; of the call before
  bool failed_ = false;                            // the call before
  std::vector<std::uint64_t> poses_of_;            // in each part; empty: they come with the bodies
  bool read_each_other_ = false;                   // all GPUs, by their kernels
  bool have_worlds_ = false;                       // the bodies
  Pieces pieces_;                                  // of their shapes
  bool bodies_first_ = false;                      // automatically
  bool poses_stay_ = false;                        // in this call GPUs read each other's poses
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

// What each place has, of the places of all ranks.
template <class T>
std::vector<T> ResidentDetector::Work::of_all(const std::vector<T>& mine) const {
  if (!ranks_) return mine;
  std::vector<T> all(regions_.size());
  ranks_->gather(mine.data(), all.data(), sizeof(T));
  return all;
}

}  // namespace padder::detect
