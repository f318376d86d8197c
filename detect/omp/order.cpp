// SPDX-License-Identifier: MIT
// The first half of the grid path on the CPU: the spheres are ordered by the keys of their bins. It
// corresponds to stages 1 to 6 of the paper. Each sphere is listed in its owner bin only, so T[i] is 1. One
// counting sort replaces stages 1 to 4, and yields the starts of stage 5 at no cost; nothing is left of
// stage 6. Stages 7 to 9 are in search/search.cpp and records.cpp.
#include <omp.h>

#include "detect/omp/choose_levels.h"

namespace padder::detect::omp {
namespace {

// A counting sort in two steps, each of which stays in a core's cache: first into parts of neighbouring keys,
// then inside each part. It is stable, so the order of the slots is the same with any number of threads.
template <class Slot, class T>
struct CountingSort {
  const View<T>& spheres;
  const Grid& grid;
  int shift = 6;            // a part has 2^shift keys
  std::uint64_t parts = 0;  // at most 2048
  std::uint32_t* keys = nullptr;
  std::uint32_t* ids = nullptr;
  std::uint32_t* starts = nullptr;
  std::uint32_t* counts = nullptr;  // of each thread and part: spheres, then the place of the next one
  Entry<T>* entries = nullptr;
  Slots<Slot> slots{};
  Exact<Slot>* exact_spheres = nullptr;
  Filter* filters = nullptr;  // null if no sphere has one
  std::vector<std::uint32_t> part_first{};
  LevelKeys level_keys[kMaxLevels];

  CountingSort(const View<T>& view, const Grid& chosen) : spheres(view), grid(chosen) {
    for (int k = 0; k < grid.levels; k++) level_keys[k] = keys_of(grid.level[k]);
    while ((grid.buckets - 1) >> shift >= 2048) shift++;
    parts = ((grid.buckets - 1) >> shift) + 1;
    part_first.assign(parts + 1, 0);
  }

  // The keys of spheres begin to end - 1, and how many of them are in each part.
  void find_keys(std::uint64_t begin, std::uint64_t end, std::uint32_t* count) const {
    const int by = shift;
    double place[4][kBatch], size[kBatch], per_size[kBatch];
    std::uint32_t bins[3][kBatch];
    std::int64_t levels[kBatch] = {};  // first octaves
    std::fill_n(size, kBatch, grid.level[0].size), std::fill_n(per_size, kBatch, grid.level[0].per_size);
    std::fill_n(count, parts, 0u);
    for (std::uint64_t first = begin; first < end; first += kBatch) {
      const auto n = static_cast<std::uint32_t>(std::min<std::uint64_t>(kBatch, end - first));
      load_batch(spheres, first, place);
      if (grid.levels > 1) {
        octaves_of(place[0], place[1], place[2], place[3], static_cast<int>(n), grid.top, levels);
        for (std::uint32_t k = 0; k < n; k++) {
          levels[k] = grid.level_of_octave[levels[k]];
          size[k] = grid.level[levels[k]].size, per_size[k] = grid.level[levels[k]].per_size;
        }
      }
      for (int axis = 0; axis < 3; axis++)
        bin_numbers(place[axis], static_cast<int>(n), size, per_size, bins[axis]);
      for (std::uint32_t k = 0; k < n; k++) {
        const std::uint32_t key = level_keys[levels[k]].key(bins[0][k], bins[1][k], bins[2][k]);
        keys[first + k] = key;
        count[key >> by]++;
      }
    }
  }

  // Where each part begins, and inside it the spheres of each thread.
  void scan(std::uint64_t threads) {
    std::uint32_t sum = 0;
    for (std::uint64_t p = 0; p < parts; p++) {
      part_first[p] = sum;
      for (std::uint64_t t = 0; t < threads; t++) {
        const std::uint32_t c = counts[t * parts + p];
        counts[t * parts + p] = sum;
        sum += c;
      }
    }
    part_first[parts] = sum;
  }

