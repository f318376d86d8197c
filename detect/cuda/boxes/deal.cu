// SPDX-License-Identifier: MIT
#include "detect/cuda/boxes/deal.h"

#include <thrust/iterator/counting_iterator.h>
#include <algorithm>
#include <bit>
#include <cstring>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include "detect/boxes/contact_batch.h"
#include "detect/boxes/halo.h"
#include "detect/boxes/numbered_hash.h"
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/input/host_copy.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256, kWarps = kThreads / 32, kMostBlocks = 132 * 8;
constexpr unsigned kRows = 8;  // spheres of a thread that are read at once

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
  const std::uint32_t *family, *mask, *world;
  std::uint32_t world_of_all;
  const std::uint8_t* is_static;

  explicit Source(const Spheres& s)
      : centers(static_cast<const T*>(s.centers)),
        radii(static_cast<const T*>(s.radii)),
        center_stride(s.center_stride),
        radius_stride(s.radius_stride),
        packed(is_packed(s)),
        count(s.count),
        family(s.family),
        mask(s.mask),
        world(s.world),
        world_of_all(s.world_of_all),
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
    if (to.ids) to.ids[place] = id;
    if (to.family) to.family[place] = family ? family[k] : 0;
    if (to.mask) to.mask[place] = mask ? mask[k] : 0;
    if (to.world) to.world[place] = world ? world[k] : world_of_all;
    if (to.is_static) to.is_static[place] = is_static ? is_static[k] : 0;
  }
};

// A cheap test in the input's own arithmetic for nearly all spheres: is the sphere without fault, and its
// halo (halo.h) in the own box for sure? The slack of 2^-20 (float) or 2^-40 (double) of the lengths covers
// the halo's 2^-46, and the roundings here and that of a face, which are 2^-24 or 2^-53 each; `least`
// is for lengths that underflow. What is no number fails a comparison.
template <class T>
struct Within {
  static constexpr T kSlack = sizeof(T) == 4 ? 0x1p-20 : 0x1p-40,
                     kLeast = sizeof(T) == 4 ? 0x1p-100 : 0x1p-900;
  T low[3], high[3], largest_radius, margin;

  Within(const Region& r, const HaloWidth& w)
      : largest_radius(static_cast<T>(w.largest_radius)), margin(static_cast<T>(w.margin)) {
    for (int a = 0; a < 3; a++) low[a] = static_cast<T>(r.low[a]), high[a] = static_cast<T>(r.high[a]);
  }
  __device__ bool operator()(const T (&v)[4]) const {
    const T m = fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2])), r = v[3];
    bool within = r >= 0;
    if constexpr (sizeof(T) == 8) within = within && m <= kLargest && r <= kLargest;
#pragma unroll
    for (int a = 0; a < 3; a++) {
      // A face that was rounded is off by a part of itself, which is no more than a part of a sphere near it.
      const T reach = r + margin / 2 + (kSlack * (m + r + largest_radius + margin) + kLeast);
      within = within && v[a] - reach >= low[a] && v[a] + reach < high[a];
    }
    return within;
  }
};

// What deal() counts: a word for each of these, then the spheres for each box.
enum Counter { kAway, kAstray, kRadiusBits, kFaulty, kStaying, kFirstBox };

struct DealTask {
  const Region* boxes;
  unsigned box_count, own, number_bits;
  Region own_box;
  HaloWidth halos;
  std::uint64_t away_room;
  unsigned long long *away, *counts;
};

