// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/world_search.h"

#include <algorithm>

#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/exclusive_sum.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 128, kWarps = kThreads / 32;

// What a kernel does with the pairs of elements that are near each other, or with the contacts in them.
enum class Pass {
  count,     // pairs, of each element
  write,     // these pairs
  any,       // marks their worlds; a world that is marked is not searched on
  total,     // of each world
  distance,  // the smallest signed distance of each world
  pair       // and the first pair with that distance
};

// Spheres of two elements, placed, in the shared memory of a warp.
struct PlacedSphere {
  double x, y, z, r;
};
struct Room {
  PlacedSphere a[kPieceSpheres], b[kPieceSpheres];
  std::uint32_t slot_a[kPieceSpheres], slot_b[kPieceSpheres];
};

// The element of a lane. The walk over the tree is the warp's: neighbours in the order need the same nodes.
struct Lane {
  std::uint32_t element, world, from, until;  // it meets the elements [from, until) of its world
  float4 ball;                                // a ball that contains all whose gap to the element is in reach
  TreeBox box;                                // of that
  bool active;
  double reach;  // the largest gap of interest
  std::uint32_t found;
  std::uint32_t steps;  // of the warp; see WorldAllowance
};

__device__ __forceinline__ void set_reach(const WorldScene& scene, Lane& lane, double reach) {
  const float4 s = scene.near_balls[lane.element];
  // A distance is rounded, which may be more than all small spheres where one is huge.
  const float r = float_above(s.w + reach + 0x1p-50 * (s.w + magnitude(reach)));
  lane.reach = reach, lane.ball = make_float4(s.x, s.y, s.z, r);
  lane.box = box_of(scene.view.balls[lane.element], reach);
}
// Not written as "within", so that what is not a number passes. Four roundings of the squares, and more.
__device__ __forceinline__ bool apart(const float4& a, const float4& b) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, s = a.w + b.w;
  return x * x + y * y + z * z > s * s * (1 + 0x1p-20f) + 0x1p-100f;
}

__device__ __forceinline__ bool owned(const WorldTask& task, const Sphere& a, const Sphere& b,
                                      std::uint32_t number_a, std::uint32_t number_b) {
  return owns(task.own, number_a < number_b ? midpoint(a, b) : midpoint(b, a));
}

// Only lists of pairs are asked for; others look at the spheres.
template <Pass kPass>
constexpr bool kListsPairs = kPass == Pass::count || kPass == Pass::write;

// `count` contacts of a world, the smallest distance among them.
template <Pass kPass>
__device__ __forceinline__ void keep(const WorldTask& task, std::uint32_t world, std::uint32_t count,
                                     double distance) {
  if (count == 0) return;
  if constexpr (kPass == Pass::any) task.keys.any[world] = 1;
  if constexpr (kPass == Pass::total)
    atomicAdd(&task.keys.totals[world], static_cast<unsigned long long>(count));
  if constexpr (kPass == Pass::distance) task.keys.keep_distance(world, distance);
}
// A contact with the smallest distance of its world names its pair.
__device__ __forceinline__ void keep_pair(const WorldTask& task, std::uint32_t world, double best,
                                          const Sphere& a, const Sphere& b, std::uint32_t number_a,
                                          std::uint32_t number_b) {
  if (signed_distance(a, b) == best) task.keys.keep_pair(world, number_a, number_b);
}

template <Pass kPass>
__device__ __forceinline__ bool ended(const WorldTask& task, std::uint32_t world) {
  return kPass == Pass::any && task.keys.has_any(world);
}
template <Pass kPass>
__device__ __forceinline__ double reach_of(const WorldTask& task, std::uint32_t world) {
  if (kPass != Pass::distance && kPass != Pass::pair) return task.margin;
  const double best = task.keys.nearest(world);
  return kPass == Pass::pair ? best : smaller(task.margin, best);
}

