// The search: one warp for 32 consecutive spheres of the order, one lane for each. Candidates of a row of bins lie
// side by side; their verdicts are bits of a mask, hits go to a queue of the warp, and records are computed and written
// by full warps. Places in the list are given out by the block: by one atomic addition, or, for a fixed order, by
// decoupled look-back (Merrill and Garland, Single-pass Parallel Prefix Scan with Decoupled Look-back, 2016).
#include <algorithm>

#include "detect/cuda_search.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 8, kThreads = 32 * kWarps, kQueue = 320;
constexpr std::uint32_t kAll = ~0u;

// The filter of contact.h, in a shape that costs one operation less a candidate: the sign of
// d2 - wide * s2 collects in a mask, and the smallest magnitude tells whether any candidate is near the threshold.
// 2^-18 leaves room for the band of 2^-20 and for its own rounding; what it lets through is judged by verdict().
constexpr float kWide = 1 + 0x1p-18f, kNear = 0x1p-17f;

struct Task {
  Source source;
  Ordered spheres;
  Output output;
  SearchOptions options;
  Counters* counters;
  unsigned long long* look_back;
  float radius, s2;  // SlotKind::equal
};

template <SlotKind Kind>
struct SlotOf {
  using Type = FloatSlot;
};
template <>
struct SlotOf<SlotKind::fixed> {
  using Type = FixedSlot;
};

__device__ __forceinline__ FloatSlot load_slot(const FloatSlot* p) {
  const float4 v = __ldg(reinterpret_cast<const float4*>(p));
  return {v.x, v.y, v.z, v.w};
}
__device__ __forceinline__ FixedSlot load_slot(const FixedSlot* p) {
  const int4 v = __ldg(reinterpret_cast<const int4*>(p));
  return {v.x, v.y, v.z, __int_as_float(v.w)};
}
__device__ __forceinline__ float3 difference(const FloatSlot& a, const FloatSlot& b) {
  return make_float3(b.x - a.x, b.y - a.y, b.z - a.z);
}
__device__ __forceinline__ float3 difference(const FixedSlot& a, const FixedSlot& b) {
  return make_float3(static_cast<float>(wrapped_difference(a.x, b.x)), static_cast<float>(wrapped_difference(a.y, b.y)),
                     static_cast<float>(wrapped_difference(a.z, b.z)));
}

struct WarpMemory {
  std::uint32_t at[kQueue];        // place of j
  unsigned char lane[kQueue];      // lane of i
};

template <SlotKind Kind, bool General>
class Searcher {
 public:
  using Slot = typename SlotOf<Kind>::Type;

  __device__ Searcher(const Task& task, const Grid& grid, WarpMemory& memory, std::uint32_t first)
      : task_(task), grid_(grid), memory_(memory), lane_(threadIdx.x & 31), first_(first), place_(first + lane_) {
    valid_ = place_ < task.spheres.count;
    if (!valid_) place_ = task.spheres.count - 1;
    slot_ = load_slot(slots() + place_);
    if constexpr (Kind == SlotKind::equal) {
      wide_ = task.s2 * kWide + 2 * kAbsoluteBand<Slot>, near_ = task.s2 * kNear + 4 * kAbsoluteBand<Slot>;
    }
    if constexpr (General && Kind == SlotKind::unequal) sphere_ = {slot_.x, slot_.y, slot_.z, slot_.r};
    if constexpr (General && Kind == SlotKind::equal) sphere_ = {slot_.x, slot_.y, slot_.z, task.options.radius};
    if constexpr (Kind == SlotKind::fixed) sphere_ = task.source.sphere(task.spheres.ids[place_]);
  }

  // Pass 0 counts hits and queues what fits; pass 1 (when it did not) finds them again and writes them at `base`.
  __device__ void run(bool write, std::uint64_t base) {
    write_ = write, base_ = base, hits_ = 0;
    if constexpr (General)
      search_levels();
    else
      search_level();
  }
  __device__ std::uint32_t hits() const { return hits_; }

  __device__ void write_queue(std::uint64_t base) {
    __syncwarp();
    for (std::uint32_t k = lane_; k < hits_; k += 32) write_record(first_ + memory_.lane[k], memory_.at[k], base + k);
  }

