// SPDX-License-Identifier: MIT
// Writes the record of a contact to its output slot. Float records of float input are computed in float from
// the slots; all others in double from the input. Only .cu files include this.
#pragma once
#include "detect/cuda/device/ptx.h"
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

template <SlotKind Kind>
__device__ __forceinline__ bool needs_double(const OutputTask& task) {
  return Kind == SlotKind::fixed_point ||
         ((task.output.scalar == Scalar::f64 || task.source.wide) && task.output.width != Width::pairs);
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

// A float record is written in two steps, load and write, so that a thread can have the loads of several
// records under way.
struct RecordInput {
  FloatSlot a, b;
  std::uint32_t id_a, id_b;
};
template <SlotKind Kind>
__device__ __forceinline__ RecordInput load_record_input(const OutputTask& task, std::uint32_t i,
                                                         std::uint32_t j) {
  const auto* const slots = static_cast<const FloatSlot*>(task.spheres.slots);
  RecordInput t{load_slot(slots + i), load_slot(slots + j), 0, 0};
  t.id_a = Kind == SlotKind::equal ? __float_as_uint(t.a.r) : __ldg(task.spheres.ids + i);
  t.id_b = Kind == SlotKind::equal ? __float_as_uint(t.b.r) : __ldg(task.spheres.ids + j);
  return t;
}
// NormalsOnly: the caller knows that the width is Width::normals. Differences of coordinates are exact or off
// by one rounding; a step of Newton's method corrects the approximate square root.
template <SlotKind Kind, bool NormalsOnly = false>
__device__ __forceinline__ void write_float_record(const OutputTask& task, const RecordInput& t,
                                                   std::uint64_t slot) {
  const Output& out = task.output;
  const FloatSlot &a = t.a, &b = t.b;
  const bool swap = t.id_b < t.id_a;
  __stcs(reinterpret_cast<uint2*>(out.pairs + slot), make_uint2(min(t.id_a, t.id_b), max(t.id_a, t.id_b)));
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

template <SlotKind Kind>
__device__ __forceinline__ void write_record(const OutputTask& task, std::uint32_t i, std::uint32_t j,
                                             std::uint64_t slot) {
  if (needs_double<Kind>(task)) return write_double_record<Kind>(task, i, j, slot);
  if constexpr (Kind != SlotKind::fixed_point)
    write_float_record<Kind>(task, load_record_input<Kind>(task, i, j), slot);
}

}  // namespace padder::detect::cuda
