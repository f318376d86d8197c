// SPDX-License-Identifier: MIT
// Through buckets: some thousand of them, each of consecutive bins. A first pass divides the spheres among
// the buckets, through shared memory so that what goes to one bucket is written together; then each bucket,
// which fits shared memory, is put in order and its part of the table written. No sphere is gathered from a
// random place. Where the buckets are too many to be divided among at once, groups of buckets come first.
// Where buckets begin is counted; or, where the call before had the same buckets, each gets a little more
// room than it needed then, and what was found is counted along.
#include "detect/cuda/order/order_kernels.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWide = 1024, kItems = 8, kMost = 10, kCount = 512;
constexpr std::uint32_t kTile = kWide * kItems, kSharedBytes = 226 * 1024;
// Buckets that spheres can be divided among at once; of a group; in all.
constexpr std::uint32_t kMostAtOnce = 6144, kGroupBits = 10, kMostBuckets = 56000,
                        kMostGroups = (kMostBuckets >> kGroupBits) + 1;
constexpr std::uint32_t kHalved = 3'000'000;  // up to so many spheres, buckets and blocks are half as large

// Bucket of a table entry: entries first_entry(b) to first_entry(b + 1) - 1 are of bucket b. Each level has
// buckets of its own width, for the levels' bins are not equally full.
struct Buckets {
  std::uint32_t count = 0, entries = 1, widest = 1;
  int merge = 0, levels = 1;
  struct Part {
    std::uint32_t entry = 0, bucket = 0, magic = 1;  // its first ones; 2^32 / width
  } part[kMaxLevels];
  __device__ __forceinline__ std::uint32_t of(std::uint32_t key) const {
    const std::uint32_t entry = key >> merge;
    int k = 0;
    while (k + 1 < levels && entry >= part[k + 1].entry) k++;
    return part[k].bucket + __umulhi(entry - part[k].entry, part[k].magic);
  }
  __device__ __forceinline__ int level_of(std::uint32_t b) const {
    int k = 0;
    while (k + 1 < levels && b >= part[k + 1].bucket) k++;
    return k;
  }
  __device__ __forceinline__ std::uint32_t first_entry(std::uint32_t b) const {
    const int k = level_of(b);
    const std::uint64_t magic = part[k].magic,
                        first = ((static_cast<std::uint64_t>(b - part[k].bucket) << 32) + magic - 1) / magic;
    return static_cast<std::uint32_t>(min(part[k].entry + first, std::uint64_t(entries)));
  }
};

// The bucket of a slot.
template <class Bins>
struct BucketOf {
  __device__ __forceinline__ BucketOf(const Bins&, const Buckets&) {}
  __device__ __forceinline__ std::uint32_t operator()(const Bins& bins, const Buckets& buckets,
                                                      const float4& slot) const {
    std::uint32_t key;
    key_of(bins, slot, key);
    return buckets.of(key);
  }
};
// Lanes of a warp ask for several levels: what tells the bucket lies in shared memory. A barrier must follow
// before the first is asked for.
template <>
struct BucketOf<LevelBins> {
  struct Line {
    float origin[3], per_size;
    std::uint32_t count_xy, count_z, magic, bucket;
  };
  struct Memory {
    alignas(16) Line line[kMaxLevels];
    std::uint8_t level_of_octave[kOctaves];
  };
  const Memory* memory;
  __device__ __forceinline__ BucketOf(const LevelBins& bins, const Buckets& buckets) {
    __shared__ Memory shared;
    memory = &shared;
    if (threadIdx.x < kOctaves) shared.level_of_octave[threadIdx.x] = bins.level_of_octave[threadIdx.x];
    if (threadIdx.x < kMaxLevels) {
      const FloatBins& b = bins.level[threadIdx.x];
      const Buckets::Part& part = buckets.part[threadIdx.x];
      shared.line[threadIdx.x] = {{b.origin[0], b.origin[1], b.origin[2]},
                                  b.per_size[0],
                                  b.count[0] | b.count[1] << 16,
                                  b.count[2],
                                  part.magic,
                                  part.bucket};
    }
  }
  __device__ __forceinline__ std::uint32_t operator()(const LevelBins& bins, const Buckets&,
                                                      const float4& slot) const {
    const int octave = octave_of_exponent(bins.top, need_exponent(slot.x, slot.y, slot.z, slot.w));
    const auto* const line = reinterpret_cast<const float4*>(memory->line + memory->level_of_octave[octave]);
    const float4 a = line[0], b = line[1];
    const std::uint32_t xy = __float_as_uint(b.x), nx = xy & 0xffff, ny = xy >> 16, nz = __float_as_uint(b.y);
    std::uint32_t i, j, k;
    float_bin(slot.x, a.x, a.w, nx, i), float_bin(slot.y, a.y, a.w, ny, j),
        float_bin(slot.z, a.z, a.w, nz, k);
    const std::uint32_t entry = ((k + 1) * (ny + 2) + j + 1) * (nx + 2) + i + 1;  // as level_bins() has it
    return __float_as_uint(b.w) + __umulhi(entry, __float_as_uint(b.z));
  }
};

