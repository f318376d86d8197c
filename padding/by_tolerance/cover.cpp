// SPDX-License-Identifier: MIT
#include "padding/by_tolerance/cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>

#include "padding/asset/error.h"
#include "padding/by_tolerance/block_search.h"
#include "padding/by_tolerance/cover_problem.h"
#include "padding/geometry/medial.h"
#include "padding/geometry/point_tree.h"
#include "padding/geometry/random.h"
#include "padding/geometry/triangle_part.h"

namespace padder {
namespace {

// The share of a tolerance that is kept back, so that scaling to another unit does not break the proof.
constexpr double held_back = 1e-9;

// What one stage of the search does. Each effort above 0 adds a stage, which begins with the cover of the one
// before, so that a higher effort never gives more balls.
struct Stage {
  // Searches that differ in nothing but their random numbers run side by side. All balls that one of them has
  // chosen are the candidates of another search, which therefore finds less than the best of them.
  int starts;
  int moves;      // rounds of each that try new places around the chosen balls
  double steps;   // exchanges of the local search, for each ball
  double margin;  // share of a point's own margin that a ball must cover around it; the certificate finds
                  // what it misses
};
constexpr std::array stages = {Stage{3, 2, 50, 0.15}, Stage{4, 3, 100, 0.1}, Stage{6, 4, 200, 0.1}};
constexpr double greedy_margin = 0.3;
constexpr double thinning_margin = 0.5;  // there no new balls can mend what the points miss

constexpr int kPlaces = 16;  // tried around each ball
// How far from the place of a chosen ball, in turn: share of the radius of the disc that it covers.
constexpr std::array step_sizes = {0.2, 0.3};
constexpr int merge_moves = 2;
// Balls that were tried stay to be chosen from while there are at most so many for each chosen one, and in
// all.
constexpr std::size_t most_tried = 40, most_tried_in_all = 400'000;

// While the certificate still finds spots, the first rounds try some places, too, and each searches less than
// the round before. Later ones only move balls over the spots, and add one where that fails. At last they
// only add balls, so that they end.
constexpr int certify_moves = 10, certify_places = 4, centred_rounds = 40;
constexpr double certify_share = 0.5, certify_decay = 0.85;

// How a ball is centred: sweeps over all balls, and places that are tried in each, half of them nearby.
constexpr int centre_sweeps = 3, centre_places = 16;
constexpr double centre_step = 0.2, centre_decay = 0.8;  // share of the covered disc's radius; for each sweep
constexpr int most_certify_rounds = 100;
constexpr double spot_margin = 0.003;  // of the spots that the certificate finds: share of the tolerance sum

// Up to so many balls, all searches of a stage run. Of more balls, fewer do: there the many blocks of one
// search differ enough. So the time grows with the number of balls, and no faster.
constexpr double balls_for_all_starts = 400;

// A cover that is being looked for: the points to cover, the balls to choose from, and those that are chosen.
struct Attempt {
  CoverProblem problem;
  std::vector<std::uint32_t> chosen;  // indices of candidates
  std::uint64_t seed;                 // of all random numbers from here on

  std::vector<Candidate> chosen_candidates() const {
    std::vector<Candidate> candidates;
    for (auto k : chosen) candidates.push_back(problem.candidates()[k]);
    return candidates;
  }
  std::vector<Ball> balls() const {
    std::vector<Ball> balls;
    for (auto k : chosen) balls.push_back(problem.candidates()[k].ball);
    return balls;
  }
};

// How many of the chosen balls cover each point.
class CoverCounts {
 public:
  explicit CoverCounts(const Attempt& attempt)
      : problem_(attempt.problem), count_(problem_.points().size()), open_(count_.size()) {
    for (const auto k : attempt.chosen) add(k);
  }

  std::uint32_t operator[](std::uint32_t point) const { return count_[point]; }
  std::size_t open() const { return open_; }

