// SPDX-License-Identifier: MIT
#include "detect/cuda/output/compaction.h"

namespace padder::detect::cuda {

void compact(const OutputTask& task, bool fused, int processors, cudaStream_t stream) {
  if (task.stable.ordered) return;  // the contacts lie where they stay, and are counted
  if (task.stable.octets) return compact_by_octets(task, fused, processors, stream);
  compact_by_numbers(task, fused, processors, stream);
}

}  // namespace padder::detect::cuda
