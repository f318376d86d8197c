// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies as the module keeps them: shapes converted once, bodies in memory that Python sees as arrays.
#pragma once
#include <pybind11/pybind11.h>

#include <vector>

#include "detect/detector.h"

namespace padder::python {

// Never copied or resized: `shapes` and Python's views point into it.
struct Bodies {
  std::vector<std::vector<detect::Sphere>> spheres;  // of each shape
  std::vector<detect::Shape> shapes;
  std::vector<detect::Body> bodies;
};

}  // namespace padder::python