// Where each bucket begins, and where its next sphere goes; of the groups too, and their first tiles.
// `bucket` holds the counts first; `finished` is the number of blocks that have counted. `room`: where each
// bucket may be put while spheres are divided, if not where it begins.
struct Starts {
  std::uint32_t *finished = nullptr, *bucket = nullptr, *cursor = nullptr, *room = nullptr,
                *group_cursor = nullptr, *group_tile = nullptr;
};
// A sixteenth more than the bucket before it ends at, and some for small ones.
__host__ __device__ constexpr std::uint32_t roomy(std::uint32_t start, std::uint32_t bucket) {
  return start + start / 16 + 64 * bucket;
}
__global__ void __launch_bounds__(kCount)
    bucket_begin_kernel(Starts starts, std::uint32_t count, unsigned long long* bounds, Counters* counters) {
  const std::uint32_t k = blockIdx.x * kCount + threadIdx.x;
  if (k < count) starts.bucket[k] = 0;
  if (k == 0) *starts.finished = 0;
  if (!bounds) return;
  if (k < kBounds) bounds[k] = Bounds::nothing(k);
  if (k == 0) *counters = {};
}

// The same where buckets have room by what the call before found.
__global__ void __launch_bounds__(kCount)
    bucket_room_kernel(Starts starts, std::uint32_t count, Gather gather, Counters* counters) {
  const std::uint32_t k = blockIdx.x * kCount + threadIdx.x;
  if (k <= count) starts.room[k] = starts.cursor[k] = roomy(starts.bucket[k], k);
  if (k == 0) *starts.finished = 0;
  if (!gather.bounds) return;
  gather.begin(k, gridDim.x * kCount);
  if (k == 0) *counters = {};
}

// By all threads: whether all other blocks have been here. Then what they wrote before is seen.
__device__ __forceinline__ bool is_last(const Starts& starts) {
  __shared__ std::uint32_t number;
  __threadfence();
  __syncthreads();
  if (threadIdx.x == 0) number = atomicAdd(starts.finished, 1);
  __syncthreads();
  if (number + 1 < gridDim.x) return false;
  __threadfence();
  return true;
}

// A block counts for itself; `Threads` of them, as few blocks a processor as their counts leave room for. The
// last block to finish makes starts of the counts.
template <class Bins, bool Along, int Threads>
__global__ void __launch_bounds__(Threads, Threads == kCount ? 4 : 1)
    bucket_count_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, std::uint32_t* keys, Starts starts,
                        std::uint32_t groups, unsigned long long* found, Counters* counters) {
  constexpr int kAtOnce = Threads == kCount ? 1 : 3;
  Bounds bounds;
  extern __shared__ std::uint32_t shared[];
  __shared__ std::uint32_t sums[32];
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads) shared[b] = 0;
  __syncthreads();
  const std::uint64_t step = static_cast<std::uint64_t>(gridDim.x) * Threads * kAtOnce;
  for (std::uint64_t from = static_cast<std::uint64_t>(blockIdx.x) * Threads * kAtOnce; from < source.count;
       from += step) {
    Sphere s[kAtOnce];
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint64_t k = from + u * Threads + threadIdx.x;
      if (k < source.count) s[u] = source.sphere(static_cast<std::uint32_t>(k));
    }