  // Puts one candidate in the place of another, unless more points would be open then. Returns the chosen
  // one.
  std::uint32_t exchange(std::uint32_t old, std::uint32_t fresh) {
    const std::size_t before = open_;
    add(fresh), remove(old);
    if (open_ <= before) return fresh;
    add(old), remove(fresh);
    return old;
  }

 private:
  void add(std::uint32_t candidate) {
    for (const auto r : problem_.covered(candidate)) open_ -= count_[r]++ == 0;
  }
  void remove(std::uint32_t candidate) {
    for (const auto r : problem_.covered(candidate)) open_ += --count_[r] == 0;
  }

  const CoverProblem& problem_;
  std::vector<std::uint32_t> count_;
  std::size_t open_;
};

// The certificate for one cover after the other. What was proved stays so until a ball that may have proved
// it is gone, so most of the surface need not be asked again. A triangle that is large beside the balls is
// asked in pieces: of it, too, only what lies beside a change is asked again. Of a stack of such pieces only
// the first is asked until nothing fails. The others are then asked once, and rarely fail.
class OpenPieces {
 public:
  OpenPieces(const Mesh& mesh, double gap) : mesh_(mesh), gap_(gap) {}

  std::vector<GapPart> failures(std::vector<Ball> balls, double grain) {
    const BallSet set(balls);
    if (state_.empty())
      cut(set);
    else
      reopen(balls);
    std::vector<GapPart> found = ask(set, grain);
    if (found.empty() && std::count(state_.begin(), state_.end(), State::stacked) > 0) {
      std::replace(state_.begin(), state_.end(), State::stacked, State::open);
      found = ask(set, grain);
    }
    last_ = std::move(balls);
    return found;
  }

 private:
  enum class State : std::uint8_t { proved, open, stacked };

  // Asks the open pieces, and closes those that are proved.
  std::vector<GapPart> ask(const BallSet& balls, double grain) {
    Mesh part;
    std::vector<std::uint32_t> piece;
    for (std::uint32_t k = 0; k < state_.size(); k++)
      if (state_[k] == State::open) piece.push_back(k), part.triangles.push_back(pieces_.triangles[k]);
    part.points.swap(pieces_.points);
    std::vector<GapPart> failures = gap_failures(part, balls, gap_, grain);
    part.points.swap(pieces_.points);
    for (const std::uint32_t k : piece) state_[k] = State::proved;
    for (GapPart& failure : failures) {
      const std::uint32_t k = piece[failure.triangle];
      state_[k] = State::open, failure.triangle = triangle_[k];
    }
    return failures;
  }

  // Bisects triangles until each piece is about as large as the ball nearest to it, as the certificate would.
  void cut(const BallSet& balls) {
    pieces_.points = mesh_.points;
    double smallest = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls.balls()) smallest = std::min(smallest, ball.radius);
    const double cell = 0.25 * (smallest + gap_);
    std::vector<TrianglePart> stack;
    FirstOfCell first_of_cell;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); t++) {
      const Vector normal = mesh_.area_normal(t);
      stack.push_back({{mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)}, t});
      for (bool whole = true; !stack.empty(); whole = false) {
        const TrianglePart part = stack.back();
        stack.pop_back();
        const double size = part.size();
        if (size > 2 * (smallest + gap_) && !balls.empty() &&
            size > 2 * (balls.balls()[balls.gap(part.centroid()).ball].radius + gap_)) {
          for (const TrianglePart& half : bisect(part)) stack.push_back(half);
          continue;
        }
        const auto first = static_cast<std::uint32_t>(pieces_.points.size());
        if (!whole) pieces_.points.insert(pieces_.points.end(), part.corner.begin(), part.corner.end());
        pieces_.triangles.push_back(whole ? mesh_.triangles[t] : std::array{first, first + 1, first + 2});
        const bool alone = size <= cell || first_of_cell.take(part.centroid(), normal, cell);
        state_.push_back(alone ? State::open : State::stacked);
        triangle_.push_back(t);
      }
    }
  }

  // Opens the pieces that balls of the last cover reach which are not among these.
  void reopen(const std::vector<Ball>& balls) {
    const auto key = [](const Ball& b) {
      return std::array{b.center.x(), b.center.y(), b.center.z(), b.radius};
    };
    std::set<std::array<double, 4>> now;
    for (const Ball& ball : balls) now.insert(key(ball));
    std::vector<Ball> gone;
    for (const Ball& ball : last_)
      if (!now.contains(key(ball))) gone.push_back(ball);
    if (gone.empty()) return;
    const BallSet set(gone);
#pragma omp parallel for schedule(static) if (state_.size() > 4096)
    for (std::size_t k = 0; k < state_.size(); k++) {
      if (state_[k] != State::proved) continue;
      const auto& at = pieces_;
      const Point center = (at.corner(k, 0) + at.corner(k, 1) + at.corner(k, 2)) / 3;
      double radius2 = 0;
      for (int c = 0; c < 3; c++) radius2 = std::max(radius2, (at.corner(k, c) - center).squaredNorm());
      if (set.any_contains(center, -(std::sqrt(radius2) + gap_ + 1e-9))) state_[k] = State::open;
    }
  }

  const Mesh& mesh_;
  const double gap_;
  Mesh pieces_;
  std::vector<std::uint32_t> triangle_;  // of the mesh, for each piece
  std::vector<State> state_;
  std::vector<Ball> last_;
};

