// SPDX-License-Identifier: MIT
#include "detect/omp/batches.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "detect/omp/avx2.h"

namespace padder::detect::omp {
namespace {

#ifdef PADDER_AVX2
// The sphere in double.
__attribute__((target("avx2"))) inline __m256d wide(const FloatSlot& s) {
  return _mm256_cvtps_pd(_mm_loadu_ps(&s.x));
}
__attribute__((target("avx2"))) inline __m256d wide(const Sphere& s) { return _mm256_loadu_pd(&s.x); }
// Rows become columns.
__attribute__((target("avx2"))) inline void transpose(__m256d (&v)[4]) {
  const __m256d a = _mm256_unpacklo_pd(v[0], v[1]), b = _mm256_unpackhi_pd(v[0], v[1]),
                c = _mm256_unpacklo_pd(v[2], v[3]), d = _mm256_unpackhi_pd(v[2], v[3]);
  v[0] = _mm256_permute2f128_pd(a, c, 0x20), v[1] = _mm256_permute2f128_pd(b, d, 0x20);
  v[2] = _mm256_permute2f128_pd(a, c, 0x31), v[3] = _mm256_permute2f128_pd(b, d, 0x31);
}
template <class S>
__attribute__((target("avx2"))) void differences_avx2(const S* spheres, const std::uint32_t* i,
                                                      const std::uint32_t* j, std::uint32_t count,
                                                      Batch& out) {
  const __m256d minus = _mm256_setr_pd(-0.0, -0.0, -0.0, 0.0);  // a difference is a sum with -ci
  for (std::uint32_t k = 0; k < count; k += 4) {
    __m256d v[4];
    for (std::uint32_t q = 0; q < 4; q++)
      v[q] = _mm256_add_pd(wide(spheres[j[k + q]]), _mm256_xor_pd(wide(spheres[i[k + q]]), minus));
    transpose(v);
    _mm256_storeu_pd(out.x + k, v[0]), _mm256_storeu_pd(out.y + k, v[1]);
    _mm256_storeu_pd(out.z + k, v[2]), _mm256_storeu_pd(out.s + k, v[3]);
  }
}
__attribute__((target("avx2"))) inline void store(Normal<double>* to, __m256d v) {
  _mm256_storeu_pd(&to->x, v);
}
__attribute__((target("avx2"))) inline void store(Normal<float>* to, __m256d v) {
  _mm_storeu_ps(&to->x, _mm256_cvtpd_ps(v));
}
// Returns how many it wrote: a multiple of 4.
template <class T>
__attribute__((target("avx2"))) std::uint32_t copy_normals_avx2(const Batch& batch, std::uint32_t count,
                                                                Normal<T>* to) {
  std::uint32_t k = 0;
  for (; k + 4 <= count; k += 4) {
    __m256d v[4] = {_mm256_loadu_pd(batch.x + k), _mm256_loadu_pd(batch.y + k), _mm256_loadu_pd(batch.z + k),
                    _mm256_loadu_pd(batch.s + k)};
    transpose(v);
    for (std::uint32_t q = 0; q < 4; q++) store(to + k + q, v[q]);
  }
  return k;
}
#endif

}  // namespace

PADDER_CLONES void order_pairs(const std::uint32_t* a, const std::uint32_t* b, std::uint32_t count,
                               const std::uint32_t* ids, Pair* pairs, std::uint32_t* i, std::uint32_t* j) {
  for (std::uint32_t k = 0; k < count; k++) {
    // Without a branch, which would be mispredicted for every other pair.
    const std::uint32_t mine = ids[a[k]], other = ids[b[k]], swap = mine > other ? ~0u : 0;
    const std::uint32_t numbers = (mine ^ other) & swap, slots = (a[k] ^ b[k]) & swap;
    pairs[k] = {mine ^ numbers, other ^ numbers};
    i[k] = a[k] ^ slots, j[k] = b[k] ^ slots;
  }
}

template <class S>
void differences(const S* spheres, const std::uint32_t* i, const std::uint32_t* j, std::uint32_t count,
                 Batch& out) {
#ifdef PADDER_AVX2
  if (has_avx2()) return differences_avx2(spheres, i, j, count, out);
#endif
  for (std::uint32_t k = 0; k < count; k++) {
    const Sphere a = sphere_of(spheres[i[k]]), b = sphere_of(spheres[j[k]]);
    out.x[k] = b.x - a.x, out.y[k] = b.y - a.y, out.z[k] = b.z - a.z, out.s[k] = a.r + b.r;
  }
}
template void differences(const FloatSlot*, const std::uint32_t*, const std::uint32_t*, std::uint32_t,
                          Batch&);
template void differences(const Sphere*, const std::uint32_t*, const std::uint32_t*, std::uint32_t, Batch&);

template <class T>
void copy_normals(const Batch& batch, std::uint32_t count, Normal<T>* to) {
  std::uint32_t k = 0;
#ifdef PADDER_AVX2
  if (has_avx2()) k = copy_normals_avx2(batch, count, to);
#endif
  for (; k < count; k++)
    to[k] = {static_cast<T>(batch.x[k]), static_cast<T>(batch.y[k]), static_cast<T>(batch.z[k]),
             static_cast<T>(batch.s[k])};
}
template void copy_normals(const Batch&, std::uint32_t, Normal<float>*);
template void copy_normals(const Batch&, std::uint32_t, Normal<double>*);

namespace {
// True if some length is so small that its square has lost digits. Then nothing is written.
PADDER_CLONES bool to_normals_unscaled(Batch& batch, int count) {
  double square[kBatch];
  std::int64_t small = 0;  // as wide as a square, so that the compiler vectorises the loop
  for (int k = 0; k < count; k++) {
    const double x = batch.x[k], y = batch.y[k], z = batch.z[k];
    square[k] = x * x + y * y + z * z;
    small |= square[k] < kSmallSquare ? 1 : 0;
  }
  if (small != 0) return true;
  for (int k = 0; k < count; k++) {
    const double d = std::sqrt(square[k]), per_d = 1 / d;
    batch.x[k] *= per_d, batch.y[k] *= per_d, batch.z[k] *= per_d, batch.s[k] -= d;
  }
  return false;
}
}  // namespace
void to_normals(Batch& batch, int count) {
  if (!to_normals_unscaled(batch, count)) return;
  for (int k = 0; k < count; k++) {
    const Line l = line_of(batch.x[k], batch.y[k], batch.z[k]);
    const double per_d = l.length > 0 ? 1 / l.length : 0;
    batch.x[k] = l.length > 0 ? l.x * per_d : 1, batch.y[k] = l.y * per_d, batch.z[k] = l.z * per_d;
    batch.s[k] -= l.length * l.per_scale;
  }
}

PADDER_CLONES bool mark_touching(const Batch& batch, int count, double margin, std::int64_t* touch) {
  std::int64_t small = 0;
  for (int k = 0; k < count; k++) {
    const double x = batch.x[k], y = batch.y[k], z = batch.z[k], s = batch.s[k] + margin;
    touch[k] = x * x + y * y + z * z <= s * s ? 1 : 0;
    small |= s < kSmallSum ? 1 : 0;
  }
  return small == 0;
}

// As whole_below(), without a cast to an integer: AVX2 has none for 64 bits. Adding 1.5 * 2^52 and
// subtracting it again rounds a number below 2^51 to a whole one, and the low bits of the sum are those of
// the whole number.
namespace {
constexpr double kWhole = 0x1.8p52;
[[gnu::always_inline]] inline double whole_part(double v) {
  const double near = (v + kWhole) - kWhole;
  return near > v ? near - 1 : near;
}
[[gnu::always_inline]] inline std::uint32_t low_bits(double whole) {
  return static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(whole + kWhole));
}
// The bin of split().
[[gnu::always_inline]] inline double bin_number(double x, double size, double per_size) {
  const double below = whole_part(x * per_size), rest = x - below * size;
  return rest < 0 ? below - 1 : ((rest >= size) & (below != -1)) ? below + 1 : below;
}
}  // namespace
PADDER_CLONES void bin_numbers(const double* x, int count, const double* size, const double* per_size,
                               std::uint32_t* bins) {
  for (int k = 0; k < count; k++) bins[k] = low_bits(bin_number(x[k], size[k], per_size[k]));
}
PADDER_CLONES void fixed_points(const double* x, int count, const Level& level, std::int32_t* places) {
  const double size = level.size, per_size = level.per_size, units = level.units;
  for (int k = 0; k < count; k++) {
    const double bin = bin_number(x[k], size, per_size), rest = x[k] - bin * size;
    places[k] =
        static_cast<std::int32_t>((low_bits(bin) << kUnitBits) + low_bits(whole_part(rest * units + 0.5)));
  }
}

