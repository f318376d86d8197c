// The fast path on the CPU. In the paper's words: T[i] is 1, each sphere is listed in its owner bin only;
// stages 1 to 4 become one counting sort, which yields the starts of stage 5 on its way; nothing is left of
// stage 6; stages 7 to 9 run over each bin and the forward half of its neighbours, where every pair meets
// once, so that the midpoint rule falls away.
#include <omp.h>

#include <cstring>

#include "detect/omp.h"

namespace padder::detect::omp {
namespace {

constexpr std::uint64_t kChunk =
    2048;  // slots searched at a stretch: the unit of work, and of the fixed order
constexpr std::uint32_t kPiece = 16384;  // candidates tested between two looks at the room left

// The exact sphere of a slot: float slots hold it, for fixed-point slots it is kept beside them.
Sphere exact(const Sphere*, const Slots<FloatSlot>& slots, std::uint32_t k) {
  return {slots.x[k], slots.y[k], slots.z[k], slots.r[k]};
}
Sphere exact(const Sphere* spheres, const Slots<FixedSlot>&, std::uint32_t k) { return spheres[k]; }

template <class Slot>
Slot slot_at(const Level& l, const Sphere& s) {
  if constexpr (std::is_same_v<Slot, FloatSlot>)
    return float_slot(s);
  else
    return fixed_slot(l, s);
}

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

// Blocks of neighbours in a row, for which larger spheres are listed once: long ones, and short ones inside
// them.
// Fixed-point slots know their place modulo 256 bins: a long block and its neighbours must fit in that.
constexpr std::uint32_t kLongBins = 64, kLongSlots = 256, kShortBins = 8, kShortSlots = 16;

// Spheres of coarser levels that come near a block: copies of their slots, side by side.
template <class Slot>
class Near {
 public:
  void clear() { size_ = 0, overflow_ = false; }
  void add(const Slots<Slot>& from, const Block<Slot>& block, const Run* runs, int count) {
    add(from, block, runs, count, nullptr);
  }
  void add(const Near& from, const Block<Slot>& block) {
    const Run all{0, from.size()};
    add(from.slots(), block, &all, 1, from.slot_.data());
    overflow_ |= from.overflow_;
  }
  std::uint32_t size() const { return size_; }
  bool overflow() const { return overflow_; }  // too many: the list is of no use
  std::uint32_t slot(std::uint32_t k) const { return slot_[k]; }
  Slots<Slot> slots() const {
    using C = typename Slots<Slot>::Component;
    return {const_cast<C*>(x_.data()), const_cast<C*>(y_.data()), const_cast<C*>(z_.data()),
            const_cast<float*>(r_.data())};
  }

 private:
  void add(const Slots<Slot>& from, const Block<Slot>& block, const Run* runs, int count,
           const std::uint32_t* names) {
    std::uint64_t most = kLanes;
    for (int k = 0; k < count; k++) most += runs[k].end - runs[k].begin;
    if ((overflow_ |= size_ + most > kPiece)) return;
    if (slot_.size() < size_ + most) {
      slot_.resize(2 * (size_ + most));
      x_.resize(slot_.size()), y_.resize(slot_.size()), z_.resize(slot_.size()), r_.resize(slot_.size());
    }
    const std::uint32_t end = size_ + sieve_(from, block, runs, count, slot_.data() + size_);
    for (; size_ < end; size_++) {
      const std::uint32_t b = slot_[size_];
      x_[size_] = from.x[b], y_[size_] = from.y[b], z_[size_] = from.z[b], r_[size_] = from.r[b];
      if (names) slot_[size_] = names[b];
    }
  }
  const SieveRuns<Slot> sieve_ = sieve_runs_for_this_machine<Slot>();
  std::uint32_t size_ = 0;
  bool overflow_ = false;
  std::vector<std::uint32_t> slot_;
  std::vector<typename Slots<Slot>::Component> x_, y_, z_;
  std::vector<float> r_;
};

template <class Slot>
class Searcher {
 public:
  Searcher(const Sphere* spheres, const Grid& grid, const Options& options, const Slots<Slot>& slots,
           const std::uint32_t* ids, const std::uint32_t* starts, const Filter* filters, std::uint32_t* found,
           Hits& hits)
      : spheres_(spheres),
        grid_(grid),
        own_(options.own),
        slots_(slots),
        ids_(ids),
        starts_(starts),
        filters_(filters),
        found_(found),
        hits_(hits),
        test_(test_runs_for_this_machine<Slot>()),
        exact_(options.precision == Precision::exact) {
    for (int k = 0; k < 3; k++) settles_ |= own_.low[k] > -INFINITY || own_.high[k] < INFINITY;
    bounded_ = settles_;
    settles_ |= filters != nullptr;
  }
  std::uint64_t doubtful() const { return doubtful_; }

