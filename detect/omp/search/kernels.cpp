// SPDX-License-Identifier: MIT
#include "detect/omp/search/kernels.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "detect/omp/avx2.h"

namespace padder::detect::omp {
namespace {

// For any machine. There is no branch on hit or miss, because that would often be mispredicted, and a
// misprediction costs more than the whole test.
template <class Slot>
std::uint32_t test_runs_plain(const Slots<Slot>& slots, const Slot& me, const Run* runs, int count,
                              std::uint32_t* out, bool& doubt) {
  std::uint32_t n = 0;
  bool any = false;
  for (int k = 0; k < count; k++)
    for (std::uint32_t b = runs[k].begin; b < runs[k].end; b++) {
      const Measured m = measured(me, slots[b]);
      const float excess = m.d2 - m.s2, band = kRelativeBand * m.s2 + kAbsoluteBand<Slot>;
      out[n] = b;
      n += excess <= band;
      any |= std::abs(excess) <= band;
    }
  doubt = any;
  return n;
}

template <class Slot>
Searched test_searches_plain(const Slots<Slot>& slots, const RunSearch<Slot>* searches, std::uint32_t count,
                             const Run* runs, const HitLists& out) {
  Searched all{count, 0, false};
  for (std::uint32_t k = 0; k < count; k++) {
    bool doubt;
    const std::uint32_t n =
        test_runs_plain(slots, searches[k].me, runs, searches[k].runs, out.b + all.hits, doubt);
    std::fill_n(out.a + all.hits, n, searches[k].a);
    runs += searches[k].runs, all.hits += n, all.doubt |= doubt;
  }
  return all;
}

template <class Slot>
Searched test_bins_plain(const Bins<Slot>& bins, std::uint32_t first, std::uint32_t last, const HitLists& out,
                         std::uint32_t room) {
  Searched all{0, 0, false};
  for (std::uint32_t a = first; a < last && bins.keys[a] <= bins.last_key; a++) {
    Run runs[kForwardRuns];
    if (forward_runs(bins, bins.keys[a], a, runs) > room - all.hits) break;
    Slot me = bins.slots[a];
    me.r += bins.grown_by;
    bool doubt;
    const std::uint32_t n = test_runs_plain(bins.slots, me, runs, kForwardRuns, out.b + all.hits, doubt);
    std::fill_n(out.a + all.hits, n, a);
    all.spheres++, all.hits += n, all.doubt |= doubt;
  }
  return all;
}

int find_rows_plain(const Ball& ball, const std::uint32_t* starts, Run* out) {
  int n = 0;
  for (int z = ball.z_low; z <= ball.z_high; z++)
    for (int y = ball.y_low; y <= ball.y_high; y++) {
      const float fy = static_cast<float>(y), fz = static_cast<float>(z);
      const float gap_y = std::max(std::max(fy - ball.y, ball.y - (fy + 1)), 0.f),
                  gap_z = std::max(std::max(fz - ball.z, ball.z - (fz + 1)), 0.f);
      const float rest = ball.radius * ball.radius - gap_y * gap_y - gap_z * gap_z;
      if (rest < 0) continue;
      const float half = std::sqrt(rest);
      const int low = std::max(static_cast<int>(std::floor(ball.x - half)), ball.x_low),
                high = std::min(static_cast<int>(std::floor(ball.x + half)), ball.x_high);
      if (low > high) continue;
      const std::uint32_t key =
          ball.key + static_cast<std::uint32_t>(z) * ball.plane + static_cast<std::uint32_t>(y) * ball.row;
      out[n] = {starts[key + static_cast<std::uint32_t>(low)],
                starts[key + static_cast<std::uint32_t>(high) + 1]};
      n += out[n].begin < out[n].end;
    }
  return n;
}

#ifdef PADDER_AVX2
// For each mask of 8 lanes, the lanes that are set, in order. This is the permutation that packs a vector.
constexpr auto kPacking = [] {
  std::array<std::array<std::uint8_t, 8>, 256> table{};
  for (unsigned mask = 0; mask < 256; mask++) {
    unsigned n = 0;
    for (std::uint8_t lane = 0; lane < 8; lane++)
      if (mask >> lane & 1) table[mask][n++] = lane;
  }
  return table;
}();

// One position in all lanes.
struct FloatPlace {
  __m256 x, y, z;
};
struct FixedPlace {
  __m256i x, y, z;
};
__attribute__((target("avx2"))) inline FloatPlace spread(const FloatSlot& s) {
  return {_mm256_set1_ps(s.x), _mm256_set1_ps(s.y), _mm256_set1_ps(s.z)};
}
__attribute__((target("avx2"))) inline FixedPlace spread(const FixedPointSlot& s) {
  return {_mm256_set1_epi32(s.x), _mm256_set1_epi32(s.y), _mm256_set1_epi32(s.z)};
}
// The differences of eight components and one. For fixed point they are exact integers.
__attribute__((target("avx2"))) inline __m256 apart(const float* p, __m256 from) {
  return _mm256_sub_ps(_mm256_loadu_ps(p), from);
}
__attribute__((target("avx2"))) inline __m256 apart(const std::int32_t* p, __m256i from) {
  const __m256i there = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
  return _mm256_cvtepi32_ps(_mm256_sub_epi32(there, from));
}
__attribute__((target("avx2"))) inline __m256 squared_length(__m256 x, __m256 y, __m256 z) {
  return _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y)), _mm256_mul_ps(z, z));
}
__attribute__((target("avx2"))) inline __m256 absolute(__m256 v) {
  return _mm256_and_ps(v, _mm256_castsi256_ps(_mm256_set1_epi32(0x7fffffff)));
}
__attribute__((target("avx2"))) inline std::uint32_t lanes_at_most(__m256 a, __m256 b) {
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)));
}
// The permutation that packs the lanes of `mask`.
__attribute__((target("avx2"))) inline __m256i packing(std::uint32_t mask) {
  return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(kPacking[mask].data())));
}
// Packs the lanes of `mask`, which stand for slots b, b + 1, and so on. The rest of the vector is garbage,
// which later writes overwrite.
__attribute__((target("avx2,popcnt"))) inline std::uint32_t pack(std::uint32_t* out, std::uint32_t b,
                                                                 std::uint32_t mask) {
  const __m256i which = _mm256_add_epi32(packing(mask), _mm256_set1_epi32(static_cast<std::int32_t>(b)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), which);
  return static_cast<std::uint32_t>(_mm_popcnt_u32(mask));
}
inline std::uint32_t inside(std::uint32_t left) { return left >= kLanes ? 255u : (1u << left) - 1; }

