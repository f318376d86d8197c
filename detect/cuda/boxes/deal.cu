// SPDX-License-Identifier: MIT
#include "detect/cuda/boxes/deal.h"

#include <cstring>

#include "detect/boxes/contact_batch.h"
#include "detect/boxes/halo.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256, kWarps = kThreads / 32, kMostBlocks = 132 * 8;
constexpr std::uint64_t kTile = 1024;  // spheres that a warp counts together: one counter for each box
constexpr unsigned kScanThreads = 1024;

std::uint64_t tiles_of(std::uint64_t n) { return (n + kTile - 1) / kTile; }
unsigned blocks_of(std::uint64_t warps) {
  const std::uint64_t blocks = (warps + kWarps - 1) / kWarps;
  return static_cast<unsigned>(blocks < kMostBlocks ? (blocks ? blocks : 1) : kMostBlocks);
}

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
};

// A bit for each box that needs the sphere; 0 for a faulty one.
__device__ unsigned boxes_of(const Sphere& s, double largest_radius, const DealRegions& regions) {
  if (fault_of(s) != Fault::none) return 0;
  const Bounds b = halo_of(s, largest_radius);
  unsigned found = 0;
  for (int p = 0; p < regions.count; p++) {
    bool meets = true;
    for (int a = 0; a < 3; a++)
      meets &= b.low[a] < regions.of[p].high[a] && b.high[a] >= regions.of[p].low[a];
    found |= static_cast<unsigned>(meets) << p;
  }
  return found;
}

// Lane p of a warp counts for box p.
template <class T>
__global__ void count_kernel(Source<T> source, DealRegions regions, double largest_radius,
                             std::uint32_t* counts, std::uint64_t tiles, unsigned long long* radius_bits,
                             unsigned long long* faulty) {
  const unsigned lane = threadIdx.x % 32;
  const std::uint64_t warps = std::uint64_t(gridDim.x) * kWarps;
  double largest = 0;
  for (std::uint64_t tile = std::uint64_t(blockIdx.x) * kWarps + threadIdx.x / 32; tile < tiles;
       tile += warps) {
    std::uint32_t mine = 0;
    for (std::uint64_t k = tile * kTile + lane; k < (tile + 1) * kTile; k += 32) {
      unsigned to = 0;
      if (k < source.count) {
        T v[4];
        source.read(k, v);
        const Sphere s{double(v[0]), double(v[1]), double(v[2]), double(v[3])};
        to = boxes_of(s, largest_radius, regions);
        if (fault_of(s) != Fault::none)
          atomicMin(faulty, static_cast<unsigned long long>(k));
        else
          largest = larger(largest, s.r);
      }
      for (int p = 0; p < regions.count; p++) {
        const unsigned there = __popc(__ballot_sync(~0u, to >> p & 1));
        mine += lane == static_cast<unsigned>(p) ? there : 0;
      }
    }
    if (lane < static_cast<unsigned>(regions.count)) counts[lane * tiles + tile] = mine;
  }
  for (unsigned by = 16; by; by /= 2) largest = larger(largest, __shfl_xor_sync(~0u, largest, by));
  // Doubles that are not negative have the order of their bits.
  if (lane == 0 && largest > 0)
    atomicMax(radius_bits, static_cast<unsigned long long>(__double_as_longlong(largest)));
}

// A block for each box: its counts become first places. Each thread takes some tiles that follow one another.
__global__ void scan_kernel(std::uint32_t* counts, std::uint64_t tiles, unsigned long long* totals) {
  __shared__ std::uint32_t sums[kScanThreads];
  std::uint32_t* const mine = counts + blockIdx.x * tiles;
  const std::uint64_t each = (tiles + kScanThreads - 1) / kScanThreads;
  const std::uint64_t first = threadIdx.x * each, end = first + each < tiles ? first + each : tiles;
  std::uint32_t sum = 0;
  for (std::uint64_t t = first; t < end; t++) sum += mine[t];
  sums[threadIdx.x] = sum;
  __syncthreads();
  for (unsigned by = 1; by < kScanThreads; by *= 2) {
    const std::uint32_t before = threadIdx.x >= by ? sums[threadIdx.x - by] : 0;
    __syncthreads();
    sums[threadIdx.x] += before;
    __syncthreads();
  }
  std::uint32_t place = sums[threadIdx.x] - sum;
  for (std::uint64_t t = first; t < end; t++) {
    const std::uint32_t here = mine[t];
    mine[t] = place, place += here;
  }
  if (threadIdx.x == kScanThreads - 1) totals[blockIdx.x] = sums[threadIdx.x];
}

struct DealTargets {
  DealTarget of[kMostResidentDevices];
};

