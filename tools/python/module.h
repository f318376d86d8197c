// SPDX-License-Identifier: GPL-3.0-or-later
// The rooms of the module padder._core; each adds its names. Their words: padder/__init__.pyi.
#pragma once
#include <pybind11/pybind11.h>

namespace padder::python {

void add_arrays(pybind11::module_& module);  // arrays.cpp: DeviceArray
void add_pad(pybind11::module_& module);     // pad.cpp: Cluster, load, pad, pad_file
void add_bodies(pybind11::module_& module);  // bodies.cpp: Bodies
void add_detect(pybind11::module_& module);  // detect.cpp: Contacts, Detector, detect

}  // namespace padder::python
