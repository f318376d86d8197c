// SPDX-License-Identifier: MIT
#include "detect/omp/worlds/world_search.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "padding/asset/error.h"

namespace padder::detect::omp {
namespace {

constexpr std::uint32_t kPartElements = 64;

}  // namespace

// The spheres of an element that may be near another one, placed.
struct WorldSearch::Spheres64 {
  std::uint32_t count = 0, slot[kPieceSpheres];
  Sphere sphere[kPieceSpheres];
};

WorldSearch::WorldSearch(Budget& b)
    : elements_(b),
      elements_given_(b),
      balls_(b),
      balls_given_(b),
      filters_(b),
      worlds_(b),
      worlds_given_(b),
      world_end_(b),
      order_(b),
      curve_(b),
      tree_(b),
      hits_(b, "contacts") {}

void WorldSearch::read_elements(const Input& input, int threads) {
  spheres_ = &input.spheres;
  pieces_.update(input.shapes);
  bodies_.assign(input.bodies.begin(), input.bodies.end());
  body_first_.assign(1, 0);
  std::vector<std::uint32_t> first_element(1, 0);
  for (std::size_t b = 0; b < bodies_.size(); b++) {
    if (input.poses) bodies_[b] = body_at(input, b);
    const std::uint32_t shape = bodies_[b].shape;
    body_first_.push_back(body_first_.back() + static_cast<std::uint32_t>(input.shapes[shape].count));
    first_element.push_back(first_element.back() + pieces_.shape_first[shape + 1] -
                            pieces_.shape_first[shape]);
  }
  const std::uint32_t of_bodies = first_element.back(),
                      all = of_bodies + static_cast<std::uint32_t>(input.spheres.count);
  Element* elements = elements_given_.resize(all, "pieces of bodies");
  Sphere* balls = balls_given_.resize(all, "the balls about bodies");
  std::uint32_t* worlds = worlds_given_.resize(all, "worlds");
  elements_in_all_ = all;
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(bodies_.size()); k++) {
    const Body& body = bodies_[static_cast<std::size_t>(k)];
    std::uint32_t at = first_element[static_cast<std::size_t>(k)];
    for (std::uint32_t p = pieces_.shape_first[body.shape]; p < pieces_.shape_first[body.shape + 1];
         p++, at++)
      elements[at] = {static_cast<std::uint32_t>(k), p}, worlds[at] = body.world,
      balls[at] = ball_of(body, pieces_.pieces[p]);
  }
  const Spheres& s = input.spheres;
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(s.count); k++) {
    const std::uint32_t at = of_bodies + static_cast<std::uint32_t>(k);
    elements[at] = {kLoose, static_cast<std::uint32_t>(k)};
    worlds[at] = s.world ? s.world[k] : s.world_of_all;
    balls[at] = loose_at(s, static_cast<std::uint64_t>(k));
  }
}

// Throws Error for the first sphere with a fault. The ball of a piece is no number where one of its spheres
// has a fault, or lies so far out that there are no balls; then it becomes a ball that contains everything.
void WorldSearch::check_elements(const Input& input, const CallOptions& options) const {
  double extent = 0;
  std::uint64_t fault = ~std::uint64_t(0);
  Sphere faulty;
  const auto check = [&](std::uint64_t k, const Sphere& s) {
    if (fault_of(s) != Fault::none && k < fault) fault = k, faulty = s;
  };
  for (std::uint32_t k = 0; k < elements_in_all_; k++) {
    const Element& e = elements_given_[k];
    Sphere& ball = balls_given_[k];
    if (e.body == kLoose) {
      check(std::uint64_t(body_first_.back()) + e.piece, ball);
    } else if (!(ball.r < INFINITY)) {
      const Piece& piece = pieces_.pieces[e.piece];
      for (std::uint32_t q = piece.first; q < piece.first + piece.count; q++)
        check(body_first_[e.body] + pieces_.numbers[q], placed(bodies_[e.body], pieces_.spheres[q]));
      ball = {0, 0, 0, INFINITY};
    }
    extent =
        std::max({extent, std::abs(ball.x) + ball.r, std::abs(ball.y) + ball.r, std::abs(ball.z) + ball.r});
  }
  if (fault != ~std::uint64_t(0)) throw Error(fault_sentence(fault, faulty, input));
  Summary summary;
  summary.extent = extent;
  check_range(summary, options);
}

