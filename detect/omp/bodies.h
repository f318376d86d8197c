// SPDX-License-Identifier: MIT
// Bodies first on the CPU (bodies.cpp): the fast path over balls about pieces of bodies and over loose
// spheres, then the spheres of each two that meet. Internal.
#pragma once
#include "detect/core/assembly.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

class BodySearch {
 public:
  explicit BodySearch(Budget& b);

  // All contacts to `records`. False: something is out of the ordinary (a pose that is none, coordinates
  // beyond what a record holds); then the spheres must be expanded and each be asked.
  bool run(const Input& input, const Options& options, int threads, Records& records, Seconds& seconds);
  bool knows(const Input& input) const;  // by its revision
  // Of a call whose revision is known, in spheres that are searched one by one: a piece that moves meets some
  // others, and then its spheres are looked at.
  std::uint64_t work() const {
    return assembly_.moving + std::uint64_t(kWorkOfPiece - 1) * assembly_.moving_pieces;
  }
  std::uint64_t body_spheres() const { return assembly_.body_first.back(); }
  void forget() { revision_ = 0; }  // a call went another way: what moved in it was not seen

 private:
  struct Hit {  // sphere `slot` of Pieces, of this body; or of loose spheres
    std::uint32_t a_body, a_slot, b_body, b_slot;
  };
  template <class T>
  struct List {  // of one thread; grows as it must, and counts when it cannot
    explicit List(Budget& b) : buffer(b) {}
    Buffer<T> buffer;
    std::uint64_t size = 0, total = 0;
    bool add(Budget& budget, const T& value);
  };
  struct Part {  // of the list of a thread
    std::uint64_t first, count;
    int thread;
  };
  struct Survivors;

  void read_bodies(const Input& input, bool known);
  bool place(const Input& input, bool known, int threads);
  void meet_static(int threads);
  void meet(std::uint64_t pair, const Options& options, Survivors& a, Survivors& b, List<Hit>& hits);
  void gather(std::uint32_t element, const Sphere& other, Survivors& out) const;
  void write(const Options& options, int threads, Records& records);
  template <class T, class F>
  void in_parts(std::vector<List<T>>& lists, std::vector<Part>& parts, std::uint64_t count, int threads, F f);

  Sphere loose(std::uint32_t k) const;
  Sphere sphere(std::uint32_t body, std::uint32_t slot) const {
    return body == kLoose ? loose(slot) : placed(bodies_[body], assembly_.pieces.spheres[slot]);
  }
  std::uint32_t number(std::uint32_t body, std::uint32_t slot) const {
    return body == kLoose ? assembly_.body_first.back() + slot
                          : assembly_.body_first[body] + assembly_.pieces.numbers[slot];
  }
  Filter filter(std::uint32_t e) const { return {family_[e], mask_[e], owner_[e]}; }
  Pair pair(std::uint64_t k) const {
    return k < broad_.count ? broad_.pairs[k] : static_pairs_[k - broad_.count];
  }

  static constexpr std::uint32_t kWorkOfPiece = 16;
  Budget* budget_;
  std::uint64_t revision_ = 0, known_loose_ = 0;
  Assembly assembly_;
  StaticTable table_;
  double static_extent_ = 0;
  std::vector<Body> bodies_;  // where they are
  const Spheres* spheres_ = nullptr;
  Fast fast_;
  Records broad_;  // pairs of elements
  Buffer<Sphere> balls_;
  Buffer<std::uint32_t> family_, mask_, owner_;
  Buffer<Pair> static_pairs_;
  std::uint64_t static_count_ = 0;
  std::vector<List<Pair>> pair_lists_;
  std::vector<List<Hit>> hit_lists_;
  std::vector<Part> parts_;
};

}  // namespace padder::detect::omp
