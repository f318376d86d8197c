// SPDX-License-Identifier: MIT
// A scene of many worlds as its kernels read it, and the memory that holds it. Only .cu files include this.
#pragma once
#include "detect/core/pieces.h"
#include "detect/core/world_tree.h"
#include "detect/cuda/input/input_copy.h"

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
  unsigned long long contacts;
  std::uint32_t largest_world, every_first;
};

// Elements are given in the order of the input: the pieces of all bodies, then the loose spheres. `order`
// says which of them stands where in the tree.
struct WorldScene {
  const Body* bodies = nullptr;
  const Pose* poses =
      nullptr;  // of all bodies, but for static ones if `static_stay`; null: those in `bodies`
  bool static_stay = false;
  const Element* pieces_given = nullptr;  // of bodies
  const Piece* pieces = nullptr;
  const Sphere* spheres = nullptr;         // of all shapes
  const std::uint32_t* numbers = nullptr;  // of each of these within its shape
  const std::uint32_t* body_first = nullptr;
  DeviceSpheres loose;
  std::uint32_t of_bodies = 0, count = 0, loose_first = 0;
  const std::uint32_t *order = nullptr, *worlds = nullptr;  // worlds: in the order of the tree
  WorldElement* elements = nullptr;
  Sphere* balls = nullptr;
  WorldTree tree;
  WorldReport* report = nullptr;

  __device__ __forceinline__ Element given(std::uint32_t k) const {
    return k < of_bodies ? pieces_given[k] : Element{kLoose, k - of_bodies};
  }
  __device__ __forceinline__ std::uint32_t world_given(std::uint32_t k) const {
    return k < of_bodies ? bodies[pieces_given[k].body].world : loose.world_of(k - of_bodies);
  }
  // A body where it is.
  __device__ __forceinline__ Body body_at(std::uint32_t k, bool is_static) const {
    Body body;
    const bool there = !poses || (static_stay && is_static);
    const double *rotation = there ? bodies[k].rotation : poses[k].rotation,
                 *position = there ? bodies[k].position : poses[k].position;
    for (int q = 0; q < 9; q++) body.rotation[q] = rotation[q];
    for (int q = 0; q < 3; q++) body.position[q] = position[q];
    return body;
  }
  // Of a loose sphere it is the sphere itself.
  __device__ __forceinline__ Sphere ball_given(std::uint32_t k) const {
    const Element e = given(k);
    return e.body == kLoose ? loose.sphere(e.piece)
                            : ball_of(body_at(e.body, bodies[e.body].is_static), pieces[e.piece]);
  }
  __device__ __forceinline__ std::uint32_t number(const WorldElement& e, std::uint32_t slot) const {
    return e.body == kLoose ? loose_first + slot : body_first[e.body] + numbers[slot];
  }
};

// Brings the input to the device, orders the elements by world and builds the tree. Bodies are kept from call
// to call: of a known revision only poses are read.
class WorldInput {
 public:
  explicit WorldInput(MemoryBook& book);

  // Everything but the report is enqueued when it returns. Waits for the device if the order is new.
  // `worlds`: elements of a world that is not below it are reported. Throws Error.
  void read(const Input& input, std::uint32_t worlds, cudaStream_t stream);
  bool knows(const Input& input) const {  // by its revision
    return input.revision != 0 && input.revision == revision_ && input.bodies.size() == known_bodies_;
  }
  bool bodies_have_worlds() const { return bodies_have_worlds_; }  // of the revision that is known
  void keep(const Input& input) { revision_ = input.revision; }
  void forget() { revision_ = 0; }

  const WorldScene& scene() const { return scene_; }
  // Throws Error if the report says that something is wrong with the input. `worlds` as for read().
  void check(const WorldReport& report, const Input& input, const CallOptions& options, std::uint32_t worlds,
             cudaStream_t stream) const;

 private:
  void read_bodies(const Input& input, cudaStream_t stream);
  void read_poses(const Input& input, cudaStream_t stream);
  void order(bool along_curve, cudaStream_t stream);
  void sort(bool along_curve, cudaStream_t stream);

  WorldScene scene_;
  std::uint64_t revision_ = 0, known_bodies_ = 0, known_loose_ = 0;
  std::uint32_t known_world_of_loose_ = 0, largest_world_ = 0;
  bool bodies_have_worlds_ = false;
  std::vector<Element> host_elements_;
  Pieces host_pieces_;
  InputCopy copy_;
  Buffer<Body> bodies_;
  Buffer<Pose> poses_;
  Buffer<Element> elements_;
  Buffer<Piece> pieces_;
  Buffer<Sphere> spheres_, balls_;
  Buffer<std::uint32_t> numbers_, body_first_, order_, spare_order_, worlds_, spare_worlds_, moved_numbers_;
  Buffer<std::uint64_t> curve_, spare_curve_;
  Buffer<CurveBox> curve_box_;
  Buffer<WorldElement> tree_elements_;
  Buffer<TreeBox> nodes_;
  Buffer<unsigned char> scratch_;
  Buffer<WorldReport> report_, host_report_;
};

}  // namespace padder::detect::cuda
