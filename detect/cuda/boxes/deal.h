// SPDX-License-Identifier: MIT
// Deals the spheres on one GPU out to the boxes of all: counts them, and copies them box by box in their
// order. Internal; only .cu files include this.
#pragma once
#include <vector>

#include "detect/boxes/cut.h"
#include "detect/boxes/resident_detector.h"
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// The boxes, one for each GPU; passed to kernels by value.
struct DealRegions {
  int count = 0;
  Region of[kMostResidentDevices];
};

// What a count found.
struct DealCounts {
  std::uint64_t to[kMostResidentDevices] = {};  // spheres for each box
  double largest_radius = 0;                    // of the spheres here
  std::uint64_t faulty = ~std::uint64_t(0);     // the first sphere that fault_of() refuses, if any
};

// Where the spheres of a box go: arrays on this GPU. Null: there is no such array.
struct DealTarget {
  void* spheres = nullptr;  // x, y, z, r
  std::uint64_t* ids = nullptr;
  std::uint32_t *family = nullptr, *mask = nullptr;
  std::uint8_t* is_static = nullptr;
};

class Dealer {
 public:
  explicit Dealer(MemoryBook& book)
      : counts_(book, "the counts of the boxes"), summary_(book, "the counts") {}

  // `largest_radius`: at least that of the scene, or the counts are those of halos that are too small.
  DealCounts count(const Spheres& spheres, const DealRegions& regions, double largest_radius,
                   cudaStream_t stream);
  // Copies what count() counted before with the same arguments. Sphere k here has number first_id + k.
  void write(const Spheres& spheres, const DealRegions& regions, double largest_radius,
             std::uint64_t first_id, const DealTarget (&to)[kMostResidentDevices], cudaStream_t stream);
  // At most about `most` of the spheres as points, each with the number of spheres that it stands for.
  std::vector<WeightedPoint> sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream);

 private:
  struct Summary {
    unsigned long long totals[kMostResidentDevices], radius_bits, faulty;
  };
  Buffer<std::uint32_t> counts_;  // of tile t and box b at b * tiles + t; after the scan its first place
  Buffer<Summary> summary_;
};

// The sum of wide_pair_hash over pairs whose numbers are those of `ids`; null: their own.
std::uint64_t hash_of_numbered_pairs(const Pair* pairs, std::uint64_t count, const std::uint64_t* ids,
                                     Buffer<unsigned long long>& sum, cudaStream_t stream);

}  // namespace padder::detect::cuda
