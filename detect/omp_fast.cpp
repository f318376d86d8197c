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
constexpr std::uint64_t kPiece = 4096;  // candidates tested between two looks at the room left

// The exact sphere of a slot: float slots hold it, fixed-point slots do not.
template <class T>
Sphere exact(const View<T>&, const std::uint32_t*, const FloatSlot* slots, std::uint32_t k) {
  const FloatSlot& s = slots[k];
  return {s.x, s.y, s.z, s.r};
}
template <class T>
Sphere exact(const View<T>& spheres, const std::uint32_t* ids, const FixedSlot*, std::uint32_t k) {
  return spheres[ids[k]];
}

FloatSlot slot_at(const Level&, const Sphere& s, const FloatSlot*) { return float_slot(s); }
FixedSlot slot_at(const Level& l, const Sphere& s, const FixedSlot*) { return fixed_slot(l, s); }

// Hits of one thread, which grow as they must. When memory is short they are only counted: then the sentence
// about it can say how much was needed.
class Hits {
 public:
  Hits(Buffer<Pair>& buffer, Budget& budget)
      : buffer_(buffer), budget_(budget) {}  // buffer: room for kPiece at least
  // Room for kPiece more behind the returned place.
  Pair* room() {
    if (size_ + kPiece > buffer_.capacity()) grow();
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
    Buffer<Pair> wider(budget_);
    if (!wider.try_resize(2 * buffer_.capacity())) {
      counting_ = true, size_ = 0;
      return;
    }
    std::memcpy(wider.data(), buffer_.data(), size_ * sizeof(Pair));
    buffer_.swap(wider);
  }
  Buffer<Pair>& buffer_;
  Budget& budget_;
  std::uint64_t size_ = 0, total_ = 0;
  bool counting_ = false;
};

// Candidates that one sphere meets in a run of slots. Without a branch on hit or miss: which of the two comes
// next is nearly random, and a mispredicted branch costs more than the whole test.
template <class Slot>
std::uint64_t test_run(const Slot* slots, const Slot& me, std::uint32_t a, std::uint32_t begin,
                       std::uint32_t end, Pair* out, std::uint64_t& doubts) {
  std::uint64_t n = 0, doubt = 0;
  for (std::uint32_t b = begin; b < end; b++) {
    const Measured m = measured(me, slots[b]);
    const float excess = m.d2 - m.s2, band = kRelativeBand * m.s2 + kAbsoluteBand<Slot>;
    out[n] = {a, b};
    doubt += std::abs(excess) <= band;
    n += excess <= band;
  }
  doubts = doubt;
  return n;
}

template <class Slot, class T>
class Searcher {
 public:
  Searcher(const View<T>& spheres, const Grid& grid, const Options& options, const Slot* slots,
           const std::uint32_t* ids, const std::uint32_t* starts, const Filter* filters, Hits& hits)
      : spheres_(spheres),
        grid_(grid),
        own_(options.own),
        slots_(slots),
        ids_(ids),
        starts_(starts),
        filters_(filters),
        hits_(hits),
        exact_(options.precision == Precision::exact) {
    for (int k = 0; k < 3; k++) bounded_ |= own_.low[k] > -INFINITY || own_.high[k] < INFINITY;
  }
  std::uint64_t doubtful() const { return doubtful_; }

  void chunk(std::uint32_t first, std::uint32_t last) {
    std::uint32_t key =
        static_cast<std::uint32_t>(std::upper_bound(starts_, starts_ + grid_.buckets + 1, first) - starts_) -
        1;
    int level = 0;
    for (std::uint32_t slot = first; slot < last; key++) {
      const std::uint32_t end = std::min(starts_[key + 1], last);
      if (slot == end) continue;
      while (key >= grid_.level[level].offset + grid_.level[level].buckets) level++;
      const Level& l = grid_.level[level];
      if (l.hashed)
        for (std::uint32_t a = slot; a < end; a++) own_level_hashed(l, key, a);
      else
        own_level_dense(l, key, slot, end);
      for (int coarser = level + 1; coarser < grid_.levels; coarser++)
        for (std::uint32_t a = slot; a < end; a++) coarser_level(grid_.level[coarser], a);
      slot = end;
    }
  }

 private:
  struct Row {  // the bins that were meant, for hashed levels
    const Level* level = nullptr;
    std::int64_t x_low = 0, x_high = 0, y = 0, z = 0;
  };

  Sphere exact_sphere(std::uint32_t k) const { return exact(spheres_, ids_, slots_, k); }

