// SPDX-License-Identifier: MIT
#include "detect/cuda/output/stable_output.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/ordered_tiles.h"

namespace padder::detect::cuda {
namespace {

std::uint32_t over(std::uint64_t n, std::uint32_t each) {
  return static_cast<std::uint32_t>((n + each - 1) / each);
}

// The marks: the counter of work and of blocks, the words of ordered tiles, the sums of groups, the sums of
// quotas. Sums of groups begin at a multiple of two words, since two are read at a time.
constexpr std::uint32_t kSumsAt = 4 + 2 * kOrderedWords;
static_assert(kSumsAt % 2 == 0);

}  // namespace

unsigned int* reserve_marks(OutputTask& task, SearchMemory& memory, cudaStream_t stream) {
  const std::uint32_t tile_groups = over(task.tiles, kGroupProducers),
                      all_groups = tile_groups + over(task.units, kGroupProducers);
  // Sums of octets are read four at a time, the last as well.
  const std::uint64_t sums = std::max<std::uint64_t>(2 * std::uint64_t(all_groups), octets_of(task) + 3),
                      marks = kSumsAt + sums + over(task.units, kQuotaUnits);
  const bool fresh = memory.marks.capacity() < marks;
  Word* const p = memory.marks.reserve(marks);
  // All that there is, which may be more than was asked for: the next search may use more.
  if (fresh) cuda_check(cudaMemsetAsync(p, 0, memory.marks.capacity() * 8, stream), "clear the counters");
  // The first spilled contact is loaded before it is known whether there is one.
  if (memory.spill.data()) clear_for_initcheck(memory.spill.data(), memory.spill.capacity(), stream);
  StableOutput& stable = task.stable;
  stable.tile_groups = tile_groups, stable.all_groups = all_groups;
  stable.blocks_done = reinterpret_cast<unsigned int*>(p) + 1;
  stable.ordered_words = p + 2, stable.group_sums = p + kSumsAt, stable.quota_sums = stable.group_sums + sums;
  return reinterpret_cast<unsigned int*>(p);
}

void lay_out(OutputTask& task, SearchMemory& memory, bool has_quotas, const Grid* grid, cudaStream_t stream) {
  StableOutput& stable = task.stable;
  const std::uint64_t units = task.units, producers = task.tiles + units;
  stable.quota_groups = has_quotas ? over(units, kQuotaUnits) : 0;
  stable.spill = memory.spill.data(),
  stable.spill_capacity = memory.spill.data() ? memory.spill.capacity() : 0;
  stable.index_capacity = stable.spill_capacity / kIndexStep + 1;
  // Arrays of 64-bit words, then those of 32 bits: `net` with eight more, since they are read four or eight
  // at a time.
  const std::uint64_t words = (producers + stable.quota_groups + 3) & ~std::uint64_t(1);
  Word* const p =
      memory.sums.reserve(words + (2 * producers + 8 + 2 * units + stable.index_capacity + 1) / 2 + 2);
  stable.spill_start = p, stable.quota_bases = p + producers;
  stable.empty_total = stable.quota_bases + stable.quota_groups + 1;
  stable.net = reinterpret_cast<std::uint32_t*>(p + words);
  stable.unit_first = stable.net + producers + 8, stable.empty_upto = stable.unit_first + units;
  stable.empty_index = stable.empty_upto + producers;
  clear_for_initcheck(stable.net + producers, 8, stream);      // read with the last producer's
  clear_for_initcheck(stable.spill_start, producers, stream);  // unwritten by units without rows
  if (has_quotas) stable.unit_quotas = stable.empty_index + stable.index_capacity;

  const std::uint64_t slots = static_cast<std::uint64_t>(task.quota.tile) * tiles_of(task.spheres.count);
  task.tile_quotas.quota[0] = task.quota.tile, task.tile_quotas.slot[1] = slots;
  if (grid) task.tile_quotas = quotas_of_levels(*grid, slots, task.tiles);
  // Each block of a compaction in one kernel holds sums of all producers in 32 bits.
  stable.octets = (grid || !has_quotas) && fits_octets(task, grid != nullptr) &&
                  stable.spill_capacity >> (grid ? 33 : 32) == 0 && slots >> 31 == 0;
}

TileQuotas quotas_of_levels(const Grid& grid, std::uint64_t slots, std::uint32_t tiles) {
  TileQuotas q;
  double weight[kMaxLevels], sum = 0;
  std::uint64_t first = 0;
  q.levels = grid.levels;
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    weight[k] = static_cast<double>(l.spheres) * std::pow(l.radius_max * l.per_size, 3) /
                    (l.filled * l.count[0] * l.count[1] * l.count[2]) +
                1e-30;
    if (k) weight[k] = std::clamp(weight[k], 0x1p-5 * weight[0], 0x1p5 * weight[0]);
    q.first[k] = std::min(over(first, kLargeTile), tiles), first += l.spheres;
  }
  const auto end = [&](int k) { return k + 1 < grid.levels ? q.first[k + 1] : tiles; };
  for (int k = 0; k < grid.levels; k++) sum += weight[k] * (end(k) - q.first[k]);
  for (int k = 0; k < grid.levels; k++) {
    q.quota[k] = static_cast<std::uint32_t>(static_cast<double>(slots) / sum * weight[k]);
    q.slot[k + 1] = q.slot[k] + static_cast<std::uint64_t>(q.quota[k]) * (end(k) - q.first[k]);
  }
  return q;
}

}  // namespace padder::detect::cuda
