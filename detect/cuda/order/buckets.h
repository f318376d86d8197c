// SPDX-License-Identifier: MIT
// What the passes of the order through buckets share (buckets.cu tells the way). A bucket is a row of
// consecutive entries of the table of bins. Only bucket*.cu include this.
#pragma once
#include "detect/cuda/order/order_kernels.h"

namespace padder::detect::cuda {

constexpr int kWideBlock = 1024;  // threads of a block that fills a processor
// Spheres a thread, at most: of a portion that is divided at once; of a bucket that is put in order at once.
constexpr int kPortionItems = tuning::kPortionItems, kMostBucketItems = 10;
// At most: buckets that spheres can be divided among at once; of a group.
constexpr std::uint32_t kMostAtOnce = 6144, kGroupBits = 10;
__host__ __device__ constexpr std::uint32_t groups_of(std::uint32_t buckets) {
  return (buckets + (1u << kGroupBits) - 1) >> kGroupBits;
}

// Which bucket holds a table entry: entries first_entry(b) to first_entry(b + 1) - 1 are of bucket b. Each
// level has buckets of its own width, because the levels' bins are not equally full.
struct Buckets {
  std::uint32_t count = 0, entries = 1, widest = 1;
  std::uint32_t portion_spheres = 0;  // that a block divides among buckets at once
  int merge = 0, levels = 1;
  // Of a level: its first entry and its first bucket; 2^32 / width.
  struct Part {
    std::uint32_t entry = 0, bucket = 0, magic = 1;
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

// Where each bucket begins (`bucket`, in which the counts stand first) and where its next sphere goes
// (`cursor`). Where the next sphere of each group goes, and the first portion of each group. `room`: where
// each bucket begins while spheres are divided by the previous call's counts. `finished`: blocks of a kernel
// that are done, so that the last block knows that it is the last.
struct Starts {
  std::uint32_t *finished = nullptr, *bucket = nullptr, *cursor = nullptr, *room = nullptr,
                *group_cursor = nullptr, *group_portion = nullptr;
};
// Where a bucket's room begins, if its spheres began at `start` in the previous call: all buckets before it
// get a sixteenth more room than they needed, and 64 spheres more each.
__host__ __device__ constexpr std::uint32_t roomy(std::uint32_t start, std::uint32_t bucket) {
  return start + start / 16 + 64 * bucket;
}

// Called by all threads of each block. True in the block that comes last: it sees what the others wrote
// before.
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

// How the spheres are to be divided, and with what: decided by the host once for all passes.
struct BucketPlan {
  Buckets buckets;
  Starts starts;
  std::uint32_t groups = 0;  // of buckets; 0: spheres are divided among all buckets at once
  double radius = 0;         // of all spheres, for SlotKind::equal
  bool kept = false;         // buckets have room by the previous call; nothing is counted
  bool stable = false;
  // Of the block that puts a bucket in order: threads, spheres that fit, bytes of the table.
  int threads = kWideBlock;
  std::uint32_t capacity = 0, table_bytes = 0;
  std::uint32_t shared_bytes = 0;  // that a block may have
  Places source, split, out;       // spheres as given; divided among buckets; in order
  Gather gather;
  Counters* counters = nullptr;
  int processors = 1;
};
// Each for all spheres; `o` and `grid` tell the kind of slots and bins.
void begin_buckets(const BucketPlan& plan, cudaStream_t stream);  // before anything else
void count_buckets(const BucketPlan& plan, const DeviceSpheres& source, const Ordered& o, const Grid& grid,
                   cudaStream_t stream);
void split_into_buckets(const BucketPlan& plan, const DeviceSpheres& source, const Ordered& o,
                        const Grid& grid, cudaStream_t stream);
void order_buckets(const BucketPlan& plan, const Ordered& o, const Grid& grid, cudaStream_t stream);

// What goes with the slot of a sphere: its key, its number. And the bytes of all.
inline bool has_keys(const Ordered& o) { return !o.bins.on && !o.float_levels; }
inline bool has_ids(const Ordered& o) { return o.kind != SlotKind::equal; }
inline std::uint32_t sphere_bytes(const Ordered& o) {
  return 16 + (has_ids(o) ? 4 : 0) + (has_keys(o) ? 4 : 0);
}

// Shared memory of a block that divides so many spheres among so many buckets.
constexpr std::uint32_t portion_bytes(std::uint32_t spheres, std::uint32_t buckets) {
  return spheres * 18 + (2 * buckets + 1) * 4;
}

// Launches a kernel with `bytes` of shared memory, of `most` that a block may have.
template <class... Parameters, class... Arguments>
void launch_with_shared(void (*kernel)(Parameters...), unsigned blocks, int threads, std::uint32_t bytes,
                        std::uint32_t most, cudaStream_t stream, const Arguments&... arguments) {
  cuda_check(
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(most)),
      "take shared memory");
  kernel<<<blocks, threads, bytes, stream>>>(arguments...);
}

}  // namespace padder::detect::cuda
