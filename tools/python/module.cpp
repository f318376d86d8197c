// The Python module padder._core: padder::pad and the detector on NumPy and GPU arrays. Its words:
// padder/__init__.pyi.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "detect/detector.h"
#include "padding/error.h"
#include "padding/export/export.h"
#include "padding/export/import.h"
#include "padding/pad.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace {

using namespace padder;

// A number is in the mesh's unit, "1%" a share of its diagonal.
Length length_of(const py::object& given, const char* name) {
  if (given.is_none()) return {};
  if (py::isinstance<py::str>(given)) {
    const std::string text = py::cast<std::string>(given);
    try {
      std::size_t end = 0;
      const double value = std::stod(text, &end);
      if (text.substr(end) == "%" && value > 0) return {value / 100, true};
    } catch (const std::logic_error&) {
    }
    throw py::value_error(std::string(name) +
                          " must be a positive number, or a share of the diagonal as \"1%\"");
  }
  const double value = py::cast<double>(given);
  if (!(value > 0)) throw py::value_error(std::string(name) + " must be positive");
  return {value, false};
}

template <class Index>
void append_faces(Mesh& mesh, const py::array& given) {
  const auto faces = py::cast<py::array_t<Index, py::array::c_style | py::array::forcecast>>(given);
  const auto f = faces.template unchecked<2>();
  mesh.triangles.reserve(static_cast<std::size_t>(f.shape(0)));
  for (py::ssize_t k = 0; k < f.shape(0); k++) {
    std::array<std::uint32_t, 3> t;
    for (int c = 0; c < 3; c++) {
      if (static_cast<std::int64_t>(f(k, c)) < 0 || static_cast<std::uint64_t>(f(k, c)) >= mesh.points.size())
        throw py::index_error("face " + std::to_string(k) + " names a vertex that is not there");
      t[static_cast<std::size_t>(c)] = static_cast<std::uint32_t>(f(k, c));
    }
    mesh.triangles.push_back(t);
  }
}

Mesh mesh_of(const py::object& given_vertices, const py::object& given_faces) {
  const py::array vertices = py::array::ensure(given_vertices), faces = py::array::ensure(given_faces);
  if (!vertices || !faces) throw py::type_error("vertices and faces must be arrays");
  if (vertices.ndim() != 2 || vertices.shape(1) != 3)
    throw py::value_error("vertices must be of the shape (N, 3)");
  if (faces.ndim() != 2 || faces.shape(1) != 3) throw py::value_error("faces must be of the shape (M, 3)");
  if (faces.dtype().kind() != 'i' && faces.dtype().kind() != 'u')
    throw py::type_error("faces must be whole numbers");
  Mesh mesh;
  const auto points = py::cast<py::array_t<double, py::array::c_style | py::array::forcecast>>(vertices);
  const auto v = points.unchecked<2>();
  for (py::ssize_t k = 0; k < v.shape(0); k++) {
    mesh.points.emplace_back(v(k, 0), v(k, 1), v(k, 2));
    if (!mesh.points.back().allFinite())
      throw py::value_error("vertex " + std::to_string(k) + " is not finite");
  }
  if (faces.dtype().kind() == 'u')
    append_faces<std::uint64_t>(mesh, faces);
  else
    append_faces<std::int64_t>(mesh, faces);
  return mesh;
}

PadOptions options_of(const py::object& depth, const py::object& tolerance, const py::object& edge_length,
                      std::uint64_t max_spheres, double sharp_angle, const std::string& repair,
                      std::uint32_t family, std::uint32_t mask) {
  PadOptions o;
  if (!depth.is_none()) o.depth = py::cast<double>(depth);
  o.tolerance = length_of(tolerance, "tolerance");
  o.edge_length = length_of(edge_length, "edge_length");
  o.max_spheres = max_spheres, o.sharp_angle = sharp_angle, o.family = family, o.mask = mask;
  if (repair == "never")
    o.repair = RepairMode::never;
  else if (repair == "wrap")
    o.repair = RepairMode::wrap;
  else if (repair != "auto")
    throw py::value_error("repair must be \"auto\", \"never\" or \"wrap\"");
  return o;
}