// The warp places those spheres of an element whose gap to a ball is at most `reach`. Returns how many.
__device__ std::uint32_t gather(const WorldScene& scene, const WorldElement& element, const Sphere& mine,
                                const Sphere& other, double reach, PlacedSphere* out, std::uint32_t* slots) {
  const std::uint32_t lane = threadIdx.x & 31;
  if (element.body == kLoose) {
    if (lane == 0) out[0] = {mine.x, mine.y, mine.z, mine.r}, slots[0] = element.piece;
    return 1;
  }
  const Body body = scene.view.placed_body(element.body);
  const std::uint32_t first = scene.view.pieces[element.piece].first,
                      n = scene.view.pieces[element.piece].count;
  std::uint32_t count = 0;
  for (std::uint32_t k = 0; k < n; k += 32) {
    Sphere s;
    bool near = false;
    if (k + lane < n) {
      s = placed(body, scene.view.spheres[first + k + lane]);
      near = near_each_other(s, other, reach);
    }
    const std::uint32_t mask = __ballot_sync(~0u, near);
    if (near) {
      const std::uint32_t at = count + __popc(mask & ((1u << lane) - 1));
      out[at] = {s.x, s.y, s.z, s.r}, slots[at] = first + k + lane;
    }
    count += __popc(mask);
  }
  return count;
}

// The warp tests the spheres of elements a and b of a world. Returns how many it tested.
template <Pass kPass>
__device__ std::uint32_t test_pair(const WorldTask& task, Room& room, std::uint32_t a, std::uint32_t b,
                                   std::uint32_t world, double reach) {
  const WorldScene& scene = task.scene;
  const WorldElement ea = scene.elements[a], eb = scene.elements[b];
  const Sphere ball_a = scene.view.balls[a], ball_b = scene.view.balls[b];
  const std::uint32_t lane = threadIdx.x & 31;
  __syncwarp();  // before the room is used again
  const std::uint32_t na = gather(scene, ea, ball_a, ball_b, reach, room.a, room.slot_a);
  if (na == 0) return kPieceSpheres;
  const std::uint32_t nb = gather(scene, eb, ball_b, ball_a, reach, room.b, room.slot_b);
  __syncwarp();
  std::uint32_t count = 0;
  double mine = INFINITY;
  for (std::uint32_t first = 0; first < na * nb; first += 32) {
    const std::uint32_t p = first + lane, i = p / nb, j = p % nb;
    bool hit = false;
    if (p < na * nb) {
      const Sphere sa{room.a[i].x, room.a[i].y, room.a[i].z, room.a[i].r},
          sb{room.b[j].x, room.b[j].y, room.b[j].z, room.b[j].r};
      hit = touching(sa, sb, task.margin);
      if (hit && (task.bounded || kPass == Pass::pair)) {
        const std::uint32_t number_a = scene.number(ea, room.slot_a[i]),
                            number_b = scene.number(eb, room.slot_b[j]);
        hit = !task.bounded || owned(task, sa, sb, number_a, number_b);
        if (kPass == Pass::pair && hit) keep_pair(task, world, reach, sa, sb, number_a, number_b);
      }
      if (kPass == Pass::distance && hit) mine = smaller(mine, signed_distance(sa, sb));
    }
    const std::uint32_t mask = __ballot_sync(~0u, hit);
    count += __popc(mask);
    if (kPass == Pass::any && mask) break;
  }
  if constexpr (kPass == Pass::distance)
    for (int d = 16; d; d >>= 1) mine = smaller(mine, __shfl_xor_sync(~0u, mine, d));
  if (lane == 0) keep<kPass>(task, world, count, mine);
  return 2 * kPieceSpheres + na * nb;
}

