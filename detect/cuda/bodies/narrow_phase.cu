// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/narrow_phase.h"

#include "detect/cuda/device/warp.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr std::uint32_t kStagedHits = 96;  // of a warp in shared memory, before it asks for room in the list
constexpr std::uint32_t kAll = ~0u;

// The spheres of one element that the other element's ball reaches, placed.
struct Side {
  double x[kPieceSpheres], y[kPieceSpheres], z[kPieceSpheres], r[kPieceSpheres];
  std::uint32_t slot[kPieceSpheres];
  __device__ __forceinline__ Sphere operator[](std::uint32_t k) const { return {x[k], y[k], z[k], r[k]}; }
  __device__ __forceinline__ void set(std::uint32_t k, const Sphere& s) {
    x[k] = s.x, y[k] = s.y, z[k] = s.z, r[k] = s.r;
  }
};
struct WarpMemory {
  Side side[2];
  uint4 hits[kStagedHits];
  uint2 ranks[kStagedHits];
};

__device__ __forceinline__ std::uint32_t number_of(const BodyView& v, std::uint32_t body,
                                                   std::uint32_t slot) {
  return body == kLoose ? v.loose_first + slot : v.body_first[body] + v.numbers[slot];
}

struct PairTester {
  const NarrowPhaseTask& task;
  WarpMemory& memory;
  std::uint32_t lane, staged = 0, batch = 0, found = 0;  // found: hits of this batch so far

  __device__ __forceinline__ bool owned(const Element& a, std::uint32_t slot_a, const Sphere& sa,
                                        const Element& b, std::uint32_t slot_b, const Sphere& sb) const {
    if (task.owns_all) return true;
    const bool ordered = number_of(task.view, a.body, slot_a) < number_of(task.view, b.body, slot_b);
    return owns(task.own, ordered ? midpoint(sa, sb) : midpoint(sb, sa));
  }

  __device__ __forceinline__ void flush() {
    __syncwarp();
    unsigned long long base = 0;
    if (lane == 0) base = atomicAdd(&task.counters->contacts, static_cast<unsigned long long>(staged));
    base = __shfl_sync(kAll, base, 0);
    for (std::uint32_t k = lane; k < staged; k += 32)
      if (base + k < task.room) {
        task.hits[base + k] = memory.hits[k];
        if (task.stable_order) task.ranks[base + k] = memory.ranks[k];
      }
    staged = 0;
    __syncwarp();
  }
  // Stages the hits of all lanes, in the order of lanes.
  __device__ __forceinline__ void push(bool hit, const uint4& h) {
    const std::uint32_t hits = __ballot_sync(kAll, hit), before = __popc(hits & ((1u << lane) - 1));
    if (staged + __popc(hits) > kStagedHits) flush();
    if (hit)
      memory.hits[staged + before] = h, memory.ranks[staged + before] = make_uint2(batch, found + before);
    staged += __popc(hits), found += __popc(hits);
  }

  // Those spheres of an element that pass the sieve, placed, to `side`. Returns how many.
  __device__ __forceinline__ std::uint32_t gather(const Element& e, const Sieve& sieve, Side& side) {
    const BodyView& v = task.view;
    if (e.body == kLoose) {
      if (lane == 0) side.slot[0] = e.piece, side.set(0, task.loose.sphere(e.piece));
      return 1;
    }
    const Piece& piece = v.pieces[e.piece];
    const std::uint32_t first = piece.first, count = piece.count;
    std::uint32_t n = 0;
    for (std::uint32_t from = 0; from < count; from += 32) {
      const std::uint32_t k = from + lane;
      bool pass = false;
      if (k < count) {
        const float4 s = __ldg(v.near + first + k);
        pass = passes(sieve, {s.x, s.y, s.z, s.w});
      }
      const std::uint32_t some = __ballot_sync(kAll, pass);
      if (pass) side.slot[n + __popc(some & ((1u << lane) - 1))] = first + k;
      n += __popc(some);
    }
    __syncwarp();
    if (n == 0) return 0;
    const Body& body = v.bodies[e.body];
    for (std::uint32_t k = lane; k < n; k += 32) side.set(k, placed(body, v.spheres[side.slot[k]]));
    return n;
  }

