// SPDX-License-Identifier: MIT
// Stages 7 to 9 of the fast path on the CPU: each sphere against the rest of its bin and the forward half of
// the bins around, where every pair of one level meets once, and against the levels that its own level looks
// at.
#include <omp.h>

#include <cstring>

#include "detect/omp/paths.h"

namespace padder::detect::omp {
namespace {

constexpr double kChunkTime = 1e5;       // nanoseconds, about: of the unit of work, and of the fixed order
constexpr std::uint64_t kChunk = 2048;   // and its spheres, at most
constexpr std::uint32_t kPiece = 16384;  // candidates tested between two looks at the room left
constexpr double kOwn = 40;              // nanoseconds, about, at a sphere's own level

// Hits of one thread, which grow as they must. When memory is short they are only counted: then the sentence
// about it can say how much was needed.
class Hits {
 public:
  static constexpr std::uint64_t kLeast = 2 * (kPiece + kLanes);
  Hits(Buffer<std::uint32_t>& buffer, Budget& budget)
      : buffer_(buffer), budget_(budget) {}  // buffer: kLeast at least

  // Room for kPiece candidates behind what is kept.
  std::uint32_t* room() {
    if (size_ + kPiece + kLanes > buffer_.capacity()) grow();
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

// Lengths in bins of the other level are floats; this much more covers their rounding, twice.
constexpr float kReachShare = 1 + 0x1p-16f, kReachMore = 0x1p-14f;
// How far a sphere may look, in bins of the finer level: fixed-point slots know their place modulo 256 bins,
// and the share above must stay below a bin.
constexpr double kWidest[2] = {800, 100};  // float slots, fixed-point slots
constexpr int kRows = 2048;                // looked up at a time; at least a layer of them

// Which other levels the spheres of each level look at. Of two levels one looks at the other, whichever costs
// less: a large sphere that looks down touches most of what it meets, but there are many bins.
struct Looks {
  int count[kMaxLevels] = {}, at[kMaxLevels][kMaxLevels];
  double cost[kMaxLevels] = {};  // of a sphere, in nanoseconds
  void add(int from, int to, double each) { at[from][count[from]++] = to, cost[from] += each; }
};
Looks plan_looks(const Grid& g, bool fixed) {
  Looks looks;
  for (int c = 0; c < g.levels; c++)
    for (int f = 0; f < c; f++) {
      const Level &coarse = g.level[c], &fine = g.level[f];
      const double up = cross_search_cost(fine, coarse), down = cross_search_cost(coarse, fine);
      const bool wide = (coarse.radius_max + fine.radius_max) * fine.per_size > kWidest[fixed];
      if (wide || up * static_cast<double>(fine.spheres) <= down * static_cast<double>(coarse.spheres))
        looks.add(f, c, up);
      else
        looks.add(c, f, down);
    }
  return looks;
}

int floor_of(float v) {
  const int whole = static_cast<int>(v);
  return whole - (static_cast<float>(whole) > v);
}

template <class Slot>
class Searcher {
 public:
  Searcher(const Sphere* spheres, const Grid& grid, const Looks& looks, const Options& options,
           const Slots<Slot>& slots, const std::uint32_t* ids, const std::uint32_t* keys,
           const std::uint32_t* starts, const Filter* filters, std::uint32_t* found, Hits& hits)
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
        looks_(looks) {
    for (int k = 0; k < 3; k++) settles_ |= own_.low[k] > -INFINITY || own_.high[k] < INFINITY;
    bounded_ = settles_;
    settles_ |= filters != nullptr;
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
      for (int k = 0; k < looks_.count[level]; k++) look(grid_.level[looks_.at[level][k]], slot);
      found_[slot] = static_cast<std::uint32_t>(hits_.total() - before);
    }
  }

 private:
  static constexpr bool kFixed = std::is_same_v<Slot, FixedPointSlot>;
  struct Bins {  // that were meant, for hashed levels
    const Level* level = nullptr;
    std::int64_t x_low = 0, x_high = 0, y_low = 0, y_high = 0, z_low = 0, z_high = 0;
    double count() const {
      return static_cast<double>(x_high - x_low + 1) * static_cast<double>(y_high - y_low + 1) *
             static_cast<double>(z_high - z_low + 1);
    }
    bool hold(const Sphere& s) const {
      const Bin b = bin_of(*level, s);
      return x_low <= b.x && b.x <= x_high && y_low <= b.y && b.y <= y_high && z_low <= b.z && b.z <= z_high;
    }
  };

  Sphere exact_sphere(std::uint32_t k) const { return omp::exact_sphere(spheres_, slots_, k); }

  // The forward half of a bin's neighbours: the rest of its row, the row behind in y, three rows in the layer
  // above.
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
    if (candidates_ <= kPiece) {
      take(me, a, runs_, 5, {});
      return;
    }
    for (const Run& r : runs_) run(me, a, r, {});
  }

