// SPDX-License-Identifier: MIT
#include "detect/cuda/boxes/deal.h"

#include <cstring>
#include <cub/device/device_radix_sort.cuh>

#include "detect/boxes/contact_batch.h"
#include "detect/boxes/halo.h"
#include "detect/boxes/numbered_hash.h"
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/input/host_copy.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256, kWarps = kThreads / 32, kMostBlocks = 132 * 8;
constexpr unsigned kRows = 8;  // spheres of a thread: its registers hold them
constexpr std::uint64_t kTile = std::uint64_t(kThreads) * kRows;  // spheres of a block
// What is known of a tile: nothing, how many spheres of the own box it has, or how many there are up to its
// end.
constexpr unsigned long long kHere = 1ull << 62, kUpTo = 2ull << 62, kCount = kHere - 1;

// Read and written at once.
template <class T>
struct alignas(16) Quad {
  T x, y, z, w;
};

template <class T>
struct Source {
  const T *centers, *radii;
  std::uint32_t center_stride, radius_stride;
  bool packed;  // x, y, z, r of a sphere lie together and may be read at once
  std::uint64_t count;
  const std::uint32_t *family, *mask;
  const std::uint8_t* is_static;

  explicit Source(const Spheres& s)
      : centers(static_cast<const T*>(s.centers)),
        radii(static_cast<const T*>(s.radii)),
        center_stride(s.center_stride),
        radius_stride(s.radius_stride),
        packed(s.center_stride == 4 && s.radius_stride == 4 && radii == centers + 3 &&
               reinterpret_cast<std::uintptr_t>(centers) % alignof(Quad<T>) == 0),
        count(s.count),
        family(s.family),
        mask(s.mask),
        is_static(s.is_static) {}

  __device__ void read(std::uint64_t k, T (&v)[4]) const {
    if (packed) {
      const Quad<T> q = reinterpret_cast<const Quad<T>*>(centers)[k];
      v[0] = q.x, v[1] = q.y, v[2] = q.z, v[3] = q.w;
    } else {
      for (int a = 0; a < 3; a++) v[a] = centers[k * center_stride + static_cast<std::uint64_t>(a)];
      v[3] = radii[k * radius_stride];
    }
  }
  // Sphere k is number `place` of `to`.
  __device__ void copy(std::uint64_t k, const T (&v)[4], std::uint64_t id, const DealTarget& to,
                       std::uint64_t place) const {
    static_cast<Quad<T>*>(to.spheres)[place] = {v[0], v[1], v[2], v[3]};
    to.ids[place] = id;
    if (to.family) to.family[place] = family ? family[k] : 0;
    if (to.mask) to.mask[place] = mask ? mask[k] : 0;
    if (to.is_static) to.is_static[place] = is_static ? is_static[k] : 0;
  }
};

// A bit for each box that needs the sphere; 0 for a faulty one. A halo that lies within the own box meets no
// other.
__device__ unsigned boxes_of(const Sphere& s, double largest_radius, const DealRegions& regions, int own) {
  if (fault_of(s) != Fault::none) return 0;
  const Bounds b = halo_of(s, largest_radius);
  bool within = true;
  for (int a = 0; a < 3; a++)
    within &= b.low[a] >= regions.of[own].low[a] && b.high[a] < regions.of[own].high[a];
  if (within) return 1u << own;
  unsigned found = 0;
  for (int p = 0; p < regions.count; p++) {
    bool meets = true;
    for (int a = 0; a < 3; a++)
      meets &= b.low[a] < regions.of[p].high[a] && b.high[a] >= regions.of[p].low[a];
    found |= static_cast<unsigned>(meets) << p;
  }
  return found;
}

// By a whole warp: how many spheres of the own box the tiles before this one have. It makes its own count
// known first, and adds up those before it, 32 at a time, until one says how many there are up to its end
// (Merrill and Garland 2016, decoupled look-back). Tiles are handed out in order, so those before it run or
// have run.
__device__ std::uint64_t spheres_before(unsigned long long* tiles, std::uint64_t tile, std::uint64_t here) {
  const unsigned lane = threadIdx.x % 32;
  volatile unsigned long long* const known = tiles;
  if (lane == 0) known[tile] = (tile ? kHere : kUpTo) | here;
  std::uint64_t before = 0;
  for (std::int64_t last = static_cast<std::int64_t>(tile) - 1; last >= 0; last -= 32) {
    const std::int64_t other = last - lane;
    unsigned long long word = 0;
    do word = other >= 0 ? known[other] : 0 + kUpTo;
    while (__any_sync(~0u, word == 0));
    const unsigned ends = __ballot_sync(~0u, word >= kUpTo);
    std::uint64_t sum = ends == 0 || lane < static_cast<unsigned>(__ffs(ends)) ? word & kCount : 0;
    for (unsigned by = 16; by; by /= 2) sum += __shfl_xor_sync(~0u, sum, by);
    before += sum;
    if (ends) break;
  }
  if (lane == 0 && tile) known[tile] = kUpTo | (before + here);
  return before;
}

