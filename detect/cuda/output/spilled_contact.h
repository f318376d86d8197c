// SPDX-License-Identifier: MIT
// A contact of the side list, on its way to the output slot that a compaction gives it. Only .cu files
// include this.
#pragma once
#include "detect/cuda/output/output_slots.h"

namespace padder::detect::cuda {

// Double: its record does not come from the slots (record_kind), known before since a call within a loop
// costs registers. Where the side list was too short it may hold anything, so all indices are held within
// bounds.
template <SlotKind Kind, bool Double>
struct SpilledContact {
  std::uint32_t i, j, producer;
  RecordInput<false> input;  // unless Double
  __device__ __forceinline__ SpilledContact() {}
  // Of the fused search, whose spilled contacts name their producer.
  __device__ __forceinline__ SpilledContact(const OutputTask& task, std::uint32_t index_i,
                                            std::uint32_t index_j, std::uint32_t of)
      : i(min(index_i, task.spheres.count - 1)),
        j(min(index_j, task.spheres.count - 1)),
        producer(min(of, task.tiles + task.units - 1)) {
    if constexpr (!Double) input = load_record_input<Kind>(task, i, j);
  }
  // Of the other searches.
  __device__ __forceinline__ SpilledContact(const OutputTask& task, Word word) {
    const std::uint32_t last = task.spheres.count - 1;
    i = static_cast<std::uint32_t>(word >> 32), j = min(static_cast<std::uint32_t>(word), last);
    if (i & kOfUnit && task.units) {
      const std::uint32_t unit = min((i & ~kOfUnit) >> 5, task.units - 1);
      producer = task.tiles + unit, i = __ldg(task.stable.unit_first + unit) + (i & 31);
    } else {
      producer = min(i, last) / kTileSpheres;
    }
    i = min(i, last);
    if constexpr (!Double) input = load_record_input<Kind>(task, i, j);
  }
  __device__ __forceinline__ void write(const OutputTask& task, Word slot) const {
    if (slot >= task.output.capacity) return;
    if constexpr (Double)
      write_record<Kind>(task, i, j, slot);
    else
      write_float_record<Kind>(task, input, slot);
  }
};

// Calls f(kind, whether records do not come from the slots, fused), all as constants. The fused search takes
// unequal slots only.
template <class F>
void with_record(const OutputTask& task, bool fused, F f) {
  const bool wide = record_kind(task) != RecordKind::from_slots;
  const auto of_kind = [&](auto kind, auto of_fused) {
    if (wide)
      f(kind, std::true_type{}, of_fused);
    else
      f(kind, std::false_type{}, of_fused);
  };
  const std::integral_constant<SlotKind, SlotKind::unequal> unequal;
  if (fused) return of_kind(unequal, std::true_type{});
  if (task.spheres.kind == SlotKind::equal)
    of_kind(std::integral_constant<SlotKind, SlotKind::equal>{}, std::false_type{});
  if (task.spheres.kind == SlotKind::unequal) of_kind(unequal, std::false_type{});
  if (task.spheres.kind == SlotKind::fixed_point)
    of_kind(std::integral_constant<SlotKind, SlotKind::fixed_point>{}, std::false_type{});
}

}  // namespace padder::detect::cuda