 private:
  __device__ const Slot* slots() const { return static_cast<const Slot*>(task_.spheres.slots); }
  __device__ std::uint32_t start(std::uint32_t key) const { return __ldg(task_.spheres.table + key); }

  // One level of dense bins: the rows lie at fixed distances from the sphere's own key.
  __device__ void search_level() {
    const Level& l = grid_.level[0];
    const std::uint32_t key = __ldg(task_.spheres.keys + place_), row = l.count[0] + 2, plane = row * (l.count[1] + 2);
    const int m = task_.spheres.merge;
    std::uint32_t begin[5], end[5];
#pragma unroll
    for (int q = 0; q < 5; q++) {
      const std::uint32_t at = key + (q == 1 ? row : q == 2 ? plane - row : q == 3 ? plane : q == 4 ? plane + row : 0);
      begin[q] = q == 0 ? place_ + 1 : start((at - 1) >> m);
      end[q] = start(((at + 1) >> m) + 1);
    }
#pragma unroll
    for (int q = 0; q < 5; q++) search_row(begin[q], valid_ ? end[q] : begin[q], slot_, 0, 0, 0, 0);
  }

  __device__ void search_levels() {
    const int own = valid_ ? level_of(grid_, sphere_) : kMaxLevels;
    for (int level = __reduce_min_sync(kAll, own); level < grid_.levels; level++) {
      const Level& l = grid_.level[level];
      const bool active = own <= level, same = own == level;
      const Split sx = split(l, sphere_.x), sy = split(l, sphere_.y), sz = split(l, sphere_.z);
      const Reach rx = reach_of(l, sx, sphere_.r), ry = reach_of(l, sy, sphere_.r), rz = reach_of(l, sz, sphere_.r);
      Slot slot = slot_;
      if constexpr (Kind == SlotKind::fixed)
        slot = {fixed_of(l, sx), fixed_of(l, sy), fixed_of(l, sz), static_cast<float>(mul(sphere_.r, l.units))};
      if constexpr (Kind != SlotKind::equal) near_ = near_of(l, slot.r);
      level_ = level;
      for (int dz = -1; dz <= 1; dz++)
        for (int dy = -1; dy <= 1; dy++) {
          const bool own_row = same && dy == 0 && dz == 0;
          bool wanted = active && dz >= rz.low && dz <= rz.high && dy >= ry.low && dy <= ry.high;
          if (same && (dz < 0 || (dz == 0 && dy < 0))) wanted = false;
          if (!__any_sync(kAll, wanted)) continue;
          const std::int64_t y = sy.bin + dy, z = sz.bin + dz;
          if (!l.hashed) {
            std::int64_t x_low = sx.bin + (own_row ? 0 : rx.low), x_high = sx.bin + rx.high;
            std::uint32_t begin = 0, end = 0;
            if (wanted && cut_row(l, x_low, x_high, y, z)) {
              const std::uint32_t row = row_of(l, y, z);
              begin = own_row ? place_ + 1 : start(key_in_row(l, row, x_low));
              end = start(key_in_row(l, row, x_high) + 1);
            }
            search_row(begin, end, slot, sx.bin, sx.bin, y, z);
          } else {
            for (int dx = -1; dx <= 1; dx++) {
              const bool here = wanted && dx >= rx.low && dx <= rx.high && !(own_row && dx < 0);
              std::uint32_t begin = 0, end = 0;
              if (here) {
                const std::uint32_t key = key_in_row(l, row_of(l, y, z), sx.bin + dx);
                begin = own_row && dx == 0 ? place_ + 1 : start(key), end = start(key + 1);
              }
              search_row(begin, end, slot, sx.bin + dx, sx.bin + dx, y, z);
            }
          }
        }
    }
  }

  __device__ float near_of(const Level& l, float r) const {
    const float most = r + static_cast<float>(Kind == SlotKind::fixed ? l.radius_max * l.units : l.radius_max);
    return most * most * kNear * 1.001f + 4 * kAbsoluteBand<Slot>;
  }

  __device__ __forceinline__ float excess(const Slot& a, const Slot& b) const {
    const float3 d = difference(a, b);
    if constexpr (Kind == SlotKind::equal) {
      return d.x * d.x - wide_ + d.y * d.y + d.z * d.z;
    } else {
      const float s = a.r + b.r;
      return d.x * d.x - (s * s * kWide + 2 * kAbsoluteBand<Slot>) + d.y * d.y + d.z * d.z;
    }
  }