struct DealTask {
  DealRegions regions;
  int own;
  double largest_radius;
  std::uint64_t first_id, own_room, away_room;
  DealTarget to;
  unsigned long long *tiles, *away, *totals, *away_count, *radius_bits, *faulty;
  unsigned* next_tile;
};

// Notes where the spheres of a warp go beside the own box: `others` has a bit for each box of the lane's
// sphere k.
__device__ void note_away(const DealTask& task, unsigned others, std::uint64_t k) {
  const unsigned lane = threadIdx.x % 32;
  for (int p = 0; p < task.regions.count; p++) {
    const unsigned there = __ballot_sync(~0u, others >> p & 1), count = static_cast<unsigned>(__popc(there));
    if (there == 0) continue;
    unsigned long long place = 0;
    if (lane == 0) place = atomicAdd(task.away_count, count), atomicAdd(task.totals + p, count);
    place = __shfl_sync(~0u, place, 0) + static_cast<unsigned>(__popc(there & ((1u << lane) - 1)));
    if ((others >> p & 1) && place < task.away_room)
      task.away[place] = static_cast<unsigned long long>(p) << 32 | k;
  }
}

// A block for each tile. All loads of a thread are under way at once; the spheres stay in registers, since to
// read them a second time takes a tenth longer.
template <class T>
__global__ void __launch_bounds__(kThreads) deal_kernel(Source<T> source, DealTask task) {
  __shared__ unsigned tile_of_block;
  __shared__ std::uint32_t of_warps[kWarps];
  __shared__ std::uint64_t before_tile;
  const unsigned lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  if (threadIdx.x == 0) tile_of_block = atomicAdd(task.next_tile, 1u);
  __syncthreads();
  const std::uint64_t tile = tile_of_block, first = tile * kTile + warp * (32 * kRows) + lane;
  T v[kRows][4];
  unsigned kept[kRows];  // the lanes whose sphere stays
  std::uint32_t of_warp = 0;
  double largest = 0;
#pragma unroll
  for (unsigned r = 0; r < kRows; r++)
    if (first + 32 * r < source.count) source.read(first + 32 * r, v[r]);
#pragma unroll
  for (unsigned r = 0; r < kRows; r++) {
    const std::uint64_t k = first + 32 * r;
    unsigned to = 0;
    if (k < source.count) {
      const Sphere s{double(v[r][0]), double(v[r][1]), double(v[r][2]), double(v[r][3])};
      to = boxes_of(s, task.largest_radius, task.regions, task.own);
      if (fault_of(s) != Fault::none)
        atomicMin(task.faulty, static_cast<unsigned long long>(k));
      else
        largest = larger(largest, s.r);
    }
    kept[r] = __ballot_sync(~0u, to >> task.own & 1);
    of_warp += static_cast<unsigned>(__popc(kept[r]));
    const unsigned others = to & ~(1u << task.own);
    if (__any_sync(~0u, others != 0)) note_away(task, others, k);
  }
  for (unsigned by = 16; by; by /= 2) largest = larger(largest, __shfl_xor_sync(~0u, largest, by));
  // Doubles that are not negative have the order of their bits.
  const auto bits = static_cast<unsigned long long>(__double_as_longlong(largest));
  if (lane == 0 && largest > 0 && bits > *static_cast<volatile unsigned long long*>(task.radius_bits))
    atomicMax(task.radius_bits, bits);
  if (lane == 0) of_warps[warp] = of_warp;
  __syncthreads();
  if (warp == 0) {
    std::uint32_t here = 0;
    for (unsigned w = 0; w < kWarps; w++) here += of_warps[w];
    const std::uint64_t before = spheres_before(task.tiles, tile, here);
    if (lane == 0) before_tile = before;
    if (lane == 0 && tile + 1 == gridDim.x) task.totals[task.own] = before + here;
  }
  __syncthreads();
  std::uint64_t place = before_tile;
  for (unsigned w = 0; w < warp; w++) place += of_warps[w];
#pragma unroll
  for (unsigned r = 0; r < kRows; r++) {
    const std::uint64_t k = first + 32 * r,
                        there = place + static_cast<unsigned>(__popc(kept[r] & ((1u << lane) - 1)));
    if ((kept[r] >> lane & 1) && there < task.own_room)
      source.copy(k, v[r], task.first_id + k, task.to, there);
    place += static_cast<unsigned>(__popc(kept[r]));
  }
}

