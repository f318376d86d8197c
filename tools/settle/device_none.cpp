// SPDX-License-Identifier: MIT
// In place of tools/settle/cuda/ in a build without CUDA.
#include "detect/core/backend.h"
#include "padding/asset/error.h"
#include "tools/settle/device_stepper.h"

namespace padder::settle {

std::unique_ptr<DeviceStepper> make_device_stepper(const System&) { throw Error(detect::cuda_absence(0)); }

}  // namespace padder::settle