// A sphere that is tested against runs.
template <class Slot>
struct Seeker {
  decltype(spread(Slot{})) place;
  __m256 radius;
};
// Tests a run. The first vector is tested even if the run is empty, because a branch on that would often be
// mispredicted. Returns the end of the hits. Lanes of `doubts` are set where float cannot decide.
template <class Slot>
__attribute__((target("avx2,popcnt"), always_inline)) inline std::uint32_t* test_run(
    const Slots<Slot>& slots, const Seeker<Slot>& me, Run run, std::uint32_t* out, __m256& doubts) {
  const __m256 relative = _mm256_set1_ps(kRelativeBand), constant = _mm256_set1_ps(kAbsoluteBand<Slot>);
  do {
    const std::uint32_t b = run.begin;
    const __m256 d2 = squared_length(apart(slots.x + b, me.place.x), apart(slots.y + b, me.place.y),
                                     apart(slots.z + b, me.place.z));
    const __m256 s = _mm256_add_ps(_mm256_loadu_ps(slots.r + b), me.radius), s2 = _mm256_mul_ps(s, s);
    const __m256 excess = _mm256_sub_ps(d2, s2), band = _mm256_add_ps(_mm256_mul_ps(relative, s2), constant);
    doubts = _mm256_or_ps(doubts, _mm256_cmp_ps(absolute(excess), band, _CMP_LE_OQ));
    out += pack(out, b, lanes_at_most(excess, band) & inside(run.end - b));
    run.begin += kLanes;
  } while (run.begin < run.end);
  return out;
}
template <class Slot>
__attribute__((target("avx2,popcnt"))) std::uint32_t test_runs_avx2(const Slots<Slot>& given, const Slot& me,
                                                                    const Run* runs, int count,
                                                                    std::uint32_t* out, bool& doubt) {
  const Slots<Slot> slots = given;
  const Seeker<Slot> seeker{spread(me), _mm256_set1_ps(me.r)};
  __m256 doubts = _mm256_setzero_ps();
  std::uint32_t* const first = out;
  for (const Run* const end = runs + count; runs != end; runs++)
    out = test_run(slots, seeker, *runs, out, doubts);
  doubt = _mm256_movemask_ps(doubts) != 0;
  return static_cast<std::uint32_t>(out - first);
}
// Writes `a` so many times, and up to kLanes times more. Returns the end.
__attribute__((target("avx2"), always_inline)) inline std::uint32_t* fill(std::uint32_t* out,
                                                                          std::ptrdiff_t count,
                                                                          std::uint32_t a) {
  std::uint32_t* const end = out + count;
  do {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_set1_epi32(static_cast<int>(a)));
    out += kLanes;
  } while (out < end);
  return end;
}
template <class Slot>
__attribute__((target("avx2,popcnt"))) Searched test_searches_avx2(const Slots<Slot>& given,
                                                                   const RunSearch<Slot>* searches,
                                                                   std::uint32_t count, const Run* runs,
                                                                   const HitLists& lists) {
  const Slots<Slot> slots = given;
  std::uint32_t *out_a = lists.a, *out = lists.b;
  __m256 doubts = _mm256_setzero_ps();
  for (std::uint32_t k = 0; k < count; k++) {
    const Seeker<Slot> me{spread(searches[k].me), _mm256_set1_ps(searches[k].me.r)};
    const std::uint32_t* const before = out;
    for (const Run* const end = runs + searches[k].runs; runs != end; runs++)
      out = test_run(slots, me, *runs, out, doubts);
    out_a = fill(out_a, out - before, searches[k].a);
  }
  return {count, static_cast<std::uint32_t>(out - lists.b), _mm256_movemask_ps(doubts) != 0};
}
template <class Slot>
__attribute__((target("avx2,popcnt"))) Searched test_bins_avx2(const Bins<Slot>& given, std::uint32_t first,
                                                               std::uint32_t last, const HitLists& lists,
                                                               std::uint32_t room) {
  const Bins<Slot> bins = given;
  const __m256 grown_by = _mm256_set1_ps(bins.grown_by);
  const std::uint32_t* const begin = lists.b;
  std::uint32_t *out_a = lists.a, *out = lists.b, a = first;
  __m256 doubts = _mm256_setzero_ps();
  for (; a < last; a++) {
    const std::uint32_t key = bins.keys[a];
    Run runs[kForwardRuns];
    if (key > bins.last_key ||
        forward_runs(bins, key, a, runs) > room - static_cast<std::uint32_t>(out - begin))
      break;
    const Seeker<Slot> me{spread(bins.slots[a]), _mm256_add_ps(_mm256_set1_ps(bins.slots.r[a]), grown_by)};
    const std::uint32_t* const before = out;
#pragma GCC unroll kForwardRuns
    for (const Run& run : runs) out = test_run(bins.slots, me, run, out, doubts);
    out_a = fill(out_a, out - before, a);
  }
  return {a - first, static_cast<std::uint32_t>(out - begin), _mm256_movemask_ps(doubts) != 0};
}