class CoverSearch {
 public:
  CoverSearch(const Surface& surface, const CoverOptions& options)
      : surface_(surface),
        mesh_(surface.mesh()),
        tolerance_sum_((options.protrusion + options.gap) * (1 - 2 * held_back)),
        protrusion_(std::min(options.protrusion, options.max_radius) -
                    held_back * (options.protrusion + options.gap)),
        gap_(options.gap - held_back * (options.protrusion + options.gap)),
        min_radius_(options.min_radius),
        largest_(std::min(options.max_radius - protrusion_, surface.bounds().diagonal())),
        effort_(std::clamp(options.effort, 0, 3)),
        watch_(options.tell, steps_of(effort_)) {
    if (mesh_.triangles.empty()) throw Error("there is no surface to cover: the mesh has no triangles");
    if (!(tolerance_sum_ > 0)) throw Error("a cover needs a tolerance above 0");
  }

  Cover run() const {
    Attempt best{CoverProblem(gap_), {}, 0};
    if (single(best)) return finish(best, true);
    SampleOptions sampling;
    sampling.tolerance_sum = tolerance_sum_, sampling.largest = largest_;
    const Samples samples = sample_surface(surface_, sampling);
    step();
    std::vector<Candidate> candidates;
    for (const Sample& s : samples.grown) propose(s.point, s.triangle, s.ball, candidates);
    best.problem.add(with_margin(samples.coarse, greedy_margin), candidates);
    solve(best, 0);
    Attempt common = best;
    bool covered = certify(best, 0, 0, &common.problem);
    for (int k = 0; k < effort_; k++) {
      const Stage& stage = stages[static_cast<std::size_t>(k)];
      const std::uint64_t seed = static_cast<std::uint64_t>(k + 1) << 56;
      Attempt next = merge(samples, search_side_by_side(common, best, stage, seed), best, stage, seed);
      centre_all(next, true);
      const bool next_covered = certify(next, certify_share * stage.steps, certify_places, nullptr);
      if (next_covered == covered ? next.chosen.size() < best.chosen.size() : next_covered)
        best = std::move(next), covered = next_covered;
    }
    return finish(best, covered);
  }

 private:
  // Of a search with all starts; a search with fewer is done at a smaller share.
  static double steps_of(int effort) {
    double steps = 2;  // samples, and the first cover
    for (int k = 0; k < effort; k++) {
      const Stage& stage = stages[static_cast<std::size_t>(k)];
      steps += stage.starts * (stage.moves + 1) + merge_moves + 1 + certify_moves;
    }
    return steps + certify_moves;
  }

  void step() const {
    watch_.tick();
    watch_.check();
  }