  void chunk(std::uint32_t first, std::uint32_t last) {
    std::uint32_t key =
        static_cast<std::uint32_t>(std::upper_bound(starts_, starts_ + grid_.buckets + 1, first) - starts_) -
        1;
    int level = 0;
    long_end_ = short_end_ = 0;
    for (std::uint32_t slot = first; slot < last; key++) {
      const std::uint32_t end = std::min(starts_[key + 1], last);
      if (slot == end) continue;
      while (key >= grid_.level[level].offset + grid_.level[level].buckets) level++;
      const Level& l = grid_.level[level];
      if (!l.hashed) forward_runs(l, key);
      for (; slot < end; slot++) {
        const std::uint64_t before = hits_.total();
        if (level + 1 < grid_.levels && slot >= short_end_) begin_block(level, key, slot, last);
        if (l.hashed)
          own_level_hashed(l, key, slot);
        else
          own_level_dense(slot);
        if (level + 1 < grid_.levels) coarser_levels(level, slot);
        found_[slot] = static_cast<std::uint32_t>(hits_.total() - before);
      }
    }
  }

 private:
  static constexpr bool kFixed = std::is_same_v<Slot, FixedSlot>;
  struct Row {  // the bins that were meant, for hashed levels
    const Level* level = nullptr;
    std::int64_t x_low = 0, x_high = 0, y = 0, z = 0;
  };

  Sphere exact_sphere(std::uint32_t k) const { return exact(spheres_, slots_, k); }

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

  void bucket(const Slot& me, std::uint32_t a, const Level& l, const Row& r) {
    const std::uint32_t row = row_of(l, r.y, r.z);
    if (!l.hashed) {
      run(me, a, {starts_[key_in_row(l, row, r.x_low)], starts_[key_in_row(l, row, r.x_high) + 1]}, {});
      return;
    }
    for (std::int64_t x = r.x_low; x <= r.x_high; x++) {
      const std::uint32_t key = key_in_row(l, row, x);
      run(me, a, {starts_[key], starts_[key + 1]}, {&l, x, x, r.y, r.z});
    }
  }

  void own_level_hashed(const Level& l, std::uint32_t key, std::uint32_t a) {
    const Slot me = slots_[a];
    const Bin b = bin_of(l, exact_sphere(a));
    run(me, a, {a + 1, starts_[key + 1]}, {&l, b.x, b.x, b.y, b.z});
    bucket(me, a, l, {&l, b.x + 1, b.x + 1, b.y, b.z});
    bucket(me, a, l, {&l, b.x - 1, b.x + 1, b.y + 1, b.z});
    for (std::int64_t y = b.y - 1; y <= b.y + 1; y++) bucket(me, a, l, {&l, b.x - 1, b.x + 1, y, b.z + 1});
  }

