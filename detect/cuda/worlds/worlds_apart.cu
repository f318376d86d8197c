// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/worlds_apart.h"

#include <algorithm>
#include <utility>

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include "detect/cuda/device/each.h"
#include "detect/cuda/input/bounds.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

// Words of the bounds: minima of x, y, z, the radius and the world, then maxima of the same, then how many
// are of kEveryWorld.
constexpr int kValues = 5, kWords = 2 * kValues + 1;

__device__ __forceinline__ unsigned long long none_of(unsigned word) { return word < kValues ? ~0ull : 0; }
__global__ void begin_kernel(unsigned long long* words) {
  if (threadIdx.x < kWords) words[threadIdx.x] = none_of(threadIdx.x);
}

// A number that is none is no bound, but it is larger than all others. Here, and where spheres lie side by
// side, source.world is of all spheres, those of bodies too.
__global__ void __launch_bounds__(kThreads) bounds_kernel(DeviceSpheres source, unsigned long long* words) {
  unsigned long long low[kValues], high[kValues];
  unsigned long long every = 0;
  __shared__ unsigned long long of_block[kWords];
  if (threadIdx.x < kWords) of_block[threadIdx.x] = none_of(threadIdx.x);
  __syncthreads();
  for (int c = 0; c < kValues; c++) low[c] = ~0ull, high[c] = 0;
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < source.count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const auto number = static_cast<std::uint32_t>(k);
    const Sphere s = source.sphere(number);
    const std::uint32_t world = source.world[number];
    const bool is_every = world == kEveryWorld;
    const unsigned long long v[kValues] = {ordered(s.x), ordered(s.y), ordered(s.z), ordered(s.r), world};
    every += is_every;
    for (int c = 0; c < kValues; c++)
      low[c] = min(low[c], v[c]), high[c] = max(high[c], c == kValues - 1 && is_every ? 0 : v[c]);
  }
  const bool first_lane = (threadIdx.x & 31) == 0;
  for (int c = 0; c < kValues; c++) {
    for (int d = 16; d; d >>= 1)
      low[c] = min(low[c], __shfl_xor_sync(~0u, low[c], d)),
      high[c] = max(high[c], __shfl_xor_sync(~0u, high[c], d));
    if (first_lane) atomicMin(of_block + c, low[c]), atomicMax(of_block + kValues + c, high[c]);
  }
  for (int d = 16; d; d >>= 1) every += __shfl_xor_sync(~0u, every, d);
  if (first_lane) atomicAdd(of_block + 2 * kValues, every);
  __syncthreads();
  // All blocks share these words. Reading a word first spares nearly every atomic operation on it.
  const unsigned word = threadIdx.x;
  const auto now = [&] { return *static_cast<volatile unsigned long long*>(words + word); };
  if (word < kValues) {
    if (of_block[word] < now()) atomicMin(words + word, of_block[word]);
  } else if (word < 2 * kValues) {
    if (of_block[word] > now()) atomicMax(words + word, of_block[word]);
  } else if (word < kWords && of_block[word]) {
    atomicAdd(words + word, of_block[word]);
  }
}

void gather_worlds(const DeviceSpheres& source, std::uint32_t* worlds, cudaStream_t stream) {
  each(source.count, stream, "read the worlds",
       [=] __device__(std::uint64_t k) { worlds[k] = source.world_of(static_cast<std::uint32_t>(k)); });
}

// Of each world its place among the distinct ones; sorted[n]: how many these are.
void write_ranks(const std::uint32_t* worlds, std::uint32_t n, const std::uint32_t* sorted,
                 std::uint32_t* ranks, cudaStream_t stream) {
  each(n, stream, "rank the worlds", [=] __device__(std::uint64_t k) {
    const std::uint32_t world = worlds[k];
    std::uint32_t low = 0, high = sorted[n];
    while (low < high) {
      const std::uint32_t middle = low + (high - low) / 2;
      sorted[middle] < world ? low = middle + 1 : high = middle;
    }
    ranks[k] = world == kEveryWorld ? kEveryWorld : low;
  });
}

}  // namespace

WorldsApart::WorldsApart(MemoryBook& book)
    : search_(book),
      every_(book),
      worlds_(book, "worlds"),
      ranks_(book, "the ranks of worlds"),
      sorted_worlds_(book, "the ranks of worlds"),
      scratch_(book, "sorting"),
      words_(book, "the bounds of worlds"),
      host_words_(book, "the bounds of worlds", true) {}

