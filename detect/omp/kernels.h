// SPDX-License-Identifier: MIT
// The inner loops of the grid path on the CPU, in plain C++ and for the vector instructions that the machine
// has. Both give the same results. Internal.
#pragma once
#include <cstdint>
#include <type_traits>

#include "detect/contact.h"
#include "detect/core/grid.h"
#include "detect/detector.h"

namespace padder::detect::omp {

// Spheres that are tested at once. Arrays of slots are longer than the number of spheres by this much.
inline constexpr std::uint32_t kLanes = 8;

// Slots as four arrays, so that a run of candidates is read in whole vectors.
template <class Slot>
struct Slots {
  using Component = std::conditional_t<std::is_same_v<Slot, FloatSlot>, float, std::int32_t>;
  Component *x, *y, *z;
  float* r;
  Slot operator[](std::uint64_t k) const { return {x[k], y[k], z[k], r[k]}; }
  void set(std::uint64_t k, const Slot& s) const { x[k] = s.x, y[k] = s.y, z[k] = s.z, r[k] = s.r; }
};

// The spheres of slots as the caller gave them: float slots are that themselves.
template <class Slot>
using Exact = std::conditional_t<std::is_same_v<Slot, FloatSlot>, FloatSlot, Sphere>;
inline Sphere sphere_of(const FloatSlot& s) { return {s.x, s.y, s.z, s.r}; }
inline Sphere sphere_of(const Sphere& s) { return s; }

// Consecutive slots, from begin to end - 1.
struct Run {
  std::uint32_t begin, end;
};

// The bins of a level, as its own spheres search them: the rest of a sphere's bin and the forward half of the
// bins around it. That is the rest of its row, the next row in y, and three rows of the next layer in z.
template <class Slot>
struct Bins {
  Slots<Slot> slots;
  const Exact<Slot>* spheres;          // of the slots
  const std::uint32_t *keys, *starts;  // the key of each slot; the first slot of each key
  std::uint32_t row, plane;            // steps of the key from a bin to the next in y, and in z
  std::uint32_t last_key;              // beyond this key the forward half does not lie behind the bin
  float grown_by;                      // how much larger the radius of a sphere that searches counts
};
struct Searched {
  std::uint32_t spheres, hits;  // how many
  bool doubt;                   // may any hit be one that float cannot decide?
};
// A sphere that searches so many runs of its own; `a`: its slot.
template <class Slot>
struct RunSearch {
  Slot me;
  std::uint32_t a;
  int runs;
};
// Where hits go: pairs of slots that the float test does not call apart, each slot in its list.
struct HitLists {
  std::uint32_t *a, *b;
};

// A ball over the bins of a dense level. Its centre and radius are in bins, relative to the low corner of the
// bin of its centre. So are the bins to search, x_low to x_high and so on.
struct Ball {
  float x, y, z, radius;
  int x_low, x_high, y_low, y_high, z_low, z_high;
  std::uint32_t key;         // of the bin of the centre, relative to the first key of the level
  std::uint32_t row, plane;  // steps of the key from a row to the next in y, and in z
};

// The forward half of the bins around the bin of slot a, without a bin's spheres up to a. Returns how many
// candidates there are.
inline constexpr int kForwardRuns = 5;
inline constexpr std::uint32_t kFewCandidates = 12;
template <class Slot>
inline std::uint32_t forward_runs(const Bins<Slot>& bins, std::uint32_t key, std::uint32_t a, Run* runs) {
  const std::uint32_t rows[] = {key + bins.row, key + bins.plane - bins.row, key + bins.plane,
                                key + bins.plane + bins.row};
  runs[0] = {a + 1, bins.starts[key + 2]};
  std::uint32_t candidates = runs[0].end - runs[0].begin;
  for (int k = 1; k < kForwardRuns; k++) {
    runs[k] = {bins.starts[rows[k - 1] - 1], bins.starts[rows[k - 1] + 2]};
    candidates += runs[k].end - runs[k].begin;
  }
  return candidates;
}

// The loops of one implementation.
template <class Slot>
struct Kernels {
  // Writes to `out` the slots of `runs` that the float test does not call apart from `me`, in order. There
  // must be room for all slots and kLanes more. Returns how many they are. Sets `doubt` if a slot is in the
  // float band; slots right after a run may set it, too.
  std::uint32_t (*test_runs)(const Slots<Slot>& slots, const Slot& me, const Run* runs, int count,
                             std::uint32_t* out, bool& doubt);
  // The same for several spheres, whose runs follow each other. Writes each hit with the sphere that
  // searched.
  Searched (*test_searches)(const Slots<Slot>& slots, const RunSearch<Slot>* searches, std::uint32_t count,
                            const Run* runs, const HitLists& out);
  // Tests the spheres of slots `first` to `last` - 1, one after the other. Writes each hit with the sphere
  // that searched first. Ends before a sphere beyond last_key or with more candidates than there is room for:
  // `room` in all. There must be room for kLanes more.
  Searched (*test_bins)(const Bins<Slot>& bins, std::uint32_t first, std::uint32_t last, const HitLists& out,
                        std::uint32_t room);
  // The same, faster where spheres have fewer than kFewCandidates candidates on average.
  Searched (*test_sparse_bins)(const Bins<Slot>& bins, std::uint32_t first, std::uint32_t last,
                               const HitLists& out, std::uint32_t room);
  // Writes to `out` the runs of the rows of bins that the ball crosses, without empty ones, ordered by z and
  // then y. There must be room for all rows and kLanes more, and fewer than 2^31 keys. Returns how many runs
  // there are.
  int (*find_rows)(const Ball& ball, const std::uint32_t* starts, Run* out);
};
template <class Slot>
Kernels<Slot> plain_kernels();
template <class Slot>
Kernels<Slot> kernels_for_this_machine();

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