template <Pass kPass>
__device__ void begin(const WorldTask& task, std::uint32_t element, bool used, Lane& lane) {
  const WorldScene& scene = task.scene;
  lane.element = element, lane.world = 0, lane.active = false, lane.found = 0, lane.reach = 0;
  lane.steps = 0;
  lane.from = ~0u, lane.until = 0, lane.ball = {}, lane.box = {};
  if (!used || (kPass == Pass::write && task.counts[element] == 0)) return;
  const WorldElement& me = scene.elements[element];
  lane.world = me.world;
  // A world that no answer is asked for has no place among them; the report names it.
  if (!kListsPairs<kPass> && lane.world >= task.keys.worlds) return;
  if (ended<kPass>(task, lane.world)) return;
  if (!kListsPairs<kPass> && task.keys.answered && task.keys.answered[lane.world]) return;
  const double reach = reach_of<kPass>(task, lane.world);
  if (kPass == Pass::pair && reach == INFINITY) return;  // the world has no contacts
  lane.active = true, lane.from = me.partners, lane.until = me.world_end;
  set_reach(scene, lane, reach);
}

// Two loose spheres are decided by one lane.
template <Pass kPass>
__device__ void test_loose(const WorldTask& task, std::uint32_t a, std::uint32_t b, std::uint32_t world,
                           double reach) {
  const WorldScene& scene = task.scene;
  const Sphere &sa = scene.view.balls[a], &sb = scene.view.balls[b];
  if (!touching(sa, sb, task.margin)) return;
  const std::uint32_t number_a = scene.number(scene.elements[a], scene.elements[a].piece),
                      number_b = scene.number(scene.elements[b], scene.elements[b].piece);
  if (task.bounded && !owned(task, sa, sb, number_a, number_b)) return;
  if constexpr (kPass == Pass::pair)
    keep_pair(task, world, reach, sa, sb, number_a, number_b);
  else
    keep<kPass>(task, world, 1, kPass == Pass::distance ? signed_distance(sa, sb) : 0);
}

// What a lane tests of a run: element k against the element of lane `whose`.
struct Held {
  std::uint32_t k;
  int whose;
  bool hit;
};

// Float did not refuse the pairs that are held: they are decided, or listed.
template <Pass kPass>
__device__ void settle(const WorldTask& task, Room& room, Lane& lane, Held held) {
  const WorldScene& scene = task.scene;
  const std::uint32_t me = threadIdx.x & 31, group = me / 8 * 8;
  const std::uint32_t a = __shfl_sync(~0u, lane.element, held.whose),
                      world = __shfl_sync(~0u, lane.world, held.whose);
  const double reach = __shfl_sync(~0u, lane.reach, held.whose);
  if (held.hit)
    held.hit = near_each_other(scene.view.balls[a], scene.view.balls[held.k], reach) &&
               admitted(scene.elements[a].filter, scene.elements[held.k].filter) &&
               !ended<kPass>(task, world);
  std::uint32_t hits = __ballot_sync(~0u, held.hit);
  if constexpr (kListsPairs<kPass>) {
    const std::uint64_t at = (kPass == Pass::write ? task.offsets[a] : 0) +
                             __shfl_sync(~0u, lane.found, held.whose) +
                             __popc(hits >> group & ((1u << (me - group)) - 1));
    if (kPass == Pass::write && held.hit && at < task.pair_room) task.near_pairs[at] = {a, held.k};
    for (int g = 0; g < 32; g += 8)
      if (__shfl_sync(~0u, held.whose, g) == static_cast<int>(me)) lane.found += __popc(hits >> g & 255);
  } else {
    if (hits == 0) return;
    const bool loose = held.hit && scene.elements[a].body == kLoose && scene.elements[held.k].body == kLoose;
    if (loose) test_loose<kPass>(task, a, held.k, world, reach);
    for (std::uint32_t left = __ballot_sync(~0u, held.hit && !loose); left; left &= left - 1) {
      const int from = __ffs(left) - 1;
      const std::uint32_t in = __shfl_sync(~0u, world, from);
      if (__any_sync(~0u, ended<kPass>(task, in))) continue;
      lane.steps += test_pair<kPass>(task, room, __shfl_sync(~0u, a, from), __shfl_sync(~0u, held.k, from),
                                     in, __shfl_sync(~0u, reach, from)) /
                    32;
    }
    __syncwarp();
    if (kPass == Pass::any) lane.active = lane.active && !ended<kPass>(task, lane.world);
    if (kPass == Pass::distance && lane.active) {
      const double best = reach_of<kPass>(task, lane.world);
      if (best < lane.reach) set_reach(scene, lane, best);
    }
  }
}

