// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/narrow_phase.h"

#include <algorithm>

#include "detect/cuda/device/ptx.h"
#include "detect/cuda/device/warp.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr std::uint32_t kAll = ~0u;
// Candidates of a warp that wait for the exact test. A step adds up to 64, and is taken while no more wait.
constexpr std::uint32_t kQueue = 128, kStep = 64;

// A pair of elements, as the whole warp needs it.
struct alignas(16) ElementPair {
  Relative to_a;                   // from b's near spheres to those of a
  std::uint32_t piece_a, piece_b;  // in `near`, `groups` and `boxes`
  std::uint32_t count_a, count_b;  // spheres
  std::uint32_t body_a, body_b;    // as in Element
  std::uint32_t slot_a, slot_b;    // of the first spheres, as in Hit
};
struct WarpMemory {
  ElementPair pairs[kBatch];
  std::uint32_t queue[kQueue];  // the number of a pair, and of a sphere of either side: 6 bits each
};

__device__ __forceinline__ std::uint32_t number_of(const BodyView& v, std::uint32_t body,
                                                   std::uint32_t slot) {
  return body == kLoose ? v.loose_first + slot : v.body_first[body] + v.numbers[slot];
}
__device__ __forceinline__ Sphere sphere_of(const BodyView& v, const DeviceSpheres& loose, std::uint32_t body,
                                            std::uint32_t slot) {
  return body == kLoose ? loose.sphere(slot) : placed(v.bodies[body], v.spheres[slot]);
}
__device__ __forceinline__ NearSphere load_near(const NearSphere* from) {
  const float4 s = __ldg(reinterpret_cast<const float4*>(from));
  return {s.x, s.y, s.z, s.w};
}
__device__ __forceinline__ void write_contact(const Output& out, std::uint64_t at, std::uint32_t na,
                                              std::uint32_t nb, const Sphere& a, const Sphere& b) {
  out.pairs[at] = {min(na, nb), max(na, nb)};
  put_geometry(out, at, na < nb ? a : b, na < nb ? b : a);
}

// What a warp does with its batch of pairs. Float tests, which let too many pass, find candidates: first
// groups of spheres, then spheres. Candidates wait in a queue until a full warp can decide them exactly.
template <bool Stable>
struct PairTester {
  const NarrowPhaseTask& task;
  const Output& out;
  WarpMemory& memory;
  std::uint32_t lane;
  std::uint32_t head = 0, tail = 0;    // of the queue
  std::uint32_t batch = 0, found = 0;  // found: contacts of this batch so far

  // Two spheres in double: a contact that is asked for?
  __device__ __forceinline__ bool accepted(const Hit& h, const Sphere& a, const Sphere& b) const {
    if (!touching(a, b)) return false;
    if (task.owns_all) return true;
    const bool ordered = number_of(task.view, h.a_body, h.a_slot) < number_of(task.view, h.b_body, h.b_slot);
    return owns(task.own, ordered ? midpoint(a, b) : midpoint(b, a));
  }

  // Decides up to 32 candidates, in their order.
  __device__ __forceinline__ void decide() {
    __syncwarp();
    const std::uint32_t n = min(tail - head, 32u);
    Hit h{};
    Sphere a, b;
    bool hit = false;
    if (lane < n) {
      const std::uint32_t code = memory.queue[(head + lane) % kQueue];
      const ElementPair& p = memory.pairs[code >> 12];
      const std::uint32_t i = code >> 6 & 63, j = code & 63;
      // Where a piece has no sphere, the float test says no, unless numbers overflow.
      if (i < p.count_a && j < p.count_b) {
        h = {p.body_a, p.slot_a + i, p.body_b, p.slot_b + j};
        a = sphere_of(task.view, task.loose, h.a_body, h.a_slot);
        b = sphere_of(task.view, task.loose, h.b_body, h.b_slot);
        hit = accepted(h, a, b);
      }
    }
    head += n;
    const std::uint32_t hits = __ballot_sync(kAll, hit);
    if (hits == 0) return;
    unsigned long long base = 0;
    if (lane == 0) base = atomicAdd(&task.counters->contacts, static_cast<unsigned long long>(__popc(hits)));
    const std::uint32_t before = __popc(hits & ((1u << lane) - 1));
    const std::uint64_t at = __shfl_sync(kAll, base, 0) + before;
    if (hit && at < task.room) {
      if (Stable) {
        task.hits[at] = make_uint4(h.a_body, h.a_slot, h.b_body, h.b_slot);
        task.ranks[at] = make_uint2(batch, found + before);
      } else {
        write_contact(out, at, number_of(task.view, h.a_body, h.a_slot),
                      number_of(task.view, h.b_body, h.b_slot), a, b);
      }
    }
    found += __popc(hits);
  }

