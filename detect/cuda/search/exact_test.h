// SPDX-License-Identifier: MIT
// What a search does with two spheres: the filter in its cheapest shape, the judgement where that is not
// enough, and the record. Only search.cu and down.h include this.
#pragma once
#include "detect/cuda/order/bins.h"
#include "detect/cuda/search/search.h"
#include "detect/cuda/warp.h"

namespace padder::detect::cuda {
namespace {

constexpr int kWarps = 4, kThreads = 32 * kWarps;
constexpr std::uint32_t kAll = ~0u;

// The same value, which the compiler keeps in a register instead of finding it again each time it is needed.
__device__ __forceinline__ std::uint32_t kept(std::uint32_t v) {
  asm volatile("" : "+r"(v));
  return v;
}
// Shared memory by its address, for the same reason.
__device__ __forceinline__ std::uint32_t shared_address(const void* p) {
  return kept(static_cast<std::uint32_t>(__cvta_generic_to_shared(p)));
}
__device__ __forceinline__ void store_shared(std::uint32_t address, std::uint32_t v) {
  asm volatile("st.shared.u32 [%0], %1;" ::"r"(address), "r"(v) : "memory");
}
__device__ __forceinline__ std::uint32_t load_shared(std::uint32_t address) {
  std::uint32_t v;
  asm volatile("ld.shared.u32 %0, [%1];" : "=r"(v) : "r"(address) : "memory");
  return v;
}

// The filter of contact.h, in a shape that costs less: one sign tells touch from apart unless the magnitude
// is small. With u = 2^-24 float is off by 9.2 u of the squares in all (2.01 for the differences, 3.01 for
// the radii, a rounding for each of four sums): a pair that touches is always below the wider threshold, and
// one that does not, but is below it, is less than 25.2 u away. Those that are less than 32 u away contact()
// judges.
constexpr float kWide = 1 + 0x1p-20f, kNear = 0x1p-19f;

// Work space for a list of fixed order (place.h). Tiles: of spheres, then units that look down.
struct TileSums {
  bool turns = false;                  // few tiles: each waits for those before it
  unsigned long long* turn = nullptr;  // number of the search, then words of place.h
  unsigned int* fills = nullptr;       // blocks that have read `groups`
  // Of each group of tiles: places left spare, hits that spilled; with `eights`, of each eight tiles both in
  // one word (note_net). Null where fill_few_kernel numbers all.
  unsigned long long* groups = nullptr;
  bool eights = false;
  std::uint32_t own_groups = 0, all_groups = 0, share_groups = 0;
  unsigned long long* spill_at = nullptr;  // where a tile's spilled hits lie
  // Contacts of each tile (of flow.h: less its places); first sphere of each unit.
  std::uint32_t *counts = nullptr, *firsts = nullptr;
  unsigned long long* spill = nullptr;  // places of i (or unit and number within it) and j
  std::uint64_t room = 0;
  // Where there are units. Of each its share and the places of those before it in its group, in one word, and
  // of each group its first place in the list, at last that behind all shares. Of each tile the spare places
  // up to it, modulo 2^32, and the tile of each kSpares-th; how many there are in all.
  std::uint32_t *shares = nullptr, *spares = nullptr, *index = nullptr;
  unsigned long long *bases = nullptr, *all_spares = nullptr;
  // Of each group of units the word of places_before (expect.h); zero between searches.
  unsigned long long* share_sums = nullptr;
  std::uint64_t index_room = 0;
};
constexpr std::uint32_t kSpares = 32;
// Of tiles of spheres, which tile of each level is its first, the places that each has to itself, and the
// first place of the first; at last the place behind them all.
struct TileShares {
  int levels = 1;
  std::uint32_t first[kMaxLevels] = {}, share[kMaxLevels] = {};
  unsigned long long place[kMaxLevels + 1] = {};
};
constexpr std::uint32_t kShareBits = 12, kMostShare = (1u << kShareBits) - 1;

struct Task {
  Source source;
  Ordered spheres;
  Output output;
  SearchOptions options;
  Counters* counters;
  TileSums sums;
  TileShares shares;
  unsigned int* next = nullptr;  // units are dealt to warps from here; zero between searches. Null: one each
  std::uint32_t own_tiles = 0, units = 0;  // tiles of spheres; units that look down
  float radius = 0, s2 = 0;                // SlotKind::equal
  std::int32_t code_limit = 0;             // of codes.h
  bool judge_all = false;                  // every hit is asked for its filter, owner or bin
};

template <SlotKind Kind>
struct SlotOf {
  using Type = FloatSlot;
};
template <>
struct SlotOf<SlotKind::fixed_point> {
  using Type = FixedPointSlot;
};

__device__ __forceinline__ FloatSlot load_slot(const FloatSlot* p) {
  const float4 v = __ldg(reinterpret_cast<const float4*>(p));
  return {v.x, v.y, v.z, v.w};
}
__device__ __forceinline__ FixedPointSlot load_slot(const FixedPointSlot* p) {
  const int4 v = __ldg(reinterpret_cast<const int4*>(p));
  return {v.x, v.y, v.z, __int_as_float(v.w)};
}
__device__ __forceinline__ float3 difference(const FloatSlot& a, const FloatSlot& b) {
  return make_float3(b.x - a.x, b.y - a.y, b.z - a.z);
}
__device__ __forceinline__ float3 difference(const FixedPointSlot& a, const FixedPointSlot& b) {
  return make_float3(static_cast<float>(wrapped_difference(a.x, b.x)),
                     static_cast<float>(wrapped_difference(a.y, b.y)),
                     static_cast<float>(wrapped_difference(a.z, b.z)));
}
template <SlotKind Kind>
__device__ __forceinline__ const typename SlotOf<Kind>::Type* slots_of(const Task& task) {
  return static_cast<const typename SlotOf<Kind>::Type*>(task.spheres.slots);
}
template <SlotKind Kind>
__device__ __forceinline__ std::uint32_t id_at(const Task& task, std::uint32_t place) {
  if constexpr (Kind == SlotKind::equal)
    return __float_as_uint(load_slot(slots_of<Kind>(task) + place).r);
  else
    return __ldg(task.spheres.ids + place);
}
template <SlotKind Kind>
__device__ __forceinline__ Sphere sphere_at(const Task& task, std::uint32_t place) {
  if constexpr (Kind == SlotKind::fixed_point) {
    return task.source.sphere(__ldg(task.spheres.ids + place));
  } else {
    const FloatSlot s = load_slot(slots_of<Kind>(task) + place);
    return {s.x, s.y, s.z, Kind == SlotKind::equal ? task.options.radius : double(s.r)};
  }
}

// How the search looks for partners: at one level of bins (few: of so few spheres that latency is all); at
// its own of several levels, while the coarser spheres look down (down.h); or up through levels of which
// some are hashed.
enum class Way { single, few, down, up };

// Where a row of candidates was looked for: level and offset of its bin from the sphere's own, for hashed
// levels.
struct Where {
  int level = 0, dx = 0, dy = 0, dz = 0;
};

// One more pair that float is not sure of, in each lane that is here: lanes of a warp that are here together
// share one atomic operation, since in a lattice that touches exactly every pair is such a one.
__device__ __forceinline__ void note_doubt(const Task& task) {
  const std::uint32_t here = __activemask();
  if ((threadIdx.x & 31) == __ffs(here) - 1)
    atomicAdd(&task.counters->doubtful, static_cast<unsigned long long>(__popc(here)));
}

// What the mask let through and what must be asked more than its distance. Rare, or slow anyway: kept out of
// line.
template <SlotKind Kind, Way W>
__device__ bool contact(const Task& task, const Grid& grid, std::uint32_t place,
                        typename SlotOf<Kind>::Type slot, std::uint32_t j, Where where, bool count_doubt) {
  const auto other = load_slot(slots_of<Kind>(task) + j);
  if constexpr (W == Way::up) {
    const Level& l = grid.level[where.level];
    if (l.hashed) {
      const Bin b = bin_of(l, sphere_at<Kind>(task, place));
      if (!in_row(l, sphere_at<Kind>(task, j), b.x + where.dx, b.x + where.dx, b.y + where.dy,
                  b.z + where.dz))
        return false;
    }
  }
  Measured m;
  if constexpr (Kind == SlotKind::equal) {
    const float3 d = difference(slot, other);
    m = {d.x * d.x + d.y * d.y + d.z * d.z, task.s2};
  } else {
    m = measured(slot, other);
  }
  const Verdict v = verdict<typename SlotOf<Kind>::Type>(m);
  if (v == Verdict::apart) return false;
  if (v == Verdict::doubt) {
    if (count_doubt) note_doubt(task);
    if (task.options.exact ? !touching(sphere_at<Kind>(task, place), sphere_at<Kind>(task, j))
                           : !(m.d2 <= m.s2))
      return false;
  }
  const std::uint32_t ia = id_at<Kind>(task, place), ib = id_at<Kind>(task, j);
  if (task.source.filtered && !admitted(task.source.filter(ia), task.source.filter(ib))) return false;
  if (!task.options.owns_all) {
    const bool swap = ib < ia;
    const Sphere a = sphere_at<Kind>(task, swap ? j : place), b = sphere_at<Kind>(task, swap ? place : j);
    if (!owns(task.options.own, midpoint(a, b))) return false;
  }
  return true;
}
// What float says of a candidate: below zero, it may be a contact; `sure`: it is one, if nothing but its
// distance counts.
template <SlotKind Kind>
__device__ __forceinline__ bool within(const Task& task, const typename SlotOf<Kind>::Type& a,
                                       const typename SlotOf<Kind>::Type& b, bool& sure) {
  using Slot = typename SlotOf<Kind>::Type;
  const float3 d = difference(a, b);
  float s2 = task.s2;
  if constexpr (Kind != SlotKind::equal) s2 = (a.r + b.r) * (a.r + b.r);
  const float e = fmaf(d.z, d.z, fmaf(d.y, d.y, fmaf(d.x, d.x, fmaf(-kWide, s2, -2 * kAbsoluteBand<Slot>))));
  sure = e < -fmaf(s2, kNear, 4 * kAbsoluteBand<Slot>);
  return e < 0;
}
// Whether a candidate is a contact.
template <SlotKind Kind, Way W>
__device__ __forceinline__ bool meets(const Task& task, const Grid& grid, std::uint32_t place,
                                      const typename SlotOf<Kind>::Type& a, std::uint32_t j,
                                      const typename SlotOf<Kind>::Type& b, bool count_doubt) {
  bool sure;
  if (!within<Kind>(task, a, b, sure)) return false;
  return (sure && !task.judge_all) || contact<Kind, W>(task, grid, place, a, j, {}, count_doubt);
}

template <SlotKind Kind>
__device__ __noinline__ void write_wide(const Task& task, std::uint32_t pi, std::uint32_t pj,
                                        std::uint64_t at) {
  const std::uint32_t ia = id_at<Kind>(task, pi), ib = id_at<Kind>(task, pj);
  const bool swap = ib < ia;
  task.output.pairs[at] = {min(ia, ib), max(ia, ib)};
  put_geometry(task.output, at, sphere_at<Kind>(task, swap ? pj : pi), sphere_at<Kind>(task, swap ? pi : pj));
}

// Float records of float input, from the slots: differences are exact or off by one rounding, the square root
// is corrected by a step of Newton's method. In two parts, so that several records can be asked for at a
// time.
struct Both {
  FloatSlot a, b;
  std::uint32_t ia, ib;
};
template <SlotKind Kind>
__device__ __forceinline__ bool is_wide(const Task& task) {
  return Kind == SlotKind::fixed_point ||
         (task.output.scalar == Scalar::f64 && task.output.width != Width::pairs);
}
template <SlotKind Kind>
__device__ __forceinline__ Both load_both(const Task& task, std::uint32_t pi, std::uint32_t pj) {
  const auto* const slots = static_cast<const FloatSlot*>(task.spheres.slots);
  Both t{load_slot(slots + pi), load_slot(slots + pj), 0, 0};
  t.ia = Kind == SlotKind::equal ? __float_as_uint(t.a.r) : __ldg(task.spheres.ids + pi);
  t.ib = Kind == SlotKind::equal ? __float_as_uint(t.b.r) : __ldg(task.spheres.ids + pj);
  return t;
}
// Normals: known to be of that width.
template <SlotKind Kind, bool Normals = false>
__device__ __forceinline__ void write_both(const Task& task, const Both& t, std::uint32_t pi,
                                           std::uint32_t pj, std::uint64_t at) {
  const Output& out = task.output;
  const FloatSlot &a = t.a, &b = t.b;
  const bool swap = t.ib < t.ia;
  __stcs(reinterpret_cast<uint2*>(out.pairs + at), make_uint2(min(t.ia, t.ib), max(t.ia, t.ib)));
  if (!Normals && out.width == Width::pairs) return;
  float3 d = difference(a, b);
  float d2 = d.x * d.x + d.y * d.y + d.z * d.z, unit = 1;
  if (d2 < 0x1p-80f) {  // squares may underflow: in units of 2^-100
    unit = 0x1p-100f, d = make_float3(d.x * 0x1p100f, d.y * 0x1p100f, d.z * 0x1p100f);
    d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    if (d2 == 0) d.x = swap ? -1.0f : 1.0f, d2 = 1, unit = 0;
  }
  const float ra = Kind == SlotKind::equal ? task.radius : a.r,
              rb = Kind == SlotKind::equal ? task.radius : b.r;
  float inverse;
  asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(d2));  // d2 is normal
  const float s = swap ? -inverse : inverse, root = d2 * inverse;
  const float distance = fmaf(0.5f * inverse, fmaf(-root, root, d2), root);
  const float4 n = make_float4(d.x * s, d.y * s, d.z * s, ra + rb - distance * unit);
  __stcs(static_cast<float4*>(out.normals) + at, n);
  if (Normals || out.width == Width::normals) return;
  const FloatSlot i = swap ? b : a, j = swap ? a : b;
  const float ri = swap ? rb : ra, rj = swap ? ra : rb;
  auto* p = static_cast<float2*>(out.points) + 3 * at;
  __stcs(p, make_float2(fmaf(ri, n.x, i.x), fmaf(ri, n.y, i.y)));
  __stcs(p + 1, make_float2(fmaf(ri, n.z, i.z), fmaf(-rj, n.x, j.x)));
  __stcs(p + 2, make_float2(fmaf(-rj, n.y, j.y), fmaf(-rj, n.z, j.z)));
}
template <SlotKind Kind>
__device__ __forceinline__ void write_record(const Task& task, std::uint32_t pi, std::uint32_t pj,
                                             std::uint64_t at) {
  if (is_wide<Kind>(task)) return write_wide<Kind>(task, pi, pj, at);
  if constexpr (Kind != SlotKind::fixed_point)
    write_both<Kind>(task, load_both<Kind>(task, pi, pj), pi, pj, at);
}

// Where a tile's hits go: the first `limit` of them to the list from `place` on, the others to the spill.
// Those of a unit are spilled as kOfUnit, its number and theirs within it, so that they tell whose they are.
constexpr std::uint32_t kOfUnit = 1u << 31, kMostUnits = 1u << 26;
struct Target {
  unsigned long long place, spill;
  std::uint32_t limit, unit, first;  // of a unit: kOfUnit | number << 5, its first sphere
};
__device__ __forceinline__ void spill(const Task& task, const Target& target, std::uint32_t at,
                                      std::uint32_t pi, std::uint32_t pj) {
  const unsigned long long to = target.spill + (at - target.limit);
  const std::uint32_t i = target.unit ? target.unit | (pi - target.first) : pi;
  if (to < task.sums.room) task.sums.spill[to] = static_cast<unsigned long long>(i) << 32 | pj;
}
template <SlotKind Kind>
__device__ __forceinline__ void put(const Task& task, const Target& target, std::uint32_t at,
                                    std::uint32_t pi, std::uint32_t pj) {
  if (at < target.limit)
    write_record<Kind>(task, pi, pj, target.place + at);
  else
    spill(task, target, at, pi, pj);
}

// What a warp found that looks down or up: the place of j, and that of i from the warp's first.
template <Way W>
constexpr std::uint32_t kQueue = W == Way::down ? 320
                                 : W == Way::up ? 192
                                                : 256;
constexpr std::uint32_t kLate = 1u << 31;  // of hits: more than the queue holds; found again to be written
template <Way W>
struct WarpMemory {
  std::uint32_t at[kQueue<W>];
  unsigned char lane[kQueue<W>];
};
// At its own level j comes after i, and seldom 2^27 places after it: one word (level.h).
template <>
struct WarpMemory<Way::single> {
  std::uint32_t at[kQueue<Way::single>];
};
template <>
struct WarpMemory<Way::few> : WarpMemory<Way::single> {};

}  // namespace
}  // namespace padder::detect::cuda
