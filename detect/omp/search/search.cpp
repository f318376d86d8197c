// SPDX-License-Identifier: MIT
// The search of the grid path on the CPU (stages 7 to 9 of the paper). Each sphere is tested against the
// spheres behind it in its bin and those in the forward half of the neighbouring bins, so every pair of one
// level is tested once. It is also tested against the levels that its own level searches.
#include <omp.h>

#include <limits>

#include "detect/omp/search/cross_search.h"
#include "detect/omp/search/hits.h"
#include "detect/omp/search/reach_table.h"

namespace padder::detect::omp {
namespace {

// A chunk is the unit of work and of the stable order. It takes about kChunkTime nanoseconds and has at most
// kChunkSlots slots. kOwnLevelTime: nanoseconds that a sphere takes at its own level, about.
constexpr double kChunkTime = 1e5, kOwnLevelTime = 40;
constexpr std::uint64_t kChunkSlots = 2048;
// Spheres whose hits are all looked at again if float cannot decide one of them.
constexpr std::uint32_t kConfirmed = 64;

constexpr int kRows = 2048;              // rows of bins that are looked up together; at least one layer
constexpr std::uint32_t kTogether = 16;  // spheres whose rows are
constexpr int kAround = std::numeric_limits<int>::max();  // rows that go on at the other end of the ring

int floor_of(float v) {
  const int whole = static_cast<int>(v);
  return whole - (static_cast<float>(whole) > v);
}

template <class Slot>
class Searcher {
 public:
  Searcher(const Exact<Slot>* spheres, const Grid& grid, const std::vector<ReachTable>& reaches,
           const CallOptions& options, const Slots<Slot>& slots, const std::uint32_t* ids,
           const std::uint32_t* keys, const std::uint32_t* starts, const Filter* filters, Hits& hits)
      : spheres_(spheres),
        grid_(grid),
        reaches_(reaches),
        own_(options.own),
        slots_(slots),
        ids_(ids),
        keys_(keys),
        starts_(starts),
        filters_(filters),
        hits_(hits),
        exact_(options.precision == Precision::exact || options.margin > 0),
        margin_(options.margin) {
    bounded_ = own_ != Region{};
    for (int k = 0; k < grid.levels; k++) level_keys_[k] = keys_of(grid.level[k]);
  }
  std::uint64_t doubtful() const { return doubtful_; }

