// SPDX-License-Identifier: MIT
// Path::grid, bodies first. The broad phase takes the balls about pieces of bodies, and the loose spheres,
// through order and search like any spheres. The narrow phase looks at the spheres of each two pieces whose
// balls touch. A last pass writes the records. Only .cu files include this.
#pragma once
#include "detect/cuda/bodies/body_input.h"
#include "detect/cuda/bodies/narrow_phase.h"
#include "detect/cuda/call/call.h"
#include "detect/cuda/call/speculative_call.h"

namespace padder::detect::cuda {

class BodySearch {
 public:
  BodySearch(MemoryBook& book, PosedBodies& posed);

  bool knows(const Input& input) const { return input_.knows(input); }  // by its revision
  Pieces& pieces() { return input_.pieces(); }
  // A call went another way: what moved in it was not seen.
  void forget() { input_.forget(); }

  // How many balls about pieces may touch.
  struct PairLimit {
    double most = INFINITY;
    bool hollow = false;  // the balls are mostly empty, as those of rods: many may touch where few spheres do
  };
  // All contacts into call.list, their number and that of the spheres to `contacts`. False: the spheres of
  // the bodies must be searched one by one. Either something is out of the ordinary (a pose that is none,
  // coordinates beyond what a record holds), or more balls touch than the limit, by count or by estimate.
  bool run(const Call& call, PairLimit limit, Contacts& contacts);
  // How many balls touched in the last run that was not in vain.
  double pairs() const { return static_cast<double>(found_.broad.contacts + found_.static_pairs); }

 private:
  // Everything that decides what the device does between its first kernel and its count: whatever a kernel is
  // given by value follows from it.
  struct Plan {
    BodyView view;
    DeviceSpheres balls, loose;
    Grid grid;
    Output output, pairs;  // of contacts, of elements whose balls touch
    Region own;
    double margin = 0;
    StaticView statics;
    Grid static_grid;
    std::uint32_t static_count = 0;
    Lent lent;
    uint4* hits = nullptr;                         // for a stable order
    std::uint64_t room = 0;                        // for contacts
    std::uint64_t most_pairs = ~std::uint64_t(0);  // of balls that touch; beyond, no contact is looked for
    OrderMethod method = OrderMethod::automatic;
    bool octaves = false, with_survey = false, stable_order = true;
    bool all_pairs = false;  // so few elements that no grid is needed
    bool samples = false;    // an estimate of the pairs runs along
    SlotQuota quota;
    int top = 0, processors = 1;
    std::uint64_t moves = 0;
    friend bool operator==(const Plan&, const Plan&) = default;
  };
  // What a plan works with. A kernel is given addresses in here and nothing else; they stay while nothing is
  // allocated.
  struct Tools {
    explicit Tools(MemoryBook& book);
    Surveyor surveyor;
    Orderer orderer;
    SearchMemory search;
    Report report;
    NarrowPhaseMemory narrow;
    Buffer<std::uint32_t> query_counts;
    Buffer<unsigned long long> query_offsets;
    Buffer<unsigned char> scratch;
    Buffer<BodyCounters> counters, host_counters;
  };
  struct Steps;  // of SpeculativeCall

  void make_plan(const Call& call, const Output& output);
  void pass(const Call& call, bool recorded);
  static void expect_report(const Plan& plan, Tools& tools);
  static void enqueue(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock);
  static void broad_phase(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock);
  template <class Launch>
  static void element_pairs(const Plan& plan, Tools& tools, cudaStream_t stream, Launch launch);
  static void broad_phase_of_static(const Plan& plan, Tools& tools, cudaStream_t stream);
  bool ordinary(const CallOptions& options) const;
  double estimated_pairs(const Call& call);

  MemoryBook& book_;
  BodyInput input_;
  Tools tools_;
  Summary summary_;
  Plan plan_;
  Recording<Plan> recording_;
  SpeculativeCall speculative_{1};
  bool samples_ = false;          // Plan::samples of this call
  std::uint64_t most_pairs_ = 0;  // likewise
  bool went_first_ = false;       // the call before did not give up
  OrderMethod method_ = OrderMethod::automatic;
  Buffer<Pair> pairs_;
  Buffer<uint4> hits_;
  BodyCounters found_{};  // by the last pass
  SlotQuota quota_;       // of the pairs found before, for a stable order
};

}  // namespace padder::detect::cuda
