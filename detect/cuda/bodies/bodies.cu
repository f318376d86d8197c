// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/bodies.h"

#include <algorithm>
#include <utility>

#include "detect/cuda/bodies/pair_estimate.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/device/exclusive_sum.h"
#include "detect/cuda/device/profile_range.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// Room for a bin around the bounds, so that elements may move before another grid is needed.
void widen(Summary& s) {
  const auto wider = [](double(&low)[3], double(&high)[3], double by) {
    for (int k = 0; k < 3; k++) low[k] -= by, high[k] += by;
  };
  wider(s.low, s.high, s.need_max);
  for (Summary::Octave& o : s.octave)
    if (o.count) wider(o.low, o.high, o.need_max);
}

// Are elements so few that each is tested with each?
bool are_few(std::uint32_t moving) {
  return moving <= std::min(tuning::kAllPairsElements, test_limits.all_pairs_elements);
}

}  // namespace

BodySearch::BodySearch(MemoryBook& book, PosedBodies& posed)
    : book_(book),
      input_(book, posed),
      tools_(book),
      pairs_(book, "the bodies that meet"),
      hits_(book, "the contacts") {}

BodySearch::Tools::Tools(MemoryBook& book)
    : surveyor(book),
      orderer(book),
      search(book),
      narrow(book),
      query_counts(book, "what is static"),
      query_offsets(book, "what is static"),
      scratch(book, "sums"),
      counters(book, "counters"),
      host_counters(book, "counters", true) {}

void BodySearch::make_plan(const Call& call, const Output& output) {
  const BodyView& view = input_.view();
  plan_ = {};
  plan_.view = view, plan_.loose = input_.loose(), plan_.output = output, plan_.own = call.options.own;
  plan_.margin = call.options.margin;
  plan_.statics = input_.static_view(), plan_.static_grid = input_.table().grid;
  plan_.static_count = input_.table().count;
  plan_.method = method_, plan_.moves = book_.moves;
  plan_.stable_order = call.options.order == Order::stable;
  plan_.all_pairs = are_few(view.moving), plan_.samples = samples_, plan_.most_pairs = most_pairs_;
  if (!plan_.all_pairs) {
    plan_.grid = choose_grid(summary_, 0);
    if (plan_.stable_order) plan_.quota = quota_;
  }
  plan_.octaves = needs_octaves(summary_), plan_.top = exponent_of(summary_.need_max);
  plan_.processors = call.processors;
  plan_.pairs.pairs = pairs_.data(), plan_.pairs.capacity = pairs_.capacity();
  plan_.pairs.width = Width::pairs;
  plan_.lent = call.list.lent();
  // Only a stable order has a list of hits, from which the list of contacts is written.
  plan_.room = output.capacity;
  if (plan_.stable_order) plan_.hits = hits_.data(), plan_.room = std::min(plan_.room, hits_.capacity());
  DeviceSpheres& b = plan_.balls;
  b.centers = &view.balls->x, b.radii = &view.balls->r, b.center_stride = b.radius_stride = 4;
  b.family = view.family, b.mask = view.mask, b.owner = view.owner;
  b.count = view.moving, b.wide = b.filtered = true;
}

// Pairs of elements, counted and then written.
template <class Launch>
void BodySearch::element_pairs(const Plan& plan, Tools& tools, cudaStream_t stream, Launch launch) {
  const std::uint32_t moving = plan.view.moving;
  ElementPairTask t{plan.view, plan.statics, plan.pairs.pairs, plan.pairs.capacity,
                    tools.query_counts.reserve(moving)};
  unsigned long long* offsets = tools.query_offsets.reserve(moving);
  t.offsets = offsets, t.counters = tools.counters.data();
  launch(t, false);
  exclusive_sum(t.counts, offsets, moving, tools.scratch, stream);
  launch(t, true);
}

// Pairs of elements that move.
void BodySearch::broad_phase(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock) {
  const ProfileRange range("padder: broad phase of bodies (stages 1 to 7)");
  BodyCounters* const counters = tools.counters.data();
  if (plan.with_survey) tools.surveyor.begin(plan.balls, plan.octaves, plan.top, plan.processors, stream);
  if (plan.all_pairs)
    return element_pairs(plan, tools, stream, [&](const ElementPairTask& t, bool write) {
      write ? write_all_pairs(t, stream) : count_all_pairs(t, stream);
    });
  const Ordered ordered = tools.orderer.order({.source = plan.balls,
                                               .grid = plan.grid,
                                               .kind = SlotKind::fixed_point,
                                               .stable = plan.stable_order,
                                               .method = plan.method,
                                               .gather = {},
                                               .lent = plan.lent,
                                               .counters = &counters->broad,
                                               .processors = plan.processors,
                                               .stream = stream});
  clock.mark(3);
  SearchOptions o;
  o.stable_order = plan.stable_order, o.quota = plan.quota;
  search(plan.balls, plan.grid, ordered, o, plan.pairs, &counters->broad, tools.search, plan.processors,
         stream);
}

