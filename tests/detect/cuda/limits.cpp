// SPDX-License-Identifier: MIT
// Linked into every test of the detector, so that all of them can run as on a smaller GPU, or another way:
//
// - PADDER_TEST_SHARED_MEMORY=BYTES: a block has no more shared memory (101376, as on compute capability 8.6)
// - PADDER_TEST_ALL_PAIRS=N: no more elements of bodies are searched without a grid (0: none)
// - PADDER_TEST_PROGRAMMATIC_LAUNCH=0: no kernel begins before the previous one has ended
#include <cstdlib>

#include "detect/cuda/device/device.h"

namespace {

[[maybe_unused]] const bool limited = [] {
  padder::detect::cuda::TestLimits& limits = padder::detect::cuda::test_limits;
  if (const char* bytes = std::getenv("PADDER_TEST_SHARED_MEMORY"))
    limits.shared_memory = std::strtoull(bytes, nullptr, 10);
  if (const char* launch = std::getenv("PADDER_TEST_PROGRAMMATIC_LAUNCH"))
    limits.programmatic_launch = *launch != '0';
  if (const char* elements = std::getenv("PADDER_TEST_ALL_PAIRS"))
    limits.all_pairs_elements = static_cast<std::uint32_t>(std::strtoul(elements, nullptr, 10));
  return true;
}();

}  // namespace
