// SPDX-License-Identifier: MIT
// Divides the spheres among buckets, a portion at a time through shared memory, so that what goes to one
// bucket is written together.
#include "detect/cuda/order/buckets.h"

namespace padder::detect::cuda {
namespace {

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
// The same for several levels. The lanes of a warp ask for different levels, which constant memory would
// answer one by one: so the levels' numbers lie in shared memory. A barrier must follow the constructor.
template <>
struct BucketOf<LevelBins> {
  struct Line {
    float origin[3], per_size;
    std::uint32_t count_xy, count_z, magic, bucket;
  };
  // Of a hashed level, in the place of the origin: row, plane and edge; of count_xy: the mask; of count_z:
  // this.
  static constexpr std::uint32_t kHashed = ~0u;
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
      if (b.size > 0)
        shared.line[threadIdx.x] = {{__uint_as_float(b.row), __uint_as_float(b.plane), b.size},
                                    b.per_size[0],
                                    b.mask,
                                    kHashed,
                                    part.magic,
                                    part.bucket};
    }
  }
  __device__ __forceinline__ std::uint32_t operator()(const LevelBins& bins, const Buckets&,
                                                      const float4& slot) const {
    const int octave = octave_of_exponent(bins.top, need_exponent(slot.x, slot.y, slot.z, slot.w));
    const auto* const line = reinterpret_cast<const float4*>(memory->line + memory->level_of_octave[octave]);
    const float4 a = line[0], b = line[1];
    if (__float_as_uint(b.y) == kHashed) {
      const auto bin = [&](float v) { return static_cast<std::uint32_t>(float_split(v, a.z, a.w).bin); };
      const std::uint32_t key =
          (bin(slot.x) + bin(slot.y) * __float_as_uint(a.x) + bin(slot.z) * __float_as_uint(a.y)) &
          __float_as_uint(b.x);
      return __float_as_uint(b.w) + __umulhi(key, __float_as_uint(b.z));
    }
    const std::uint32_t xy = __float_as_uint(b.x), nx = xy & 0xffff, ny = xy >> 16, nz = __float_as_uint(b.y);
    std::uint32_t i, j, k;
    float_bin(slot.x, a.x, a.w, nx, i), float_bin(slot.y, a.y, a.w, ny, j),
        float_bin(slot.z, a.z, a.w, nz, k);
    const std::uint32_t entry = ((k + 1) * (ny + 2) + j + 1) * (nx + 2) + i + 1;  // as level_bins() has it
    return __float_as_uint(b.w) + __umulhi(entry, __float_as_uint(b.z));
  }
};

// All buckets at once; or groups of buckets first, and then the buckets of each group.
enum class Pass { whole, among_groups, within_groups };

// By the last block that has divided its spheres: buckets begin where the counts of this call say, whether
// they had room or not.
__device__ __noinline__ void begin_as_found(const Starts& starts, std::uint32_t count, std::uint32_t* shared,
                                            std::uint32_t* sums, Counters* counters) {
  if (!is_last(starts)) return;
  for (std::uint32_t b = threadIdx.x; b < count; b += blockDim.x) {
    const std::uint32_t begin = starts.room[b], room = starts.room[b + 1] - begin,
                        found = __ldcg(starts.cursor + b) - begin;
    if (found > room) atomicOr(&counters->flags, kOutgrown);
    shared[b] = found;
  }
  scan_shared(shared, count, sums);
  for (std::uint32_t b = threadIdx.x; b <= count; b += blockDim.x) starts.bucket[b] = shared[b];
}

