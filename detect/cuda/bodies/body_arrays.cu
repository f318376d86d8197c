// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/body_arrays.h"

#include <algorithm>
#include <utility>

#include "detect/cuda/device/blocks.h"
#include "detect/cuda/input/input_copy.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;

__global__ void moved_kernel(const MovedBody* moved, std::uint32_t count, Body* bodies) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < count; k += gridDim.x * kThreads) {
    const Pose& pose = moved[k].pose;
    Body& to = bodies[moved[k].body];
    for (int c = 0; c < 9; c++) to.rotation[c] = pose.rotation[c];
    for (int c = 0; c < 3; c++) to.position[c] = pose.position[c];
  }
}
// A thread for each number of a pose. `moving`: static bodies are left out, since they stay where they were
// put.
__global__ void __launch_bounds__(kThreads)
    pose_kernel(const Pose* poses, std::uint64_t count, Body* bodies, bool moving) {
  for (std::uint64_t k = blockIdx.x * kThreads + threadIdx.x; k < 12 * count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const std::uint64_t b = k / 12, c = k % 12;
    if (moving && bodies[b].is_static) continue;
    if (c < 9)
      bodies[b].rotation[c] = poses[b].rotation[c];
    else
      bodies[b].position[c - 9] = poses[b].position[c - 9];
  }
}
void put_poses(const Pose* poses, std::uint64_t count, Body* bodies, bool moving, cudaStream_t stream) {
  if (count == 0) return;
  pose_kernel<<<blocks_of_loop(12 * count, kThreads), kThreads, 0, stream>>>(poses, count, bodies, moving);
  cuda_launched("place the bodies");
}

// Are groups small in most bodies? A scene is searched in one way.
bool goes_by_groups(const Input& input, const Pieces& pieces) {
  std::vector<double> size;
  for (std::uint32_t shape = 0; shape < input.shapes.size(); shape++)
    size.push_back(pieces.group_size(shape));
  double weighted = 0, all = 0;
  for (const Body& b : input.bodies) {
    const std::uint32_t count = pieces.shape_first[b.shape + 1] - pieces.shape_first[b.shape];
    weighted += count * size[b.shape], all += count;
  }
  return weighted < tuning::kSmallGroups * all;
}

}  // namespace

BodyArrays::BodyArrays(MemoryBook& book)
    : bodies_(book, "the bodies"),
      poses_(book, "the poses"),
      pieces_(book, "the pieces of bodies"),
      spheres_(book, "the shapes"),
      numbers_(book, "the shapes"),
      body_first_(book, "the bodies"),
      near_(book, "the shapes"),
      groups_(book, "the shapes"),
      boxes_(book, "the shapes"),
      moved_(book, "what moved"),
      host_moved_(book, "what moved", true) {}

BodyView BodyArrays::read(const Input& input, const Pieces& p, const std::vector<std::uint32_t>& body_first,
                          cudaStream_t stream) {
  const std::uint64_t n = input.bodies.size();
  BodyView view;
  Body* bodies = copied(bodies_, input.bodies.data(), n, stream);
  view.bodies = bodies;
  moving_ =
      std::count_if(input.bodies.begin(), input.bodies.end(), [](const Body& b) { return !b.is_static; });
  some_static_ = moving_ < n;
  in_place_ = false;
  view.pieces = copied(pieces_, p.pieces.data(), p.pieces.size(), stream);
  view.spheres = copied(spheres_, p.spheres.data(), p.spheres.size(), stream);
  view.numbers = copied(numbers_, p.numbers.data(), p.numbers.size(), stream);
  view.near = copied(near_, p.near.data(), p.near.size(), stream);
  view.groups = copied(groups_, p.groups.data(), p.groups.size(), stream);
  view.grouped = goes_by_groups(input, p);
  view.boxes = copied(boxes_, p.boxes.data(), p.boxes.size(), stream);
  view.unit_piece = static_cast<std::uint32_t>(p.pieces.size());
  view.unit_near = static_cast<std::uint32_t>(p.spheres.size());
  view.body_first = copied(body_first_, body_first.data(), body_first.size(), stream);
  view.loose_first = body_first.back();
  if (input.poses || input.poses_around) {
    const Pose* const poses = has_device_poses(input) ? device_poses(input, poses_, stream)
                                                      : copied(poses_, input.poses, n, stream);
    put_poses(poses, n, bodies, input.revision != 0 && some_static_, stream);
  }
  return view;
}

void BodyArrays::move(const Input& input, cudaStream_t stream) {
  Body* bodies = bodies_.data();
  const bool apart = std::exchange(in_place_, false);
  if (has_device_poses(input))
    return put_poses(device_poses(input, poses_, stream), input.bodies.size(), bodies, some_static_, stream);
  if (apart && input.moved.size() < moving_)
    throw Error(
        "the previous call of this revision read its poses in device memory, and this call gives none: give "
        "the poses in each call, or another revision");
  if (input.moved.empty()) return;
  MovedBody* host = host_moved_.reserve(input.moved.size());
  std::uint32_t n = 0;
  for (const std::uint32_t b : input.moved) {
    const Body& body = input.bodies[b];
    if (body.is_static) continue;
    host[n].pose = pose_of(body), host[n++].body = b;
  }
  if (n == 0) return;
  MovedBody* device = copied(moved_, host, n, stream);
  moved_kernel<<<blocks_of_loop(n, kThreads), kThreads, 0, stream>>>(device, n, bodies);
  cuda_launched("place the bodies");
}

PosePart BodyArrays::in_place(const Input& input) const {
  if (!has_device_poses(input) || some_static_) return {};
  if (!input.poses_around) return {input.poses->rotation, 0, static_cast<std::uint32_t>(input.bodies.size())};
  return input.poses_around->parts[input.poses_around->own];
}

void BodyArrays::move_in_place(const Input& input, BodyView& view, cudaStream_t stream) {
  view.in_place = in_place(input);
  if (view.in_place.count == 0) return move(input, stream);
  in_place_ = true;
}

}  // namespace padder::detect::cuda
