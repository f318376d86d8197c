// Fast path on the GPU: spheres in the order of their bins (cuda_order.cu), and the search over bins and the forward
// half of their neighbours (cuda_search.cu). Internal; only .cu files include this.
#pragma once
#include "detect/cuda_source.h"
#include "detect/detector.h"
#include "detect/grid.h"

namespace padder::detect::cuda {

// What the search reads of a sphere. Equal: float input of one radius; the slot's fourth word is the sphere's number.
enum class SlotKind : std::uint8_t { equal, unequal, fixed };

// Spheres in the order of their bins, in device memory. table[k] is the first place with a key of at least k << merge;
// slots may be read up to kSlack places past the end.
inline constexpr std::uint32_t kSlack = 64;
struct Ordered {
  void* slots = nullptr;               // FloatSlot or FixedSlot
  std::uint32_t* ids = nullptr;        // null for SlotKind::equal
  std::uint32_t* keys = nullptr;       // as grid.h numbers them
  std::uint32_t* table = nullptr;      // (buckets >> merge) + 2 entries
  std::uint32_t count = 0;
  SlotKind kind = SlotKind::equal;
  int merge = 0;                       // 2^merge bins along x share an entry of the table
};

struct Counters {
  unsigned long long contacts, doubtful;
  std::uint32_t ticket, flags;
};
enum : std::uint32_t { kCrowded = 1 };  // Counters::flags: a bin too full for its order to be put right in place

// Where the contacts go, in device memory. Beyond `capacity` they are counted but not written.
struct Output {
  Pair* pairs = nullptr;
  void* normals = nullptr;
  void* points = nullptr;
  std::uint64_t capacity = 0;
  Width width = Width::normals;
  Scalar scalar = Scalar::f32;
};

// The record in double, rounded once. The pair itself is written by the caller.
__device__ __forceinline__ void put_geometry(const Output& out, std::uint64_t at, const Sphere& i, const Sphere& j) {
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

class Orderer {
 public:
  explicit Orderer(MemoryBook& book);
  // Stable: within a bin by sphere number, so that the order is the same in every run.
  Ordered order(const Source& source, const Grid& grid, SlotKind kind, cudaStream_t stream);

 private:
  Buffer<std::uint32_t> keys_, sorted_keys_, ids_, sorted_ids_, table_;
  Buffer<FloatSlot> slots_;
  Buffer<unsigned char> scratch_;
};

// Work space of the search: the place of each block in a list of fixed order.
std::uint64_t search_blocks(std::uint32_t spheres);
struct SearchOptions {
  bool exact = true, fixed_order = true;
  Region own;
  bool owns_all = true;
  double radius = 0;  // of all spheres, for SlotKind::equal
};
// Counters are set to zero first; afterwards they hold the number of contacts, whatever the capacity.
void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, unsigned long long* look_back, cudaStream_t stream);

}  // namespace padder::detect::cuda
