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

// Functions that are compiled for AVX2 as well. Such clones are chosen before the runtime of the thread
// sanitizer is there.
#if defined(PADDER_AVX2) && !defined(__SANITIZE_THREAD__)
#define PADDER_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define PADDER_CLONES
#endif