  struct Box {
    Sphere low{INFINITY, INFINITY, INFINITY, 0},
        high{-INFINITY, -INFINITY, -INFINITY, 0};  // of centres; low.r: largest radius
  };
  Box box_of(std::uint32_t first, std::uint32_t end) const {
    Box box;
    for (std::uint32_t a = first; a < end; a++) {
      const Sphere s = exact_sphere(a);
      box.low = {std::min(box.low.x, s.x), std::min(box.low.y, s.y), std::min(box.low.z, s.z),
                 std::max(box.low.r, s.r)};
      box.high = {std::max(box.high.x, s.x), std::max(box.high.y, s.y), std::max(box.high.z, s.z), 0};
    }
    return box;
  }
  Block<Slot> block_of(const Level& l, const Box& box) const {
    const Sphere &low = box.low, &high = box.high;
    const double unit = kFixed ? l.units : 1;
    Block<Slot> block;
    block.from = slot_at<Slot>(
        l, {low.x + (high.x - low.x) / 2, low.y + (high.y - low.y) / 2, low.z + (high.z - low.z) / 2, low.r});
    block.half[0] = static_cast<float>((high.x - low.x) / 2 * unit),
    block.half[1] = static_cast<float>((high.y - low.y) / 2 * unit);
    block.half[2] = static_cast<float>((high.z - low.z) / 2 * unit);
    block.slack = static_cast<float>(l.size * unit * 1e-4);
    return block;
  }

  // Neighbours along a row look at the same larger spheres, so these are listed once for all of them.
  // Fixed-point slots are in units of their level: a list for each level. Float slots of all levels go into
  // one.
  void begin_block(int level, std::uint32_t key, std::uint32_t first, std::uint32_t last) {
    const Level& l = grid_.level[level];
    const std::uint32_t row = l.count[0] + 2,
                        left = l.hashed ? 1 : row - (key - l.offset) % row;  // keys to the row's end
    const auto end_of = [&](std::uint32_t bins, std::uint32_t slots) {
      return l.hashed ? first + 1 : std::min({starts_[key + std::min(left, bins)], last, first + slots});
    };
    if (first >= long_end_) {
      long_end_ = end_of(kLongBins, kLongSlots);
      const Box box = box_of(first, long_end_);
      for (int coarser = level + 1; coarser < grid_.levels; coarser++) list_near(coarser, box);
    }
    short_end_ = std::min(end_of(kShortBins, kShortSlots), long_end_);
    const Box box = box_of(first, short_end_);
    for (int coarser = level + 1; coarser < grid_.levels; coarser++) {
      Near<Slot>& near = near_[kFixed ? coarser : 0];
      if (kFixed || coarser == level + 1) near.clear();
      if (long_[coarser].size() || long_[coarser].overflow())
        near.add(long_[coarser], block_of(grid_.level[coarser], box));
    }
  }

  void list_near(int level, const Box& box) {
    const Level& l = grid_.level[level];
    Near<Slot>& near = long_[level];
    near.clear();
    const Block<Slot> block = block_of(l, box);
    const double r = box.low.r;
    const auto low = [&](double x) {
      const Split s = split(l, x);
      return s.bin + reach_of(l, s, r).low;
    };
    const auto high = [&](double x) {
      const Split s = split(l, x);
      return s.bin + reach_of(l, s, r).high;
    };
    const std::int64_t x_low = low(box.low.x), x_high = high(box.high.x), y_low = low(box.low.y),
                       y_high = high(box.high.y);
    const std::int64_t z_low = low(box.low.z), z_high = high(box.high.z);
    std::vector<Run>& runs = row_runs_;
    runs.clear();
    for (std::int64_t z = z_low; z <= z_high; z++)
      for (std::int64_t y = y_low; y <= y_high; y++) {
        std::int64_t first = x_low, last = x_high;
        if (!cut_row(l, first, last, y, z)) continue;
        const std::uint32_t row = row_of(l, y, z);
        if (!l.hashed) {
          const Run run{starts_[key_in_row(l, row, first)], starts_[key_in_row(l, row, last) + 1]};
          if (run.begin < run.end) runs.push_back(run);
          continue;
        }
        for (std::int64_t x = first; x <= last; x++) {
          const std::uint32_t key = key_in_row(l, row, x);
          for (std::uint32_t b = starts_[key]; b < starts_[key + 1]; b++)
            if (in_row(l, exact_sphere(b), x, x, y, z)) runs.push_back({b, b + 1});
        }
      }
    near.add(slots_, block, runs.data(), static_cast<int>(runs.size()));
  }