#pragma unroll
    for (int u = 0; u < kAtOnce; u++) {
      const std::uint64_t k = from + u * Threads + threadIdx.x;
      const bool valid = k < source.count;
      std::uint32_t key = 0;
      if (valid) {
        key = key_of_sphere(s[u], bins, counters);
        if (!kKeyless<Bins>) keys[k] = key;
        if (Along) bounds.take(s[u], static_cast<std::uint32_t>(k));
      }
      ticket(shared, valid ? buckets.of(key) : ~0u);
    }
  }
  if (Along) bounds.give(found);
  __syncthreads();
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads)
    if (shared[b]) atomicAdd(starts.bucket + b, shared[b]);
  if (!is_last(starts)) return;
  for (std::uint32_t b = threadIdx.x; b < buckets.count; b += Threads) shared[b] = __ldcg(starts.bucket + b);
  scan_shared(shared, buckets.count, sums);
  for (std::uint32_t b = threadIdx.x; b <= buckets.count; b += Threads) {
    starts.bucket[b] = shared[b];
    if (b < buckets.count) starts.cursor[b] = shared[b];
  }
  for (std::uint32_t g = threadIdx.x; g < groups; g += Threads)
    starts.group_cursor[g] = shared[g << kGroupBits];
  if (threadIdx.x > 0 || groups == 0) return;
  std::uint32_t tiles = 0;
  for (std::uint32_t g = 0; g < groups; g++) {
    starts.group_tile[g] = tiles;
    tiles +=
        (shared[min((g + 1) << kGroupBits, buckets.count)] - shared[g << kGroupBits] + kTile - 1) / kTile;
  }
  starts.group_tile[groups] = tiles;
}

enum class Pass { whole, among_groups, within_groups };

// By the last block that has divided its spheres: what was found is where buckets begin.
__device__ __noinline__ void begin_as_found(const Starts& starts, std::uint32_t count, std::uint32_t* shared,
                                            std::uint32_t* sums, Counters* counters) {
  if (!is_last(starts)) return;
  for (std::uint32_t b = threadIdx.x; b < count; b += blockDim.x) {
    const std::uint32_t begin = starts.room[b], room = starts.room[b + 1] - begin,
                        found = __ldcg(starts.cursor + b) - begin;
    if (found > room) atomicOr(&counters->flags, kOutside);
    shared[b] = min(found, room);
  }
  scan_shared(shared, count, sums);
  for (std::uint32_t b = threadIdx.x; b <= count; b += blockDim.x) starts.bucket[b] = shared[b];
}