// The elements of a run against those of the lanes in `mask`: eight by four at a time.
template <Pass kPass>
__device__ __forceinline__ void test_run(const WorldTask& task, Room& room, Lane& lane,
                                         const TreeWalk::Run& run, std::uint32_t mask) {
  const std::uint32_t me = threadIdx.x & 31, k = run.first + me % 8;
  const float4 other = task.scene.near_balls[min(k, run.end - 1)];
  while (mask) {
    const std::uint32_t second = mask & (mask - 1), third = second & (second - 1),
                        fourth = third & (third - 1),
                        mine = me < 8    ? mask
                               : me < 16 ? second
                               : me < 24 ? third
                                         : fourth;
    mask = fourth & (fourth - 1);
    const int whose = max(__ffs(static_cast<int>(mine)) - 1, 0);
    const float4 ball =
        make_float4(__shfl_sync(~0u, lane.ball.x, whose), __shfl_sync(~0u, lane.ball.y, whose),
                    __shfl_sync(~0u, lane.ball.z, whose), __shfl_sync(~0u, lane.ball.w, whose));
    const std::uint32_t from = __shfl_sync(~0u, lane.from, whose),
                        until = __shfl_sync(~0u, lane.until, whose);
    const bool hit = mine && k < run.end && from <= k && k < until && !apart(ball, other);
    if (__any_sync(~0u, hit)) settle<kPass>(task, room, lane, {k, mine ? whose : 0, hit});
  }
}

// The warp walks over the elements that the ranges of its lanes contain together.
template <Pass kPass>
__device__ void walk(const WorldTask& task, Room& room, Lane& lane) {
  const bool any = lane.active && lane.from < lane.until;
  const std::uint32_t from = any ? lane.from : ~0u, until = any ? lane.until : 0;
  TreeWalk walk{__reduce_min_sync(~0u, from), __reduce_max_sync(~0u, until)};
  std::uint32_t mask = 0;
  const auto meets = [&](const TreeBox& node, std::uint32_t first, std::uint32_t end) {
    mask =
        __ballot_sync(~0u, lane.active && first < lane.until && lane.from < end && overlap(lane.box, node));
    return mask != 0;
  };
  while (true) {
    const TreeWalk::Run run = walk.next(task.scene.tree, meets);
    if (run.first >= run.end) return;
    if (!run.in_node) mask = __ballot_sync(~0u, lane.active && run.first < lane.until && lane.from < run.end);
    test_run<kPass>(task, room, lane, run, mask);
    if constexpr (kPass != Pass::write && kPass != Pass::pair) {
      lane.steps += __popc(mask);
      if (lane.steps > task.allowed.steps_of_warp) {
        task.scene.report->gave_up = 1;
        lane.active = false;
        return;
      }
    }
    if (kPass == Pass::any && !__any_sync(~0u, lane.active)) return;
  }
}

template <Pass kPass>
__global__ void __launch_bounds__(kThreads) search_kernel(const __grid_constant__ WorldTask task) {
  if ((kPass == Pass::write || kPass == Pass::pair) && task.scene.report->gave_up) return;
  __shared__ Room rooms[kListsPairs<kPass> ? 1 : kWarps];
  Room& room = rooms[kListsPairs<kPass> ? 0 : threadIdx.x >> 5];
  const std::uint64_t warp = blockIdx.x * std::uint64_t(kWarps) + (threadIdx.x >> 5);
  const std::uint64_t element = warp * task.lanes + (threadIdx.x & 31);
  const bool used = (threadIdx.x & 31) < task.lanes && element < task.end;
  Lane lane;
  begin<kPass>(task, static_cast<std::uint32_t>(element), used, lane);
  walk<kPass>(task, room, lane);
  // Then kEveryWorld, unless the element is of it.
  lane.active = lane.active && lane.world != kEveryWorld;
  lane.from = task.scene.tree.every_first, lane.until = lane.active ? task.scene.count : 0;
  walk<kPass>(task, room, lane);
  if (kPass == Pass::count && used) task.counts[element] = lane.found;
}

