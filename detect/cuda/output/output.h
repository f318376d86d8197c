// SPDX-License-Identifier: MIT
// The list of contacts in device memory, and the part of a record that is computed in double. Internal; only
// .cu files include this.
#pragma once
#include <cstdint>

#include "detect/contact.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Where the contacts go. Contacts beyond `capacity` are counted but not written.
struct Output {
  Pair* pairs = nullptr;
  void* normals = nullptr;
  void* points = nullptr;
  std::uint64_t capacity = 0;
  Width width = Width::normals;
  Scalar scalar = Scalar::f32;
  friend bool operator==(const Output&, const Output&) = default;
};

// Computes normal, penetration and points in double and rounds them once. The caller writes the pair itself.
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

}  // namespace padder::detect::cuda
