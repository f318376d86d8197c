// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/region_elements.h"

#include <thrust/iterator/counting_iterator.h>
#include <cstring>
#include <cub/device/device_select.cuh>

#include "detect/boxes/halo.h"
#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

// Doubles that are not negative have the order of their bits. That of a pose that is none is not a number,
// which is larger than all: then nothing is left out, and the search finds the fault.
__global__ void __launch_bounds__(kThreads)
    largest_kernel(const Sphere* balls, std::uint32_t count, unsigned long long* largest) {
  unsigned long long mine = 0;
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < count; k += gridDim.x * kThreads)
    mine = max(mine, static_cast<unsigned long long>(__double_as_longlong(balls[k].r)));
  for (unsigned by = 16; by; by /= 2) mine = max(mine, __shfl_xor_sync(~0u, mine, by));
  if (threadIdx.x % 32 == 0) atomicMax(largest, mine);
}

struct MayHaveContacts {
  const Sphere* balls;
  const unsigned long long* largest;
  Region own;
  __device__ bool operator()(std::uint32_t k) const {
    const Bounds b = halo_of(balls[k], __longlong_as_double(static_cast<long long>(*largest)));
    bool apart = false;
    for (int a = 0; a < 3; a++) apart = apart || b.high[a] < own.low[a] || b.low[a] >= own.high[a];
    return !apart;
  }
};

// Elements numbers[0], numbers[1], …, or from `first` on, take the places from `first` on.
__global__ void __launch_bounds__(kThreads)
    gather_kernel(BodyView from, BodyView to, Element* elements, const std::uint32_t* numbers,
                  std::uint32_t first, std::uint32_t end) {
  for (std::uint32_t k = first + blockIdx.x * kThreads + threadIdx.x; k < end; k += gridDim.x * kThreads) {
    const std::uint32_t at = numbers ? numbers[k] : k;
    elements[k] = from.elements[at], to.balls[k] = from.balls[at], to.stances[k] = from.stances[at];
    to.family[k] = from.family[at], to.mask[k] = from.mask[at], to.owner[k] = from.owner[at];
  }
}

}  // namespace

RegionElements::RegionElements(MemoryBook& book)
    : elements_(book, "the pieces of bodies"),
      balls_(book, "the balls about bodies"),
      stances_(book, "the balls about bodies"),
      tags_(book, "families and masks"),
      numbers_(book, "the bodies near a box"),
      scratch_(book, "the bodies near a box"),
      found_(book, "the bodies near a box") {}

BodyView RegionElements::select(const BodyView& all, const Region& own, double largest_static,
                                cudaStream_t stream) {
  if (all.moving == 0) return all;
  unsigned long long* const found = found_.reserve(2);
  unsigned long long host[2] = {0, 0};
  std::memcpy(host, &largest_static, sizeof largest_static);
  cuda_check(cudaMemcpyAsync(found, host, sizeof host, cudaMemcpyHostToDevice, stream), "choose the bodies");
  largest_kernel<<<blocks_of_loop(all.moving, kThreads), kThreads, 0, stream>>>(all.balls, all.moving, found);
  cuda_launched("choose the bodies");
  std::uint32_t* const numbers = numbers_.reserve(all.moving);
  const thrust::counting_iterator<std::uint32_t> element(0);
  std::size_t bytes = 0;
  const auto choose = [&](void* room) {
    cuda_check(cub::DeviceSelect::If(room, bytes, element, numbers, found + 1, all.moving,
                                     MayHaveContacts{all.balls, found, own}, stream),
               "choose the bodies");
  };
  choose(nullptr);
  choose(scratch_.reserve(bytes));
  cuda_check(cudaMemcpyAsync(host, found, sizeof host, cudaMemcpyDeviceToHost, stream), "choose the bodies");
  cuda_check(cudaStreamSynchronize(stream), "choose the bodies");

  BodyView view = all;
  const bool room = all.count <= elements_.capacity() && elements_.data();
  Element* const elements = elements_.reserve(all.count);
  view.elements = elements, view.balls = balls_.reserve(all.count),
  view.stances = stances_.reserve(all.count);
  view.family = tags_.reserve(3 * std::uint64_t(all.count));
  view.mask = view.family + all.count, view.owner = view.mask + all.count;
  view.moving = static_cast<std::uint32_t>(host[1]);
  if (view.moving > 0)
    gather_kernel<<<blocks_of_loop(view.moving, kThreads), kThreads, 0, stream>>>(all, view, elements,
                                                                                  numbers, 0, view.moving);
  if (!(knows_static_ && room) && all.moving < all.count)
    gather_kernel<<<blocks_of_loop(all.count - all.moving, kThreads), kThreads, 0, stream>>>(
        all, view, elements, nullptr, all.moving, all.count);
  cuda_launched("choose the bodies");
  knows_static_ = true;
  return view;
}

}  // namespace padder::detect::cuda