template <class T>
__global__ void write_kernel(Source<T> source, DealRegions regions, double largest_radius,
                             const std::uint32_t* places, std::uint64_t tiles, std::uint64_t first_id,
                             DealTargets targets) {
  const unsigned lane = threadIdx.x % 32;
  const std::uint64_t warps = std::uint64_t(gridDim.x) * kWarps;
  for (std::uint64_t tile = std::uint64_t(blockIdx.x) * kWarps + threadIdx.x / 32; tile < tiles;
       tile += warps) {
    std::uint32_t next = lane < static_cast<unsigned>(regions.count) ? places[lane * tiles + tile] : 0;
    for (std::uint64_t k = tile * kTile + lane; k < (tile + 1) * kTile; k += 32) {
      unsigned to = 0;
      T v[4] = {};
      if (k < source.count) {
        source.read(k, v);
        to = boxes_of({double(v[0]), double(v[1]), double(v[2]), double(v[3])}, largest_radius, regions);
      }
      for (int p = 0; p < regions.count; p++) {
        const unsigned there = __ballot_sync(~0u, to >> p & 1);
        if (there == 0) continue;
        const std::uint64_t place =
            __shfl_sync(~0u, next, p) + static_cast<unsigned>(__popc(there & ((1u << lane) - 1)));
        if (to >> p & 1) {
          const DealTarget& target = targets.of[p];
          static_cast<Quad<T>*>(target.spheres)[place] = {v[0], v[1], v[2], v[3]};
          target.ids[place] = first_id + k;
          if (target.family) target.family[place] = source.family ? source.family[k] : 0;
          if (target.mask) target.mask[place] = source.mask ? source.mask[k] : 0;
          if (target.is_static) target.is_static[place] = source.is_static ? source.is_static[k] : 0;
        }
        next += lane == static_cast<unsigned>(p) ? static_cast<unsigned>(__popc(there)) : 0;
      }
    }
  }
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

DealCounts Dealer::count(const Spheres& spheres, const DealRegions& regions, double largest_radius,
                         cudaStream_t stream) {
  DealCounts found;
  if (spheres.count == 0) return found;
  const std::uint64_t tiles = tiles_of(spheres.count);
  std::uint32_t* const counts = counts_.reserve(tiles * static_cast<std::uint64_t>(regions.count));
  Summary* const summary = summary_.reserve(1);
  Summary host{};
  host.faulty = ~0ull;
  cuda_check(cudaMemcpyAsync(summary, &host, sizeof host, cudaMemcpyHostToDevice, stream), "count spheres");
  as_source(spheres, [&](const auto& source) {
    count_kernel<<<blocks_of(tiles), kThreads, 0, stream>>>(source, regions, largest_radius, counts, tiles,
                                                            &summary->radius_bits, &summary->faulty);
  });
  scan_kernel<<<static_cast<unsigned>(regions.count), kScanThreads, 0, stream>>>(counts, tiles,
                                                                                 summary->totals);
  cuda_launched("count the spheres of the boxes");
  cuda_check(cudaMemcpyAsync(&host, summary, sizeof host, cudaMemcpyDeviceToHost, stream), "count spheres");
  cuda_check(cudaStreamSynchronize(stream), "count the spheres of the boxes");
  for (int p = 0; p < regions.count; p++) found.to[p] = host.totals[p];
  std::memcpy(&found.largest_radius, &host.radius_bits, sizeof found.largest_radius);
  found.faulty = host.faulty;
  return found;
}

void Dealer::write(const Spheres& spheres, const DealRegions& regions, double largest_radius,
                   std::uint64_t first_id, const DealTarget (&to)[kMostResidentDevices],
                   cudaStream_t stream) {
  if (spheres.count == 0) return;
  const std::uint64_t tiles = tiles_of(spheres.count);
  DealTargets targets;
  for (int p = 0; p < regions.count; p++) targets.of[p] = to[p];
  as_source(spheres, [&](const auto& source) {
    write_kernel<<<blocks_of(tiles), kThreads, 0, stream>>>(source, regions, largest_radius, counts_.data(),
                                                            tiles, first_id, targets);
  });
  cuda_launched("copy the spheres of the boxes");
}

std::vector<WeightedPoint> Dealer::sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream) {
  if (spheres.count == 0) return {};
  const std::uint64_t step = spheres.count / most + 1, count = (spheres.count + step - 1) / step;
  MemoryBook book;
  Buffer<Sphere> device(book, "a sample");
  device.reserve(count);
  as_source(spheres, [&](const auto& source) {
    sample_kernel<<<static_cast<unsigned>((count + kThreads - 1) / kThreads), kThreads, 0, stream>>>(
        source, step, device.data(), count);
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
