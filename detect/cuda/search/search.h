// SPDX-License-Identifier: MIT
// Fast path on the GPU: spheres in the order of their bins (order.cu), and the search over bins and the
// forward half of their neighbours (search.cu). Internal; only .cu files include this.
#pragma once
#include "detect/core/grid.h"
#include "detect/cuda/device_input.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// What the search reads of a sphere. Equal: float input of one radius; the slot's fourth word is the sphere's
// number.
enum class SlotKind : std::uint8_t { equal, unequal, fixed_point };

// Bins of one dense level in float (bins.h), where they will do: keys are then computed from the slots
// and stand nowhere.
inline constexpr std::uint32_t kMostFloatBins = 4096;  // on an axis
struct FloatBins {
  float origin[3] = {0, 0, 0}, per_size[3] = {0, 0, 0};
  std::uint32_t count[3] = {1, 1, 1}, row = 0, plane = 0, buckets = 0;  // keys of a row, a plane and in all
  std::uint32_t first = 1;                                              // key of bin (0, -1, -1)
  std::uint32_t fine = 1;  // bins along x that make up one of the level's: a row of candidates is shorter
  float units = 0;         // of codes.h, a length
  bool on = false;
};
// The same of several dense levels; keys as grid.h numbers them, though a sphere's bin need not be the same.
struct LevelBins {
  FloatBins level[kMaxLevels];
  std::int32_t top = 0;
  std::uint8_t level_of_octave[kOctaves] = {};
  bool on = false;
};

// Spheres in the order of their bins, in device memory. table[k] is the first place with a key of at least k
// << merge; slots and codes may be read up to kSlack places past the end.
inline constexpr std::uint32_t kSlack = 64;
struct Ordered {
  void* slots = nullptr;           // FloatSlot or FixedPointSlot
  std::uint32_t* ids = nullptr;    // null for SlotKind::equal
  std::uint32_t* codes = nullptr;  // codes.h; null where a level is hashed
  std::uint32_t* keys = nullptr;   // as grid.h numbers them; null where bins are in float
  FloatBins bins;
  bool float_levels = false;       // by level_bins(grid, kind), if not by `bins`
  std::uint32_t* table = nullptr;  // (buckets >> merge) + 2 entries
  std::uint32_t count = 0;
  SlotKind kind = SlotKind::equal;
  int merge = 0;              // 2^merge bins along x share an entry of the table
  std::uint64_t entries = 0;  // of the table
};

struct Counters {
  unsigned long long contacts, doubtful, spilled;
  unsigned long long own;       // contacts within a level, for a fixed order
  unsigned long long expected;  // 16ths of contacts that units were expected to find (expect.h)
  std::uint32_t flags;          // set by Orderer, cleared by its caller
};
// Counters::flags: a bin or bucket too full for the method; a sphere outside the bins, which were chosen for
// others.
enum : std::uint32_t { kCrowded = 1, kOutside = 2 };

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

// Memory that putting in order may use and leave behind changed: that of the list, which is written later.
struct Lent {
  float4* slot = nullptr;
  std::uint64_t slots = 0;
  std::uint32_t* word = nullptr;
  std::uint64_t words = 0;
  friend bool operator==(const Lent&, const Lent&) = default;
};

enum class OrderMethod : std::uint8_t { automatic, cells, buckets, sort };

class Orderer {
 public:
  explicit Orderer(MemoryBook& book);
  // `stable`: within a bin by sphere number, so that the order is the same in every run. Sets kCrowded in the
  // counters where a bin or bucket is too full for the method; then only OrderMethod::sort gives an order.
  // What `gather` asks for is gathered along; it and the counters need not have been set to zero then.
  // `keep`: if the call before had the same buckets, nothing is counted: each has a little more room than it
  // needed then. Sets kOutside where that is not enough, or where one radius is not that of all; the caller
  // then calls again without. Spheres outside the bins are not reported: the caller compares the grid with
  // the bounds, where coordinates that are no numbers show, too, but not whose. `processors`:
  // processors_of(stream); the order does not depend on it.
  Ordered order(const Source& source, const Grid& grid, SlotKind kind, bool stable, OrderMethod method,
                const Gather& gather, const Lent& lent, Counters* counters, int processors,
                cudaStream_t stream, bool keep = false);
  // Another number whenever `keep` would stand for something else.
  std::uint64_t kept() const { return kept_; }
  double bucket_spheres = 6500;  // average aimed at
  static constexpr std::uint32_t kFewSpheres = 1u << 18;
  // Slots lent that are enough for any order.
  static std::uint64_t room(std::uint64_t spheres) { return spheres + spheres / 8; }

 private:
  bool by_cells(const Source& source, const Grid& grid, bool stable, const Gather& gather, const Lent& lent,
                Counters* counters, Ordered& o, int processors, cudaStream_t stream);
  bool by_buckets(const Source& source, const Grid& grid, bool stable, bool keep, const Gather& gather,
                  const Lent& lent, Counters* counters, Ordered& o, cudaStream_t stream);
  void by_sort(const Source& source, const Grid& grid, const Gather& gather, Counters* counters, Ordered& o,
               cudaStream_t stream);

  // Of the buckets whose starts the last call left behind; none where spheres is 0.
  struct Layout {
    std::uint64_t spheres = 0;
    std::uint32_t buckets = 0, entries = 0, magic[kMaxLevels] = {};
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
  Buffer<unsigned char> scratch_;
};

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
