// SPDX-License-Identifier: GPL-3.0-or-later
// Whole numbers that come from Python, 0 and above: one out of range is a ValueError that says the range, as
// every other argument at fault.
#pragma once
#include <pybind11/pybind11.h>

#include <limits>
#include <string>

namespace padder::python {

template <class T, T kMost = std::numeric_limits<T>::max()>
struct Whole {
  T value = 0;
  operator T() const { return value; }
};

}  // namespace padder::python

namespace pybind11::detail {

// pybind11 finds it by the type. Anything but a whole number is its usual TypeError.
template <class T, T kMost>
struct type_caster<padder::python::Whole<T, kMost>> {
  using Number = padder::python::Whole<T, kMost>;
  PYBIND11_TYPE_CASTER(Number, const_name("int"));

  bool load(handle source, bool) {
    if (!PyIndex_Check(source.ptr())) return false;
    const object number = reinterpret_steal<object>(PyNumber_Index(source.ptr()));
    if (!number) throw error_already_set();
    const unsigned long long given = PyLong_AsUnsignedLongLong(number.ptr());
    constexpr auto most = static_cast<unsigned long long>(kMost);
    const bool outside = PyErr_Occurred() != nullptr;
    PyErr_Clear();
    if (outside || given > most)
      throw value_error(str(number).cast<std::string>() + " is out of range: give a whole number from 0 to " +
                        std::to_string(most));
    value.value = static_cast<T>(given);
    return true;
  }
  static handle cast(Number whole, return_value_policy, handle) {
    return PyLong_FromUnsignedLongLong(static_cast<unsigned long long>(whole.value));
  }
};

}  // namespace pybind11::detail
