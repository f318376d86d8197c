// SPDX-License-Identifier: MIT
// The tests of candidates on the CPU, in plain C++ and for the vector instructions that the machine has. Both
// give the same results. Internal.
#pragma once
#include <cstdint>

#include "detect/omp/slots.h"

namespace padder::detect::omp {

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

}  // namespace padder::detect::omp
