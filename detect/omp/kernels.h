// SPDX-License-Identifier: MIT
// The inner loops of the fast path on the CPU, for the instructions this machine has; internal.
#pragma once
#include <cstdint>
#include <type_traits>

#include "detect/contact.h"
#include "detect/detector.h"

namespace padder::detect::omp {

inline constexpr std::uint32_t kLanes =
    8;  // spheres tested at once; arrays of slots are this much longer than N

// Slots as four arrays: a run of candidates is read in whole vectors.
template <class Slot>
struct Slots {
  using Component = std::conditional_t<std::is_same_v<Slot, FloatSlot>, float, std::int32_t>;
  Component *x, *y, *z;
  float* r;
  Slot operator[](std::uint64_t k) const { return {x[k], y[k], z[k], r[k]}; }
  void set(std::uint64_t k, const Slot& s) const { x[k] = s.x, y[k] = s.y, z[k] = s.z, r[k] = s.r; }
};

struct Run {
  std::uint32_t begin, end;
};

// A ball over the bins of a dense level: centre and radius in bins, counted from the low corner of the bin at
// `key`, and the bins to look at, counted likewise.
struct Ball {
  float x, y, z, radius;
  int x_low, x_high, y_low, y_high, z_low, z_high;
  std::uint32_t key, row, plane;  // keys from the level's first; from one row to the next in y, in z
};

// What is there for this machine and in plain C++: the same results.
template <class Slot>
struct Kernels {
  // Writes the slots of `runs` that the filter does not call apart from `me` to `out`, in order; room for all
  // of them and kLanes more. Gives their number; sets `doubt` when any of them is inside the band, or a slot
  // beside them.
  std::uint32_t (*test_runs)(const Slots<Slot>& slots, const Slot& me, const Run* runs, int count,
                             std::uint32_t* out, bool& doubt);
  // Writes the runs of the rows that the ball crosses to `out`, empty ones left out, by z, then y; room for
  // all rows and kLanes more. Gives their number. Less than 2^31 keys.
  int (*find_rows)(const Ball& ball, const std::uint32_t* starts, Run* out);
  // Pairs of the sphere of slot a and those of hits[0 to count - 1]: their numbers, the smaller first, and
  // their slots in that order. Room for count and kLanes more.
  void (*order_pairs)(std::uint32_t a, const std::uint32_t* hits, int count, const std::uint32_t* ids,
                      Pair* pairs, std::uint32_t* i, std::uint32_t* j);
};
template <class Slot>
Kernels<Slot> plain_kernels();
template <class Slot>
Kernels<Slot> kernels_for_this_machine();

// Differences and sums of radii of up to kBatch pairs, and from these normals and depths: geometry() of
// contact.h, bit for bit.
inline constexpr std::uint32_t kBatch = 256;
struct Batch {
  double x[kBatch], y[kBatch], z[kBatch], s[kBatch];  // cj - ci, ri + rj; then normal, depth
};
// Of slots i[k], j[k]; the exact spheres of fixed-point slots lie beside them.
void differences(const Slots<FloatSlot>& slots, const Sphere*, const std::uint32_t* i, const std::uint32_t* j,
                 int count, Batch& out);
void differences(const Slots<FixedPointSlot>&, const Sphere* spheres, const std::uint32_t* i,
                 const std::uint32_t* j, int count, Batch& out);
void to_normals(Batch& batch, int count);

}  // namespace padder::detect::omp