  // Chooses the fewest candidates, beginning with those that are chosen.
  void solve(Attempt& attempt, double steps) const {
    const Sets sets = attempt.problem.sets();
    const std::size_t n = attempt.problem.points().size();
    attempt.chosen = complete(sets, n, attempt.chosen);
    if (!(steps > 0)) return;
    BlockSearch search;
    search.steps = steps, search.seed = ++attempt.seed;
    if (attempt.chosen.size() <= search.block) {
      SetCover cover(sets, n);
      cover.greedy(attempt.chosen);
      cover.improve(static_cast<std::uint64_t>(steps * static_cast<double>(attempt.chosen.size())),
                    search.seed);
      attempt.chosen = cover.best();
      return;
    }
    std::vector<Point> centers;
    for (const Candidate& c : attempt.problem.candidates()) centers.push_back(c.ball.center);
    attempt.chosen = improve_in_blocks(sets, n, centers, attempt.chosen, search);
  }

  // Searches from the same beginning with different random numbers. Returns the balls that each has chosen.
  std::vector<std::vector<Candidate>> search_side_by_side(const Attempt& common, const Attempt& best,
                                                          const Stage& stage, std::uint64_t seed) const {
    const auto n = static_cast<double>(best.chosen.size());
    const auto starts = static_cast<std::size_t>(
        1 + std::lround((stage.starts - 1) * std::min(1.0, balls_for_all_starts / n)));
    std::vector<std::vector<Candidate>> found(starts);
    // Few balls make few blocks, so that whole searches run in parallel; of many balls the blocks do.
#pragma omp parallel for schedule(dynamic, 1) if (n <= 2 * balls_for_all_starts)
    for (std::size_t start = 0; start < starts; start++) {
      Attempt attempt = common;
      attempt.seed = seed + ((start + 1) << 48);
      for (int k = 0; k <= stage.moves && !watch_.stopped(); k++) {
        if (k > 0) move(attempt, kPlaces);
        solve(attempt, stage.steps);
        watch_.tick();
      }
      found[start] = attempt.chosen_candidates();
    }
    watch_.check();
    return found;
  }

  // Chooses again from what all searches have found.
  Attempt merge(const Samples& samples, const std::vector<std::vector<Candidate>>& found, const Attempt& best,
                const Stage& stage, std::uint64_t seed) const {
    Attempt attempt{CoverProblem(gap_), {}, seed};
    std::size_t fewest = 0;
    for (std::size_t k = 0; k < found.size(); k++)
      if (found[k].size() < found[fewest].size()) fewest = k;
    std::vector<Candidate> pool = found[fewest];
    attempt.chosen.resize(pool.size());
    std::iota(attempt.chosen.begin(), attempt.chosen.end(), 0u);
    for (std::size_t k = 0; k < found.size(); k++)
      if (k != fewest) pool.insert(pool.end(), found[k].begin(), found[k].end());
    const std::vector<Candidate> known = best.chosen_candidates();
    pool.insert(pool.end(), known.begin(), known.end());
    attempt.problem.add(with_margin(samples.fine, stage.margin), pool);
    for (int k = 0; k <= merge_moves; k++) {
      if (k > 0) move(attempt, kPlaces);
      solve(attempt, stage.steps);
      step();
    }
    return attempt;
  }

  // Adds the spots that the certificate finds, until none is left. Returns false if the radius limits leave
  // some. `also` gets the same points and balls.
  bool certify(Attempt& attempt, double steps, int tries, CoverProblem* also) const {
    OpenPieces open(mesh_, gap_);
    // About ten rounds are enough, except beside surface that a radius limit leaves open: the cap is for
    // that.
    for (int round = 0;; round++, steps *= certify_decay) {
      const std::vector<GapPart> failures = open.failures(attempt.balls(), 0.25 * tolerance_sum_);
      if (failures.empty()) return true;
      if (round < certify_moves)
        step();
      else
        watch_.check();
      if (round < certify_moves && tries > 0) move(attempt, tries);
      if (round == most_certify_rounds || !refine(attempt.problem, failures, also)) return false;
      const bool search = round < certify_moves;
      const bool centring = tries > 0 && round < centred_rounds;
      if (const std::size_t left = centring ? centre_all(attempt, search) : 1; search || left > 0)
        solve(attempt, search ? steps : 0);
    }
  }

