// SPDX-License-Identifier: MIT
// Which elements a box of space needs, for a GPU that is one of several: all of them know all bodies, and
// each places those alone that may have a contact in its box. Only .cu files include this.
#pragma once
#include "detect/core/input.h"
#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/bodies/body_marks.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

// Of the elements that move, those that a box needs. Null: all.
struct ChosenElements {
  static constexpr std::uint32_t kRun = 256;
  const std::uint32_t* bits = nullptr;         // bit k of word w: element 32 w + k
  const unsigned long long* before = nullptr;  // chosen ones before each run of kRun elements
};

class RegionElements {
 public:
  explicit RegionElements(MemoryBook& book);

  void forget() { knows_bodies_ = false; }  // they are others now
  // Begins a call: `own` limits its contacts.
  void begin(const Input& input, const DeviceSpheres& loose, const Region& own, double margin,
             cudaStream_t stream);
  // The marks of a part that has those of all bodies.
  const std::uint32_t* mark(const PosePart& all, cudaStream_t stream);
  // The moving elements that may have a contact in `own`. `parts`: of what moves, with marks.
  // Does not wait. Cost: a pass over all elements.
  ChosenElements choose(const BodyView& view, const PoseParts& parts, cudaStream_t stream);
  // How many they are. Waits for what was chosen, and for no more.
  std::uint32_t count(cudaStream_t stream) const;

 private:
  // Null: there are no loose spheres.
  const double* largest_loose() const {
    return loose_.count ? reinterpret_cast<const double*>(largest_.data()) : nullptr;
  }

  bool knows_bodies_ = false;
  DeviceSpheres loose_;
  Region own_;
  double margin_ = 0;
  BodyMarks marks_;
  Buffer<std::uint32_t> bodies_, bits_, counts_;              // bodies_: marks
  Buffer<unsigned long long> before_, host_count_, largest_;  // largest_: radius of a loose sphere
  Report report_;
};

}  // namespace padder::detect::cuda
