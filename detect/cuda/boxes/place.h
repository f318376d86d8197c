// SPDX-License-Identifier: MIT
// One of the GPUs of a ResidentDetector: its detector, its spheres, and room for those that come and go.
// Internal.
#pragma once
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "detect/core/input.h"
#include "detect/cuda/boxes/sphere_arrays.h"

namespace padder::detect::cuda {

// One GPU: its spheres, what it deals out, and what it was dealt.
struct Place {
  explicit Place(int number) : device(number), detector(DeviceChoice{BackendKind::cuda, number}) {
    const OnDevice on(device);
    on.require();
    cuda_check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "make a stream");
  }
  ~Place() {
    const OnDevice on(device);
    others.reset(), away.reset(), packed.reset(), upload.reset(), dealer.reset(), sum.release();
    others_on_host.reset(), away_on_host.reset();
    poses.release(), poses_on_host.release();
    cudaStreamDestroy(stream);
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

  int device;
  Detector detector;
  cudaStream_t stream = nullptr;
  MemoryBook book;
  std::optional<Dealer> dealer{book};
  std::optional<Upload> upload{book};
  std::optional<SphereArrays> others{book}, away{book};  // what it was sent; what it sends, box by box
  std::optional<SphereArrays> packed{book};              // its part, if that was not given packed
  // The same in pinned memory, where ranks do not read the GPU's.
  std::optional<SphereArrays> others_on_host{std::in_place, book, true},
      away_on_host{std::in_place, book, true};
  Buffer<unsigned long long> sum{book, "the hash"};
  Buffer<Pose> poses{book, "the poses"}, poses_on_host{book, "the poses", true};  // of all bodies
  const Pose* all_poses = nullptr;     // of the call; null: those in host memory, or around
  PosesAround poses_around;            // of the call, if GPUs read each other's poses
  std::vector<ListedElements> listed;  // of the call: elements of its bodies that each GPU needs
  Spheres part;                        // of the call, in this GPU's memory
  std::uint64_t first = 0;             // number of its first sphere in the scene
  DealCounts counts;
  std::vector<std::uint64_t> coming;  // spheres that it needs, from each GPU
  std::uint64_t away_room = 0;        // for how many spheres that it sends there is room
  std::uint64_t before = 0, own = 0;  // that it needs from GPUs before it, and of its part
  std::uint64_t behind = 0;           // that it needs from GPUs behind it
  SpheresAround around;               // those from other GPUs, if the part is read where it lies
  std::uint64_t loaded = 0;           // spheres that its detector is given
  double body_spheres = 0;            // of the box, when space was cut last; an estimate
};

}  // namespace padder::detect::cuda
