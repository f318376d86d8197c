// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of the module padder._core. Each function adds the names of one source file; padder/__init__.pyi
// describes them.
#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <utility>

#include "padding/asset/cluster.h"
#include "padding/asset/mesh.h"

namespace padder::python {

namespace py = pybind11;

using PyCluster = py::class_<Cluster, std::shared_ptr<Cluster>>;

void add_arrays(pybind11::module_& module);  // arrays.cpp: DeviceArray
void add_pad(pybind11::module_& module);     // pad.cpp: Cluster, load, pad, pad_file
void add_page(PyCluster& cluster);           // page.cpp: Cluster.page
void add_bodies(pybind11::module_& module);  // bodies.cpp: Bodies
void add_detect(pybind11::module_& module);  // detect.cpp: Contacts, Detector, detect

// The mesh of two arrays, or of one object with .vertices and .faces (pad.cpp). Throws TypeError and
// ValueError.
Mesh given_mesh(const py::object& vertices, const py::object& faces);

// The value that has this name. Throws ValueError with the refusal where none has.
template <class Value, std::size_t N>
Value named(const std::pair<const char*, Value> (&names)[N], const std::string& given, const char* refusal) {
  for (const auto& [name, value] : names)
    if (given == name) return value;
  throw py::value_error(refusal);
}

}  // namespace padder::python