template <Pass kPass>
void search(const WorldTask& task, cudaStream_t stream) {
  if (task.end == 0) return;
  const std::uint64_t elements = std::uint64_t(kWarps) * task.lanes;
  search_kernel<kPass>
      <<<static_cast<unsigned>((task.end + elements - 1) / elements), kThreads, 0, stream>>>(task);
  cuda_launched("search the worlds");
}

// How many pairs there are, and how many of them the narrow phase is to see: none, if they are too many.
__global__ void count_kernel(const unsigned long long* all, WorldAllowance allowed, WorldReport* report,
                             BodyCounters* counters) {
  report->pairs = *all;
  counters->broad.contacts = report->gave_up || *all > allowed.pairs ? 0 : *all;
}

}  // namespace

WorldSearch::WorldSearch(MemoryBook& book, PosedBodies& posed)
    : input_(book, posed),
      narrow_(book),
      near_pairs_(book, "the bodies that meet"),
      hits_(book, "the contacts"),
      counters_(book, "counters"),
      host_counters_(book, "counters", true),
      counts_(book, "the bodies that meet"),
      offsets_(book, "the bodies that meet"),
      scratch_(book, "sums"),
      host_report_(book, "the report", true) {}

WorldTask WorldSearch::task_of(const CallOptions& options, int processors) const {
  // A warp takes fewer elements where there are not enough of them for all processors.
  constexpr std::uint32_t kWarpsOfProcessor = 32;
  WorldTask task;
  task.lanes = std::clamp(input_.scene().count / (static_cast<std::uint32_t>(processors) * kWarpsOfProcessor),
                          1u, 32u);
  task.scene = input_.scene(), task.own = options.own, task.margin = options.margin;
  task.bounded = !(options.own == Region{});
  return task;
}

WorldReport WorldSearch::report(cudaStream_t stream) {
  WorldReport* host = host_report_.reserve(1);
  cuda_check(cudaMemcpyAsync(host, input_.scene().report, sizeof *host, cudaMemcpyDeviceToHost, stream),
             "read the report");
  cuda_check(cudaStreamSynchronize(stream), "search the worlds");
  return *host;
}

// The pairs of elements that are near each other, in an order that follows from that of the tree. Their
// number goes to the counters.
void WorldSearch::find_pairs(WorldTask task, cudaStream_t stream) {
  const std::uint32_t n = task.end;
  task.counts = counts_.reserve(n + std::uint64_t(1));
  task.offsets = offsets_.reserve(n + std::uint64_t(1));
  task.near_pairs = near_pairs_.data(), task.pair_room = near_pairs_.capacity();
  BodyCounters* counters = counters_.reserve(1);
  cuda_check(cudaMemsetAsync(counters, 0, sizeof *counters, stream), "clear the counters");
  cuda_check(cudaMemsetAsync(task.counts + n, 0, sizeof *task.counts, stream), "clear the counters");
  search<Pass::count>(task, stream);
  exclusive_sum(task.counts, task.offsets, n + std::uint64_t(1), scratch_, stream);
  count_kernel<<<1, 1, 0, stream>>>(task.offsets + n, task.allowed, task.scene.report, counters);
  cuda_launched("count the pairs");
  search<Pass::write>(task, stream);
}

