// SPDX-License-Identifier: MIT
// Deals the spheres on one GPU out to the boxes of all. Nearly all of them belong to this GPU's own box and
// stay where they lie: they are only read. Of the few others it is noted where they go, and they are copied
// afterwards. Internal; only .cu files include this.
#pragma once
#include <span>
#include <vector>

#include "detect/boxes/cut.h"
#include "detect/boxes/halo.h"
#include "detect/boxes/resident_detector.h"
#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// What dealing found.
struct DealCounts {
  std::vector<std::uint64_t> to;             // spheres for each box
  std::uint64_t away = 0;                    // for all boxes but the GPU's own, together
  std::uint64_t astray = 0;                  // spheres that the GPU's own box does not need
  double largest_radius = 0;                 // of the spheres here
  std::uint64_t faulty = ~std::uint64_t(0);  // the first sphere that fault_of() refuses, if any
};

// How far the halos of all spheres (halo.h) reach beside their own radii.
struct HaloWidth {
  double largest_radius = 0;  // at least that of the scene, or halos are too small
  double margin = 0;
  PADDER_HD Bounds of(const Sphere& s) const { return halo_of(s, largest_radius, margin); }
};

// Where spheres are copied to: arrays on this GPU. Null: there is no such array.
struct DealTarget {
  void* spheres = nullptr;  // x, y, z, r
  std::uint64_t* ids = nullptr;
  std::uint32_t *family = nullptr, *mask = nullptr, *world = nullptr;
  std::uint8_t* is_static = nullptr;
};

// Do x, y, z, r of each sphere lie together, where they are read at once?
bool is_packed(const Spheres& spheres);

class Dealer {
 public:
  explicit Dealer(MemoryBook& book)
      : away_(book, "the spheres for other boxes"),
        sorted_(book, "the spheres for other boxes"),
        space_(book, "the order of the spheres for other boxes"),
        staying_(book, "the spheres that stay"),
        sample_(book, "a sample"),
        regions_(book, "the boxes"),
        counts_(book, "the counts") {}

  // The boxes of all GPUs, of which `own` is this one's, until the next call. Waits for the stream.
  void set_boxes(std::span<const Region> boxes, std::size_t own, cudaStream_t stream);
  // Notes up to away_room spheres for boxes other than its own; further ones are only counted. Waits for the
  // stream.
  DealCounts deal(const Spheres& spheres, const HaloWidth& halos, std::uint64_t away_room,
                  cudaStream_t stream);
  // Copies the spheres that deal() noted, box by box and in their order. Sphere k here has number first_id +
  // k in the scene. Does not wait.
  void gather_away(const Spheres& spheres, std::uint64_t away, std::uint64_t first_id, const DealTarget& to,
                   cudaStream_t stream);
  // Copies the `count` spheres that its own box needs, in their order. For parts of which many lie elsewhere.
  // Does not wait.
  void gather_own(const Spheres& spheres, const HaloWidth& halos, std::uint64_t count, std::uint64_t first_id,
                  const DealTarget& to, cudaStream_t stream);
  // Copies all, so that they are packed. Does not wait.
  static void pack(const Spheres& spheres, const DealTarget& to, cudaStream_t stream);
  // At most about `most` of the spheres as points, each with the number of spheres that it stands for.
  std::vector<WeightedPoint> sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream);

 private:
  std::size_t boxes_ = 1, own_ = 0;
  Region own_box_;
  Buffer<unsigned long long> away_, sorted_;  // a box and a sphere
  Buffer<char> space_;
  Buffer<std::uint32_t> staying_;
  Buffer<Sphere> sample_;
  Buffer<Region> regions_;
  Buffer<unsigned long long> counts_;  // of deal(): see Counter
};

// The sum of wide_pair_hash over pairs of these numbers.
std::uint64_t hash_of_numbered_pairs(const Pair* pairs, std::uint64_t count, const ResidentNumbers& numbers,
                                     Buffer<unsigned long long>& sum, cudaStream_t stream);

}  // namespace padder::detect::cuda
