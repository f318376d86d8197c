// SPDX-License-Identifier: MIT
#include "detect/cuda/call/sphere_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "detect/cuda/device/profile_range.h"
#include "detect/cuda/input/input_copy.h"
#include "detect/cuda/order/bins.h"
#include "detect/cuda/search/exact_test.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// A level has an array of at most so many bins for each sphere; beyond, it is hashed.
constexpr double kBinsASphere = 8;

// A power of two, so that it seldom changes while spheres move. No |coordinate| is larger.
double extent_of(const Summary& s) {
  int exponent = 0;
  std::frexp(s.extent, &exponent);
  return s.extent > 0 ? std::ldexp(1, exponent) : 0;
}

SearchOptions search_options(const CallOptions& options, const Summary& summary, bool apart) {
  SearchOptions s;
  s.exact = options.precision == Precision::exact || options.margin > 0;
  // With a history, contacts have slots of their own even in any order: then they stay near their place.
  s.stable_order = options.order == Order::stable || options.history;
  s.defers = true;
  s.own = options.own, s.radius = summary.radius_max, s.margin = options.margin;
  s.owns_all = options.own == Region{};
  // Where worlds lie side by side, slots do not tell where a midpoint is.
  s.owner_band = apart ? INFINITY : owner_band(extent_of(summary), summary.radius_max, options.margin);
  return s;
}

struct Point {
  double at[3];
};

// Half the length of the scene.
double half_of(const Summary& s) {
  double half = s.radius_max;
  for (int k = 0; k < 3; k++) half = std::max(half, s.high[k] / 2 - s.low[k] / 2);
  return half;
}
// DeviceSpheres::origin. It goes in steps of 2.7 to 5.5 times half_of(), so that it seldom changes while
// spheres move, and is 0 where 0 lies in the scene: where few spheres have escaped, most of the others lie
// near 0, but far from the middle of all. 1.37: many scenes have a power of two as their length.
Point origin_for(const Summary& s) {
  const double half = half_of(s);
  Point origin{};
  if (!(half > 0)) return origin;
  const double step = 4 * std::ldexp(1, std::ilogb(1.37 * half));
  for (int k = 0; k < 3; k++) origin.at[k] = step * std::round((s.low[k] / 2 + s.high[k] / 2) / step);
  return origin;
}
// Of spheres that lie so much further along the axes. Their needs and octaves are not moved.
Summary moved(Summary s, const double (&by)[3], double sign) {
  s.extent = 0;
  for (int k = 0; k < 3; k++) {
    s.low[k] += sign * by[k], s.high[k] += sign * by[k];
    s.extent = larger(s.extent, larger(magnitude(s.low[k]), magnitude(s.high[k])));
  }
  return s;
}

// Input in double is searched as float where that leaves float sure of most pairs, and worlds are searched
// side by side (exact_test.h). `s`: relative to DeviceSpheres::origin.
bool may_round(const DeviceSpheres& source, const Summary& s, double margin) {
  return (source.worlds_apart || (source.wide && source.placed == 0)) &&
         SphereSearch::serves_rounded(s, margin);
}

// What the next call may count, if the spheres go on as they did. The quota of a stable order follows from
// what a call counts: where it was foreseen, nothing is searched twice.
Counters expected_next(const Counters& before, const Counters& now) {
  const auto ahead = [](auto old, auto last) {
    return old > 0 && last + last > old ? last + last - old : last;
  };
  Counters next = now;
  next.own = ahead(before.own, now.own);
  const auto of_units = [](const Counters& c) { return c.contacts - c.deferred - c.own; };
  next.contacts = next.own + ahead(of_units(before), of_units(now)), next.deferred = 0;
  next.expected = ahead(before.expected, now.expected);
  return next;
}

// In any order a quota of the call before may stay, as long as not many more contacts spill. It must not be
// larger than the best one: slots would stay empty, and the list would have gaps.
bool serves(const SlotQuota& quota, const SlotQuota& best) {
  const auto near_below = [](double a, double b) { return 0.9 * b <= a && a <= b; };
  return near_below(quota.tile, best.tile) && near_below(quota.unit, best.unit);
}