  __device__ __forceinline__ void push(std::uint32_t candidates, std::uint32_t code) {
    const std::uint32_t bit = 1u << lane;
    if (candidates & bit) memory.queue[(tail + __popc(candidates & (bit - 1))) % kQueue] = code;
    tail += __popc(candidates);
  }

  // Which groups overlap: a byte for each group of b, in it a bit for each group of a.
  __device__ __forceinline__ std::uint64_t overlapping_groups(std::uint32_t pair) const {
    const ElementPair& p = memory.pairs[pair];
    const NearSphere* const groups = task.view.groups;
    // Each lane has one group of a, and two of b.
    const std::uint32_t ga = lane % kPieceGroups, gb = lane / kPieceGroups;
    const NearSphere a = load_near(groups + p.piece_a * kPieceGroups + ga);
    const NearSphere b0 = p.to_a(load_near(groups + p.piece_b * kPieceGroups + gb)),
                     b1 = p.to_a(load_near(groups + p.piece_b * kPieceGroups + gb + 4));
    const std::uint32_t groups_b = ga < groups_of(p.count_a) ? groups_of(p.count_b) : 0;
    const std::uint32_t low = __ballot_sync(kAll, gb < groups_b && overlap(a, b0)),
                        high = __ballot_sync(kAll, gb + 4 < groups_b && overlap(a, b1));
    return std::uint64_t(high) << 32 | low;
  }

  // Queues candidates of one group of b and those of a that it overlaps, until the queue is rather full.
  // Returns what is left of `groups`, which are not 0.
  __device__ __forceinline__ std::uint64_t take_group(std::uint32_t pair, std::uint64_t groups) {
    const ElementPair& p = memory.pairs[pair];
    const std::uint32_t shift = (63 - __clzll(static_cast<long long>(groups))) & ~7u,
                        j = shift / 8 * kGroupSpheres + lane / 8;
    std::uint32_t with = static_cast<std::uint32_t>(groups >> shift) & 255;
    groups ^= std::uint64_t(with) << shift;
    // Each lane has one sphere of a, and two of b.
    const NearSphere* const of_a = task.view.padded + p.piece_a * kPieceSpheres + lane % 8;
    const NearSphere* const of_b = task.view.padded + p.piece_b * kPieceSpheres + j;
    const NearSphere b0 = p.to_a(load_near(of_b)), b1 = p.to_a(load_near(of_b + 4));
    const std::uint32_t code = kept_in_register(pair << 12 | (lane % 8) << 6 | j);
    while (with && tail - head <= kQueue - kStep) {
      const std::uint32_t ga = 31 - __clz(static_cast<int>(with));
      with ^= 1u << ga;
      const NearSphere a = load_near(of_a + ga * kGroupSpheres);
      const std::uint32_t first = __ballot_sync(kAll, overlap(a, b0)),
                          second = __ballot_sync(kAll, overlap(a, b1));
      if ((first | second) == 0) continue;
      const std::uint32_t code_a = code | ga * kGroupSpheres << 6;
      push(first, code_a), push(second, code_a + 4);
    }
    return groups | std::uint64_t(with) << shift;
  }

  // The spheres of those pairs of the batch that `pairs` has a bit for.
  __device__ __forceinline__ void test(std::uint32_t pairs) {
    std::uint32_t pair = 0;
    std::uint64_t groups = 0;
    for (bool more = true; more;) {
      while (groups == 0 && pairs) {
        pair = kept_in_register(31 - __clz(static_cast<int>(pairs & (0 - pairs))));
        pairs &= pairs - 1;
        groups = overlapping_groups(pair);
      }
      more = groups != 0;
      if (more) groups = take_group(pair, groups);
      while (tail - head >= (more ? 32 : 1)) decide();
    }
  }
};

// Makes the pair ready for the warp. False if the boxes of the elements are apart, so that nothing touches.
__device__ __forceinline__ bool prepare(const BodyView& v, const Pair& p, ElementPair& out) {
  const Stance a = v.stances[p.i], b = v.stances[p.j];
  const std::uint32_t piece_a = a.body == kLoose ? v.unit_piece : a.piece,
                      piece_b = b.body == kLoose ? v.unit_piece : b.piece;
  const Relative to = relative(a, v.balls[p.i], b, v.balls[p.j]);
  if (boxes_apart(v.boxes[piece_a], v.boxes[piece_b], to)) return false;
  out = {to,
         piece_a,
         piece_b,
         a.count,
         b.count,
         a.body,
         b.body,
         a.body == kLoose ? a.piece : v.pieces[piece_a].first,
         b.body == kLoose ? b.piece : v.pieces[piece_b].first};
  return true;
}