  // The spheres of slots `first` to `last` - 1, which are of one level, search that level.
  void own_level(int level, std::uint32_t first, std::uint32_t last) {
    const LevelKeys& keys = level_keys_[level];
    const std::uint32_t last_key =
        keys.periodic() ? keys.offset + keys.mask - keys.plane - keys.row - 2 : ~0u;
    const Bins<Slot> bins{slots_, spheres_, keys_, starts_, keys.row, keys.plane, last_key, grown_by()};
    const auto test_bins = sparse(bins, first, last) ? kernels_.test_sparse_bins : kernels_.test_bins;
    while (first < last) {
      const HitLists out = hits_.room();
      const Searched s = test_bins(bins, first, std::min(last, first + kConfirmed), out, kMostCandidates);
      keep(out, s.hits, s.doubt, level, near(level));
      first += s.spheres;
      if (s.spheres == 0) own_level_of(level, bins, first++);
    }
  }
  // The same for a coarser level, by its table of reaches. All candidates are decided in double: half of them
  // touch, and float would look at the rest in vain.
  void coarser_level(int level, std::uint32_t first, std::uint32_t last) {
    const ReachTable& table = reaches_[static_cast<std::size_t>(level)];
    const Level& l = grid_.level[level];
    double place[3][kBatch], size[kBatch], per_size[kBatch];
    std::uint32_t bins[3][kBatch];
    std::fill_n(size, kBatch, l.size), std::fill_n(per_size, kBatch, l.per_size);
    for (std::uint32_t count; first < last; first += count) {
      count = std::min(kBatch, last - first);
      for (std::uint32_t k = 0; k < count; k++) {
        const Sphere s = exact_sphere(first + k);
        place[0][k] = s.x, place[1][k] = s.y, place[2][k] = s.z;
      }
      for (int axis = 0; axis < 3; axis++)
        bin_numbers(place[axis], static_cast<int>(count), size, per_size, bins[axis]);
      HitLists out = hits_.room();
      std::uint32_t n = 0;
      for (std::uint32_t k = 0; k < count; k++) {
        Run run = table.run(bins[0][k], bins[1][k], bins[2][k]);
        while (run.end - run.begin > kMostCandidates - n) {
          const std::uint32_t part = kMostCandidates - n;
          add_pairs(out, n, first + k, table.slots() + run.begin, part);
          keep_touching(out, n + part, level);
          out = hits_.room(), n = 0, run.begin += part;
        }
        add_pairs(out, n, first + k, table.slots() + run.begin, run.end - run.begin);
        n += run.end - run.begin;
      }
      keep_touching(out, n, level);
    }
  }
  // The same for another level, all of whose spheres are tested.
  void whole_level(int from, int level, std::uint32_t first, std::uint32_t last) {
    const Box box = box_of(from, level);
    const Level& l = grid_.level[level];
    const Run all{starts_[l.offset], starts_[std::uint64_t(l.offset) + l.buckets]};
    for (std::uint32_t a = first; a < last; a++) {
      const Sphere s = exact_sphere(a);
      if (box.holds(s) && has_bin(l, s)) test_in_parts(seeker_at(l, a, s), a, all, level, near(level, true));
    }
  }
  // The same for another level, by rows of its bins.
  void other_level(int from, int level, std::uint32_t first, std::uint32_t last) {
    const Box box = box_of(from, level);
    // Several spheres are tested together, so that none waits for the rows of another.
    constexpr int kMostRows = kRows / static_cast<int>(kTogether);
    const std::uint32_t* const starts = starts_ + grid_.level[level].offset;
    Run* rows = rows_;
    std::uint32_t together = 0;
    const auto search_together = [&] { search_level(level, together), together = 0, rows = rows_; };
    for (std::uint32_t a = first; a < last; a++) {
      const Sphere s = exact_sphere(a);
      BallSearch search;
      if (!box.holds(s) || !prepare(level, a, s, search)) continue;
      if (search.rows <= kMostRows) {
        together_[together] = {search.me, a, rows_of_box(search.ball, starts, rows)};
        rows += together_[together++].runs;
        if (together == kTogether) search_together();
      } else {
        search_together();  // first, because the rows are kept in one place
        search_alone(level, a, search);
      }
    }
    search_together();
  }

 private:
  static constexpr bool kFixedPoint = std::is_same_v<Slot, FixedPointSlot>;
  Sphere exact_sphere(std::uint32_t k) const { return sphere_of(spheres_[k]); }
  // The sum of two radii has the margin in one of them. Fixed-point slots are of spheres that are larger by
  // half of it each.
  float grown_by() const { return kFixedPoint ? 0 : static_cast<float>(margin_); }
  Slot seeker(std::uint32_t k) const {
    Slot s = slots_[k];
    s.r += grown_by();
    return s;
  }
  // The same as a slot of another level.
  Slot seeker_at(const Level& l, std::uint32_t a, [[maybe_unused]] Sphere s) const {
    if constexpr (kFixedPoint)
      return fixed_point_slot(l, s);
    else
      return seeker(a);
  }
  // A sphere this far out has no bin number. The spheres of this level are nearer (need_of), and cannot touch
  // it.
  static bool has_bin(const Level& l, const Sphere& s) {
    return larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z)) <= 0x1p43 * l.size;
  }
  // Where spheres of a level may meet those of another.
  struct Box {
    double low[3], high[3];
    bool holds(const Sphere& s) const {
      return (s.x >= low[0]) & (s.x <= high[0]) & (s.y >= low[1]) & (s.y <= high[1]) & (s.z >= low[2]) &
             (s.z <= high[2]);
    }
  };
  Box box_of(int from, int level) const {
    const Level& l = grid_.level[level];
    Box box;
    for (int k = 0; k < 3; k++) {  // a bin more than the reach makes up for rounding
      const double reach = (grid_.level[from].radius_max + l.radius_max) * (1 + 0x1p-20) + l.size;
      box.low[k] = l.hashed ? -INFINITY : low_of(l, k) - reach;
      box.high[k] = l.hashed ? INFINITY : high_of(l, k) + reach;
    }
    return box;
  }
  // How far apart along an axis centres may be that the search of a level compares: the places of fixed-point
  // slots repeat after 256 bins. `any`: spheres of the level may be met that are not near.
  double near(int level, bool any) const {
    return kFixedPoint && any ? 0x1p7 * grid_.level[level].size : INFINITY;
  }
  double near(int level) const { return near(level, level_keys_[level].periodic()); }