// Tiles of spheres, one after the other: ordered by bucket in shared memory, then written, each bucket's
// share to one place. The next tile is read while this one is written. Kept: buckets have room by the call
// before; one that has outgrown it, or a sphere of another radius than all have, is reported.
template <SlotKind Kind, class Bins, Pass P, bool Packed, bool Kept>
__global__ void __launch_bounds__(kWide)
    bucket_split_kernel(const __grid_constant__ Source source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, std::uint32_t count,
                        const __grid_constant__ Starts starts, Places in, Places out, float radius,
                        Counters* counters) {
  constexpr int kShare = kMostAtOnce / kWide;
  constexpr bool kKeys = !kKeyless<Bins>, kIds = Kind != SlotKind::equal, kWithin = P == Pass::within_groups;
  extern __shared__ float4 slots[];
  auto* bucket_at = reinterpret_cast<std::uint16_t*>(slots + kTile);
  auto* counts = reinterpret_cast<std::uint32_t*>(bucket_at + kTile);
  auto* shift = counts + count + 1;
  __shared__ std::uint32_t sums[32];
  struct Range {
    std::uint32_t first, count, group;
  };
  const std::uint32_t groups = (buckets.count + (1u << kGroupBits) - 1) >> kGroupBits;
  const auto tiles = kWithin ? starts.group_tile[groups]
                             : static_cast<std::uint32_t>((std::uint64_t(source.count) + kTile - 1) / kTile);
  const auto range_of = [&](std::uint32_t tile, std::uint32_t group) -> Range {
    std::uint32_t first = tile * kTile, end = source.count;
    if (kWithin) {
      while (tile >= starts.group_tile[group + 1]) group++;
      first = starts.bucket[group << kGroupBits] + (tile - starts.group_tile[group]) * kTile;
      end = starts.bucket[min((group + 1) << kGroupBits, buckets.count)];
    }
    return {first, min(end - first, kTile), group};
  };
  const BucketOf<Bins> bucket_of(bins, buckets);
  float4 slot[kItems];
  const auto read = [&](const Range& r) {
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = threadIdx.x + u * kWide;
      if (k < r.count)
        slot[u] = kWithin ? static_cast<const float4*>(in.slots)[r.first + k]
                          : bare_slot<Kind, Packed>(source, grid_of(bins), r.first + k);
    }
  };
  for (std::uint32_t b = threadIdx.x; b < count; b += kWide) counts[b] = 0;
  // A bucket that has outgrown its room runs into the next one's, the last no further than one place.
  const auto place_of = [&](std::uint32_t to) { return Kept ? min(to, roomy(source.count, count)) : to; };
  std::uint32_t tile = blockIdx.x;
  if (tile >= tiles) return;
  std::uint32_t group = 0;
  read(range_of(tile, 0));
  __syncthreads();
  for (; tile < tiles; tile += gridDim.x) {
    const Range range = range_of(tile, group);
    group = range.group;
    std::uint32_t* const cursors = P == Pass::whole          ? starts.cursor
                                   : P == Pass::among_groups ? starts.group_cursor
                                                             : starts.cursor + (range.group << kGroupBits);
    std::uint32_t place[kItems];  // bucket and rank in it; then the place in the tile
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      const std::uint32_t k = threadIdx.x + u * kWide;
      std::uint32_t bucket = ~0u;
      if (k < range.count) {
        if constexpr (kKeys)
          bucket = buckets.of(in.keys[range.first + k]);
        else
          bucket = bucket_of(bins, buckets, slot[u]);
        if (Kept && Kind == SlotKind::equal && slot[u].w != radius) atomicOr(&counters->flags, kOutside);
        if (P == Pass::among_groups) bucket >>= kGroupBits;
        if (P == Pass::within_groups) bucket &= (1u << kGroupBits) - 1;
      }
      place[u] = ticket(counts, bucket) | bucket << 16;
    }
    scan_shared(counts, count, sums);
#pragma unroll
    for (int u = 0; u < kItems; u++) {
      if (threadIdx.x + u * kWide >= range.count) break;
      const std::uint32_t bucket = place[u] >> 16;
      place[u] = counts[bucket] + (place[u] & 0xffff);
      if (Kind == SlotKind::equal && !kWithin)
        slot[u].w = __uint_as_float(range.first + threadIdx.x + u * kWide);
      slots[place[u]] = slot[u], bucket_at[place[u]] = static_cast<std::uint16_t>(bucket);
    }
    // The slots' registers are free now: places are asked for, and the next tile, before either is waited
    // for.
    std::uint32_t taken[kShare];