  void own_level_dense(const Level& l, std::uint32_t key, std::uint32_t first, std::uint32_t end) {
    const std::uint32_t row = l.count[0] + 2, plane = row * (l.count[1] + 2);
    const std::uint32_t rows[4] = {key + row, key + plane - row, key + plane, key + plane + row};
    const std::uint32_t own_end = starts_[key + 2];
    std::uint32_t begin[4], stop[4];
    for (int k = 0; k < 4; k++) begin[k] = starts_[rows[k] - 1], stop[k] = starts_[rows[k] + 2];
    for (std::uint32_t a = first; a < end; a++) {
      const Slot me = slots_[a];
      run(me, a, a + 1, own_end, {});
      for (int k = 0; k < 4; k++) run(me, a, begin[k], stop[k], {});
    }
  }

  void bucket(const Slot& me, std::uint32_t a, const Level& l, const Row& r) {
    const std::uint32_t row = row_of(l, r.y, r.z);
    if (!l.hashed) {
      run(me, a, starts_[key_in_row(l, row, r.x_low)], starts_[key_in_row(l, row, r.x_high) + 1], {});
      return;
    }
    for (std::int64_t x = r.x_low; x <= r.x_high; x++) {
      const std::uint32_t key = key_in_row(l, row, x);
      run(me, a, starts_[key], starts_[key + 1], {&l, x, x, r.y, r.z});
    }
  }

  void own_level_hashed(const Level& l, std::uint32_t key, std::uint32_t a) {
    const Slot me = slots_[a];
    const Bin b = bin_of(l, exact_sphere(a));
    run(me, a, a + 1, starts_[key + 1], {&l, b.x, b.x, b.y, b.z});
    bucket(me, a, l, {&l, b.x + 1, b.x + 1, b.y, b.z});
    bucket(me, a, l, {&l, b.x - 1, b.x + 1, b.y + 1, b.z});
    for (std::int64_t y = b.y - 1; y <= b.y + 1; y++) bucket(me, a, l, {&l, b.x - 1, b.x + 1, y, b.z + 1});
  }

  void coarser_level(const Level& l, std::uint32_t a) {
    const Sphere s = exact_sphere(a);
    const Slot me = slot_at(l, s, static_cast<const Slot*>(nullptr));
    const Split x = split(l, s.x), y = split(l, s.y), z = split(l, s.z);
    const Reach rx = reach_of(l, x, s.r), ry = reach_of(l, y, s.r), rz = reach_of(l, z, s.r);
    for (int dz = rz.low; dz <= rz.high; dz++)
      for (int dy = ry.low; dy <= ry.high; dy++) {
        Row row{&l, x.bin + rx.low, x.bin + rx.high, y.bin + dy, z.bin + dz};
        if (cut_row(l, row.x_low, row.x_high, row.y, row.z)) bucket(me, a, l, row);
      }
  }

  void run(const Slot& me, std::uint32_t a, std::uint32_t begin, std::uint32_t end, const Row& meant) {
    while (begin < end) {
      const std::uint32_t stop = end - begin > kPiece ? begin + static_cast<std::uint32_t>(kPiece) : end;
      Pair* out = hits_.room();
      std::uint64_t doubts, n = test_run(slots_, me, a, begin, stop, out, doubts);
      if (doubts | filters_check() | (meant.level != nullptr)) n = settle(me, out, n, meant, doubts);
      hits_.keep(n);
      begin = stop;
    }
  }
  bool filters_check() const { return filters_ != nullptr || bounded_; }

  // What the filter could not say, and what is not about distance: the hits that stay.
  std::uint64_t settle(const Slot& me, Pair* hits, std::uint64_t n, const Row& meant, std::uint64_t doubts) {
    std::uint64_t kept = 0;
    for (std::uint64_t k = 0; k < n; k++) {
      const std::uint32_t a = hits[k].i, b = hits[k].j;
      if (filters_ && !admitted(filters_[a], filters_[b])) continue;
      if (meant.level && !in_row(*meant.level, exact_sphere(b), meant.x_low, meant.x_high, meant.y, meant.z))
        continue;
      if (bounded_) {
        const bool ordered = ids_[a] < ids_[b];
        const Sphere i = exact_sphere(ordered ? a : b), j = exact_sphere(ordered ? b : a);
        if (!owns(own_, midpoint(i, j))) continue;
      }
      const Measured m = measured(me, slots_[b]);
      if (doubts && verdict<Slot>(m) == Verdict::doubt) {
        doubtful_++;
        if (exact_ ? !touching(exact_sphere(a), exact_sphere(b)) : m.d2 > m.s2) continue;
      }
      hits[kept++] = hits[k];
    }
    return kept;
  }