// A run of spheres that a block divides at once.
struct Portion {
  std::uint32_t first, count, group;
};
template <Pass P>
__device__ __forceinline__ Portion portion_of(const Starts& starts, const Buckets& buckets,
                                              std::uint32_t spheres, std::uint32_t portion,
                                              std::uint32_t group) {
  const std::uint32_t most = buckets.portion_spheres;
  std::uint32_t first = portion * most, end = spheres;
  if (P == Pass::within_groups) {
    while (portion >= starts.group_portion[group + 1]) group++;
    first = starts.bucket[group << kGroupBits] + (portion - starts.group_portion[group]) * most;
    end = starts.bucket[min((group + 1) << kGroupBits, buckets.count)];
  }
  return {first, min(end - first, most), group};
}

// Shared memory of a block: the portion's slots in the order of buckets, the bucket of each, and of each
// bucket its count (then its first place in the portion) and how far its spheres are to be shifted from
// there.
struct PortionMemory {
  float4* slots;
  std::uint16_t* bucket_at;
  std::uint32_t *counts, *shift;
  __device__ __forceinline__ PortionMemory(float4* memory, std::uint32_t spheres, std::uint32_t buckets)
      : slots(memory),
        bucket_at(reinterpret_cast<std::uint16_t*>(memory + spheres)),
        counts(reinterpret_cast<std::uint32_t*>(bucket_at + spheres)),
        shift(counts + buckets + 1) {}
};

// Finds the bucket of each sphere of the portion, and its rank in the bucket. Kept: the radius of all spheres
// is taken from the previous call; a sphere of another radius is reported.
template <SlotKind Kind, class Bins, Pass P, bool Kept>
__device__ __forceinline__ void rank_spheres(const Portion& portion, const float4 (&slot)[kPortionItems],
                                             std::uint32_t (&place)[kPortionItems],
                                             const BucketOf<Bins>& bucket_of, const Bins& bins,
                                             const Buckets& buckets, const Places& in, std::uint32_t* counts,
                                             float radius, Counters* counters) {
#pragma unroll
  for (int u = 0; u < kPortionItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWideBlock;
    std::uint32_t bucket = ~0u;
    if (k < portion.count) {
      if constexpr (!kKeyless<Bins>)
        bucket = buckets.of(in.keys[portion.first + k]);
      else
        bucket = bucket_of(bins, buckets, slot[u]);
      if (Kept && Kind == SlotKind::equal && slot[u].w != radius) atomicOr(&counters->flags, kOutside);
      if (P == Pass::among_groups) bucket >>= kGroupBits;
      if (P == Pass::within_groups) bucket &= (1u << kGroupBits) - 1;
    }
    place[u] = ticket(counts, bucket) | bucket << 16;
  }
}

// Numbers and keys do not fit the slot. They go the same way in a second round, through the memory of the
// slots.
template <SlotKind Kind, class Bins, Pass P, class PlaceOf>
__device__ __forceinline__ void move_ids_and_keys(const Portion& portion,
                                                  const std::uint32_t (&place)[kPortionItems],
                                                  const PortionMemory& memory, std::uint32_t most,
                                                  const Places& in, const Places& out, PlaceOf place_of) {
  constexpr bool kIds = Kind != SlotKind::equal, kKeys = !kKeyless<Bins>, kWithin = P == Pass::within_groups;
  auto *numbers = reinterpret_cast<std::uint32_t*>(memory.slots), *portion_keys = numbers + most;
#pragma unroll
  for (int u = 0; u < kPortionItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWideBlock;
    if (k >= portion.count) break;
    if (kIds) numbers[place[u]] = kWithin ? in.ids[portion.first + k] : portion.first + k;
    if (kKeys) portion_keys[place[u]] = in.keys[portion.first + k];
  }
  __syncthreads();
  for (std::uint32_t s = threadIdx.x; s < portion.count; s += kWideBlock) {
    const std::uint32_t to = place_of(memory.shift[memory.bucket_at[s]] + s);
    if (kIds) out.ids[to] = numbers[s];
    if (kKeys) out.keys[to] = portion_keys[s];
  }
  __syncthreads();
}