  // Do the spheres of these slots have few candidates? Some of them are asked.
  static bool sparse(const Bins<Slot>& bins, std::uint32_t first, std::uint32_t last) {
    constexpr std::uint32_t kAsked = 16;
    std::uint32_t asked = 0, candidates = 0;
    for (std::uint32_t a = first; a < last && bins.keys[a] <= bins.last_key;
         a += (last - first) / kAsked + 1) {
      Run runs[kForwardRuns];
      asked++, candidates += std::min(forward_runs(bins, bins.keys[a], a, runs), 100 * kFewCandidates);
    }
    return candidates < kFewCandidates * asked;
  }

  // Sphere a searches its own level.
  void own_level_of(int level, const Bins<Slot>& bins, std::uint32_t a) {
    Run runs[2 * kForwardRuns];  // a row may go on at the other end of the ring
    const LevelKeys& l = level_keys_[level];
    const std::uint32_t key = keys_[a];
    std::uint64_t candidates = 0;
    int count = kForwardRuns;
    if (key <= bins.last_key) {
      forward_runs(bins, key, a, runs);
    } else {
      const std::uint32_t here = key - l.offset;
      runs[0] = {a + 1, starts_[key + 1]}, count = 1;
      runs_around(l, here + 1, 1, runs, count);
      for (const std::uint32_t row : {l.row, l.plane - l.row, l.plane, l.plane + l.row})
        runs_around(l, here + row - 1, 3, runs, count);
    }
    for (int k = 0; k < count; k++) candidates += runs[k].end - runs[k].begin;
    if (candidates <= kMostCandidates) return test(seeker(a), a, runs, count, level, near(level));
    for (int k = 0; k < count; k++) test_in_parts(seeker(a), a, runs[k], level, near(level));
  }
  // Appends the spheres of the buckets from `first` on, at most as many as the ring has: one run or two.
  void runs_around(const LevelKeys& l, std::uint32_t first, std::uint32_t buckets, Run* runs,
                   int& count) const {
    first &= l.mask;
    const std::uint32_t* const starts = starts_ + l.offset;
    const std::uint32_t inside = std::min(buckets, l.mask + 1 - first);
    runs[count++] = {starts[first], starts[first + inside]};
    if (inside < buckets) runs[count++] = {starts[0], starts[buckets - inside]};
  }
  // The search of a sphere at another level: of the rows of bins around the ball.
  struct BallSearch {
    Slot me;
    Ball ball;
    int rows;  // at most; more than kRows where it takes a search of its own
  };
  // Returns false if the sphere meets none of the level.
  bool prepare(int level, std::uint32_t a, Sphere s, BallSearch& search) const {
    const Level& l = grid_.level[level];
    const LevelKeys& keys = level_keys_[level];
    if (!has_bin(l, s)) return false;
    search.me = seeker_at(l, a, s);
    s.r += margin_ / 2;
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    Ball& ball = search.ball;
    ball.x = static_cast<float>(x.rest * l.per_size), ball.y = static_cast<float>(y.rest * l.per_size);
    ball.z = static_cast<float>(z.rest * l.per_size);
    ball.radius =
        static_cast<float>((s.r + l.radius_max) * l.per_size) * kSearchRadiusFactor + kSearchRadiusMargin;
    ball.x_low = floor_of(ball.x - ball.radius), ball.x_high = floor_of(ball.x + ball.radius);
    ball.y_low = floor_of(ball.y - ball.radius), ball.y_high = floor_of(ball.y + ball.radius);
    ball.z_low = floor_of(ball.z - ball.radius), ball.z_high = floor_of(ball.z + ball.radius);
    if (!restrict_to(l, 0, x.bin, ball.x_low, ball.x_high) ||
        !restrict_to(l, 1, y.bin, ball.y_low, ball.y_high) ||
        !restrict_to(l, 2, z.bin, ball.z_low, ball.z_high))
      return false;
    ball.row = keys.row, ball.plane = keys.plane;
    ball.key = keys.key({x.bin, y.bin, z.bin}) - l.offset;
    search.rows = (ball.y_high - ball.y_low + 1) * (ball.z_high - ball.z_low + 1);
    if (keys.periodic()) {
      const auto steps = [&](int bx, int by, int bz) {
        return static_cast<std::uint32_t>(bx) + static_cast<std::uint32_t>(by) * ball.row +
               static_cast<std::uint32_t>(bz) * ball.plane;
      };
      // The box may lie across the end of the ring; it is never wider than the ring.
      const std::uint32_t to_corner = steps(ball.x_low, ball.y_low, ball.z_low),
                          corner = (ball.key + to_corner) & keys.mask;
      ball.key = corner - to_corner;
      if (corner + (steps(ball.x_high, ball.y_high, ball.z_high) - to_corner) > keys.mask)
        search.rows = kAround;
    }
    return true;
  }
  // Tests the first `count` spheres of together_.
  void search_level(int level, std::uint32_t count) {
    const Run* rows = rows_;
    for (std::uint32_t k = 0; k < count; k++) rows += together_[k].runs;
    std::uint64_t candidates = 0;
    for (const Run* row = rows_; row != rows; row++) candidates += row->end - row->begin;
    if (candidates <= kMostCandidates) {
      const HitLists out = hits_.room();
      const Searched s = kernels_.test_searches(slots_, together_, count, rows_, out);
      return keep(out, s.hits, s.doubt, level, near(level));
    }
    rows = rows_;
    for (std::uint32_t k = 0; k < count; rows += together_[k++].runs)
      test_rows(together_[k].me, together_[k].a, rows, together_[k].runs, level);
  }
  // The rows of the box around a ball that has few, as find_rows() writes them. To leave out what the ball
  // does not cross would take longer than to test it.
  static int rows_of_box(const Ball& b, const std::uint32_t* starts, Run* rows) {
    // One loop over y and z, because a processor does not predict the end of a short one.
    const int wide = b.y_high - b.y_low + 1, all = wide * (b.z_high - b.z_low + 1);
    const std::uint32_t to_next_layer = b.plane - static_cast<std::uint32_t>(wide - 1) * b.row,
                        count = static_cast<std::uint32_t>(b.x_high - b.x_low + 1);
    std::uint32_t key = b.key + static_cast<std::uint32_t>(b.x_low) +
                        static_cast<std::uint32_t>(b.y_low) * b.row +
                        static_cast<std::uint32_t>(b.z_low) * b.plane;
    int n = 0;
    for (int k = 0, left = wide; k < all; k++) {
      rows[n] = {starts[key], starts[key + count]};
      n += rows[n].begin < rows[n].end;
      const bool next_layer = --left == 0;
      key += next_layer ? to_next_layer : b.row, left = next_layer ? wide : left;
    }
    return n;
  }
  // The same for a sphere with many rows.
  void search_alone(int level, std::uint32_t a, BallSearch& s) {
    const Level& l = grid_.level[level];
    if (s.rows == kAround) return search_around(level_keys_[level], s.ball, s.me, a, level);
    Ball& ball = s.ball;
    const int last = ball.z_high, layers = std::max(1, kRows / (ball.y_high - ball.y_low + 1));
    for (; ball.z_low <= last; ball.z_low += layers) {
      ball.z_high = std::min(last, ball.z_low + layers - 1);
      test_rows(s.me, a, rows_, kernels_.find_rows(ball, starts_ + l.offset, rows_), level);
    }
  }
  // All rows of the box around the ball, on a periodic level.
  void search_around(const LevelKeys& keys, const Ball& ball, const Slot& me, std::uint32_t a, int level) {
    const auto width = static_cast<std::uint32_t>(ball.x_high - ball.x_low + 1);
    for (int z = ball.z_low; z <= ball.z_high; z++)
      for (int y = ball.y_low; y <= ball.y_high; y++) {
        int count = 0;
        runs_around(keys,
                    ball.key + static_cast<std::uint32_t>(ball.x_low) +
                        static_cast<std::uint32_t>(y) * ball.row + static_cast<std::uint32_t>(z) * ball.plane,
                    width, rows_, count);
        test_rows(me, a, rows_, count, level);
      }
  }
  // Restricts bins low to high, relative to `bin`, to those that exist on the level. False if none of them
  // does. On a periodic level any bin exists.
  static bool restrict_to(const Level& l, int axis, std::int64_t bin, int& low, int& high) {
    if (l.hashed) return true;
    const std::int64_t first = std::max<std::int64_t>(low, l.first[axis] - bin),
                       last = std::min<std::int64_t>(high, l.first[axis] + l.count[axis] - 1 - bin);
    if (first > last) return false;
    low = static_cast<int>(first), high = static_cast<int>(last);
    return true;
  }

