// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/python/bodies.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <type_traits>

#include "detect/core/errors.h"
#include "detect/scene/scene.h"
#include "padding/asset/cluster.h"
#include "tools/python/arguments.h"
#include "tools/python/arrays.h"
#include "tools/python/module.h"
#include "tools/python/unlocked.h"

namespace padder::python {

using namespace pybind11::literals;

namespace {

// `name` says in messages whose arrays they are.
std::vector<detect::Sphere> spheres_of_arrays(const py::object& shape, const std::string& name) {
  if (!py::isinstance<py::sequence>(shape) || py::len(shape) != 2)
    throw py::type_error(name + " must be a Cluster or (centers, radii)");
  const std::string centers_name = "the centers of " + name, radii_name = "the radii of " + name;
  const Array centers =
      array_of(shape[py::int_(0)], {centers_name.c_str(), Contract::Kind::wide, {kAny, 3}, "(N, 3)"});
  const py::ssize_t n = centers.shape[0];
  const Array radii =
      array_of(shape[py::int_(1)],
               {radii_name.c_str(), Contract::Kind::wide, {n}, "(N,), or one number for all", true});
  if (centers.memory != detect::Memory::host || radii.memory != detect::Memory::host)
    throw py::type_error(name + " must lie on the host");
  std::vector<detect::Sphere> spheres;
  const auto *c = centers.as<double>(), *r = radii.as<double>();
  for (py::ssize_t i = 0; i < n; i++)
    spheres.push_back({c[3 * i], c[3 * i + 1], c[3 * i + 2], r[radii.one() ? 0 : i]});
  return spheres;
}

// Reads one number for each body and calls put(body, number). T is std::uint32_t, or std::uint8_t for flags.
template <class T, class Put>
void each(const py::object& object, const char* name, std::vector<detect::Body>& bodies, Put put) {
  if (object.is_none()) return;
  const auto kind = sizeof(T) == 1 ? Contract::Kind::flags : Contract::Kind::bits;
  const auto count = static_cast<py::ssize_t>(bodies.size());
  const Array a = array_of(object, {name, kind, {count}, "(B,), one for each row of poses"});
  if (a.memory != detect::Memory::host) throw py::type_error(std::string(name) + " must lie on the host");
  for (std::size_t b = 0; b < bodies.size(); b++) put(bodies[b], a.as<T>()[b]);
}

std::shared_ptr<Bodies> bodies_of(const py::sequence& shapes, const py::object& poses,
                                  const py::object& shape, const py::object& family, const py::object& mask,
                                  const py::object& is_static, const py::object& world) {
  auto out = std::make_shared<Bodies>();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> filters;  // family and mask of each shape
  for (std::size_t k = 0; k < py::len(shapes); k++) {
    const py::object s = shapes[k];
    if (py::isinstance<Cluster>(s)) {
      const auto& c = py::cast<const Cluster&>(s);
      out->rungs.push_back(detect::rungs_of(c));
      filters.emplace_back(c.family, c.mask);
    } else {
      out->rungs.emplace_back().push_back({spheres_of_arrays(s, "shape " + std::to_string(k))});
      filters.emplace_back(0, 0);
    }
  }
  for (const auto& r : out->rungs) out->shapes.push_back({r[0].spheres.data(), r[0].spheres.size()});
  const Array p = array_of(poses, {"poses", Contract::Kind::wide, {kAny, 12}, "(B, 12)"});
  if (p.memory != detect::Memory::host)
    throw py::type_error("the poses that Bodies is made from must lie on the host");
  out->bodies.resize(static_cast<std::size_t>(p.shape[0]));
  for (std::size_t b = 0; b < out->bodies.size(); b++) {
    const double* from = p.as<double>() + 12 * b;
    check_rotation(from, b);
    std::copy_n(from, 9, out->bodies[b].rotation), std::copy_n(from + 9, 3, out->bodies[b].position);
  }
  each<std::uint32_t>(shape, "shape", out->bodies, [](detect::Body& b, std::uint32_t v) { b.shape = v; });
  for (std::size_t b = 0; b < out->bodies.size(); b++) {
    detect::Body& body = out->bodies[b];
    // One check is enough, because Python's view of the shapes is read-only.
    if (body.shape >= out->shapes.size())
      throw py::index_error("body " + std::to_string(b) + " names shape " + std::to_string(body.shape) +
                            ", but there are " + std::to_string(out->shapes.size()));
    body.family = filters[body.shape].first, body.mask = filters[body.shape].second;
  }
  each<std::uint32_t>(family, "family", out->bodies, [](detect::Body& b, std::uint32_t v) { b.family = v; });
  each<std::uint32_t>(mask, "mask", out->bodies, [](detect::Body& b, std::uint32_t v) { b.mask = v; });
  each<std::uint8_t>(is_static, "is_static", out->bodies,
                     [](detect::Body& b, std::uint8_t v) { b.is_static = v != 0; });
  each<std::uint32_t>(world, "world", out->bodies, [](detect::Body& b, std::uint32_t v) { b.world = v; });
  return out;
}

// The bodies at other levels of detail. `smallest` given: for things that move.
std::shared_ptr<Bodies> with_lod(const Bodies& from, const Text<"lod">& lod, const py::object& centers,
                                 const py::object& radii, std::optional<Real<"smallest">> smallest,
                                 Real<"margin"> margin, Real<"share"> share) {
  if (centers.is_none() != radii.is_none()) throw py::value_error("centers and radii go together");
  if (!(share > 0)) throw py::value_error("share must be a number above 0");
  if (smallest && !(*smallest >= 0)) throw py::value_error("smallest must be 0 or more");
  std::vector<detect::Sphere> loose;
  if (!centers.is_none()) loose = spheres_of_arrays(py::make_tuple(centers, radii), "the loose spheres");
  detect::RungRule rule;
  try {
    rule = detect::rung_rule(lod);
    detect::CallOptions options;
    options.margin = margin;
    detect::check_options(options);
    for (std::size_t k = 0; k < loose.size(); k++)
      if (detect::fault_of(loose[k]) != detect::Fault::none)
        throw Error(detect::fault_sentence("loose sphere " + std::to_string(k), loose[k]));
  } catch (const Error& e) {
    throw py::value_error(e.what());
  }
  rule.share = share;
  const std::vector<std::span<const detect::Rung>> shapes(from.rungs.begin(), from.rungs.end());
  detect::RungChoice choice;
  if (!smallest) {
    detect::Spheres spheres;
    if (!loose.empty()) spheres = detect::spheres_of<double>(loose.size(), &loose[0].x, &loose[0].r);
    spheres.center_stride = spheres.radius_stride = 4;
    try {
      choice = unlocked([&] {
        return detect::choose_rungs(shapes, from.bodies, spheres, rule, margin, {detect::BackendKind::omp});
      });
    } catch (const detect::MemoryError&) {
      throw;
    } catch (const Error& e) {  // an argument is at fault
      throw py::value_error(e.what());
    }
  } else {
    for (const detect::Sphere& s : loose) smallest->value = std::min(smallest->value, s.r);
    choice = detect::choose_rungs_anywhere(shapes, from.bodies, *smallest, rule);
  }
  auto out = std::make_shared<Bodies>();
  out->rungs = from.rungs, out->bodies = from.bodies;
  const auto first = static_cast<std::uint32_t>(out->rungs.size());
  for (const detect::TakenShape& t : detect::take_rungs(out->bodies, choice, first)) {
    std::vector<detect::Rung> one(1);
    if (t.rung != detect::kLeftOut) one[0] = out->rungs[t.of][t.rung];
    out->rungs.push_back(std::move(one));
  }
  for (const auto& r : out->rungs) out->shapes.push_back({r[0].spheres.data(), r[0].spheres.size()});
  out->taken = std::move(choice.rungs), out->lod_error = choice.error;
  return out;
}

// A member of all bodies as an array, which is a view of the bodies' memory.
template <class T>
py::array member_of(const py::object& self, std::size_t offset, py::ssize_t columns, bool writeable) {
  std::vector<detect::Body>& b = py::cast<Bodies&>(self).bodies;
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(b.size())}, strides{sizeof(detect::Body)};
  if (columns > 1) shape.push_back(columns), strides.push_back(sizeof(T));
  static const T none{};
  const void* at =
      b.empty() ? static_cast<const void*>(&none) : reinterpret_cast<const char*>(b.data()) + offset;
  py::array a(py::dtype::of<T>(), std::move(shape), std::move(strides), at, self);
  if (!writeable) a.attr("flags").attr("writeable") = false;  // Python cannot undo this
  return a;
}

// The property that returns it.
template <class T>
py::cpp_function member(std::size_t offset, py::ssize_t columns = 1, bool writeable = true) {
  return [=](const py::object& self) { return member_of<T>(self, offset, columns, writeable); };
}

}  // namespace

