// SPDX-License-Identifier: MIT
// How GoogleTest prints the parameters of the detector's tests. Without these it prints their bytes, also
// those that nothing has written to, and then the name of a test differs from run to run.
#pragma once
#include <ostream>

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

}  // namespace padder::detect
