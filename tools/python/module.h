// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of the module padder._core. Each function adds the names of one source file; padder/__init__.pyi
// describes them.
#pragma once
#include <pybind11/pybind11.h>

namespace padder::python {

void add_arrays(pybind11::module_& module);  // arrays.cpp: DeviceArray
void add_pad(pybind11::module_& module);     // pad.cpp: Cluster, load, pad, pad_file
void add_bodies(pybind11::module_& module);  // bodies.cpp: Bodies
void add_detect(pybind11::module_& module);  // detect.cpp: Contacts, Detector, detect

}  // namespace padder::python
