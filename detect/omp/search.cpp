// SPDX-License-Identifier: MIT
// The search of the grid path on the CPU (stages 7 to 9 of the paper). Each sphere is tested against the
// spheres behind it in its bin and those in the forward half of the neighbouring bins, so every pair of one
// level is tested once. It is also tested against the levels that its own level searches.
#include <omp.h>

#include <cstring>

#include "detect/omp/paths.h"

namespace padder::detect::omp {
namespace {

// A chunk is the unit of work and of the stable order. It takes about kChunkTime nanoseconds and has at most
// kChunkSlots slots. kOwnLevelTime: nanoseconds that a sphere takes at its own level, about.
constexpr double kChunkTime = 1e5, kOwnLevelTime = 40;
constexpr std::uint64_t kChunkSlots = 2048;
// The most candidates that are tested before the room for hits is checked again.
constexpr std::uint32_t kMostCandidates = 16384;

// The hits of one thread. The list grows as it must. If there is not enough memory, hits are only counted
// from then on, so that the sentence about it can say how much would be needed.
class Hits {
 public:
  static constexpr std::uint64_t kLeast = 2 * (kMostCandidates + kLanes);
  // The buffer must have room for kLeast hits.
  Hits(Buffer<std::uint32_t>& buffer, Budget& budget) : buffer_(buffer), budget_(budget) {}

  // Room for kMostCandidates hits after those that are kept.
  std::uint32_t* room() {
    if (size_ + kMostCandidates + kLanes > buffer_.capacity()) grow();
    return buffer_.data() + size_;
  }
  void keep(std::uint64_t n) {
    total_ += n;
    if (!counting_) size_ += n;
  }
  std::uint64_t size() const { return size_; }
  std::uint64_t total() const { return total_; }
  bool counting() const { return counting_; }

 private:
  void grow() {
    Buffer<std::uint32_t> wider(budget_);
    if (!wider.try_resize(2 * buffer_.capacity())) {
      counting_ = true, size_ = 0;
      return;
    }
    std::memcpy(wider.data(), buffer_.data(), size_ * sizeof(std::uint32_t));
    buffer_.swap(wider);
  }
  Buffer<std::uint32_t>& buffer_;
  Budget& budget_;
  std::uint64_t size_ = 0, total_ = 0;
  bool counting_ = false;
};

// The largest search radius of a coarse sphere, in bins of the finer level. Fixed-point slots know their
// place modulo 256 bins only, and kSearchRadiusFactor must not add more than a bin.
constexpr double kLargestSearchRadius[2] = {800, 100};  // for float slots, for fixed-point slots
constexpr int kRows = 2048;  // rows of bins that are looked up together; at least one layer

// Which other levels the spheres of each level search. Of two levels, one searches the other, in the
// direction that costs less. A large sphere touches most of the finer spheres that it tests, but it searches
// many bins.
struct CrossSearches {
  int count[kMaxLevels] = {}, at[kMaxLevels][kMaxLevels];
  double cost[kMaxLevels] = {};  // for each sphere of the level, in nanoseconds
  void add(int from, int to, double each) { at[from][count[from]++] = to, cost[from] += each; }
};
CrossSearches plan_cross_searches(const Grid& g, bool fixed_point) {
  CrossSearches plan;
  for (int c = 0; c < g.levels; c++)
    for (int f = 0; f < c; f++) {
      const Level &coarse = g.level[c], &fine = g.level[f];
      const double fine_cost = cross_search_cost(fine, coarse), coarse_cost = cross_search_cost(coarse, fine);
      const bool wide =
          (coarse.radius_max + fine.radius_max) * fine.per_size > kLargestSearchRadius[fixed_point];
      if (wide ||
          fine_cost * static_cast<double>(fine.spheres) <= coarse_cost * static_cast<double>(coarse.spheres))
        plan.add(f, c, fine_cost);
      else
        plan.add(c, f, coarse_cost);
    }
  return plan;
}

int floor_of(float v) {
  const int whole = static_cast<int>(v);
  return whole - (static_cast<float>(whole) > v);
}

template <class Slot>
class Searcher {
 public:
  Searcher(const Sphere* spheres, const Grid& grid, const CrossSearches& cross_searches,
           const CallOptions& options, const Slots<Slot>& slots, const std::uint32_t* ids,
           const std::uint32_t* keys, const std::uint32_t* starts, const Filter* filters,
           std::uint32_t* found, Hits& hits)
      : spheres_(spheres),
        grid_(grid),
        own_(options.own),
        slots_(slots),
        ids_(ids),
        keys_(keys),
        starts_(starts),
        filters_(filters),
        found_(found),
        hits_(hits),
        exact_(options.precision == Precision::exact),
        cross_searches_(cross_searches) {
    for (int k = 0; k < 3; k++) confirms_ |= own_.low[k] > -INFINITY || own_.high[k] < INFINITY;
    bounded_ = confirms_;
    confirms_ |= filters != nullptr;
  }
  std::uint64_t doubtful() const { return doubtful_; }