// Pairs of an element that moves and a static one.
void BodySearch::broad_phase_of_static(const Plan& plan, Tools& tools, cudaStream_t stream) {
  if (plan.static_count == 0) return;
  element_pairs(plan, tools, stream, [&](const ElementPairTask& t, bool write) {
    write ? write_static_pairs(t, plan.static_grid, plan.processors, stream)
          : count_static_pairs(t, plan.static_grid, plan.processors, stream);
  });
}

void BodySearch::expect_report(const Plan& plan, Tools& tools) {
  tools.report.clear();
  if (plan.view.moving > 0 && plan.with_survey)
    tools.surveyor.read(plan.balls, plan.octaves, false, tools.report);
  tools.report.add(tools.counters.reserve(1), tools.host_counters.reserve(1), sizeof(BodyCounters));
  tools.report.expect();
}

// One pass over the device, up to the counters on the host.
void BodySearch::enqueue(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock) {
  BodyCounters* counters = tools.counters.reserve(1);
  cuda_check(cudaMemsetAsync(counters, 0, sizeof *counters, stream), "clear the counters");
  if (plan.view.moving > 0) {
    // A list that was laid out for another length has holes; the pass is repeated.
    clear_for_initcheck(plan.pairs.pairs, plan.pairs.capacity, stream);
    if (plan.samples) sample_pairs(plan.view, &counters->sampled, stream);
    broad_phase(plan, tools, stream, clock);
    broad_phase_of_static(plan, tools, stream);
    clock.mark(6);
    const ProfileRange range("padder: narrow phase of bodies (stages 8 and 9)");
    NarrowPhaseTask t{plan.view, plan.loose, plan.own};
    t.margin = plan.margin, t.owns_all = plan.own == Region{}, t.stable_order = plan.stable_order;
    t.pairs = plan.pairs.pairs, t.pair_room = std::min(plan.pairs.capacity, plan.most_pairs);
    t.room = plan.room;
    t.hits = plan.hits, t.counters = counters;
    narrow_phase(t, plan.output, tools.narrow, plan.processors, stream, clock);
  }
  tools.report.send(stream);
}

// The pass of plan_, to its end. Recorded: no stage is timed.
void BodySearch::pass(const Call& call, bool recorded) {
  expect_report(plan_, tools_);
  if (recorded)
    recording_.run(
        plan_, call.stream, call.side,
        [&](cudaStream_t stream) { enqueue(plan_, tools_, stream, call.clock); },
        [&](Plan& plan) { plan.moves = book_.moves; });
  else
    enqueue(plan_, tools_, call.stream, call.clock);
  const ProfileRange range("padder: wait");
  tools_.report.arrived(call.stream, "search for contacts");
  found_ = *tools_.host_counters.data();
}

bool BodySearch::ordinary(const CallOptions& options) const {
  if (summary_.first_fault != ~std::uint64_t(0)) return false;
  return options.width == Width::pairs || options.scalar == Scalar::f64 ||
         std::max(summary_.extent + summary_.radius_max, input_.static_extent()) <= kBallInFloat;
}

struct BodySearch::Steps {
  BodySearch& s;
  const Call& call;
  double most_pairs;
  Contacts& contacts;
  bool too_many_pairs = false;
  std::uint32_t moving = s.input_.view().moving;
  Output output = room_for(1024);

  // Lists of so many contacts.
  Output room_for(std::uint64_t count) const {
    call.list.reserve(call.options, count);
    if (call.options.order == Order::stable) s.hits_.reserve(count);
    return call.list.output(call.options);
  }

  // A plan stands as long as its grid serves the elements of this call. In a stable order it must be the grid
  // that a survey by itself leads to, since the order follows from it.
  Trial try_previous() {
    const Summary planned = s.summary_;
    s.make_plan(call, output);
    s.plan_.with_survey = true;
    s.pass(call, !call.options.timings);
    const Plan& plan = s.plan_;
    if (!s.tools_.surveyor.finish(plan.balls, plan.octaves, plan.top, false, s.summary_))
      return Trial::differs;
    if (!s.ordinary(call.options)) return Trial::refused;
    if (plan.all_pairs) return Trial::fits;
    if (s.summary_.octave[kOctaves - 1].count) return Trial::differs;
    if (plan.stable_order) return plan.grid == choose_grid(s.summary_, 0) ? Trial::fits : Trial::differs;
    if (!covers(plan.grid, s.summary_)) return Trial::differs;
    s.summary_ = planned;
    return Trial::fits;
  }