#pragma unroll
    for (int u = 0; u < kShare; u++) {
      const std::uint32_t b = threadIdx.x + u * kWide, c = b < count ? counts[b + 1] - counts[b] : 0;
      taken[u] = c ? atomicAdd(cursors + b, c) : 0;
    }
    if (tile + gridDim.x < tiles) read(range_of(tile + gridDim.x, group));
#pragma unroll
    for (int u = 0; u < kShare; u++) {
      const std::uint32_t b = threadIdx.x + u * kWide;
      if (b < count) shift[b] = taken[u] - counts[b];
    }
    __syncthreads();
    for (std::uint32_t b = threadIdx.x; b < count; b += kWide) counts[b] = 0;
    for (std::uint32_t s = threadIdx.x; s < range.count; s += kWide)
      static_cast<float4*>(out.slots)[place_of(shift[bucket_at[s]] + s)] = slots[s];
    __syncthreads();
    // What does not fit the slot is staged in a second round, through the same memory.
    if (kIds || kKeys) {
      auto *numbers = reinterpret_cast<std::uint32_t*>(slots), *tile_keys = numbers + kTile;
#pragma unroll
      for (int u = 0; u < kItems; u++) {
        const std::uint32_t k = threadIdx.x + u * kWide;
        if (k >= range.count) break;
        if (kIds) numbers[place[u]] = kWithin ? in.ids[range.first + k] : range.first + k;
        if (kKeys) tile_keys[place[u]] = in.keys[range.first + k];
      }
      __syncthreads();
      for (std::uint32_t s = threadIdx.x; s < range.count; s += kWide) {
        const std::uint32_t to = place_of(shift[bucket_at[s]] + s);
        if (kIds) out.ids[to] = numbers[s];
        if (kKeys) out.keys[to] = tile_keys[s];
      }
      __syncthreads();
    }
  }
  if constexpr (Kept) begin_as_found(starts, count, counts, sums, counters);
}

// One bucket a block: its spheres by bin, within a bin by number if `stable`, and its part of the table. Half
// as wide blocks are two a processor, so that one reads while the other counts. Kept: buckets lie in the
// rooms they had, and bounds are gathered here.
template <SlotKind Kind, class Bins, int Threads, bool Kept>
__global__ void __launch_bounds__(Threads, kWide / Threads)
    bucket_order_kernel(const __grid_constant__ Bins grid_bins, const __grid_constant__ Buckets buckets,
                        std::uint32_t capacity, const __grid_constant__ Starts where, Places in, Places out,
                        std::uint32_t* table, bool stable, const __grid_constant__ Gather gather,
                        float radius, Counters* counters) {
  constexpr bool kIds = Kind != SlotKind::equal, kKeys = !kKeyless<Bins>;
  extern __shared__ float4 slots[];
  auto* tile_keys = reinterpret_cast<std::uint32_t*>(slots + capacity);
  auto* numbers = kKeys ? tile_keys + capacity : tile_keys;
  auto* bins = kIds ? numbers + capacity : numbers;
  __shared__ std::uint32_t sums[32];
  const std::uint32_t begin = where.bucket[blockIdx.x], count = where.bucket[blockIdx.x + 1] - begin,
                      from = Kept ? where.room[blockIdx.x] : begin;
  const auto& bins_here = bins_of_level(grid_bins, buckets.level_of(blockIdx.x));
  const std::uint32_t first = buckets.first_entry(blockIdx.x),
                      width = buckets.first_entry(blockIdx.x + 1) - first;
  if (Kept && counters->flags) return;  // a bucket ran into another
  if (count > capacity) {
    if (threadIdx.x == 0) atomicOr(&counters->flags, kCrowded);
    return;
  }
  const auto bin_of_key = [&](std::uint32_t key) { return (key >> buckets.merge) - first; };
  const auto bin_of_slot = [&](const float4& s) {
    std::uint32_t key = 0;
    if constexpr (!kKeys) key_of(bins_here, s, key);
    return bin_of_key(key);
  };
  float4 slot[kMost];
  std::uint32_t place[kMost];  // bin and rank in it
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * Threads;
    if (k < count) {
      if (kKeys) place[u] = in.keys[from + k];
      slot[u] = static_cast<const float4*>(in.slots)[from + k];
    }
  }
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) bins[b] = 0;
  auto& octaves = *reinterpret_cast<OctaveBounds*>(bins + ((width + 4) & ~3u));
  if (Kept && kIds && gather.octaves) octaves.begin();
  __syncthreads();
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    if (threadIdx.x + u * Threads >= count) break;
    const std::uint32_t bin = kKeys ? bin_of_key(place[u]) : bin_of_slot(slot[u]);
    place[u] = atomicAdd(bins + bin, 1u) | bin << 16;
  }
  scan_shared(bins, width, sums);
  for (std::uint32_t b = threadIdx.x; b < width; b += blockDim.x) table[first + b] = begin + bins[b];
  if (blockIdx.x + 1 == gridDim.x && threadIdx.x == 0)
    table[first + width] = begin + count;  // the end of all