// Fixed-point slots are of spheres that are grown by what the grid says: more would be too much.
bool has_margin(const Grid& grid, SlotKind kind, const Summary& s) {
  return kind != SlotKind::fixed_point || grid.level[0].grown_by == s.grown_by;
}

bool are_about_as_many(std::uint64_t a, std::uint64_t b) { return a - a / 8 <= b && b - b / 8 <= a; }

void check(const DeviceSpheres& source, const Summary& s, const Call& call) {
  if (s.first_fault != ~std::uint64_t(0)) {
    const Sphere faulty = sphere_at(source, static_cast<std::uint32_t>(s.first_fault), call.stream);
    throw Error(fault_sentence(s.first_fault, faulty, call.input));
  }
  check_range(s, call.options);
}

}  // namespace

bool SphereSearch::serves_rounded(const Summary& s, double margin) {
  const double smallest = s.radius_min + margin / 2;
  return float_range(s.extent, s.radius_max + margin / 2) && smallest > 0x1p-40 &&
         extent_of(s) <= kMostRounded * smallest;
}

Summary SphereSearch::survey(const DeviceSpheres& source, const Call& call) {
  const ProfileRange range("padder: survey");
  const Summary s = tools_.surveyor.survey(source, call.processors, call.stream);
  check(source, s, call);
  return s;
}

// The grid that the summary asks for. A stable order depends on the grid, so that there it must follow from
// the spheres alone, whatever was detected before.
Grid SphereSearch::best_grid(const Call& call, const Summary& summary, GridBounds bounds) const {
  const bool stable = call.options.order == Order::stable;
  return choose_grid(summary, call.options.bin_size, spread_ && !stable ? 0 : kBinsASphere, Processor::gpu,
                     stable ? GridBounds::stepped : bounds);
}

// After a pass with grid_, of which summary_ was found: may the contacts be taken? Chooses the grid of the
// next call, before spheres leave this one.
bool SphereSearch::still_good(const Call& call, const Summary& previous) {
  if (call.options.order == Order::stable) return best_grid(call, summary_, GridBounds::stepped) == grid_;
  const bool good = covers(grid_, summary_);
  const Summary next = expected_next(previous, summary_);
  const bool stays = good && covers(grid_, next);
  if (stays && ++calls_ % tuning::kCallsOfGrid != 0) return true;
  const Grid best = best_grid(call, summary_, GridBounds::wide);
  if (!stays || best.buckets * std::uint64_t(2) + 4096 < grid_.buckets) grid_ = best;
  if (stays) return good;
  // For some calls more, where spheres fly on, if that takes few bins more.
  const Summary later = expected_next(next, expected_next(summary_, next));
  const Grid ahead = best_grid(call, later, GridBounds::wide);
  if (ahead.buckets <= best.buckets + best.buckets / 2) grid_ = ahead;
  return good;
}

// The grid that this call begins with, where there are not many more or fewer spheres than before. The margin
// may be another. In any order the grid stays while it can. That of a stable order follows from the spheres
// of its call alone, and is guessed: the spheres stay or, for some calls after one in which another grid was
// right, they go on as they did since the call before.
void SphereSearch::expect(std::uint64_t count, const Call& call) {
  const bool same = summary_.count == count && plan_.search.margin == call.options.margin &&
                    planned_order_ == call.options.order;
  if (!same) summary_ = with_count(summary_, count), set_growth(call.options);
  if (call.options.order == Order::any) {
    if (!same && !(covers(grid_, summary_) && has_margin(grid_, plan_.kind, summary_)))
      grid_ = best_grid(call, summary_, GridBounds::wide);
    return;
  }
  kept_ = same ? plan_.grid : best_grid(call, summary_, GridBounds::stepped);
  if (guesses_ > 0) going_on_ = best_grid(call, going_on(before_, summary_), GridBounds::stepped);
  grid_ = guesses_ > 0 && goes_on_ ? going_on_ : kept_;
}

// Where the guesses differ, the one that turns out to be right counts until the other one does.
void SphereSearch::learn_from_guess() {
  const bool stayed = plan_.grid == kept_, went_on = guesses_ > 0 && plan_.grid == going_on_;
  if (stayed != went_on) goes_on_ = went_on;
  guesses_ = stayed ? std::max(guesses_ - 1, 0) : tuning::kCallsGuessed;
}