  Ball medial(const Point& p, std::uint32_t triangle, double guess = 0) const {
    const Vector normal = mesh_.area_normal(triangle).normalized();
    const Ball ball =
        inner_medial_ball(surface_, p, normal, largest_, medial_tolerance * tolerance_sum_, guess);
    if (ball.radius + protrusion_ > 0) return ball;
    // In a sharp corner no ball inside the body touches p. But one covers it whose centre is pushed off the
    // walls there, of which there may be three, by a part of the gap each.
    for (double push = 0.25 * gap_; push > 1e-4 * gap_; push *= 0.5) {
      Point c = p - push * normal;
      for (int wall = 0; wall < 3; wall++) {
        const Nearest at = surface_.signed_nearest(c);
        if (-at.distance >= 0.1 * push) return {c, -at.distance};
        c -= push * at.normal;
      }
    }
    return ball;
  }

  // Adds the medial ball, dilated by the whole protrusion, unless it is too small.
  void propose(const Point& p, std::uint32_t triangle, const Ball& medial,
               std::vector<Candidate>& candidates) const {
    const double radius = medial.radius + protrusion_;
    if (radius > 0 && radius >= min_radius_)
      candidates.push_back({{medial.center, radius}, medial.radius, p, triangle});
  }

  static std::vector<CoverPoint> with_margin(std::vector<CoverPoint> points, double share) {
    for (CoverPoint& point : points) point.margin *= share;
    return points;
  }

