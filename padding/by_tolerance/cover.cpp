// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "padding/asset/error.h"
#include "padding/by_tolerance/block_search.h"
#include "padding/by_tolerance/cover_problem.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"

namespace padder {
namespace {

constexpr double rounding =
    1e-9;                       // share of a tolerance kept back, so that rescaling does not break the proof
constexpr double margin = 0.5;  // share of a row's own radius that must be covered around it
constexpr double late_margin = 0.3;  // the same once the certificate has the last word on what the rows miss
constexpr double medial_tolerance = 0.05;  // share of the reach
constexpr double wander = 0.25;  // how far new places lie from a chosen ball's, share of the disc it covers

// How a large cover is searched on: more rounds of more places, also while the certificate still finds spots.
// It takes as much off a small one, whose seconds matter more: there it is left to a higher effort.
constexpr int late_moves = 4, late_places = 12, late_refinements = 8;
constexpr double late_share = 0.6;  // of the exchanges
constexpr std::array late_wander = {0.5 * wander, 1.6 * wander};

constexpr int most_rounds = 100;

// What an effort buys.
struct Search {
  double fine_density;
  int moves;     // rounds of trying new places around the chosen balls
  int places;    // that each ball tries
  double steps;  // exchanges of the local search, for each ball
};
Search search_of(int effort) {
  constexpr Search searches[] = {{4, 0, 0, 0}, {6, 2, 8, 100}, {8, 3, 16, 150}, {10, 4, 16, 400}};
  return searches[std::clamp(effort, 0, 3)];
}

class Coverer {
 public:
  Coverer(const Surface& surface, const CoverOptions& options)
      : surface_(surface),
        mesh_(surface.mesh()),
        protrusion_(std::min(options.protrusion, options.max_radius) * (1 - rounding)),
        gap_(options.gap * (1 - rounding)),
        reach_(protrusion_ + gap_),
        min_radius_(options.min_radius),
        largest_(std::min(options.max_radius - protrusion_, surface.bounds().diagonal())),
        large_(options.effort > 1 ? 0 : options.large),
        search_(search_of(options.effort)),
        pool_(gap_) {
    if (mesh_.triangles.empty()) throw Error("there is no surface to cover: the mesh has no triangles");
    if (!(reach_ > 0)) throw Error("a cover needs a tolerance above 0");
  }

  Cover run() {
    if (single()) return finish(true);
    SampleOptions sampling;
    sampling.reach = reach_, sampling.largest = largest_, sampling.fine_density = search_.fine_density;
    Samples samples = sample_surface(surface_, sampling);
    std::vector<Candidate> candidates;
    for (const Sample& s : samples.grown) propose(s.point, s.triangle, s.ball, candidates);
    pool_.add(scaled(samples.coarse, margin), candidates);
    solve(1);
    for (int k = 0; k < search_.moves; k++) {
      move(search_.places, {wander, wander});
      if (k == 0) pool_.replace_rows(scaled(samples.fine, margin));
      solve(1);
    }
    const bool large = search_.moves > 0 && chosen_.size() > large_;
    if (large) pool_.replace_rows(scaled(samples.fine, late_margin));
    for (int k = 0; large && k < late_moves; k++) {
      move(late_places, late_wander);
      solve(late_share);
    }
    // The cap is for radius limits, at the rim of what they leave open; otherwise some ten rounds are enough.
    double share = 0.4;
    for (int round = 0;; round++, share *= 0.7) {
      const std::vector<Cell> failures = gap_failures(mesh_, BallSet(balls()), gap_, 0.25 * reach_);
      if (failures.empty()) return finish(true);
      if (large && round < late_refinements) move(late_places, late_wander);
      if (round == most_rounds || !refine(failures)) return finish(false);
      solve(share);
    }
  }

