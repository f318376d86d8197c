// SPDX-License-Identifier: MIT
// The families of search kernels, each in a .cu of its own, as the host sees them. Internal.
#pragma once
#include "detect/cuda/output/stable_output.h"
#include "detect/cuda/search/level_pairs.h"
#include "detect/cuda/search/search_task.h"

namespace padder::detect::cuda {

// How spheres look for partners.
enum class KernelFamily {
  few_tiles,       // one dense level, so few tiles that latency is all
  one_level,       // one dense level
  several_levels,  // several levels: the own level, and units that search another one
  fused_levels     // the same, for many float spheres whose distance alone counts
};

// How many tiles of the family run at once on so many processors. Not for fused_levels.
unsigned resident_tiles(KernelFamily family, SlotKind kind, int processors);

// Search kernels alone; compaction.h finishes a stable list. All throw Error.
void launch_one_level(const SearchTask& task, const Grid& grid, KernelFamily family, cudaStream_t stream);
void launch_several_levels(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, int processors,
                           cudaStream_t stream);
void launch_fused_levels(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, int processors,
                         cudaStream_t stream);

// Room for so many parts of long rows, in memory.long_rows.
LongRows lay_out_long_rows(SearchMemory& memory, std::uint64_t room, std::uint32_t spheres, bool stable,
                           cudaStream_t stream);
// Searches the parts that a search has put on the list of task.long_rows. A stable list is finished before,
// but for these.
void search_long_rows(SearchTask& task, const Grid& grid, SearchMemory& memory, int processors,
                      cudaStream_t stream);

// Quotas of units (unit_quotas.cu). The kernel behind it may start early and waits for its end
// (launch_overlapped). `overlapped`: it does the same behind the kernel before it.
void launch_unit_quotas(const SearchTask& task, const Grid& grid, const LevelPairs& pairs, bool overlapped,
                        int processors, cudaStream_t stream);

unsigned resident_one_level(KernelFamily family, SlotKind kind, int processors);
unsigned resident_several_levels(SlotKind kind, int processors);

}  // namespace padder::detect::cuda