// A warp takes a batch of pairs of elements, and each lane prepares one. Then the whole warp tests the
// spheres of one pair after the other.
template <bool Stable>
__global__ void __launch_bounds__(kThreads, tuning::kNarrowPhaseBlocks)
    find_contacts_kernel(const __grid_constant__ NarrowPhaseTask task, const __grid_constant__ Output out) {
  __shared__ WarpMemory memory[kWarps];
  const std::uint64_t n = task.counters->broad.contacts + task.counters->static_pairs;
  if (task.counters->broad.flags || n > task.pair_room) return;  // the pass is repeated
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  PairTester<Stable> tester{task, out, memory[warp], lane};
  const std::uint32_t size = batch_size(n, gridDim.x * kWarps);
  while (true) {
    // Pairs differ in cost: a warp that is done takes the next batch.
    unsigned long long first = 0;
    if (lane == 0) first = atomicAdd(&task.counters->next, static_cast<unsigned long long>(size));
    first = __shfl_sync(kAll, first, 0);
    if (first >= n) break;
    __syncwarp();  // the previous batch is read no more
    Pair p{~0u, ~0u};
    if (lane < size && first + lane < n) p = task.pairs[first + lane];
    // A list that was laid out for another length has holes, and the pass is repeated: until then what
    // stands in the holes must do no harm.
    const bool valid = p.i < task.view.count && p.j < task.view.count;
    const bool near = valid && prepare(task.view, p, memory[warp].pairs[lane]);
    tester.batch = static_cast<std::uint32_t>(first / size), tester.found = 0;
    __syncwarp();
    tester.test(__ballot_sync(kAll, near));
    if (Stable && lane == 0) task.batch_counts[tester.batch] = tester.found;
  }
}

template <bool SumsUp>
constexpr int kWriterThreads = SumsUp ? 512 : 256;
// Writes the hits to their places in a stable order. SumsUp: each block sums up the counts of all batches
// for itself.
template <bool SumsUp>
__global__ void __launch_bounds__(kWriterThreads<SumsUp>)
    write_hits_kernel(const __grid_constant__ NarrowPhaseTask task, const __grid_constant__ Output out) {
  constexpr int kThreads = kWriterThreads<SumsUp>;
  __shared__ std::uint32_t before[SumsUp ? kMostSummedBatches + 1 : 1], sums[32];
  const std::uint64_t n = task.counters->contacts, first = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x,
                      step = gridDim.x * std::uint64_t(kThreads);
  if (n > task.room || n > out.capacity || first - threadIdx.x >= n) return;  // the list is made longer
  const BodyView& v = task.view;
  uint4 h = make_uint4(0, 0, 0, 0);
  uint2 r = make_uint2(0, 0);
  std::uint32_t na = 0, nb = 0;
  const auto read = [&](std::uint64_t k) {
    if (k >= n) return;
    h = task.hits[k], r = task.ranks[k];
    na = number_of(v, h.x, h.y), nb = number_of(v, h.z, h.w);
  };
  read(first);
  if constexpr (SumsUp) {
    const std::uint64_t pairs = task.counters->broad.contacts + task.counters->static_pairs;
    const std::uint32_t size = batch_size(pairs, task.finder_warps);
    const auto batches = static_cast<std::uint32_t>(
        (min(pairs, static_cast<std::uint64_t>(task.pair_room)) + size - 1) / size);
    for (std::uint32_t b = threadIdx.x; b < batches; b += kThreads) before[b] = task.batch_counts[b];
    scan_shared(before, batches, sums);
  }
  for (std::uint64_t k = first; k < n; k += step, read(k)) {
    const std::uint64_t at = (SumsUp ? before[r.x] : task.batch_offsets[r.x]) + r.y;
    write_contact(out, at, na, nb, sphere_of(v, task.loose, h.x, h.y), sphere_of(v, task.loose, h.z, h.w));
  }
}

}  // namespace

std::uint32_t finder_warps(int processors) {
  return static_cast<std::uint32_t>(processors * tuning::kNarrowPhaseBlocks * kWarps);
}
void find_contacts(const NarrowPhaseTask& task, const Output& output, cudaStream_t stream) {
  const unsigned blocks = task.finder_warps / kWarps;
  if (task.stable_order)
    find_contacts_kernel<true><<<blocks, kThreads, 0, stream>>>(task, output);
  else
    find_contacts_kernel<false><<<blocks, kThreads, 0, stream>>>(task, output);
  cuda_launched("test the spheres of bodies whose balls touch");
}
void write_hits(const NarrowPhaseTask& task, const Output& output, int processors, cudaStream_t stream) {
  if (!task.batch_offsets)
    write_hits_kernel<true>
        <<<processors * tuning::kSumAndWriteBlocks, kWriterThreads<true>, 0, stream>>>(task, output);
  else
    write_hits_kernel<false>
        <<<processors * tuning::kWriteBlocks, kWriterThreads<false>, 0, stream>>>(task, output);
  cuda_launched("write the contacts");
}

}  // namespace padder::detect::cuda
