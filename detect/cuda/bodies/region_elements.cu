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
  std::uint32_t box;

  __device__ bool reaches(const Sphere& ball) const {
    return !(ball.r >= 0) || meets(halo_of(ball, larger(largest, *largest_loose), margin), own);
  }
  __device__ bool operator()(std::uint32_t k) const {
    const Element e = view.elements[k];
    if (e.body == kLoose) return reaches(ball_of(loose.sphere(e.piece)));
    const PosePart& part = part_of(parts, e.body);
    if (!(part.marks[e.body - part.first] >> box & 1)) return false;
    const bool before = k > 0 && view.elements[k - 1].body == e.body,
               behind = k + 1 < view.moving && view.elements[k + 1].body == e.body;
    return !(before || behind) || reaches(ball_of(body_of(part, e.body), view.pieces[e.piece]));
  }
};

}  // namespace

RegionElements::RegionElements(MemoryBook& book)
    : marks_(book),
      parts_(book, "the poses"),
      numbers_(book, "the bodies near a box"),
      scratch_(book, "the bodies near a box"),
      found_(book, "the bodies near a box") {}

ChosenElements RegionElements::choose(const Input& input, const BodyView& view, const DeviceSpheres& loose,
                                      const Region& own, double margin, cudaStream_t stream) {
  if (!knows_bodies_) marks_.learn(input.shapes, input.bodies, stream);
  knows_bodies_ = true;
  unsigned long long* const found = found_.reserve(2);
  cuda_check(cudaMemsetAsync(found, 0, 2 * sizeof *found, stream), "choose the bodies");
  if (loose.count)
    largest_kernel<<<blocks_of_loop(loose.count, kThreads), kThreads, 0, stream>>>(loose, found);
  const auto* const largest_loose = reinterpret_cast<const double*>(found);

  ChosenElements chosen;
  std::vector<PosePart> parts;
  if (input.poses_around) {
    parts = input.poses_around->parts;
  } else {
    PosePart all{view.poses, nullptr, 0, static_cast<std::uint32_t>(input.bodies.size()), view.pose_step};
    if (has_device_poses(input)) all.poses = input.poses->rotation, all.step = sizeof(Pose) / sizeof(double);
    all.marks = marks_.mark(all.poses, all.step, {&own, 1}, 0, largest_loose, margin, stream);
    parts = {all};
  }
  if (parts != known_parts_) known_parts_ = parts, copied(parts_, known_parts_.data(), parts.size(), stream);
  chosen.parts = parts_.data(), chosen.numbers = numbers_.reserve(view.moving);

  const thrust::counting_iterator<std::uint32_t> element(0);
  const MayHaveContacts needed{view,
                               chosen.parts,
                               loose,
                               own,
                               marks_.largest_radius(),
                               largest_loose,
                               margin,
                               input.poses_around ? input.poses_around->box : 0};
  std::size_t bytes = 0;
  const auto select = [&](void* room) {
    cuda_check(
        cub::DeviceSelect::If(room, bytes, element, numbers_.data(), found + 1, view.moving, needed, stream),
        "choose the bodies");
  };
  select(nullptr);
  select(scratch_.reserve(bytes));
  unsigned long long count = 0;
  cuda_check(cudaMemcpyAsync(&count, found + 1, sizeof count, cudaMemcpyDeviceToHost, stream),
             "choose the bodies");
  cuda_check(cudaStreamSynchronize(stream), "choose the bodies");
  chosen.count = static_cast<std::uint32_t>(count);
  return chosen;
}

}  // namespace padder::detect::cuda
