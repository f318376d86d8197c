// SPDX-License-Identifier: MIT
// Random sequences of calls on a ResidentDetector: resident_model.h.
#include "tests/detect/cuda/resident_model.h"

namespace padder::detect {
namespace {

std::unique_ptr<BoxesUnderTest> resident_of(std::uint64_t seed) {
  const std::vector<int> devices = several(Dice(mixed(seed)).of<std::size_t>({1, 2, 3, 4, 7}));
  return std::make_unique<Resident>(devices, on(devices));
}

TEST(CudaResidentModel, EveryCallIsThatOfOneDetector) {
  if (gpus() == 0) GTEST_SKIP() << "there is no GPU";
  EXPECT_EQ(play_boxes(model_seed(), 200, resident_of), "");
}

}  // namespace
}  // namespace padder::detect
