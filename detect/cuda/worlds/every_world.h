// SPDX-License-Identifier: MIT
// Contacts of spheres of kEveryWorld with those of all other worlds, where the worlds lie side by side:
// each of the others walks over a tree of them. Only .cu files include this.
#pragma once
#include "detect/core/wide_tree.h"
#include "detect/cuda/call/call.h"

namespace padder::detect::cuda {

// What the kernels work on.
struct EveryWorldTask {
  DeviceSpheres source;  // its world: of all spheres
  double margin = 0;
  Region own;  // contacts whose midpoint lies elsewhere are left out
  double radius_max = 0;
  std::uint32_t every = 0;                 // spheres of kEveryWorld
  WideTree tree;                           // of these
  const Sphere* spheres = nullptr;         // in the order of the tree
  const std::uint32_t* numbers = nullptr;  // of them
  const Filter* filters = nullptr;
  std::uint32_t* counts = nullptr;        // of each sphere, its contacts with them
  unsigned long long* offsets = nullptr;  // the contacts before these
};

class EveryWorld {
 public:
  explicit EveryWorld(MemoryBook& book);

  // Enqueues the count of the contacts; `every`: how many spheres are of kEveryWorld, at least one. No radius
  // is larger than radius_max. Throws Error.
  void count(const DeviceSpheres& source, std::uint64_t every, double radius_max, const CallOptions& options,
             cudaStream_t stream);
  // The contacts. Waits for the device.
  std::uint64_t counted(cudaStream_t stream);
  // Enqueues the contacts, in an order that follows from the input, to the places of `output` from `first`
  // on.
  void write(const Output& output, std::uint64_t first, cudaStream_t stream) const;

 private:
  void order(const DeviceSpheres& source, std::uint32_t every, cudaStream_t stream);

  EveryWorldTask task_;
  Buffer<std::uint32_t> numbers_, spare_numbers_, counts_;
  Buffer<std::uint64_t> curve_, spare_curve_;
  Buffer<CurveBox> curve_box_;
  Buffer<Sphere> spheres_;
  Buffer<Filter> filters_;
  Buffer<BoxGroup> groups_;
  Buffer<unsigned long long> offsets_, total_;
  Buffer<unsigned char> scratch_;
};

}  // namespace padder::detect::cuda