  // Tries one ball for everything. No cover is smaller, and this must come before any step whose cost grows
  // with the area: on a fine sphere every triangle is equally near to the centre, which makes each query
  // slow.
  bool single(Attempt& attempt) const {
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
      attempt.problem.add({}, candidates);
      attempt.chosen = {0};
      return true;
    }
    return false;
  }

  // Adds the ball of a random place beside that of a candidate, at most `most` away along each axis.
  void try_place(const Candidate& c, double most, Random& random, std::vector<Candidate>& candidates) const {
    Vector step;
    for (int axis = 0; axis < 3; axis++) step[axis] = (2 * random.uniform() - 1) * most;
    const Nearest at = surface_.nearest(c.point + step);
    propose(at.point, at.triangle,
            medial(at.point, at.triangle, 1.1 * c.inner_distance + 0.5 * tolerance_sum_), candidates);
  }

  // Makes the next problem: what was tried, or the chosen balls alone where that is too much, and new medial
  // balls at places around the chosen ones. The places lie up to a share of the covered disc's radius from
  // the place of the chosen ball.
  void move(Attempt& attempt, int tries) const {
    const std::size_t n = attempt.chosen.size() * static_cast<std::size_t>(tries);
    const std::uint64_t seed = Random(++attempt.seed).next();
    std::vector<std::vector<Candidate>> tried_at(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 64)
    for (std::size_t k = 0; k < n; k++) {
      const Candidate& c = attempt.problem.candidates()[attempt.chosen[k / static_cast<std::size_t>(tries)]];
      Random random(seed + k);
      try_place(c, step_sizes[k % 2] * covered_disc(c.inner_distance, tolerance_sum_), random, tried_at[k]);
    }
    std::vector<Candidate> fresh;
    for (const auto& candidates : tried_at) fresh.insert(fresh.end(), candidates.begin(), candidates.end());
    const std::size_t tried = attempt.problem.candidates().size();
    if (tried > most_tried_in_all || tried > most_tried * attempt.chosen.size()) {
      attempt.problem.keep(attempt.chosen);
      std::iota(attempt.chosen.begin(), attempt.chosen.end(), 0u);
    }
    attempt.problem.add({}, fresh);
  }

  // Some sweeps of centre(). Where not all balls are wanted, they end when no point is open.
  std::size_t centre_all(Attempt& attempt, bool all) const {
    std::size_t open = 1;
    double step_size = centre_step;
    for (int sweep = 0; sweep < centre_sweeps && (all || open > 0); sweep++, step_size *= centre_decay)
      open = centre(attempt, all, step_size);
    return open;
  }

  // Moves each ball to the middle of what it alone covers: of the places that are tried, to that where the
  // point nearest to slipping out lies deepest inside. Then the surface between the points is covered with
  // some room, too. An open point counts as the nearest ball's own, so that ball moves over it. Returns how
  // many points stay open. Where not all balls are wanted, only those move that have such a point.
  std::size_t centre(Attempt& attempt, bool all, double step_size) const {
    CoverProblem& problem = attempt.problem;
    CoverCounts counts(attempt);
    const std::size_t n = attempt.chosen.size();
    std::vector<std::vector<std::uint32_t>> own(n);
    const BallSet set(attempt.balls());
    for (std::uint32_t r = 0; r < problem.points().size(); r++) {
      if (counts[r] > 0) continue;
      const BallGap nearest = set.gap(problem.points()[r].point, gap_ + 0.25 * tolerance_sum_);
      if (std::isfinite(nearest.value)) own[nearest.ball].push_back(r);
    }
    const std::uint64_t seed = Random(++attempt.seed).next();
    std::vector<std::optional<Candidate>> better(n);
#pragma omp parallel for schedule(dynamic, 16) if (n > 32)
    for (std::size_t k = 0; k < n; k++) {
      if (!all && own[k].empty()) continue;
      for (const auto r : problem.covered(attempt.chosen[k]))
        if (counts[r] == 1) own[k].push_back(r);
      if (!own[k].empty())
        better[k] = centred(problem, problem.candidates()[attempt.chosen[k]], own[k], step_size, seed + k);
    }
    std::vector<Candidate> fresh;
    for (const auto& candidate : better)
      if (candidate) fresh.push_back(*candidate);
    auto next = static_cast<std::uint32_t>(problem.candidates().size());
    problem.add({}, fresh);
    // One after the other: two balls that leave a point which both cover would open it.
    for (std::size_t k = 0; k < n; k++)
      if (better[k]) attempt.chosen[k] = counts.exchange(attempt.chosen[k], next++);
    return counts.open();
  }

  // The best place for a ball that must cover its own points, if one is better than where it is.
  std::optional<Candidate> centred(const CoverProblem& problem, Candidate ball,
                                   const std::vector<std::uint32_t>& own, double step_size,
                                   std::uint64_t seed) const {
    const auto least_depth = [&](const Candidate& candidate, double enough) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < own.size() && least > enough; k++)
        least = std::min(least, problem.depth(candidate, problem.points()[own[k]]));
      return least;
    };
    double depth = least_depth(ball, -std::numeric_limits<double>::infinity());
    bool moved = false;
    Random random(seed);
    const double most = step_size * covered_disc(ball.inner_distance, tolerance_sum_);
    std::vector<Candidate> tried;
    for (int k = 0; k < centre_places; k++) {
      tried.clear();
      try_place(ball, 2 * k < centre_places ? most : 0.4 * most, random, tried);
      const double there = tried.empty() ? depth : least_depth(tried[0], depth);
      if (there > depth) depth = there, ball = tried[0], moved = true;
    }
    if (!moved) return std::nullopt;
    return ball;
  }

  // Adds the worst failures as points to cover, each with a ball of its own that covers it. Returns false if
  // the radius limits allow no such ball.
  bool refine(CoverProblem& problem, const std::vector<GapPart>& failures, CoverProblem* also) const {
    std::vector<std::uint32_t> order(failures.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return failures[a].value > failures[b].value; });
    std::vector<Point> points;
    for (const GapPart& part : failures) points.push_back(part.point);
    const PointTree tree(points);
    std::vector<char> gone(failures.size());
    std::vector<std::uint32_t> near, taken;
    for (auto k : order) {
      if (gone[k]) continue;
      taken.push_back(k);
      near.clear();
      tree.find(points[k], 0.25 * tolerance_sum_, near);
      for (auto other : near) gone[other] = 1;
    }
    std::vector<Ball> medials(taken.size());
