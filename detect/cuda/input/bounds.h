// SPDX-License-Identifier: MIT
// Bounds of spheres, gathered on the device: words whose order as integers is that of the numbers they stand
// for, and what a thread and a block gather before they touch the words that all blocks share. Only .cu files
// include this.
#pragma once
#include "detect/core/grid.h"

namespace padder::detect::cuda {

// A double as an unsigned integer, so that the order stays: for atomic minima and maxima. And back.
__host__ __device__ inline unsigned long long ordered(double v) {
  unsigned long long b;
  memcpy(&b, &v, 8);
  return b >> 63 ? ~b : b | 1ull << 63;
}
__host__ __device__ inline double unordered(unsigned long long b) {
  b = b >> 63 ? b & ~(1ull << 63) : ~b;
  double v;
  memcpy(&v, &b, 8);
  return v;
}

// The same for a float. And back.
__host__ __device__ inline std::uint32_t rank_of(float f) {
  std::uint32_t b;
  memcpy(&b, &f, 4);
  return b >> 31 ? ~b : b | 0x80000000u;
}
__host__ __device__ inline float of_rank(std::uint32_t b) {
  b = b >> 31 ? b & 0x7fffffffu : ~b;
  float f;
  memcpy(&f, &b, 4);
  return f;
}

// exponent_of(need_of()) of a float sphere, by its bits. 2 r (1 + 2^-20) has the exponent of 2 r, or one more
// where r has a mantissa of more than 2 - 2^-19.
__host__ __device__ inline int need_exponent(float x, float y, float z, float r) {
  const float m = fmaxf(fmaxf(fabsf(x), fabsf(y)), fabsf(z));
  std::uint32_t of_m, of_r;
  memcpy(&of_m, &m, 4), memcpy(&of_r, &r, 4);
  if (of_m < 0x00800000u || of_r < 0x00800000u) return exponent_of(need_of({x, y, z, r}));
  const int far = static_cast<int>(of_m >> 23) - 127 - 42,
            near = static_cast<int>(of_r >> 23) - 126 + ((of_r & 0x7fffffu) > 0x7ffff0u);
  return near > far ? near : far;
}

// Words of the bounds, in this order.
enum {
  kLow = 0,
  kRadiusMin = 3,
  kFault = 4,
  kHigh = 5,
  kRadiusMax = 8,
  kNeedMax = 9,
  kExtent = 10,
  kBounds = 11
};
// Bounds of float spheres, gathered by a kernel that reads the spheres anyway. Each thread takes spheres;
// then all threads of the block together give what they have.
struct Bounds {
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY},
        r_min = INFINITY, r_max = 0;
  std::uint32_t fault = ~0u;
  static __device__ __forceinline__ unsigned long long nothing(std::uint32_t word) {
    return word <= kFault ? ~0ull : 0;
  }
  __device__ __forceinline__ void take(const Sphere& s, std::uint32_t k) {
    const auto x = static_cast<float>(s.x), y = static_cast<float>(s.y), z = static_cast<float>(s.z),
               r = static_cast<float>(s.r);
    const float nought = (x - x) + (y - y) + (z - z) + (r - r);  // not a number unless all are finite
    if (!(nought == 0 && r >= 0)) fault = min(fault, k);
    low[0] = fminf(low[0], x), low[1] = fminf(low[1], y), low[2] = fminf(low[2], z);
    high[0] = fmaxf(high[0], x), high[1] = fmaxf(high[1], y), high[2] = fmaxf(high[2], z);
    r_min = fminf(r_min, r), r_max = fmaxf(r_max, r);
  }
  // Does not note the number of a faulty sphere. A coordinate that is not a number then stands in `high`, a
  // radius in r_max.
  __device__ __forceinline__ void take_quickly(float x, float y, float z, float r) {
    low[0] = fminf(low[0], x), low[1] = fminf(low[1], y), low[2] = fminf(low[2], z), r_min = fminf(r_min, r);
    const auto larger_or_none = [](float& a, float b) { asm("max.NaN.f32 %0, %0, %1;" : "+f"(a) : "f"(b)); };
    larger_or_none(high[0], x), larger_or_none(high[1], y), larger_or_none(high[2], z);
    larger_or_none(r_max, r);
  }
  template <bool AskFirst = true>
  __device__ __forceinline__ void give(unsigned long long* out) const {
    const float minima[4] = {low[0], low[1], low[2], r_min}, maxima[4] = {high[0], high[1], high[2], r_max};
    const auto value = [](std::uint32_t b) { return ordered(static_cast<double>(of_rank(b))); };
    __shared__ std::uint32_t all[9];
    if (threadIdx.x < 9) all[threadIdx.x] = threadIdx.x < 4 || threadIdx.x == 8 ? ~0u : 0;
    __syncthreads();
    const bool first = (threadIdx.x & 31) == 0;
#pragma unroll
    for (int k = 0; k < 4; k++) {
      const std::uint32_t l = __reduce_min_sync(~0u, rank_of(minima[k])),
                          h = __reduce_max_sync(~0u, rank_of(maxima[k]));
      if (first) atomicMin(all + k, l), atomicMax(all + 4 + k, h);
    }
    const std::uint32_t f = __reduce_min_sync(~0u, fault);
    if (first && f != ~0u) atomicMin(all + 8, f);
    __syncthreads();
    // All blocks share a few words. Reading a word first spares nearly every atomic operation on it, but the
    // thread must wait for what it reads.
    const std::uint32_t k = threadIdx.x;
    if (k < 4) {
      const unsigned long long l = value(all[k]);
      if (!AskFirst || l < *static_cast<volatile unsigned long long*>(out + kLow + k))
        atomicMin(out + kLow + k, l);
    } else if (k < 8) {
      const unsigned long long h = value(all[k]);
      if (!AskFirst || h > *static_cast<volatile unsigned long long*>(out + kHigh + k - 4))
        atomicMax(out + kHigh + k - 4, h);
    } else if (k == 8 && all[8] != ~0u) {
      atomicMin(out + kFault, static_cast<unsigned long long>(all[8]));
    }
  }
};

