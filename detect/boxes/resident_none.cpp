// SPDX-License-Identifier: MIT
// Takes the place of cuda/boxes/resident_detector.cu in a build without CUDA.
#include "detect/boxes/numbered_hash.h"
#include "detect/boxes/resident_detector.h"
#include "detect/core/backend.h"
#include "padding/asset/error.h"

namespace padder::detect {

class ResidentDetector::Work {};

ResidentDetector::ResidentDetector(const ResidentOptions&) { throw Error(cuda_absence(0)); }
ResidentDetector::~ResidentDetector() = default;
ResidentDetector::ResidentDetector(ResidentDetector&&) noexcept = default;
ResidentDetector& ResidentDetector::operator=(ResidentDetector&&) noexcept = default;

struct NumberedHash::Memory {};

NumberedHash::NumberedHash() = default;
NumberedHash::~NumberedHash() = default;
void NumberedHash::release() {}
std::uint64_t NumberedHash::of(int device, const Pair*, std::uint64_t, std::span<const std::uint64_t>) {
  throw Error(cuda_absence(device));
}

// No object exists on which these could be called.
const ResidentReport& ResidentDetector::detect(std::span<const Spheres>) { throw Error(cuda_absence(0)); }
const ResidentReport& ResidentDetector::detect(std::span<const Spheres>, const Input&,
                                               std::span<const ResidentPoses>) {
  throw Error(cuda_absence(0));
}
std::span<const ResidentContacts> ResidentDetector::found() const { return {}; }
const ResidentReport& ResidentDetector::report() const { throw Error(cuda_absence(0)); }
std::uint64_t ResidentDetector::hash() const { return 0; }
Region ResidentDetector::region(std::size_t) const { return {}; }
std::size_t ResidentDetector::devices() const { return 0; }
CallOptions& ResidentDetector::options() { throw Error(cuda_absence(0)); }

}  // namespace padder::detect