  void chunk(std::uint32_t first, std::uint32_t last) {
    int level = 0;
    for (std::uint32_t slot = first; slot < last; slot++) {
      const std::uint32_t key = keys_[slot];
      while (key >= grid_.level[level].offset + grid_.level[level].buckets) level++;
      const Level& l = grid_.level[level];
      const std::uint64_t before = hits_.total();
      if (l.hashed)
        own_level_hashed(l, key, slot);
      else
        forward_runs(l, key), own_level_dense(slot);
      for (int k = 0; k < cross_searches_.count[level]; k++)
        search_level(grid_.level[cross_searches_.at[level][k]], slot);
      found_[slot] = static_cast<std::uint32_t>(hits_.total() - before);
    }
  }

 private:
  static constexpr bool kFixedPoint = std::is_same_v<Slot, FixedPointSlot>;
  // The bins of a hashed level that are searched. Buckets also hold spheres of other bins.
  struct Bins {
    const Level* level = nullptr;
    std::int64_t x_low = 0, x_high = 0, y_low = 0, y_high = 0, z_low = 0, z_high = 0;
    double count() const {
      return static_cast<double>(x_high - x_low + 1) * static_cast<double>(y_high - y_low + 1) *
             static_cast<double>(z_high - z_low + 1);
    }
    bool contain(const Sphere& s) const {
      const Bin b = bin_of(*level, s);
      return x_low <= b.x && b.x <= x_high && y_low <= b.y && b.y <= y_high && z_low <= b.z && b.z <= z_high;
    }
  };

  Sphere exact_sphere(std::uint32_t k) const { return omp::exact_sphere(spheres_, slots_, k); }

  // The forward half of the bins around a bin: the rest of its row, the next row in y, and three rows of the
  // next layer in z.
  void forward_runs(const Level& l, std::uint32_t key) {
    const std::uint32_t row = l.count[0] + 2, plane = row * (l.count[1] + 2);
    const std::uint32_t rows[4] = {key + row, key + plane - row, key + plane, key + plane + row};
    runs_[0].end = starts_[key + 2];
    candidates_ = runs_[0].end - starts_[key];
    for (int k = 0; k < 4; k++) {
      runs_[k + 1] = {starts_[rows[k] - 1], starts_[rows[k] + 2]};
      candidates_ += runs_[k + 1].end - runs_[k + 1].begin;
    }
  }
  void own_level_dense(std::uint32_t a) {
    const Slot me = slots_[a];
    runs_[0].begin = a + 1;
    if (candidates_ <= kMostCandidates) {
      test(me, a, runs_, 5, {});
      return;
    }
    for (const Run& r : runs_) test_in_parts(me, a, r, {});
  }

  // Bins of a hashed level, one by one.
  void search_hashed(const Slot& me, std::uint32_t a, const Bins& bins) {
    const Level& l = *bins.level;
    for (std::int64_t z = bins.z_low; z <= bins.z_high; z++)
      for (std::int64_t y = bins.y_low; y <= bins.y_high; y++) {
        const std::uint32_t row = row_of(l, y, z);
        for (std::int64_t x = bins.x_low; x <= bins.x_high; x++) {
          const std::uint32_t key = key_in_row(l, row, x);
          test_in_parts(me, a, {starts_[key], starts_[key + 1]}, {&l, x, x, y, y, z, z});
        }
      }
  }

  void own_level_hashed(const Level& l, std::uint32_t key, std::uint32_t a) {
    const Slot me = slots_[a];
    const Bin b = bin_of(l, exact_sphere(a));
    test_in_parts(me, a, {a + 1, starts_[key + 1]}, {&l, b.x, b.x, b.y, b.y, b.z, b.z});
    search_hashed(me, a, {&l, b.x + 1, b.x + 1, b.y, b.y, b.z, b.z});
    search_hashed(me, a, {&l, b.x - 1, b.x + 1, b.y + 1, b.y + 1, b.z, b.z});
    search_hashed(me, a, {&l, b.x - 1, b.x + 1, b.y - 1, b.y + 1, b.z + 1, b.z + 1});
  }