// Would a survey lead to the same DeviceSpheres::origin? For a stable order, which must not depend on the
// calls before: surely, since what is known is rounded. In any order it stays while it is not twice as far
// away as it may be.
bool SphereSearch::origin_stays(const Call& call) const {
  if (call.options.order == Order::any) return summary_.extent <= 8 * half_of(summary_);
  for (const int low : {-1, 1})
    for (const int high : {-1, 1}) {
      Summary given = moved(summary_, origin_, 1);
      for (int k = 0; k < 3; k++) {
        const double error = 0x1p-23 * extent_of(summary_) + 0x1p-51 * magnitude(origin_[k]);
        given.low[k] += low * error, given.high[k] += high * error;
      }
      given.radius_max *= 1 + high * 0x1p-23;
      if (!std::ranges::equal(origin_for(given).at, origin_)) return false;
    }
  return true;
}

// Also finds summary_ of the floats that are searched in the place of what is given.
void SphereSearch::survey_as_searched(const DeviceSpheres& source, const Call& call) {
  DeviceSpheres searched = source;
  searched.rounded = source.worlds_apart;
  if (!searched.rounded) {
    summary_ = survey(source, call);
    std::ranges::copy(origin_for(summary_).at, searched.origin);
    searched.rounded = may_round(source, moved(summary_, searched.origin, -1), call.options.margin);
    if (summary_.radius_min == summary_.radius_max) searched.radius_of_all = summary_.radius_max;
  }
  if (searched.rounded) {
    const Summary of_floats = tools_.surveyor.survey(searched, call.processors, call.stream);
    searched.rounded = may_round(source, of_floats, call.options.margin);
    if (searched.rounded) summary_ = of_floats;
    if (source.worlds_apart && !searched.rounded) throw Error(kChanged);
  }
  rounded_ = searched.rounded, radius_of_all_ = searched.radius_of_all;
  std::ranges::copy(searched.origin, origin_);
  const Draw draw = call.options.order == Order::stable ? Draw::few : Draw::many;
  summary_.near = tools_.surveyor.neighbourhood(searched, summary_, draw, call.stream);
  set_growth(call.options);
}

void SphereSearch::set_growth(const CallOptions& options) {
  summary_.grown_by = options.margin / 2 + (rounded_ ? grown_by_rounding(extent_of(summary_)) : 0);
}

void SphereSearch::make_plan(const DeviceSpheres& source, const Call& call, const Summary& summary) {
  plan_ = {};
  plan_.source = source, plan_.grid = grid_;
  plan_.search = search_options(call.options, summary, source.worlds_apart);
  if (plan_.search.stable_order) plan_.search.quota = quota_;
  plan_.search.long_rows = long_rows_;
  plan_.rounded = rounded_ && may_round(source, summary, call.options.margin);
  if (plan_.rounded) {
    plan_.source.radius_of_all = radius_of_all_;
    std::ranges::copy(origin_, plan_.source.origin);
  }
  const bool floats = plan_.searched().searched_as_floats() &&
                      float_range(summary.extent, summary.radius_max + call.options.margin / 2);
  plan_.kind = !floats                                    ? SlotKind::fixed_point
               : summary.radius_min == summary.radius_max ? SlotKind::equal
                                                          : SlotKind::unequal;
  plan_.octaves = needs_octaves(summary), plan_.top = exponent_of(summary.need_max);
  // The levels of a stable order follow from the spheres of this very call.
  plan_.groups = call.options.order == Order::stable && summary.near ? summary.near->groups : SizeGroups{};
  plan_.processors = call.processors;
}

// The rest of the plan, once the list is as long as it is to be.
void SphereSearch::plan_output(const Call& call, bool with_survey) {
  plan_.output = call.list.output(call.options), plan_.with_survey = with_survey, plan_.method = method_;
  plan_.crowding = crowding_;
  plan_.lent = call.list.lent();
  plan_.history =
      call.history ? call.history->task(call.list.pairs(), plan_.output.capacity, nullptr) : HistoryTask{};
  plan_.moves = book_.moves, plan_.kept = tools_.orderer.kept();
}