 private:
  void solve(double share) {
    const Sets sets = pool_.sets();
    SetCover cover(sets, pool_.rows().size());
    cover.greedy(chosen_);
    chosen_ = cover.best();
    if (!(search_.steps > 0)) return;
    std::vector<Point> places;
    for (const Candidate& c : pool_.candidates()) places.push_back(c.ball.center);
    BlockSearch search;
    search.steps = share * search_.steps, search.seed = ++seed_;
    chosen_ = improve_in_blocks(sets, pool_.rows().size(), places, chosen_, search);
  }

  Ball medial(const Point& p, std::uint32_t triangle) const {
    return inner_medial_ball(surface_, p, mesh_.area_normal(triangle).normalized(), largest_,
                             medial_tolerance * reach_);
  }

  // Adds the medial ball, grown as far as allowed, unless it is too small.
  void propose(const Point& p, std::uint32_t triangle, const Ball& medial,
               std::vector<Candidate>& candidates) const {
    const double radius = medial.radius + protrusion_;
    if (radius >= min_radius_) candidates.push_back({{medial.center, radius}, medial.radius, p, triangle});
  }

  static std::vector<Row> scaled(std::vector<Row> rows, double share) {
    for (Row& row : rows) row.margin *= share;
    return rows;
  }

  std::vector<Ball> balls() const {
    std::vector<Ball> balls;
    for (auto k : chosen_) balls.push_back(pool_.candidates()[k].ball);
    return balls;
  }

  // A ball that covers all by itself cannot be bettered, and is found before anything that costs as much as
  // the surface is large: on a fine sphere every triangle is as near as any other to the centre.
  bool single() {
    Random random(1);
    for (int k = 0; k < 4; k++) {
      const auto t = static_cast<std::uint32_t>(random.below(mesh_.triangles.size()));
      if (!(mesh_.area_normal(t).squaredNorm() > 0)) continue;
      const Point p = (mesh_.corner(t, 0) + mesh_.corner(t, 1) + mesh_.corner(t, 2)) / 3;
      std::vector<Candidate> candidates;
      propose(p, t, medial(p, t), candidates);
      if (candidates.empty()) continue;
      const Candidate& c = candidates[0];
      const double limit = (c.ball.radius + gap_) * (c.ball.radius + gap_);
      bool all = true;
      for (const auto& triangle : mesh_.triangles) {
        for (auto v : triangle) all = all && (mesh_.points[v] - c.ball.center).squaredNorm() <= limit;
        if (!all) break;
      }
      if (!all) continue;
      pool_.add({}, candidates);
      chosen_ = {0};
      return true;
    }
    return false;
  }

  // The next problem: the chosen balls, and medial balls at places around theirs, in turn up to the one and
  // up to the other share of their discs away.
  void move(int tries, std::array<double, 2> away) {
    const std::size_t n = chosen_.size() * static_cast<std::size_t>(tries);
    const std::uint64_t seed = ++moves_ << 40;
    std::vector<Sample> places(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
    for (std::size_t k = 0; k < n; k++) {
      const Candidate& c = pool_.candidates()[chosen_[k / static_cast<std::size_t>(tries)]];
      Random random(seed + k);
      const double most = away[k % 2] * covered_disc(c.depth, reach_);
      Vector step;
      for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
      const Nearest at = surface_.nearest(c.point + step);
      places[k] = {at.point, at.triangle, medial(at.point, at.triangle)};
    }
    std::vector<Candidate> fresh;
    for (const Sample& s : places) propose(s.point, s.triangle, s.ball, fresh);
    pool_.keep(chosen_);
    std::iota(chosen_.begin(), chosen_.end(), 0u);
    pool_.add({}, fresh);
  }

  // Makes rows of the worst spots, each with a ball of its own that covers it; false if no such ball is
  // allowed.
  bool refine(const std::vector<Cell>& failures) {
    std::vector<std::uint32_t> order(failures.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return failures[a].value > failures[b].value; });
    std::vector<Point> points;
    for (const Cell& cell : failures) points.push_back(cell.point);
    const PointTree tree(points);
    std::vector<char> gone(failures.size());
    std::vector<std::uint32_t> near, taken;
    for (auto k : order) {
      if (gone[k]) continue;
      taken.push_back(k);
      near.clear();
      tree.find(points[k], 0.25 * reach_, near);
      for (auto other : near) gone[other] = 1;
    }
    std::vector<Ball> medials(taken.size());
#pragma omp parallel for schedule(dynamic, 16) if (taken.size() > 32)
    for (std::size_t k = 0; k < taken.size(); k++)
      medials[k] = medial(points[taken[k]], failures[taken[k]].triangle);
    std::vector<Row> rows;
    std::vector<Candidate> candidates;
    for (std::size_t k = 0; k < taken.size(); k++) {
      const std::size_t before = candidates.size();
      propose(points[taken[k]], failures[taken[k]].triangle, medials[k], candidates);
      // A spot that only rounding kept from being proved needs a ball that covers it with room to spare.
      const double spare = failures[taken[k]].value > gap_ ? 0 : 0.01 * reach_;
      if (candidates.size() > before) rows.push_back({points[taken[k]], spare});
    }
    pool_.add(rows, candidates);
    return !rows.empty();
  }