  // Tests sphere a against the spheres of another level, in the rows of bins that a ball around it crosses.
  void search_level(const Level& l, std::uint32_t a) {
    const Sphere s = exact_sphere(a);
    // A sphere this far out has no bin number. The spheres of this level are nearer (need_of), and cannot
    // touch it.
    if (larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z)) > 0x1p43 * l.size) return;
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    Slot me = slots_[a];
    if constexpr (kFixedPoint)
      me = {fixed_point_of(l, x), fixed_point_of(l, y), fixed_point_of(l, z),
            static_cast<float>(mul(s.r, l.units))};
    Ball ball;
    ball.x = static_cast<float>(x.rest * l.per_size), ball.y = static_cast<float>(y.rest * l.per_size);
    ball.z = static_cast<float>(z.rest * l.per_size);
    ball.radius =
        static_cast<float>((s.r + l.radius_max) * l.per_size) * kSearchRadiusFactor + kSearchRadiusMargin;
    ball.x_low = floor_of(ball.x - ball.radius), ball.x_high = floor_of(ball.x + ball.radius);
    ball.y_low = floor_of(ball.y - ball.radius), ball.y_high = floor_of(ball.y + ball.radius);
    ball.z_low = floor_of(ball.z - ball.radius), ball.z_high = floor_of(ball.z + ball.radius);
    if (l.hashed) {
      const Bins bins{&l,
                      x.bin + ball.x_low,
                      x.bin + ball.x_high,
                      y.bin + ball.y_low,
                      y.bin + ball.y_high,
                      z.bin + ball.z_low,
                      z.bin + ball.z_high};
      // The bins of a hashed level have no bounds. If they are more than the spheres of the level, all of
      // these are tested instead.
      const Run all{starts_[l.offset], starts_[l.offset + l.buckets]};
      if (bins.count() > all.end - all.begin) return test_in_parts(me, a, all, bins);
      return search_hashed(me, a, bins);
    }
    if (!restrict_to(l, 0, x.bin, ball.x_low, ball.x_high) ||
        !restrict_to(l, 1, y.bin, ball.y_low, ball.y_high) ||
        !restrict_to(l, 2, z.bin, ball.z_low, ball.z_high))
      return;
    ball.row = l.count[0] + 2, ball.plane = ball.row * (l.count[1] + 2);
    ball.key = key_of(l, {x.bin, y.bin, z.bin}) - l.offset;
    const int last = ball.z_high, layers = std::max(1, kRows / (ball.y_high - ball.y_low + 1));
    for (; ball.z_low <= last; ball.z_low += layers) {
      ball.z_high = std::min(last, ball.z_low + layers - 1);
      test_rows(me, a, kernels_.find_rows(ball, starts_ + l.offset, rows_));
    }
  }
  // Restricts bins low to high, relative to `bin`, to those that exist on the level. False if none of them
  // does.
  static bool restrict_to(const Level& l, int axis, std::int64_t bin, int& low, int& high) {
    const std::int64_t first = std::max<std::int64_t>(low, l.first[axis] - bin),
                       last = std::min<std::int64_t>(high, l.first[axis] + l.count[axis] - 1 - bin);
    if (first > last) return false;
    low = static_cast<int>(first), high = static_cast<int>(last);
    return true;
  }

  // Tests the candidates in rows_[0] to rows_[count - 1], as many at once as there is room for.
  void test_rows(const Slot& me, std::uint32_t a, int count) {
    int first = 0;
    std::uint32_t candidates = 0;
    for (int k = 0; k < count; k++) {
      const std::uint32_t n = rows_[k].end - rows_[k].begin;
      if (n <= kMostCandidates - candidates) [[likely]] {
        candidates += n;
        continue;
      }
      if (k > first) test(me, a, rows_ + first, k - first, {});
      first = k, candidates = n;
      if (n > kMostCandidates) test_in_parts(me, a, rows_[k], {}), first = k + 1, candidates = 0;
    }
    if (count > first) test(me, a, rows_ + first, count - first, {});
  }

  // Tests the candidates of a run of any length.
  void test_in_parts(const Slot& me, std::uint32_t a, Run r, const Bins& bins) {
    while (r.begin < r.end) {
      const Run part{r.begin, std::min(r.end, r.begin + kMostCandidates)};
      test(me, a, &part, 1, bins);
      r.begin = part.end;
    }
  }
  // Tests at most kMostCandidates candidates. On a hashed level, `bins` are the bins that are searched;
  // elsewhere it has no level.
  void test(const Slot& me, std::uint32_t a, const Run* runs, int count, const Bins& bins) {
    std::uint32_t* out = hits_.room();
    bool doubt;
    std::uint32_t n = kernels_.test_runs(slots_, me, runs, count, out, doubt);
    if (doubt | confirms_ | (bins.level != nullptr)) n = confirm(me, a, out, n, bins, doubt);
    hits_.keep(n);
  }

