// SPDX-License-Identifier: MIT
// The search on the host: chooses the family of kernels, makes their task and launches them.
#include "detect/cuda/search/search.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/output/compaction.h"
#include "detect/cuda/output/record_writer.h"
#include "detect/cuda/search/exact_test.h"
#include "detect/cuda/search/launch.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

std::uint32_t blocks_of_warps(std::uint64_t warps) {
  return static_cast<std::uint32_t>((warps + kTileWarps - 1) / kTileWarps);
}

// The region as slots have it, with its faces moved outwards by so much, and then to a float inwards of that.
SearchTask::FloatBox float_box(const Region& region, const double (&origin)[3], double outwards) {
  SearchTask::FloatBox box;
  for (int k = 0; k < 3; k++) {
    box.low[k] = std::nextafter(static_cast<float>(region.low[k] - origin[k] - outwards), INFINITY);
    box.high[k] = std::nextafter(static_cast<float>(region.high[k] - origin[k] + outwards), -INFINITY);
  }
  return box;
}

// May two spheres that meet in a bucket of a hashed level be so many of its bins apart that in fixed point,
// modulo 256 bins, they look near? A bucket holds spheres of unrelated bins, and those of other levels search
// it, wherever they are.
bool places_repeat(const Grid& grid) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (int k = 0; k < grid.levels; k++) {
    const Level& l = grid.level[k];
    for (int c = 0; c < 3; c++)
      low[c] = std::min(low[c], low_of(l, c)), high[c] = std::max(high[c], high_of(l, c));
  }
  for (int k = 0; k < grid.levels; k++)
    for (int c = 0; c < 3; c++)
      if (grid.level[k].hashed && !(high[c] - low[c] <= 128.5 * grid.level[k].size)) return true;
  return false;
}

// What the kernels read, and how they test it.
SearchTask make_task(const DeviceSpheres& source, const Grid& grid, const Ordered& spheres,
                     const SearchOptions& options, const Output& output, Counters* counters) {
  SearchTask task;
  task.source = source, task.spheres = spheres, task.output = output, task.counters = counters;
  task.stable_order = options.stable_order, task.quota = options.quota;
  task.radius = options.radius, task.radius_f32 = static_cast<float>(options.radius);
  task.margin = options.margin;
  if (spheres.kind != SlotKind::fixed_point) task.margin_f32 = static_cast<float>(options.margin);
  task.sum = task.radius_f32 + task.radius_f32 + task.margin_f32, task.sum_squared = task.sum * task.sum;
  task.own = options.own, task.exact = options.exact, task.owns_all = options.owns_all;
  // The outer box stays outside by one band when its faces are rounded inwards.
  task.inner = float_box(options.own, source.origin, -options.owner_band);
  task.outer = float_box(options.own, source.origin, 2 * options.owner_band);
  task.defers = options.defers;
  task.wide = spheres.rounded ? kWideRounded : kWide, task.near = spheres.rounded ? kNearRounded : kNear;
  task.code_limit = code_limit(grid, spheres.bins, options.radius + grid.level[0].grown_by);
  task.test_all = source.filtered || !options.owns_all;
  if (spheres.kind == SlotKind::fixed_point) task.places_repeat = places_repeat(grid);
  task.test_all = task.test_all || task.places_repeat;
  task.only_owner = !options.owns_all && !source.filtered && !task.places_repeat;
  return task;
}

// How the spheres are searched: the family, and the division of the work between levels.
struct SearchPlan {
  KernelFamily family = KernelFamily::one_level;
  LevelPairs pairs;
  bool fused() const { return family == KernelFamily::fused_levels; }
};
SearchPlan choose_family(const SearchTask& task, const Grid& grid, int processors) {
  SearchPlan plan;
  const Ordered& spheres = task.spheres;
  // The fused search asks for the owner in the variant that several GPUs need most.
  const bool owned = task.only_owner && !task.stable_order && !task.spheres.rounded &&
                     record_kind(task) != RecordKind::from_given;
  if (spheres.count >= tuning::kFusedSpheres && spheres.float_levels && (!task.test_all || owned) &&
      (task.output.scalar == Scalar::f32 || task.output.width == Width::pairs)) {
    plan.family = KernelFamily::fused_levels;
  } else if (grid.levels > 1) {
    plan.family = KernelFamily::several_levels;
  } else {
    plan.family = tiles_of(spheres.count) <= tuning::kFewTilesOfProcessor * static_cast<unsigned>(processors)
                      ? KernelFamily::few_tiles
                      : KernelFamily::one_level;
  }
  plan.pairs = plan_level_pairs(grid, spheres.count, spheres.kind, plan.fused());
  if (spheres.float_levels) plan.pairs.bins = level_bins(grid, spheres.kind);
  // A spilled contact has 31 bits for its sphere, or for its unit and a sphere of that.
  if (task.stable_order && plan.family == KernelFamily::several_levels &&
      (spheres.count >= kOfUnit || plan.pairs.units > kMostUnits))
    throw Error(
        "too many spheres of several sizes for a stable order on one GPU: ask for any order, or "
        "divide the scene into boxes");
  return plan;
}

