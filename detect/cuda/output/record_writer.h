// SPDX-License-Identifier: MIT
// Writes the record of a contact to its output slot. Records of doubles are computed in double from the
// spheres as they were given; float records in float, from the slots where these are the spheres, and else
// from differences that were taken in double. Only .cu files include this.
#pragma once
#include <type_traits>

#include "detect/cuda/device/ptx.h"
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

// Which way a record goes. Pairs alone need no sphere.
enum class RecordKind : std::uint8_t { from_slots, from_given, doubles };
__device__ __host__ __forceinline__ RecordKind record_kind(const OutputTask& task) {
  if (task.output.width == Width::pairs) return RecordKind::from_slots;
  return task.output.scalar == Scalar::f64            ? RecordKind::doubles
         : task.spheres.given || task.spheres.rounded ? RecordKind::from_given
                                                      : RecordKind::from_slots;
}

// Out of line: it is rare, and inlined it would take registers from the common way.
template <SlotKind Kind>
static __device__ __noinline__ void write_double_record(const OutputTask& task, std::uint32_t i,
                                                        std::uint32_t j, std::uint64_t slot) {
  const std::uint32_t id_i = id_at<Kind>(task, i), id_j = id_at<Kind>(task, j);
  const bool swap = id_j < id_i;
  task.output.pairs[slot] = {min(id_i, id_j), max(id_i, id_j)};
  put_geometry(task.output, slot, sphere_at<Kind>(task, swap ? j : i), sphere_at<Kind>(task, swap ? i : j));
}

// Pairs are stored the ordinary way, so that some stay in L2 for a history; what only the caller reads is
// stored to be evicted first.
//
// A float record is written in two steps, load and write, so that a thread can have the loads of several
// records under way. Given: from the spheres as they were given.
template <bool Given>
struct RecordInput {
  std::conditional_t<Given, Sphere, FloatSlot> a, b;
  std::uint32_t id_a, id_b;
};
template <SlotKind Kind, bool Given = false>
__device__ __forceinline__ RecordInput<Given> load_record_input(const OutputTask& task, std::uint32_t i,
                                                                std::uint32_t j) {
  if constexpr (Given) {
    return {given_sphere<Kind>(task, i), given_sphere<Kind>(task, j), id_at<Kind>(task, i),
            id_at<Kind>(task, j)};
  } else {
    const auto* const slots = static_cast<const FloatSlot*>(task.spheres.slots);
    RecordInput<false> t{load_slot(slots + i), load_slot(slots + j), 0, 0};
    t.id_a = Kind == SlotKind::equal ? __float_as_uint(t.a.r) : __ldg(task.spheres.ids + i);
    t.id_b = Kind == SlotKind::equal ? __float_as_uint(t.b.r) : __ldg(task.spheres.ids + j);
    return t;
  }
}

