// SPDX-License-Identifier: MIT
// What one pass over the device counts and reports to the host. Internal; only .cu files include this.
#pragma once
#include <cstdint>

namespace padder::detect::cuda {

struct Counters {
  unsigned long long contacts, doubtful, spilled;
  unsigned long long own;        // contacts within a level, for a stable order
  unsigned long long expected;   // 16ths of contacts that units were expected to find (unit_quotas.cu)
  unsigned long long long_rows;  // parts of long rows (search/long_rows.h)
  unsigned long long deferred;   // contacts of these, in a stable order
  std::uint32_t flags;           // set by Orderer, cleared by its caller
};
// Counters::flags. Crowded: a bin or bucket is too full for the method. Outside: a sphere lies outside the
// bins, which were chosen for other spheres. Outgrown: a bucket has outgrown the room that it got by the
// previous call (OrderRequest::keep).
enum : std::uint32_t { kCrowded = 1, kOutside = 2, kOutgrown = 4 };

}  // namespace padder::detect::cuda