// By a whole warp: notes where its spheres go beside the own box. `asked`: the lane's sphere k is to be
// looked at.
__device__ __noinline__ void note_away(const DealTask& task, bool asked, const Sphere& s, std::uint64_t k) {
  const unsigned lane = threadIdx.x % 32;
  const bool faulty = asked && fault_of(s) != Fault::none;
  if (faulty) atomicMin(task.counts + kFaulty, static_cast<unsigned long long>(k));
  asked = asked && !faulty;
  const Bounds halo = task.halos.of(s);
  const unsigned astray = __ballot_sync(~0u, asked && !meets(halo, task.own_box));
  if (lane == 0 && astray) atomicAdd(task.counts + kAstray, static_cast<unsigned long long>(__popc(astray)));
  asked = asked && !lies_within(halo, task.own_box);
  if (!__any_sync(~0u, asked)) return;
  for (unsigned b = 0; b < task.box_count; b++) {
    if (b == task.own) continue;
    const bool goes = asked && meets(halo, task.boxes[b]);
    const unsigned there = __ballot_sync(~0u, goes), count = static_cast<unsigned>(__popc(there));
    if (there == 0) continue;
    unsigned long long place = 0;
    if (lane == 0)
      place = atomicAdd(task.counts + kAway, count), atomicAdd(task.counts + kFirstBox + b, count);
    place = __shfl_sync(~0u, place, 0) + static_cast<unsigned>(__popc(there & ((1u << lane) - 1)));
    if (goes && place < task.away_room)
      task.away[place] = static_cast<unsigned long long>(b) << task.number_bits | k;
  }
}

// All loads of a thread are under way at once.
template <class T>
__global__ void __launch_bounds__(kThreads)
    deal_kernel(const __grid_constant__ Source<T> source, const __grid_constant__ Within<T> within,
                const __grid_constant__ DealTask task) {
  const unsigned lane = threadIdx.x % 32;
  const std::uint64_t warp = std::uint64_t(blockIdx.x) * kWarps + threadIdx.x / 32,
                      step = std::uint64_t(gridDim.x) * kThreads * kRows;
  T largest = 0;
  for (std::uint64_t first = warp * (32 * kRows); first < source.count; first += step) {
    T v[kRows][4];
#pragma unroll
    for (unsigned r = 0; r < kRows; r++)
      if (const std::uint64_t k = first + 32 * r + lane; k < source.count) source.read(k, v[r]);
#pragma unroll
    for (unsigned r = 0; r < kRows; r++) {
      const std::uint64_t k = first + 32 * r + lane;
      const bool there = k < source.count, asked = there && !within(v[r]);
      if (there && v[r][3] > largest) largest = v[r][3];
      if (__any_sync(~0u, asked))
        note_away(task, asked, {double(v[r][0]), double(v[r][1]), double(v[r][2]), double(v[r][3])}, k);
    }
  }
  for (unsigned by = 16; by; by /= 2) {
    const T other = __shfl_xor_sync(~0u, largest, by);
    if (other > largest) largest = other;
  }
  // Doubles that are not negative have the order of their bits.
  const auto bits = static_cast<unsigned long long>(__double_as_longlong(double(largest)));
  unsigned long long* const known = task.counts + kRadiusBits;
  if (lane == 0 && largest > 0 && bits > *static_cast<volatile unsigned long long*>(known))
    atomicMax(known, bits);
}

// Does the own box need sphere k?
template <class T>
struct Stays {
  Source<T> source;
  Region own_box;
  HaloWidth halos;
  __device__ bool operator()(std::uint32_t k) const {
    T v[4];
    source.read(k, v);
    const Sphere s{double(v[0]), double(v[1]), double(v[2]), double(v[3])};
    return fault_of(s) == Fault::none && meets(halos.of(s), own_box);
  }
};

