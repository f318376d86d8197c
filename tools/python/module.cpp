// SPDX-License-Identifier: GPL-3.0-or-later
// The Python module padder._core: padding, and the detector for NumPy and GPU arrays.
#include "tools/python/module.h"

#include "padding/asset/error.h"

namespace {

// An object made by Class.__new__ alone holds nothing. pybind11 would give it memory that nobody has filled,
// by the type's operator_new, when a method first asks for what it holds. Refuses instead.
void refuse_objects_without_content(const pybind11::module_& m) {
  for (const auto& [name, value] : m.attr("__dict__").cast<pybind11::dict>()) {
    if (!pybind11::isinstance<pybind11::type>(value)) continue;
    auto* const type = reinterpret_cast<PyTypeObject*>(value.ptr());
    pybind11::detail::type_info* const info = pybind11::detail::get_type_info(type);
    if (info)
      info->operator_new = [](std::size_t) -> void* {
        throw pybind11::type_error(
            "the object is empty: it was made by __new__ alone, without its constructor");
      };
  }
}

// With the protocols 0 and 1, pickle makes an object of pybind11's base of all classes, which ends the
// process.
void refuse_old_pickles(const pybind11::module_& m) {
  const pybind11::object reduce = pybind11::module_::import("builtins").attr("object").attr("__reduce_ex__");
  for (const auto& [name, value] : m.attr("__dict__").cast<pybind11::dict>()) {
    auto* const type = reinterpret_cast<PyTypeObject*>(value.ptr());
    if (!pybind11::isinstance<pybind11::type>(value) || !pybind11::detail::get_type_info(type)) continue;
    pybind11::setattr(value, "__reduce_ex__",
                      pybind11::cpp_function(
                          [reduce](const pybind11::object& self, int protocol) -> pybind11::object {
                            if (protocol < 2) throw pybind11::type_error("pickle needs protocol 2 or above");
                            return reduce(self, protocol);
                          },
                          pybind11::name("__reduce_ex__"), pybind11::is_method(value)));
  }
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = PADDER_VERSION;
  pybind11::register_exception<padder::Error>(m, "Error", PyExc_RuntimeError);
  padder::python::add_pad(m);
  padder::python::add_arrays(m);
  padder::python::add_bodies(m);
  padder::python::add_detect(m);
  refuse_objects_without_content(m);
  refuse_old_pickles(m);
}