  const View<T>& spheres_;
  const Grid& grid_;
  const Region own_;
  const Slot* slots_;
  const std::uint32_t* ids_;
  const std::uint32_t* starts_;
  const Filter* filters_;
  Hits& hits_;
  bool exact_, bounded_ = false;
  std::uint64_t doubtful_ = 0;
};

}  // namespace

Fast::Fast(Budget& b) : budget_(&b), keys_(b), starts_(b), ids_(b), entries_(b), slots_(b), filters_(b) {}

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
  auto* slots = reinterpret_cast<Slot*>(slots_.resize(n, "sorted spheres"));
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
        slots[at] = slot_at(grid.level[level_of(grid, s)], s, static_cast<const Slot*>(nullptr));
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
                           Records& records, Seconds& seconds) {
  Watch watch;
  const std::uint64_t n = spheres.count, chunks = (n + kChunk - 1) / kChunk;
  const auto* slots = reinterpret_cast<const Slot*>(slots_.data());
  struct Piece {
    std::uint64_t first, count, record;
    int thread;
  };
  std::vector<Piece> pieces(chunks);
  while (hits_.size() < static_cast<std::size_t>(threads)) hits_.emplace_back(*budget_);
  for (Buffer<Pair>& buffer : hits_)
    buffer.resize(4 * kPiece, "the list of contacts");  // nothing may throw in the threads
  std::uint64_t doubtful = 0, total = 0;
  bool counted_only = false;
#pragma omp parallel num_threads(threads) reduction(+ : doubtful, total) reduction(|| : counted_only)
  {
    const int t = omp_get_thread_num();
    Hits hits(hits_[static_cast<std::size_t>(t)], *budget_);
    Searcher<Slot, T> searcher(spheres, grid, options, slots, ids_.data(), starts_.data(),
                               spheres.filtered() ? filters_.data() : nullptr, hits);
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(chunks); k++) {
      const std::uint64_t first = static_cast<std::uint64_t>(k) * kChunk, before = hits.size();
      searcher.chunk(static_cast<std::uint32_t>(first),
                     static_cast<std::uint32_t>(std::min(n, first + kChunk)));
      pieces[static_cast<std::size_t>(k)] = {before, hits.size() - before, 0, t};
    }
    doubtful += searcher.doubtful(), total += hits.total(), counted_only = counted_only || hits.counting();
  }
  seconds.stage[6] += watch.lap();
  if (counted_only)
    throw_memory(total * sizeof(Pair) + budget_->held(), (std::to_string(total) + " contacts").c_str());

  std::uint64_t sum = 0;
  for (Piece& p : pieces) p.record = sum, sum += p.count;
  seconds.stage[7] += watch.lap();
  records.resize(sum, options);
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(chunks); k++) {
    const Piece& p = pieces[static_cast<std::size_t>(k)];
    const Pair* hit = hits_[static_cast<std::size_t>(p.thread)].data() + p.first;
    for (std::uint64_t q = 0; q < p.count; q++)
      records.write(p.record + q, ids_[hit[q].i], ids_[hit[q].j],
                    exact(spheres, ids_.data(), slots, hit[q].i),
                    exact(spheres, ids_.data(), slots, hit[q].j), options);
  }
  seconds.stage[8] += watch.lap();
  return doubtful;
}

template <class T>
std::uint64_t Fast::run(const View<T>& spheres, const Summary& summary, const Options& options, int threads,
                        Records& records, Seconds& seconds) {
  const Grid grid = choose_grid(summary, options.bin_size);
  if (sizeof(T) == sizeof(float) && float_range(summary.extent, summary.radius_max)) {
    sort<FloatSlot>(spheres, grid, threads, seconds);
    return search<FloatSlot>(spheres, grid, options, threads, records, seconds);
  }
  sort<FixedSlot>(spheres, grid, threads, seconds);
  return search<FixedSlot>(spheres, grid, options, threads, records, seconds);
}
template std::uint64_t Fast::run(const View<float>&, const Summary&, const Options&, int, Records&, Seconds&);
template std::uint64_t Fast::run(const View<double>&, const Summary&, const Options&, int, Records&,
                                 Seconds&);

}  // namespace padder::detect::omp
