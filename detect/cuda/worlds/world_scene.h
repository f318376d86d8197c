// SPDX-License-Identifier: MIT
// A scene of many worlds as its kernels read it, and the memory that holds it. Only .cu files include this.
#pragma once
#include <optional>

#include "detect/core/world_tree.h"
#include "detect/cuda/bodies/body_arrays.h"
#include "detect/cuda/input/input_copy.h"
#include "detect/cuda/input/posed_bodies.h"

namespace padder::detect::cuda {

// An element in the order of the tree.
struct alignas(16) WorldElement {
  std::uint32_t body, piece;  // as in Element
  std::uint32_t world, world_end;
  Filter filter;
  // The first element behind this one in its world that may touch it. What lies between are other pieces of
  // its body, or of bodies that the filter excludes.
  std::uint32_t partners;
};

// What the kernels found out about a scene.
struct WorldReport {
  unsigned long long fault;        // the first sphere with one, or ~0
  unsigned long long world_fault;  // the first element whose world has no answer, or ~0
  unsigned long long extent;       // bits of the largest |coordinate| + radius
  // The elements of the largest world, and of the largest one but kEveryWorld.
  std::uint32_t largest, largest_own, every_first;
  unsigned long long pairs;  // of elements that are near each other
  std::uint32_t gave_up;     // not 0: a warp has taken more steps than are allowed
};

// Elements are given in the order of the input: the pieces of all bodies, then the loose spheres. `order`
// says which of them stands where in the tree. Balls and stances are in the order of the tree; of a loose
// sphere the ball is the sphere itself.
struct WorldScene {
  BodyView view;
  const Element* pieces_given = nullptr;  // of bodies
  DeviceSpheres loose;
  std::uint32_t of_bodies = 0, count = 0;
  const std::uint32_t *order = nullptr, *worlds = nullptr;  // worlds: in the order of the tree
  WorldElement* elements = nullptr;
  float4* near_balls = nullptr;  // x, y, z, r of balls that contain those of the view
  WorldTree tree;
  WorldReport* report = nullptr;

  __device__ __forceinline__ Element given(std::uint32_t k) const {
    return k < of_bodies ? pieces_given[k] : Element{kLoose, k - of_bodies};
  }
  __device__ __forceinline__ std::uint32_t world_given(std::uint32_t k) const {
    return k < of_bodies ? view.bodies[pieces_given[k].body].world : loose.world_of(k - of_bodies);
  }
  __device__ __forceinline__ Sphere ball_given(std::uint32_t k) const {
    const Element e = given(k);
    return e.body == kLoose ? loose.sphere(e.piece) : ball_of(view.placed_body(e.body), view.pieces[e.piece]);
  }
  __device__ __forceinline__ std::uint32_t number(const WorldElement& e, std::uint32_t slot) const {
    return e.body == kLoose ? view.loose_first + slot : view.body_first[e.body] + view.numbers[slot];
  }
};

// Brings the input to the device, orders the elements by world and builds the tree. Bodies are kept from call
// to call: of a known revision only poses are read.
class WorldInput {
 public:
  WorldInput(MemoryBook& book, PosedBodies& posed);

  // What a search wants of its input.
  struct Wanted {
    std::uint32_t worlds = ~0u;             // elements of a world that is not below it are reported
    std::uint32_t elements_of_world = ~0u;  // at most, but of kEveryWorld
    bool stances = false;
    bool reproducible = false;  // the order follows from this input alone
  };
  // Everything but the report is enqueued when it returns. Waits for the device if the order is new. False:
  // some world has too many elements, and there is no tree. Throws Error.
  bool read(const Input& input, const Wanted& wanted, cudaStream_t stream);
  bool knows(const Input& input) const {  // by its revision
    return input.revision != 0 && input.revision == revision_ && input.bodies.size() == known_bodies_;
  }
  void keep(const Input& input) { revision_ = input.revision; }
  void forget() { revision_ = 0; }

  const WorldScene& scene() const { return scene_; }
  // Throws Error if the report says that something is wrong with the input. `worlds` as for read().
  void check(const WorldReport& report, const Input& input, const CallOptions& options, std::uint32_t worlds,
             cudaStream_t stream) const;

 private:
  void read_bodies(const Input& input, cudaStream_t stream);
  void order(bool along_curve, cudaStream_t stream);
  void sort(bool along_curve, cudaStream_t stream);

  WorldScene scene_;
  std::uint64_t revision_ = 0, known_bodies_ = 0, known_loose_ = 0;
  std::optional<std::uint32_t> known_world_of_loose_;  // none: they have several
  WorldReport found_{};                                // of the order
  std::uint32_t worlds_of_bodies_ = 0;                 // the least number of worlds that has all of theirs
  std::size_t last_world_body_ = 0;                    // one of the last of these worlds
  std::vector<Element> host_elements_;
  Pieces host_pieces_;
  InputCopy copy_;
  PosedBodies& posed_;
  BodyArrays arrays_;
  Buffer<Element> elements_;
  Buffer<Sphere> balls_;
  Buffer<float4> near_balls_;
  Buffer<Stance> stances_;
  Buffer<std::uint32_t> order_, spare_order_, worlds_, spare_worlds_;
  Buffer<std::uint64_t> curve_, spare_curve_;
  Buffer<CurveBox> curve_box_;
  Buffer<WorldElement> tree_elements_;
  Buffer<TreeBox> nodes_;
  Buffer<unsigned char> scratch_;
  Buffer<WorldReport> report_, host_report_;
};

}  // namespace padder::detect::cuda
