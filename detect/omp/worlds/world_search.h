// SPDX-License-Identifier: MIT
// Scenes of many worlds, with or without a margin, on the CPU. Elements (pieces of bodies and loose spheres)
// are ordered by world, a tree finds those that are near each other (detect/core/wide_tree.h), and then their
// spheres are tested. Internal.
#pragma once
#include <atomic>

#include "detect/core/bodies/pieces.h"
#include "detect/omp/parts.h"
#include "detect/omp/worlds/sphere_tree.h"
#include "detect/omp/worlds/world_answers.h"

namespace padder::detect::omp {

// How many tests that find no contact a search may make. Threads share it. Whether a list exceeds it depends
// on the scene alone, and not on their number.
class Allowance {
 public:
  static constexpr std::uint64_t kUnlimited = ~std::uint64_t(0);
  explicit Allowance(std::uint64_t tests) : tests_(tests) {}
  void spend(std::uint64_t tests) { spent_.fetch_add(tests, std::memory_order_relaxed); }
  bool exceeded() const { return spent_.load(std::memory_order_relaxed) > tests_; }

 private:
  std::uint64_t tests_;
  std::atomic<std::uint64_t> spent_{0};
};

class WorldSearch {
 public:
  explicit WorldSearch(Budget& b);

  // Writes all contacts to `records`. False: the allowance is exceeded, and nothing was written. Throws Error
  // as Detector::detect() does.
  bool run(const Input& input, const CallOptions& options, int threads, Allowance& allowance,
           Records& records, Seconds& seconds);
  // Answers for those worlds that have none yet. False: the allowance is exceeded, and some still have none.
  bool answer(const Input& input, const CallOptions& options, int threads, Allowance& allowance,
              AnswerArrays& answers);

 private:
  // A contact. A slot is an index in Pieces::spheres, or the number of a loose sphere.
  struct Hit {
    std::uint32_t a_element, a_slot, b_element, b_slot;
  };
  // Consecutive elements of one world: the unit of work, and of the stable order. For an answer, what was
  // found.
  struct Part {
    std::uint32_t first, end;
    std::uint64_t hits = 0;
    Nearest nearest;
  };
  struct Spheres64;

  void read(const Input& input, const CallOptions& options, int threads);
  void read_elements(const Input& input, int threads);
  void order(int threads);
  void place_on_curve_all(int threads);
  void place_in_order(int threads);
  void make_parts(std::uint32_t end);
  void check_elements(const Input& input, const CallOptions& options) const;
  void write(const CallOptions& options, int threads, Records& records);

  Sphere sphere(std::uint32_t e, std::uint32_t slot) const {
    const Element& element = elements_[e];
    return element.body == kLoose ? balls_[e] : placed(bodies_[element.body], pieces_.spheres[slot]);
  }
  std::uint32_t number(std::uint32_t e, std::uint32_t slot) const {
    const Element& element = elements_[e];
    return element.body == kLoose ? body_first_.back() + slot
                                  : body_first_[element.body] + pieces_.numbers[slot];
  }
  std::uint32_t gather(std::uint32_t e, const Sphere& other, double reach, Spheres64& out) const;
  template <class Found>
  bool test_pair(std::uint32_t a, std::uint32_t b, const CallOptions& options, const double& reach,
                 Spheres64& of_a, Spheres64& of_b, std::uint64_t& in_vain, Found found) const;
  template <class Found>
  bool search(std::uint32_t e, const CallOptions& options, const double& reach, Allowance& allowance,
              Found found) const;

  Pieces pieces_;
  std::vector<Body> bodies_;  // at their poses of this call
  std::vector<std::uint32_t> body_first_;
  const Spheres* spheres_ = nullptr;
  // Of each element, in the order of the tree. Of a loose sphere the ball is the sphere itself.
  Buffer<Element> elements_, elements_given_;
  Buffer<Sphere> balls_, balls_given_;
  Buffer<Filter> filters_;
  Buffer<std::uint32_t> worlds_, worlds_given_;
  Buffer<std::uint32_t> world_end_;  // the end of the element's world
  Buffer<std::uint32_t> order_;      // what is given, in the order of the tree
  Buffer<std::uint64_t> curve_;
  SphereTree tree_;
  std::uint32_t elements_in_all_ = 0, every_first_ = 0;  // elements; the first of kEveryWorld
  std::vector<Part> parts_;
  PartLists<Hit> hits_;
};

}  // namespace padder::detect::omp