// The thread's spheres of a portion.
template <SlotKind Kind, Pass P, bool Packed>
__device__ __forceinline__ void read_portion(const Portion& t, const DeviceSpheres& source, const Grid* grid,
                                             const Places& in, float4 (&slot)[kPortionItems]) {
  constexpr bool kWithin = P == Pass::within_groups;
  if constexpr (Packed && !kWithin) {
    if (const float4* const run = source.float_run(t.first, t.count)) {
#pragma unroll
      for (int u = 0; u < kPortionItems; u++)
        if (const std::uint32_t k = threadIdx.x + u * kWideBlock; k < t.count) slot[u] = __ldg(run + k);
      return;
    }
  }
#pragma unroll
  for (int u = 0; u < kPortionItems; u++) {
    const std::uint32_t k = threadIdx.x + u * kWideBlock;
    if (k < t.count)
      slot[u] = kWithin ? static_cast<const float4*>(in.slots)[t.first + k]
                        : bare_slot<Kind, Packed>(source, grid, t.first + k);
  }
}

// A block takes portions of spheres, one after the other: it orders a portion by bucket in shared memory,
// then writes each bucket's spheres to one place. The next portion is read while this one is written. Kept:
// buckets have room by the previous call; one that has outgrown it is reported.
template <SlotKind Kind, class Bins, Pass P, bool Packed, bool Kept>
__global__ void __launch_bounds__(kWideBlock)
    bucket_split_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ Bins bins,
                        const __grid_constant__ Buckets buckets, std::uint32_t count,
                        const __grid_constant__ Starts starts, Places in, Places out, float radius,
                        Counters* counters) {
  constexpr int kBucketsAThread = kMostAtOnce / kWideBlock;
  constexpr bool kKeys = !kKeyless<Bins>, kIds = Kind != SlotKind::equal, kWithin = P == Pass::within_groups;
  extern __shared__ float4 slots[];
  const PortionMemory memory(slots, buckets.portion_spheres, count);
  auto *const counts = memory.counts, *const shift = memory.shift;
  __shared__ std::uint32_t sums[32];
  const std::uint32_t groups = groups_of(buckets.count);
  const auto portions =
      kWithin ? starts.group_portion[groups]
              : source.count / buckets.portion_spheres + (source.count % buckets.portion_spheres != 0);
  const BucketOf<Bins> bucket_of(bins, buckets);
  float4 slot[kPortionItems];
  const auto read = [&](const Portion& t) {
    read_portion<Kind, P, Packed>(t, source, grid_of(bins), in, slot);
  };
  for (std::uint32_t b = threadIdx.x; b < count; b += kWideBlock) counts[b] = 0;
  // A bucket that has outgrown its room runs into the next one's. The last bucket stops at the last place.
  const std::uint32_t last_place = Kept ? starts.room[count] : 0;
  const auto place_of = [&](std::uint32_t to) { return Kept ? min(to, last_place) : to; };
  std::uint32_t number = blockIdx.x;
  if (number >= portions) return;
  std::uint32_t group = 0;
  read(portion_of<P>(starts, buckets, source.count, number, 0));
  __syncthreads();
  for (; number < portions; number += gridDim.x) {
    const Portion portion = portion_of<P>(starts, buckets, source.count, number, group);
    group = portion.group;
    std::uint32_t* const cursors = P == Pass::whole          ? starts.cursor
                                   : P == Pass::among_groups ? starts.group_cursor
                                                             : starts.cursor + (portion.group << kGroupBits);
    std::uint32_t place[kPortionItems];  // bucket and rank in it; then the place in the portion
    rank_spheres<Kind, Bins, P, Kept>(portion, slot, place, bucket_of, bins, buckets, in, counts, radius,
                                      counters);
    scan_shared(counts, count, sums);
#pragma unroll
    for (int u = 0; u < kPortionItems; u++) {
      if (threadIdx.x + u * kWideBlock >= portion.count) break;
      const std::uint32_t bucket = place[u] >> 16;
      place[u] = counts[bucket] + (place[u] & 0xffff);
      if (Kind == SlotKind::equal && !kWithin)
        slot[u].w = __uint_as_float(portion.first + threadIdx.x + u * kWideBlock);
      slots[place[u]] = slot[u], memory.bucket_at[place[u]] = static_cast<std::uint16_t>(bucket);
    }
    // The registers of the slots are free now. The thread asks for places in the buckets and for the next
    // portion before it waits for either.
    std::uint32_t taken[kBucketsAThread];
#pragma unroll
    for (int u = 0; u < kBucketsAThread; u++) {
      const std::uint32_t b = threadIdx.x + u * kWideBlock, c = b < count ? counts[b + 1] - counts[b] : 0;
      taken[u] = c ? atomicAdd(cursors + b, c) : 0;
    }
    if (number + gridDim.x < portions)
      read(portion_of<P>(starts, buckets, source.count, number + gridDim.x, group));
#pragma unroll
    for (int u = 0; u < kBucketsAThread; u++) {
      const std::uint32_t b = threadIdx.x + u * kWideBlock;
      if (b < count) shift[b] = taken[u] - counts[b];
    }
    __syncthreads();
    for (std::uint32_t b = threadIdx.x; b < count; b += kWideBlock) counts[b] = 0;
    for (std::uint32_t s = threadIdx.x; s < portion.count; s += kWideBlock)
      static_cast<float4*>(out.slots)[place_of(shift[memory.bucket_at[s]] + s)] = slots[s];
    __syncthreads();
    if (kIds || kKeys)
      move_ids_and_keys<Kind, Bins, P>(portion, place, memory, buckets.portion_spheres, in, out, place_of);
  }
  if constexpr (Kept) begin_as_found(starts, count, counts, sums, counters);
}

}  // namespace