// Pairs of a sphere that searches and a candidate. Those of many spheres are tested together, eight at once:
// a run of fewer than eight candidates would leave most lanes of a vector idle.
class PairList {
 public:
  static constexpr std::uint32_t kRoom = 512;
  // Adds sphere a with each slot of the run, behind `size` pairs. There must be room. Returns the new size,
  // which is no member: a compiler would read it again after each store.
  __attribute__((target("avx2"), always_inline)) inline std::uint32_t add(std::uint32_t size, std::uint32_t a,
                                                                          Run run) {
    const __m256i eight = _mm256_set1_epi32(kLanes), mine = _mm256_set1_epi32(static_cast<int>(a));
    __m256i other = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(run.begin)),
                                     _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    const std::uint32_t end = size + (run.end - run.begin);
    do {
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(a_ + size), mine);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(b_ + size), other);
      size += kLanes, other = _mm256_add_epi32(other, eight);
    } while (size < end);
    return end;
  }
  // Writes the first `size` pairs without those that the float test calls apart. Returns how many it wrote.
  __attribute__((target("avx2,popcnt"))) std::uint32_t test(std::uint32_t size, const FloatSlot* spheres,
                                                            float grown_by, const HitLists& out,
                                                            bool& doubt) {
    // Of the first sphere, x + 0, y + 0, z + 0 and -(r + grown_by) are taken: a difference is then that of
    // the centres, and the sum of the radii.
    const __m256 grown = _mm256_setr_ps(0, 0, 0, grown_by, 0, 0, 0, grown_by),
                 minus = _mm256_setr_ps(0, 0, 0, -0.f, 0, 0, 0, -0.f);
    const __m256 relative = _mm256_set1_ps(kRelativeBand),
                 constant = _mm256_set1_ps(kAbsoluteBand<FloatSlot>);
    std::uint32_t n = 0, unsure = 0;
    std::fill_n(a_ + size, kLanes, 0u), std::fill_n(b_ + size, kLanes, 0u);  // to fill up the last vector
    for (std::uint32_t k = 0; k < size; k += kLanes) {
      __m256 v[4];
      for (std::uint32_t q = 0; q < 4; q++) {
        const __m256 mine = _mm256_xor_ps(_mm256_add_ps(both(spheres, a_ + k + q), grown), minus);
        v[q] = _mm256_sub_ps(both(spheres, b_ + k + q), mine);
      }
      const __m256 xy0 = _mm256_unpacklo_ps(v[0], v[1]), zs0 = _mm256_unpackhi_ps(v[0], v[1]),
                   xy2 = _mm256_unpacklo_ps(v[2], v[3]), zs2 = _mm256_unpackhi_ps(v[2], v[3]);
      const __m256 x = _mm256_shuffle_ps(xy0, xy2, 0x44), y = _mm256_shuffle_ps(xy0, xy2, 0xee),
                   z = _mm256_shuffle_ps(zs0, zs2, 0x44), s = _mm256_shuffle_ps(zs0, zs2, 0xee);
      const __m256 s2 = _mm256_mul_ps(s, s), excess = _mm256_sub_ps(squared_length(x, y, z), s2),
                   band = _mm256_add_ps(_mm256_mul_ps(relative, s2), constant);
      const std::uint32_t mask = lanes_at_most(excess, band) & inside(size - k);
      unsure |= lanes_at_most(absolute(excess), band) & inside(size - k);
      const __m256i which = packing(mask);
      pack(out.a + n, a_ + k, which), pack(out.b + n, b_ + k, which);
      n += static_cast<std::uint32_t>(_mm_popcnt_u32(mask));
    }
    doubt = unsure != 0;
    return n;
  }

 private:
  // The spheres of slots k[0] and k[4].
  __attribute__((target("avx2"), always_inline)) static inline __m256 both(const FloatSlot* spheres,
                                                                           const std::uint32_t* k) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(&spheres[k[0]].x)),
                                _mm_loadu_ps(&spheres[k[4]].x), 1);
  }
  __attribute__((target("avx2"), always_inline)) static inline void pack(std::uint32_t* to,
                                                                         const std::uint32_t* from,
                                                                         __m256i which) {
    const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(all, which));
  }
  std::uint32_t a_[kRoom + kLanes], b_[kRoom + kLanes];
};