// The place of each element that is given, on a curve through all of them.
void WorldSearch::place_on_curve_all(int threads) {
  const std::uint32_t n = elements_in_all_;
  std::uint64_t* curve = curve_.resize(n, "sorting");
  const CurveBox box = curve_box(balls_given_.data(), n);
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(n); k++)
    curve[k] = place_on_curve(box, balls_given_[static_cast<std::uint64_t>(k)]);
}

// Orders the elements by world, and those of large worlds along a curve.
void WorldSearch::order(int threads) {
  const std::uint32_t n = elements_in_all_;
  std::uint32_t *order = order_.resize(n, "sorting"), *worlds = worlds_.resize(n, "worlds"),
                *end = world_end_.resize(n, "worlds");
  const std::uint32_t* given = worlds_given_.data();
  std::iota(order, order + n, 0u);
  if (!std::is_sorted(given, given + n))
    std::stable_sort(order, order + n, [=](std::uint32_t a, std::uint32_t b) { return given[a] < given[b]; });
  for (std::uint32_t k = n; k-- > 0;) {
    worlds[k] = given[order[k]];
    end[k] = k + 1 < n && worlds[k + 1] == worlds[k] ? end[k + 1] : k + 1;
  }
  bool placed = false;
  for (std::uint32_t first = 0; first < n; first = end[first]) {
    if (end[first] - first <= kSmallWorld) continue;
    if (!placed) place_on_curve_all(threads), placed = true;
    const std::uint64_t* curve = curve_.data();
    std::sort(order + first, order + end[first], [=](std::uint32_t a, std::uint32_t b) {
      return curve[a] != curve[b] ? curve[a] < curve[b] : a < b;
    });
  }
  every_first_ = static_cast<std::uint32_t>(std::lower_bound(worlds, worlds + n, kEveryWorld) - worlds);
}

void WorldSearch::place_in_order(int threads) {
  const std::uint32_t n = elements_in_all_;
  Element* elements = elements_.resize(n, "pieces of bodies");
  Sphere* balls = balls_.resize(n, "the balls about bodies");
  Filter* filters = filters_.resize(n, "families and masks");
  const Spheres& s = *spheres_;
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(n); k++) {
    const std::uint32_t from = order_[static_cast<std::uint64_t>(k)];
    const Element e = elements[k] = elements_given_[from];
    balls[k] = balls_given_[from];
    filters[k] = e.body == kLoose ? filter_at(s, e.piece) : filter_of(bodies_[e.body], e.body);
  }
  tree_.build(balls, n, threads);
}

void WorldSearch::read(const Input& input, const CallOptions& options, int threads) {
  read_elements(input, threads);
  check_elements(input, options);
  order(threads);
  place_in_order(threads);
}

// Parts of the elements before `end`, none of them of two worlds.
void WorldSearch::make_parts(std::uint32_t end) {
  parts_.clear();
  for (std::uint32_t first = 0; first < end;) {
    const std::uint32_t next = std::min(first + kPartElements, world_end_[first]);
    parts_.push_back({.first = first, .end = next, .nearest = {}});
    first = next;
  }
}

// The spheres of element e whose gap to the ball `other` is at most `reach`. Returns how many were tested.
std::uint32_t WorldSearch::gather(std::uint32_t e, const Sphere& other, double reach, Spheres64& out) const {
  const Element& element = elements_[e];
  out.count = 0;
  if (element.body == kLoose) {
    out.slot[0] = element.piece, out.sphere[0] = balls_[e], out.count = 1;
    return 0;
  }
  const Piece& piece = pieces_.pieces[element.piece];
  for (std::uint32_t k = piece.first; k < piece.first + piece.count; k++) {
    const Sphere s = placed(bodies_[element.body], pieces_.spheres[k]);
    out.slot[out.count] = k, out.sphere[out.count] = s;
    out.count += near_each_other(s, other, reach);
  }
  return piece.count;
}

// Calls found(slot of a, slot of b, spheres) for each contact of two elements; false ends the search. `reach`
// is the largest gap of interest, which found() may lessen. `in_vain` grows by the tests that found nothing.
template <class Found>
bool WorldSearch::test_pair(std::uint32_t a, std::uint32_t b, const CallOptions& options, const double& reach,
                            Spheres64& of_a, Spheres64& of_b, std::uint64_t& in_vain, Found found) const {
  in_vain += gather(a, balls_[b], reach, of_a);
  if (of_a.count == 0) return true;
  in_vain += gather(b, balls_[a], reach, of_b);
  in_vain += std::uint64_t(of_a.count) * of_b.count;
  const bool own = options.own != Region{};
  for (std::uint32_t i = 0; i < of_a.count; i++)
    for (std::uint32_t j = 0; j < of_b.count; j++) {
      const Sphere &sa = of_a.sphere[i], &sb = of_b.sphere[j];
      if (!touching(sa, sb, options.margin)) continue;
      if (own && !owns(options.own, number(a, of_a.slot[i]) < number(b, of_b.slot[j]) ? midpoint(sa, sb)
                                                                                      : midpoint(sb, sa)))
        continue;
      in_vain--;
      if (!found(b, of_a.slot[i], of_b.slot[j], sa, sb)) return false;
    }
  return true;
}