void split_into_buckets(const BucketPlan& p, const DeviceSpheres& source, const Ordered& o, const Grid& grid,
                        cudaStream_t stream) {
  const std::uint32_t n = o.count, count = p.buckets.count;
  with_bins(o, grid, [&]<class Kind, class Bins>(Kind kind, const Bins& bins) {
    const auto launch = [&](auto* kernel, std::uint32_t among, const Places& from, const Places& to) {
      launch_with_shared(
          kernel,
          std::min<unsigned>(blocks_for(n, static_cast<int>(p.buckets.portion_spheres)), p.processors),
          kWideBlock, portion_bytes(p.buckets.portion_spheres, among), p.shared_bytes, stream, source, bins,
          p.buckets, among, p.starts, from, to, static_cast<float>(p.radius), p.counters);
    };
    constexpr bool kMayPack = kind() != SlotKind::fixed_point, kMayKeep = kKeyless<Bins>;
    constexpr auto kWhole = Pass::whole, kAmong = Pass::among_groups, kWithin = Pass::within_groups;
    const bool packed = kMayPack && source.packed && !source.wide;
    if (p.groups > 0) {
      launch(packed ? bucket_split_kernel<kind(), Bins, kAmong, kMayPack, false>
                    : bucket_split_kernel<kind(), Bins, kAmong, false, false>,
             p.groups, p.source, p.out);
      launch(bucket_split_kernel<kind(), Bins, kWithin, false, false>, 1u << kGroupBits, p.out, p.split);
    } else if (p.kept) {
      launch(packed ? bucket_split_kernel<kind(), Bins, kWhole, kMayPack, kMayKeep>
                    : bucket_split_kernel<kind(), Bins, kWhole, false, kMayKeep>,
             count, p.source, p.split);
    } else {
      launch(packed ? bucket_split_kernel<kind(), Bins, kWhole, kMayPack, false>
                    : bucket_split_kernel<kind(), Bins, kWhole, false, false>,
             count, p.source, p.split);
    }
  });
}

}  // namespace padder::detect::cuda
