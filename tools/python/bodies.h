// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies as the module keeps them: the shapes are converted once, and Python sees the bodies' memory as
// arrays.
#pragma once
#include <pybind11/pybind11.h>

#include <vector>

#include "detect/scene/rungs.h"

namespace padder::python {

// Must never be copied or resized, because `shapes` and Python's views point into it.
struct Bodies {
  std::vector<std::vector<detect::Rung>> rungs;  // the levels of detail of each shape
  std::vector<detect::Shape> shapes;             // the spheres of each shape's finest level
  std::vector<detect::Body> bodies;
  std::vector<std::uint32_t> taken;  // by with_lod(): the level of each body
  double lod_error = 0;
};

// Throws ValueError unless the nine numbers, row by row, are an orthonormal matrix to within 1e-3: rounding
// and drift leave less, and with any other matrix a body is no longer the shape that was padded.
void check_rotation(const double* rotation, std::size_t body);

}  // namespace padder::python
