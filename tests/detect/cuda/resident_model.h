// SPDX-License-Identifier: MIT
// A ResidentDetector in the random sequences of model/boxes_sequence.h. The loose spheres lie in parts, each
// on a GPU or on the host, and now and then the poses on the GPUs.
#pragma once
#include <optional>
#include <tuple>

#include "tests/detect/cuda/resident_scene.h"
#include "tests/detect/model/boxes_sequence.h"

namespace padder::detect {

class Resident : public BoxesUnderTest {
 public:
  // A part of each scene for each device. `mine`: the part that this process gives, where others are of other
  // ranks.
  Resident(std::vector<int> devices, const ResidentOptions& options, std::optional<std::size_t> mine = {})
      : devices_(std::move(devices)), mine_(mine), resident_(options) {}
  BoxesFound detect(const Input& input, Call& call) override {
    if (call.handed_on) resident_ = ResidentDetector(std::move(resident_));
    resident_.options() = call.options;
    if (call.number == 0 || call.number != number_) pose_parts_ = call.dice.chance(0.4);
    number_ = call.number;
    std::vector<std::unique_ptr<OnGpu>> kept;
    on_host_ = {};
    const std::vector<Spheres> parts = input.spheres.scalar == Scalar::f32
                                           ? parts_of<float>(input.spheres, call.dice, kept)
                                           : parts_of<double>(input.spheres, call.dice, kept);
    Input bodies = input;
    bodies.spheres = {};
    std::unique_ptr<PoseParts> poses;
    if (pose_parts_ && !input.bodies.empty()) {
      std::vector<Pose> all;
      for (std::size_t k = 0; k < input.bodies.size(); k++)
        all.push_back(input.poses ? input.poses[k] : pose_of(input.bodies[k]));
      poses = std::make_unique<PoseParts>(all, devices_), bodies.poses = nullptr;
    }
    const std::size_t first = mine_.value_or(0), count = mine_ ? 1 : devices_.size();
    std::span<const ResidentPoses> given;
    if (poses) given = std::span<const ResidentPoses>(poses->parts).subspan(first, count);
    const ResidentReport& r =
        resident_.detect(std::span<const Spheres>(parts).subspan(first, count), bodies, given);
    BoxesFound f;
    f.spheres = r.spheres, f.contacts = r.contacts, f.hash = resident_.hash(), f.doubtful = r.doubtful;
    f.pairs = pairs();
    return f;
  }
  // The parts are arrays of this test.
  bool takes(Fault f) const override {
    return f != Fault::pointer && f != Fault::too_many && f != Fault::stride && f != Fault::device_memory;
  }
  std::string told() const override { return std::to_string(devices_.size()) + " parts"; }

 private:
  // Uneven parts, some of them empty.
  template <class T>
  std::vector<Spheres> parts_of(const Spheres& s, Dice& dice, std::vector<std::unique_ptr<OnGpu>>& kept) {
    std::vector<Spheres> parts;
    std::uint64_t first = 0;
    for (std::size_t k = 0; k < devices_.size(); k++) {
      const std::uint64_t left = s.count - first, count = k + 1 == devices_.size() ? left
                                                          : dice.chance(0.1)       ? 0
                                                                                   : dice.below(left + 1);
      std::vector<T>& v = std::get<std::vector<std::vector<T>>>(on_host_).emplace_back();
      const bool together = dice.chance(0.5), on_gpu = count > 0 && dice.chance(0.7);
      v.resize(4 * count + 1);
      const std::uint64_t stride = together ? 4 : 3;
      for (std::uint64_t q = 0; q < count; q++) {
        const T* const c = static_cast<const T*>(s.centers) + (first + q) * s.center_stride;
        std::copy_n(c, 3, &v[q * stride]);
        v[together ? 4 * q + 3 : 3 * count + q] =
            static_cast<const T*>(s.radii)[(first + q) * s.radius_stride];
      }
      const auto placed = [&](const auto* from, std::uint64_t n) {
        if (!from || !on_gpu) return from;
        kept.push_back(std::make_unique<OnGpu>(devices_[k], from, n * sizeof *from));
        return static_cast<decltype(from)>(kept.back()->data());
      };
      const T* const all = placed(static_cast<const T*>(v.data()), v.size());
      Spheres part = spheres_of<T>(count, all, all + (together ? 3 : 3 * count));
      part.center_stride = static_cast<std::uint32_t>(stride), part.radius_stride = together ? 4 : 1;
      part.memory = on_gpu ? Memory::device : Memory::host;
      if (s.family) part.family = placed(s.family + first, count);
      if (s.mask) part.mask = placed(s.mask + first, count);
      if (s.is_static) part.is_static = placed(s.is_static + first, count);
      if (s.world) {
        part.world = s.world + first, name_one_world(part);
        part.world = placed(part.world, count);
      }
      parts.push_back(part), first += count;
    }
    return parts;
  }
  std::vector<Pair> pairs() const {
    std::vector<Pair> all;
    for (const ResidentContacts& f : resident_.found()) {
      const auto others = from_gpu<std::uint64_t>(f.numbers.others, f.others.count);
      ResidentNumbers numbers = f.numbers;
      numbers.others = others.data();
      for (const Pair& p : from_gpu<Pair>(f.contacts.pairs, f.contacts.count))
        all.push_back(
            {static_cast<std::uint32_t>(numbers.of(p.i)), static_cast<std::uint32_t>(numbers.of(p.j))});
    }
    return all;
  }

  std::vector<int> devices_;
  std::optional<std::size_t> mine_;
  std::tuple<std::vector<std::vector<float>>, std::vector<std::vector<double>>> on_host_;  // of a call
  ResidentDetector resident_;
  std::uint64_t number_ = 0;
  bool pose_parts_ = false;
};

}  // namespace padder::detect
