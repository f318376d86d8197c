// SPDX-License-Identifier: MIT
// Memory and layout of the bookkeeping of a list of stable order, on the host. Internal; only .cu files
// include this.
#pragma once
#include "detect/cuda/device/memory.h"
#include "detect/cuda/output/output_task.h"

namespace padder::detect::cuda {

// Work space of the search. The caller makes `spill` longer when Counters::spilled says so, and searches
// again. `long_rows` and `scratch` are those of long_rows.cu.
struct SearchMemory {
  explicit SearchMemory(MemoryBook& book)
      : sums(book, "the order of the list"),
        marks(book, "the order of the list"),
        spill(book, "the order of the list"),
        long_rows(book, "crowded spheres"),
        scratch(book, "crowded spheres") {}
  Buffer<unsigned long long> sums, marks, spill;  // marks: zero where the last search left them so
  Buffer<unsigned long long> long_rows;
  Buffer<unsigned char> scratch;
};

// The words that searches leave at zero, set in `task.stable`; task.tiles and task.units are known. Returns
// the counter from which warps take work.
unsigned int* reserve_marks(OutputTask& task, SearchMemory& memory, cudaStream_t stream);

// Lays out the rest of task.stable. `has_quotas`: units have quotas. `grid`: of the fused search, whose tiles
// have quotas by level; else null. task.quota is known. `stream` is used in initcheck's build alone.
void lay_out(OutputTask& task, SearchMemory& memory, bool has_quotas, const Grid* grid, cudaStream_t stream);

// Quotas for `tiles` tiles of the fused search, `slots` output slots in all and never more: fewer slots may
// be left empty than contacts spill. The quota of a level's tiles is in proportion to how many of its spheres
// are within reach of one.
TileQuotas quotas_of_levels(const Grid& grid, std::uint64_t slots, std::uint32_t tiles);

// Tiles of the searches that are not fused.
inline std::uint32_t tiles_of(std::uint64_t spheres) {
  return static_cast<std::uint32_t>((spheres + kTileSpheres - 1) / kTileSpheres);
}

}  // namespace padder::detect::cuda