  // Candidates begin to end - 1, other ones in each lane. Verdicts of 32 at a time; candidate k is bit 31 - k.
  __device__ __forceinline__ void search_row(std::uint32_t begin, std::uint32_t end, const Slot& slot, std::int64_t x_low,
                                             std::int64_t x_high, std::int64_t y, std::int64_t z) {
    const std::uint32_t count = end > begin ? end - begin : 0, longest = __reduce_max_sync(kAll, count);
    for (std::uint32_t done = 0; done < longest; done += 32) {
      const std::uint32_t span = (min(longest - done, 32u) + 3) & ~3u;
      const std::uint32_t left = count > done ? count - done : 0;
      const Slot* candidate = slots() + (left ? begin + done : 0);
      std::uint32_t mask = 0;
      float nearest = INFINITY;
      for (std::uint32_t k = 0; k < span; k += 4, candidate += 4) {
        Slot c[4];
#pragma unroll
        for (int u = 0; u < 4; u++) c[u] = load_slot(candidate + u);
#pragma unroll
        for (int u = 0; u < 4; u++) {
          const float e = excess(slot, c[u]);
          mask = __funnelshift_l(__float_as_uint(e), mask, 1);
          nearest = fminf(nearest, fabsf(e));
        }
      }
      mask <<= 32 - span;
      mask &= left >= 32 ? ~0u : ~(~0u >> left);
      bool look = !(nearest > near_) || task_.source.filtered || !task_.options.owns_all;
      if constexpr (General) look = look || grid_.level[level_].hashed;
      if (look && mask) mask = judged(mask, begin + done, slot, x_low, x_high, y, z);
      push(mask, begin + done);
    }
  }

  __device__ __noinline__ std::uint32_t judged(std::uint32_t mask, std::uint32_t from, Slot slot, std::int64_t x_low,
                                               std::int64_t x_high, std::int64_t y, std::int64_t z) {
    for (std::uint32_t rest = mask; rest;) {
      const int k = __clz(rest);
      const std::uint32_t bit = 0x80000000u >> k, j = from + k;
      rest ^= bit;
      if (!contact(slot, j, x_low, x_high, y, z)) mask ^= bit;
    }
    return mask;
  }
  __device__ bool contact(const Slot& slot, std::uint32_t j, std::int64_t x_low, std::int64_t x_high, std::int64_t y,
                          std::int64_t z) {
    const Slot other = load_slot(slots() + j);
    if constexpr (General)
      if (grid_.level[level_].hashed && !in_row(grid_.level[level_], sphere_at(j), x_low, x_high, y, z)) return false;
    Measured m;
    if constexpr (Kind == SlotKind::equal) {
      const float3 d = difference(slot, other);
      m = {d.x * d.x + d.y * d.y + d.z * d.z, task_.s2};
    } else {
      m = measured(slot, other);
    }
    const Verdict v = verdict<Slot>(m);
    if (v == Verdict::apart) return false;
    if (v == Verdict::doubt) {
      atomicAdd(&task_.counters->doubtful, write_ ? 0ull : 1ull);
      if (task_.options.exact ? !touching(sphere_at(place_), sphere_at(j)) : !(m.d2 <= m.s2)) return false;
    }
    if (task_.source.filtered && !admitted(task_.source.filter(id_at(place_)), task_.source.filter(id_at(j)))) return false;
    if (!task_.options.owns_all) {
      const bool swap = id_at(j) < id_at(place_);
      const Sphere a = sphere_at(swap ? j : place_), b = sphere_at(swap ? place_ : j);
      if (!owns(task_.options.own, midpoint(a, b))) return false;
    }
    return true;
  }

  __device__ std::uint32_t id_at(std::uint32_t place) const {
    if constexpr (Kind == SlotKind::equal)
      return __float_as_uint(load_slot(slots() + place).r);
    else
      return task_.spheres.ids[place];
  }
  __device__ Sphere sphere_at(std::uint32_t place) const {
    if constexpr (Kind == SlotKind::fixed) {
      return task_.source.sphere(task_.spheres.ids[place]);
    } else {
      const FloatSlot s = load_slot(slots() + place);
      return {s.x, s.y, s.z, Kind == SlotKind::equal ? task_.options.radius : double(s.r)};
    }
  }