void check_rotation(const double* rotation, std::size_t body) {
  for (int i = 0; i < 3; i++)
    for (int k = i; k < 3; k++) {
      const double *a = rotation + 3 * i, *b = rotation + 3 * k;
      if (!(std::abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - (i == k)) < 1e-3))
        throw py::value_error("the pose of body " + std::to_string(body) +
                              " does not begin with a rotation: the three rows of its matrix must have "
                              "length 1 and be at right angles");
    }
  const double* r = rotation;
  if (r[0] * (r[4] * r[8] - r[5] * r[7]) + r[1] * (r[5] * r[6] - r[3] * r[8]) +
          r[2] * (r[3] * r[7] - r[4] * r[6]) <
      0)
    throw py::value_error(
        "the pose of body " + std::to_string(body) +
        " begins with a mirror image and no rotation: the determinant of its matrix must be 1");
}

void add_bodies(py::module_& m) {
  static_assert(std::is_standard_layout_v<detect::Body> && offsetof(detect::Body, rotation) == 0 &&
                offsetof(detect::Body, position) == 9 * sizeof(double));
  py::class_<Bodies, std::shared_ptr<Bodies>>(
      m, "Bodies", "Shapes put at poses, as many as you like. Its length is the number of bodies.")
      .def(py::init(&bodies_of), "shapes"_a, "poses"_a, "shape"_a = py::none(), py::kw_only(),
           "family"_a = py::none(), "mask"_a = py::none(), "is_static"_a = py::none(), "world"_a = py::none(),
           R"(B bodies, each of them a shape at a pose.

shapes: Clusters, or pairs (centers, radii) in the shape's own frame. poses: (B, 12) float64, the rotation matrix row by row
and then the position; rows that are not orthonormal to within 1e-3 are refused. shape: (B,), the index of each body's shape; None: the first shape for all. family, mask: (B,); None:
those of the body's Cluster, or 0 if the shape is given by arrays. is_static: (B,), the bodies that do not move: two static
bodies are never a contact. world: (B,); None: 0 for all. Only bodies of one world meet, and those of EVERY_WORLD meet all.)")
      .def("with_lod", &with_lod, "lod"_a = "auto", py::kw_only(), "centers"_a = py::none(),
           "radii"_a = py::none(), "smallest"_a = py::none(), "margin"_a = 0.0, "share"_a = 0.1,
           R"(These bodies at another level of detail, as new Bodies.

lod: "0" is the finest level, "1" the next coarser one and so on; "auto" takes for each body the coarsest level whose proved
error is at most `share` of the smallest thing that can touch it. That is looked for among the bodies and the loose spheres
(centers, radii) where they are now, with gaps of up to `margin`; a body that nothing can touch gets no spheres. With `smallest`,
the radius of the smallest loose sphere (inf: there is none), everything may move, and every thing can touch every body.
`lod` and `lod_error` of the result say what was taken.)")
      .def_property_readonly(
          "lod",
          [](const py::object& self) {
            const auto& taken = py::cast<Bodies&>(self).taken;
            return py::array_t<std::uint32_t>(static_cast<py::ssize_t>(taken.size()), taken.data());
          },
          "What with_lod() took of each body: 4294967295 is a body that is left out.")
      .def_readonly(
          "lod_error", &Bodies::lod_error,
          "What touches a body of with_lod() is at most this far from its finest level; inf: not proved.")
      .def("__len__", [](const Bodies& b) { return b.bodies.size(); })
      .def_property_readonly("poses", member<double>(0, 12))
      .def_property_readonly("shape", member<std::uint32_t>(offsetof(detect::Body, shape), 1, false))
      .def_property_readonly("family", member<std::uint32_t>(offsetof(detect::Body, family)))
      .def_property_readonly("mask", member<std::uint32_t>(offsetof(detect::Body, mask)))
      .def_property_readonly("world", member<std::uint32_t>(offsetof(detect::Body, world)))
      .def_property_readonly("is_static", member<bool>(offsetof(detect::Body, is_static)));
}

}  // namespace padder::python