// A view of memory that `owner` keeps alive; not to be written to.
template <class T>
py::array view(const T* data, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
               const py::handle& owner) {
  static const T none{};
  py::array a(py::dtype::of<T>(), std::move(shape), std::move(strides), data ? data : &none, owner);
  a.attr("flags").attr("writeable") = false;
  return a;
}

py::object from_json(const std::string& text) { return py::module_::import("json").attr("loads")(text); }

py::array vector_of(const Vector& v) {
  py::array_t<double> a(3);
  for (int k = 0; k < 3; k++) a.mutable_at(k) = v[k];
  return a;
}

// ---- Arrays on either side: NumPy's buffers, __cuda_array_interface__, DLPack.

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

struct Given {
  py::object keep;  // what owns the memory while detect runs
  const char* data = nullptr;
  std::vector<py::ssize_t> shape, strides;  // strides in bytes
  char kind = 'f';
  int size = 4;
  detect::Memory memory = detect::Memory::host;
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

// On the host anything that NumPy can convert is converted; a device array must come as it is wanted.
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

  py::dict interface() const {
    std::vector<std::int64_t> bytes;
    for (const std::int64_t s : strides_) bytes.push_back(s * size_);
    return py::dict("version"_a = 3, "typestr"_a = std::string("<") + kind_ + std::to_string(size_),
                    "shape"_a = py::tuple(py::cast(shape_)), "strides"_a = py::tuple(py::cast(bytes)),
                    "data"_a = py::make_tuple(reinterpret_cast<std::uintptr_t>(data_), true));
  }
  py::tuple shape() const { return py::tuple(py::cast(shape_)); }
  py::tuple device() const { return py::make_tuple(2, device_); }

  py::capsule dlpack(const py::object&) const {
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

 private:
  py::object owner_;
  const void* data_;
  std::vector<std::int64_t> shape_, strides_;  // strides in entries
  char kind_;
  int size_, device_;
};

// Keeps the detector: its memory is what the arrays show.
struct PyContacts {
  std::unique_ptr<detect::Detector> detector;
  detect::Contacts contacts;
  int device = 0;

