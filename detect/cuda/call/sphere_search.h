// SPDX-License-Identifier: MIT
// Path::grid over all spheres, each by itself: bounds, grid, order, search. Only .cu files include this.
#pragma once
#include <algorithm>

#include "detect/cuda/call/call.h"
#include "detect/cuda/call/speculative_call.h"

namespace padder::detect::cuda {

class SphereSearch {
 public:
  explicit SphereSearch(MemoryBook& book) : book_(book), tools_(book) {}

  // The contacts of `source`, at least one sphere, into call.list; their number and how many were doubtful to
  // `contacts`. Throws Error.
  void run(const DeviceSpheres& source, const Call& call, Contacts& contacts);
  // May such spheres, of which extent and radii are asked, be searched as float whatever they are given as?
  static bool serves_rounded(const Summary& s, double margin);
  // The bounds of the spheres. Waits for the device; throws Error at a faulty sphere.
  Summary survey(const DeviceSpheres& source, const Call& call);
  // The next call does not rely on what this one found.
  void forget() { planned_for_ = 0; }

 private:
  // Everything that decides what the device does between its first kernel and its count: whatever a kernel is
  // given by value follows from it.
  struct Plan {
    DeviceSpheres source;
    Grid grid;
    SearchOptions search;
    Output output;
    Lent lent;
    HistoryTask history;  // `found` is null: none is asked for
    SlotKind kind = SlotKind::equal;
    OrderMethod method = OrderMethod::automatic;
    int crowding = 0;
    bool rounded = false;  // doubles are searched as floats (kMostRounded)
    bool octaves = false, with_survey = false;
    bool keeps = true;  // OrderRequest::keep
    int top = 0, processors = 1;
    SizeGroups groups;        // with_survey: probed along, unless there are none
    std::uint64_t moves = 0;  // allocations so far: addresses are those of the plan
    std::uint64_t kept = 0;   // Orderer::kept(), where the previous call's buckets are to be tried
    // Where the pass leaves the spheres in order. It follows from the rest, and is known when that is
    // enqueued.
    struct Result {
      Ordered ordered;
      friend bool operator==(const Result&, const Result&) { return true; }
    } result;
    friend bool operator==(const Plan&, const Plan&) = default;

    // The bounds are gathered by the kernels that put the spheres in order.
    bool along() const { return with_survey && Surveyor::rides_along(searched()); }
    bool probes() const { return with_survey && groups.count > 0; }
    // What is put in order and searched; decisions and records go by `source`.
    DeviceSpheres searched() const {
      DeviceSpheres s = source;
      s.rounded = rounded;
      return s;
    }
  };
  // What a plan works with. A kernel is given addresses in here and nothing else; they stay while nothing is
  // allocated.
  struct Tools {
    explicit Tools(MemoryBook& book) : surveyor(book), orderer(book), search(book) {}
    Counters* counters() {
      static_assert(sizeof(Counters) <= Surveyor::kHead * 8);
      return reinterpret_cast<Counters*>(surveyor.head());
    }
    void clear_counters(cudaStream_t stream) {
      cuda_check(cudaMemsetAsync(counters(), 0, sizeof(Counters), stream), "clear the counters");
    }
    Surveyor surveyor;
    Branch probing;
    Report report;
    Orderer orderer;
    SearchMemory search;
  };
  struct Steps;  // of SpeculativeCall
  // May the buckets of the call before be kept? Spheres that outgrow them are put in order twice, which costs
  // as much as to count spheres in four calls. So where that has happened twice within a few calls, some
  // calls count.
  class KeptBuckets {
   public:
    bool may() const { return counted_ == 0; }
    void after(bool outgrown) {
      if (counted_ > 0) {
        if (--counted_ == 0) since_ = 0;
        return;
      }
      if (outgrown && since_ < tuning::kSeldomOutgrown) counted_ = tuning::kCallsCounted;
      since_ = outgrown ? 0 : std::min(since_ + 1, tuning::kSeldomOutgrown);
    }

   private:
    int counted_ = 0;                      // calls that are still to count
    int since_ = tuning::kSeldomOutgrown;  // calls since spheres outgrew theirs
  };

  Grid best_grid(const Call& call, const Summary& summary, GridBounds bounds) const;
  bool still_good(const Call& call, const Summary& previous);
  bool origin_stays(const Call& call) const;
  void expect(std::uint64_t count, const Call& call);
  void learn_from_guess();
  void set_growth(const CallOptions& options);
  void survey_as_searched(const DeviceSpheres& source, const Call& call);
  void make_plan(const DeviceSpheres& source, const Call& call, const Summary& summary);
  void plan_output(const Call& call, bool with_survey);
  void lengthen_to_lend(const Call& call);
  enum class Pass { recorded, whole, search };
  void pass(const Call& call, Pass kind);
  static void expect_report(const Plan& plan, Tools& tools);
  static Ordered enqueue_order(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock);
  static void enqueue_search(const Plan& plan, const Ordered& spheres, Tools& tools, cudaStream_t stream,
                             StageClock& clock);

  MemoryBook& book_;
  Tools tools_;
  Plan plan_;
  Recording<Plan> recording_;
  SpeculativeCall speculative_{0};
  KeptBuckets buckets_;
  Summary summary_, before_;      // of the last call, and of that before it
  bool rounded_ = false;          // summary_ is of doubles rounded to float
  double origin_[3] = {0, 0, 0};  // of DeviceSpheres, for those
  double radius_of_all_ = 0;      // likewise
  Grid grid_;                     // that the next pass is to use
  Grid kept_, going_on_;          // guesses for a stable order: see expect()
  bool goes_on_ = false;          // the second one was right, when the first was not
  int guesses_ = 0;               // calls in which there is a second one
  std::uint64_t calls_ = 0;       // in any order, after which the grid could stay
  bool spread_ = false;  // levels are hashed, because spheres are too crowded in some part of a dense level
  int crowding_ = 0;     // OrderRequest::crowding that the spheres asked for
  std::uint64_t long_rows_ = 0;    // SearchOptions::long_rows that the spheres asked for
  std::uint64_t planned_for_ = 0;  // spheres of summary_; 0: it is not to be relied on
  bool planned_wide_ = false;
  Order planned_order_ = Order::stable;
  double planned_bin_size_ = 0;  // CallOptions::bin_size of that plan
  Counters found_{};             // by the last pass
  Ordered ordered_;              // where that pass left the spheres
  OrderMethod method_ = OrderMethod::automatic;
  SlotQuota quota_;  // of the previous list, for a stable order
};

}  // namespace padder::detect::cuda