// `numbers`: of spheres, in the bits of `mask`; null: all.
template <class T, class Number>
__global__ void __launch_bounds__(kThreads)
    gather_kernel(Source<T> source, const Number* numbers, Number mask, std::uint64_t count,
                  std::uint64_t first_id, DealTarget to) {
  const std::uint64_t place = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x;
  if (place >= count) return;
  const std::uint64_t k = numbers ? numbers[place] & mask : place;
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

__global__ void hash_kernel(const Pair* pairs, std::uint64_t count, ResidentNumbers numbers,
                            unsigned long long* sum) {
  unsigned long long mine = 0;
  for (std::uint64_t k = std::uint64_t(blockIdx.x) * kThreads + threadIdx.x; k < count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const Pair p = pairs[k];
    mine += wide_pair_hash(numbers.of(p.i), numbers.of(p.j));
  }
  for (unsigned by = 16; by; by /= 2) mine += __shfl_xor_sync(~0u, mine, by);
  if (threadIdx.x % 32 == 0) atomicAdd(sum, mine);
}

// Of what is noted of a sphere, so many bits are its number and the higher ones its box: fewer to sort.
int number_bits(const Spheres& spheres) { return std::bit_width(spheres.count - 1); }

template <class Use>
void as_source(const Spheres& spheres, const Use& use) {
  if (spheres.scalar == Scalar::f32)
    use(Source<float>(spheres));
  else
    use(Source<double>(spheres));
}

}  // namespace

bool is_packed(const Spheres& s) {
  const std::uint64_t real = s.scalar == Scalar::f32 ? 4 : 8;
  return s.center_stride == 4 && s.radius_stride == 4 &&
         s.radii == static_cast<const char*>(s.centers) + 3 * real &&
         reinterpret_cast<std::uintptr_t>(s.centers) % alignof(Quad<float>) == 0;
}

void Dealer::pack(const Spheres& spheres, const DealTarget& to, cudaStream_t stream) {
  as_source(spheres, [&](const auto& source) {
    constexpr const std::uint32_t* all = nullptr;
    gather_kernel<<<blocks_for(spheres.count, kThreads), kThreads, 0, stream>>>(source, all, 0u,
                                                                                spheres.count, 0, to);
  });
  cuda_launched("copy the spheres");
}

void Dealer::set_boxes(std::span<const Region> boxes, std::size_t own, cudaStream_t stream) {
  boxes_ = boxes.size(), own_ = own, own_box_ = boxes[own];
  cuda_check(cudaMemcpyAsync(regions_.reserve(boxes.size()), boxes.data(), boxes.size_bytes(),
                             cudaMemcpyHostToDevice, stream),
             "copy the boxes");
  cuda_check(cudaStreamSynchronize(stream), "copy the boxes");
}

DealCounts Dealer::deal(const Spheres& spheres, const HaloWidth& halos, std::uint64_t away_room,
                        cudaStream_t stream) {
  DealCounts found;
  found.to.resize(boxes_);
  if (spheres.count == 0) return found;
  std::vector<unsigned long long> counts(kFirstBox + boxes_, 0);
  counts[kFaulty] = ~0ull;
  const std::size_t bytes = counts.size() * sizeof counts[0];
  const DealTask task{regions_.data(),
                      static_cast<unsigned>(boxes_),
                      static_cast<unsigned>(own_),
                      static_cast<unsigned>(number_bits(spheres)),
                      own_box_,
                      halos,
                      away_room,
                      away_.reserve(away_room),
                      counts_.reserve(counts.size())};
  cuda_check(cudaMemcpyAsync(task.counts, counts.data(), bytes, cudaMemcpyHostToDevice, stream),
             "deal the spheres out");
  as_source(spheres, [&]<class T>(const Source<T>& source) {
    const auto blocks = std::min(blocks_for(spheres.count, kThreads * kRows), kMostBlocks);
    deal_kernel<<<blocks, kThreads, 0, stream>>>(source, Within<T>(own_box_, halos), task);
  });
  cuda_launched("deal the spheres out");
  cuda_check(cudaMemcpyAsync(counts.data(), task.counts, bytes, cudaMemcpyDeviceToHost, stream),
             "deal the spheres out");
  cuda_check(cudaStreamSynchronize(stream), "deal the spheres out");
  std::copy(counts.begin() + kFirstBox, counts.end(), found.to.begin());
  found.away = counts[kAway], found.astray = counts[kAstray], found.faulty = counts[kFaulty];
  found.to[own_] = spheres.count - found.astray;
  std::memcpy(&found.largest_radius, &counts[kRadiusBits], sizeof found.largest_radius);
  return found;
}