template <class T>
__global__ void __launch_bounds__(kThreads)
    gather_kernel(Source<T> source, const unsigned long long* away, std::uint64_t count,
                  std::uint64_t first_id, DealTarget to) {
  const std::uint64_t place = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x;
  if (place >= count) return;
  const std::uint64_t k = static_cast<std::uint32_t>(away[place]);
  T v[4];
  source.read(k, v);
  source.copy(k, v, first_id + k, to, place);
}

template <class T>
__global__ void sample_kernel(Source<T> source, std::uint64_t step, Sphere* to, std::uint64_t count) {
  const std::uint64_t k = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x;
  if (k >= count) return;
  const std::uint64_t start = k * step, end = start + step < source.count ? start + step : source.count;
  const std::uint64_t drawn = start + mixed(start) % step;
  T v[4];
  source.read(drawn < end ? drawn : end - 1, v);
  to[k] = {double(v[0]), double(v[1]), double(v[2]), double(v[3])};
}

__global__ void number_kernel(std::uint64_t bodies, const std::uint64_t* of_loose, std::uint64_t count,
                              std::uint64_t* to) {
  for (std::uint64_t k = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x; k < count;
       k += std::uint64_t(gridDim.x) * kThreads)
    to[k] = k < bodies ? k : bodies + of_loose[k - bodies];
}

__global__ void hash_kernel(const Pair* pairs, std::uint64_t count, const std::uint64_t* ids,
                            unsigned long long* sum) {
  unsigned long long mine = 0;
  for (std::uint64_t k = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x; k < count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const Pair p = pairs[k];
    mine += ids ? wide_pair_hash(ids[p.i], ids[p.j]) : wide_pair_hash(p.i, p.j);
  }
  for (unsigned by = 16; by; by /= 2) mine += __shfl_xor_sync(~0u, mine, by);
  if (threadIdx.x % 32 == 0) atomicAdd(sum, mine);
}

template <class Use>
void as_source(const Spheres& spheres, const Use& use) {
  if (spheres.scalar == Scalar::f32)
    use(Source<float>(spheres));
  else
    use(Source<double>(spheres));
}

}  // namespace

DealCounts Dealer::deal(const Spheres& spheres, const DealRegions& regions, int own, double largest_radius,
                        std::uint64_t first_id, const DealTarget& to, std::uint64_t own_room,
                        std::uint64_t away_room, cudaStream_t stream) {
  DealCounts found;
  if (spheres.count == 0) return found;
  const std::uint64_t tiles = (spheres.count + kTile - 1) / kTile;
  Summary* const summary = summary_.reserve(1);
  Summary host{};
  host.faulty = ~0ull;
  DealTask task{regions, own, largest_radius, first_id, own_room, away_room, to};
  task.tiles = tiles_.reserve(tiles), task.away = away_.reserve(away_room);
  task.totals = summary->totals, task.away_count = &summary->away, task.radius_bits = &summary->radius_bits;
  task.faulty = &summary->faulty, task.next_tile = &summary->next_tile;
  cuda_check(cudaMemcpyAsync(summary, &host, sizeof host, cudaMemcpyHostToDevice, stream),
             "deal the spheres out");
  cuda_check(cudaMemsetAsync(task.tiles, 0, tiles * sizeof *task.tiles, stream), "deal the spheres out");
  as_source(spheres, [&](const auto& source) {
    deal_kernel<<<static_cast<unsigned>(tiles), kThreads, 0, stream>>>(source, task);
  });
  cuda_launched("deal the spheres out");
  cuda_check(cudaMemcpyAsync(&host, summary, sizeof host, cudaMemcpyDeviceToHost, stream),
             "deal the spheres out");
  cuda_check(cudaStreamSynchronize(stream), "deal the spheres out");
  for (int p = 0; p < regions.count; p++) found.to[p] = host.totals[p];
  found.away = host.away;
  std::memcpy(&found.largest_radius, &host.radius_bits, sizeof found.largest_radius);
  found.faulty = host.faulty;
  return found;
}

