// SPDX-License-Identifier: MIT
// Arithmetic in double over batches of numbers: records of contacts, bin numbers, bounds. Plain C++ loops
// that the compiler makes vectors of, and a few for AVX2; the results are the same. Internal.
#pragma once
#include <cstdint>

#include "detect/detector.h"
#include "detect/omp/slots.h"

namespace padder::detect::omp {

// The contacts of a batch of hits: those of slots a[k] and b[k], with the numbers `ids` of their spheres.
// Writes the numbers, the smaller first, and the slots in the same order.
void order_pairs(const std::uint32_t* a, const std::uint32_t* b, std::uint32_t count,
                 const std::uint32_t* ids, Pair* pairs, std::uint32_t* i, std::uint32_t* j);

// Up to kBatch pairs: the differences of their centres and the sums of their radii, from which to_normals()
// makes normals and penetrations. These are those of geometry() in contact.h, bit for bit.
inline constexpr std::uint32_t kBatch = 256;
struct Batch {
  double x[kBatch], y[kBatch], z[kBatch],
      s[kBatch];  // cj - ci and ri + rj; then the normal and the penetration
};
// For the spheres i[k] and j[k]. Entries after `count`, up to a multiple of 4, must be numbers of spheres,
// too.
template <class S>
void differences(const S* spheres, const std::uint32_t* i, const std::uint32_t* j, std::uint32_t count,
                 Batch& out);
void to_normals(Batch& batch, int count);
// Sets touch[k] to 1 where the pair touches (touching() in contact.h), else to 0. False if some sum of radii
// is so small that this does not tell it.
bool mark_touching(const Batch& batch, int count, double margin, std::int64_t* touch);
template <class T>
void copy_normals(const Batch& batch, std::uint32_t count, Normal<T>* to);

// For up to kBatch coordinates along an axis, each with the edge of its bins: the bin numbers of split() in
// grid.h, modulo 2^32.
void bin_numbers(const double* x, int count, const double* size, const double* per_size, std::uint32_t* bins);
// For up to kBatch coordinates along an axis of the level: fixed_point_of() in grid.h.
void fixed_points(const double* x, int count, const Level& level, std::int32_t* places);
// The octaves of `count` spheres, as octave_of() in grid.h has them.
void octaves_of(const double* x, const double* y, const double* z, const double* r, int count, int top,
                std::int64_t* octaves);
// Widens `low` and `high` by `count` numbers, a multiple of 8. False if one of them is not a number, or
// larger than kLargest in magnitude; then low and high mean nothing.
bool widen(const double* x, int count, double& low, double& high);

}  // namespace padder::detect::omp
