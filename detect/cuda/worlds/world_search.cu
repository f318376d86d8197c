// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/world_search.h"

#include <algorithm>
#include <chrono>
#include <cub/device/device_scan.cuh>

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 128, kWarps = kThreads / 32;

// What a kernel does with the contacts that it finds.
enum class Pass {
  count,     // of each element
  write,     // as records
  any,       // marks their worlds; a world that is marked is not searched on
  total,     // of each world
  distance,  // the smallest signed distance of each world
  pair       // and the first pair with that distance
};

// Numbers as keys: ordered in the same way, for atomicMin().
__device__ __forceinline__ unsigned long long key_of(double v) {
  const auto bits = static_cast<unsigned long long>(__double_as_longlong(v));
  return bits >> 63 ? ~bits : bits | 1ull << 63;
}
__device__ __forceinline__ double number_of(unsigned long long key) {
  return __longlong_as_double(static_cast<long long>(key >> 63 ? key ^ 1ull << 63 : ~key));
}

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
  std::uint32_t element;
  WorldElement me;
  Sphere ball;
  TreeBox box;
  bool active;
  double reach;  // the largest gap of interest
  unsigned long long found;
};

__device__ __forceinline__ bool owned(const WorldTask& task, const Sphere& a, const Sphere& b,
                                      std::uint32_t number_a, std::uint32_t number_b) {
  return owns(task.own, number_a < number_b ? midpoint(a, b) : midpoint(b, a));
}

// One contact, found by this lane.
template <Pass kPass>
__device__ __forceinline__ void take(const WorldTask& task, const Sphere& a, const Sphere& b,
                                     std::uint32_t number_a, std::uint32_t number_b, unsigned long long at,
                                     std::uint32_t world, double best, double& distance) {
  const bool ordered = number_a < number_b;
  if constexpr (kPass == Pass::write) {
    if (at >= task.output.capacity) return;
    task.output.pairs[at] = ordered ? Pair{number_a, number_b} : Pair{number_b, number_a};
    put_geometry(task.output, at, ordered ? a : b, ordered ? b : a);
  }
  if constexpr (kPass == Pass::distance) distance = smaller(distance, signed_distance(a, b));
  if constexpr (kPass == Pass::pair)
    if (signed_distance(a, b) == best)
      atomicMin(&task.pairs[world], static_cast<unsigned long long>(ordered ? number_a : number_b) << 32 |
                                        (ordered ? number_b : number_a));
}

// After contacts of the lane's element: `count` of them, the smallest distance among them.
template <Pass kPass>
__device__ __forceinline__ void keep(const WorldTask& task, Lane& lane, std::uint32_t count,
                                     double distance) {
  lane.found += count;
  if constexpr (kPass == Pass::any)
    if (count) task.any[lane.me.world] = 1, lane.active = false;
  if constexpr (kPass == Pass::distance)
    if (count && (distance < lane.reach || distance >= task.margin)) {
      atomicMin(&task.distances[lane.me.world], key_of(distance));
      lane.reach = smaller(lane.reach, distance);
      lane.box = box_of(lane.ball, lane.reach);
    }
}

template <Pass kPass>
__device__ __forceinline__ bool ended(const WorldTask& task, const Lane& lane) {
  return kPass == Pass::any && *static_cast<const volatile std::uint8_t*>(task.any + lane.me.world) != 0;
}

// May the spheres of element k touch those of the lane's element? Two loose spheres are tested at once; then
// there is nothing left to do.
template <Pass kPass>
__device__ __forceinline__ bool candidate(const WorldTask& task, Lane& lane, std::uint32_t k) {
  const WorldScene& scene = task.scene;
  const Sphere other = scene.balls[k];
  if (!lane.active || !near_each_other(lane.ball, other, lane.reach)) return false;
  const WorldElement& element = scene.elements[k];
  if (!admitted(lane.me.filter, element.filter)) return false;
  if (ended<kPass>(task, lane)) return lane.active = false;
  if (lane.me.body != kLoose || element.body != kLoose) return true;
  if (!touching(lane.ball, other, task.margin)) return false;
  const std::uint32_t mine = scene.loose_first + lane.me.piece, its = scene.loose_first + element.piece;
  if (task.bounded && !owned(task, lane.ball, other, mine, its)) return false;
  double distance = INFINITY;
  take<kPass>(task, lane.ball, other, mine, its, lane.found, lane.me.world, lane.reach, distance);
  keep<kPass>(task, lane, 1, distance);
  return false;
}

