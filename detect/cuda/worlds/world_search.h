// SPDX-License-Identifier: MIT
// Path::grid for scenes of many worlds: each element walks over the tree of worlds. For a list, the pairs of
// elements that are near each other go through the narrow phase of bodies. For the answers of detect_worlds()
// a warp tests the spheres of such a pair at once, so that a search may end early. Only .cu files include
// this.
#pragma once
#include "detect/cuda/bodies/narrow_phase.h"
#include "detect/cuda/call/call.h"
#include "detect/cuda/worlds/world_answers.h"
#include "detect/cuda/worlds/world_scene.h"

namespace padder::detect::cuda {

// How much a search of the tree may do before it gives up.
struct WorldAllowance {
  unsigned long long pairs = ~0ull;  // of elements that are near each other
  // A step is a run of eight elements against one, or 32 tests of two spheres.
  std::uint32_t steps_of_warp = ~0u;
  std::uint32_t elements_of_world = ~0u;  // in the largest, but for kEveryWorld
};

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
  WorldKeys keys;  // for answers
  WorldAllowance allowed;
};

class WorldSearch {
 public:
  WorldSearch(MemoryBook& book, PosedBodies& posed);

  // All contacts into call.list, their number and that of the spheres to `contacts`. False: more than is
  // allowed would have to be done. Throws Error.
  bool run(const Call& call, const WorldAllowance& allowed, Contacts& contacts);
  // Answers for those worlds that have none. False: as above; then some have none yet.
  bool answer(const Call& call, const WorldAllowance& allowed, const AnswerArrays& answers);
  void forget() { input_.forget(); }

 private:
  WorldTask task_of(const CallOptions& options, int processors) const;
  void find_pairs(WorldTask task, cudaStream_t stream);
  void narrow_phase(const Call& call);
  WorldReport report(cudaStream_t stream);  // waits for the device

  WorldInput input_;
  NarrowPhaseMemory narrow_;
  Buffer<Pair> near_pairs_;
  Buffer<uint4> hits_;
  Buffer<BodyCounters> counters_, host_counters_;
  Buffer<std::uint32_t> counts_;
  Buffer<unsigned long long> offsets_;
  Buffer<unsigned char> scratch_;
  Buffer<WorldReport> host_report_;
};

}  // namespace padder::detect::cuda
