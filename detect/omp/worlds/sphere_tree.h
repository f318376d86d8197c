// SPDX-License-Identifier: MIT
// A wide tree (detect/core/wide_tree.h) in the memory of the OpenMP backend. Internal.
#pragma once
#include "detect/core/wide_tree.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

// The part of space along which spheres are to be ordered: from quantiles of some of the centres. `count`: at
// least 1.
CurveBox curve_box(const Sphere* spheres, std::uint32_t count);

class SphereTree {
 public:
  explicit SphereTree(Budget& b) : groups_(b) {}

  void build(const Sphere* spheres, std::uint32_t count, int threads);
  const WideTree* operator->() const { return &tree_; }

 private:
  WideTree tree_;
  Buffer<BoxGroup> groups_;
};

}  // namespace padder::detect::omp
