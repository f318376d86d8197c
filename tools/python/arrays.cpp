#include "tools/python/arrays.h"

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

void fill_strides(Given& g) {
  if (!g.strides.empty() || g.shape.empty()) return;
  g.strides.assign(g.shape.size(), g.size);
  for (std::size_t k = g.shape.size() - 1; k-- > 0;) g.strides[k] = g.strides[k + 1] * g.shape[k + 1];
}

Given from_cuda(const py::object& object) {
  const py::dict d = object.attr("__cuda_array_interface__");
  const std::string type = py::cast<std::string>(d["typestr"]);
  Given g;
  g.keep = object, g.memory = detect::Memory::device;
  g.data = reinterpret_cast<const char*>(py::cast<std::uintptr_t>(d["data"].cast<py::tuple>()[0]));
  g.shape = d["shape"].cast<std::vector<py::ssize_t>>();
  if (d.contains("strides") && !d["strides"].is_none())
    g.strides = d["strides"].cast<std::vector<py::ssize_t>>();
  g.kind = type.at(1), g.size = std::stoi(type.substr(2));
  return g;
}

Given from_dlpack(const py::object& object) {
  const py::object capsule = object.attr("__dlpack__")();
  auto* managed = static_cast<DlManaged*>(PyCapsule_GetPointer(capsule.ptr(), "dltensor"));
  if (!managed) throw py::error_already_set();
  PyCapsule_SetName(capsule.ptr(), "used_dltensor");  // ours to delete from now on
  Given g;
  g.keep = py::capsule(managed, [](void* m) {
    if (auto* d = static_cast<DlManaged*>(m); d->deleter) d->deleter(d);
  });
  const DlTensor& t = managed->tensor;
  if (t.device_type != 1 && t.device_type != 2)
    throw py::type_error("arrays must lie on the host or on a CUDA device");
  g.memory = t.device_type == 2 ? detect::Memory::device : detect::Memory::host;
  g.data = static_cast<const char*>(t.data) + t.byte_offset;
  g.kind = t.code == 2 ? 'f' : t.code == 1 ? 'u' : 'i', g.size = t.bits / 8;
  for (int k = 0; k < t.ndim; k++) {
    g.shape.push_back(t.shape[k]);
    if (t.strides) g.strides.push_back(t.strides[k] * g.size);
  }
  return g;
}

}  // namespace

Given given(const py::object& object, const char* name) {
  Given g;
  if (py::hasattr(object, "__cuda_array_interface__")) {
    g = from_cuda(object);
  } else if (!py::isinstance<py::array>(object) && py::hasattr(object, "__dlpack__")) {
    g = from_dlpack(object);
  } else {
    const py::array a = py::array::ensure(object);
    if (!a) throw py::type_error(std::string(name) + " is no array");
    g.keep = a, g.data = static_cast<const char*>(a.data());
    g.shape.assign(a.shape(), a.shape() + a.ndim()), g.strides.assign(a.strides(), a.strides() + a.ndim());
    g.kind = a.dtype().kind(), g.size = static_cast<int>(a.itemsize());
  }
  fill_strides(g);
  return g;
}

bool is_float(const Given& g, int size) { return g.kind == 'f' && g.size == size; }

void convert(Given& g, const char* name, char kind, int size, bool contiguous) {
  const auto row = [&] { return g.strides.empty() || g.strides.back() == g.size; };
  const auto whole = [&] {
    bool positive = true;
    for (const py::ssize_t s : g.strides) positive &= s >= 0 && s % g.size == 0;
    return positive && (g.shape.size() < 2 || row()) && (!contiguous || g.shape.size() != 1 || row());
  };
  if (g.kind == kind && g.size == size && whole()) return;
  if (g.memory == detect::Memory::device)
    throw py::type_error(std::string(name) + " on a device must be " + (kind == 'f' ? "float" : "uint") +
                         std::to_string(8 * size) + " with its last axis contiguous");
  if (!py::isinstance<py::array>(g.keep))
    throw py::type_error(std::string(name) + ": convert it to a NumPy array first");
  if (kind == 'u' && g.kind != 'u' && g.kind != 'i')
    throw py::type_error(std::string(name) + " must be whole numbers");
  const py::module_ np = py::module_::import("numpy");
  py::object a = g.keep;
  if (kind == 'u' && g.shape.size() == 1 && g.shape[0] > 0 &&
      (py::cast<double>(a.attr("min")()) < 0 || py::cast<double>(a.attr("max")()) > 4294967295.0))
    throw py::value_error(std::string(name) + " must be from 0 to 4294967295");
  g = given(np.attr("ascontiguousarray")(a, "dtype"_a = std::string(1, kind) + std::to_string(size)), name);
}

void convert_flags(Given& g, const char* name) {
  if (g.kind != 'b' && g.kind != 'u' && g.kind != 'i')
    throw py::type_error(std::string(name) + " must be booleans or whole numbers");
  if (g.size == 1 && g.shape.size() == 1 && (g.shape[0] < 2 || g.strides[0] == 1)) return;
  if (g.memory == detect::Memory::device)
    throw py::type_error(std::string(name) + " on a device must be of one byte each, contiguous");
  if (!py::isinstance<py::array>(g.keep))
    throw py::type_error(std::string(name) + ": convert it to a NumPy array first");
  g = given(py::module_::import("numpy").attr("ascontiguousarray")(g.keep, "dtype"_a = "bool"), name);
}

py::dict DeviceArray::interface() const {
  std::vector<std::int64_t> bytes;
  for (const std::int64_t s : strides_) bytes.push_back(s * size_);
  return py::dict("version"_a = 3, "typestr"_a = std::string("<") + kind_ + std::to_string(size_),
                  "shape"_a = py::tuple(py::cast(shape_)), "strides"_a = py::tuple(py::cast(bytes)),
                  // Not marked as read-only, although it is meant so: PyTorch refuses what is.
                  "data"_a = py::make_tuple(reinterpret_cast<std::uintptr_t>(data_), false));
}

py::capsule DeviceArray::dlpack(const py::object&, const py::object&, const py::object& where,
                                const py::object& copy) const {
  if (!copy.is_none() && py::cast<bool>(copy))
    throw py::buffer_error("padder lends its arrays and does not copy them");
  if (!where.is_none() && !device().equal(where))
    throw py::buffer_error("padder's arrays stay on their device");
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
    if (!PyCapsule_IsValid(capsule, "dltensor")) return;  // someone took it over
    auto* m = static_cast<DlManaged*>(PyCapsule_GetPointer(capsule, "dltensor"));
    m->deleter(m);
  }));
}

void add_arrays(py::module_& m) {
  py::class_<DeviceArray>(m, "DeviceArray")
      .def_property_readonly("__cuda_array_interface__", &DeviceArray::interface)
      .def_property_readonly("shape", &DeviceArray::shape)
      .def("__dlpack__", &DeviceArray::dlpack, py::kw_only(), "stream"_a = py::none(),
           "max_version"_a = py::none(), "dl_device"_a = py::none(), "copy"_a = py::none())
      .def("__dlpack_device__", &DeviceArray::device);
}

}  // namespace padder::python