  // Removes hits that are no contacts: by the exact test where float cannot decide, by the filter, by the
  // region, and by the bin of a candidate on a hashed level. Returns how many are left.
  std::uint32_t confirm(const Slot& me, std::uint32_t a, std::uint32_t* hits, std::uint32_t n,
                        const Bins& bins, bool doubt) {
    std::uint32_t kept = 0;
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t b = hits[k];
      if (filters_ && !admitted(filters_[a], filters_[b])) continue;
      if (bins.level && !bins.contain(exact_sphere(b))) continue;
      if (bounded_) {
        const bool ordered = ids_[a] < ids_[b];
        const Sphere i = exact_sphere(ordered ? a : b), j = exact_sphere(ordered ? b : a);
        if (!owns(own_, midpoint(i, j))) continue;
      }
      if (doubt) {
        const Measured m = measured(me, slots_[b]);
        if (verdict<Slot>(m) == Verdict::doubt) {
          doubtful_++;
          if (exact_ ? !touching(exact_sphere(a), exact_sphere(b)) : m.d2 > m.s2) continue;
        }
      }
      hits[kept++] = b;
    }
    return kept;
  }

  const Sphere* spheres_;  // beside fixed-point slots
  const Grid& grid_;
  const Region own_;
  const Slots<Slot> slots_;
  const std::uint32_t* ids_;
  const std::uint32_t* keys_;  // in the order of slots
  const std::uint32_t* starts_;
  const Filter* filters_;
  std::uint32_t* found_;
  Hits& hits_;
  const Kernels<Slot> kernels_ = kernels_for_this_machine<Slot>();
  bool exact_, bounded_ = false, confirms_ = false;
  Run runs_[5] = {};
  Run rows_[kRows + kLanes];
  const CrossSearches& cross_searches_;
  std::uint64_t candidates_ = 0;
  std::uint64_t doubtful_ = 0;
};

}  // namespace

template <class Slot>
std::uint64_t GridPath::search(const Grid& grid, const CallOptions& options, bool filtered, int threads,
                               Seconds& seconds) {
  Stopwatch watch;
  const CrossSearches cross_searches = plan_cross_searches(grid, std::is_same_v<Slot, FixedPointSlot>);
  chunks_.clear();
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    const std::uint64_t end = starts_[std::uint64_t(l.offset) + l.buckets];
    const auto size =
        static_cast<std::uint64_t>(std::max(1.0, kChunkTime / (kOwnLevelTime + cross_searches.cost[k])));
    for (std::uint64_t slot = starts_[l.offset]; slot < end; slot += chunks_.back().slots)
      chunks_.push_back({slot, std::min({size, kChunkSlots, end - slot}), 0, 0, 0, 0});
  }
  while (hits_.size() < static_cast<std::size_t>(threads)) hits_.emplace_back(*budget_);
  for (auto& buffer : hits_)
    buffer.resize(Hits::kLeast, "the list of contacts");  // here, because nothing may throw in the threads
  std::uint32_t* found = found_.resize(starts_[grid.buckets], "the list of contacts");
  std::uint64_t doubtful = 0, total = 0;
  bool counted_only = false;
#pragma omp parallel num_threads(threads) reduction(+ : doubtful, total) reduction(|| : counted_only)
  {
    const int t = omp_get_thread_num();
    Hits hits(hits_[static_cast<std::size_t>(t)], *budget_);
    Searcher<Slot> searcher(spheres_.data(), grid, cross_searches, options, slots<Slot>(), ids_.data(),
                            keys_.data(), starts_.data(), filtered ? filters_.data() : nullptr, found, hits);
    // Backwards: the few largest spheres come first, because their cost is known least.
#pragma omp for schedule(dynamic, 1)
    for (auto k = static_cast<std::int64_t>(chunks_.size()) - 1; k >= 0; k--) {
      Chunk& c = chunks_[static_cast<std::size_t>(k)];
      c.first = hits.size(), c.thread = t;
      searcher.chunk(static_cast<std::uint32_t>(c.slot), static_cast<std::uint32_t>(c.slot + c.slots));
      c.count = hits.size() - c.first;
    }
    doubtful += searcher.doubtful(), total += hits.total(), counted_only = counted_only || hits.counting();
  }
  if (counted_only)
    throw_memory(total * sizeof(std::uint32_t) + budget_->held(),
                 (std::to_string(total) + " contacts").c_str());
  seconds.stage[6] += watch.lap();
  return doubtful;
}
template std::uint64_t GridPath::search<FloatSlot>(const Grid&, const CallOptions&, bool, int, Seconds&);
template std::uint64_t GridPath::search<FixedPointSlot>(const Grid&, const CallOptions&, bool, int, Seconds&);

}  // namespace padder::detect::omp