#pragma omp parallel for schedule(dynamic, 16) if (taken.size() > 32)
    for (std::size_t k = 0; k < taken.size(); k++)
      medials[k] = medial(points[taken[k]], failures[taken[k]].triangle);
    std::vector<CoverPoint> fresh;
    std::vector<Candidate> candidates;
    for (std::size_t k = 0; k < taken.size(); k++) {
      const std::size_t before = candidates.size();
      propose(points[taken[k]], failures[taken[k]].triangle, medials[k], candidates);
      // A ball must cover the spot with room to spare, or what is around it fails in the next round.
      if (candidates.size() > before) fresh.push_back({points[taken[k]], spot_margin * tolerance_sum_});
    }
    problem.add(fresh, candidates);
    if (also) also->add(fresh, candidates);
    return !fresh.empty();
  }

  Cover finish(const Attempt& attempt, bool covered) const {
    Cover cover;
    cover.balls = attempt.balls(), cover.covered = covered;
    if (covered) {
      const ProtrusionBound bound = protrusion_bound(surface_, cover.balls);
      cover.proved = bound.proved && bound.max <= protrusion_ + held_back * tolerance_sum_;
    }
    for (const Candidate& c : attempt.chosen_candidates()) cover.triangle.push_back(c.triangle);
    return cover;
  }

  const Surface& surface_;
  const Mesh& mesh_;
  const double tolerance_sum_, protrusion_, gap_, min_radius_, largest_;
  const int effort_;
  mutable Watch watch_;
};

}  // namespace

Cover cover_surface(const Surface& surface, const CoverOptions& options) {
  return CoverSearch(surface, options).run();
}

std::vector<std::uint32_t> thin_balls(const Surface& surface, const std::vector<Ball>& balls, double gap,
                                      int effort) {
  const double bound = gap * (1 - held_back);
  const double steps = effort > 0 ? 2 * stages[static_cast<std::size_t>(std::min(effort, 3) - 1)].steps : 0;
  std::vector<Candidate> candidates(balls.size());
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < balls.size(); k++)
    candidates[k] = {balls[k], std::max(0.0, -surface.signed_nearest(balls[k].center).distance),
                     balls[k].center, 0};
  SampleOptions sampling;
  sampling.tolerance_sum = gap, sampling.coarse_density = sampling.fine_density = effort > 0 ? 6 : 4;
  // What these balls cover depends on their sizes and not on the local thickness.
  sampling.largest = 0;
  for (const Candidate& c : candidates) sampling.largest = std::max(sampling.largest, c.inner_distance);
  Samples samples = sample_surface(surface, sampling);
  for (CoverPoint& point : samples.fine) point.margin *= thinning_margin;
  CoverProblem problem(bound);
  problem.add(samples.fine, candidates);

  std::vector<std::uint32_t> chosen;
  const BallSet all(balls);
  std::vector<Point> places;
  for (const Ball& ball : balls) places.push_back(ball.center);
  for (std::uint64_t round = 1;; round++) {
    const Sets sets = problem.sets();
    SetCover cover(sets, problem.points().size());
    cover.greedy(chosen);
    chosen = cover.best();
    if (steps > 0)
      chosen = improve_in_blocks(sets, problem.points().size(), places, chosen,
                                 {.steps = steps * std::pow(0.7, round - 1), .seed = round});
    std::vector<Ball> kept;
    for (auto k : chosen) kept.push_back(balls[k]);
    // Where the chosen balls leave a gap that others would close, those spots become points to cover. Beside
    // surface that no ball covers, the certificate may fail in the notch between two balls without knowing a
    // point that fails. Such a spot is skipped.
    std::vector<CoverPoint> points;
    for (const GapPart& part : gap_failures(surface.mesh(), BallSet(kept), bound, 0.1 * gap))
      if (part.value > bound && all.gap(part.point).value <= bound * (1 - held_back))
        points.push_back({part.point, 0});
    if (points.empty()) return chosen;
    problem.add(points, {});
  }
}

}  // namespace padder