__attribute__((target("avx2,popcnt"))) Searched test_sparse_bins_avx2(const Bins<FloatSlot>& given,
                                                                      std::uint32_t first, std::uint32_t last,
                                                                      const HitLists& out,
                                                                      std::uint32_t room) {
  const Bins<FloatSlot> bins = given;
  PairList pairs;
  Searched all{0, 0, false};
  for (;;) {
    const std::uint32_t most = std::min(PairList::kRoom, room - all.hits), from = first + all.spheres;
    std::uint32_t a = from, size = 0;
    for (; a < last; a++) {
      Run runs[kForwardRuns];
      const std::uint32_t key = bins.keys[a];
      if (key > bins.last_key || forward_runs(bins, key, a, runs) > most - size) break;
#pragma GCC unroll kForwardRuns
      for (const Run& run : runs) size = pairs.add(size, a, run);
    }
    if (a == from) return all;
    bool doubt;
    all.hits += pairs.test(size, bins.spheres, bins.grown_by, {out.a + all.hits, out.b + all.hits}, doubt);
    all.spheres += a - from, all.doubt |= doubt;
  }
}

// Writes a0 b0 a1 b1 and so on.
__attribute__((target("avx2"))) inline void store_both(void* to, __m256i a, __m256i b) {
  const __m256i low = _mm256_unpacklo_epi32(a, b), high = _mm256_unpackhi_epi32(a, b);
  auto* out = static_cast<__m256i*>(to);
  _mm256_storeu_si256(out, _mm256_permute2x128_si256(low, high, 0x20));
  _mm256_storeu_si256(out + 1, _mm256_permute2x128_si256(low, high, 0x31));
}
// The squared distance from a ball's centre to the bins [first, first + 1] along an axis.
__attribute__((target("avx2"))) inline __m256 gap_squared(__m256i first, float centre) {
  const __m256 low = _mm256_cvtepi32_ps(first), at = _mm256_set1_ps(centre);
  const __m256 below = _mm256_sub_ps(low, at),
               above = _mm256_sub_ps(at, _mm256_add_ps(low, _mm256_set1_ps(1)));
  const __m256 gap = _mm256_max_ps(_mm256_max_ps(below, above), _mm256_setzero_ps());
  return _mm256_mul_ps(gap, gap);
}
__attribute__((target("avx2"))) inline __m256i times(__m256i a, std::uint32_t b) {
  return _mm256_mullo_epi32(a, _mm256_set1_epi32(static_cast<int>(b)));
}
__attribute__((target("avx2"))) inline __m256i floors_of(__m256 v) {
  return _mm256_cvttps_epi32(_mm256_floor_ps(v));
}

