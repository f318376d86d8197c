// SPDX-License-Identifier: MIT
// What detect_worlds() answers on the CPU: arrays with an entry for each world, filled from what the search
// of the tree finds or from a list of contacts. Internal.
#pragma once
#include <atomic>
#include <cmath>

#include "detect/omp/paths.h"

namespace padder::detect::omp {

// The pair with the smallest signed distance so far; of several the first.
struct Nearest {
  double distance = INFINITY;
  Pair pair{~0u, ~0u};
  void take(double other_distance, Pair other);
};

class AnswerArrays {
 public:
  explicit AnswerArrays(Budget& b) : any_(b), count_(b), distance_(b), pair_(b) {}

  // No world has an answer yet. Throws Error if something is in a world that is not below `worlds`.
  void begin(const Input& input, std::uint32_t worlds, Answer answer);
  Answer answer() const { return answer_; }
  // Has a contact of the world been found? Not known of counts.
  bool is_answered(std::uint32_t world) const;
  bool are_all_answered() const;
  void mark(std::uint32_t world);  // it has a contact; threads may do so at once
  // Contacts of a world, and the nearest of them.
  void add(std::uint32_t world, std::uint64_t contacts, const Nearest& nearest);
  // The contacts of a list. Those between two spheres of kEveryWorld count nowhere.
  template <class T>
  void add(const View<T>& spheres, const Records& list, int threads);
  WorldAnswers arrays() const;

 private:
  Answer answer_ = Answer::any;
  std::uint32_t worlds_ = 0;
  Buffer<std::uint8_t> any_;
  Buffer<std::uint64_t> count_;
  Buffer<double> distance_;
  Buffer<Pair> pair_;
};

}  // namespace padder::detect::omp
