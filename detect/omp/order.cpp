// SPDX-License-Identifier: MIT
// The fast path on the CPU. In the paper's words: T[i] is 1, each sphere is listed in its owner bin only;
// stages 1 to 4 become one counting sort (here), which yields the starts of stage 5 on its way; nothing is
// left of stage 6; stages 7 to 9 (search.cpp, record.cpp) run over each bin and the forward half of
// its neighbours, where every pair meets once, so that the midpoint rule falls away.
#include <omp.h>

#include "detect/omp/paths.h"

namespace padder::detect::omp {

Fast::Fast(Budget& b)
    : budget_(&b),
      keys_(b),
      starts_(b),
      ids_(b),
      found_(b),
      counts_(b),
      places_(b),
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
  constexpr std::uint64_t kAhead = 16;  // spheres are fetched so far ahead of use
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
  Sphere* exact_spheres =
      std::is_same_v<Slot, FixedPointSlot> ? spheres_.resize(n, "sorted spheres") : nullptr;
  Filter* filters = spheres.filtered() ? filters_.resize(n, "families and masks") : nullptr;
  std::uint32_t* starts = starts_.resize(std::uint64_t(grid.buckets) + 1, "starts of bins");
  const std::uint64_t each = std::uint64_t(1) << shift;  // bins of a part
  std::uint32_t* count = counts_.resize(static_cast<std::uint64_t>(threads) * parts, "sorting");
  std::uint32_t* places = places_.resize(static_cast<std::uint64_t>(threads) * each, "sorting");
  std::vector<std::uint32_t> part_first(parts + 1, 0);

#pragma omp parallel num_threads(threads)
  {
    const auto t = static_cast<std::uint64_t>(omp_get_thread_num()),
               all = static_cast<std::uint64_t>(omp_get_num_threads());
    const std::uint64_t begin = n * t / all, end = n * (t + 1) / all;
    std::uint32_t *mine = count + t * parts, *place = places + t * each;
    std::fill_n(mine, parts, 0u);
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

#pragma omp for schedule(dynamic, 4)
    for (std::int64_t part = 0; part < static_cast<std::int64_t>(parts); part++) {
      const auto p = static_cast<std::uint64_t>(part);
      const auto low = static_cast<std::uint32_t>(p << shift);
      const std::uint32_t width = std::min(std::uint32_t(1) << shift, grid.buckets - low);
      std::fill_n(place, width, 0u);
      for (std::uint32_t k = part_first[p]; k < part_first[p + 1]; k++) place[entries[k].key - low]++;
      std::uint32_t sum = part_first[p];
      for (std::uint32_t b = 0; b < width; b++) {
        const std::uint32_t c = place[b];
        starts[low + b] = place[b] = sum;
        sum += c;
      }
      for (std::uint32_t k = part_first[p]; k < part_first[p + 1]; k++) {
        spheres.prefetch(entries[std::min<std::uint64_t>(k + kAhead, n - 1)].id);
        const std::uint32_t id = entries[k].id, at = place[entries[k].key - low]++;
        const Sphere s = spheres[id];
        if (exact_spheres) exact_spheres[at] = s;
        if constexpr (std::is_same_v<Slot, FloatSlot>)
          slots.set(at, float_slot(s));
        else
          slots.set(at, fixed_point_slot(grid.level[level_of(grid, s)], s));
        ids[at] = id, keys[at] = entries[k].key;
        if (filters) filters[at] = spheres.filter(id);
      }
    }
  }
  starts[grid.buckets] = static_cast<std::uint32_t>(n);
  seconds.stage[3] += watch.lap();
}

template <class Slot, class T>
std::uint64_t Fast::sort_and_search(const View<T>& spheres, const Grid& grid, const Options& options,
                                    int threads, Records& records, Seconds& seconds) {
  sort<Slot>(spheres, grid, threads, seconds);
  const std::uint64_t doubtful = search<Slot>(grid, options, spheres.filtered(), threads, seconds);
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
  const Grid grid = choose_grid(summary, options.bin_size, 8, CrossSearch::cheaper);
  if (sizeof(T) == sizeof(float) && float_range(summary.extent, summary.radius_max))
    return sort_and_search<FloatSlot>(spheres, grid, options, threads, records, seconds);
  return sort_and_search<FixedPointSlot>(spheres, grid, options, threads, records, seconds);
}
template std::uint64_t Fast::run(const View<float>&, const Summary&, const Options&, int, Records&, Seconds&);
template std::uint64_t Fast::run(const View<double>&, const Summary&, const Options&, int, Records&,
                                 Seconds&);

}  // namespace padder::detect::omp
