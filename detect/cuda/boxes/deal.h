// SPDX-License-Identifier: MIT
// Deals the spheres on one GPU out to the boxes of all. Nearly all of them belong to this GPU's own box, and
// those are read once and written once, in their order; of the few others it is noted where they go, and they
// are copied afterwards. Internal; only .cu files include this.
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

// What dealing found.
struct DealCounts {
  std::uint64_t to[kMostResidentDevices] = {};  // spheres for each box
  std::uint64_t away = 0;                       // for all boxes but the GPU's own, together
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
      : tiles_(book, "the counts of the tiles"),
        away_(book, "the spheres for other boxes"),
        sorted_(book, "the spheres for other boxes"),
        sort_space_(book, "the order of the spheres for other boxes"),
        summary_(book, "the counts") {}

  // Writes the spheres of box `own`, which has room for own_room, and notes up to away_room spheres for the
  // other boxes. What finds no room is only counted. Sphere k here has number first_id + k. `largest_radius`:
  // at least that of the scene, or the counts are those of halos that are too small. Waits for the stream.
  DealCounts deal(const Spheres& spheres, const DealRegions& regions, int own, double largest_radius,
                  std::uint64_t first_id, const DealTarget& to, std::uint64_t own_room,
                  std::uint64_t away_room, cudaStream_t stream);
  // Copies the spheres that deal() noted, box by box and in their order. Does not wait.
  void gather_away(const Spheres& spheres, std::uint64_t away, std::uint64_t first_id, const DealTarget& to,
                   cudaStream_t stream);
  // At most about `most` of the spheres as points, each with the number of spheres that it stands for.
  std::vector<WeightedPoint> sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream);

 private:
  struct Summary {
    unsigned long long totals[kMostResidentDevices], away, radius_bits, faulty;
    unsigned next_tile;
  };
  Buffer<unsigned long long> tiles_;          // how many spheres of the own box come before the tile's end
  Buffer<unsigned long long> away_, sorted_;  // box << 32 | sphere
  Buffer<char> sort_space_;
  Buffer<Summary> summary_;
};

// The numbers from 0 to bodies - 1, then `loose` numbers of loose spheres, which are counted from 0 there and
// come after the spheres of bodies in the scene.
void number_spheres(std::uint64_t bodies, const std::uint64_t* of_loose, std::uint64_t loose,
                    std::uint64_t* to, cudaStream_t stream);

// The sum of wide_pair_hash over pairs whose numbers are those of `ids`; null: their own.
std::uint64_t hash_of_numbered_pairs(const Pair* pairs, std::uint64_t count, const std::uint64_t* ids,
                                     Buffer<unsigned long long>& sum, cudaStream_t stream);

}  // namespace padder::detect::cuda
