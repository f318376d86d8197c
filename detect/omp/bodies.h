// SPDX-License-Identifier: MIT
// Searching bodies first on the CPU. Broad phase: the grid path finds the pairs of balls that touch, around
// pieces of bodies and loose spheres. Narrow phase: the spheres of each such pair are tested. Internal.
#pragma once
#include "detect/core/bodies/assembly.h"
#include "detect/core/bodies/body_choice.h"
#include "detect/core/bodies/static_table.h"
#include "detect/omp/parts.h"

namespace padder::detect::omp {

class BodySearch {
 public:
  explicit BodySearch(Budget& b);

  // Writes all contacts to `records`. False if something is wrong with a pose, a sphere or the range of
  // coordinates; then the spheres must be expanded, so that each can be checked.
  bool run(const Input& input, const CallOptions& options, int threads, Records& records, Seconds& seconds);
  // Is its revision that of the previous call, which had this margin?
  bool knows(const Input& input, double margin) const;
  // The work of a call with a known revision, in spheres that are searched one by one. A moving piece counts
  // for more than one, because its ball touches some others and then its spheres are tested.
  std::uint64_t work() const {
    return assembly_.moving + std::uint64_t(kWorkOfPiece - 1) * assembly_.moving_pieces;
  }
  std::uint64_t body_spheres() const { return assembly_.body_first.back(); }
  Pieces& pieces() { return assembly_.pieces; }
  void forget() { revision_ = 0; }  // after a call that did not come here, so that its `moved` was not read

 private:
  // A contact. A slot is an index in Pieces::spheres, or the number of a loose sphere if the body is kLoose.
  struct Hit {
    std::uint32_t a_body, a_slot, b_body, b_slot;
  };
  struct Survivors;

  void read_bodies(const Input& input, bool known);
  bool place(const Input& input, bool known, int threads);
  void find_static_pairs(int threads);
  void search_static(std::uint32_t element, List<Pair>& list);
  bool boxes_are_apart(Pair p) const;
  void test_pair(std::uint64_t pair, const CallOptions& options, Survivors& a, Survivors& b, List<Hit>& hits);
  void gather(std::uint32_t element, const Sphere& other, Survivors& out) const;
  void write(const CallOptions& options, int threads, Records& records);

  Sphere sphere(std::uint32_t body, std::uint32_t slot) const {
    return body == kLoose ? loose_at(*spheres_, slot) : placed(bodies_[body], assembly_.pieces.spheres[slot]);
  }
  // The number of a sphere in the input.
  std::uint32_t sphere_number(std::uint32_t body, std::uint32_t slot) const {
    return body == kLoose ? assembly_.body_first.back() + slot
                          : assembly_.body_first[body] + assembly_.pieces.numbers[slot];
  }
  Filter filter(std::uint32_t e) const { return {family_[e], mask_[e], owner_[e]}; }
  // By how much balls are larger: by more than half of the margin, and by far more than the decisions about
  // it round.
  double grown_by() const { return 0.5 * margin_ * (1 + 0x1p-40); }
  Pair pair(std::uint64_t k) const {
    return k < broad_.count ? broad_.pairs[k] : static_pairs_[k - broad_.count];
  }

  static constexpr std::uint32_t kWorkOfPiece = 16;
  std::uint64_t revision_ = 0, known_loose_ = 0;
  Assembly assembly_;
  StaticTable table_;
  double static_extent_ = 0, margin_ = 0;
  std::vector<Body> bodies_;  // at their poses of this call
  const Spheres* spheres_ = nullptr;
  GridPath grid_path_;
  Records broad_;  // pairs of moving elements whose balls touch
  Buffer<Sphere> balls_;
  Buffer<std::uint32_t> family_, mask_, owner_;
  Buffer<Pair> static_pairs_;  // a moving and a static element whose balls touch
  std::uint64_t static_count_ = 0;
  PartLists<Pair> pair_lists_;
  PartLists<Hit> hit_lists_;
};

}  // namespace padder::detect::omp