void Dealer::gather_away(const Spheres& spheres, std::uint64_t away, std::uint64_t first_id,
                         const DealTarget& to, cudaStream_t stream) {
  if (away == 0) return;
  const int bits = number_bits(spheres) + std::bit_width(boxes_ - 1);
  cub::DoubleBuffer<unsigned long long> keys(away_.data(), sorted_.reserve(away_.capacity()));
  const auto sort = [&](void* space, std::size_t& bytes) {
    cuda_check(cub::DeviceRadixSort::SortKeys(space, bytes, keys, away, 0, bits, stream),
               "order the spheres");
  };
  std::size_t bytes = 0;
  sort(nullptr, bytes);
  sort(space_.reserve(bytes), bytes);
  as_source(spheres, [&](const auto& source) {
    gather_kernel<<<blocks_for(away, kThreads), kThreads, 0, stream>>>(
        source, keys.Current(), (1ull << number_bits(spheres)) - 1, away, first_id, to);
  });
  cuda_launched("copy the spheres for other boxes");
}

void Dealer::gather_own(const Spheres& spheres, const HaloWidth& halos, std::uint64_t count,
                        std::uint64_t first_id, const DealTarget& to, cudaStream_t stream) {
  if (count == 0) return;
  std::uint32_t* const staying = staying_.reserve(count);
  as_source(spheres, [&]<class T>(const Source<T>& source) {
    const auto select = [&](void* space, std::size_t& bytes) {
      cuda_check(cub::DeviceSelect::If(space, bytes, thrust::counting_iterator<std::uint32_t>(0), staying,
                                       counts_.reserve(kFirstBox + boxes_) + kStaying, spheres.count,
                                       Stays<T>{source, own_box_, halos}, stream),
                 "find the spheres that stay");
    };
    std::size_t bytes = 0;
    select(nullptr, bytes);
    select(space_.reserve(bytes), bytes);
    gather_kernel<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(source, staying, ~0u, count, first_id,
                                                                        to);
  });
  cuda_launched("copy the spheres that stay");
}

std::vector<WeightedPoint> Dealer::sample(const Spheres& spheres, std::uint64_t most, cudaStream_t stream) {
  if (spheres.count == 0) return {};
  const std::uint64_t step = spheres.count / most + 1, count = (spheres.count + step - 1) / step;
  Sphere* const device = sample_.reserve(count);
  as_source(spheres, [&](const auto& source) {
    sample_kernel<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(source, step, device, count);
  });
  cuda_launched("draw a sample");
  std::vector<Sphere> drawn(count);
  cuda_check(cudaMemcpyAsync(drawn.data(), device, count * sizeof(Sphere), cudaMemcpyDeviceToHost, stream),
             "draw a sample");
  cuda_check(cudaStreamSynchronize(stream), "draw a sample");
  std::vector<WeightedPoint> points;
  for (const Sphere& s : drawn)
    if (fault_of(s) == Fault::none) points.push_back({{s.x, s.y, s.z}, static_cast<double>(step)});
  return points;
}

std::uint64_t hash_of_numbered_pairs(const Pair* pairs, std::uint64_t count, const ResidentNumbers& numbers,
                                     Buffer<unsigned long long>& sum, cudaStream_t stream) {
  if (count == 0) return 0;
  unsigned long long *device = sum.reserve(1), value = 0;
  cuda_check(cudaMemsetAsync(device, 0, sizeof value, stream), "hash the contacts");
  hash_kernel<<<kMostBlocks, kThreads, 0, stream>>>(pairs, count, numbers, device);
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
  return cuda::hash_of_numbered_pairs(pairs, count, {0, ids.size(), 0, 0, numbers}, memory_->sum, nullptr);
}

}  // namespace padder::detect
