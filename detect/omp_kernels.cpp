#include "detect/omp_kernels.h"

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

template <class Slot>
__attribute__((target("avx2,popcnt"))) std::uint32_t test_runs_avx2(const Slots<Slot>& slots, const Slot& me,
                                                                    const Run* runs, int count,
                                                                    std::uint32_t* out, bool& doubt) {
  constexpr bool kFixed = std::is_same_v<Slot, FixedSlot>;
  const __m256 relative = _mm256_set1_ps(kRelativeBand), absolute = _mm256_set1_ps(kAbsoluteBand<Slot>);
  const __m256 positive = _mm256_castsi256_ps(_mm256_set1_epi32(0x7fffffff));
  const __m256 radius = _mm256_set1_ps(me.r);
  std::uint32_t n = 0, any = 0;
  for (int k = 0; k < count; k++)
    for (std::uint32_t b = runs[k].begin; b < runs[k].end; b += kLanes) {
      __m256 x, y, z;
      if constexpr (kFixed) {
        const auto apart = [&](const std::int32_t* p, std::int32_t from) __attribute__((target("avx2"))) {
          return _mm256_cvtepi32_ps(_mm256_sub_epi32(
              _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p + b)), _mm256_set1_epi32(from)));
        };
        x = apart(slots.x, me.x), y = apart(slots.y, me.y), z = apart(slots.z, me.z);
      } else {
        x = _mm256_sub_ps(_mm256_loadu_ps(slots.x + b), _mm256_set1_ps(me.x));
        y = _mm256_sub_ps(_mm256_loadu_ps(slots.y + b), _mm256_set1_ps(me.y));
        z = _mm256_sub_ps(_mm256_loadu_ps(slots.z + b), _mm256_set1_ps(me.z));
      }
      const __m256 s = _mm256_add_ps(_mm256_loadu_ps(slots.r + b), radius);
      const __m256 s2 = _mm256_mul_ps(s, s);
      const __m256 d2 =
          _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y)), _mm256_mul_ps(z, z));
      const __m256 excess = _mm256_sub_ps(d2, s2),
                   band = _mm256_add_ps(_mm256_mul_ps(relative, s2), absolute);
      const std::uint32_t left = runs[k].end - b, inside = left >= kLanes ? 255u : (1u << left) - 1;
      const auto hits =
          static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(excess, band, _CMP_LE_OQ))) & inside;
      any |= static_cast<std::uint32_t>(
                 _mm256_movemask_ps(_mm256_cmp_ps(_mm256_and_ps(excess, positive), band, _CMP_LE_OQ))) &
             inside;
      const __m128i packing = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(kPacking[hits].data()));
      const __m256i which =
          _mm256_add_epi32(_mm256_cvtepu8_epi32(packing), _mm256_set1_epi32(static_cast<std::int32_t>(b)));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + n),
                          which);  // lanes behind the hits are written over
      n += static_cast<std::uint32_t>(_mm_popcnt_u32(hits));
    }
  doubt = any != 0;
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
