// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/worlds_apart.h"

#include <algorithm>
#include <utility>

#include "detect/cuda/device/blocks.h"
#include "detect/cuda/input/bounds.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

// Words of the bounds: minima of x, y, z, the radius and the world, then maxima of the same.
constexpr int kValues = 5, kWords = 2 * kValues;

__global__ void begin_kernel(unsigned long long* words) {
  if (threadIdx.x < kWords) words[threadIdx.x] = threadIdx.x < kValues ? ~0ull : 0;
}

// A number that is none is no bound, but it is larger than all others.
__global__ void __launch_bounds__(kThreads) bounds_kernel(DeviceSpheres source, unsigned long long* words) {
  unsigned long long low[kValues], high[kValues];
  for (int c = 0; c < kValues; c++) low[c] = ~0ull, high[c] = 0;
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < source.count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const auto number = static_cast<std::uint32_t>(k);
    const Sphere s = source.sphere(number);
    const unsigned long long v[kValues] = {ordered(s.x), ordered(s.y), ordered(s.z), ordered(s.r),
                                           source.world_of(number)};
    for (int c = 0; c < kValues; c++) low[c] = min(low[c], v[c]), high[c] = max(high[c], v[c]);
  }
  for (int c = 0; c < kValues; c++) {
    for (int d = 16; d; d >>= 1)
      low[c] = min(low[c], __shfl_xor_sync(~0u, low[c], d)),
      high[c] = max(high[c], __shfl_xor_sync(~0u, high[c], d));
    // All warps share these words. Reading a word first spares nearly every atomic operation on it.
    if ((threadIdx.x & 31) == 0 && low[c] < *static_cast<volatile unsigned long long*>(words + c))
      atomicMin(words + c, low[c]);
    if ((threadIdx.x & 31) == 0 && high[c] > *static_cast<volatile unsigned long long*>(words + kValues + c))
      atomicMax(words + kValues + c, high[c]);
  }
}

}  // namespace

WorldsApart::WorldsApart(MemoryBook& book)
    : input_(book),
      search_(book),
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
  return b;
}

bool WorldsApart::lay_out(const WorldBounds& b, double margin, DeviceSpheres& source) {
  Summary apart;
  if (!lay_side_by_side(b, source.count, margin, source.side_by_side, apart.extent)) return false;
  apart.radius_min = b.radius_min * (1 - 0x1p-20), apart.radius_max = b.radius_max;  // they will be rounded
  source.packed = source.packed && source.wide;  // packed floats are read past DeviceSpheres::searched()
  return source.worlds_apart = SphereSearch::serves_rounded(apart, margin);
}

bool WorldsApart::run(const Call& call, Contacts& contacts) {
  const Input& input = call.input;
  if (!input.bodies.empty() || input.around || !(call.options.own == Region{})) return false;
  DeviceSpheres source = input_.source(input, call.stream);
  if (input.spheres.world) {
    const WorldBounds b = bounds(source, call.stream);
    if (b.first_world != b.last_world && !lay_out(b, call.options.margin, source)) return false;
  }
  if (std::exchange(apart_, source.worlds_apart) != source.worlds_apart) search_.forget();
  call.clock.mark(StageClock::kPlace);
  contacts.spheres = source.count;
  search_.run(source, call, contacts);
  return true;
}

}  // namespace padder::detect::cuda