WorldBounds WorldsApart::bounds(const DeviceSpheres& source, cudaStream_t stream) {
  unsigned long long *const words = words_.reserve(kWords), *const host = host_words_.reserve(kWords);
  report_.clear(), report_.add(words, host, kWords * sizeof *words), report_.expect();
  begin_kernel<<<1, 32, 0, stream>>>(words);
  bounds_kernel<<<std::min(blocks_for(source.count, kThreads), 528u), kThreads, 0, stream>>>(source, words);
  cuda_launched("survey the worlds");
  report_.send(stream);
  report_.arrived(stream, "survey the worlds");
  WorldBounds b;
  for (int c = 0; c < 3; c++) b.low[c] = unordered(host[c]), b.high[c] = unordered(host[kValues + c]);
  b.radius_min = unordered(host[3]), b.radius_max = unordered(host[kValues + 3]);
  b.first_world = static_cast<std::uint32_t>(host[4]),
  b.last_world = static_cast<std::uint32_t>(host[kValues + 4]);
  b.every = host[2 * kValues];
  return b;
}

// Replaces the numbers of worlds by their ranks. kEveryWorld stays.
void WorldsApart::rank_worlds(DeviceSpheres& source, cudaStream_t stream) {
  const std::uint32_t n = source.count;
  std::uint32_t *const sorted = sorted_worlds_.reserve(n + std::uint64_t(1)), *const ranks =
                                                                                  ranks_.reserve(n);
  std::size_t bytes = 0;
  const auto sort = [&](void* room) {
    cuda_check(cub::DeviceRadixSort::SortKeys(room, bytes, source.world, ranks, n, 0, 32, stream),
               "sort the worlds");
  };
  sort(nullptr), sort(scratch_.reserve(bytes));
  const auto unique = [&](void* room) {
    cuda_check(cub::DeviceSelect::Unique(room, bytes, ranks, sorted, sorted + n, n, stream),
               "sort the worlds");
  };
  unique(nullptr), unique(scratch_.reserve(bytes));
  write_ranks(source.world, n, sorted, ranks, stream);
  source.world = ranks;
}

bool WorldsApart::lay_out(const WorldBounds& b, double margin, DeviceSpheres& source) {
  Summary apart;
  if (!lay_side_by_side(b, source.count, margin, source.side_by_side, apart.extent)) return false;
  apart.radius_min = b.radius_min * (1 - 0x1p-20), apart.radius_max = b.radius_max;  // they will be rounded
  source.packed = source.packed && source.wide;  // packed floats are read past DeviceSpheres::searched()
  return source.worlds_apart = SphereSearch::serves_rounded(apart, margin);
}

// The world of each sphere, those of bodies too. Null: all are of one world.
const std::uint32_t* WorldsApart::all_worlds(const DeviceSpheres& source, cudaStream_t stream) {
  if (source.placed == 0 && !source.around.spheres) return source.world;
  std::uint32_t* const worlds = worlds_.reserve(source.count);
  gather_worlds(source, worlds, stream);
  return worlds;
}

bool WorldsApart::run(const DeviceSpheres& given, const Call& call, Contacts& contacts) {
  DeviceSpheres source = given;
  contacts.spheres = source.count;
  if (source.count == 0) return true;
  std::uint64_t every = 0;  // that meet others in another way
  double radius_max = 0;
  last_world_ = source.world_of_all == kEveryWorld ? 0 : source.world_of_all;
  worlds_given_ = source.world = all_worlds(source, call.stream);
  if (source.world) {
    WorldBounds b = bounds(source, call.stream);
    last_world_ = b.last_world;
    if (b.sparse(source.count)) rank_worlds(source, call.stream), b = bounds(source, call.stream);
    if (b.many() && !lay_out(b, call.options.margin, source)) return false;
    if (b.many()) every = b.every, radius_max = b.radius_max;
  }
  if (!source.worlds_apart) source.world = given.world;
  if (std::exchange(apart_, source.worlds_apart) != source.worlds_apart) search_.forget();
  if (every) every_.count(source, every, radius_max, call.options, call.stream);
  call.clock.mark(StageClock::kPlace);
  Call plain = call;
  if (every) plain.history = nullptr;  // of a part of the list
  search_.run(source, plain, contacts);
  if (every) add_every(source, plain, contacts);
  matched_ = every == 0;
  return true;
}

// The contacts with kEveryWorld, behind those that the search has found.
void WorldsApart::add_every(const DeviceSpheres& source, const Call& call, Contacts& contacts) {
  const std::uint64_t count = every_.counted(call.stream), all = contacts.count + count;
  if (all > call.list.capacity(call.options)) {  // what was there is lost where it grows
    call.list.reserve(call.options, all + all / 8);
    search_.run(source, call, contacts);
  }
  every_.write(call.list.output(call.options), contacts.count, call.stream);
  contacts.count += count;
  // The caller may read the list on another stream.
  cuda_check(cudaStreamSynchronize(call.stream), "write contacts with every world");
  call.clock.mark(8);
}

}  // namespace padder::detect::cuda