  // Hits to the queue, lane by lane, one of each lane at a time: the same order in every run.
  __device__ __forceinline__ void push(std::uint32_t mask, std::uint32_t from) {
    while (true) {
      const std::uint32_t has = __ballot_sync(kAll, mask != 0);
      if (!has) return;
      if (mask) {
        const int k = __clz(mask);
        mask ^= 0x80000000u >> k;
        const std::uint32_t at = hits_ + __popc(has & ((1u << lane_) - 1));
        if (write_)
          write_record(place_, from + k, base_ + at);
        else if (at < kQueue)
          memory_.at[at] = from + k, memory_.lane[at] = static_cast<unsigned char>(lane_);
      }
      hits_ += __popc(has);
    }
  }

  __device__ __forceinline__ void write_record(std::uint32_t pi, std::uint32_t pj, std::uint64_t at) const {
    const Output& out = task_.output;
    if (Kind == SlotKind::fixed || out.scalar == Scalar::f64) {
      write_wide(pi, pj, at);
      return;
    }
    if constexpr (Kind != SlotKind::fixed) {
      const FloatSlot a = load_slot(slots() + pi), b = load_slot(slots() + pj);
      const std::uint32_t ia = Kind == SlotKind::equal ? __float_as_uint(a.r) : task_.spheres.ids[pi],
                          ib = Kind == SlotKind::equal ? __float_as_uint(b.r) : task_.spheres.ids[pj];
      const bool swap = ib < ia;
      out.pairs[at] = {min(ia, ib), max(ia, ib)};
      if (out.width == Width::pairs) return;
      const float3 d = difference(a, b);
      const float ra = Kind == SlotKind::equal ? task_.radius : a.r, rb = Kind == SlotKind::equal ? task_.radius : b.r;
      const float d2 = d.x * d.x + d.y * d.y + d.z * d.z, inverse = d2 > 0 ? rsqrtf(d2) : 0.f, s = swap ? -inverse : inverse;
      // One step of Newton's method for the square root: a depth without the error of rsqrtf.
      const float root = d2 * inverse, distance = root + 0.5f * inverse * fmaf(-root, root, d2);
      float4 n = make_float4(d.x * s, d.y * s, d.z * s, ra + rb - distance);
      if (d2 < 0x1p-100f) {  // squares underflow, or equal centres
        write_wide(pi, pj, at);
        return;
      }
      static_cast<float4*>(out.normals)[at] = n;
      if (out.width == Width::normals) return;
      const FloatSlot i = swap ? b : a, j = swap ? a : b;
      const float ri = swap ? rb : ra, rj = swap ? ra : rb;
      auto* p = static_cast<float2*>(out.points) + 3 * at;
      p[0] = make_float2(fmaf(ri, n.x, i.x), fmaf(ri, n.y, i.y));
      p[1] = make_float2(fmaf(ri, n.z, i.z), fmaf(-rj, n.x, j.x));
      p[2] = make_float2(fmaf(-rj, n.y, j.y), fmaf(-rj, n.z, j.z));
    }
  }
  __device__ __noinline__ void write_wide(std::uint32_t pi, std::uint32_t pj, std::uint64_t at) const {
    const Output& out = task_.output;
    const std::uint32_t ia = id_at(pi), ib = id_at(pj);
    const bool swap = ib < ia;
    out.pairs[at] = {min(ia, ib), max(ia, ib)};
    if (out.width == Width::pairs) return;
    put_geometry(out, at, sphere_at(swap ? pj : pi), sphere_at(swap ? pi : pj));
  }

  const Task& task_;
  const Grid& grid_;
  WarpMemory& memory_;
  std::uint32_t lane_, first_, place_, hits_ = 0;
  bool valid_, write_ = false;
  int level_ = 0;
  std::uint64_t base_ = 0;
  Slot slot_;
  Sphere sphere_;
  float wide_ = 0, near_ = 0;
};

