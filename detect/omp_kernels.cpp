#include "detect/omp_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>

#if defined(__x86_64__) && defined(__GNUC__)
#define PADDER_AVX2 1
#include <immintrin.h>
#endif

namespace padder::detect::omp {
namespace {

// Any machine. No branch on hit or miss: which of the two comes next is nearly random, and a mispredicted
// branch costs more than the whole test.
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

float beyond(float a, float from, float half) { return std::max(std::abs(a - from) - half, 0.f); }
float beyond(std::int32_t a, std::int32_t from, float half) {
  return std::max(std::abs(static_cast<float>(wrapped_difference(from, a))) - half, 0.f);
}

template <class Slot>
std::uint32_t sieve_runs_plain(const Slots<Slot>& slots, const Block<Slot>& block, const Run* runs, int count,
                               std::uint32_t* out) {
  std::uint32_t n = 0;
  for (int k = 0; k < count; k++)
    for (std::uint32_t b = runs[k].begin; b < runs[k].end; b++) {
      const float x = beyond(slots.x[b], block.from.x, block.half[0]),
                  y = beyond(slots.y[b], block.from.y, block.half[1]);
      const float z = beyond(slots.z[b], block.from.z, block.half[2]),
                  reach = (slots.r[b] + block.from.r) * 1.001f + block.slack;
      out[n] = b;
      n += x * x + y * y + z * z <= reach * reach;
    }
  return n;
}

#ifdef PADDER_AVX2
// For each mask of 8 lanes, the lanes that are set, in order: the permutation that packs a vector.
constexpr auto kPacking = [] {
  std::array<std::array<std::uint8_t, 8>, 256> table{};
  for (unsigned mask = 0; mask < 256; mask++) {
    unsigned n = 0;
    for (std::uint8_t lane = 0; lane < 8; lane++)
      if (mask >> lane & 1) table[mask][n++] = lane;
  }
  return table;
}();

// Eight components less one: exact integers for fixed point.
__attribute__((target("avx2"))) inline __m256 apart(const float* p, float from) {
  return _mm256_sub_ps(_mm256_loadu_ps(p), _mm256_set1_ps(from));
}
__attribute__((target("avx2"))) inline __m256 apart(const std::int32_t* p, std::int32_t from) {
  const __m256i there = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
  return _mm256_cvtepi32_ps(_mm256_sub_epi32(there, _mm256_set1_epi32(from)));
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
// Packs the lanes of `mask`, which are slots b, b + 1, …; the lanes behind them are written over later.
__attribute__((target("avx2,popcnt"))) inline std::uint32_t pack(std::uint32_t* out, std::uint32_t b,
                                                                 std::uint32_t mask) {
  const __m128i lanes = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(kPacking[mask].data()));
  const __m256i which =
      _mm256_add_epi32(_mm256_cvtepu8_epi32(lanes), _mm256_set1_epi32(static_cast<std::int32_t>(b)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), which);
  return static_cast<std::uint32_t>(_mm_popcnt_u32(mask));
}
inline std::uint32_t inside(std::uint32_t left) { return left >= kLanes ? 255u : (1u << left) - 1; }

template <class Slot>
__attribute__((target("avx2,popcnt"))) std::uint32_t test_runs_avx2(const Slots<Slot>& slots, const Slot& me,
                                                                    const Run* runs, int count,
                                                                    std::uint32_t* out, bool& doubt) {
  const __m256 relative = _mm256_set1_ps(kRelativeBand), constant = _mm256_set1_ps(kAbsoluteBand<Slot>);
  const __m256 radius = _mm256_set1_ps(me.r);
  std::uint32_t n = 0, any = 0;
  for (int k = 0; k < count; k++)
    for (std::uint32_t b = runs[k].begin; b < runs[k].end; b += kLanes) {
      const __m256 d2 =
          squared_length(apart(slots.x + b, me.x), apart(slots.y + b, me.y), apart(slots.z + b, me.z));
      const __m256 s = _mm256_add_ps(_mm256_loadu_ps(slots.r + b), radius), s2 = _mm256_mul_ps(s, s);
      const __m256 excess = _mm256_sub_ps(d2, s2),
                   band = _mm256_add_ps(_mm256_mul_ps(relative, s2), constant);
      const std::uint32_t mask = inside(runs[k].end - b);
      any |= lanes_at_most(absolute(excess), band) & mask;
      n += pack(out + n, b, lanes_at_most(excess, band) & mask);
    }
  doubt = any != 0;
  return n;
}

template <class Slot>
__attribute__((target("avx2,popcnt"))) std::uint32_t sieve_runs_avx2(const Slots<Slot>& slots,
                                                                     const Block<Slot>& block,
                                                                     const Run* runs, int count,
                                                                     std::uint32_t* out) {
  const __m256 zero = _mm256_setzero_ps(),
               half[3] = {_mm256_set1_ps(block.half[0]), _mm256_set1_ps(block.half[1]),
                          _mm256_set1_ps(block.half[2])};
  const __m256 radius = _mm256_set1_ps(block.from.r), slack = _mm256_set1_ps(block.slack),
               generous = _mm256_set1_ps(1.001f);
  std::uint32_t n = 0;
  for (int k = 0; k < count; k++)
    for (std::uint32_t b = runs[k].begin; b < runs[k].end; b += kLanes) {
      const __m256 x =
          _mm256_max_ps(_mm256_sub_ps(absolute(apart(slots.x + b, block.from.x)), half[0]), zero);
      const __m256 y =
          _mm256_max_ps(_mm256_sub_ps(absolute(apart(slots.y + b, block.from.y)), half[1]), zero);
      const __m256 z =
          _mm256_max_ps(_mm256_sub_ps(absolute(apart(slots.z + b, block.from.z)), half[2]), zero);
      const __m256 reach =
          _mm256_add_ps(_mm256_mul_ps(_mm256_add_ps(_mm256_loadu_ps(slots.r + b), radius), generous), slack);
      n +=
          pack(out + n, b,
               lanes_at_most(squared_length(x, y, z), _mm256_mul_ps(reach, reach)) & inside(runs[k].end - b));
    }
  return n;
}
#endif

}  // namespace

template <class Slot>
TestRuns<Slot> test_runs_for_this_machine() {
#ifdef PADDER_AVX2
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt")) return test_runs_avx2<Slot>;
#endif
  return test_runs_plain<Slot>;
}
template <class Slot>
SieveRuns<Slot> sieve_runs_for_this_machine() {
#ifdef PADDER_AVX2
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt")) return sieve_runs_avx2<Slot>;
#endif
  return sieve_runs_plain<Slot>;
}
template SieveRuns<FloatSlot> sieve_runs_for_this_machine();
template SieveRuns<FixedSlot> sieve_runs_for_this_machine();
template TestRuns<FloatSlot> test_runs_for_this_machine();
template TestRuns<FixedSlot> test_runs_for_this_machine();

#ifdef PADDER_AVX2
__attribute__((target_clones("avx2", "default")))
#endif
void to_normals(Batch& batch, int count) {
  for (int k = 0; k < count; k++) {
    const double x = batch.x[k], y = batch.y[k], z = batch.z[k];
    const double d = std::sqrt(x * x + y * y + z * z), per_d = 1 / d;
    batch.x[k] = d > 0 ? x * per_d : 1;
    batch.y[k] = d > 0 ? y * per_d : 0;
    batch.z[k] = d > 0 ? z * per_d : 0;
    batch.s[k] -= d;
  }
}

}  // namespace padder::detect::omp
