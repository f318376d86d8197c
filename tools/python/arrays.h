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

// An array of the caller's.
struct Given {
  py::object keep;  // what owns the memory while detect runs
  const char* data = nullptr;
  std::vector<py::ssize_t> shape, strides;  // strides in bytes
  char kind = 'f';
  int size = 4;
  detect::Memory memory = detect::Memory::host;
};

// Of anything that has one of the three. Throws TypeError, which names the argument, for what has none.
Given given(const py::object& object, const char* name);

bool is_float(const Given& g, int size);

// As numbers of this kind ('f', 'u', 'i') and size with the last axis contiguous. On the host anything that
// NumPy can convert is converted; a device array must come as it is wanted. Throws TypeError or ValueError.
void convert(Given& g, const char* name, char kind, int size, bool contiguous);

// One byte each, 0 or not, of booleans or whole numbers; the same rules.
void convert_flags(Given& g, const char* name);

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