// NormalsOnly: the caller knows that the width is Width::normals. Differences of coordinates are exact or off
// by one rounding; a step of Newton's method corrects the approximate square root.
template <SlotKind Kind, bool NormalsOnly = false>
__device__ __forceinline__ void write_float_record(const OutputTask& task, const RecordInput<false>& t,
                                                   std::uint64_t slot) {
  const Output& out = task.output;
  const FloatSlot &a = t.a, &b = t.b;
  const bool swap = t.id_b < t.id_a;
  *reinterpret_cast<uint2*>(out.pairs + slot) = make_uint2(min(t.id_a, t.id_b), max(t.id_a, t.id_b));
  if (!NormalsOnly && out.width == Width::pairs) return;
  float3 d = difference(a, b);
  float d2 = d.x * d.x + d.y * d.y + d.z * d.z, unit = 1;
  if (d2 < 0x1p-80f) {  // squares may underflow: in units of 2^-100
    unit = 0x1p-100f, d = make_float3(d.x * 0x1p100f, d.y * 0x1p100f, d.z * 0x1p100f);
    d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    if (d2 == 0) d.x = swap ? -1.0f : 1.0f, d2 = 1, unit = 0;
  }
  const float ra = Kind == SlotKind::equal ? task.radius_f32 : a.r,
              rb = Kind == SlotKind::equal ? task.radius_f32 : b.r;
  const float inverse = approximate_rsqrt(d2), s = swap ? -inverse : inverse, root = d2 * inverse;
  const float distance = fmaf(0.5f * inverse, fmaf(-root, root, d2), root);
  const float4 n = make_float4(d.x * s, d.y * s, d.z * s, ra + rb - distance * unit);
  __stcs(static_cast<float4*>(out.normals) + slot, n);
  if (NormalsOnly || out.width == Width::normals) return;
  const FloatSlot i = swap ? b : a, j = swap ? a : b;
  const float ri = swap ? rb : ra, rj = swap ? ra : rb;
  auto* p = static_cast<float2*>(out.points) + 3 * slot;
  __stcs(p, make_float2(fmaf(ri, n.x, i.x), fmaf(ri, n.y, i.y)));
  __stcs(p + 1, make_float2(fmaf(ri, n.z, i.z), fmaf(-rj, n.x, j.x)));
  __stcs(p + 2, make_float2(fmaf(-rj, n.y, j.y), fmaf(-rj, n.z, j.z)));
}
// The penetration s - d is (s^2 - d^2) / (s + d): the difference is taken in double, where it keeps its
// digits, and square root and division need no more than float. So no step takes longer than a few operations
// in double. Where slots are floats, radii and coordinates are in the range of float (float_range), and only
// the distance may be too small for its square; elsewhere double does all of it.
template <SlotKind Kind, bool NormalsOnly = false>
__device__ __forceinline__ void write_float_record(const OutputTask& task, const RecordInput<true>& t,
                                                   std::uint64_t slot) {
  const Output& out = task.output;
  const Sphere &a = t.a, &b = t.b;
  const bool swap = t.id_b < t.id_a;
  *reinterpret_cast<uint2*>(out.pairs + slot) = make_uint2(min(t.id_a, t.id_b), max(t.id_a, t.id_b));
  if (!NormalsOnly && out.width == Width::pairs) return;
  const double x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, sum = a.r + b.r,
               more = fma(-x, x, fma(-y, y, fma(-z, z, sum * sum)));
  float3 d = make_float3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
  float d2 = d.x * d.x + d.y * d.y + d.z * d.z, unit = 1;
  const auto s = static_cast<float>(sum);
  if constexpr (Kind == SlotKind::fixed_point) {
    if (!(d2 > 0x1p-80f && d2 < 0x1p120f && s < 0x1p60f))
      return put_geometry(out, slot, swap ? b : a, swap ? a : b);
  } else if (d2 < 0x1p-80f) {  // in units that make the longest of the three about 1
    const double longest = fmax(fmax(fabs(x), fabs(y)), fabs(z));
    const int exponent = __double2hiint(longest) & 0x7ff00000;
    const double scale = __hiloint2double(0x7fd00000 - exponent, 0);
    unit = static_cast<float>(__hiloint2double(exponent + 0x00100000, 0));
    d = make_float3(static_cast<float>(x * scale), static_cast<float>(y * scale),
                    static_cast<float>(z * scale));
    d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    if (d2 == 0) d.x = swap ? -1.0f : 1.0f, d2 = 1, unit = 0;
  }
  const float inverse = approximate_rsqrt(d2), per_d = swap ? -inverse : inverse, root = d2 * inverse;
  const float distance = fmaf(0.5f * inverse, fmaf(-root, root, d2), root) * unit;
  // Two points in one place, which only a margin lets touch, have neither: 0 / 0 is no depth.
  const float both = fmaxf(s + distance, 0x1p-126f);
  const float4 n =
      make_float4(d.x * per_d, d.y * per_d, d.z * per_d, __fdividef(static_cast<float>(more), both));
  __stcs(static_cast<float4*>(out.normals) + slot, n);
  if (NormalsOnly || out.width == Width::normals) return;
  const Sphere i = swap ? b : a, j = swap ? a : b;
  const auto on = [](double centre, double radius, float normal) {
    return static_cast<float>(fma(radius, static_cast<double>(normal), centre));
  };
  auto* p = static_cast<float2*>(out.points) + 3 * slot;
  __stcs(p, make_float2(on(i.x, i.r, n.x), on(i.y, i.r, n.y)));
  __stcs(p + 1, make_float2(on(i.z, i.r, n.z), on(j.x, -j.r, n.x)));
  __stcs(p + 2, make_float2(on(j.y, -j.r, n.y), on(j.z, -j.r, n.z)));
}

template <SlotKind Kind>
__device__ __forceinline__ void write_record(const OutputTask& task, std::uint32_t i, std::uint32_t j,
                                             std::uint64_t slot) {
  const RecordKind kind = record_kind(task);
  if (kind == RecordKind::doubles)
    write_double_record<Kind>(task, i, j, slot);
  else if (kind == RecordKind::from_given)
    write_float_record<Kind>(task, load_record_input<Kind, true>(task, i, j), slot);
  else
    write_float_record<Kind>(task, load_record_input<Kind, false>(task, i, j), slot);
}

}  // namespace padder::detect::cuda
