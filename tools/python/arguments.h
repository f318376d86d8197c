// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers and text that come from Python. Their types carry the argument's name: one of another kind is a
// TypeError that names it, where pybind11 would list every signature, and one out of range a ValueError.
#pragma once
#include <pybind11/pybind11.h>

#include <algorithm>
#include <limits>
#include <string>

namespace padder::python {

// A text as a parameter of a template.
template <std::size_t N>
struct Name {
  constexpr Name(const char (&from)[N]) { std::copy_n(from, N, text); }
  char text[N];
};

// A whole number from 0 to kMost.
template <Name kName, class T, T kMost = std::numeric_limits<T>::max()>
struct Whole {
  T value = 0;
  operator T() const { return value; }
};

template <Name kName>
struct Real {
  double value = 0;
  operator double() const { return value; }
};

template <Name kName>
struct Text {
  std::string value;
  operator const std::string&() const { return value; }
};

[[noreturn]] inline void refuse_type(const char* name, const char* wanted, pybind11::handle given) {
  throw pybind11::type_error(std::string(name) + " must be " + wanted + ", not " +
                             pybind11::cast<std::string>(pybind11::type::of(given).attr("__name__")));
}

}  // namespace padder::python

namespace pybind11::detail {

// pybind11 finds these by their types.
template <padder::python::Name kName, class T, T kMost>
struct type_caster<padder::python::Whole<kName, T, kMost>> {
  using Number = padder::python::Whole<kName, T, kMost>;
  PYBIND11_TYPE_CASTER(Number, const_name("int"));

  bool load(handle source, bool) {
    if (!PyIndex_Check(source.ptr())) padder::python::refuse_type(kName.text, "a whole number", source);
    const object number = reinterpret_steal<object>(PyNumber_Index(source.ptr()));
    if (!number) throw error_already_set();
    const unsigned long long given = PyLong_AsUnsignedLongLong(number.ptr());
    constexpr auto most = static_cast<unsigned long long>(kMost);
    const bool outside = PyErr_Occurred() != nullptr;
    PyErr_Clear();
    if (outside || given > most)
      throw value_error(std::string(kName.text) + " must be a whole number from 0 to " +
                        std::to_string(most));
    value.value = static_cast<T>(given);
    return true;
  }
  static handle cast(Number whole, return_value_policy, handle) {
    return PyLong_FromUnsignedLongLong(static_cast<unsigned long long>(whole.value));
  }
};

template <padder::python::Name kName>
struct type_caster<padder::python::Real<kName>> {
  using Number = padder::python::Real<kName>;
  PYBIND11_TYPE_CASTER(Number, const_name("float"));

  bool load(handle source, bool) {
    value.value = PyFloat_AsDouble(source.ptr());
    if (!PyErr_Occurred()) return true;
    const bool large = PyErr_ExceptionMatches(PyExc_OverflowError) != 0;
    if (!large && !PyErr_ExceptionMatches(PyExc_TypeError)) throw error_already_set();
    PyErr_Clear();
    if (large) throw value_error(std::string(kName.text) + " is beyond what a float holds");
    padder::python::refuse_type(kName.text, "a number", source);
  }
  static handle cast(Number number, return_value_policy, handle) { return PyFloat_FromDouble(number.value); }
};

template <padder::python::Name kName>
struct type_caster<padder::python::Text<kName>> {
  using Words = padder::python::Text<kName>;
  PYBIND11_TYPE_CASTER(Words, const_name("str"));

  bool load(handle source, bool) {
    make_caster<std::string> text;
    if (!text.load(source, false)) {
      if (!PyUnicode_Check(source.ptr())) padder::python::refuse_type(kName.text, "text", source);
      throw value_error(std::string(kName.text) + " must be text that UTF-8 can hold");
    }
    value.value = cast_op<std::string&&>(std::move(text));
    return true;
  }
  static handle cast(const Words& words, return_value_policy, handle) {
    return PyUnicode_FromStringAndSize(words.value.data(), static_cast<ssize_t>(words.value.size()));
  }
};

}  // namespace pybind11::detail
