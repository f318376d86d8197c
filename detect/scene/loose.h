// SPDX-License-Identifier: MIT
// Loose spheres in host memory, and the files they come from.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/generate.h"

namespace padder::detect {

// x, y, z, r of each sphere, in float or in double; the others empty or one for each.
struct LooseSpheres {
  Scalar scalar = Scalar::f32;
  std::vector<float> single;  // 4 N, when scalar is f32
  std::vector<double> twice;  // 4 N, when scalar is f64
  std::vector<std::uint32_t> family, mask;
  std::vector<std::uint8_t> is_static;  // likewise

  std::uint64_t size() const { return (scalar == Scalar::f32 ? single.size() : twice.size()) / 4; }
  // Behind the spheres here; to double when either side is.
  void append(const LooseSpheres& more);
  Spheres view() const;  // borrowed
};

LooseSpheres loose_from(const std::vector<FloatSphere>& spheres);

// .npz with `centers` (N, 3) and `radii` (N), perhaps `family` and `mask` (N): float32 stays float.
LooseSpheres loose_from_npz(std::string_view bytes, const std::string& where);

// .csv: a header x,y,z,r and perhaps family and mask, then a sphere a line, in double; lines that begin with
// # are skipped. Throws Error that names the line.
LooseSpheres loose_from_csv(std::string_view text, const std::string& where);

}  // namespace padder::detect
