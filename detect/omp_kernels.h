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

// Writes the slots of `runs` that the filter does not call apart from `me` to `out`, in order; room for all
// of them and kLanes more. Gives their number; sets `doubt` when any of them is inside the band.
template <class Slot>
using TestRuns = std::uint32_t (*)(const Slots<Slot>& slots, const Slot& me, const Run* runs, int count,
                                   std::uint32_t* out, bool& doubt);
template <class Slot>
TestRuns<Slot> test_runs_for_this_machine();

// A box of centres: half its edges about the position of `from`, whose r is the largest radius inside, and a
// length that makes the sieve generous. All in the units of the slots.
template <class Slot>
struct Block {
  Slot from = {};
  float half[3] = {}, slack = 0;
};
// Writes the slots of `runs` that may touch a sphere of the block to `out`; room for all of them and kLanes
// more. Only a first sieve: it may let through too many, never too few.
template <class Slot>
using SieveRuns = std::uint32_t (*)(const Slots<Slot>& slots, const Block<Slot>& block, const Run* runs,
                                    int count, std::uint32_t* out);
template <class Slot>
SieveRuns<Slot> sieve_runs_for_this_machine();

// Differences and sums of radii of up to kBatch pairs to normals and depths: geometry() of contact.h, bit for
// bit.
inline constexpr int kBatch = 256;
struct Batch {
  double x[kBatch], y[kBatch], z[kBatch], s[kBatch];  // in: cj - ci, ri + rj; out: normal, depth
};
void to_normals(Batch& batch, int count);

}  // namespace padder::detect::omp