// The list lends its memory to the order as work space. In a first call it has none yet. Smaller buckets take
// more room: where that is not lent, they are counted in each call. The list of few spheres lends none, but
// is long enough for usual scenes: making it longer would take several times as long as a call.
void SphereSearch::lengthen_to_lend(const Call& call) {
  const std::uint32_t count = plan_.source.count;
  const bool first = call.list.capacity(call.options) == 0;
  if (count < tuning::kFewSpheres) {
    if (first && book_.limit == 0) call.list.reserve(call.options, tuning::kListOfFew * std::uint64_t(count));
    return;
  }
  if (call.options.width == Width::pairs || (!first && crowding_ == 0)) return;
  const std::uint64_t room = Orderer::room(count) + (crowding_ ? count / 8 : 0);
  const bool words = plan_.kind != SlotKind::equal || !float_bins(plan_.grid, plan_.kind, count).on;
  if (!words)
    call.list.reserve_slots(room);
  else
    call.list.reserve(call.options, room);
}

void SphereSearch::expect_report(const Plan& plan, Tools& tools) {
  tools.report.clear();
  if (plan.with_survey)
    tools.surveyor.read(plan.searched(), plan.octaves, plan.along(), tools.report);
  else
    tools.surveyor.read_head(tools.report);
  if (plan.probes()) tools.surveyor.read_probes(plan.groups, tools.report);
  tools.report.expect();
}

// The first half of a pass over the device.
Ordered SphereSearch::enqueue_order(const Plan& plan, Tools& tools, cudaStream_t stream, StageClock& clock) {
  Counters* const counters = tools.counters();
  const ProfileRange range("padder: order (stages 1 to 6)");
  if (plan.with_survey && !plan.along())
    tools.surveyor.begin(plan.source, plan.octaves, plan.top, plan.processors, stream);
  else if (!plan.with_survey)
    tools.clear_counters(stream);
  const Gather gather = plan.along() ? tools.surveyor.gather(plan.octaves, plan.top) : Gather{};
  const Ordered spheres = tools.orderer.order({.source = plan.searched(),
                                               .grid = plan.grid,
                                               .kind = plan.kind,
                                               .radius = plan.search.radius,
                                               .given = true,
                                               .stable = plan.search.stable_order,
                                               .method = plan.method,
                                               .crowding = plan.crowding,
                                               .gather = gather,
                                               .lent = plan.lent,
                                               .counters = counters,
                                               .processors = plan.processors,
                                               .stream = stream,
                                               .keep = plan.with_survey && plan.keeps});
  // Beside the search: the host alone asks for what the probes find.
  if (plan.probes())
    tools.probing.fork(stream, [&](cudaStream_t beside) {
      tools.surveyor.probe(plan.searched(), plan.groups, Draw::few, beside);
    });
  clock.mark(3);
  return spheres;
}

// The second half: search, and the counters (with_survey: the summary too) to the host.
void SphereSearch::enqueue_search(const Plan& plan, const Ordered& spheres, Tools& tools, cudaStream_t stream,
                                  StageClock& clock) {
  Counters* const counters = tools.counters();
  {
    const ProfileRange range("padder: search (stages 7 to 9)");
    search(plan.source, plan.grid, spheres, plan.search, plan.output, counters, tools.search, plan.processors,
           stream);
  }
  if (plan.history.found) {
    const ProfileRange range("padder: history");
    clock.mark(8);
    HistoryTask history = plan.history;
    history.count = &counters->contacts;
    History::enqueue(history, plan.processors, stream);
    clock.mark(StageClock::kHistory);
  }
  tools.probing.join(stream);
  tools.report.send(stream);
}

