// padder::detect on NumPy and GPU arrays.
#include <memory>

#include "tools/python/arrays.h"
#include "tools/python/module.h"

namespace padder::python {

using namespace pybind11::literals;

namespace {

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

void add_detect(py::module_& m) {
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

}  // namespace padder::python