  // Tests the candidates in `count` rows, as many at once as there is room for.
  void test_rows(const Slot& me, std::uint32_t a, const Run* rows, int count, int level) {
    int first = 0;
    std::uint32_t candidates = 0;
    for (int k = 0; k < count; k++) {
      const std::uint32_t n = rows[k].end - rows[k].begin;
      if (n <= kMostCandidates - candidates) [[likely]] {
        candidates += n;
        continue;
      }
      if (k > first) test(me, a, rows + first, k - first, level, near(level));
      first = k, candidates = n;
      if (n > kMostCandidates)
        test_in_parts(me, a, rows[k], level, near(level)), first = k + 1, candidates = 0;
    }
    if (count > first) test(me, a, rows + first, count - first, level, near(level));
  }

  // Tests the candidates of a run of any length.
  void test_in_parts(const Slot& me, std::uint32_t a, Run r, int level, double near) {
    while (r.begin < r.end) {
      const Run part{r.begin, std::min(r.end, r.begin + kMostCandidates)};
      test(me, a, &part, 1, level, near);
      r.begin = part.end;
    }
  }
  // Tests at most kMostCandidates candidates.
  void test(const Slot& me, std::uint32_t a, const Run* runs, int count, int level, double near) {
    const HitLists out = hits_.room();
    bool doubt;
    const std::uint32_t n = kernels_.test_runs(slots_, me, runs, count, out.b, doubt);
    // Whole vectors: what is too much is written over.
    for (std::uint32_t k = 0; k < n; k += kLanes) std::fill_n(out.a + k, kLanes, a);
    keep(out, n, doubt, level, near);
  }