// The contacts of element e with those behind it in its world, and with kEveryWorld. False: found() ended it.
template <class Found>
bool WorldSearch::search(std::uint32_t e, const CallOptions& options, const double& reach,
                         Allowance& allowance, Found found) const {
  Spheres64 of_a, of_b;
  TreeBox box = box_of(balls_[e], reach);
  double reach_of_box = reach;
  bool goes_on = true;
  std::uint64_t in_vain = 0;
  const auto test = [&](std::uint32_t k) {
    in_vain++;
    if (!near_each_other(balls_[e], balls_[k], reach) || !admitted(filters_[e], filters_[k])) return true;
    goes_on = test_pair(e, k, options, reach, of_a, of_b, in_vain, found);
    if (reach < reach_of_box) box = box_of(balls_[e], reach_of_box = reach);
    return goes_on;
  };
  tree_->visit(box, e + 1, world_end_[e], test);
  if (goes_on && worlds_[e] != kEveryWorld) tree_->visit(box, every_first_, elements_in_all_, test);
  allowance.spend(in_vain);
  return goes_on;
}

void WorldSearch::write(const CallOptions& options, int threads, Records& records) {
  records.resize(hits_.size(), options);
  hits_.each(threads, [&](std::span<const Hit> hits, std::uint64_t place) {
    RecordWriter writer(records, options, place);
    for (const Hit& h : hits)
      writer.add(number(h.a_element, h.a_slot), number(h.b_element, h.b_slot), sphere(h.a_element, h.a_slot),
                 [&] { return sphere(h.b_element, h.b_slot); });
  });
}

bool WorldSearch::run(const Input& input, const CallOptions& options, int threads, Allowance& allowance,
                      Records& records, Seconds& seconds) {
  Stopwatch watch;
  read(input, options, threads);
  make_parts(elements_in_all_);
  seconds.place = watch.lap();
  hits_.fill(parts_.size(), threads, [&](std::uint64_t part, List<Hit>& list) {
    for (std::uint32_t e = parts_[part].first; e < parts_[part].end && !allowance.exceeded(); e++)
      search(e, options, options.margin, allowance,
             [&](std::uint32_t b, std::uint32_t a_slot, std::uint32_t b_slot, const Sphere&, const Sphere&) {
               list.add({e, a_slot, b, b_slot});
               return true;
             });
  });
  seconds.stage[6] = watch.lap();
  if (allowance.exceeded()) return false;
  write(options, threads, records);
  seconds.stage[8] = watch.lap();
  return true;
}

bool WorldSearch::answer(const Input& input, const CallOptions& options, int threads, Allowance& allowance,
                         AnswerArrays& answers) {
  CallOptions o = options;
  o.width = Width::pairs;  // there are no records whose range could be too small
  read(input, o, threads);
  make_parts(every_first_);
  const Answer answer = answers.answer();
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(parts_.size()); k++) {
    Part& p = parts_[static_cast<std::size_t>(k)];
    const std::uint32_t world = worlds_[p.first];
    if (answer == Answer::distance && answers.is_answered(world)) continue;
    double reach = o.margin;
    for (std::uint32_t e = p.first; e < p.end && !allowance.exceeded(); e++) {
      if (answer == Answer::any && answers.is_answered(world)) break;
      search(e, o, reach, allowance,
             [&](std::uint32_t b, std::uint32_t a_slot, std::uint32_t b_slot, const Sphere& sa,
                 const Sphere& sb) {
               p.hits++;
               if (answer == Answer::any) answers.mark(world);
               if (answer == Answer::distance) {
                 const std::uint32_t i = number(e, a_slot), j = number(b, b_slot);
                 p.nearest.take(signed_distance(sa, sb), {std::min(i, j), std::max(i, j)});
                 reach = std::min(reach, p.nearest.distance);
               }
               return answer != Answer::any;
             });
    }
  }
  if (allowance.exceeded()) return false;
  for (const Part& p : parts_) answers.add(worlds_[p.first], p.hits, p.nearest);
  return true;
}

}  // namespace padder::detect::omp