// The pass of plan_, to its end. Recorded: no stage is timed. Search: the spheres are in order by the pass
// before.
void SphereSearch::pass(const Call& call, Pass kind) {
  expect_report(plan_, tools_);
  if (call.history) call.history->begin_pass(plan_.history, call.stream);
  const auto enqueue = [&](cudaStream_t stream) {
    if (kind == Pass::search)
      tools_.clear_counters(stream);
    else
      ordered_ = enqueue_order(plan_, tools_, stream, call.clock);
    enqueue_search(plan_, ordered_, tools_, stream, call.clock);
  };
  if (kind == Pass::recorded)
    ordered_ = recording_
                   .run(plan_, call.stream, call.side, enqueue,
                        [&](Plan& plan) {
                          plan.moves = book_.moves, plan.kept = tools_.orderer.kept();
                          plan.result.ordered = ordered_;
                        })
                   .result.ordered;
  else
    enqueue(call.stream);
  const ProfileRange range("padder: wait");
  tools_.report.arrived(call.stream, "search for contacts");
  found_ = *reinterpret_cast<const Counters*>(tools_.surveyor.host_head());
}

struct SphereSearch::Steps {
  SphereSearch& s;
  const DeviceSpheres& source;
  const Call& call;
  Contacts& contacts;
  bool again;             // the call before had about as many spheres
  bool surveyed = false;  // by a trial that found the spheres to be others, but all it needed to know
  bool in_order = false;  // the last pass put the spheres in an order that still serves

  bool may_try() const { return again && !call.options.timings; }

  Trial try_previous() {
    const Summary previous = s.summary_;
    s.make_plan(source, call, previous);
    s.plan_output(call, true);
    s.plan_.keeps = s.buckets_.may();
    s.pass(call, Pass::recorded);
    const bool outgrown = s.found_.flags == kOutgrown;
    s.buckets_.after(outgrown);
    // The counts of that pass were right, and each bucket gets the room that it needs now.
    if (outgrown) s.pass(call, Pass::recorded);
    const SlotKind kind = s.plan_.kind;
    const SearchOptions searched = s.plan_.search;
    const bool probed = s.plan_.probes(), rounded = s.plan_.rounded;
    if (!s.tools_.surveyor.finish(s.plan_.searched(), s.plan_.octaves, s.plan_.top, s.plan_.along(),
                                  s.summary_))
      return Trial::differs;
    s.summary_.near =
        s.plan_.probes() ? s.tools_.surveyor.probed(s.plan_.groups, source.count, Draw::few) : previous.near;
    // A sphere that no float can hold need not be faulty.
    if (s.rounded_ && s.summary_.first_fault != ~std::uint64_t(0)) return Trial::differs;
    s.set_growth(call.options);
    check(source, s.summary_, call);
    // A list of rounded spheres has another order than one of doubles.
    if (call.options.order == Order::stable && !s.rounded_ &&
        may_round(source, moved(s.summary_, origin_for(s.summary_).at, -1), call.options.margin))
      return Trial::differs;
    if (s.rounded_ && !source.worlds_apart && !s.origin_stays(call)) return Trial::differs;
    // Where the last octave is populated, a survey by itself may tell sizes apart in another way
    // (Summary::above).
    if (s.summary_.octave[kOctaves - 1].count > 0) return Trial::differs;
    const Grid tried = s.grid_;
    const bool good = s.still_good(call, previous) && !s.found_.flags;
    const auto same_groups = [&] {
      const Summary& now = s.summary_;
      return now.octaves_known ? now.near && now.near->groups == size_groups(now) : !now.near;
    };
    // What follows in this call goes by the grid that was tried.
    const Grid next = std::exchange(s.grid_, tried);
    s.make_plan(source, call, s.summary_);
    s.grid_ = next;
    in_order = !s.found_.flags && kind == s.plan_.kind && rounded == s.plan_.rounded &&
               has_margin(tried, kind, s.summary_) &&
               (kind != SlotKind::equal || s.summary_.radius_max == previous.radius_max);
    if (in_order && good && (!probed || same_groups()) && searched == s.plan_.search) return Trial::fits;
    surveyed = same_groups() && !(s.found_.flags & kCrowded) && rounded == s.plan_.rounded;
    return Trial::differs;
  }