// Bounds of each octave of size below the exponent `top`, in shared memory. All threads of the block call
// begin() and give(), with barriers around.
struct OctaveBounds {
  // What is given of each: low x, y, z as minima; high x, y, z, radius, need as maxima; the count.
  static constexpr int kWords = 9;
  std::uint32_t v[kOctaves][8];  // ranks of low x, y, z; of high x, y, z, radius; the count
  static __device__ __forceinline__ unsigned long long nothing(std::uint32_t word) {
    return word % kWords < 3 ? ~0ull : 0;
  }
  __device__ __forceinline__ void begin() {
    for (std::uint32_t k = threadIdx.x; k < kOctaves * 8; k += blockDim.x)
      v[k / 8][k % 8] = k % 8 < 3 ? ~0u : 0;
  }
  __device__ __forceinline__ void take(int octave, const float (&low)[3], const float (&high)[4],
                                       std::uint32_t count) {
    std::uint32_t* const o = v[octave];
#pragma unroll
    for (int c = 0; c < 3; c++) atomicMin(o + c, rank_of(low[c]));
#pragma unroll
    for (int c = 0; c < 4; c++) atomicMax(o + 3 + c, rank_of(high[c]));
    atomicAdd(o + 7, count);
  }
  // The largest need follows from the largest radius and coordinate.
  __device__ __forceinline__ void give(unsigned long long* out) const {
    for (std::uint32_t k = threadIdx.x; k < kOctaves; k += blockDim.x) {
      const std::uint32_t count = v[k][7];
      if (count == 0) continue;
      unsigned long long* const o = out + k * kWords;
      double most = 0;
      const double r = of_rank(v[k][6]);
      for (int c = 0; c < 3; c++) {
        const double low = of_rank(v[k][c]), high = of_rank(v[k][3 + c]);
        atomicMin(o + c, ordered(low)), atomicMax(o + 3 + c, ordered(high));
        most = larger(most, larger(magnitude(low), magnitude(high)));
      }
      atomicMax(o + 6, ordered(r)), atomicMax(o + 7, ordered(need_of({most, 0, 0, r})));
      atomicAdd(o + 8, static_cast<unsigned long long>(count));
    }
  }
};
// One thread's part in OctaveBounds. Registers hold the bounds of two neighbouring octaves: those of most of
// the warp's first spheres. Spheres of other octaves go to shared memory one by one. All lanes of a warp call
// begin() and give().
class OctaveTaker {
 public:
  // With what it will take first, if that is a sphere.
  __device__ __forceinline__ void begin(int top, const float4& s, bool valid) {
    const int octave = valid ? octave_of(top, s) : -1;
    std::uint32_t rest = __ballot_sync(~0u, valid);
    for (int most = 0; rest;) {
      const int fine = __shfl_sync(~0u, octave, __ffs(static_cast<int>(rest)) - 1);
      const std::uint32_t here = __ballot_sync(~0u, octave == fine),
                          coarser = __ballot_sync(~0u, valid && octave == fine - 1);
      if (const int count = __popc(here | coarser); count > most) most = count, fine_ = fine;
      rest &= ~here;
    }
  }
  __device__ __forceinline__ void take(OctaveBounds& all, int top, const float4& s) {
    const int octave = octave_of(top, s);
#pragma unroll
    for (int k = 0; k < 2; k++) {
      const bool in = octave == fine_ - k;
      if (k == 1 && !__any_sync(__activemask(), in)) continue;
      const float x[4] = {s.x, s.y, s.z, s.w};
#pragma unroll
      for (int c = 0; c < 3; c++) low_[k][c] = fminf(low_[k][c], in ? x[c] : INFINITY);
#pragma unroll
      for (int c = 0; c < 4; c++) high_[k][c] = fmaxf(high_[k][c], in ? x[c] : -INFINITY);
      count_[k] += in;
    }
    if (octave != fine_ && octave != fine_ - 1) all.take(octave, {s.x, s.y, s.z}, {s.x, s.y, s.z, s.w}, 1);
  }
  __device__ __forceinline__ void give(OctaveBounds& all) const {
#pragma unroll
    for (int k = 0; k < 2; k++) {
      const std::uint32_t count = __reduce_add_sync(~0u, count_[k]);
      if (count == 0) continue;
      float low[3], high[4];
#pragma unroll
      for (int c = 0; c < 3; c++) low[c] = of_rank(__reduce_min_sync(~0u, rank_of(low_[k][c])));
#pragma unroll
      for (int c = 0; c < 4; c++) high[c] = of_rank(__reduce_max_sync(~0u, rank_of(high_[k][c])));
      if ((threadIdx.x & 31) == 0) all.take(fine_ - k, low, high, count);
    }
  }

