// SPDX-License-Identifier: MIT
// The search for contacts among spheres that stand in the order of their bins: each with its own bin, the
// forward half of the bins around and, where there are several levels, the bins of the others. Internal; only
// .cu files include this.
#pragma once
#include "detect/core/grid.h"
#include "detect/cuda/order/order.h"
#include "detect/cuda/output/stable_output.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

struct SearchOptions {
  bool exact = true, stable_order = true;
  SlotQuota quota;  // quota_for() the list, for a stable order
  Region own;       // contacts whose midpoint lies elsewhere are left out, unless owns_all
  bool owns_all = true;
  double owner_band = 0;  // owner_band() of the spheres; infinite: by slots nobody knows
  double radius = 0;      // of all spheres, for SlotKind::equal
  double margin = 0;      // CallOptions::margin; Level::grown_by is half of it or more
  // Long rows go to a list (long_rows.h) with room for so many parts. Where they are more, the caller makes
  // the room larger and searches again; the other contacts alone are counted then.
  bool defers = false;
  std::uint64_t long_rows = 0;
  friend bool operator==(const SearchOptions&, const SearchOptions&) = default;
};

// The quota for a list of which `found` was counted. It decides the order of the list and follows from the
// contacts alone: a list that was found with another quota is not the one to hand out.
SlotQuota quota_for(const Counters& found, std::uint32_t spheres, const Grid& grid, SlotKind kind);

// The caller sets the counters to zero first. Afterwards they hold the number of contacts, whatever the
// capacity of `output`. `processors`: processors_of(stream); the list does not depend on it. Throws Error.
void search(const DeviceSpheres& source, const Grid& grid, const Ordered& spheres,
            const SearchOptions& options, const Output& output, Counters* counters, SearchMemory& memory,
            int processors, cudaStream_t stream);

}  // namespace padder::detect::cuda