  // Of a hashed level, bin by bin.
  void look_into(const Slot& me, std::uint32_t a, const Bins& bins) {
    const Level& l = *bins.level;
    for (std::int64_t z = bins.z_low; z <= bins.z_high; z++)
      for (std::int64_t y = bins.y_low; y <= bins.y_high; y++) {
        const std::uint32_t row = row_of(l, y, z);
        for (std::int64_t x = bins.x_low; x <= bins.x_high; x++) {
          const std::uint32_t key = key_in_row(l, row, x);
          run(me, a, {starts_[key], starts_[key + 1]}, {&l, x, x, y, y, z, z});
        }
      }
  }

  void own_level_hashed(const Level& l, std::uint32_t key, std::uint32_t a) {
    const Slot me = slots_[a];
    const Bin b = bin_of(l, exact_sphere(a));
    run(me, a, {a + 1, starts_[key + 1]}, {&l, b.x, b.x, b.y, b.y, b.z, b.z});
    look_into(me, a, {&l, b.x + 1, b.x + 1, b.y, b.y, b.z, b.z});
    look_into(me, a, {&l, b.x - 1, b.x + 1, b.y + 1, b.y + 1, b.z, b.z});
    look_into(me, a, {&l, b.x - 1, b.x + 1, b.y - 1, b.y + 1, b.z + 1, b.z + 1});
  }

  // The spheres of another level that may touch a: in the rows that a ball about it crosses.
  void look(const Level& l, std::uint32_t a) {
    const Sphere s = exact_sphere(a);
    // So far out that it has no bin number: the spheres of this level are not (need_of), nor can they touch
    // it.
    if (larger(larger(magnitude(s.x), magnitude(s.y)), magnitude(s.z)) > 0x1p43 * l.size) return;
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    Slot me = slots_[a];
    if constexpr (kFixed)
      me = {fixed_point_of(l, x), fixed_point_of(l, y), fixed_point_of(l, z),
            static_cast<float>(mul(s.r, l.units))};
    Ball ball;
    ball.x = static_cast<float>(x.rest * l.per_size), ball.y = static_cast<float>(y.rest * l.per_size);
    ball.z = static_cast<float>(z.rest * l.per_size);
    ball.radius = static_cast<float>((s.r + l.radius_max) * l.per_size) * kSearchRadiusFactor + kSearchRadiusMargin;
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
      // The bins within reach are bounded by nothing but radii: where they are more than there are spheres,
      // the spheres are gone through instead.
      const Run all{starts_[l.offset], starts_[l.offset + l.buckets]};
      if (bins.count() > all.end - all.begin) return run(me, a, all, bins);
      return look_into(me, a, bins);
    }
    if (!cut(l, 0, x.bin, ball.x_low, ball.x_high) || !cut(l, 1, y.bin, ball.y_low, ball.y_high) ||
        !cut(l, 2, z.bin, ball.z_low, ball.z_high))
      return;
    ball.row = l.count[0] + 2, ball.plane = ball.row * (l.count[1] + 2);
    ball.key = key_of(l, {x.bin, y.bin, z.bin}) - l.offset;
    const int last = ball.z_high, layers = std::max(1, kRows / (ball.y_high - ball.y_low + 1));
    for (; ball.z_low <= last; ball.z_low += layers) {
      ball.z_high = std::min(last, ball.z_low + layers - 1);
      several(me, a, kernels_.find_rows(ball, starts_ + l.offset, rows_));
    }
  }
  // Bins low to high, counted from `bin`, to those that exist; false when none does.
  static bool cut(const Level& l, int axis, std::int64_t bin, int& low, int& high) {
    const std::int64_t first = std::max<std::int64_t>(low, l.first[axis] - bin),
                       last = std::min<std::int64_t>(high, l.first[axis] + l.count[axis] - 1 - bin);
    if (first > last) return false;
    low = static_cast<int>(first), high = static_cast<int>(last);
    return true;
  }

