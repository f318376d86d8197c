// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies as the module keeps them: the shapes are converted once, and Python sees the bodies' memory as
// arrays.
#pragma once
#include <pybind11/pybind11.h>

#include <vector>

#include "detect/detector.h"

namespace padder::python {

// Must never be copied or resized, because `shapes` and Python's views point into it.
struct Bodies {
  std::vector<std::vector<detect::Sphere>> spheres;  // those of each shape
  std::vector<detect::Shape> shapes;
  std::vector<detect::Body> bodies;
};

}  // namespace padder::python
