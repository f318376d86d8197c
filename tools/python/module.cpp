// SPDX-License-Identifier: GPL-3.0-or-later
// The Python module padder._core: padding, and the detector for NumPy and GPU arrays.
#include "tools/python/module.h"

#include "padding/asset/error.h"

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = PADDER_VERSION;
  pybind11::register_exception<padder::Error>(m, "Error", PyExc_RuntimeError);
  padder::python::add_pad(m);
  padder::python::add_arrays(m);
  padder::python::add_bodies(m);
  padder::python::add_detect(m);
}