// The contacts in these pairs, and the counters to the host.
void WorldSearch::narrow_phase(const Call& call) {
  const WorldScene& scene = input_.scene();
  const Output output = call.list.output(call.options);
  NarrowPhaseTask t{scene.view, scene.loose, call.options.own};
  t.margin = call.options.margin, t.owns_all = call.options.own == Region{};
  t.stable_order = call.options.order == Order::stable;
  t.pairs = near_pairs_.data(), t.pair_room = near_pairs_.capacity(), t.room = output.capacity;
  if (t.stable_order) t.hits = hits_.data(), t.room = std::min(t.room, hits_.capacity());
  t.counters = counters_.data();
  cuda::narrow_phase(t, output, narrow_, call.processors, call.stream, call.clock);
  cuda_check(cudaMemcpyAsync(host_counters_.reserve(1), counters_.data(), sizeof(BodyCounters),
                             cudaMemcpyDeviceToHost, call.stream),
             "read the counters");
}

bool WorldSearch::run(const Call& call, const WorldAllowance& allowed, Contacts& contacts) {
  const cudaStream_t stream = call.stream;
  const bool stable = call.options.order == Order::stable;
  if (!input_.read(call.input, {~0u, allowed.elements_of_world, true, stable}, stream))
    return input_.keep(call.input), false;
  call.clock.mark(StageClock::kPlace);
  WorldTask task = task_of(call.options, call.processors);
  const std::uint32_t n = task.end = task.scene.count;
  task.allowed = allowed;
  contacts.spheres = task.scene.view.loose_first + loose_count(call.input);
  if (n == 0) return true;
  const auto make_room = [&](std::uint64_t count) {
    call.list.reserve(call.options, count);
    if (stable) hits_.reserve(count);
  };
  near_pairs_.reserve(4 * std::uint64_t(n) + 1024), make_room(1024);
  find_pairs(task, stream);
  call.clock.mark(6);
  narrow_phase(call);
  const WorldReport found = report(stream);
  input_.check(found, call.input, call.options, ~0u, stream);
  input_.keep(call.input);
  if (found.gave_up || found.pairs > allowed.pairs) return false;
  task.allowed = {};  // what is counted again counts once
  // What was too small was counted to its end, and is made larger.
  const BodyCounters& counters = *host_counters_.data();
  if (const std::uint64_t pairs = counters.broad.contacts; pairs > near_pairs_.capacity()) {
    near_pairs_.reserve(pairs + pairs / 8);
    find_pairs(task, stream);
    narrow_phase(call);
    cuda_check(cudaStreamSynchronize(stream), "search the worlds");
  }
  const std::uint64_t room = call.list.capacity(call.options);
  if (counters.contacts > (stable ? std::min(room, hits_.capacity()) : room)) {
    make_room(counters.contacts + counters.contacts / 8);
    cuda_check(cudaMemsetAsync(&counters_.data()->contacts, 0,
                               sizeof(BodyCounters) - offsetof(BodyCounters, contacts), stream),
               "clear the counters");
    narrow_phase(call);
    cuda_check(cudaStreamSynchronize(stream), "search the worlds");
  }
  call.clock.mark(8);
  contacts.count = counters.contacts;
  return true;
}

bool WorldSearch::answer(const Call& call, const WorldAllowance& allowed, const AnswerArrays& answers) {
  CallOptions o = call.options;
  o.width = Width::pairs;  // there are no records whose range could be too small
  const std::uint32_t worlds = answers.keys().worlds;
  if (!input_.read(call.input, {worlds, allowed.elements_of_world}, call.stream))
    return input_.keep(call.input), false;
  WorldTask task = task_of(o, call.processors);
  task.end = task.scene.count ? task.scene.tree.every_first : 0;
  task.keys = answers.keys(), task.allowed = allowed;
  if (answers.answer() == Answer::any) search<Pass::any>(task, call.stream);
  if (answers.answer() == Answer::count) search<Pass::total>(task, call.stream);
  if (answers.answer() == Answer::distance)
    search<Pass::distance>(task, call.stream), search<Pass::pair>(task, call.stream);
  const WorldReport found = report(call.stream);
  input_.check(found, call.input, o, worlds, call.stream);
  input_.keep(call.input);
  return !found.gave_up;
}

}  // namespace padder::detect::cuda