  // rows_[0 to count - 1], as many at a time as there is room for.
  void several(const Slot& me, std::uint32_t a, int count) {
    int first = 0;
    std::uint32_t candidates = 0;
    for (int k = 0; k < count; k++) {
      const std::uint32_t n = rows_[k].end - rows_[k].begin;
      if (n <= kPiece - candidates) [[likely]] {
        candidates += n;
        continue;
      }
      if (k > first) take(me, a, rows_ + first, k - first, {});
      first = k, candidates = n;
      if (n > kPiece) run(me, a, rows_[k], {}), first = k + 1, candidates = 0;
    }
    if (count > first) take(me, a, rows_ + first, count - first, {});
  }

  void run(const Slot& me, std::uint32_t a, Run r, const Bins& meant) {
    while (r.begin < r.end) {
      const Run piece{r.begin, std::min(r.end, r.begin + kPiece)};
      take(me, a, &piece, 1, meant);
      r.begin = piece.end;
    }
  }
  // At most kPiece candidates.
  void take(const Slot& me, std::uint32_t a, const Run* runs, int count, const Bins& meant) {
    std::uint32_t* out = hits_.room();
    bool doubt;
    std::uint32_t n = kernels_.test_runs(slots_, me, runs, count, out, doubt);
    if (doubt | settles_ | (meant.level != nullptr)) n = settle(me, a, out, n, meant, doubt);
    hits_.keep(n);
  }

  // What the filter could not say, and what is not about distance: the hits that stay.
  std::uint32_t settle(const Slot& me, std::uint32_t a, std::uint32_t* hits, std::uint32_t n,
                       const Bins& meant, bool doubt) {
    std::uint32_t kept = 0;
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t b = hits[k];
      if (filters_ && !admitted(filters_[a], filters_[b])) continue;
      if (meant.level && !meant.hold(exact_sphere(b))) continue;
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

  const Sphere* spheres_;  // of fixed-point slots
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
  bool exact_, bounded_ = false, settles_ = false;
  Run runs_[5] = {};
  Run rows_[kRows + kLanes];
  const Looks& looks_;
  std::uint64_t candidates_ = 0;
  std::uint64_t doubtful_ = 0;
};

}  // namespace

template <class Slot>
std::uint64_t Fast::search(const Grid& grid, const Options& options, bool filtered, int threads,
                           Seconds& seconds) {
  Watch watch;
  const Looks looks = plan_looks(grid, std::is_same_v<Slot, FixedPointSlot>);
  chunks_.clear();
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    const std::uint64_t end = starts_[std::uint64_t(l.offset) + l.buckets];
    const auto size = static_cast<std::uint64_t>(std::max(1.0, kChunkTime / (kOwn + looks.cost[k])));
    for (std::uint64_t slot = starts_[l.offset]; slot < end; slot += chunks_.back().slots)
      chunks_.push_back({slot, std::min({size, kChunk, end - slot}), 0, 0, 0, 0});
  }
  while (hits_.size() < static_cast<std::size_t>(threads)) hits_.emplace_back(*budget_);
  for (auto& buffer : hits_)
    buffer.resize(Hits::kLeast, "the list of contacts");  // nothing may throw in the threads
  std::uint32_t* found = found_.resize(starts_[grid.buckets], "the list of contacts");
  std::uint64_t doubtful = 0, total = 0;
  bool counted_only = false;
#pragma omp parallel num_threads(threads) reduction(+ : doubtful, total) reduction(|| : counted_only)
  {
    const int t = omp_get_thread_num();
    Hits hits(hits_[static_cast<std::size_t>(t)], *budget_);
    Searcher<Slot> searcher(spheres_.data(), grid, looks, options, slots<Slot>(), ids_.data(), keys_.data(),
                            starts_.data(), filtered ? filters_.data() : nullptr, found, hits);
    // Backwards: what the few largest spheres cost is known least, so they come first.
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
template std::uint64_t Fast::search<FloatSlot>(const Grid&, const Options&, bool, int, Seconds&);
template std::uint64_t Fast::search<FixedPointSlot>(const Grid&, const Options&, bool, int, Seconds&);

}  // namespace padder::detect::omp
