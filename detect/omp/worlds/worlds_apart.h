// SPDX-License-Identifier: MIT
// Loose spheres of many worlds, without bodies, on the CPU: the grid path searches them as if the worlds lay
// side by side, a little farther than asked for. What it finds is decided, and records are written, by the
// spheres as they are given. Internal.
#pragma once
#include "detect/core/side_by_side.h"
#include "detect/omp/paths.h"

namespace padder::detect::omp {

class WorldsApart {
 public:
  explicit WorldsApart(Budget& b);

  // Writes all contacts to `records`. False, and nothing was searched: there is a region, or a sphere of
  // kEveryWorld, or with a fault, or worlds would take so much space that doubles could not tell their
  // spheres apart well. Throws Error.
  template <class T>
  bool run(const View<T>& spheres, const CallOptions& options, int threads, Records& records,
           Contacts& contacts);

 private:
  template <class T>
  void write(const View<T>& spheres, const CallOptions& options, int threads, Records& records) const;

  Buffer<Sphere> moved_;
  GridPath grid_path_;
  Records found_;
};

}  // namespace padder::detect::omp
