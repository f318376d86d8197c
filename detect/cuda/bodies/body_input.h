// SPDX-License-Identifier: MIT
// The scene of a search over bodies, on the device: bodies, their pieces, loose spheres, and the table of
// what is static. It is kept from call to call; of a known revision only what moves is read. Only .cu files
// include this.
#pragma once
#include <vector>

#include "detect/core/bodies/assembly.h"
#include "detect/core/bodies/static_table.h"
#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/bodies/near_elements.h"
#include "detect/cuda/input/input_copy.h"
#include "detect/cuda/input/posed_bodies.h"

namespace padder::detect::cuda {

struct Call;

// Which loose spheres, whose marks lie on the device, are static; and how many are not, wherever their marks
// lie. Both wait for the device.
std::vector<std::uint8_t> marks_on_device(const Input& input, cudaStream_t stream);
std::uint64_t moving_loose(const Input& input, cudaStream_t stream);

// A loose sphere on its way to the device, where only those that move are sent.
struct LooseRecord {
  Sphere sphere;
  Filter filter;
  std::uint32_t number = 0;
};

class BodyInput {
 public:
  BodyInput(MemoryBook& book, PosedBodies& posed);

  bool knows(const Input& input) const;  // by its revision
  // Brings everything to where it is in this call: what moves, if the input is known, else all. The balls
  // about what moves are placed, and are larger by half of the margin: so they touch where spheres in them
  // may have a gap of no more than it. What cannot have a contact in options.own is left out. The revision is
  // forgotten until keep() is called. False: there are static elements for which no table can be built.
  bool read(const Call& call);
  void keep(const Input& input) { revision_ = input.revision; }
  Pieces& pieces() { return assembly_.pieces; }
  void forget() { revision_ = 0; }

  std::uint64_t body_spheres() const { return assembly_.body_first.back(); }
  const BodyView& view() const { return near_; }
  const DeviceSpheres& loose() const { return loose_; }
  const StaticTable& table() const { return table_; }  // of what is static, on the host
  const StaticView& static_view() const { return static_view_; }
  double static_extent() const { return static_extent_; }

 private:
  void read_all(const Input& input, cudaStream_t stream);
  void read_loose(const Input& input, bool known, cudaStream_t stream);
  bool build_table(cudaStream_t stream);
  PosePart part_of_bodies() const;
  PosePart part_of_call(const Input& input) const;
  ElementRange elements_of(const PosePart& part) const;
  Placing placing();
  void place_near(const Call& call);
  void place_listed(const PosesAround& around, std::span<const ListedElements> lists, cudaStream_t stream);
  void place_all(const PosePart& part, std::uint32_t first, std::uint32_t end, cudaStream_t stream);

  InputCopy copy_;
  Assembly assembly_;
  StaticTable table_;
  double static_extent_ = 0, margin_ = 0, largest_radius_ = 0;  // the last: of the spheres of bodies
  std::uint64_t revision_ = 0, known_bodies_ = 0, known_loose_ = 0;
  std::vector<std::uint32_t> moving_loose_;
  BodyView view_, near_;  // of everything; without what is left out
  StaticView static_view_;
  DeviceSpheres loose_;

  PosedBodies& posed_;
  BodyArrays arrays_;
  NearElements near_elements_;
  Buffer<Element> elements_;
  Buffer<Sphere> balls_, loose_spheres_, static_balls_;
  Buffer<Stance> stances_;
  Buffer<std::uint32_t> tags_, loose_tags_, moving_list_, static_starts_, static_elements_;
  Buffer<LooseRecord> records_, host_records_;
};

}  // namespace padder::detect::cuda
