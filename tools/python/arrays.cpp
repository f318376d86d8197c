// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/python/arrays.h"

#include <algorithm>
#include <optional>

#include "tools/python/module.h"

namespace padder::python {

using namespace pybind11::literals;

namespace {

// DLPack's structs, version 0 (dmlc.github.io/dlpack/latest/c_api.html).
struct DlTensor {
  void* data;
  std::int32_t device_type, device;  // 1: host, 2: CUDA
  std::int32_t ndim;
  std::uint8_t code, bits;  // 0 int, 1 unsigned, 2 float
  std::uint16_t lanes;
  std::int64_t *shape, *strides;
  std::uint64_t byte_offset;
};
struct DlManaged {
  DlTensor tensor;
  void* context;
  void (*deleter)(DlManaged*);
};

using Kind = Contract::Kind;

std::string named(const char* name, const std::string& what) { return std::string(name) + " " + what; }

std::string text_of(const py::handle& object) { return py::cast<std::string>(py::str(object)); }

std::vector<py::ssize_t> packed_strides(const std::vector<py::ssize_t>& shape, py::ssize_t size) {
  std::vector<py::ssize_t> strides(shape.size(), size);
  for (std::size_t k = shape.size(); k-- > 1;) strides[k - 1] = strides[k] * shape[k];
  return strides;
}

bool empty(const Array& a) { return std::find(a.shape.begin(), a.shape.end(), 0) != a.shape.end(); }

// Can it be read where it lies? The detector takes strides as 32-bit counts of numbers.
bool layout_fits(const Array& a, bool rows) {
  const std::vector<py::ssize_t> packed = packed_strides(a.shape, a.size);
  for (std::size_t k = 0; k < a.shape.size(); k++) {
    if (a.shape[k] <= 1 || a.strides[k] == packed[k]) continue;
    const bool outermost = k == 0 && rows;
    if (!outermost || a.strides[k] < packed[k] || a.strides[k] % a.size != 0 ||
        a.strides[k] / a.size > 0xffffffffll)
      return false;
  }
  return true;
}

bool type_fits(const Array& a, Kind kind) {
  switch (kind) {
    case Kind::real:
      return a.kind == 'f' && (a.size == 4 || a.size == 8);
    case Kind::wide:
      return a.kind == 'f' && a.size == 8;
    case Kind::bits:
      return a.kind == 'u' && a.size == 4;
    case Kind::whole:
      return (a.kind == 'u' || a.kind == 'i') && a.size == 8;
    case Kind::flags:
      return (a.kind == 'b' || a.kind == 'u' || a.kind == 'i') && a.size == 1;
  }
  return false;
}

const char* type_said(Kind kind) {
  constexpr const char* said[] = {"float32 or float64", "float64", "uint32", "int64 or uint64",
                                  "bool, uint8 or int8"};
  return said[static_cast<std::size_t>(kind)];
}

// What the interface says under `key`, as a T.
template <class T>
T interface_entry(const py::dict& interface, const char* key, const char* name) {
  try {
    return interface[key].template cast<T>();
  } catch (const std::exception&) {  // no such key, or something of another type under it
  }
  throw py::type_error(named(name, std::string("has a __cuda_array_interface__ whose \"") + key +
                                       "\" is missing or of another type: it needs \"shape\", \"typestr\" "
                                       "and \"data\""));
}

Array from_cuda(const py::object& object, const char* name) {
  const py::object interface = object.attr("__cuda_array_interface__");
  if (!py::isinstance<py::dict>(interface))
    throw py::type_error(named(name, "has a __cuda_array_interface__ that is no dict"));
  const auto d = py::reinterpret_borrow<py::dict>(interface);
  using Counts = std::vector<py::ssize_t>;
  const auto type = interface_entry<std::string>(d, "typestr", name);
  if (type.size() < 3 || type.size() > 4 || type.find_first_not_of("0123456789", 2) != type.npos ||
      type[0] == '>')
    throw py::type_error(named(name, "on a device must be little-endian numbers, not " + type));
  if (d.contains("mask") && !d["mask"].is_none())
    throw py::value_error(named(name, "on a device has a mask: masked arrays cannot be read there"));
  Array a;
  a.keep = object, a.memory = detect::Memory::device;
  const auto [address, read_only] = interface_entry<std::pair<std::uintptr_t, bool>>(d, "data", name);
  a.data = reinterpret_cast<const char*>(address);
  a.kind = type[1], a.size = std::stoi(type.substr(2));
  a.shape = interface_entry<Counts>(d, "shape", name);
  const bool told = d.contains("strides") && !d["strides"].is_none();
  a.strides = told ? interface_entry<Counts>(d, "strides", name) : packed_strides(a.shape, a.size);
  if (a.strides.size() != a.shape.size())
    throw py::value_error(named(name, "must have one stride for each dimension"));
  if (std::ranges::any_of(a.shape, [](py::ssize_t n) { return n < 0; }))
    throw py::value_error(named(name, "must have no dimension below 0"));
  return a;
}

// An array in host memory as a NumPy array, so that it is treated like any other.
py::object host_view(const Array& a) {
  const std::string type = std::string(1, a.kind) + std::to_string(a.size);
  return py::array(py::dtype(type), a.shape, a.strides, a.data, a.keep);
}

Array from_dlpack(const py::object& object, const char* name) {
  const py::object capsule = object.attr("__dlpack__")();
  if (!PyCapsule_IsValid(capsule.ptr(), "dltensor"))
    throw py::type_error(named(name, "has a __dlpack__ that gives no fresh capsule of DLPack"));
  auto* managed = static_cast<DlManaged*>(PyCapsule_GetPointer(capsule.ptr(), "dltensor"));
  PyCapsule_SetName(capsule.ptr(), "used_dltensor");  // it is now ours to delete
  Array a;
  a.keep = py::capsule(managed, [](void* m) {
    if (auto* d = static_cast<DlManaged*>(m); d->deleter) d->deleter(d);
  });
  const DlTensor& t = managed->tensor;
  const bool host = t.device_type == 1 || t.device_type == 3;  // 3: host memory that a device reads
  if (!host && t.device_type != 2 && t.device_type != 13)      // 13: memory that wanders
    throw py::type_error(named(name, "must lie on the host or on a CUDA device"));
  static constexpr char kinds[] = {'i', 'u', 'f', 0, 0, 0, 'b'};  // by DLPack's codes
  a.kind = t.code < sizeof kinds ? kinds[t.code] : '\0';
  if (!a.kind || t.lanes != 1 || t.bits % 8 != 0)
    throw py::type_error(named(name, "must be whole numbers, floats or booleans"));
  a.memory = host ? detect::Memory::host : detect::Memory::device;
  a.data = static_cast<const char*>(t.data) + t.byte_offset;
  a.size = t.bits / 8;
  a.shape.assign(t.shape, t.shape + t.ndim);
  a.strides = packed_strides(a.shape, a.size);
  for (int k = 0; t.strides && k < t.ndim; k++)
    a.strides[static_cast<std::size_t>(k)] = t.strides[k] * a.size;
  return a;
}

Array from_numpy(const py::array& array) {
  Array a;
  a.keep = array, a.data = static_cast<const char*>(array.data());
  a.shape.assign(array.shape(), array.shape() + array.ndim());
  a.strides.assign(array.strides(), array.strides() + array.ndim());
  a.kind = array.dtype().kind(), a.size = static_cast<int>(array.itemsize());
  return a;
}

// A sequence that NumPy takes entry by entry.
bool is_list(PyObject* o) {
  if (PyList_Check(o) || PyTuple_Check(o)) return true;
  return PySequence_Check(o) && PyObject_HasAttrString(o, "__len__") && !PyUnicode_Check(o) &&
         !PyObject_CheckBuffer(o) && !PyObject_HasAttrString(o, "__array__");
}

// Calls use(entry) for each entry, and for each entry of a list in it, until it returns true.
template <class Use>
bool any_entry(const py::handle& list, Use use, int depth = 1) {
  constexpr int most = 2;  // dimensions of any argument
  std::size_t left = py::len(list);
  for (const py::handle entry : list) {
    if (left-- == 0) throw py::type_error("a sequence has more entries than its length says");  // or no end
    if (depth < most && is_list(entry.ptr()) ? any_entry(entry, use, depth + 1) : use(entry)) return true;
  }
  return false;
}

// Whole numbers for which NumPy has no type in common become objects, or floats.
bool only_whole_numbers(const py::object& object) {
  const auto other = [](const py::handle& e) { return !PyLong_Check(e.ptr()) || PyBool_Check(e.ptr()); };
  return is_list(object.ptr()) ? !any_entry(object, other) : !other(object);
}

// numpy.asarray(), but an error for masked entries, whose mask NumPy would silently drop: also of arrays in a
// list of rows, and of what an object's __array__ gives.
py::array numpy_array(const py::object& object, const char* name) {
  const py::module_ np = py::module_::import("numpy"), ma = py::module_::import("numpy.ma");
  const py::object type = ma.attr("MaskedArray");
  const auto masked = [&](const py::handle& entry) {
    return !PyFloat_CheckExact(entry.ptr()) && py::isinstance(entry, type) &&
           py::cast<bool>(ma.attr("is_masked")(entry));
  };
  try {
    if (!is_list(object.ptr()) || !any_entry(object, masked)) {
      const py::object array = np.attr("asanyarray")(object);
      if (!masked(array)) return np.attr("asarray")(array);
    }
  } catch (py::error_already_set& e) {
    // Ctrl-C and too little memory are no fault of the argument.
    if (!e.matches(PyExc_Exception) || e.matches(PyExc_MemoryError)) throw;
    py::raise_from(e, PyExc_TypeError, named(name, "is not an array of numbers").c_str());
    throw py::error_already_set();
  }
  throw py::value_error(named(name, "has masked entries: fill them or remove them"));
}

void check_type(const py::object& given, const py::array& a, const Contract& wanted) {
  const char kind = a.dtype().kind();
  const bool whole = kind == 'i' || kind == 'u', flag = whole || kind == 'b', real = flag || kind == 'f';
  const bool reals = wanted.kind == Kind::real || wanted.kind == Kind::wide;
  if (a.size() == 0 ? real : reals ? real : wanted.kind == Kind::flags ? flag : whole)
    return;  // an empty list has no type of its own
  if (only_whole_numbers(given))
    throw py::value_error(named(wanted.name, "has whole numbers that no type of NumPy holds together"));
  throw py::type_error(named(wanted.name, std::string("must be ") +
                                              (reals                        ? "real numbers"
                                               : wanted.kind == Kind::flags ? "booleans or whole numbers"
                                                                            : "whole numbers") +
                                              ", not " + text_of(a.dtype())));
}

// The array with numbers of the wanted type and layout, aligned and in native byte order. If it is so
// already, itself.
py::array converted(const py::array& a, const Contract& wanted) {
  const char kind = a.dtype().kind();
  if (wanted.kind == Kind::bits && a.size() > 0) {
    const py::object low = a.attr("min")(), high = a.attr("max")();  // NumPy's own: exact beyond 2^53
    if (py::int_(low) < py::int_(0) || py::int_(high) > py::int_(4294967295))
      throw py::value_error(named(wanted.name, "must be from 0 to 4294967295"));
  }
  const char* type = wanted.kind == Kind::real    ? (kind == 'f' && a.itemsize() == 4 ? "f4" : "f8")
                     : wanted.kind == Kind::wide  ? "f8"
                     : wanted.kind == Kind::bits  ? "u4"
                     : wanted.kind == Kind::whole ? (kind == 'u' ? "u8" : "i8")
                                                  : "?";
  const py::dtype target{std::string(type)};
  const bool aligned = py::cast<bool>(a.attr("flags").attr("aligned"));
  // Any type of one byte will do for flags, because they are read as 0 or not 0.
  const bool same =
      wanted.kind == Kind::flags ? type_fits(from_numpy(a), wanted.kind) : a.dtype().equal(target);
  if (same && aligned && layout_fits(from_numpy(a), wanted.rows)) return a;
  return a.attr("astype")(target,
                          "order"_a = "C");  // not ascontiguousarray, which makes a number a list of one
}

bool shape_fits(const Array& a, const Contract& wanted) {
  if (a.one() && wanted.number) return true;
  if (a.shape.size() != wanted.shape.size()) return false;
  for (std::size_t k = 0; k < a.shape.size(); k++)
    if (wanted.shape[k] != kAny && a.shape[k] != wanted.shape[k]) return false;
  return true;
}

}  // namespace

Array array_of(const py::object& object, const Contract& wanted) {
  py::object host = object;
  std::optional<Array> other;
  if (py::hasattr(object, "__cuda_array_interface__"))
    other = from_cuda(object, wanted.name);
  else if (!py::isinstance<py::array>(object) && py::hasattr(object, "__dlpack__"))
    other = from_dlpack(object, wanted.name);
  if (other && other->memory == detect::Memory::host) host = host_view(*other), other.reset();
  Array a;
  if (other) {
    a = *other;
  } else {
    py::array array = numpy_array(host, wanted.name);
    check_type(host, array, wanted);
    if (array.ndim() == 1 && array.size() == 0 && wanted.shape.size() == 2)
      array =
          array.reshape({py::ssize_t{0}, wanted.shape[1]});  // an empty list has no rows to tell their length
    a = from_numpy(array);
  }
  if (!shape_fits(a, wanted))
    throw py::value_error(named(wanted.name, std::string("must be of the shape ") + wanted.said +
                                                 ", and not " + text_of(py::tuple(py::cast(a.shape)))));
  if (a.memory == detect::Memory::host)
    return from_numpy(converted(py::reinterpret_borrow<py::array>(a.keep), wanted));
  if (!empty(a) && (!type_fits(a, wanted.kind) || !layout_fits(a, wanted.rows)))
    throw py::type_error(
        named(wanted.name, std::string("on a device must be ") + type_said(wanted.kind) +
                               (wanted.rows ? " with its last axis contiguous" : ", contiguous")));
  return a;
}

void convert_real(Array& array, const char* name, int size) {
  if (array.size == size) return;
  if (array.memory == detect::Memory::device)
    throw py::type_error(
        named(name, "on a device must be of the type of the other arrays, float" + std::to_string(8 * size)));
  array = from_numpy(array.keep.attr("astype")(py::dtype(size == 4 ? "f4" : "f8"), "order"_a = "C"));
}

py::dict DeviceArray::interface() const {
  std::vector<std::int64_t> bytes;
  for (const std::int64_t s : strides_) bytes.push_back(s * size_);
  return py::dict(
      "version"_a = 3, "typestr"_a = std::string("<") + kind_ + std::to_string(size_),
      "shape"_a = py::tuple(py::cast(shape_)), "strides"_a = py::tuple(py::cast(bytes)),
      // Not marked as read-only, although it must not be written to: PyTorch refuses read-only arrays.
      "data"_a = py::make_tuple(reinterpret_cast<std::uintptr_t>(data_), false));
}

py::capsule DeviceArray::dlpack(const py::object&, const py::object&, const py::object& where,
                                const py::object& copy) const {
  if (!copy.is_none() && py::cast<bool>(copy))
    throw py::buffer_error("padder does not copy its arrays: copy=True is not possible");
  if (!where.is_none() && !device().equal(where))
    throw py::buffer_error("padder does not move its arrays to another device");
  struct Context {
    py::object owner;
    std::vector<std::int64_t> shape, strides;
    DlManaged managed;
  };
  auto* c = new Context{owner_, shape_, strides_, {}};
  c->managed.tensor = {const_cast<void*>(data_),
                       2,
                       device_,
                       static_cast<std::int32_t>(shape_.size()),
                       static_cast<std::uint8_t>(kind_ == 'f' ? 2 : 1),
                       static_cast<std::uint8_t>(8 * size_),
                       1,
                       c->shape.data(),
                       c->strides.data(),
                       0};
  c->managed.context = c;
  c->managed.deleter = [](DlManaged* m) {
    const py::gil_scoped_acquire gil;
    delete static_cast<Context*>(m->context);
  };
  return py::reinterpret_steal<py::capsule>(PyCapsule_New(&c->managed, "dltensor", [](PyObject* capsule) {
    if (!PyCapsule_IsValid(capsule, "dltensor")) return;  // a consumer owns it now
    auto* m = static_cast<DlManaged*>(PyCapsule_GetPointer(capsule, "dltensor"));
    m->deleter(m);
  }));
}

void add_arrays(py::module_& m) {
  py::class_<DeviceArray>(
      m, "DeviceArray",
      "An array in the memory of a GPU, which CuPy, PyTorch and others take as it is. Do not write to it.")
      .def_property_readonly("__cuda_array_interface__", &DeviceArray::interface)
      .def_property_readonly("shape", &DeviceArray::shape)
      .def("__dlpack__", &DeviceArray::dlpack, py::kw_only(), "stream"_a = py::none(),
           "max_version"_a = py::none(), "dl_device"_a = py::none(), "copy"_a = py::none())
      .def("__dlpack_device__", &DeviceArray::device);
}

}  // namespace padder::python
