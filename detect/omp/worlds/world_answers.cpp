// SPDX-License-Identifier: MIT
#include "detect/omp/worlds/world_answers.h"

#include <algorithm>

#include "detect/core/errors.h"
#include "detect/core/world_tree.h"

namespace padder::detect::omp {

void Nearest::take(double d, Pair p) {
  if (d < distance || (d == distance && (p.i < pair.i || (p.i == pair.i && p.j < pair.j))))
    distance = d, pair = p;
}

void AnswerArrays::begin(const Input& input, std::uint32_t worlds, Answer answer) {
  const auto check = [&](bool loose, std::uint64_t k, std::uint32_t world) {
    if (world >= worlds && world != kEveryWorld) throw Error(world_sentence(loose, k, world, worlds));
  };
  for (std::size_t b = 0; b < input.bodies.size(); b++) check(false, b, input.bodies[b].world);
  const Spheres& s = input.spheres;
  for (std::uint64_t k = 0; k < s.count; k++) check(true, k, s.world ? s.world[k] : s.world_of_all);
  answer_ = answer, worlds_ = worlds;
  const auto fill = [&](auto& list, Answer of, auto none) {
    if (answer == of) std::fill_n(list.resize(worlds, "the answers"), worlds, none);
  };
  fill(any_, Answer::any, std::uint8_t(0)), fill(count_, Answer::count, std::uint64_t(0));
  fill(distance_, Answer::distance, double(INFINITY)), fill(pair_, Answer::distance, Pair{~0u, ~0u});
}

bool AnswerArrays::is_answered(std::uint32_t world) const {
  if (answer_ == Answer::any) return std::atomic_ref(any_[world]).load(std::memory_order_relaxed);
  return answer_ == Answer::distance && distance_[world] < INFINITY;
}

bool AnswerArrays::are_all_answered() const {
  for (std::uint32_t w = 0; w < worlds_; w++)
    if (!is_answered(w)) return false;
  return true;
}

void AnswerArrays::mark(std::uint32_t world) {
  std::atomic_ref(any_[world]).store(1, std::memory_order_relaxed);
}

void AnswerArrays::add(std::uint32_t world, std::uint64_t contacts, const Nearest& nearest) {
  if (contacts == 0) return;
  if (answer_ == Answer::any) mark(world);
  if (answer_ == Answer::count) count_[world] += contacts;
  if (answer_ != Answer::distance) return;
  Nearest best{distance_[world], pair_[world]};
  best.take(nearest.distance, nearest.pair);
  distance_[world] = best.distance, pair_[world] = best.pair;
}

template <class T>
void AnswerArrays::add(const View<T>& spheres, const Records& list, int threads) {
  constexpr std::int64_t kChunk = 4096;
#pragma omp parallel num_threads(threads)
  {
    // Pairs that follow each other are mostly of one world.
    std::uint32_t world = kEveryWorld;
    std::uint64_t contacts = 0;
    Nearest nearest;
    const auto add_run = [&] {
      if (world != kEveryWorld)
#pragma omp critical(padder_world_answers)
        add(world, contacts, nearest);
      contacts = 0, nearest = {};
    };
#pragma omp for schedule(static, kChunk) nowait
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(list.count); k++) {
      const Pair p = list.pairs[static_cast<std::uint64_t>(k)];
      const std::uint32_t of_i = spheres.world_of(p.i),
                          own = of_i == kEveryWorld ? spheres.world_of(p.j) : of_i;
      if (own != world) add_run(), world = own;
      contacts++;
      if (answer_ == Answer::distance) nearest.take(signed_distance(spheres[p.i], spheres[p.j]), p);
    }
    add_run();
  }
}
template void AnswerArrays::add(const View<float>&, const Records&, int);
template void AnswerArrays::add(const View<double>&, const Records&, int);

WorldAnswers AnswerArrays::arrays() const {
  WorldAnswers answers;
  answers.worlds = worlds_;
  if (answer_ == Answer::any) answers.any = any_.data();
  if (answer_ == Answer::count) answers.count = count_.data();
  if (answer_ == Answer::distance) answers.distance = distance_.data(), answers.pair = pair_.data();
  return answers;
}

}  // namespace padder::detect::omp