  // Appends pairs of slot a and the next `count` slots of `b`. Whole vectors: what is too much is written
  // over.
  static void add_pairs(const HitLists& out, std::uint32_t n, std::uint32_t a, const std::uint32_t* b,
                        std::uint32_t count) {
    for (std::uint32_t k = 0; k < count; k += kLanes)
      std::fill_n(out.a + n + k, kLanes, a), std::copy_n(b + k, kLanes, out.b + n + k);
  }
  // Keeps those of the first n candidates that are contacts. All of them are decided in double.
  void keep_touching(const HitLists& hits, std::uint32_t n, int level) {
    std::fill_n(hits.a + n, kLanes, n > 0 ? hits.a[0] : 0),
        std::fill_n(hits.b + n, kLanes, n > 0 ? hits.b[0] : 0);
    std::uint32_t kept = 0;
    for (std::uint32_t first = 0; first < n; first += kBatch) {
      const std::uint32_t count = std::min(kBatch, n - first);
      const std::uint32_t *a = hits.a + first, *b = hits.b + first;
      std::int64_t touch[kBatch];
      differences(spheres_, a, b, count, batch_);
      if (!mark_touching(batch_, static_cast<int>(count), margin_, touch))
        for (std::uint32_t k = 0; k < count; k++)
          touch[k] = touching(exact_sphere(a[k]), exact_sphere(b[k]), margin_);
      for (std::uint32_t k = 0; k < count; k++) {
        const std::uint32_t mine = a[k], other = b[k];
        hits.a[kept] = mine, hits.b[kept] = other;
        kept += touch[k] != 0;
      }
    }
    keep(hits, kept, false, level, INFINITY);
  }

