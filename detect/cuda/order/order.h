// SPDX-License-Identifier: MIT
// Puts spheres in the order of their bins, so that the search reads neighbours from neighbouring places.
// Internal; only .cu files include this.
#pragma once
#include "detect/cuda/device/counters.h"
#include "detect/cuda/input/survey.h"
#include "detect/cuda/order/float_bins.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {

// Spheres in the order of their bins, in device memory. table[k] is the first place with a key of at least
// k << merge. Slots and codes may be read up to kSlack places past the end: what is there has no meaning.
inline constexpr std::uint32_t kSlack = 64;
struct Ordered {
  void* slots = nullptr;         // FloatSlot or FixedPointSlot
  std::uint32_t* ids = nullptr;  // null for SlotKind::equal
  Sphere* given = nullptr;       // the spheres as they were given, where they were gathered
  // Slots are doubles rounded to float: what float is not sure of, and every record, goes by the doubles.
  bool rounded = false;
  std::uint32_t* codes = nullptr;  // codes.h
  std::uint32_t* keys = nullptr;   // as grid.h numbers them; null where bins are in float
  FloatBins bins;
  bool float_levels = false;       // keys are those of level_bins(grid, kind), unless bins.on
  std::uint32_t* table = nullptr;  // (buckets >> merge) + 2 entries
  std::uint32_t count = 0;
  SlotKind kind = SlotKind::equal;
  bool hashed = false;        // one of the levels is
  int merge = 0;              // 2^merge bins along x share an entry of the table
  std::uint64_t entries = 0;  // of the table
};

// Memory of the contact list that the order may use as work space, since the list is written later.
struct Lent {
  float4* slot = nullptr;
  std::uint64_t slots = 0;
  std::uint32_t* word = nullptr;
  std::uint64_t words = 0;
  friend bool operator==(const Lent&, const Lent&) = default;
};

// Ways of putting spheres in order: a counting sort over bins, through buckets, a radix sort by key.
// Automatic: the fastest that serves.
enum class OrderMethod : std::uint8_t { automatic, cells, buckets, sort };

struct OrderRequest {
  const DeviceSpheres& source;
  const Grid& grid;
  SlotKind kind;
  double radius = 0;   // of all spheres, for SlotKind::equal
  bool given = false;  // asks for Ordered::given where it pays (gathers_given)
  bool stable;         // within a bin by sphere number, so that the order is the same in every run
  OrderMethod method;
  int crowding = 0;  // buckets get 2^crowding times fewer spheres on average, so that uneven ones fit
  // What it asks for is gathered along; it and the counters need not have been set to zero then.
  const Gather& gather;
  const Lent& lent;
  Counters* counters;  // Counters::flags is set
  int processors;      // processors_of(stream); the order does not depend on it
  cudaStream_t stream;
  // If the previous call had the same buckets, nothing is counted: each has a little more room than it needed
  // then. kOutgrown is set where that is not enough; the next call gives each what it needs now. kOutside is
  // set where one radius is not that of all; the caller then calls again without.
  bool keep = false;
};

struct BucketPlan;  // buckets.h

class Orderer {
 public:
  explicit Orderer(MemoryBook& book);
  // Where a bin or bucket is too full for the method, kCrowded is set in the counters, and only
  // OrderMethod::sort gives an order. Spheres outside the bins are not reported in every case: the caller
  // compares the grid with the bounds, where coordinates that are no numbers show, too, but not whose.
  Ordered order(const OrderRequest& request);
  // Another number whenever `keep` would stand for something else.
  std::uint64_t kept() const { return kept_; }
  double bucket_spheres = tuning::kBucketSpheres;
  // Slots lent that are enough for any order.
  static std::uint64_t room(std::uint64_t spheres) { return spheres + spheres / 8; }

 private:
  // These fill in what remains of `o`; false: the method does not serve.
  bool by_cells(const OrderRequest& request, Ordered& o);
  bool by_buckets(const OrderRequest& request, Ordered& o);
  void by_sort(const OrderRequest& request, Ordered& o);
  std::uint64_t plan_rooms(const OrderRequest& request, const Ordered& o, BucketPlan& plan);
  void plan_work_space(const Lent& list, std::uint64_t split_room, Ordered& o, BucketPlan& plan);

  // Of the buckets whose starts the previous call left behind, of so many spheres; none where they are 0.
  struct Layout {
    std::uint64_t spheres = 0;
    std::uint32_t buckets = 0, entries = 0, magic[kMaxLevels] = {};
    bool has_same_buckets(Layout other) const {
      other.spheres = spheres;
      return spheres > 0 && other == *this;
    }
    friend bool operator==(const Layout&, const Layout&) = default;
  };
  void keep_layout(const Layout& layout) {
    if (layout != layout_) kept_++;
    layout_ = layout;
  }

  Layout layout_;
  std::uint64_t kept_ = 0;
  Buffer<std::uint32_t> keys_, sorted_keys_, ids_, sorted_ids_, codes_, table_, starts_;
  Buffer<float4> slots_, split_slots_;
  Buffer<Sphere> given_;
  Buffer<unsigned char> scratch_;
};

}  // namespace padder::detect::cuda