  void coarser_levels(int level, std::uint32_t a) {
    for (int coarser = level + 1; coarser < grid_.levels; coarser++) {
      const Near<Slot>& near = near_[kFixed ? coarser : 0];
      if (near.overflow()) {
        coarser_level(grid_.level[coarser], a);
        continue;
      }
      if (near.size()) {
        Slot me = slots_[a];
        if constexpr (kFixed) me = fixed_slot(grid_.level[coarser], exact_sphere(a));
        const Run all{0, near.size()};
        std::uint32_t* out = hits_.room();
        bool doubt;
        std::uint32_t n = test_(near.slots(), me, &all, 1, out, doubt);
        for (std::uint32_t k = 0; k < n; k++) out[k] = near.slot(out[k]);
        if (doubt | settles_) n = settle(me, a, out, n, {}, doubt);
        hits_.keep(n);
      }
      if (!kFixed) return;
    }
  }

  // The same for one sphere, without a list: where there are too many for one.
  void coarser_level(const Level& l, std::uint32_t a) {
    const Sphere s = exact_sphere(a);
    const Slot me = slot_at<Slot>(l, s);
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    const Reach rx = reach_of(l, x, s.r), ry = reach_of(l, y, s.r), rz = reach_of(l, z, s.r);
    for (int dz = rz.low; dz <= rz.high; dz++)
      for (int dy = ry.low; dy <= ry.high; dy++) {
        Row row{&l, x.bin + rx.low, x.bin + rx.high, y.bin + dy, z.bin + dz};
        if (cut_row(l, row.x_low, row.x_high, row.y, row.z)) bucket(me, a, l, row);
      }
  }

  void run(const Slot& me, std::uint32_t a, Run r, const Row& meant) {
    while (r.begin < r.end) {
      const Run piece{r.begin, std::min(r.end, r.begin + kPiece)};
      take(me, a, &piece, 1, meant);
      r.begin = piece.end;
    }
  }
  // At most kPiece candidates.
  void take(const Slot& me, std::uint32_t a, const Run* runs, int count, const Row& meant) {
    std::uint32_t* out = hits_.room();
    bool doubt;
    std::uint32_t n = test_(slots_, me, runs, count, out, doubt);
    if (doubt | settles_ | (meant.level != nullptr)) n = settle(me, a, out, n, meant, doubt);
    hits_.keep(n);
  }