// Eight rows at a time.
__attribute__((target("avx2,popcnt"))) int find_rows_avx2(const Ball& ball, const std::uint32_t* starts,
                                                          Run* out) {
  const int side = ball.y_high - ball.y_low + 1, rows = side * (ball.z_high - ball.z_low + 1);
  const __m256 square = _mm256_set1_ps(ball.radius * ball.radius), x = _mm256_set1_ps(ball.x),
               half_row = _mm256_set1_ps(0.5f), per_side = _mm256_set1_ps(1 / static_cast<float>(side));
  const auto* const table = reinterpret_cast<const int*>(starts);
  int n = 0;
  for (int k = 0; k < rows; k += static_cast<int>(kLanes)) {
    const __m256i row = _mm256_add_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(k));
    // Half a row is added so that rounding cannot change the integer part of the quotient.
    const __m256i layer =
        _mm256_cvttps_epi32(_mm256_mul_ps(_mm256_add_ps(_mm256_cvtepi32_ps(row), half_row), per_side));
    const __m256i z = _mm256_add_epi32(layer, _mm256_set1_epi32(ball.z_low)),
                  y = _mm256_add_epi32(_mm256_sub_epi32(row, times(layer, static_cast<std::uint32_t>(side))),
                                       _mm256_set1_epi32(ball.y_low));
    const __m256 rest = _mm256_sub_ps(_mm256_sub_ps(square, gap_squared(y, ball.y)), gap_squared(z, ball.z)),
                 half = _mm256_sqrt_ps(rest);
    const __m256i low = _mm256_max_epi32(floors_of(_mm256_sub_ps(x, half)), _mm256_set1_epi32(ball.x_low)),
                  high = _mm256_min_epi32(floors_of(_mm256_add_ps(x, half)), _mm256_set1_epi32(ball.x_high));
    const __m256i crossed = _mm256_castps_si256(_mm256_cmp_ps(rest, _mm256_setzero_ps(), _CMP_GE_OQ)),
                  is_row = _mm256_cmpgt_epi32(_mm256_set1_epi32(rows), row),
                  there =
                      _mm256_andnot_si256(_mm256_cmpgt_epi32(low, high), _mm256_and_si256(crossed, is_row));
    const __m256i key = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(ball.key)),
                                         _mm256_add_epi32(times(z, ball.plane), times(y, ball.row)));
    const __m256i none = _mm256_setzero_si256(),
                  begin = _mm256_mask_i32gather_epi32(none, table, _mm256_add_epi32(key, low), there, 4),
                  end = _mm256_mask_i32gather_epi32(none, table + 1, _mm256_add_epi32(key, high), there, 4);
    const __m256i empty = _mm256_cmpeq_epi32(begin, end);
    const auto mask = ~static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(empty))) & 255;
    store_both(out + n, _mm256_permutevar8x32_epi32(begin, packing(mask)),
               _mm256_permutevar8x32_epi32(end, packing(mask)));
    n += _mm_popcnt_u32(mask);
  }
  return n;
}
#endif

}  // namespace

template <class Slot>
Kernels<Slot> plain_kernels() {
  return {test_runs_plain<Slot>, test_searches_plain<Slot>, test_bins_plain<Slot>, test_bins_plain<Slot>,
          find_rows_plain};
}
template <class Slot>
Kernels<Slot> kernels_for_this_machine() {
#ifdef PADDER_AVX2
  if (has_avx2()) {
    Kernels<Slot> here{test_runs_avx2<Slot>, test_searches_avx2<Slot>, test_bins_avx2<Slot>,
                       test_bins_avx2<Slot>, find_rows_avx2};
    if constexpr (std::is_same_v<Slot, FloatSlot>) here.test_sparse_bins = test_sparse_bins_avx2;
    return here;
  }
#endif
  return plain_kernels<Slot>();
}
template Kernels<FloatSlot> plain_kernels();
template Kernels<FixedPointSlot> plain_kernels();
template Kernels<FloatSlot> kernels_for_this_machine();
template Kernels<FixedPointSlot> kernels_for_this_machine();

}  // namespace padder::detect::omp
