// SPDX-License-Identifier: GPL-3.0-or-later
// Arrays on either side of the module: NumPy's buffers, __cuda_array_interface__, DLPack. What comes in is
// read where it lies; what goes out is a view that keeps its owner alive.
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <string>
#include <vector>

#include "detect/detector.h"

namespace padder::python {

namespace py = pybind11;

// An array of the caller's, as the detector reads it: native numbers of one of the types of its Contract.
struct Array {
  py::object keep;  // what owns the memory while detect runs
  const char* data = nullptr;
  std::vector<py::ssize_t> shape, strides;  // strides in bytes; one each for every dimension
  char kind = 'f';                          // as NumPy names it
  int size = 4;                             // bytes a number
  detect::Memory memory = detect::Memory::host;

  bool single() const { return kind == 'f' && size == 4; }
  bool one() const { return shape.empty(); }  // a number, not a list of one
  template <class T>
  const T* as() const {
    return reinterpret_cast<const T*>(data);
  }
};

// What an argument must be, and so what comes of it.
struct Contract {
  enum class Kind {
    real,   // float32 stays so, all other real numbers and booleans become float64
    wide,   // float64
    bits,   // whole numbers from 0 to 4294967295: uint32
    whole,  // whole numbers: int64, or uint64 when they come as unsigned
    flags   // booleans or whole numbers, true where not 0: a byte each, 0 or not
  };
  const char* name;
  Kind kind;
  std::vector<py::ssize_t> shape;  // any: any length
  const char* said;                // the shape in words, for the message
  bool number = false;             // a single number, of no dimension, will do too
  bool rows = false;  // may stay where it is with other numbers between its rows; else contiguous
};
inline constexpr py::ssize_t any = -1;

// The one door for arrays: of NumPy (of any type, byte order, alignment and strides), lists, tuples, whatever
// numpy.asarray takes, and objects with __cuda_array_interface__ or DLPack. On the host what is not as wanted
// is converted once; on a device it is refused. `shape` is the caller's, so no dimension is ever added.
// Throws TypeError (complex numbers, objects, text, a device array of another type or layout) or ValueError
// (another shape, masked entries, a number out of range), which name the argument.
Array array_of(const py::object& object, const Contract& wanted);

// A real array as float32 (size 4) or float64 (8); the same rules.
void convert_real(Array& array, const char* name, int size);

// A view of memory that `owner` keeps alive; not to be written to.
template <class T>
py::array view(const T* data, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
               const py::handle& owner) {
  static const T none{};
  py::array a(py::dtype::of<T>(), std::move(shape), std::move(strides), data ? data : &none, owner);
  a.attr("flags").attr("writeable") = false;
  return a;
}

// What stays on a device: for CuPy, PyTorch and others to take over without a copy.
class DeviceArray {
 public:
  DeviceArray(py::object owner, const void* data, std::vector<std::int64_t> shape,
              std::vector<std::int64_t> strides, char kind, int size, int device)
      : owner_(std::move(owner)),
        data_(data),
        shape_(std::move(shape)),
        strides_(std::move(strides)),
        kind_(kind),
        size_(size),
        device_(device) {}

  py::dict interface() const;
  py::tuple shape() const { return py::tuple(py::cast(shape_)); }
  py::tuple device() const { return py::make_tuple(2, device_); }

  // The work was waited for before the array came to be, so no stream needs to wait. Of DLPack's two forms
  // always the one without a version, which a consumer of the other must take, too.
  py::capsule dlpack(const py::object& stream, const py::object& max_version, const py::object& where,
                     const py::object& copy) const;

 private:
  py::object owner_;
  const void* data_;
  std::vector<std::int64_t> shape_, strides_;  // strides in entries
  char kind_;
  int size_, device_;
};

}  // namespace padder::python