  // What the filter could not say, and what is not about distance: the hits that stay.
  std::uint32_t settle(const Slot& me, std::uint32_t a, std::uint32_t* hits, std::uint32_t n,
                       const Row& meant, bool doubt) {
    std::uint32_t kept = 0;
    for (std::uint32_t k = 0; k < n; k++) {
      const std::uint32_t b = hits[k];
      if (filters_ && !admitted(filters_[a], filters_[b])) continue;
      if (meant.level && !in_row(*meant.level, exact_sphere(b), meant.x_low, meant.x_high, meant.y, meant.z))
        continue;
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
  const std::uint32_t* starts_;
  const Filter* filters_;
  std::uint32_t* found_;
  Hits& hits_;
  const TestRuns<Slot> test_;
  bool exact_, bounded_ = false, settles_ = false;
  Run runs_[5] = {};
  Near<Slot> long_[kMaxLevels], near_[kMaxLevels];
  std::vector<Run> row_runs_;
  std::uint32_t long_end_ = 0, short_end_ = 0;
  std::uint64_t candidates_ = 0;
  std::uint64_t doubtful_ = 0;
};

}  // namespace

Fast::Fast(Budget& b)
    : budget_(&b),
      keys_(b),
      starts_(b),
      ids_(b),
      found_(b),
      entries_(b),
      slots_{Buffer<float>(b), Buffer<float>(b), Buffer<float>(b), Buffer<float>(b)},
      filters_(b),
      spheres_(b) {}

// Counting sort in two steps that each stay in a core's cache: into parts of neighbouring keys, then inside
// each part. Stable, so that the order of slots is the same for every thread count.
template <class Slot, class T>
void Fast::sort(const View<T>& spheres, const Grid& grid, int threads, Seconds& seconds) {
  Watch watch;
  const std::uint64_t n = spheres.count;
  int shift = 6;
  while ((grid.buckets - 1) >> shift >= 2048) shift++;
  const std::uint64_t parts = ((grid.buckets - 1) >> shift) + 1;
  std::uint32_t* keys = keys_.resize(n, "bin numbers");
  Entry* entries = entries_.resize(n, "sorting");
  std::uint32_t* ids = ids_.resize(n, "sorted spheres");
  for (Buffer<float>& component : slots_) {
    component.resize(n + kLanes, "sorted spheres");
    std::fill_n(component.data() + n, kLanes, 0.f);  // read with the last vector, and not looked at
  }
  const Slots<Slot> slots = this->slots<Slot>();
  Sphere* exact_spheres = std::is_same_v<Slot, FixedSlot> ? spheres_.resize(n, "sorted spheres") : nullptr;
  Filter* filters = spheres.filtered() ? filters_.resize(n, "families and masks") : nullptr;
  std::uint32_t* starts = starts_.resize(std::uint64_t(grid.buckets) + 1, "starts of bins");
  std::vector<std::uint32_t> count(static_cast<std::size_t>(threads) * parts, 0), part_first(parts + 1, 0);

#pragma omp parallel num_threads(threads)
  {
    const auto t = static_cast<std::uint64_t>(omp_get_thread_num()),
               all = static_cast<std::uint64_t>(omp_get_num_threads());
    const std::uint64_t begin = n * t / all, end = n * (t + 1) / all;
    std::uint32_t* mine = &count[t * parts];
    for (std::uint64_t i = begin; i < end; i++) {
      const Sphere s = spheres[i];
      const Level& l = grid.level[level_of(grid, s)];
      const std::uint32_t key = key_of(l, bin_of(l, s));
      keys[i] = key;
      mine[key >> shift]++;
    }
#pragma omp barrier
#pragma omp single
    {
      seconds.stage[0] += watch.lap();
      std::uint32_t sum = 0;
      for (std::uint64_t p = 0; p < parts; p++) {
        part_first[p] = sum;
        for (std::uint64_t k = 0; k < all; k++) {
          const std::uint32_t c = count[k * parts + p];
          count[k * parts + p] = sum;
          sum += c;
        }
      }
      part_first[parts] = sum;
      seconds.stage[1] += watch.lap();
    }
    for (std::uint64_t i = begin; i < end; i++)
      entries[mine[keys[i] >> shift]++] = {keys[i], static_cast<std::uint32_t>(i)};
#pragma omp barrier
#pragma omp single
    seconds.stage[2] += watch.lap();

    std::vector<std::uint32_t> place(std::size_t(1) << shift);
#pragma omp for schedule(dynamic, 4)
    for (std::int64_t part = 0; part < static_cast<std::int64_t>(parts); part++) {
      const auto p = static_cast<std::uint64_t>(part);
      const auto low = static_cast<std::uint32_t>(p << shift);
      const std::uint32_t width = std::min(std::uint32_t(1) << shift, grid.buckets - low);
      std::fill_n(place.begin(), width, 0u);
      for (std::uint32_t k = part_first[p]; k < part_first[p + 1]; k++) place[entries[k].key - low]++;
      std::uint32_t sum = part_first[p];
      for (std::uint32_t b = 0; b < width; b++) {
        const std::uint32_t c = place[b];
        starts[low + b] = place[b] = sum;
        sum += c;
      }
      for (std::uint32_t k = part_first[p]; k < part_first[p + 1]; k++) {
        const std::uint32_t id = entries[k].id, at = place[entries[k].key - low]++;
        const Sphere s = spheres[id];
        if (exact_spheres) exact_spheres[at] = s;
        slots.set(at, slot_at<Slot>(grid.level[level_of(grid, s)], s));
        ids[at] = id;
        if (filters) filters[at] = spheres.filter(id);
      }
    }
  }
  starts[grid.buckets] = static_cast<std::uint32_t>(n);
  seconds.stage[3] += watch.lap();
}

template <class Slot, class T>
std::uint64_t Fast::search(const View<T>& spheres, const Grid& grid, const Options& options, int threads,
                           Seconds& seconds) {
  Watch watch;
  const std::uint64_t n = spheres.count, chunks = (n + kChunk - 1) / kChunk;
  chunks_.resize(chunks);
  while (hits_.size() < static_cast<std::size_t>(threads)) hits_.emplace_back(*budget_);
  for (auto& buffer : hits_)
    buffer.resize(Hits::kLeast, "the list of contacts");  // nothing may throw in the threads
  std::uint32_t* found = found_.resize(n, "the list of contacts");
  std::uint64_t doubtful = 0, total = 0;
  bool counted_only = false;
#pragma omp parallel num_threads(threads) reduction(+ : doubtful, total) reduction(|| : counted_only)
  {
    const int t = omp_get_thread_num();
    Hits hits(hits_[static_cast<std::size_t>(t)], *budget_);
    Searcher<Slot> searcher(spheres_.data(), grid, options, slots<Slot>(), ids_.data(), starts_.data(),
                            spheres.filtered() ? filters_.data() : nullptr, found, hits);
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(chunks); k++) {
      const std::uint64_t first = static_cast<std::uint64_t>(k) * kChunk, before = hits.size();
      searcher.chunk(static_cast<std::uint32_t>(first),
                     static_cast<std::uint32_t>(std::min(n, first + kChunk)));
      chunks_[static_cast<std::size_t>(k)] = {before, hits.size() - before, 0, t};
    }
    doubtful += searcher.doubtful(), total += hits.total(), counted_only = counted_only || hits.counting();
  }
  if (counted_only)
    throw_memory(total * sizeof(std::uint32_t) + budget_->held(),
                 (std::to_string(total) + " contacts").c_str());
  seconds.stage[6] += watch.lap();
  return doubtful;
}

// Hits to records. Normals in batches: square roots and divisions then go several at a time.
template <class Slot>
void Fast::write(const Options& options, int threads, Records& records) {
  const Slots<Slot> slots = this->slots<Slot>();
  const auto chunks = static_cast<std::int64_t>(chunks_.size());
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
  for (std::int64_t k = 0; k < chunks; k++) {
    const Chunk& c = chunks_[static_cast<std::size_t>(k)];
    const std::uint32_t* hit = hits_[static_cast<std::size_t>(c.thread)].data() + c.first;
    const auto first = static_cast<std::uint32_t>(static_cast<std::uint64_t>(k) * kChunk);
    RecordWriter writer(records, options, c.record);
    for (std::uint32_t a = first, done = 0; done < c.count; a++) {
      if (found_[a] == 0) continue;
      const Sphere sa = options.width == Width::pairs ? Sphere{} : exact(spheres_.data(), slots, a);
      for (const std::uint32_t end = done + found_[a]; done < end; done++)
        writer.add(ids_[a], ids_[hit[done]], sa, [&] { return exact(spheres_.data(), slots, hit[done]); });
    }
  }
}

template <class Slot, class T>
std::uint64_t Fast::sort_and_search(const View<T>& spheres, const Grid& grid, const Options& options,
                                    int threads, Records& records, Seconds& seconds) {
  sort<Slot>(spheres, grid, threads, seconds);
  const std::uint64_t doubtful = search<Slot>(spheres, grid, options, threads, seconds);
  Watch watch;
  std::uint64_t sum = 0;
  for (Chunk& c : chunks_) c.record = sum, sum += c.count;
  seconds.stage[7] += watch.lap();
  records.resize(sum, options);
  write<Slot>(options, threads, records);
  seconds.stage[8] += watch.lap();
  return doubtful;
}

template <class T>
std::uint64_t Fast::run(const View<T>& spheres, const Summary& summary, const Options& options, int threads,
                        Records& records, Seconds& seconds) {
  const Grid grid = choose_grid(summary, options.bin_size);
  if (sizeof(T) == sizeof(float) && float_range(summary.extent, summary.radius_max))
    return sort_and_search<FloatSlot>(spheres, grid, options, threads, records, seconds);
  return sort_and_search<FixedSlot>(spheres, grid, options, threads, records, seconds);
}
template std::uint64_t Fast::run(const View<float>&, const Summary&, const Options&, int, Records&, Seconds&);
template std::uint64_t Fast::run(const View<double>&, const Summary&, const Options&, int, Records&,
                                 Seconds&);

}  // namespace padder::detect::omp