  // Contacts of the elements a and b.
  __device__ __forceinline__ void test(const Element& a, const Element& b, const Sieve& sieve_a,
                                       const Sieve& sieve_b) {
    Side &sa = memory.side[0], &sb = memory.side[1];
    __syncwarp();  // the sides are read no more
    const std::uint32_t na = gather(a, sieve_a, sa);
    if (na == 0) return;
    const std::uint32_t nb = gather(b, sieve_b, sb);
    __syncwarp();
    const float per_nb = 1.f / static_cast<float>(nb);
    const std::uint32_t total = na * nb;
    for (std::uint32_t from = 0; from < total; from += 32) {
      const std::uint32_t t = from + lane;
      const auto i = static_cast<std::uint32_t>((static_cast<float>(t) + 0.5f) * per_nb);
      const std::uint32_t j = t - i * nb;
      bool hit = false;
      if (t < total) {
        const Sphere p = sa[i], q = sb[j];
        hit = touching(p, q) && owned(a, sa.slot[i], p, b, sb.slot[j], q);
      }
      if (!__any_sync(kAll, hit)) continue;
      push(hit, hit ? make_uint4(a.body, sa.slot[i], b.body, sb.slot[j]) : make_uint4(0, 0, 0, 0));
    }
  }
};

__device__ __forceinline__ float take(float v, int lane) { return __shfl_sync(kAll, v, lane); }
__device__ __forceinline__ Sieve take(const Sieve& s, int lane) {
  return {take(s.x, lane), take(s.y, lane), take(s.z, lane), take(s.radius, lane)};
}
__device__ __forceinline__ Element take(const Element& e, int lane) {
  return {__shfl_sync(kAll, e.body, lane), __shfl_sync(kAll, e.piece, lane)};
}

// A warp takes `kBatch` pairs of elements, one a lane. Two loose spheres are decided at once. For the other
// pairs the lane makes both sieves; then the whole warp tests the spheres of one pair after the other.
__global__ void __launch_bounds__(kThreads, 4)
    find_hits_kernel(const __grid_constant__ NarrowPhaseTask task) {
  __shared__ WarpMemory memory[kWarps];
  const std::uint64_t n = task.counters->broad.contacts + task.counters->static_pairs;
  if (task.counters->broad.flags || n > task.pair_room) return;  // the pass is repeated
  const std::uint32_t lane = threadIdx.x & 31, warp = threadIdx.x >> 5;
  PairTester tester{task, memory[warp], lane};
  const BodyView& v = task.view;
  while (true) {
    // Pairs differ in cost: a warp that is done takes the next batch.
    unsigned long long first = 0;
    if (lane == 0) first = atomicAdd(&task.counters->next, static_cast<unsigned long long>(kBatch));
    first = __shfl_sync(kAll, first, 0);
    if (first >= n) break;
    const std::uint64_t item = first + lane;
    Pair p{~0u, ~0u};
    if (lane < kBatch && item < n) p = task.pairs[item];
    // A list that was laid out for another length has holes, and the pass is repeated: until then what
    // stands in the holes must do no harm.
    const bool valid = p.i < v.count && p.j < v.count;
    Element a, b;
    Sieve sieve_a, sieve_b;
    bool whole = false, hit = false;
    if (valid) {
      a = v.elements[p.i], b = v.elements[p.j];
      if (a.body == kLoose && b.body == kLoose) {
        const Sphere sa = task.loose.sphere(a.piece), sb = task.loose.sphere(b.piece);
        hit = touching(sa, sb) && tester.owned(a, a.piece, sa, b, b.piece, sb);
      } else {
        const Sphere ball_a = v.balls[p.i], ball_b = v.balls[p.j];
        whole = true;
        if (a.body != kLoose) sieve_a = sieve_of(v.bodies[a.body], v.pieces[a.piece], ball_a, ball_b);
        if (b.body != kLoose) sieve_b = sieve_of(v.bodies[b.body], v.pieces[b.piece], ball_b, ball_a);
      }
    }
    tester.batch = static_cast<std::uint32_t>(first / kBatch), tester.found = 0;
    if (__any_sync(kAll, hit)) tester.push(hit, make_uint4(kLoose, a.piece, kLoose, b.piece));
    for (std::uint32_t rest = __ballot_sync(kAll, whole); rest; rest &= rest - 1) {
      const int k = __ffs(rest) - 1;
      tester.test(take(a, k), take(b, k), take(sieve_a, k), take(sieve_b, k));
    }
    if (task.stable_order && lane == 0) task.batch_counts[tester.batch] = tester.found;
  }
  if (tester.staged) tester.flush();
}

