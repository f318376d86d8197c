// SPDX-License-Identifier: MIT
// Path::grid for scenes of many worlds: each element walks over the tree of worlds. For a list, the pairs of
// elements that are near each other go through the narrow phase of bodies. For the answers of detect_worlds()
// a warp tests the spheres of such a pair at once, so that a search may end early. Only .cu files include
// this.
#pragma once
#include "detect/cuda/bodies/narrow_phase.h"
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
  // For a list: of each element, the pairs with others that are near, and the pairs before them.
  std::uint32_t* counts = nullptr;
  unsigned long long* offsets = nullptr;
  Pair* near_pairs = nullptr;
  std::uint64_t pair_room = 0;
  // Of each world that an answer is asked for.
  std::uint32_t worlds = 0;
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
  bool counted(const Input& input) const { return input_.counted(input); }
  bool has_worlds() const { return input_.has_worlds(); }
  void forget() { input_.forget(); }

 private:
  WorldTask task_of(const CallOptions& options, int processors) const;
  void find_pairs(WorldTask task, cudaStream_t stream);
  void narrow_phase(const Call& call);
  WorldReport report(cudaStream_t stream);  // waits for the device
  template <class T>
  const T* delivered(const Buffer<T>& from, Buffer<T>& host, std::uint64_t count, const CallOptions& options,
                     cudaStream_t stream);

  WorldInput input_;
  NarrowPhaseMemory narrow_;
  Buffer<Pair> near_pairs_;
  Buffer<uint4> hits_;
  Buffer<BodyCounters> counters_, host_counters_;
  Buffer<std::uint32_t> counts_;
  Buffer<unsigned long long> offsets_, totals_, keys_, pair_keys_;
  Buffer<std::uint8_t> any_, host_any_;
  Buffer<std::uint64_t> count_, host_count_;
  Buffer<double> distance_, host_distance_;
  Buffer<Pair> pair_, host_pair_;
  Buffer<unsigned char> scratch_;
  Buffer<WorldReport> host_report_;
};

}  // namespace padder::detect::cuda
