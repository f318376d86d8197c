// SPDX-License-Identifier: GPL-3.0-or-later
// The Python names Cluster, load, pad and pad_file.
#include <pybind11/numpy.h>
#include <pybind11/stl/filesystem.h>

#include <cerrno>
#include <cmath>
#include <map>
#include <optional>

#include "padding/asset/error.h"
#include "padding/export/export.h"
#include "padding/import/import.h"
#include "padding/pad.h"
#include "padding/robot.h"
#include "tools/python/arguments.h"
#include "tools/python/arrays.h"
#include "tools/python/interruptible.h"
#include "tools/python/module.h"

namespace padder::python {

using namespace pybind11::literals;

namespace {

double number_of(const py::object& given, const char* name) {
  const double value = PyFloat_AsDouble(given.ptr());
  if (PyErr_Occurred()) {
    const bool large = PyErr_ExceptionMatches(PyExc_OverflowError);
    PyErr_Clear();
    if (large) throw py::value_error(std::string(name) + " is beyond what a float holds");
    throw py::type_error(std::string(name) + " must be a number");
  }
  if (!std::isfinite(value)) throw py::value_error(std::string(name) + " must be finite");
  return value;
}

// A length from Python: a number in the mesh's unit, or text such as "1%", a fraction of the mesh's diagonal.
Length length_of(const py::object& given, const char* name) {
  if (given.is_none()) return {};
  if (py::isinstance<py::str>(given)) {
    const auto length = padder::length_of(py::cast<std::string>(given));
    if (length && length->is_share()) return *length;
    throw py::value_error(std::string(name) +
                          " must be a positive number, or a share of the diagonal as \"1%\"");
  }
  const double value = number_of(given, name);
  if (!(value > 0)) throw py::value_error(std::string(name) + " must be positive");
  return Length::of(value);
}

// A length that may be 0, such as an error that is not allowed at all.
std::optional<Length> error_of(const py::object& given, const char* name) {
  if (given.is_none()) return std::nullopt;
  if (!py::isinstance<py::str>(given) && number_of(given, name) == 0) return Length::of(0);
  return length_of(given, name);
}

template <class Index>
void append_faces(Mesh& mesh, const Array& faces) {
  const auto count = static_cast<std::size_t>(faces.shape[0]);
  mesh.triangles.resize(count);
  for (std::size_t k = 0; k < 3 * count; k++) {
    const Index v = faces.as<Index>()[k];
    if (v < Index(0) || static_cast<std::uint64_t>(v) >= mesh.points.size())
      throw py::index_error("face " + std::to_string(k / 3) +
                            " names a vertex that does not exist: there are " +
                            std::to_string(mesh.points.size()));
    mesh.triangles[k / 3][k % 3] = static_cast<std::uint32_t>(v);
  }
}

Mesh mesh_of(const py::object& given_vertices, const py::object& given_faces) {
  const Array vertices = array_of(given_vertices, {"vertices", Contract::Kind::wide, {kAny, 3}, "(N, 3)"});
  const Array faces = array_of(given_faces, {"faces", Contract::Kind::whole, {kAny, 3}, "(M, 3)"});
  if (vertices.memory != detect::Memory::host || faces.memory != detect::Memory::host)
    throw py::type_error("vertices and faces must lie on the host");
  Mesh mesh;
  for (py::ssize_t k = 0; k < vertices.shape[0]; k++) {
    const double* v = vertices.as<double>() + 3 * k;
    mesh.points.emplace_back(v[0], v[1], v[2]);
    if (!mesh.points.back().allFinite())
      throw py::value_error("vertex " + std::to_string(k) + " is not finite");
  }
  if (faces.kind == 'u')
    append_faces<std::uint64_t>(mesh, faces);
  else
    append_faces<std::int64_t>(mesh, faces);
  return mesh;
}

// Throws the error that Python's open() throws for a file that does not exist.
void need_file(const std::filesystem::path& path) {
  std::error_code code;
  if (std::filesystem::exists(path, code)) return;
  errno = ENOENT;
  PyErr_SetFromErrnoWithFilename(PyExc_FileNotFoundError, path.c_str());
  throw py::error_already_set();
}

void need_unit(const std::string& unit) {
  try {
    metres(unit);
  } catch (const Error& e) {
    throw py::value_error(e.what());
  }
}

// What the option of this name is given as.
template <class T>
T cast_of(const py::object& given, const std::string& name) {
  try {
    return py::cast<T>(given);
  } catch (const py::cast_error&) {
    throw py::type_error(name + " must not be of the type " +
                         py::str(py::type::of(given)).cast<std::string>());
  }
}

// The options that are given by their names only.
void take_more(PadOptions& o, const py::kwargs& more) {
  const std::map<std::string, Length*> lengths = {{"min_radius", &o.min_radius},
                                                  {"max_radius", &o.max_radius},
                                                  {"reach", &o.min_grain_radius},
                                                  {"thickness", &o.thickness}};
  for (const auto& [key, given] : more) {
    const auto name = py::cast<std::string>(key);
    const auto value = py::reinterpret_borrow<py::object>(given);
    if (name == "balance") {
      o.balance = named(kBalances, cast_of<std::string>(value, name),
                        "balance must be \"none\", \"volume\" or \"mean\"");
    } else if (name == "effort") {
      o.effort = cast_of<Whole<"effort", int>>(value, name);
    } else if (name == "smooth") {
      o.smooth = number_of(value, "smooth");
    } else if (name == "lod") {
      if (py::isinstance<py::str>(value) || !py::isinstance<py::iterable>(value))
        throw py::type_error("lod must be a list of tolerances, as [\"2%\", \"1%\"]");
      for (const auto& rung : value)
        o.lod.push_back(length_of(py::reinterpret_borrow<py::object>(rung), "lod"));
    } else if (const auto found = lengths.find(name); found != lengths.end()) {
      *found->second = length_of(value, found->first.c_str());
    } else if (name == "force") {
      o.force = cast_of<bool>(value, name);
    } else {
      throw py::type_error("padding has no option \"" + name + '"');
    }
  }
}

PadOptions options_of(const py::object& depth, const py::object& tolerance, const py::object& edge_length,
                      std::uint64_t max_spheres, double sharp_angle, const std::string& repair,
                      std::uint32_t family, std::uint32_t mask, const py::object& protrusion,
                      const py::object& gap, const py::kwargs& more) {
  PadOptions o;
  take_more(o, more);
  o.protrusion = error_of(protrusion, "protrusion"), o.gap = error_of(gap, "gap");
  if (!depth.is_none()) o.depth_ratio = number_of(depth, "depth");
  if (!std::isfinite(sharp_angle)) throw py::value_error("sharp_angle must be finite");
  o.tolerance = length_of(tolerance, "tolerance");
  o.edge_length = length_of(edge_length, "edge_length");
  o.max_spheres = max_spheres, o.sharp_angle = sharp_angle, o.family = family, o.mask = mask;
  o.repair = named(kRepairModes, repair,
                   "repair must be \"auto\", \"union\", \"fill\", \"sheet\", \"never\" or \"wrap\"");
  try {
    check(o);
  } catch (const Error& e) {  // an argument is at fault, before any mesh is looked at
    throw py::value_error(e.what());
  }
  return o;
}

py::object from_json(const std::string& text) { return py::module_::import("json").attr("loads")(text); }

py::array vector_of(const Vector& v) {
  py::array_t<double> a(3);
  for (int k = 0; k < 3; k++) a.mutable_at(k) = v[k];
  return a;
}

void warn(const std::vector<std::string>& sentences) {
  for (const std::string& told : sentences)
    if (PyErr_WarnEx(PyExc_UserWarning, told.c_str(), 1) != 0) throw py::error_already_set();
}

void save_model(const Model& model, const std::filesystem::path& path, const std::string& format,
                double density) {
  if (!(density > 0) || !std::isfinite(density)) throw py::value_error("density must be positive");
  if (path.has_parent_path()) need_file(path.parent_path());
  if (format.empty() && path.extension() == ".json" && !model.robot())
    return write_cluster(model.bodies[0].cluster, path);
  warn(write_model(model, path, find_format(path, format), {density}));
}

// The cluster of what was padded.
std::shared_ptr<Cluster> cluster_of(Padded padded) {
  warn(padded.report.warnings);
  return std::make_shared<Cluster>(std::move(padded.cluster));
}

// The names of a cluster, and the arrays of its spheres, which are views of the cluster's memory.
void add_spheres_of(PyCluster& cluster) {
  cluster.def("__len__", &Cluster::size)
      .def("__repr__",
           [](const Cluster& c) {
             return "<padder.Cluster " + c.name + ": " + std::to_string(c.size()) + " spheres>";
           })
      .def_property(
          "name", [](const Cluster& c) { return c.name; },
          [](Cluster& c, const Text<"name">& name) { c.name = name.value; })
      .def_property(
          "unit", [](const Cluster& c) { return c.unit; },
          [](Cluster& c, const Text<"unit">& unit) { need_unit(unit), c.unit = unit.value; })
      .def_property(
          "family", [](const Cluster& c) { return c.family; },
          [](Cluster& c, Whole<"family", std::uint32_t> family) { c.family = family; })
      .def_property(
          "mask", [](const Cluster& c) { return c.mask; },
          [](Cluster& c, Whole<"mask", std::uint32_t> mask) { c.mask = mask; })
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
      .def_property_readonly("triangle", [](const py::object& self) {
        const auto& c = py::cast<const Cluster&>(self);
        return view(c.triangle.data(), {py::ssize_t(c.size())}, {8}, self);
      });
}

void add_properties_of(PyCluster& cluster) {
  cluster.def_property_readonly("volume", [](const Cluster& c) { return c.mass.volume; })
      .def_property_readonly("mass_of", [](const Cluster& c) { return name_of(c.mass_of); })
      .def_property_readonly("center_of_mass", [](const Cluster& c) { return vector_of(c.mass.center); })
      .def_property_readonly("inertia",
                             [](const Cluster& c) {
                               py::array_t<double> a({3, 3});
                               for (int i = 0; i < 3; i++)
                                 for (int j = 0; j < 3; j++) a.mutable_at(i, j) = c.mass.inertia(i, j);
                               return a;
                             })
      .def_property_readonly("accuracy", [](const Cluster& c) { return from_json(to_json(c.accuracy)); })
      .def_property_readonly("settings", [](const Cluster& c) { return from_json(c.settings); });
}

void add_cluster(py::module_& m) {
  PyCluster cluster(m, "Cluster",
                    "The spheres that cover a part, and what is proved of them. Its length is their number.");
  add_spheres_of(cluster), add_properties_of(cluster);
  add_page(cluster);
  cluster
      .def(py::pickle([](const Cluster& c) { return to_json(c); },
                      [](const std::string& text) {
                        return std::make_shared<Cluster>(cluster_from_json(text, "a pickled cluster"));
                      }))
      .def("to_json", [](const Cluster& c) { return to_json(c); })
      .def(
          "save",
          [](const Cluster& c, const std::filesystem::path& path, const Text<"format">& format,
             Real<"density"> density) { save_model(model_of(c), path, format, density); },
          "path"_a, "format"_a = "", "density"_a = 1000.0);
}

void add_load(py::module_& m) {
  m.def(
      "load",
      [](const std::filesystem::path& path, const Text<"part">& part) {
        need_file(path);
        return std::make_shared<Cluster>(read_spheres(path, part));
      },
      "path"_a, "part"_a = "",
      "Reads spheres from a .spheres.json file, or from a file of another program (docs/formats.md). part: "
      "the name of the link or clump to read.");
}

void add_pad_of_arrays(py::module_& m) {
  m.def(
      "pad",
      [](const py::object& vertices, const py::object& faces, const py::object& depth,
         const py::object& tolerance, const py::object& edge_length,
         Whole<"max_spheres", std::uint64_t> max_spheres, Real<"sharp_angle"> sharp_angle,
         const Text<"repair">& repair, Whole<"family", std::uint32_t> family,
         Whole<"mask", std::uint32_t> mask, const Text<"unit">& unit, const Text<"name">& name,
         const py::object& protrusion, const py::object& gap, const py::kwargs& more) {
        const PadOptions options = options_of(depth, tolerance, edge_length, max_spheres, sharp_angle, repair,
                                              family, mask, protrusion, gap, more);
        need_unit(unit);
        ReadResult file;
        file.mesh = given_mesh(vertices, faces);
        file.unit = unit.value, file.source.file = name.value,
        file.source.triangles = file.mesh.triangles.size();
        if (file.mesh.triangles.empty())
          throw py::value_error("faces is empty: a mesh needs at least one triangle");
        return cluster_of(interruptible([file = std::move(file), options](const PadProgress& progress) {
          return padder::pad(file, options, progress);
        }));
      },
      "vertices"_a, "faces"_a = py::none(), "depth"_a = py::none(), "tolerance"_a = py::none(),
      "edge_length"_a = py::none(), "max_spheres"_a = 0, "sharp_angle"_a = 40.0, "repair"_a = "auto",
      "family"_a = 0, "mask"_a = 0, "unit"_a = "", "name"_a = "mesh", "protrusion"_a = py::none(),
      "gap"_a = py::none(),
      R"(Covers a triangle mesh with spheres.

vertices: (N, 3) numbers in any unit; they are copied once. faces: (M, 3) whole numbers, counter-clockwise seen from outside.
depth: one sphere for each triangle; the height of its cap over the triangle's circumradius, 0 to 1. 0.2 if neither depth nor
tolerance is given.
tolerance: the fewest spheres whose protrusion and gap are proved to be within it.
protrusion, gap: each error by itself; one that is not given is the tolerance. 0 is allowed: with a gap of 0 the whole body is
inside the spheres, with a protrusion of 0 all spheres are inside the body.
balance, effort, smooth, lod, min_radius, max_radius, reach, thickness, force: by their names, as on the command line.
In place of both arrays, a mesh with .vertices and .faces may be given, such as one of trimesh.
A length (tolerance, edge_length, protrusion, gap) is a number in the mesh's unit, or a fraction of the mesh's diagonal such as "1%".
Other Python threads can run during the call. Raises padder.Error if the mesh cannot be padded.)");
}

void add_pad_of_file(py::module_& m) {
  m.def(
      "pad_file",
      [](const std::filesystem::path& path, const py::object& depth, const py::object& tolerance,
         const py::object& edge_length, Whole<"max_spheres", std::uint64_t> max_spheres,
         Real<"sharp_angle"> sharp_angle, const Text<"repair">& repair, Whole<"family", std::uint32_t> family,
         Whole<"mask", std::uint32_t> mask, const Text<"unit">& unit, Real<"scale"> scale,
         const py::object& protrusion, const py::object& gap, const py::kwargs& more) {
        const PadOptions options = options_of(depth, tolerance, edge_length, max_spheres, sharp_angle, repair,
                                              family, mask, protrusion, gap, more);
        need_unit(unit), need_file(path);
        if (!(scale > 0) || !std::isfinite(scale)) throw py::value_error("scale must be positive");
        return cluster_of(interruptible([=](const PadProgress& progress) {
          return padder::pad_file(path, {scale, unit}, options, progress);
        }));
      },
      "path"_a, "depth"_a = py::none(), "tolerance"_a = py::none(), "edge_length"_a = py::none(),
      "max_spheres"_a = 0, "sharp_angle"_a = 40.0, "repair"_a = "auto", "family"_a = 0, "mask"_a = 0,
      "unit"_a = "", "scale"_a = 1.0, "protrusion"_a = py::none(), "gap"_a = py::none(),
      "Reads a mesh file and pads it; see pad. unit: \"m\", \"cm\", \"mm\" or \"in\". scale: a factor for "
      "every coordinate.");
}

// A robot whose links are clusters.
void add_robot(py::module_& m) {
  py::class_<PaddedRobot, std::shared_ptr<PaddedRobot>>(
      m, "Robot", "A robot whose links are clusters. Its length is the number of spheres.")
      .def_property_readonly("name", [](const PaddedRobot& r) { return r.model.name; })
      .def_property_readonly("links",
                             [](const PaddedRobot& r) {
                               std::map<std::string, std::shared_ptr<Cluster>> links;
                               for (const Body& b : r.model.bodies)
                                 if (b.cluster.size() > 0)
                                   links[b.name] = std::make_shared<Cluster>(b.cluster);
                               return links;
                             })
      .def_property_readonly(
          "apart",
          [](const PaddedRobot& r) {
            py::list pairs;
            for (const Apart& p : r.model.apart)
              pairs.append(py::make_tuple(r.model.bodies[p.a].name, r.model.bodies[p.b].name, p.reason));
            return pairs;
          })
      .def_property_readonly("notes", [](const PaddedRobot& r) { return r.notes; })
      .def("__len__", [](const PaddedRobot& r) { return r.model.spheres(); })
      .def("__repr__",
           [](const PaddedRobot& r) {
             return "<padder.Robot " + r.model.name + ": " + std::to_string(r.model.spheres()) + " spheres>";
           })
      .def(
          "save",
          [](const PaddedRobot& r, const std::filesystem::path& path, const Text<"format">& format,
             Real<"density"> density) { save_model(r.model, path, format, density); },
          "path"_a, "format"_a = "", "density"_a = 1000.0);
  m.def(
      "pad_urdf",
      [](const std::filesystem::path& path, const py::object& depth, const py::object& tolerance,
         const py::object& edge_length, Whole<"max_spheres", std::uint64_t> max_spheres,
         Whole<"robot_spheres", std::uint64_t> robot_spheres, bool visual,
         const std::vector<std::filesystem::path>& package_path, Whole<"poses", int> poses,
         const Text<"repair">& repair, const py::kwargs& more) {
        const PadOptions options =
            options_of(depth, tolerance, edge_length, max_spheres, PadOptions().sharp_angle, repair, 0, 0,
                       py::none(), py::none(), more);
        need_file(path);
        RobotOptions whole;
        whole.reading.package_folders = package_path, whole.reading.visual = visual;
        whole.max_spheres = robot_spheres, whole.poses = poses;
        auto robot = interruptible([=](const PadProgress& progress) {
          return std::make_shared<PaddedRobot>(pad_robot(path, options, whole, progress));
        });
        for (const PadReport& report : robot->reports) warn(report.warnings);
        return robot;
      },
      "path"_a, "depth"_a = py::none(), "tolerance"_a = py::none(), "edge_length"_a = py::none(),
      "max_spheres"_a = 0, "robot_spheres"_a = 0, "visual"_a = false,
      "package_path"_a = std::vector<std::filesystem::path>(), "poses"_a = RobotOptions().poses,
      "repair"_a = "auto",
      "Pads every link of a URDF; options of padding as in pad, for each link by itself. robot_spheres: the "
      "smallest tolerance for so many spheres in all. save writes any format for robots (docs/formats.md).");
}

}  // namespace

Mesh given_mesh(const py::object& vertices, const py::object& faces) {
  const bool is_mesh = faces.is_none() && py::hasattr(vertices, "vertices") && py::hasattr(vertices, "faces");
  if (faces.is_none() && !is_mesh)
    throw py::type_error(
        "faces must be given, or a mesh with .vertices and .faces in place of both; pad_file takes a file");
  return is_mesh ? mesh_of(vertices.attr("vertices"), vertices.attr("faces")) : mesh_of(vertices, faces);
}

void add_pad(py::module_& m) {
  m.def("_finish", [] {
    const py::gil_scoped_release release;
    constexpr int most = 300;  // tenths of a second: meshing is not interrupted
    for (int k = 0; k < most && at_work() > 0; k++)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
  });
  add_cluster(m);
  add_robot(m);
  add_load(m);
  add_pad_of_arrays(m);
  add_pad_of_file(m);
}

}  // namespace padder::python