  bool survey() {
    if (!surveyed) s.survey_as_searched(source, call);
    call.clock.mark(0);
    // The spheres move, where the grid of a call before did not fit.
    s.grid_ = s.best_grid(call, s.summary_, may_try() ? GridBounds::wide : GridBounds::tight);
    in_order = in_order && surveyed && have_same_bins(s.grid_, s.plan_.grid);
    s.make_plan(source, call, s.summary_);
    s.lengthen_to_lend(call);
    s.method_ = OrderMethod::automatic;
    s.plan_output(call, false);
    return true;
  }

  void pass() { s.pass(call, in_order ? Pass::search : Pass::whole); }

  // A bucket too full: smaller buckets; then hashed levels, where they are not yet; at last sort. A list too
  // short: it was counted to its end, is made longer and written again. So is a list whose order is that of
  // another length.
  bool grow() {
    const Counters& found = s.found_;
    contacts.count = found.contacts, contacts.doubtful = found.doubtful;
    if (found.flags & kOutside) throw Error(kChanged);
    SearchOptions& search = s.plan_.search;
    const bool stable = search.stable_order, reproducible = call.options.order == Order::stable;
    SlotQuota quota = stable ? quota_for(found, source.count, s.plan_.grid, s.plan_.kind) : SlotQuota{};
    if (!reproducible && serves(search.quota, quota)) quota = search.quota;
    const bool too_short = contacts.count > call.list.capacity(call.options);
    in_order = !(found.flags & kCrowded);
    if (found.flags & kCrowded) {
      if (s.crowding_ < tuning::kMostCrowding && source.count >= tuning::kFewSpheres) {
        s.crowding_++;
        s.lengthen_to_lend(call);
      } else if (!reproducible && !s.spread_) {
        s.spread_ = true, s.crowding_ = 0, s.grid_ = s.best_grid(call, s.summary_, GridBounds::tight);
        s.plan_.grid = s.grid_;
      } else {
        s.method_ = OrderMethod::sort;
      }
    } else if (search.defers && found.long_rows > tuning::kMostRowParts) {
      search.defers = false, search.long_rows = 0;  // for this call alone: the list must not depend on others
    } else if (found.long_rows > search.long_rows) {
      // The contacts of long rows are not counted yet. In motion their number changes.
      search.long_rows = s.long_rows_ = found.long_rows + found.long_rows / 2 + 256;
    } else if (too_short || quota != search.quota ||
               (stable && found.spilled > s.tools_.search.spill.capacity())) {
      // A list that was long enough for these spheres before will be too short again.
      if (too_short) call.list.reserve(call.options, contacts.count + contacts.count / (again ? 4 : 16));
      if (stable) {
        // With another quota it is not known yet what will spill: usually a twentieth of the list.
        s.tools_.search.spill.reserve(quota == search.quota ? found.spilled + found.spilled / 8
                                                            : contacts.count / 16 + 4096);
        search.quota = s.quota_ = quota;
      }
    } else {
      return false;
    }
    s.plan_output(call, false);
    return true;
  }
};

void SphereSearch::run(const DeviceSpheres& source, const Call& call, Contacts& contacts) {
  const std::uint64_t planned_for = std::exchange(planned_for_, 0);  // until all went well
  const bool as_many = planned_for > 0 && are_about_as_many(planned_for, source.count);
  if (!as_many) spread_ = false, crowding_ = 0, long_rows_ = 0;
  const bool planned = as_many && planned_bin_size_ == call.options.bin_size && planned_wide_ == source.wide;
  if (planned) expect(source.count, call);
  const Counters before = found_;
  const Summary summary_before = summary_;
  double origin_before[3];
  std::ranges::copy(origin_, origin_before);
  Steps steps{*this, source, call, contacts, planned};
  speculative_.run(steps, steps.may_try());
  if (call.options.order == Order::stable) {
    const bool trend = planned && planned_order_ == Order::stable;
    quota_ = quota_for(expected_next(trend ? before : found_, found_), source.count, plan_.grid, plan_.kind);
    const bool same_origin = planned && std::ranges::equal(origin_before, origin_);
    before_ = same_origin ? summary_before : summary_;
    if (planned) learn_from_guess();
  }
  planned_for_ = source.count, planned_bin_size_ = call.options.bin_size, planned_wide_ = source.wide;
  planned_order_ = call.options.order;
  call.clock.mark(8);
}

}  // namespace padder::detect::cuda
