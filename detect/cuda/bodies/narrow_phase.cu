// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/narrow_phase.h"

#include "detect/boxes/halo.h"
#include "detect/cuda/device/exclusive_sum.h"
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
  std::uint32_t near_a, near_b;    // the first near spheres
  std::uint32_t group_a, group_b;  // the first groups
  std::uint32_t count_a, count_b;  // spheres
  std::uint32_t body_a, body_b;    // as in Element
  std::uint32_t slot_a, slot_b;    // of the first spheres, as in Hit
};
// Spheres of one element that the other element's ball reaches, as near spheres of a.
struct Survivors {
  float4 spheres[kPieceSpheres];
  std::uint8_t numbers[kPieceSpheres];  // in the piece
};
struct WarpMemory {
  ElementPair pairs[kBatch];
  Survivors of_a, of_b;
  std::uint32_t queue[kQueue];  // the number of a pair, and of a sphere of either side: 6 bits each
};

__device__ __forceinline__ std::uint32_t number_of(const BodyView& v, std::uint32_t body,
                                                   std::uint32_t slot) {
  return body == kLoose ? v.loose_first + slot : v.body_first[body] + v.numbers[slot];
}
__device__ __forceinline__ Sphere sphere_of(const BodyView& v, const DeviceSpheres& loose, std::uint32_t body,
                                            std::uint32_t slot) {
  return body == kLoose ? loose.sphere(slot) : placed(v.placed_body(body), v.spheres[slot]);
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
// groups against groups, or spheres against the other element's ball; then spheres against spheres.
// Candidates wait in a queue until a full warp can decide them exactly.
template <bool Stable, bool Grouped>
struct PairTester {
  const NarrowPhaseTask& task;
  const Output& out;
  WarpMemory& memory;
  std::uint32_t lane;
  std::uint32_t head = 0, tail = 0;    // of the queue
  std::uint32_t batch = 0, found = 0;  // found: contacts of this batch so far

  // Two spheres in double: a contact that is asked for?
  __device__ __forceinline__ bool accepted(const Hit& h, const Sphere& a, const Sphere& b) const {
    if (!touching(a, b, task.margin)) return false;
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
      h = {p.body_a, p.slot_a + (code >> 6 & 63), p.body_b, p.slot_b + (code & 63)};
      a = sphere_of(task.view, task.loose, h.a_body, h.a_slot);
      b = sphere_of(task.view, task.loose, h.b_body, h.b_slot);
      hit = accepted(h, a, b);
    }
    head += n;
    const std::uint32_t hits = __ballot_sync(kAll, hit);
    __syncwarp();  // a vote orders no memory: the candidates are read no more, their places are free
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

  // Pairs of single spheres are candidates as they are: each lane has one.
  __device__ __forceinline__ void push_run(std::uint32_t pairs) {
    push(pairs, lane << 12);
    while (tail - head > kQueue - kStep) decide();
  }

  // Those of `count` spheres that overlap the ball. `to_a` makes near spheres of a of them.
  template <class ToA>
  __device__ __forceinline__ std::uint32_t sieve(std::uint32_t near, std::uint32_t count,
                                                 const NearSphere& ball, Survivors& out, ToA to_a) const {
    std::uint32_t n = 0;
    for (std::uint32_t from = 0; from < count; from += 32) {
      const std::uint32_t k = from + lane;
      const NearSphere s = to_a(load_near(task.view.near + near + min(k, count - 1)));
      const bool pass = k < count && overlap(s, ball);
      const std::uint32_t all = __ballot_sync(kAll, pass), at = n + __popc(all & ((1u << lane) - 1));
      if (pass)
        out.spheres[at] = make_float4(s.x, s.y, s.z, s.r), out.numbers[at] = static_cast<std::uint8_t>(k);
      n += __popc(all);
    }
    return n;
  }

  // Each of `many` against each of `few`; the lanes divide the many. `many_by`, `few_by`: where their numbers
  // stand in the code of a candidate.
  __device__ __forceinline__ void test_all(std::uint32_t pair, const Survivors& many, std::uint32_t n_many,
                                           std::uint32_t many_by, const Survivors& few, std::uint32_t n_few,
                                           std::uint32_t few_by) {
    for (std::uint32_t from = 0; from < n_many; from += 32) {
      const std::uint32_t k = min(from + lane, n_many - 1);
      const float4 m = many.spheres[k];
      const std::uint32_t code = pair << 12 | std::uint32_t(many.numbers[k]) << many_by,
                          valid = __ballot_sync(kAll, from + lane < n_many);
      for (std::uint32_t q = 0; q < n_few; q += 2) {
        const bool two = q + 1 < n_few;
        const float4 f = few.spheres[q], g = few.spheres[two ? q + 1 : q];
        const std::uint32_t first = __ballot_sync(kAll, overlap({m.x, m.y, m.z, m.w}, {f.x, f.y, f.z, f.w})) &
                                    valid,
                            second = two ? __ballot_sync(
                                               kAll, overlap({m.x, m.y, m.z, m.w}, {g.x, g.y, g.z, g.w})) &
                                               valid
                                         : 0;
        if ((first | second) == 0) continue;
        push(first, code | std::uint32_t(few.numbers[q]) << few_by);
        if (two) push(second, code | std::uint32_t(few.numbers[q + 1]) << few_by);
        while (tail - head > kQueue - kStep) decide();
      }
    }
  }

  // Which groups overlap: a byte for each group of b, in it a bit for each group of a.
  __device__ __forceinline__ std::uint64_t overlapping_groups(const ElementPair& p) const {
    const NearSphere* const groups = task.view.groups;
    // Each lane has one group of a, and two of b.
    const std::uint32_t ga = lane % kPieceGroups, gb = lane / kPieceGroups;
    const NearSphere a = load_near(groups + p.group_a + ga);
    const NearSphere b0 = p.to_a(load_near(groups + p.group_b + gb)),
                     b1 = p.to_a(load_near(groups + p.group_b + gb + 4));
    const std::uint32_t groups_b = ga < groups_of(p.count_a) ? groups_of(p.count_b) : 0;
    const std::uint32_t low = __ballot_sync(kAll, gb < groups_b && overlap(a, b0)),
                        high = __ballot_sync(kAll, gb + 4 < groups_b && overlap(a, b1));
    return std::uint64_t(high) << 32 | low;
  }
  // The spheres of each group of b against those of the groups of a that it overlaps. Each lane has one
  // sphere of a, and two of b.
  __device__ __forceinline__ void test_groups(std::uint32_t pair) {
    const ElementPair& p = memory.pairs[pair];
    for (std::uint64_t groups = overlapping_groups(p); groups;) {
      const std::uint32_t shift = (63 - __clzll(static_cast<long long>(groups))) & ~7u,
                          i = lane % kGroupSpheres, j = shift / 8 * kGroupSpheres + lane / 8;
      std::uint32_t with = static_cast<std::uint32_t>(groups >> shift) & 255;
      groups ^= std::uint64_t(with) << shift;
      const NearSphere* const near = task.view.near;
      const NearSphere b0 = p.to_a(load_near(near + p.near_b + min(j, p.count_b - 1))),
                       b1 = p.to_a(load_near(near + p.near_b + min(j + 4, p.count_b - 1)));
      const std::uint32_t valid0 = __ballot_sync(kAll, j < p.count_b),
                          valid1 = __ballot_sync(kAll, j + 4 < p.count_b),
                          code = kept_in_register(pair << 12 | i << 6 | j);
      for (; with; with &= with - 1) {
        const std::uint32_t of_a = (__ffs(static_cast<int>(with)) - 1) * kGroupSpheres;
        const NearSphere a = load_near(near + p.near_a + min(of_a + i, p.count_a - 1));
        const bool there = of_a + i < p.count_a;
        const std::uint32_t first = __ballot_sync(kAll, there && overlap(a, b0)) & valid0,
                            second = __ballot_sync(kAll, there && overlap(a, b1)) & valid1;
        if ((first | second) == 0) continue;
        push(first, code + (of_a << 6)), push(second, code + (of_a << 6) + 4);
        while (tail - head > kQueue - kStep) decide();
      }
    }
  }

  // The spheres of a pair of the batch.
  __device__ __forceinline__ void test(std::uint32_t pair) {
    if constexpr (Grouped) return test_groups(pair);
    const ElementPair& p = memory.pairs[pair];
    const Relative& to_a = p.to_a;
    __syncwarp();  // the survivors of the previous pair are read no more
    const std::uint32_t na =
        sieve(p.near_a, p.count_a, {to_a.t[0], to_a.t[1], to_a.t[2], to_a.scale + to_a.margin}, memory.of_a,
              [](const NearSphere& s) { return s; });
    if (na == 0) return;
    const std::uint32_t nb = sieve(p.near_b, p.count_b, {0, 0, 0, 1}, memory.of_b, to_a);
    __syncwarp();
    const bool more_a = na >= nb;
    test_all(pair, more_a ? memory.of_a : memory.of_b, max(na, nb), more_a ? 6 : 0,
             more_a ? memory.of_b : memory.of_a, min(na, nb), more_a ? 0 : 6);
  }
};

// Where the midpoints of contacts can lie whose spheres are in two balls. (Without worlds the balls are
// larger by half of the margin already, and the halo is wider than it need be. The rounding that halo_of adds
// is enough for all spheres in a ball: 60 u of 128.)
__device__ __forceinline__ Bounds halo_of_pair(const Sphere& a, const Sphere& b, double margin) {
  const Bounds of_a = halo_of(a, b.r, margin), of_b = halo_of(b, a.r, margin);
  Bounds both;
  for (int k = 0; k < 3; k++)
    both.low[k] = larger(of_a.low[k], of_b.low[k]), both.high[k] = smaller(of_a.high[k], of_b.high[k]);
  return both;
}

// Makes the pair ready for the warp. False if the boxes of the elements are apart, so that nothing touches,
// or if nothing that touches would be owned.
__device__ __forceinline__ bool prepare(const NarrowPhaseTask& task, Pair p, ElementPair& out) {
  const BodyView& v = task.view;
  if (!task.owns_all && !meets(halo_of_pair(v.balls[p.i], v.balls[p.j], task.margin), task.own)) return false;
  if (v.stances[p.i].body == kLoose && v.stances[p.j].body == kLoose) {  // there is nothing to sieve
    out.count_a = out.count_b = 1, out.body_a = out.body_b = kLoose;
    out.slot_a = v.stances[p.i].piece, out.slot_b = v.stances[p.j].piece;
    return true;
  }
  // In the frame of the larger one, so that a point beside a piece is no exception.
  if (v.stances[p.i].radius < v.stances[p.j].radius) p = {p.j, p.i};
  const Stance a = v.stances[p.i], b = v.stances[p.j];
  const bool loose_a = a.body == kLoose, loose_b = b.body == kLoose;
  const Relative to = relative(a, v.balls[p.i], b, v.balls[p.j], task.margin);
  const std::uint32_t piece_a = loose_a ? v.unit_piece : a.piece, piece_b = loose_b ? v.unit_piece : b.piece;
  if (boxes_apart(v.boxes[piece_a], v.boxes[piece_b], to)) return false;
  const std::uint32_t near_a = loose_a ? v.unit_near : v.pieces[a.piece].first,
                      near_b = loose_b ? v.unit_near : v.pieces[b.piece].first;
  out = {to,      near_a, near_b, piece_a * kPieceGroups,     piece_b * kPieceGroups,    a.count,
         b.count, a.body, b.body, loose_a ? a.piece : near_a, loose_b ? b.piece : near_b};
  return true;
}

// A warp takes a batch of pairs of elements, and each lane prepares one. Then the whole warp tests the
// spheres of one pair after the other.
template <bool Stable, bool Grouped>
__global__ void __launch_bounds__(kThreads, tuning::kNarrowPhaseBlocks)
    find_contacts_kernel(const __grid_constant__ NarrowPhaseTask task, const __grid_constant__ Output out) {
  __shared__ WarpMemory memory[kWarps];
  const std::uint64_t n = task.counters->broad.contacts + task.counters->static_pairs;
  if (task.counters->broad.flags || n > task.pair_room) return;  // the pass is repeated
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  PairTester<Stable, Grouped> tester{task, out, memory[warp], lane};
  const Batches batches(n, gridDim.x * kWarps);
  while (true) {
    // Pairs differ in cost: a warp that is done takes the next batch.
    unsigned long long batch = 0;
    if (lane == 0) batch = atomicAdd(&task.counters->next, 1ull);
    batch = __shfl_sync(kAll, batch, 0);
    const std::uint64_t first = batches.first(batch);
    if (first >= n) break;
    const std::uint32_t size = batches.size(batch);
    __syncwarp();  // the previous batch is read no more
    Pair p{~0u, ~0u};
    if (lane < size && first + lane < n) p = task.pairs[first + lane];
    // A list that was laid out for another length has holes, and the pass is repeated: until then what
    // stands in the holes must do no harm.
    const bool valid = p.i < task.view.count && p.j < task.view.count;
    const bool near = valid && prepare(task, p, memory[warp].pairs[lane]);
    tester.batch = static_cast<std::uint32_t>(batch), tester.found = 0;
    __syncwarp();
    const ElementPair& own = memory[warp].pairs[lane];
    const std::uint32_t singles = __ballot_sync(kAll, near && own.count_a == 1 && own.count_b == 1);
    for (std::uint32_t rest = __ballot_sync(kAll, near); rest;) {
      const std::uint32_t first = rest & (0 - rest), others = rest & ~singles;
      if (first & singles) {
        const std::uint32_t run = rest & ((others & (0 - others)) - 1);
        tester.push_run(run);
        rest ^= run;
      } else {
        tester.test(__ffs(first) - 1);
        rest ^= first;
      }
    }
    while (tester.tail != tester.head) tester.decide();
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
    const auto batches = static_cast<std::uint32_t>(
        Batches(min(pairs, static_cast<std::uint64_t>(task.pair_room)), task.finder_warps).count());
    for (std::uint32_t b = threadIdx.x; b < batches; b += kThreads) before[b] = task.batch_counts[b];
    scan_shared(before, batches, sums);
  }
  for (std::uint64_t k = first; k < n; k += step, read(k)) {
    const std::uint64_t at = (SumsUp ? before[r.x] : task.batch_offsets[r.x]) + r.y;
    write_contact(out, at, na, nb, sphere_of(v, task.loose, h.x, h.y), sphere_of(v, task.loose, h.z, h.w));
  }
}

// In any order it writes the contacts, too; for a stable order it writes hits and ranks.
void find_contacts(const NarrowPhaseTask& task, const Output& output, cudaStream_t stream) {
  const bool grouped = task.view.grouped;
  const auto kernel = task.stable_order
                          ? grouped ? find_contacts_kernel<true, true> : find_contacts_kernel<true, false>
                      : grouped ? find_contacts_kernel<false, true>
                                : find_contacts_kernel<false, false>;
  kernel<<<task.finder_warps / kWarps, kThreads, 0, stream>>>(task, output);
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

}  // namespace

NarrowPhaseMemory::NarrowPhaseMemory(MemoryBook& book)
    : ranks(book, "the order of the list"),
      batch_counts(book, "the order of the list"),
      batch_offsets(book, "the order of the list"),
      scratch(book, "sums") {}

std::uint32_t finder_warps(int processors) {
  return static_cast<std::uint32_t>(processors * tuning::kNarrowPhaseBlocks * kWarps);
}

void narrow_phase(NarrowPhaseTask task, const Output& output, NarrowPhaseMemory& memory, int processors,
                  cudaStream_t stream, StageClock& clock) {
  task.finder_warps = finder_warps(processors);
  if (!task.stable_order) return find_contacts(task, output, stream);
  const std::uint64_t batches = most_batches(task.pair_room, task.finder_warps);
  task.ranks = memory.ranks.reserve(task.room), task.batch_counts = memory.batch_counts.reserve(batches);
  clear_for_initcheck(task.batch_counts, batches, stream);  // all that may come are added up
  find_contacts(task, output, stream);
  if (batches > kMostSummedBatches) {
    unsigned long long* offsets = memory.batch_offsets.reserve(batches);
    task.batch_offsets = offsets;
    exclusive_sum(task.batch_counts, offsets, batches, memory.scratch, stream);
  }
  clock.mark(7);
  write_hits(task, output, processors, stream);
}

}  // namespace padder::detect::cuda
