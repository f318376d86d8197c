// SPDX-License-Identifier: MIT
#include "detect/cuda/input/posed_bodies.h"

#include <algorithm>
#include <utility>

#include "detect/cuda/device/blocks.h"

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

// The poses in one array on this GPU: the caller's, or a copy in `room`.
const Pose* device_poses(const Input& input, Buffer<Pose>& room, cudaStream_t stream) {
  if (!input.poses_around) return input.poses;
  copy_poses(input, room.reserve(input.bodies.size()), stream);
  return room.data();
}

}  // namespace

void copy_poses(const Input& input, Pose* to, cudaStream_t stream) {
  const auto copy = [&](const Pose* from, std::uint64_t first, std::uint64_t count) {
    if (count)
      cuda_check(cudaMemcpyAsync(to + first, from, count * sizeof(Pose), cudaMemcpyDefault, stream),
                 "read the poses");
  };
  if (!input.poses_around) return copy(input.poses, 0, input.bodies.size());
  for (const PosePart& p : input.poses_around->parts)
    copy(reinterpret_cast<const Pose*>(p.poses), p.first, p.count);
}

PosedBodies::PosedBodies(MemoryBook& book)
    : bodies_(book, "the bodies"),
      poses_(book, "the poses"),
      moved_(book, "what moved"),
      host_moved_(book, "what moved", true) {}

const Body* PosedBodies::read(const Input& input, cudaStream_t stream) {
  if (read_) return bodies_.data();
  const std::uint64_t n = input.bodies.size();
  some_static_ = moving_ < n;
  in_place_ = false;
  Body* const bodies = bodies_.reserve(n);
  host_.run(bodies, input.bodies.data(), n * sizeof(Body), "copy the bodies", stream);
  if (input.poses || input.poses_around) {
    const bool on_device = has_device_poses(input);
    if (!on_device) host_.run(poses_.reserve(n), input.poses, n * sizeof(Pose), "copy the poses", stream);
    put_poses(on_device ? device_poses(input, poses_, stream) : poses_.data(), n, bodies,
              input.revision != 0 && some_static_, stream);
  }
  read_ = true;
  return bodies;
}

void PosedBodies::move(const Input& input, cudaStream_t stream) {
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

PosePart PosedBodies::in_place(const Input& input) const {
  if (!has_device_poses(input) || some_static_) return {};
  if (!input.poses_around) return {input.poses->rotation, 0, static_cast<std::uint32_t>(input.bodies.size())};
  return input.poses_around->parts[input.poses_around->own];
}

PosePart PosedBodies::move_in_place(const Input& input, cudaStream_t stream) {
  const PosePart part = in_place(input);
  if (part.count == 0)
    move(input, stream);
  else
    in_place_ = true;
  return part;
}

}  // namespace padder::detect::cuda