// Exclusive sum of the blocks before this one. Low two bits of an entry: 1 the block's own sum, 2 with all before it.
__device__ unsigned long long look_back(volatile unsigned long long* entry, std::uint32_t block, std::uint32_t sum) {
  const int lane = threadIdx.x & 31;
  if (block == 0) {
    if (lane == 0) entry[0] = static_cast<unsigned long long>(sum) << 2 | 2;
    return 0;
  }
  if (lane == 0) entry[block] = static_cast<unsigned long long>(sum) << 2 | 1;
  unsigned long long before = 0;
  for (std::int64_t at = static_cast<std::int64_t>(block) - 1 - lane;; at -= 32) {
    unsigned long long v;
    do v = at >= 0 ? entry[at] : 2;
    while (__any_sync(kAll, (v & 3) == 0));
    const std::uint32_t whole = __ballot_sync(kAll, (v & 3) == 2);
    const int last = whole ? __ffs(whole) - 1 : 31;
    unsigned long long add = lane <= last ? v >> 2 : 0;
    for (int d = 16; d; d >>= 1) add += __shfl_xor_sync(kAll, add, d);
    before += add;
    if (whole) break;
  }
  if (lane == 0) entry[block] = (before + sum) << 2 | 2;
  return before;
}

template <SlotKind Kind, bool General>
__global__ void __launch_bounds__(kThreads)
    search_kernel(const __grid_constant__ Task task, const __grid_constant__ Grid grid) {
  __shared__ WarpMemory memory[kWarps];
  __shared__ std::uint32_t sums[kWarps], ticket;
  __shared__ unsigned long long base;
  const int warp = threadIdx.x >> 5;
  std::uint32_t block = blockIdx.x;
  if (task.options.fixed_order) {  // blocks in the order in which they start: those before are running or done
    if (threadIdx.x == 0) ticket = atomicAdd(&task.counters->ticket, 1u);
    __syncthreads();
    block = ticket;
  }
  Searcher<Kind, General> searcher(task, grid, memory[warp], (block * kWarps + warp) * 32);
  searcher.run(false, 0);
  if ((threadIdx.x & 31) == 0) sums[warp] = searcher.hits();
  __syncthreads();
  std::uint32_t sum = 0, before = 0;
  for (int k = 0; k < kWarps; k++) sum += sums[k], before += k < warp ? sums[k] : 0;
  if (task.options.fixed_order) {
    if (warp == 0) {
      const unsigned long long b = look_back(task.look_back, block, sum);
      if (threadIdx.x == 0) base = b;
      if (threadIdx.x == 0 && block + 1 == gridDim.x) task.counters->contacts = b + sum;
    }
  } else if (threadIdx.x == 0) {
    base = sum ? atomicAdd(&task.counters->contacts, static_cast<unsigned long long>(sum)) : 0;
  }
  __syncthreads();
  if (base + sum > task.output.capacity) return;  // counted; the list is made longer and the search repeated
  if (searcher.hits() <= kQueue)
    searcher.write_queue(base + before);
  else
    searcher.run(true, base + before);
}

}  // namespace

std::uint64_t search_blocks(std::uint32_t spheres) { return (std::uint64_t(spheres) + kThreads - 1) / kThreads; }

void search(const Source& source, const Grid& grid, const Ordered& spheres, const SearchOptions& options,
            const Output& output, Counters* counters, unsigned long long* look_back, cudaStream_t stream) {
  Task task{source, spheres, output, options, counters, look_back, 0, 0};
  task.radius = static_cast<float>(options.radius);
  task.s2 = (task.radius + task.radius) * (task.radius + task.radius);
  const auto blocks = static_cast<unsigned>(search_blocks(spheres.count));
  cuda_check(cudaMemsetAsync(counters, 0, sizeof(Counters), stream), "clear the counters");
  if (options.fixed_order)
    cuda_check(cudaMemsetAsync(look_back, 0, blocks * sizeof(unsigned long long), stream), "clear the counters");
  const bool general = grid.levels > 1 || grid.level[0].hashed;
  auto* const kernel = spheres.kind == SlotKind::equal ? (general ? search_kernel<SlotKind::equal, true> : search_kernel<SlotKind::equal, false>)
                       : spheres.kind == SlotKind::unequal
                           ? (general ? search_kernel<SlotKind::unequal, true> : search_kernel<SlotKind::unequal, false>)
                           : (general ? search_kernel<SlotKind::fixed, true> : search_kernel<SlotKind::fixed, false>);
  kernel<<<blocks, kThreads, 0, stream>>>(task, grid);
  cuda_launched("search for contacts");
}

}  // namespace padder::detect::cuda