  bool survey() {
    const ProfileRange range("padder: survey");
    s.method_ = OrderMethod::automatic;
    s.summary_ = {};
    if (moving > 0) {
      s.make_plan(call, output);
      s.summary_ = s.tools_.surveyor.survey(s.plan_.balls, call.processors, call.stream);
    }
    if (!s.ordinary(call.options)) return false;
    call.clock.mark(0);
    if (call.options.order == Order::any) widen(s.summary_);
    s.make_plan(call, output);
    return true;
  }

  void pass() { s.pass(call, false); }

  // Whatever was too small was counted to its end, and is made larger. A list of pairs whose order is that of
  // another length is made again, too.
  bool grow() {
    const BodyCounters& found = s.found_;
    const std::uint64_t pairs = found.broad.contacts + found.static_pairs;
    const bool stable = s.plan_.stable_order && !s.plan_.all_pairs && moving > 0;
    const SlotQuota quota =
        stable ? quota_for(found.broad, moving, s.plan_.grid, SlotKind::fixed_point) : SlotQuota{};
    const bool known = !stable || quota == s.plan_.quota;
    const std::uint64_t spilled = stable ? found.broad.spilled : 0;
    SearchMemory& memory = s.tools_.search;
    if (found.broad.flags & kOutside) throw Error(kChanged);
    if (found.broad.flags & kCrowded) {
      s.method_ = OrderMethod::sort;
    } else if (static_cast<double>(pairs) > most_pairs ||
               (s.plan_.samples && cuda::estimated_pairs(moving, found.sampled) > most_pairs)) {
      too_many_pairs = true;
      return false;
    } else if (pairs > s.pairs_.capacity() || !known || spilled > memory.spill.capacity()) {
      if (pairs > s.pairs_.capacity()) s.pairs_.reserve(pairs + pairs / 8);
      if (stable) memory.spill.reserve(known ? spilled + spilled / 8 : pairs / 16 + 4096), s.quota_ = quota;
    } else if (found.contacts > s.plan_.room) {
      output = room_for(found.contacts + found.contacts / 8);
    } else {
      contacts.count = found.contacts;
      return false;
    }
    s.make_plan(call, output);
    return true;
  }
};

// Waits for the device.
double BodySearch::estimated_pairs(const Call& call) {
  BodyCounters* counters = tools_.counters.reserve(1);
  cuda_check(cudaMemsetAsync(counters, 0, sizeof *counters, call.stream), "clear the counters");
  sample_pairs(input_.view(), &counters->sampled, call.stream);
  Report& report = tools_.report;
  report.clear(), report.add(counters, tools_.host_counters.reserve(1), sizeof *counters), report.expect();
  report.send(call.stream);
  report.arrived(call.stream, "estimate the pairs");
  return cuda::estimated_pairs(input_.view().moving, tools_.host_counters.data()->sampled);
}

bool BodySearch::run(const Call& call, PairLimit limit, Contacts& contacts) {
  const bool known = knows(call.input);
  {
    const ProfileRange range("padder: read the bodies");
    if (!input_.read(call)) return false;
  }
  call.clock.mark(StageClock::kPlace);
  const std::uint32_t moving = input_.view().moving;
  // Too many pairs by the estimate are too many, whatever their count, so that a stable order follows from
  // the scene. The estimate runs along if the call before did not give up. Else it comes first: to count in
  // vain would take longer than to wait for it.
  samples_ = limit.most < INFINITY && !are_few(moving) &&
             (limit.hollow || limit.most < tuning::kPackedPairs * moving);
  if (!std::exchange(went_first_, false) && std::exchange(samples_, false) &&
      estimated_pairs(call) > limit.most) {
    input_.keep(call.input);
    return false;
  }
  pairs_.reserve(4 * std::uint64_t(moving) + 1024);
  most_pairs_ =
      limit.most < 0x1p63 ? static_cast<std::uint64_t>(std::max(limit.most, 0.0)) : ~std::uint64_t(0);
  Steps steps{*this, call, limit.most, contacts};
  // Where only a box's elements are searched, their number changes as they move, and with it the grid.
  if (!speculative_.run(steps, known && moving > 0 && moving == summary_.count)) return false;
  input_.keep(call.input);
  if (steps.too_many_pairs) return false;
  went_first_ = true;
  call.clock.mark(8);
  contacts.spheres = input_.body_spheres() + loose_count(call.input);
  return true;
}

}  // namespace padder::detect::cuda
