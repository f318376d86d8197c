// SPDX-License-Identifier: MIT
// The search over bins and the forward half of their neighbours, in spheres that stand in the order of their
// bins. Internal; only .cu files include this.
#pragma once
#include "detect/core/grid.h"
#include "detect/cuda/device_input.h"
#include "detect/cuda/order/order.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Where the contacts go, in device memory. Beyond `capacity` they are counted but not written.
struct Output {
  Pair* pairs = nullptr;
  void* normals = nullptr;
  void* points = nullptr;
  std::uint64_t capacity = 0;
  Width width = Width::normals;
  Scalar scalar = Scalar::f32;
  friend bool operator==(const Output&, const Output&) = default;
};

// The record in double, rounded once. The pair itself is written by the caller.
__device__ __forceinline__ void put_geometry(const Output& out, std::uint64_t at, const Sphere& i,
                                             const Sphere& j) {
  if (out.width == Width::pairs) return;
  const Geometry g = geometry(i, j);
  if (out.scalar == Scalar::f64) {
    static_cast<Normal<double>*>(out.normals)[at] = {g.normal[0], g.normal[1], g.normal[2], g.depth};
    auto* p = static_cast<double*>(out.points) + 6 * at;
    for (int k = 0; k < 3 && out.width == Width::points; k++) p[k] = g.on_i[k], p[3 + k] = g.on_j[k];
  } else {
    static_cast<float4*>(out.normals)[at] = make_float4(g.normal[0], g.normal[1], g.normal[2], g.depth);
    auto* p = static_cast<float*>(out.points) + 6 * at;
    for (int k = 0; k < 3 && out.width == Width::points; k++) p[k] = g.on_i[k], p[3 + k] = g.on_j[k];
  }
}

// Work space of the search for a list of fixed order. The caller makes `spill` longer when Counters::spilled
// says so, and searches again.
struct SearchMemory {
  explicit SearchMemory(MemoryBook& book)
      : sums(book, "the order of the list"),
        marks(book, "the order of the list"),
        spill(book, "the order of the list") {}
  Buffer<unsigned long long> sums, marks, spill;  // marks: as the last search left them
};
// Places of the list that a tile of spheres has to itself, and a unit that looks down of a 16th of a hit it
// is expected to find.
struct Share {
  std::uint32_t own = 0;
  float unit = 0;
  friend bool operator==(const Share&, const Share&) = default;
};
struct SearchOptions {
  bool exact = true, stable_order = true;
  Share share;  // share_for the list, for a fixed order
  Region own;
  bool owns_all = true;
  double radius = 0;  // of all spheres, for SlotKind::equal
  friend bool operator==(const SearchOptions&, const SearchOptions&) = default;
};
// The share decides the order of the list, and follows from the contacts alone: a list found with another
// share is not the one to hand out.
Share share_for(const Counters& found, std::uint32_t spheres, const Grid& grid, SlotKind kind);
// The caller sets the counters to zero first; afterwards they hold the number of contacts, whatever the
// capacity. `processors`: processors_of(stream); the list does not depend on it.
void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, SearchMemory& memory, int processors,
            cudaStream_t stream);

}  // namespace padder::detect::cuda