  // Keeps those of the first n hits that are contacts: those that the filter admits, that the region owns,
  // that are no farther apart than `near` along an axis, and that the exact test confirms where float cannot
  // decide. `doubt`: there may be such hits. `level`: of the second spheres.
  void keep(const HitLists& hits, std::uint32_t n, bool doubt, int level, double near) {
    if (filters_)
      n = keep_if(hits, n,
                  [this](std::uint32_t a, std::uint32_t b) { return admitted(filters_[a], filters_[b]); });
    if (near < INFINITY)
      n = keep_if(hits, n, [&](std::uint32_t a, std::uint32_t b) {
        const Sphere p = exact_sphere(a), q = exact_sphere(b);
        return larger(larger(magnitude(p.x - q.x), magnitude(p.y - q.y)), magnitude(p.z - q.z)) <= near;
      });
    if (bounded_)
      n = keep_if(hits, n, [this](std::uint32_t a, std::uint32_t b) {
        const bool ordered = ids_[a] < ids_[b];
        return owns(own_, midpoint(exact_sphere(ordered ? a : b), exact_sphere(ordered ? b : a)));
      });
    if (doubt)
      n = keep_if(hits, n, [&](std::uint32_t a, std::uint32_t b) {
        const Sphere s = exact_sphere(a);
        const Measured m = measured(seeker_at(grid_.level[level], a, s), slots_[b]);
        if (verdict<Slot>(m) != Verdict::doubt) return true;
        doubtful_++;
        return exact_ ? touching(s, exact_sphere(b), margin_) : m.d2 <= m.s2;
      });
    hits_.keep(n);
  }
  // Removes hits. Without a branch on them, which would often be mispredicted. Returns how many are left.
  template <class Test>
  static std::uint32_t keep_if(const HitLists& hits, std::uint32_t n, Test test) {
    std::uint32_t kept = 0;
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t a = hits.a[k], b = hits.b[k];
      hits.a[kept] = a, hits.b[kept] = b;
      kept += test(a, b);
    }
    return kept;
  }

  const Exact<Slot>* spheres_;
  const Grid& grid_;
  const std::vector<ReachTable>& reaches_;
  const Region own_;
  const Slots<Slot> slots_;
  const std::uint32_t* ids_;
  const std::uint32_t* keys_;  // in the order of slots
  const std::uint32_t* starts_;
  const Filter* filters_;
  Hits& hits_;
  const Kernels<Slot> kernels_ = kernels_for_this_machine<Slot>();
  bool exact_, bounded_ = false;
  double margin_;
  Run rows_[kRows + kLanes];
  RunSearch<Slot> together_[kTogether];
  Batch batch_;
  LevelKeys level_keys_[kMaxLevels];
  std::uint64_t doubtful_ = 0;
};

}  // namespace

GridPath::GridPath(Budget& b, const char* what)
    : budget_(&b),
      what_(what),
      keys_(b),
      starts_(b),
      ids_(b),
      counts_(b),
      places_(b),
      entries_(b),
      slots_{Buffer<float>(b), Buffer<float>(b), Buffer<float>(b), Buffer<float>(b)},
      filters_(b),
      spheres_(b) {}