 private:
  static __device__ __forceinline__ int octave_of(int top, const float4& s) {
    return octave_of_exponent(top, need_exponent(s.x, s.y, s.z, s.w));
  }
  int fine_ = -1;
  float low_[2][3] = {{INFINITY, INFINITY, INFINITY}, {INFINITY, INFINITY, INFINITY}},
        high_[2][4] = {{-INFINITY, -INFINITY, -INFINITY, -INFINITY},
                       {-INFINITY, -INFINITY, -INFINITY, -INFINITY}};
  std::uint32_t count_[2] = {};
};

// Where a kernel that reads all spheres is to write their bounds, and those of the octaves below the exponent
// `top`. Null: not asked for.
struct Gather {
  unsigned long long *bounds = nullptr, *octaves = nullptr;
  int top = 0;
  static constexpr std::uint32_t kWords = kOctaves * OctaveBounds::kWords;
  // By `threads` threads, of which this is number `thread`.
  __device__ __forceinline__ void begin(std::uint32_t thread, std::uint32_t threads) const {
    for (std::uint32_t k = thread; k < kBounds; k += threads) bounds[k] = Bounds::nothing(k);
    for (std::uint32_t k = thread; octaves && k < kWords; k += threads) octaves[k] = OctaveBounds::nothing(k);
  }
};

}  // namespace padder::detect::cuda
