// SPDX-License-Identifier: MIT
// Spheres in the memory of one GPU, and how they come there: from host memory, or from another GPU. Internal.
#pragma once
#include <array>
#include <cstdint>

#include "detect/cuda/boxes/deal.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/input/host_copy.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Which arrays the spheres of a scene have. A part without families, say, has 0 for all.
struct Form {
  Scalar scalar = Scalar::f32;
  bool family = false, mask = false, is_static = false, world = false, ids = true;
  std::uint32_t world_of_all = 0;  // without an array
  static Form of(const Spheres& s) {
    return {s.scalar, s.family != nullptr, s.mask != nullptr, s.is_static != nullptr, s.world != nullptr,
            true,     s.world_of_all};
  }
  std::uint64_t bytes_of_one() const {
    return (scalar == Scalar::f32 ? 16u : 32u) + 8u + (family ? 4u : 0u) + (mask ? 4u : 0u) +
           (world ? 4u : 0u) + (is_static ? 1u : 0u);
  }
};

// Spheres in the memory of one GPU, or in pinned host memory, as arrays that grow together.
class SphereArrays {
 public:
  explicit SphereArrays(MemoryBook& book, bool pinned = false)
      : spheres_(book, "the spheres of a box", pinned),
        ids_(book, "the numbers of the spheres", pinned),
        family_(book, "the families", pinned),
        mask_(book, "the masks", pinned),
        world_(book, "the worlds", pinned),
        is_static_(book, "the marks of static spheres", pinned) {}

  void reserve(std::uint64_t count, const Form& form) {
    spheres_.reserve((form.scalar == Scalar::f32 ? 16 : 32) * count);
    if (form.ids) ids_.reserve(count);
    if (form.family) family_.reserve(count);
    if (form.mask) mask_.reserve(count);
    if (form.world) world_.reserve(count);
    if (form.is_static) is_static_.reserve(count);
  }
  DealTarget from(std::uint64_t first, const Form& form) const {
    const auto in = [first](bool there, const auto& array) { return there ? array.data() + first : nullptr; };
    return {spheres_.data() + first * (form.scalar == Scalar::f32 ? 16 : 32),
            in(form.ids, ids_),
            in(form.family, family_),
            in(form.mask, mask_),
            in(form.world, world_),
            in(form.is_static, is_static_)};
  }
  Spheres view(std::uint64_t count, const Form& form) const {
    const DealTarget at = from(0, form);
    Spheres s;
    s.count = count, s.scalar = form.scalar, s.memory = Memory::device;
    s.centers = at.spheres, s.radii = static_cast<char*>(at.spheres) + (form.scalar == Scalar::f32 ? 12 : 24);
    s.center_stride = s.radius_stride = 4;
    s.family = at.family, s.mask = at.mask, s.is_static = at.is_static;
    s.world = at.world, s.world_of_all = form.world_of_all;
    return s;
  }

 private:
  Buffer<char> spheres_;
  Buffer<std::uint64_t> ids_;
  Buffer<std::uint32_t> family_, mask_, world_;
  Buffer<std::uint8_t> is_static_;
};

// An array of spheres, and the bytes of one of its items. Null: there is no such array.
struct SphereArray {
  char* at;
  std::uint64_t bytes_of_one;
};
inline std::array<SphereArray, 6> arrays_of(const DealTarget& t, Scalar scalar) {
  const auto as_bytes = [](auto* at) { return reinterpret_cast<char*>(at); };
  return {{{static_cast<char*>(t.spheres), scalar == Scalar::f32 ? 16u : 32u},
           {as_bytes(t.ids), sizeof *t.ids},
           {as_bytes(t.family), sizeof *t.family},
           {as_bytes(t.mask), sizeof *t.mask},
           {as_bytes(t.world), sizeof *t.world},
           {as_bytes(t.is_static), sizeof *t.is_static}}};
}

// Copies `count` spheres between a GPU and host memory, or within either. Does not wait.
void copy_spheres(const DealTarget& to, const DealTarget& from, std::uint64_t count, Scalar scalar,
                  cudaStream_t stream);

// Spheres that come from another GPU: where they are there, and their place among those that come.
struct ComingSpheres {
  DealTarget from;
  std::uint64_t place = 0, count = 0;
};
inline constexpr std::size_t kMostComing = 64;
// Reads spheres from GPUs whose memory this one can read, at most kMostComing runs of them, all at once.
// Does not wait.
void read_spheres(const DealTarget& to, std::span<const ComingSpheres> coming, Scalar scalar,
                  cudaStream_t stream);

// Copies `count` spheres from one GPU to another. The stream is one of the GPU that gets them.
void copy_to_peer(const DealTarget& to, int to_device, const DealTarget& from, int from_device,
                  std::uint64_t count, Scalar scalar, cudaStream_t stream);

// Spheres that came in host memory, on the GPU with the caller's strides.
class Upload {
 public:
  explicit Upload(MemoryBook& book) : bytes_(book, "spheres from host memory") {}
  // `s` as it is if it lies on the GPU; else its copy, which the stream makes.
  Spheres run(const Spheres& s, cudaStream_t stream);

 private:
  Buffer<char> bytes_;
  HostCopy host_;
};

// Lets a GPU read the other's memory, where the machine can. False: it cannot.
bool let_access(int device, int other);

}  // namespace padder::detect::cuda
