// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/region_elements.h"

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_select.cuh>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

// Doubles that are not negative have the order of their bits. One that is not a number is larger than all:
// then nothing is left out, and the search finds the fault.
__global__ void __launch_bounds__(kThreads) largest_kernel(DeviceSpheres loose, unsigned long long* largest) {
  unsigned long long mine = 0;
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < loose.count; k += gridDim.x * kThreads)
    mine = max(mine, static_cast<unsigned long long>(__double_as_longlong(ball_of(loose.sphere(k)).r)));
  for (unsigned by = 16; by; by /= 2) mine = max(mine, __shfl_xor_sync(~0u, mine, by));
  if (threadIdx.x % 32 == 0) atomicMax(largest, mine);
}

// Asks for the body first, and then, where it has several pieces, for the piece.
struct MayHaveContacts {
  BodyView view;
  const PosePart* parts;
  DeviceSpheres loose;
  Region own;
  double largest;
  const double* largest_loose;
  double margin;

  // True as well where something may be wrong with it: the search finds that.
  __device__ bool reaches(const Sphere& ball) const {
    const double extent = larger(larger(magnitude(ball.x), magnitude(ball.y)), magnitude(ball.z));
    return !(extent + ball.r < kBallInFloat) ||
           meets(halo_of(ball, larger(largest, *largest_loose), margin), own);
  }
  __device__ bool operator()(std::uint32_t k) const {
    const Element e = view.elements[k];
    if (e.body == kLoose) return reaches(ball_of(loose.sphere(e.piece)));
    const PosePart& part = part_of(parts, e.body);
    const std::uint32_t at = e.body - part.first;
    if (!(part.marks[at / 32] >> at % 32 & 1)) return false;
    const bool before = k > 0 && view.elements[k - 1].body == e.body,
               behind = k + 1 < view.moving && view.elements[k + 1].body == e.body;
    return !(before || behind) || reaches(ball_of(body_of(part, e.body), view.pieces[e.piece]));
  }
};

}  // namespace

RegionElements::RegionElements(MemoryBook& book)
    : marks_(book),
      numbers_(book, "the bodies near a box"),
      scratch_(book, "the bodies near a box"),
      found_(book, "the bodies near a box") {}

void RegionElements::begin(const Input& input, const DeviceSpheres& loose, const Region& own, double margin,
                           cudaStream_t stream) {
  loose_ = loose, own_ = own, margin_ = margin;
  if (!knows_bodies_) marks_.learn(input.shapes, input.bodies, stream);
  knows_bodies_ = true;
  cuda_check(cudaMemsetAsync(found_.reserve(2), 0, 2 * sizeof(unsigned long long), stream),
             "choose the bodies");
  if (loose.count)
    largest_kernel<<<blocks_of_loop(loose.count, kThreads), kThreads, 0, stream>>>(loose, found_.data());
  cuda_launched("choose the bodies");
}

const std::uint32_t* RegionElements::mark(const PosePart& all, cudaStream_t stream) {
  return marks_.mark(all.poses, all.step, {&own_, 1}, 0, reinterpret_cast<const double*>(found_.data()),
                     margin_, stream);
}

const std::uint32_t* RegionElements::choose(const BodyView& view, const PosePart* parts, std::uint32_t& count,
                                            cudaStream_t stream) {
  std::uint32_t* const numbers = numbers_.reserve(view.moving);
  unsigned long long* const found = found_.data();
  const thrust::counting_iterator<std::uint32_t> element(0);
  const MayHaveContacts needed{
      view, parts, loose_, own_, marks_.largest_radius(), reinterpret_cast<const double*>(found), margin_};
  std::size_t bytes = 0;
  const auto select = [&](void* room) {
    cuda_check(cub::DeviceSelect::If(room, bytes, element, numbers, found + 1, view.moving, needed, stream),
               "choose the bodies");
  };
  select(nullptr);
  select(scratch_.reserve(bytes));
  unsigned long long chosen = 0;
  cuda_check(cudaMemcpyAsync(&chosen, found + 1, sizeof chosen, cudaMemcpyDeviceToHost, stream),
             "choose the bodies");
  cuda_check(cudaStreamSynchronize(stream), "choose the bodies");
  count = static_cast<std::uint32_t>(chosen);
  return numbers;
}

}  // namespace padder::detect::cuda