  Cover finish(bool covered) const {
    Cover cover;
    cover.balls = balls(), cover.covered = covered;
    if (covered) {
      const ProtrusionBound bound = protrusion_bound(surface_, cover.balls);
      cover.proved = bound.proved && bound.max <= protrusion_ + rounding * reach_;
    }
    for (auto k : chosen_) cover.triangle.push_back(pool_.candidates()[k].triangle);
    return cover;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const double protrusion_, gap_, reach_, min_radius_, largest_;
  const std::size_t large_;
  const Search search_;
  Pool pool_;
  std::vector<std::uint32_t> chosen_;
  std::uint64_t seed_ = 0, moves_ = 0;  // used so far
};

}  // namespace

Cover cover_surface(const Surface& surface, const CoverOptions& options) {
  return Coverer(surface, options).run();
}

std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort) {
  const double bound = gap * (1 - rounding);
  const Search search = search_of(effort);
  std::vector<Candidate> candidates(balls.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < balls.size(); k++)
    candidates[k] = {balls[k], std::max(0.0, -surface.signed_nearest(balls[k].center).distance),
                     balls[k].center, 0};
  SampleOptions sampling;
  sampling.reach = gap, sampling.coarse_density = sampling.fine_density = search.fine_density;
  // What the balls cover depends on their sizes, not on the local thickness: none is wanted larger than they
  // are.
  sampling.largest = 0;
  for (const Candidate& c : candidates) sampling.largest = std::max(sampling.largest, c.depth);
  Samples samples = sample_surface(surface, sampling);
  for (Row& row : samples.fine) row.margin *= margin;
  Pool pool(bound);
  pool.add(samples.fine, candidates);

  std::vector<std::uint32_t> chosen;
  const BallSet all(balls);
  std::vector<Point> places;
  for (const Ball& ball : balls) places.push_back(ball.center);
  for (std::uint64_t round = 1;; round++) {
    const Sets sets = pool.sets();
    SetCover cover(sets, pool.rows().size());
    cover.greedy(chosen);
    chosen = cover.best();
    if (search.steps > 0)
      chosen = improve_in_blocks(sets, pool.rows().size(), places, chosen,
                                 {.steps = search.steps * std::pow(0.7, round - 1), .seed = round});
    std::vector<Ball> kept;
    for (auto k : chosen) kept.push_back(balls[k]);
    // Where the chosen leave a gap that others would close, those points become rows. At the rim of what none
    // covers, cells fail in the notch between two balls although no point of them is known to: those are
    // passed over.
    std::vector<Row> rows;
    for (const Cell& cell : gap_failures(surface.mesh(), BallSet(kept), bound, 0.25 * gap))
      if (cell.value > bound && all.gap(cell.point).value <= bound * (1 - rounding))
        rows.push_back({cell.point, 0});
    if (rows.empty()) return chosen;
    pool.add(rows, {});
  }
}

}  // namespace padder
