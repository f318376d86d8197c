// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/world_answers.h"

#include "detect/core/world_tree.h"
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/each.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

__global__ void fill_kernel(WorldKeys keys) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < keys.worlds; k += gridDim.x * kThreads)
    keys.distances[k] = WorldKeys::key_of(INFINITY), keys.pairs[k] = ~0ull;
}

struct ListedContacts {
  DeviceSpheres source;
  const std::uint32_t* world;
  std::uint32_t world_of_all;
  const Pair* pairs;
  std::uint64_t count;
  // Of a contact; kEveryWorld where both spheres are of it.
  __device__ std::uint32_t world_of(const Pair& p) const {
    if (!world) return world_of_all;
    return world[p.i] == kEveryWorld ? world[p.j] : world[p.i];
  }
  __device__ double distance(const Pair& p) const {
    return signed_distance(source.sphere(p.i), source.sphere(p.j));
  }
};

// Neighbours in the list are mostly of one world: its lanes add to it at once.
__global__ void __launch_bounds__(kThreads)
    add_kernel(WorldKeys keys, const __grid_constant__ ListedContacts list) {
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < list.count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const Pair p = list.pairs[k];
    const std::uint32_t world = list.world_of(p);
    if (world == kEveryWorld) continue;
    if (keys.any && !keys.has_any(world)) keys.any[world] = 1;
    if (keys.totals) {
      const unsigned same = __match_any_sync(__activemask(), world);
      if ((threadIdx.x & 31) == static_cast<unsigned>(__ffs(static_cast<int>(same)) - 1))
        atomicAdd(keys.totals + world, static_cast<unsigned long long>(__popc(same)));
    }
    if (keys.distances)
      if (const double d = list.distance(p); d < keys.nearest(world)) keys.keep_distance(world, d);
  }
}
// The first pair with the smallest distance of its world.
__global__ void __launch_bounds__(kThreads)
    pair_kernel(WorldKeys keys, const __grid_constant__ ListedContacts list) {
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < list.count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const Pair p = list.pairs[k];
    const std::uint32_t world = list.world_of(p);
    if (world != kEveryWorld && list.distance(p) == keys.nearest(world)) keys.keep_pair(world, p.i, p.j);
  }
}

// Device lambdas may not stand in member functions that are not public, so these are functions of their own.
void mark_answered(const WorldKeys& keys, std::uint8_t* answered, std::uint32_t* open, cudaStream_t stream) {
  each(keys.worlds, stream, "count the answers", [=] __device__(std::uint64_t w) {
    const bool has = keys.pairs[w] != ~0ull;
    answered[w] = has;
    if (!has) *open = 1;
  });
}
void read_keys(const WorldKeys& keys, double* distance, Pair* pair, cudaStream_t stream) {
  each(keys.worlds, stream, "finish the answers", [=] __device__(std::uint64_t w) {
    distance[w] = WorldKeys::number_of(keys.distances[w]);
    pair[w] = {static_cast<std::uint32_t>(keys.pairs[w] >> 32), static_cast<std::uint32_t>(keys.pairs[w])};
  });
}

}  // namespace

AnswerArrays::AnswerArrays(MemoryBook& book)
    : any_(book, "the answers"),
      host_any_(book, "the answers", true),
      answered_(book, "the answers"),
      count_(book, "the answers"),
      host_count_(book, "the answers", true),
      distance_keys_(book, "the answers"),
      pair_keys_(book, "the answers"),
      distance_(book, "the answers"),
      host_distance_(book, "the answers", true),
      pair_(book, "the answers"),
      host_pair_(book, "the answers", true),
      open_(book, "the answers"),
      host_open_(book, "the answers", true) {}

void AnswerArrays::begin(std::uint32_t worlds, Answer answer, cudaStream_t stream) {
  answer_ = answer, keys_ = {}, keys_.worlds = worlds;
  if (answer == Answer::any) {
    keys_.any = any_.reserve(worlds);
    cuda_check(cudaMemsetAsync(keys_.any, 0, worlds, stream), "begin the answers");
  } else if (answer == Answer::count) {
    static_assert(sizeof(std::uint64_t) == sizeof(unsigned long long));
    keys_.totals = reinterpret_cast<unsigned long long*>(count_.reserve(worlds));
    cuda_check(cudaMemsetAsync(keys_.totals, 0, worlds * sizeof *keys_.totals, stream), "begin the answers");
  } else {
    keys_.distances = distance_keys_.reserve(worlds), keys_.pairs = pair_keys_.reserve(worlds);
    if (worlds == 0) return;
    fill_kernel<<<blocks_of_loop(worlds, kThreads), kThreads, 0, stream>>>(keys_);
    cuda_launched("begin the answers");
  }
}

void AnswerArrays::add(const DeviceSpheres& source, const std::uint32_t* world, std::uint32_t world_of_all,
                       const Pair* pairs, std::uint64_t count, cudaStream_t stream) {
  if (count == 0) return;
  const ListedContacts list{source, world, world_of_all, pairs, count};
  add_kernel<<<blocks_of_loop(count, kThreads), kThreads, 0, stream>>>(keys_, list);
  if (keys_.pairs) pair_kernel<<<blocks_of_loop(count, kThreads), kThreads, 0, stream>>>(keys_, list);
  cuda_launched("answer from the contacts");
}

bool AnswerArrays::settle(cudaStream_t stream) {
  if (!keys_.pairs) return true;
  std::uint8_t* const answered = answered_.reserve(keys_.worlds);
  std::uint32_t *const open = open_.reserve(1), *const host = host_open_.reserve(1);
  cuda_check(cudaMemsetAsync(open, 0, sizeof *open, stream), "count the answers");
  mark_answered(keys_, answered, open, stream);
  cuda_check(cudaMemcpyAsync(host, open, sizeof *open, cudaMemcpyDeviceToHost, stream), "count the answers");
  cuda_check(cudaStreamSynchronize(stream), "count the answers");
  keys_.answered = answered;
  return *host == 0;
}

template <class T>
const T* AnswerArrays::delivered(const Buffer<T>& from, Buffer<T>& host, Memory memory, cudaStream_t stream) {
  if (memory == Memory::device) return from.data();
  T* to = host.reserve(keys_.worlds);
  if (keys_.worlds)
    cuda_check(cudaMemcpyAsync(to, from.data(), keys_.worlds * sizeof(T), cudaMemcpyDeviceToHost, stream),
               "copy the answers");
  return to;
}

WorldAnswers AnswerArrays::deliver(Memory memory, cudaStream_t stream) {
  WorldAnswers a;
  a.worlds = keys_.worlds, a.memory = memory;
  if (answer_ == Answer::any) a.any = delivered(any_, host_any_, memory, stream);
  if (answer_ == Answer::count) a.count = delivered(count_, host_count_, memory, stream);
  if (answer_ != Answer::distance) return a;
  double* const distance = distance_.reserve(keys_.worlds);
  Pair* const pair = pair_.reserve(keys_.worlds);
  if (keys_.worlds) read_keys(keys_, distance, pair, stream);
  a.distance = delivered(distance_, host_distance_, memory, stream);
  a.pair = delivered(pair_, host_pair_, memory, stream);
  return a;
}

}  // namespace padder::detect::cuda