void Dealer::gather_away(const Spheres& spheres, std::uint64_t away, std::uint64_t first_id,
                         const DealTarget& to, cudaStream_t stream) {
  if (away == 0) return;
  constexpr int kBits = 32 + 4;  // a sphere's and a box's
  static_assert(kMostResidentDevices <= 1 << (kBits - 32));
  cub::DoubleBuffer<unsigned long long> keys(away_.data(), sorted_.reserve(away_.capacity()));
  const auto sort = [&](void* space, std::size_t& bytes) {
    cuda_check(cub::DeviceRadixSort::SortKeys(space, bytes, keys, away, 0, kBits, stream),
               "order the spheres");
  };
  std::size_t bytes = 0;
  sort(nullptr, bytes);
  sort(sort_space_.reserve(bytes), bytes);
  as_source(spheres, [&](const auto& source) {
    gather_kernel<<<blocks_for(away, kThreads), kThreads, 0, stream>>>(source, keys.Current(), away, first_id,
                                                                       to);
  });
  cuda_launched("copy the spheres for other boxes");
}

std::vector<WeightedPoint> Dealer::sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream) {
  if (spheres.count == 0) return {};
  const std::uint64_t step = spheres.count / most + 1, count = (spheres.count + step - 1) / step;
  MemoryBook book;
  Buffer<Sphere> device(book, "a sample");
  device.reserve(count);
  as_source(spheres, [&](const auto& source) {
    sample_kernel<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(source, step, device.data(), count);
  });
  cuda_launched("draw a sample");
  std::vector<Sphere> drawn(count);
  cuda_check(
      cudaMemcpyAsync(drawn.data(), device.data(), count * sizeof(Sphere), cudaMemcpyDeviceToHost, stream),
      "draw a sample");
  cuda_check(cudaStreamSynchronize(stream), "draw a sample");
  std::vector<WeightedPoint> points;
  for (const Sphere& s : drawn)
    if (fault_of(s) == Fault::none) points.push_back({{s.x, s.y, s.z}, static_cast<double>(step)});
  return points;
}

void number_spheres(std::uint64_t bodies, const std::uint64_t* of_loose, std::uint64_t loose,
                    std::uint64_t* to, cudaStream_t stream) {
  number_kernel<<<kMostBlocks, kThreads, 0, stream>>>(bodies, of_loose, bodies + loose, to);
  cuda_launched("number the spheres");
}

std::uint64_t hash_of_numbered_pairs(const Pair* pairs, std::uint64_t count, const std::uint64_t* ids,
                                     Buffer<unsigned long long>& sum, cudaStream_t stream) {
  if (count == 0) return 0;
  unsigned long long *device = sum.reserve(1), value = 0;
  cuda_check(cudaMemsetAsync(device, 0, sizeof value, stream), "hash the contacts");
  hash_kernel<<<kMostBlocks, kThreads, 0, stream>>>(pairs, count, ids, device);
  cuda_launched("hash the contacts");
  cuda_check(cudaMemcpyAsync(&value, device, sizeof value, cudaMemcpyDeviceToHost, stream),
             "hash the contacts");
  cuda_check(cudaStreamSynchronize(stream), "hash the contacts");
  return value;
}

}  // namespace padder::detect::cuda

namespace padder::detect {

struct NumberedHash::Memory {
  cuda::MemoryBook book;
  cuda::HostCopy host;
  cuda::Buffer<std::uint64_t> numbers{book, "the numbers of the spheres"};
  cuda::Buffer<unsigned long long> sum{book, "the hash"};
};

NumberedHash::NumberedHash() = default;
NumberedHash::~NumberedHash() = default;
void NumberedHash::release() { memory_.reset(); }

std::uint64_t NumberedHash::of(int device, const Pair* pairs, std::uint64_t count,
                               std::span<const std::uint64_t> ids) {
  const cuda::OnDevice on(device);
  on.require();
  if (!memory_) memory_ = std::make_unique<Memory>();
  std::uint64_t* numbers = memory_->numbers.reserve(ids.size());
  memory_->host.run(numbers, ids.data(), ids.size_bytes(), "number the contacts", nullptr);
  return cuda::hash_of_numbered_pairs(pairs, count, numbers, memory_->sum, nullptr);
}

}  // namespace padder::detect
