// SPDX-License-Identifier: MIT
// The narrow phase: float decides where it is sure, double where it is not; then filter, owner and bin are
// asked. Only .cu files include this.
#pragma once
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/search/search_task.h"

namespace padder::detect::cuda {

// The float test of contact.h in a cheaper form: the sign of one number tells touch from apart unless its
// magnitude is small. With u = 2^-24 float is off by 11.2 u of the squares in all (2.01 for the
// differences, 3.01 for the radii, 2.01 more for the margin, which is rounded and added, one rounding for
// each of four sums). So a pair that touches is always below the wider threshold, and a pair that is below it
// without touching is less than 27.3 u away from it. Pairs less than 32 u away are decided in double.
inline constexpr float kWide = 1 + 0x1p-20f, kNear = 0x1p-19f;

// The same where slots are doubles rounded to float, relative to an origin near the scene. A coordinate is
// then off by e = 2^-24 of the pair's largest one, so a distance by less than 3.47 e, and the square of one
// that is near the sum s of the radii and the margin by less than 7 e s: e / s <= 2^-9. Where spheres are
// that near, no coordinate is larger than m + s, if m is the largest one of either sphere. blur() is 8 *
// 2^-24 (m + s) s, which leaves a seventh for roundings; `sure` stays 1.5 times that away. Each pair has the
// band of its own place: a few spheres that are far from that leave the others as they are. Radii are
// off by 2^-24 of themselves, 2.1 u of the squares on both sides; the bands grow by 4 u and 16 u for that.
inline constexpr float kWideRounded = kWide + 0x1p-22f, kNearRounded = kNear + 0x1p-20f;
__device__ __forceinline__ float blur(const FloatSlot& a, float s) {
  return 0x1p-21f * s * (s + fmaxf(fmaxf(fabsf(a.x), fabsf(a.y)), fabsf(a.z)));
}
// Doubles are rounded so where no |coordinate| is larger than this, in smallest radii (with a margin, of
// grown spheres).
inline constexpr double kMostRounded = 0x1p16;
// By how much rounded spheres grow (Summary::grown_by): two of them by 4 e, more than 3.47 e.
inline double grown_by_rounding(double extent) { return 2 * 0x1p-24 * extent; }

// How near to a face of the region float is not sure on which side a midpoint lies. No |coordinate| is larger
// than `extent`, no radius than `largest`. In float the place of a slot, or a midpoint computed from two
// slots, is off by less than 8 * 2^-24 of these lengths, and by 2^-24 more where slots are doubles rounded to
// float. A face is off by 2^-24 of itself, which is small or, where the face lies far outside, does not
// matter. The halo (detect/boxes/halo.h) is wider than the ball by 2^-46 of them. This is 32 * 2^-24.
inline double owner_band(double extent, double largest, double margin) {
  return 0x1p-19 * (extent + 2 * largest + margin);
}

// Both radii and the margin.
template <SlotKind Kind>
__device__ __forceinline__ float radii_together(const SearchTask& task, const typename SlotOf<Kind>::Type& a,
                                                const typename SlotOf<Kind>::Type& b) {
  return Kind == SlotKind::fixed_point ? a.r + b.r : a.r + b.r + task.margin_f32;
}

// What float says of a candidate: false, the spheres are apart; `sure`, they touch. `rounded`:
// Ordered::rounded; a constant where slots are never rounded.
template <SlotKind Kind>
__device__ __forceinline__ bool float_test(const SearchTask& task, const typename SlotOf<Kind>::Type& a,
                                           const typename SlotOf<Kind>::Type& b, bool rounded, bool& sure) {
  using Slot = typename SlotOf<Kind>::Type;
  const float3 d = difference(a, b);
  float s = task.sum, s2 = task.sum_squared;
  if constexpr (Kind != SlotKind::equal) s = radii_together<Kind>(task, a, b), s2 = s * s;
  float more = 2 * kAbsoluteBand<Slot>;
  if constexpr (Kind != SlotKind::fixed_point)
    if (rounded) more += blur(a, s);
  const float e = fmaf(d.z, d.z, fmaf(d.y, d.y, fmaf(d.x, d.x, fmaf(-task.wide, s2, -more))));
  sure = e < -fmaf(s2, task.near, 2.5f * more);
  return e < 0;
}

// What Precision::float32 says where float is not sure.
template <SlotKind Kind>
__device__ __forceinline__ bool touching_in_float(const SearchTask& task,
                                                  const typename SlotOf<Kind>::Type& a,
                                                  const typename SlotOf<Kind>::Type& b) {
  const float3 d = difference(a, b);
  const float s = Kind == SlotKind::equal ? task.sum : radii_together<Kind>(task, a, b);
  return d.x * d.x + d.y * d.y + d.z * d.z <= s * s;
}

// Adds the doubtful pairs that each lane has found to the counters, by one atomic operation of the lanes that
// are here. In a pile at rest most pairs are doubtful, and an operation for each 32 of them would be what the
// search waits for.
__device__ __forceinline__ void count_doubtful(const SearchTask& task, std::uint32_t found) {
  const std::uint32_t here = __activemask(), sum = __reduce_add_sync(here, found);
  if (sum && (threadIdx.x & 31) == __ffs(here) - 1)
    atomicAdd(&task.counters->doubtful, static_cast<Word>(sum));
}

// Does this search report all contacts of the sphere, wherever its partners lie? The midpoint of a contact
// lies in the halo of both spheres (detect/boxes/halo.h). So it lies in the region if one halo does, and
// nobody has to compute it.
template <SlotKind Kind>
__device__ __forceinline__ bool owns_contacts_of(const SearchTask& task,
                                                 const typename SlotOf<Kind>::Type& s) {
  if constexpr (Kind == SlotKind::fixed_point)
    return task.owns_all;  // the slot does not say where the sphere is
  else
    return task.inner.holds({s.x, s.y, s.z},
                            (Kind == SlotKind::equal ? task.radius_f32 : s.r) + 0.5f * task.margin_f32);
}

// Does the midpoint of a contact lie in the region, by float? `midpoint` of contact.h, whose case of one
// sphere in the other is that of a share below 0 or above 1; spheres at one place have a share of 0. Touch:
// it does; apart: it does not.
template <SlotKind Kind>
__device__ __forceinline__ Verdict owner_by_float(const SearchTask& task,
                                                  const typename SlotOf<Kind>::Type& a,
                                                  const typename SlotOf<Kind>::Type& b) {
  if constexpr (Kind == SlotKind::fixed_point) {
    return Verdict::doubt;  // the slot does not say where the sphere is
  } else {
    const float3 d = difference(a, b);
    float share = 0.5f;
    if constexpr (Kind == SlotKind::unequal) {
      const float per_length = rsqrtf(fmaf(d.x, d.x, fmaf(d.y, d.y, d.z * d.z)));
      share = fminf(fmaxf(fmaf(0.5f * (a.r - b.r), per_length, 0.5f), 0), 1);
    }
    const float at[3] = {fmaf(share, d.x, a.x), fmaf(share, d.y, a.y), fmaf(share, d.z, a.z)};
    return task.inner.holds(at, 0)    ? Verdict::touch
           : !task.outer.holds(at, 0) ? Verdict::apart
                                      : Verdict::doubt;
  }
}

// The same for spheres `i` and `j` of the order, exactly.
template <SlotKind Kind>
__device__ __forceinline__ bool owns_contact(const SearchTask& task, std::uint32_t i,
                                             const typename SlotOf<Kind>::Type& a, std::uint32_t j,
                                             const typename SlotOf<Kind>::Type& b) {
  const Verdict v = owner_by_float<Kind>(task, a, b);
  if (v != Verdict::doubt) return v == Verdict::touch;
  const bool swap = id_at<Kind>(task, j) < id_at<Kind>(task, i);
  return owns(task.own, midpoint(sphere_at<Kind>(task, swap ? j : i), sphere_at<Kind>(task, swap ? i : j)));
}

// Whether spheres `i` and `j` of the order, whose distance float_test() does not exclude, are a contact that
// this search reports. It is called from functions that are out of line, since it is rare, or slow anyway.
// `slot`: of i, at the level of j. `sure`: by float_test(). `doubtful` grows by one where float is not sure.
template <SlotKind Kind>
static __device__ bool is_contact(const SearchTask& task, std::uint32_t i, typename SlotOf<Kind>::Type slot,
                                  std::uint32_t j, bool sure, std::uint32_t& doubtful) {
  const auto other = load_slot(slots_of<Kind>(task) + j);
  const bool repeats = Kind == SlotKind::fixed_point && task.places_repeat;
  if (!sure || repeats) {
    doubtful += !sure;
    if (task.exact || repeats ? !touching(sphere_at<Kind>(task, i), sphere_at<Kind>(task, j), task.margin)
                              : !touching_in_float<Kind>(task, slot, other))
      return false;
  }
  if (!task.test_all) return true;
  const std::uint32_t id_i = id_at<Kind>(task, i), id_j = id_at<Kind>(task, j);
  if (task.source.filtered && !admitted(task.source.filter(id_i), task.source.filter(id_j))) return false;
  return task.owns_all || owns_contact<Kind>(task, i, slot, j, other);
}

// Float first, then is_contact() where float is not enough.
template <SlotKind Kind>
__device__ __forceinline__ bool test(const SearchTask& task, std::uint32_t i,
                                     const typename SlotOf<Kind>::Type& a, std::uint32_t j,
                                     const typename SlotOf<Kind>::Type& b, std::uint32_t& doubtful) {
  bool sure;
  if (!float_test<Kind>(task, a, b, task.spheres.rounded, sure)) return false;
  if (sure && !task.test_all) return true;
  if (sure && task.only_owner) {
    const Verdict owner = owner_by_float<Kind>(task, a, b);
    if (owner != Verdict::doubt) return owner == Verdict::touch;
  }
  return is_contact<Kind>(task, i, a, j, sure, doubtful);
}

}  // namespace padder::detect::cuda
