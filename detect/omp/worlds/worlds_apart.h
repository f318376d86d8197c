// SPDX-License-Identifier: MIT
// Spheres of many worlds, loose ones and those of bodies that have been placed, on the CPU: the grid path
// searches them as if the worlds lay side by side, a little farther than asked for. Spheres of kEveryWorld
// lie in a box of their own there, and a tree finds those that touch spheres of other worlds. What is found
// is decided, and records are written, by the spheres as they are given. Internal.
#pragma once
#include "detect/core/side_by_side.h"
#include "detect/omp/parts.h"
#include "detect/omp/worlds/sphere_tree.h"

namespace padder::detect::omp {

class WorldsApart {
 public:
  explicit WorldsApart(Budget& b);

  // Writes all contacts to `records`. False, and nothing was searched: there is a sphere with a fault, or
  // worlds would take so much space that doubles could not tell their spheres apart well. Throws Error.
  template <class T>
  bool run(const View<T>& spheres, const CallOptions& options, int threads, Records& records,
           Contacts& contacts);

 private:
  template <class T>
  void build_tree(const View<T>& spheres, std::uint64_t count, int threads);
  template <class T>
  void find_hits(const View<T>& spheres, const CallOptions& options, int threads);

  Buffer<Sphere> moved_;
  GridPath grid_path_;
  Records found_;
  // The spheres of kEveryWorld in the order of the tree.
  std::vector<std::uint32_t> every_;
  Buffer<Sphere> every_spheres_;
  SphereTree tree_;
  PartLists<Pair> hits_;
};

}  // namespace padder::detect::omp