GridPath::~GridPath() = default;

template <class Slot>
std::uint64_t GridPath::search(const Grid& grid, const Summary& summary, const CallOptions& options,
                               bool filtered, int threads, Seconds& seconds) {
  Stopwatch watch;
  const CrossSearches cross_searches =
      plan_cross_searches(grid, summary, std::is_same_v<Slot, FixedPointSlot>);
  chunks_.clear();
  while (reaches_.size() < static_cast<std::size_t>(grid.levels)) reaches_.emplace_back(*budget_);
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    if (cross_searches.partners[k].any)
      reaches_[static_cast<std::size_t>(k)].build(l, cross_searches.partners[k], exact_spheres<Slot>(),
                                                  starts_[l.offset],
                                                  starts_[std::uint64_t(l.offset) + l.buckets]);
  }
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    const std::uint64_t begin = starts_[l.offset], end = starts_[std::uint64_t(l.offset) + l.buckets];
    const auto add = [&](int at, Way way, double each) {
      const auto size = std::min(static_cast<std::uint64_t>(std::max(1.0, kChunkTime / each)), kChunkSlots);
      for (std::uint64_t slot = begin; slot < end; slot += size)
        chunks_.push_back({slot, std::min(size, end - slot), 0, 0, 0, 0, k, at, way});
    };
    add(k, Way::rows, kOwnLevelTime);
    for (const LevelSearch& c : cross_searches.of_level[k]) add(c.at, c.way, c.cost);
  }
  while (hits_.size() < static_cast<std::size_t>(threads)) hits_.emplace_back(*budget_);
  hits_[0].resize(Hits::kLeast, what_);  // here, because nothing may throw in the threads
  int searching = 1;  // fewer threads where a limit of memory leaves no room for a list of each
  while (searching < threads && hits_[static_cast<std::size_t>(searching)].try_resize(Hits::kLeast))
    searching++;
  std::uint64_t doubtful = 0, total = 0;
  bool counted_only = false;
#pragma omp parallel num_threads(searching) reduction(+ : doubtful, total) reduction(|| : counted_only)
  {
    const int t = omp_get_thread_num();
    Hits hits(hits_[static_cast<std::size_t>(t)], *budget_);
    Searcher<Slot> searcher(exact_spheres<Slot>(), grid, reaches_, options, slots<Slot>(), ids_.data(),
                            keys_.data(), starts_.data(), filtered ? filters_.data() : nullptr, hits);
    // Backwards: the few largest spheres come first, because their cost is known least.
#pragma omp for schedule(dynamic, 1)
    for (auto k = static_cast<std::int64_t>(chunks_.size()) - 1; k >= 0; k--) {
      Chunk& c = chunks_[static_cast<std::size_t>(k)];
      c.first = hits.size(), c.thread = t;
      const auto slot = static_cast<std::uint32_t>(c.slot),
                 end = static_cast<std::uint32_t>(c.slot + c.slots);
      if (c.at == c.level)
        searcher.own_level(c.at, slot, end);
      else if (c.way == Way::table)
        searcher.coarser_level(c.at, slot, end);
      else if (c.way == Way::whole)
        searcher.whole_level(c.level, c.at, slot, end);
      else
        searcher.other_level(c.level, c.at, slot, end);
      c.count = hits.size() - c.first;
    }
    doubtful += searcher.doubtful(), total += hits.total(), counted_only = counted_only || hits.counting();
  }
  if (counted_only) throw_memory(*budget_, total * 2 * sizeof(std::uint32_t), total, what_);
  seconds.stage[6] += watch.lap();
  return doubtful;
}
template std::uint64_t GridPath::search<FloatSlot>(const Grid&, const Summary&, const CallOptions&, bool, int,
                                                   Seconds&);
template std::uint64_t GridPath::search<FixedPointSlot>(const Grid&, const Summary&, const CallOptions&, bool,
                                                        int, Seconds&);

}  // namespace padder::detect::omp