PADDER_CLONES void octaves_of(const double* x, const double* y, const double* z, const double* r, int count,
                              int top, std::int64_t* octaves) {
  for (int k = 0; k < count; k++) {
    const double need = need_of({x[k], y[k], z[k], r[k]});
    const std::int64_t below =
        top - (static_cast<std::int64_t>(std::bit_cast<std::uint64_t>(need) >> 52) - 1023);
    octaves[k] = below < 0 ? 0 : below < kOctaves ? below : kOctaves - 1;
  }
}

PADDER_CLONES bool widen(const double* x, int count, double& low, double& high) {
  constexpr int kSide = 8;  // lanes of their own, because a compiler may not reorder minima of doubles
  double lows[kSide], highs[kSide], bad[kSide];
  for (int j = 0; j < kSide; j++) lows[j] = low, highs[j] = high, bad[j] = 0;
  // A loop for each, which the compiler then makes vectors of. v - v is 0, or not a number.
  for (int k = 0; k < count; k += kSide)
    for (int j = 0; j < kSide; j++) lows[j] = x[k + j] < lows[j] ? x[k + j] : lows[j];
  for (int k = 0; k < count; k += kSide)
    for (int j = 0; j < kSide; j++) highs[j] = x[k + j] > highs[j] ? x[k + j] : highs[j];
  for (int k = 0; k < count; k += kSide)
    for (int j = 0; j < kSide; j++) bad[j] += x[k + j] - x[k + j];
  bool good = true;
  for (int j = 0; j < kSide; j++)
    low = std::min(low, lows[j]), high = std::max(high, highs[j]), good &= bad[j] == 0;
  return good && low >= -kLargest && high <= kLargest;
}

}  // namespace padder::detect::omp
