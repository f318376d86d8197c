// SPDX-License-Identifier: GPL-3.0-or-later
// Arrays that come from Python and go to Python: NumPy's, and device arrays through __cuda_array_interface__
// or DLPack. Arrays that come in are read where they lie. Arrays that go out are views that keep their owner
// alive.
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <vector>

#include "detect/detector.h"

namespace padder::python {

namespace py = pybind11;

// An array of the caller as the detector reads it. Its type is one that the Contract allows, in native byte
// order.
struct Array {
  py::object keep;  // owns the memory during the call
  const char* data = nullptr;
  std::vector<py::ssize_t> shape, strides;  // one for each dimension; strides are in bytes
  char kind = 'f';                          // NumPy's letter for the type
  int size = 4;                             // bytes of each number
  detect::Memory memory = detect::Memory::host;

  bool single() const { return kind == 'f' && size == 4; }
  bool one() const { return shape.empty(); }  // a number, not a list of one
  template <class T>
  const T* as() const {
    return reinterpret_cast<const T*>(data);
  }
};

// What an argument must be, and what it is converted to.
struct Contract {
  enum class Kind {
    real,   // float32 stays float32; all other real numbers and booleans become float64
    wide,   // becomes float64
    bits,   // whole numbers from 0 to 4294967295; becomes uint32
    whole,  // whole numbers; becomes int64, or uint64 if they are unsigned
    flags   // booleans or whole numbers; becomes a byte each, true if it is not 0
  };
  const char* name;
  Kind kind;
  std::vector<py::ssize_t> shape;  // kAny stands for any length
  const char* said;                // the shape in words, for messages
  bool number = false;             // a single number is allowed, too
  bool rows = false;               // rows need not be contiguous with each other
};
inline constexpr py::ssize_t kAny = -1;

// Every array from Python comes in through this function. It takes NumPy arrays of any type, byte order,
// alignment and strides, everything that numpy.asarray takes, and objects that offer __cuda_array_interface__
// or DLPack. An array on the host that is not as wanted is converted, once. One on a device is refused. A
// dimension is never added.
//
// Throws TypeError for complex numbers, objects, text, and device arrays of another type or layout. Throws
// ValueError for another shape, masked entries, and numbers out of range. The message names the argument.
Array array_of(const py::object& object, const Contract& wanted);

// Converts a real array to float32 (size 4) or float64 (size 8), by the same rules.
void convert_real(Array& array, const char* name, int size);

// A read-only view of memory that `owner` keeps alive.
template <class T>
py::array view(const T* data, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
               const py::handle& owner) {
  static const T none{};
  py::array a(py::dtype::of<T>(), std::move(shape), std::move(strides), data ? data : &none, owner);
  a.attr("flags").attr("writeable") = false;
  return a;
}

// An array in device memory, which CuPy, PyTorch and others can use without a copy.
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

  // No stream needs to wait, because the work was finished before this object was made. The capsule is always
  // of DLPack's form without a version. Consumers of the other form must accept it, too.
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