// Spheres of a tile of the fused search. In any order tiles are small, but where all work runs at once by
// large tiles alone: a second round would be nearly empty.
std::uint32_t fused_tile(const SearchTask& task, const SearchPlan& plan, int processors) {
  const auto runs_at_once = [&](std::uint64_t tile) {
    return plan.pairs.warps + (task.spheres.count + tile - 1) / tile <=
           std::uint64_t(processors) * tuning::kFusedBlocks * kTileWarps;
  };
  return task.stable_order || (runs_at_once(kLargeTile) && !runs_at_once(kTileSpheres)) ? kLargeTile
                                                                                        : kTileSpheres;
}

// May each tile wait for those before it? Then all must run at once.
bool are_ordered(const SearchTask& task, const SearchPlan& plan, int processors) {
  if (plan.fused() || plan.family == KernelFamily::one_level) return false;
  const std::uint32_t tiles = task.tiles + blocks_of_warps(plan.pairs.warps);
  return tiles <= tuning::kMostOrderedTiles &&
         tiles <= resident_tiles(plan.family, task.spheres.kind, processors);
}

}  // namespace

// Where tiles wait for each other, a warp must have one unit only.
static_assert(tuning::kMostOrderedTiles * kTileSpheres < tuning::kManySpheres);

unsigned resident_tiles(KernelFamily family, SlotKind kind, int processors) {
  if (family == KernelFamily::several_levels) return resident_several_levels(kind, processors);
  return resident_one_level(family, kind, processors);
}

SlotQuota quota_for(const Counters& found, std::uint32_t spheres, const Grid& grid, SlotKind kind) {
  // The quota goes in steps, so that it seldom changes from call to call; steps are finer where chance
  // changes the number of contacts less. A factor of 1, which is expected, lies in the origin of a step.
  const double steps = found.contacts >> 24 ? 64 : found.contacts >> 22 ? 32 : 16;  // of an octave
  const auto rounded = [&](double mean) {
    return std::exp2((std::floor(steps * std::log2(mean) + 0.5) - 0.5) / steps);
  };
  const std::uint32_t tiles = tiles_of(spheres);
  const LevelPairs pairs = plan_level_pairs(grid, spheres, kind);
  if (tiles + blocks_of_warps(pairs.warps) <= tuning::kMostOrderedTiles) return {};
  SlotQuota quota;
  const double own = static_cast<double>(found.own) / std::max(tiles, 1u),
               of_units = static_cast<double>(found.contacts - found.deferred - found.own);
  if (own >= 1) quota.tile = static_cast<std::uint32_t>(std::min(rounded(own), 0x1p24));
  if (pairs.units && of_units > 0 && found.expected)
    quota.unit = static_cast<float>(rounded(std::min(of_units / static_cast<double>(found.expected), 1.0)));
  return quota;
}

void search(const DeviceSpheres& source, const Grid& grid, const Ordered& spheres,
            const SearchOptions& options, const Output& output, Counters* counters, SearchMemory& memory,
            int processors, cudaStream_t stream) {
  SearchTask task = make_task(source, grid, spheres, options, output, counters);
  if (options.long_rows)
    task.long_rows =
        lay_out_long_rows(memory, options.long_rows, spheres.count, options.stable_order, stream);
  const SearchPlan plan = choose_family(task, grid, processors);
  const bool fused = plan.fused(), many = fused || spheres.count >= tuning::kManySpheres;
  if (fused) task.tile_spheres = fused_tile(task, plan, processors);
  task.tiles =
      static_cast<std::uint32_t>((std::uint64_t(spheres.count) + task.tile_spheres - 1) / task.tile_spheres);
  task.units = plan.pairs.units;
  if (options.stable_order || plan.pairs.count) {
    unsigned int* const next = reserve_marks(task, memory, stream);
    if (many) task.next = next;
  }
  if (options.stable_order) {
    task.stable.ordered = are_ordered(task, plan, processors);
    lay_out(task, memory, task.units && many, fused ? &grid : nullptr, stream);
  }
  if (fused)
    launch_fused_levels(task, grid, plan.pairs, processors, stream);
  else if (plan.family == KernelFamily::several_levels)
    launch_several_levels(task, grid, plan.pairs, processors, stream);
  else
    launch_one_level(task, grid, plan.family, stream);
  if (options.stable_order) compact(task, fused, processors, stream);
  if (options.long_rows) search_long_rows(task, grid, memory, processors, stream);
}

}  // namespace padder::detect::cuda