  template <class T>
  static py::object array(const py::object& self, const void* data, std::int64_t columns, std::int64_t row,
                          std::int64_t first) {
    const auto& me = py::cast<const PyContacts&>(self);
    const auto n = static_cast<std::int64_t>(me.contacts.count);
    const T* at = data ? static_cast<const T*>(data) + first : nullptr;
    if (me.contacts.memory == detect::Memory::device) {
      std::vector<std::int64_t> shape{n}, strides{row};
      if (columns > 1) shape.push_back(columns), strides.push_back(1);
      return py::cast(DeviceArray(self, at, shape, strides, std::is_floating_point_v<T> ? 'f' : 'u',
                                  sizeof(T), me.device));
    }
    std::vector<py::ssize_t> shape{n}, strides{static_cast<py::ssize_t>(row * sizeof(T))};
    if (columns > 1) shape.push_back(columns), strides.push_back(sizeof(T));
    return view(at, shape, strides, self);
  }
  static py::object pairs(const py::object& self) {
    return array<std::uint32_t>(self, py::cast<const PyContacts&>(self).contacts.pairs, 2, 2, 0);
  }
  static py::object reals(const py::object& self, const void* data, const char* what, std::int64_t columns,
                          std::int64_t row, std::int64_t first) {
    const auto& c = py::cast<const PyContacts&>(self).contacts;
    if (!data && c.count) throw py::attribute_error(std::string(what) + " were not asked for: see `width`");
    return c.scalar == detect::Scalar::f32 ? array<float>(self, data, columns, row, first)
                                           : array<double>(self, data, columns, row, first);
  }
};

PyContacts detect_spheres(const py::object& centers, const py::object& radii, const py::object& family,
                          const py::object& mask, const std::string& width, const std::string& backend,
                          const std::string& precision, int threads, int device) {
  Given c = given(centers, "centers"), r = given(radii, "radii");
  if (c.shape.size() != 2 || c.shape[1] != 3) throw py::value_error("centers must be of the shape (N, 3)");
  const py::ssize_t n = c.shape[0];
  if (r.shape.size() > 1 || (r.shape.size() == 1 && r.shape[0] != n))
    throw py::value_error("radii must be of the shape (N,), or one number for all");
  const bool single = is_float(c, 4) && (is_float(r, 4) || r.shape.empty());
  convert(c, "centers", 'f', single ? 4 : 8, false), convert(r, "radii", 'f', single ? 4 : 8, false);
  detect::Options o;
  o.scalar = single ? detect::Scalar::f32 : detect::Scalar::f64;
  o.memory_limit = 0, o.threads = threads, o.device = device;
  if (width == "pairs")
    o.width = detect::Width::pairs;
  else if (width == "points")
    o.width = detect::Width::points;
  else if (width != "normals")
    throw py::value_error("width must be \"pairs\", \"normals\" or \"points\"");
  if (backend == "omp")
    o.backend = detect::Choice::omp;
  else if (backend == "cuda")
    o.backend = detect::Choice::cuda;
  else if (backend != "auto")
    throw py::value_error("backend must be \"auto\", \"omp\" or \"cuda\"");
  if (precision == "fast")
    o.precision = detect::Precision::fast;
  else if (precision != "exact")
    throw py::value_error("precision must be \"exact\" or \"fast\"");
  detect::Input input;
  detect::Spheres& s = input.spheres;
  s.count = static_cast<std::uint64_t>(n), s.scalar = o.scalar, s.memory = c.memory;
  s.centers = c.data, s.radii = r.data;
  s.center_stride = static_cast<std::uint32_t>(n > 1 ? c.strides[0] / c.size : 3);
  s.radius_stride = static_cast<std::uint32_t>(r.shape.empty() ? 0 : n > 1 ? r.strides[0] / r.size : 1);
  std::vector<Given> bits;
  const auto filter = [&](const py::object& object, const char* name) -> const std::uint32_t* {
    if (object.is_none()) return nullptr;
    Given g = given(object, name);
    if (g.shape != std::vector<py::ssize_t>{n})
      throw py::value_error(std::string(name) + " must be of the shape (N,)");
    convert(g, name, 'u', 4, true);
    bits.push_back(g);
    return reinterpret_cast<const std::uint32_t*>(g.data);
  };
  s.family = filter(family, "family"), s.mask = filter(mask, "mask");
  bits.push_back(r);
  for (const Given& g : bits)
    if (g.memory != c.memory)
      throw py::value_error("all arrays must lie in one place: on the host or on the device");
  o.output = c.memory;
  if (c.memory == detect::Memory::device && backend == "auto") o.backend = detect::Choice::cuda;
  PyContacts out;
  out.device = device;
  {
    const py::gil_scoped_release release;
    out.detector = std::make_unique<detect::Detector>(o);
    out.contacts = out.detector->detect(input);
  }
  return out;
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = PADDER_VERSION;
  py::register_exception<Error>(m, "Error", PyExc_RuntimeError);

  py::class_<Cluster, std::shared_ptr<Cluster>>(m, "Cluster")
      .def("__len__", &Cluster::size)
      .def("__repr__",
           [](const Cluster& c) {
             return "<padder.Cluster " + c.name + ": " + std::to_string(c.size()) + " spheres>";
           })
      .def_readwrite("name", &Cluster::name)
      .def_readwrite("unit", &Cluster::unit)
      .def_readwrite("family", &Cluster::family)
      .def_readwrite("mask", &Cluster::mask)
      .def_readonly("volume_union", &Cluster::volume_union)
      .def_property_readonly("centers",
                             [](const py::object& self) {
                               const auto& c = py::cast<const Cluster&>(self);
                               static_assert(sizeof(Point) == 3 * sizeof(double));
                               return view(c.centers.empty() ? nullptr : c.centers[0].data(),
                                           {py::ssize_t(c.size()), 3}, {24, 8}, self);
                             })
      .def_property_readonly("radii",
                             [](const py::object& self) {
                               const auto& c = py::cast<const Cluster&>(self);
                               return view(c.radii.data(), {py::ssize_t(c.size())}, {8}, self);
                             })
      .def_property_readonly("triangle",
                             [](const py::object& self) {
                               const auto& c = py::cast<const Cluster&>(self);
                               return view(c.triangle.data(), {py::ssize_t(c.size())}, {8}, self);
                             })
      .def_property_readonly("volume", [](const Cluster& c) { return c.mass.volume; })
      .def_property_readonly("center_of_mass", [](const Cluster& c) { return vector_of(c.mass.center); })
      .def_property_readonly("inertia",
                             [](const Cluster& c) {
                               py::array_t<double> a({3, 3});
                               for (int i = 0; i < 3; i++)
                                 for (int j = 0; j < 3; j++) a.mutable_at(i, j) = c.mass.inertia(i, j);
                               return a;
                             })
      .def_property_readonly("accuracy", [](const Cluster& c) { return from_json(to_json(c.accuracy)); })
      .def_property_readonly("settings", [](const Cluster& c) { return from_json(c.settings); })
      .def("to_json", [](const Cluster& c) { return to_json(c); })
      .def(
          "save",
          [](const Cluster& c, const std::filesystem::path& path, const std::string& format, double density) {
            if (format.empty() && path.extension() == ".json")
              write_cluster(c, path);
            else
              write_model(model_of(c), path, find_format(path, format), {density});
          },
          "path"_a, "format"_a = "", "density"_a = 1000.0);

  m.def(
      "load",
      [](const std::filesystem::path& path, const std::string& part) {
        return std::make_shared<Cluster>(read_spheres(path, part));
      },
      "path"_a, "part"_a = "",
      "Spheres from a .spheres.json or another program's file (docs/formats.md); part: the link or clump "
      "wanted.");

  m.def(
      "pad",
      [](const py::object& vertices, const py::object& faces, const py::object& depth,
         const py::object& tolerance, const py::object& edge_length, std::uint64_t max_spheres,
         double sharp_angle, const std::string& repair, std::uint32_t family, std::uint32_t mask,
         const std::string& unit, const std::string& name) {
        const PadOptions options =
            options_of(depth, tolerance, edge_length, max_spheres, sharp_angle, repair, family, mask);
        metres(unit);  // a word that is no unit is refused
        ReadResult file;
        file.mesh = mesh_of(vertices, faces);
        file.unit = unit, file.source.file = name, file.source.triangles = file.mesh.triangles.size();
        if (file.mesh.triangles.empty()) throw py::value_error("there is no face");
        const py::gil_scoped_release release;
        return std::make_shared<Cluster>(padder::pad(file, options).cluster);
      },
      "vertices"_a, "faces"_a, "depth"_a = py::none(), "tolerance"_a = py::none(),
      "edge_length"_a = py::none(), "max_spheres"_a = 0, "sharp_angle"_a = 40.0, "repair"_a = "auto",
      "family"_a = 0, "mask"_a = 0, "unit"_a = "", "name"_a = "mesh",
      R"(Covers a triangle mesh with spheres.

vertices: (N, 3) numbers in any unit, copied once; faces: (M, 3) whole numbers, counter-clockwise from outside.
depth: cap height over circumradius, 0 to 1 (0.2 when nothing else is asked for): a sphere a triangle.
tolerance: the fewest spheres with protrusion and gap proved within it.
Lengths (tolerance, edge_length) are in the mesh's unit, or a share of its diagonal as "1%".
Other threads of Python run meanwhile. Raises padder.Error when the mesh cannot be padded.)");

  m.def(
      "pad_file",
      [](const std::filesystem::path& path, const py::object& depth, const py::object& tolerance,
         const py::object& edge_length, std::uint64_t max_spheres, double sharp_angle,
         const std::string& repair, std::uint32_t family, std::uint32_t mask, const std::string& unit,
         double scale) {
        const PadOptions options =
            options_of(depth, tolerance, edge_length, max_spheres, sharp_angle, repair, family, mask);
        const py::gil_scoped_release release;
        return std::make_shared<Cluster>(padder::pad_file(path, {scale, unit}, options).cluster);
      },
      "path"_a, "depth"_a = py::none(), "tolerance"_a = py::none(), "edge_length"_a = py::none(),
      "max_spheres"_a = 0, "sharp_angle"_a = 40.0, "repair"_a = "auto", "family"_a = 0, "mask"_a = 0,
      "unit"_a = "", "scale"_a = 1.0,
      "Reads a mesh file and pads it: see pad. unit: \"m\", \"cm\", \"mm\" or \"in\"; scale: on every "
      "coordinate.");

  py::class_<DeviceArray>(m, "DeviceArray")
      .def_property_readonly("__cuda_array_interface__", &DeviceArray::interface)
      .def_property_readonly("shape", &DeviceArray::shape)
      .def("__dlpack__", &DeviceArray::dlpack, "stream"_a = py::none())
      .def("__dlpack_device__", &DeviceArray::device);

  py::class_<PyContacts>(m, "Contacts")
      .def("__len__", [](const PyContacts& c) { return c.contacts.count; })
      .def_property_readonly("pairs", &PyContacts::pairs)
      .def_property_readonly("normals",
                             [](const py::object& self) {
                               return PyContacts::reals(self,
                                                        py::cast<const PyContacts&>(self).contacts.normals,
                                                        "normals", 3, 4, 0);
                             })
      .def_property_readonly("depth",
                             [](const py::object& self) {
                               return PyContacts::reals(self,
                                                        py::cast<const PyContacts&>(self).contacts.normals,
                                                        "depths", 1, 4, 3);
                             })
      .def_property_readonly("points_i",
                             [](const py::object& self) {
                               return PyContacts::reals(self,
                                                        py::cast<const PyContacts&>(self).contacts.points,
                                                        "points", 3, 6, 0);
                             })
      .def_property_readonly("points_j",
                             [](const py::object& self) {
                               return PyContacts::reals(self,
                                                        py::cast<const PyContacts&>(self).contacts.points,
                                                        "points", 3, 6, 3);
                             })
      .def_property_readonly("backend", [](const PyContacts& c) { return c.detector->backend(); })
      .def_property_readonly("hash", [](const PyContacts& c) { return c.detector->hash(); });

  m.def("detect", &detect_spheres, "centers"_a, "radii"_a, "family"_a = py::none(), "mask"_a = py::none(),
        py::kw_only(), "width"_a = "normals", "backend"_a = "auto", "precision"_a = "exact", "threads"_a = 0,
        "device"_a = 0,
        R"(Every contact of N spheres, none twice.

centers: (N, 3), radii: (N,) or one number; float32 when both are, else float64. family, mask: (N,) uint32 or None:
no contact inside one family other than 0, nor where a mask has bit family - 1 of the other side.
NumPy arrays, and device arrays through __cuda_array_interface__ or DLPack, are read where they lie; then the contacts
lie there too. They must not be written to while this runs; other threads of Python run meanwhile.
Returns Contacts whose arrays are views that keep it alive. Raises padder.Error.)");
}