// The warp places those spheres of an element whose gap to a ball is at most `reach`. Returns how many.
__device__ std::uint32_t gather(const WorldScene& scene, const WorldElement& element, const Sphere& mine,
                                const Sphere& other, double reach, PlacedSphere* out, std::uint32_t* slots) {
  const std::uint32_t lane = threadIdx.x & 31;
  if (element.body == kLoose) {
    if (lane == 0) out[0] = {mine.x, mine.y, mine.z, mine.r}, slots[0] = element.piece;
    return 1;
  }
  const Body body = scene.body_at(element.body, (element.filter.owner & kStatic) != 0);
  const std::uint32_t first = scene.pieces[element.piece].first, n = scene.pieces[element.piece].count;
  std::uint32_t count = 0;
  for (std::uint32_t k = 0; k < n; k += 32) {
    Sphere s;
    bool near = false;
    if (k + lane < n) {
      s = placed(body, scene.spheres[first + k + lane]);
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

// The warp tests the spheres of elements a and b. Returns the number of contacts; of Pass::any at least 1 if
// there are some. `found`: of element a before.
template <Pass kPass>
__device__ std::uint32_t test_pair(const WorldTask& task, Room& room, std::uint32_t a, std::uint32_t b,
                                   double reach, unsigned long long found, double& distance) {
  const WorldScene& scene = task.scene;
  const WorldElement ea = scene.elements[a], eb = scene.elements[b];
  const Sphere ball_a = scene.balls[a], ball_b = scene.balls[b];
  const std::uint32_t lane = threadIdx.x & 31;
  __syncwarp();  // before the room is used again
  const std::uint32_t na = gather(scene, ea, ball_a, ball_b, reach, room.a, room.slot_a);
  if (na == 0) return 0;
  const std::uint32_t nb = gather(scene, eb, ball_b, ball_a, reach, room.b, room.slot_b);
  __syncwarp();
  std::uint32_t count = 0;
  double mine = INFINITY;
  for (std::uint32_t first = 0; first < na * nb; first += 32) {
    const std::uint32_t p = first + lane, i = p / nb, j = p % nb;
    bool hit = false;
    Sphere sa, sb;
    std::uint32_t number_a = 0, number_b = 0;
    if (p < na * nb) {
      sa = {room.a[i].x, room.a[i].y, room.a[i].z, room.a[i].r};
      sb = {room.b[j].x, room.b[j].y, room.b[j].z, room.b[j].r};
      hit = touching(sa, sb, task.margin);
      if (hit && (task.bounded || kPass == Pass::write || kPass == Pass::pair)) {
        number_a = scene.number(ea, room.slot_a[i]), number_b = scene.number(eb, room.slot_b[j]);
        hit = !task.bounded || owned(task, sa, sb, number_a, number_b);
      }
    }
    const std::uint32_t mask = __ballot_sync(~0u, hit);
    if (hit)
      take<kPass>(task, sa, sb, number_a, number_b, found + count + __popc(mask & ((1u << lane) - 1)),
                  ea.world, reach, mine);
    count += __popc(mask);
    if (kPass == Pass::any && mask) break;
  }
  if constexpr (kPass == Pass::distance) {
    for (int d = 16; d; d >>= 1) mine = smaller(mine, __shfl_xor_sync(~0u, mine, d));
    distance = mine;
  }
  return count;
}

template <Pass kPass>
__device__ void begin(const WorldTask& task, std::uint32_t element, bool used, Lane& lane) {
  const WorldScene& scene = task.scene;
  lane.element = element, lane.active = false, lane.found = 0, lane.reach = task.margin;
  if (!used) return;
  lane.me = scene.elements[element], lane.ball = scene.balls[element];
  if (ended<kPass>(task, lane)) return;
  if constexpr (kPass == Pass::write) {
    lane.found = task.offsets[element];
    if (lane.found == task.offsets[element + 1]) return;  // it has no contacts
  }
  if constexpr (kPass == Pass::distance)
    lane.reach =
        smaller(lane.reach,
                number_of(*static_cast<const volatile unsigned long long*>(task.distances + lane.me.world)));
  if constexpr (kPass == Pass::pair) {
    lane.reach = number_of(task.distances[lane.me.world]);
    if (lane.reach == INFINITY) return;  // the world has no contacts
  }
  lane.box = box_of(lane.ball, lane.reach), lane.active = true;
}

// The warp walks over the elements that its lanes' own ranges [from, until) contain together.
template <Pass kPass>
__device__ void walk(const WorldTask& task, Room& room, Lane& lane, std::uint32_t from, std::uint32_t until) {
  if (!lane.active) from = ~0u, until = 0;
  TreeWalk walk{__reduce_min_sync(~0u, from), __reduce_max_sync(~0u, until)};
  const auto meets = [&](const TreeBox& node, std::uint32_t first, std::uint32_t end) {
    return __any_sync(~0u, lane.active && first < until && from < end && overlap(lane.box, node)) != 0;
  };
  for (std::uint32_t k; (k = walk.next(task.scene.tree, meets)) != kNoElement;) {
    const bool mine = from <= k && k < until && candidate<kPass>(task, lane, k);
    for (std::uint32_t left = __ballot_sync(~0u, mine); left; left &= left - 1) {
      const int whose = __ffs(left) - 1;
      const std::uint32_t a = __shfl_sync(~0u, lane.element, whose);
      const double reach = __shfl_sync(~0u, lane.reach, whose);
      const unsigned long long found = __shfl_sync(~0u, lane.found, whose);
      double distance = INFINITY;
      const std::uint32_t count = test_pair<kPass>(task, room, a, k, reach, found, distance);
      if ((threadIdx.x & 31) == static_cast<unsigned>(whose)) keep<kPass>(task, lane, count, distance);
    }
    if (kPass == Pass::any && !__any_sync(~0u, lane.active)) return;
  }
}

template <Pass kPass>
__global__ void __launch_bounds__(kThreads) search_kernel(const __grid_constant__ WorldTask task) {
  __shared__ Room rooms[kWarps];
  Room& room = rooms[threadIdx.x >> 5];
  const std::uint64_t warp = blockIdx.x * std::uint64_t(kWarps) + (threadIdx.x >> 5);
  const std::uint64_t element = warp * task.lanes + (threadIdx.x & 31);
  const bool used = (threadIdx.x & 31) < task.lanes && element < task.end;
  Lane lane;
  begin<kPass>(task, static_cast<std::uint32_t>(element), used, lane);
  const bool every = lane.active && lane.me.world == kEveryWorld;
  walk<kPass>(task, room, lane, lane.active ? lane.me.partners : 0, lane.active ? lane.me.world_end : 0);
  walk<kPass>(task, room, lane, task.scene.tree.every_first, every ? 0 : task.scene.count);
  if (!used) return;
  if constexpr (kPass == Pass::count) task.counts[element] = lane.found;
  if constexpr (kPass == Pass::total)
    if (lane.found) atomicAdd(&task.totals[lane.me.world], lane.found);
}

template <Pass kPass>
void search(const WorldTask& task, cudaStream_t stream, const char* what) {
  if (task.end == 0) return;
  const std::uint64_t elements = std::uint64_t(kWarps) * task.lanes;
  search_kernel<kPass>
      <<<static_cast<unsigned>((task.end + elements - 1) / elements), kThreads, 0, stream>>>(task);
  cuda_launched(what);
}

__global__ void fill_kernel(unsigned long long* keys, unsigned long long* pairs, std::uint32_t n) {
  for (std::uint32_t k = blockIdx.x * blockDim.x + threadIdx.x; k < n; k += gridDim.x * blockDim.x)
    keys[k] = key_of(INFINITY), pairs[k] = ~0ull;
}
__global__ void finish_kernel(const unsigned long long* keys, const unsigned long long* pairs,
                              std::uint32_t n, double* distance, Pair* pair) {
  for (std::uint32_t k = blockIdx.x * blockDim.x + threadIdx.x; k < n; k += gridDim.x * blockDim.x) {
    distance[k] = number_of(keys[k]);
    pair[k] = {static_cast<std::uint32_t>(pairs[k] >> 32), static_cast<std::uint32_t>(pairs[k])};
  }
}
unsigned blocks_for(std::uint32_t n) { return std::min(n / 256 + 1, 4096u); }

}  // namespace

WorldSearch::WorldSearch(MemoryBook& book)
    : input_(book),
      counts_(book, "counts of contacts"),
      offsets_(book, "counts of contacts"),
      totals_(book, "the answers"),
      keys_(book, "the answers"),
      pair_keys_(book, "the answers"),
      any_(book, "the answers"),
      host_any_(book, "the answers", true),
      count_(book, "the answers"),
      host_count_(book, "the answers", true),
      distance_(book, "the answers"),
      host_distance_(book, "the answers", true),
      pair_(book, "the answers"),
      host_pair_(book, "the answers", true),
      scratch_(book, "counts of contacts"),
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

void WorldSearch::write(WorldTask task, const Call& call) {
  task.output = call.list.output(call.options);
  search<Pass::write>(task, call.stream, "write the contacts");
}

void WorldSearch::run(const Call& call, Contacts& contacts) {
  const cudaStream_t stream = call.stream;
  input_.read(call.input, ~0u, stream);
  call.clock.mark(StageClock::kPlace);
  WorldTask task = task_of(call.options, call.processors);
  const std::uint32_t n = task.end = task.scene.count;
  contacts.spheres = task.scene.loose_first + call.input.spheres.count;
  if (n == 0) return;
  task.counts = counts_.reserve(n + std::uint64_t(1)), task.offsets = offsets_.reserve(n + std::uint64_t(1));
  cuda_check(cudaMemsetAsync(task.counts + n, 0, sizeof *task.counts, stream), "count the contacts");
  search<Pass::count>(task, stream, "count the contacts");
  call.clock.mark(6);
  std::size_t bytes = 0;
  const auto scan = [&](void* room) {
    cuda_check(
        cub::DeviceScan::ExclusiveSum(room, bytes, task.counts, task.offsets, n + std::uint64_t(1), stream),
        "sum the counts of contacts");
  };
  scan(nullptr), scan(scratch_.reserve(bytes));
  cuda_check(cudaMemcpyAsync(&task.scene.report->contacts, task.offsets + n, sizeof *task.offsets,
                             cudaMemcpyDeviceToDevice, stream),
             "count the contacts");
  call.clock.mark(7);
  const std::uint64_t room = call.list.capacity(call.options);
  if (room > 0) write(task, call);  // most often it is enough
  const WorldReport found = report(stream);
  input_.check(found, call.input, call.options, ~0u, stream);
  if (found.contacts > room) {
    call.list.reserve(call.options, found.contacts + found.contacts / 8);
    write(task, call);
    cuda_check(cudaStreamSynchronize(stream), "write the contacts");
  }
  call.clock.mark(8);
  contacts.count = found.contacts;
  input_.keep(call.input);
}

template <class T>
const T* WorldSearch::delivered(const Buffer<T>& from, Buffer<T>& host, std::uint64_t count,
                                const CallOptions& options, cudaStream_t stream) {
  if (options.output == Memory::device) return from.data();
  T* to = host.reserve(count);
  if (count)
    cuda_check(cudaMemcpyAsync(to, from.data(), count * sizeof(T), cudaMemcpyDeviceToHost, stream),
               "copy the answers");
  return to;
}

WorldAnswers WorldSearch::answer(const Input& input, const CallOptions& options, std::uint32_t worlds,
                                 Answer answer, int processors, cudaStream_t stream) {
  const auto begun = std::chrono::steady_clock::now();
  CallOptions o = options;
  o.width = Width::pairs;  // there are no records whose range could be too small
  input_.read(input, worlds, stream);
  WorldTask task = task_of(o, processors);
  task.end = task.scene.count ? task.scene.tree.every_first : 0;
  WorldAnswers answers;
  answers.worlds = worlds, answers.memory = options.output;
  if (answer == Answer::any) {
    task.any = any_.reserve(worlds);
    cuda_check(cudaMemsetAsync(task.any, 0, worlds, stream), "begin the answers");
    search<Pass::any>(task, stream, "search the worlds");
    answers.any = delivered(any_, host_any_, worlds, options, stream);
  } else if (answer == Answer::count) {
    static_assert(sizeof(std::uint64_t) == sizeof(unsigned long long));
    task.totals = reinterpret_cast<unsigned long long*>(count_.reserve(worlds));
    cuda_check(cudaMemsetAsync(task.totals, 0, worlds * sizeof *task.totals, stream), "begin the answers");
    search<Pass::total>(task, stream, "search the worlds");
    answers.count = delivered(count_, host_count_, worlds, options, stream);
  } else {
    task.distances = keys_.reserve(worlds), task.pairs = pair_keys_.reserve(worlds);
    fill_kernel<<<blocks_for(worlds), 256, 0, stream>>>(task.distances, task.pairs, worlds);
    search<Pass::distance>(task, stream, "search the worlds");
    search<Pass::pair>(task, stream, "search the worlds");
    finish_kernel<<<blocks_for(worlds), 256, 0, stream>>>(task.distances, task.pairs, worlds,
                                                          distance_.reserve(worlds), pair_.reserve(worlds));
    cuda_launched("finish the answers");
    answers.distance = delivered(distance_, host_distance_, worlds, options, stream);
    answers.pair = delivered(pair_, host_pair_, worlds, options, stream);
  }
  const WorldReport found = report(stream);
  input_.check(found, input, o, worlds, stream);
  input_.keep(input);
  answers.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return answers;
}

}  // namespace padder::detect::cuda
