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

// N loose spheres, in float or in double.
struct LooseSpheres {
  Scalar scalar = Scalar::f32;
  std::vector<float> single;                       // x, y, z, r of each sphere if scalar is f32
  std::vector<double> twice;                       // x, y, z, r of each sphere if scalar is f64
  std::vector<std::uint32_t> family, mask, world;  // one for each sphere, or empty
  std::vector<std::uint8_t> is_static;             // one for each sphere, or empty

  std::uint64_t size() const { return (scalar == Scalar::f32 ? single.size() : twice.size()) / 4; }
  // Appends the spheres of `more`. The result is in double if either of the two is.
  void append(const LooseSpheres& more);
  // The spheres as the detector takes them. They refer to this object.
  Spheres view() const;
};

LooseSpheres loose_from(const std::vector<FloatSphere>& spheres);
// A copy of spheres in host memory. Their arrays may begin at any address.
LooseSpheres loose_from(const Spheres& spheres);

// Reads .npz: the arrays `centers` (N, 3) and `radii` (N), and, if they are there, `family`, `mask` and
// `world` (N). The spheres are in float if centres and radii are float32. Throws Error that names the array.
LooseSpheres loose_from_npz(std::string_view bytes, const std::string& where);

// Reads .csv, in double: a header x,y,z,r, which may go on with family and mask, and then a line for each
// sphere. Lines that begin with # are skipped. Throws Error that names the line.
LooseSpheres loose_from_csv(std::string_view text, const std::string& where);

}  // namespace padder::detect
