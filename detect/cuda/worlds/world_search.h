// SPDX-License-Identifier: MIT
// Path::grid for scenes of many worlds and for calls with a margin: each element walks over the tree of
// worlds, and a warp tests the spheres of each two elements that are near each other. One kernel counts and
// writes contacts, and gives the answers of detect_worlds(). Only .cu files include this.
#pragma once
#include "detect/cuda/call/call.h"
#include "detect/cuda/worlds/world_scene.h"

namespace padder::detect::cuda {

// What a kernel of the search works on.
struct WorldTask {
  WorldScene scene;
  Region own;
  double margin = 0;
  bool bounded = false;      // by `own`
  std::uint32_t end = 0;     // the elements that search: the first of the tree
  std::uint32_t lanes = 32;  // elements of a warp
  // Of each element, the number of its contacts, and then the place of its first one in the list.
  unsigned long long *counts = nullptr, *offsets = nullptr;
  Output output;
  // Of each world.
  std::uint8_t* any = nullptr;
  unsigned long long *totals = nullptr, *distances = nullptr, *pairs = nullptr;  // two keys; see the kernel
};

class WorldSearch {
 public:
  explicit WorldSearch(MemoryBook& book);

  // All contacts into call.list, their number and that of the spheres to `contacts`. Throws Error.
  void run(const Call& call, Contacts& contacts);
  WorldAnswers answer(const Input& input, const CallOptions& options, std::uint32_t worlds, Answer answer,
                      int processors, cudaStream_t stream);
  bool knows(const Input& input) const { return input_.knows(input); }
  bool bodies_have_worlds() const { return input_.bodies_have_worlds(); }
  void forget() { input_.forget(); }

 private:
  WorldTask task_of(const CallOptions& options, int processors) const;
  void write(WorldTask task, const Call& call);
  WorldReport report(cudaStream_t stream);  // waits for the device
  template <class T>
  const T* delivered(const Buffer<T>& from, Buffer<T>& host, std::uint64_t count, const CallOptions& options,
                     cudaStream_t stream);

  WorldInput input_;
  Buffer<unsigned long long> counts_, offsets_, totals_, keys_, pair_keys_;
  Buffer<std::uint8_t> any_, host_any_;
  Buffer<std::uint64_t> count_, host_count_;
  Buffer<double> distance_, host_distance_;
  Buffer<Pair> pair_, host_pair_;
  Buffer<unsigned char> scratch_;
  Buffer<WorldReport> host_report_;
};

}  // namespace padder::detect::cuda