template <bool SumsUp>
constexpr int kWriterThreads = SumsUp ? 512 : 256;
// SumsUp: each block sums up the counts of all batches for itself.
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
    h = task.hits[k];
    if (task.stable_order) r = task.ranks[k];
    na = number_of(v, h.x, h.y), nb = number_of(v, h.z, h.w);
  };
  read(first);
  if constexpr (SumsUp) {
    const std::uint64_t pairs = task.counters->broad.contacts + task.counters->static_pairs;
    const auto batches = static_cast<std::uint32_t>(
        (min(pairs, static_cast<std::uint64_t>(task.pair_room)) + kBatch - 1) / kBatch);
    for (std::uint32_t b = threadIdx.x; b < batches; b += kThreads) before[b] = task.batch_counts[b];
    scan_shared(before, batches, sums);
  }
  for (std::uint64_t k = first; k < n; k += step, read(k)) {
    const std::uint64_t at = SumsUp              ? before[r.x] + r.y
                             : task.stable_order ? task.batch_offsets[r.x] + r.y
                                                 : k;
    out.pairs[at] = {min(na, nb), max(na, nb)};
    if (out.width == Width::pairs) continue;
    const Sphere a = h.x == kLoose ? task.loose.sphere(h.y) : placed(v.bodies[h.x], v.spheres[h.y]);
    const Sphere b = h.z == kLoose ? task.loose.sphere(h.w) : placed(v.bodies[h.z], v.spheres[h.w]);
    put_geometry(out, at, na < nb ? a : b, na < nb ? b : a);
  }
}