  void move_to_parts(std::uint64_t begin, std::uint64_t end, std::uint32_t* next) const {
    const int by = shift;
    for (std::uint64_t i = begin; i < end; i++) {
      const T* const c = spheres.center(i);
      entries[next[keys[i] >> by]++] = {keys[i],          static_cast<std::uint32_t>(i), c[0], c[1], c[2],
                                        spheres.radius(i)};
    }
  }

  // Fetches the lines of these arrays that begin with slot k, before slots near it are written in any order.
  // (Always inline: GCC drops calls of functions that only fetch.)
  template <class... Entries>
  [[gnu::always_inline]] static void fetch([[maybe_unused]] std::uint32_t k,
                                           [[maybe_unused]] Entries*... arrays) {
#ifdef __GNUC__
    constexpr std::uint32_t kLine = 64;
    ((k % (kLine / sizeof(Entries)) == 0 ? __builtin_prefetch(arrays + k, 1) : void()), ...);
#endif
  }

  // The spheres of a part in the order of their keys, as slots. `place`: room for a number for each key of
  // the part.
  void sort_part(std::uint64_t part, std::uint32_t* place) const {
    const auto low = static_cast<std::uint32_t>(part << shift);
    const std::uint32_t width = std::min(std::uint32_t(1) << shift, grid.buckets - low);
    const std::uint32_t begin = part_first[part], end = part_first[part + 1];
    std::fill_n(place, width, 0u);
    for (std::uint32_t k = begin; k < end; k++) {
      place[entries[k].key - low]++;
      fetch(k, exact_spheres, slots.x, slots.y, slots.z, slots.r, ids, keys);
    }
    std::uint32_t sum = begin;
    for (std::uint32_t b = 0; b < width; b++) {
      const std::uint32_t c = place[b];
      starts[low + b] = place[b] = sum;
      sum += c;
    }
    for (std::uint32_t k = begin; k < end; k++) {
      const Entry<T>& e = entries[k];
      const std::uint32_t id = e.id, at = place[e.key - low]++;
      const Sphere s{e.x, e.y, e.z, e.r};
      if constexpr (std::is_same_v<Slot, FloatSlot>)
        exact_spheres[at] = float_slot(s), slots.set(at, float_slot(s));
      else
        exact_spheres[at] = s;
      ids[at] = id, keys[at] = e.key;
      if (filters) filters[at] = spheres.filter(id);
    }
    if constexpr (std::is_same_v<Slot, FixedPointSlot>)
      for (int level = 0; level < grid.levels; level++) {
        const Level& l = grid.level[level];
        const std::uint32_t first = std::max(low, l.offset),
                            last = std::min(low + width, l.offset + l.buckets);
        if (first < last) set_fixed_points(l, starts[first], last < low + width ? starts[last] : end);
      }
  }
  // The slots `first` to `last` - 1, which are of this level, from the exact spheres.
  void set_fixed_points(const Level& l, std::uint32_t first, std::uint32_t last) const {
    for (std::uint32_t count; first < last; first += count) {
      count = std::min(kBatch, last - first);
      double place[3][kBatch];
      for (std::uint32_t k = 0; k < count; k++) {
        const Sphere& s = exact_spheres[first + k];
        place[0][k] = s.x, place[1][k] = s.y, place[2][k] = s.z;
        slots.r[first + k] = static_cast<float>(mul(add(s.r, l.grown_by), l.units));
      }
      const auto n = static_cast<int>(count);
      fixed_points(place[0], n, l, slots.x + first), fixed_points(place[1], n, l, slots.y + first);
      fixed_points(place[2], n, l, slots.z + first);
    }
  }
};

}  // namespace

template <class Slot, class T>
void GridPath::sort(const View<T>& spheres, const Grid& grid, int threads, Seconds& seconds) {
  Stopwatch watch;
  const std::uint64_t n = spheres.count;
  CountingSort<Slot, T> sort(spheres, grid);
  sort.keys = keys_.resize(n, "bin numbers");
  sort.entries = reinterpret_cast<Entry<T>*>(entries_.resize(n * sizeof(Entry<T>), "sorting"));
  sort.ids = ids_.resize(n, "sorted spheres");
  for (Buffer<float>& component : slots_) {
    component.resize(n + kLanes, "sorted spheres");
    std::fill_n(component.data() + n, kLanes, 0.f);  // read with the last vector, and ignored
  }
  sort.slots = slots<Slot>();
  sort.exact_spheres =
      reinterpret_cast<Exact<Slot>*>(spheres_.resize(n * sizeof(Exact<Slot>), "sorted spheres"));
  if (spheres.filtered()) sort.filters = filters_.resize(n, "families and masks");
  sort.starts = starts_.resize(std::uint64_t(grid.buckets) + 1, "starts of bins");
  const std::uint64_t width = std::uint64_t(1) << sort.shift;
  sort.counts = counts_.resize(static_cast<std::uint64_t>(threads) * sort.parts, "sorting");
  std::uint32_t* places = places_.resize(static_cast<std::uint64_t>(threads) * width, "sorting");

#pragma omp parallel num_threads(threads)
  {
    const auto t = static_cast<std::uint64_t>(omp_get_thread_num()),
               all = static_cast<std::uint64_t>(omp_get_num_threads());
    const std::uint64_t begin = n * t / all, end = n * (t + 1) / all;
    std::uint32_t *mine = sort.counts + t * sort.parts, *place = places + t * width;
    sort.find_keys(begin, end, mine);
#pragma omp barrier
#pragma omp single
    {
      seconds.stage[0] += watch.lap();
      sort.scan(all);
      seconds.stage[1] += watch.lap();
    }
    sort.move_to_parts(begin, end, mine);
#pragma omp barrier
#pragma omp single
    seconds.stage[2] += watch.lap();

#pragma omp for schedule(dynamic, 4)
    for (std::int64_t part = 0; part < static_cast<std::int64_t>(sort.parts); part++)
      sort.sort_part(static_cast<std::uint64_t>(part), place);
  }
  sort.starts[grid.buckets] = static_cast<std::uint32_t>(n);
  seconds.stage[3] += watch.lap();
}

template <class Slot>
std::uint64_t GridPath::search_and_write(const Grid& grid, const Summary& summary, const CallOptions& options,
                                         bool filtered, int threads, Records& records, Seconds& seconds) {
  const std::uint64_t doubtful = search<Slot>(grid, summary, options, filtered, threads, seconds);
  Stopwatch watch;
  std::uint64_t sum = 0;
  for (Chunk& c : chunks_) c.record = sum, sum += c.count;
  seconds.stage[7] += watch.lap();
  records.resize(sum, options);
  write<Slot>(options, threads, records);
  seconds.stage[8] += watch.lap();
  return doubtful;
}

template <class T>
std::uint64_t GridPath::run(const View<T>& spheres, const Summary& summary, const CallOptions& options,
                            int threads, Records& records, Seconds& seconds) {
  const bool floats =
      sizeof(T) == sizeof(float) && float_range(summary.extent, summary.radius_max + summary.grown_by);
  Grid grid = choose_levels(summary, options.bin_size);
  spread_planes(spheres, grid);
  floats ? sort<FloatSlot>(spheres, grid, threads, seconds)
         : sort<FixedPointSlot>(spheres, grid, threads, seconds);
  return floats ? search_and_write<FloatSlot>(grid, summary, options, spheres.filtered(), threads, records,
                                              seconds)
                : search_and_write<FixedPointSlot>(grid, summary, options, spheres.filtered(), threads,
                                                   records, seconds);
}
template std::uint64_t GridPath::run(const View<float>&, const Summary&, const CallOptions&, int, Records&,
                                     Seconds&);
template std::uint64_t GridPath::run(const View<double>&, const Summary&, const CallOptions&, int, Records&,
                                     Seconds&);

}  // namespace padder::detect::omp