#pragma unroll
  for (int u = 0; u < kMost; u++) {
    const std::uint32_t k = threadIdx.x + u * Threads;
    if (k >= count) break;
    place[u] = bins[place[u] >> 16] + (place[u] & 0xffff);
    slots[place[u]] = slot[u];
    if (kKeys) tile_keys[place[u]] = in.keys[from + k];
  }
  // Asked for all at once, in registers that the slots had.
  if constexpr (kIds) {
    std::uint32_t id[kMost];
#pragma unroll
    for (int u = 0; u < kMost; u++)
      if (threadIdx.x + u * Threads < count) id[u] = in.ids[from + threadIdx.x + u * Threads];
#pragma unroll
    for (int u = 0; u < kMost; u++)
      if (threadIdx.x + u * Threads < count) numbers[place[u]] = id[u];
  }
  __syncthreads();
  const auto number = [&](std::uint32_t s) { return kIds ? numbers[s] : __float_as_uint(slots[s].w); };
  Bounds bounds;
  const bool by_octave = Kept && kIds && gather.octaves;
  OctaveTaker taker;
  if (by_octave) taker.begin(gather.top, slots[min(threadIdx.x, count - 1)], threadIdx.x < count);
  for (std::uint32_t s = threadIdx.x; s < count; s += blockDim.x) {
    std::uint32_t to = s;
    const float4 mine = slots[s];
    if (stable) {
      const std::uint32_t b = kKeys ? bin_of_key(tile_keys[s]) : bin_of_slot(mine), end = bins[b + 1],
                          own = number(s);
      to = bins[b];
      // Four at a time: bins are small, and one after the other each would be waited for.
      for (std::uint32_t q = to; q < end; q += 4) {
#pragma unroll
        for (std::uint32_t v = 0; v < 4; v++)
          if (q + v < end && q + v != s) to += number(q + v) < own;
      }
    }
    if (Kept && gather.bounds)
      bounds.take_quickly(mine.x, mine.y, mine.z, Kind == SlotKind::equal ? radius : mine.w);
    if (by_octave) taker.take(octaves, gather.top, mine);
    static_cast<float4*>(out.slots)[begin + to] = mine;
    if (out.codes) out.codes[begin + to] = code_for<Kind>(bins_here, kKeys ? tile_keys[s] : 0, mine);
    if (kKeys) out.keys[begin + to] = tile_keys[s];
    if (kIds) out.ids[begin + to] = numbers[s];
  }
  if (Kept && gather.bounds) bounds.give<false>(gather.bounds);
  if (by_octave) {
    taker.give(octaves);
    __syncthreads();
    octaves.give(gather.octaves);
  }
}

}  // namespace

