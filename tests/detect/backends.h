// SPDX-License-Identifier: MIT
// What tests on every backend share: the test itself, which is skipped where there is no GPU, and the names
// by which GoogleTest prints the parameters. Without these it prints their bytes, also those that nothing has
// written to, and then the name of a test differs from run to run.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <string>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

inline const char* name_of(BackendKind kind) {
  return kind == BackendKind::omp ? "omp" : kind == BackendKind::cuda ? "cuda" : "automatic";
}
inline const char* name_of(Path path) { return path == Path::grid ? "grid" : "nine_stages"; }
inline const char* name_of(Precision precision) {
  return precision == Precision::exact ? "exact" : "float32";
}
inline const char* name_of(Scalar scalar) { return scalar == Scalar::f32 ? "float" : "double"; }
inline const char* name_of(Bodies bodies) {
  return bodies == Bodies::first ? "first" : bodies == Bodies::expanded ? "expanded" : "automatic";
}
inline void PrintTo(BackendKind kind, std::ostream* out) { *out << name_of(kind); }

// Those that this machine has.
inline std::vector<BackendKind> backends() {
  if (cuda_present()) return {BackendKind::omp, BackendKind::cuda};
  return {BackendKind::omp};
}

// For SetUp(), which may go on where IsSkipped() is false.
inline void skip_without(BackendKind backend) {
  if (backend == BackendKind::cuda && !cuda_present()) GTEST_SKIP() << "no GPU that this build can use";
}

class BackendTest : public testing::TestWithParam<BackendKind> {
 protected:
  void SetUp() override { skip_without(GetParam()); }
  DeviceChoice device_{GetParam()};
  CallOptions options_;
};
class GpuTest : public testing::Test {
 protected:
  void SetUp() override { skip_without(BackendKind::cuda); }
};
// The name of a test's parameter as it is printed, in one word.
template <class Parameter>
std::string name_in_one_word(const testing::TestParamInfo<Parameter>& info) {
  std::string name = testing::PrintToString(info.param);
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}
#define ON_EVERY_BACKEND(Suite)                                                                   \
  INSTANTIATE_TEST_SUITE_P(Backends, Suite, testing::Values(BackendKind::omp, BackendKind::cuda), \
                           name_in_one_word<BackendKind>)

}  // namespace padder::detect
