// SPDX-License-Identifier: MIT
// Does the compiler know AVX2, and has the machine it? Internal; only .cpp files include this.
#pragma once
#if defined(__x86_64__) && defined(__GNUC__)
#define PADDER_AVX2 1
#include <immintrin.h>

namespace padder::detect::omp {

inline bool has_avx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt"); }

}  // namespace padder::detect::omp
#endif