bool Orderer::by_buckets(const Source& source, const Grid& grid, bool stable, bool keep, const Gather& gather,
                         const Lent& lending, Counters* counters, Ordered& o, cudaStream_t stream) {
  const bool ids = o.kind != SlotKind::equal, keyed = !o.bins.on && !o.float_levels;
  unsigned long long* const bounds = gather.bounds;
  const std::uint32_t sphere_bytes = 16 + (ids ? 4 : 0) + (keyed ? 4 : 0);
  // As many buckets as give each about `bucket_spheres` on average, and no more entries than leave room, nor
  // than 16 bits can number.
  const bool halved = o.count <= kHalved;
  const int width_of_block = halved ? kWide / 2 : kWide;
  const std::uint32_t room = halved ? kSharedBytes / 2 : kSharedBytes;
  const double aim = halved ? bucket_spheres / 2 : bucket_spheres,
               widest = std::min((room - aim * 1.12 * sphere_bytes) / 4 - 4, 65535.0);
  if (widest < 64) return false;
  Buckets b;
  b.merge = o.merge, b.levels = grid.levels, b.entries = static_cast<std::uint32_t>(o.entries);
  for (int k = 0; k < grid.levels; k++) {
    Buckets::Part& part = b.part[k];
    part.entry = k ? grid.level[k].offset : 0, part.bucket = b.count;
    const std::uint32_t entries = (k + 1 < grid.levels ? grid.level[k + 1].offset : b.entries) - part.entry;
    const double spheres = static_cast<double>(std::max<std::uint64_t>(grid.level[k].spheres, 1)),
                 width = std::floor(std::clamp(aim * entries / spheres, 2.0, widest - 1));
    part.magic = static_cast<std::uint32_t>(std::ceil(4294967296.0 / width));
    b.widest = std::max(b.widest, static_cast<std::uint32_t>(width) + 2);
    b.count += static_cast<std::uint32_t>((std::uint64_t(entries - 1) * part.magic) >> 32) + 1;
  }
  if (b.count > kMostBuckets) return false;
  const bool grouped = b.count > kMostAtOnce;
  const std::uint32_t groups = grouped ? (b.count + (1u << kGroupBits) - 1) >> kGroupBits : 0;
  const auto tile_bytes = [](std::uint32_t count) { return kTile * 18 + (2 * count + 1) * 4; };
  const std::uint32_t table_bytes = ((b.widest + 4) & ~3u) * 4 + (ids ? sizeof(OctaveBounds) : 0);
  const std::uint32_t capacity =
      std::min<std::uint32_t>((room - table_bytes) / sphere_bytes, kMost * width_of_block) & ~3u;
  // Work space in the list of contacts, which is written afterwards.
  const std::uint64_t n = o.count;
  // Two calls with the same buckets, whatever the spheres do: those of the first have room in the second.
  Layout layout{n, b.count, b.entries};
  for (int k = 0; k < b.levels; k++) layout.magic[k] = b.part[k].magic;
  const std::uint64_t roomy_count = roomy(o.count, b.count) + 1ull;
  const bool fits = lending.slots >= roomy_count ||
                    lending.slots < n,  // no memory of its own for the sake of it
      keepable = !keyed && !grouped && roomy_count > n && fits, kept = keep && keepable && layout == layout_;
  const std::uint64_t split_room = keepable ? roomy_count : n;
  keep_layout(keepable ? layout : Layout{});
  const bool lent = lending.slots >= split_room && lending.words >= (keyed ? 2 * n : 0);
  if (keyed) o.keys = sorted_keys_.reserve(n);
  Places source_places, split, out{o.slots, nullptr, o.keys, o.codes};
  split.slots = lent ? lending.slot : split_slots_.reserve(split_room);
  if (keyed) {
    source_places.keys = lent ? lending.word : keys_.reserve(n);
    split.keys = lent ? lending.word + n : ids_.reserve(n);
  }
  const bool lent_ids = lent && lending.words >= (keyed ? 2 * n : 0) + split_room;
  if (ids) {
    out.ids = o.ids = sorted_ids_.reserve(lent_ids ? n : n + split_room);
    split.ids = lent_ids ? lending.word + (keyed ? 2 * n : 0) : o.ids + n;
  }
  Starts starts;
  starts.finished = starts_.reserve(3 * std::uint64_t(b.count) + 2 * kMostGroups + 6);
  starts.bucket = starts.finished + 1, starts.cursor = starts.bucket + b.count + 1,
  starts.room = starts.cursor + b.count + 1, starts.group_cursor = starts.room + b.count + 1;
  starts.group_tile = starts.group_cursor + kMostGroups;
  if (gather.octaves && !kept) Surveyor::gather_octaves(source, gather, stream);
  if (kept)
    bucket_room_kernel<<<blocks_for(b.count + 1, kCount), kCount, 0, stream>>>(starts, b.count, gather,
                                                                               counters);
  else
    bucket_begin_kernel<<<blocks_for(b.count, kCount), kCount, 0, stream>>>(starts, b.count, bounds,
                                                                            counters);
  const auto radius = static_cast<float>(grid.level[0].radius_max);
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    const auto with_shared = [&](auto* kernel, unsigned blocks, int threads, std::uint32_t bytes,
                                 auto&&... arguments) {
      cuda_check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, kSharedBytes),
                 "take shared memory");
      kernel<<<blocks, threads, bytes, stream>>>(arguments...);
    };
    const unsigned tiles = std::min<unsigned>(blocks_for(n, kTile), kProcessors);
    if (!kept && grouped)
      with_shared(bounds ? bucket_count_kernel<Bins, true, kWide> : bucket_count_kernel<Bins, false, kWide>,
                  kProcessors, kWide, (b.count + 1) * 4, source, bins, b, source_places.keys, starts, groups,
                  bounds, counters);
    else if (!kept)
      with_shared(bounds ? bucket_count_kernel<Bins, true, kCount> : bucket_count_kernel<Bins, false, kCount>,
                  kProcessors * 4, kCount, (b.count + 1) * 4, source, bins, b, source_places.keys, starts,
                  groups, bounds, counters);
    constexpr bool kMayPack = kind() != SlotKind::fixed_point, kMayKeep = kKeyless<Bins>;
    const bool packed = kMayPack && source.packed;
    const auto split_by = [&](auto* kernel, std::uint32_t of, const Places& from, const Places& to) {
      with_shared(kernel, tiles, kWide, tile_bytes(of), source, bins, b, of, starts, from, to, radius,
                  counters);
    };
    constexpr auto kWhole = Pass::whole, kAmong = Pass::among_groups, kWithin = Pass::within_groups;
    if (grouped) {
      split_by(packed ? bucket_split_kernel<kind(), Bins, kAmong, kMayPack, false>
                      : bucket_split_kernel<kind(), Bins, kAmong, false, false>,
               groups, source_places, out);
      split_by(bucket_split_kernel<kind(), Bins, kWithin, false, false>, 1u << kGroupBits, out, split);
    } else if (kept) {
      split_by(packed ? bucket_split_kernel<kind(), Bins, kWhole, kMayPack, kMayKeep>
                      : bucket_split_kernel<kind(), Bins, kWhole, false, kMayKeep>,
               b.count, source_places, split);
    } else {
      split_by(packed ? bucket_split_kernel<kind(), Bins, kWhole, kMayPack, false>
                      : bucket_split_kernel<kind(), Bins, kWhole, false, false>,
               b.count, source_places, split);
    }
    with_shared(kept     ? halved ? bucket_order_kernel<kind(), Bins, kWide / 2, kMayKeep>
                                  : bucket_order_kernel<kind(), Bins, kWide, kMayKeep>
                    : halved ? bucket_order_kernel<kind(), Bins, kWide / 2, false>
                         : bucket_order_kernel<kind(), Bins, kWide, false>,
                b.count, width_of_block, capacity * sphere_bytes + table_bytes, bins, b, capacity, starts,
                split, out, o.table, stable, gather, radius, counters);
  });
  return true;
}

}  // namespace padder::detect::cuda