// A warp for each moving element; a lane takes one row of bins at a time. With `Write` each lane goes over
// its row twice, once to count, so that the pairs come in the order of rows.
template <bool Write>
__global__ void __launch_bounds__(kThreads)
    static_pairs_kernel(const __grid_constant__ StaticPairTask task, const __grid_constant__ Grid grid) {
  const BodyView& v = task.view;
  const StaticView& t = task.table;
  const std::uint32_t lane = threadIdx.x & 31;
  for (std::uint32_t e = blockIdx.x * kWarps + (threadIdx.x >> 5); e < v.moving; e += gridDim.x * kWarps) {
    const Sphere ball = v.balls[e];
    const Filter mine{v.family[e], v.mask[e], v.owner[e]};
    unsigned long long found = 0, base = 0;
    if (Write) {
      if (task.counts[e] == 0 && e + 1 < v.moving) continue;
      base = task.counters->broad.contacts + task.offsets[e];
    }
    for (int level = 0; level < grid.levels; level++) {
      const Level& l = grid.level[level];
      const std::uint32_t begin = t.starts[l.offset], population = t.starts[l.offset + l.buckets] - begin;
      BinBox box;
      if (population == 0 || !bins_near(l, t.bounds[level], ball, population, box)) continue;
      const std::uint64_t nx = l.hashed ? box.high[0] - box.low[0] + 1 : 1, ny = box.high[1] - box.low[1] + 1,
                          rows = box.whole ? population : nx * ny * (box.high[2] - box.low[2] + 1);
      for (std::uint64_t from = 0; from < rows; from += 32) {
        const std::uint64_t row = from + lane;
        std::uint32_t first = 0, end = 0;
        std::int64_t x = 0, y = 0, z = 0;
        if (row < rows && box.whole) {
          first = begin + static_cast<std::uint32_t>(row), end = first + 1;
        } else if (row < rows) {
          x = box.low[0] + row % nx, y = box.low[1] + row / nx % ny, z = box.low[2] + row / nx / ny;
          const std::uint32_t key = row_of(l, y, z);
          first = t.starts[key_in_row(l, key, x)];
          end = t.starts[key_in_row(l, key, l.hashed ? x : box.high[0]) + 1];
        }
        const auto touches = [&](std::uint32_t k) {
          const Sphere s = t.balls[k];
          if (!touching(ball, s) || (l.hashed && !box.whole && !in_row(l, s, x, x, y, z))) return false;
          const std::uint32_t other = t.elements[k];
          return admitted(mine, {v.family[other], v.mask[other], v.owner[other]});
        };
        std::uint32_t count = 0;
        for (std::uint32_t k = first; k < end; k++) count += touches(k);
        if (Write && __any_sync(kAll, count != 0)) {
          std::uint32_t upto = count;
#pragma unroll
          for (int d = 1; d < 32; d <<= 1) {
            const std::uint32_t u = __shfl_up_sync(kAll, upto, d);
            if (static_cast<int>(lane) >= d) upto += u;
          }
          unsigned long long at = base + found + upto - count;
          for (std::uint32_t k = first; count && k < end; k++)
            if (touches(k)) {
              if (at < task.pair_room) task.pairs[at] = {e, t.elements[k]};
              at++;
            }
        }
        found += __reduce_add_sync(kAll, count);
      }
    }
    if (lane == 0 && !Write) task.counts[e] = static_cast<std::uint32_t>(found);
    if (lane == 0 && Write && e + 1 == v.moving) task.counters->static_pairs = task.offsets[e] + found;
  }
}

unsigned blocks_for(std::uint64_t units, unsigned each, int processors) {
  return static_cast<unsigned>(std::min<std::uint64_t>((units + each - 1) / each + 1, processors * 16ull));
}

}  // namespace

void find_hits(const NarrowPhaseTask& task, int processors, cudaStream_t stream) {
  find_hits_kernel<<<processors * tuning::kNarrowPhaseBlocks, kThreads, 0, stream>>>(task);
  cuda_launched("test the spheres of bodies whose balls touch");
}
void write_hits(const NarrowPhaseTask& task, const Output& output, int processors, cudaStream_t stream) {
  const bool sums = task.stable_order && !task.batch_offsets;
  if (sums)
    write_hits_kernel<true>
        <<<processors * tuning::kSumAndWriteBlocks, kWriterThreads<true>, 0, stream>>>(task, output);
  else
    write_hits_kernel<false>
        <<<processors * tuning::kWriteBlocks, kWriterThreads<false>, 0, stream>>>(task, output);
  cuda_launched("write the contacts");
}
void count_static_pairs(const StaticPairTask& task, const Grid& grid, int processors, cudaStream_t stream) {
  static_pairs_kernel<false>
      <<<blocks_for(task.view.moving, kWarps, processors), kThreads, 0, stream>>>(task, grid);
  cuda_launched("search among what is static");
}
void write_static_pairs(const StaticPairTask& task, const Grid& grid, int processors, cudaStream_t stream) {
  static_pairs_kernel<true>
      <<<blocks_for(task.view.moving, kWarps, processors), kThreads, 0, stream>>>(task, grid);
  cuda_launched("search among what is static");
}

}  // namespace padder::detect::cuda
