// SPDX-License-Identifier: MIT
// Arithmetic for host and device. What decides something is written once, with these functions. No header of
// CUDA is included here.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>

#if defined(__CUDACC__)
#define PADDER_HD __host__ __device__ __forceinline__
#else
#define PADDER_HD inline
#endif

namespace padder::detect {

// Double arithmetic with one rounding for each operation. A compiler may fuse a product and a sum into one
// operation (nvcc does by default, gcc where the processor can). Then the two backends could decide a pair at
// the threshold differently. So the device uses these intrinsics, and the sources for the host are compiled
// with -ffp-contract=off.
#if defined(__CUDA_ARCH__)
PADDER_HD double add(double a, double b) { return __dadd_rn(a, b); }
PADDER_HD double sub(double a, double b) { return __dsub_rn(a, b); }
PADDER_HD double mul(double a, double b) { return __dmul_rn(a, b); }
PADDER_HD double div(double a, double b) { return __ddiv_rn(a, b); }
PADDER_HD double root(double a) { return __dsqrt_rn(a); }
#else
PADDER_HD double add(double a, double b) { return a + b; }
PADDER_HD double sub(double a, double b) { return a - b; }
PADDER_HD double mul(double a, double b) { return a * b; }
PADDER_HD double div(double a, double b) { return a / b; }
PADDER_HD double root(double a) { return std::sqrt(a); }
#endif

PADDER_HD double larger(double a, double b) { return a > b ? a : b; }
PADDER_HD double smaller(double a, double b) { return a < b ? a : b; }
PADDER_HD double magnitude(double a) { return ::fabs(a); }

// floor(a) for |a| < 2^52. On a plain x86-64, std::floor is a function call, and a cast is not. A cast
// truncates towards zero, hence the correction.
PADDER_HD double whole_below(double a) {
#if defined(__CUDA_ARCH__)
  return ::floor(a);
#else
  const auto whole = static_cast<std::int64_t>(a);
  // Without a branch: it would often be mispredicted, as half of all coordinates are negative.
  return static_cast<double>(whole - (static_cast<double>(whole) > a));
#endif
}

// A hash of 64 bits: the output function of splitmix64 (Steele, Lea and Flood, Fast splittable pseudorandom
// number generators, 2014).
PADDER_HD std::uint64_t mixed(std::uint64_t z) {
  z += 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

}  // namespace padder::detect
