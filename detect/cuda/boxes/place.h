// SPDX-License-Identifier: MIT
// One of the GPUs of a ResidentDetector: its detector, its spheres, and room for those that come and go.
// Internal.
#pragma once
#include <cstdint>
#include <optional>

#include "detect/cuda/boxes/sphere_arrays.h"

namespace padder::detect::cuda {

// For how many spheres a GPU has room: in its load those of the GPUs before it, then its own, then those of
// the GPUs after it; and beside the load those that it sends. Dealing finds out how many there are; what is
// too small grows, by an eighth more than what is missing, and the spheres are dealt again.
struct Rooms {
  std::uint64_t before = 0, own = 0, after = 0, away = 0;
  bool hold(const Rooms& needed) {
    bool all = true;
    const auto hold_one = [&](std::uint64_t& room, std::uint64_t need) {
      if (need > room) room = need + need / 8 + 64, all = false;
    };
    hold_one(before, needed.before), hold_one(own, needed.own), hold_one(after, needed.after),
        hold_one(away, needed.away);
    return all;
  }
};

// One GPU: its spheres, what it deals out, and what it was dealt.
struct Place {
  explicit Place(int number) : device(number), detector(DeviceChoice{BackendKind::cuda, number}) {
    const OnDevice on(device);
    on.require();
    cuda_check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "make a stream");
  }
  ~Place() {
    const OnDevice on(device);
    load.reset(), away.reset(), upload.reset(), dealer.reset(), sum.release();
    poses.release(), ids.release();
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
  std::optional<SphereArrays> load{book}, away{book};  // what it detects; what it sends, box by box
  Buffer<unsigned long long> sum{book, "the hash"};
  Buffer<Pose> poses{book, "the poses"};                          // of all bodies
  Buffer<std::uint64_t> ids{book, "the numbers of the spheres"};  // of bodies and the load together
  const Pose* all_poses = nullptr;                                // of the call; null: those in host memory
  Spheres part;                                                   // of the call, in this GPU's memory
  std::uint64_t first = 0;                                        // number of its first sphere in the scene
  DealCounts counts;
  Rooms rooms, needed;
  std::uint64_t loaded = 0;  // spheres in the load
  double body_spheres = 0;   // of the box, when space was cut last; an estimate
  double density = 1;        // work for each of these spheres, in the call before
};

}  // namespace padder::detect::cuda
