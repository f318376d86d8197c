// SPDX-License-Identifier: GPL-3.0-or-later
// The Python names Contacts, Detector and detect: the detector for NumPy and GPU arrays.
#include <algorithm>
#include <cmath>
#include <memory>

#include "detect/core/errors.h"
#include "padding/asset/error.h"
#include "tools/python/arguments.h"
#include "tools/python/arrays.h"
#include "tools/python/bodies.h"
#include "tools/python/module.h"
#include "tools/python/unlocked.h"

namespace padder::python {

using namespace pybind11::literals;

namespace {

using Answer = Text<"answer">;
using BackendName = Text<"backend">;
using Device = Whole<"device", int>;
using Margin = Real<"margin">;
using Precision = Text<"precision">;
using Revision = Whole<"revision", std::uint64_t>;
using Threads = Whole<"threads", int, detect::kMostThreads>;
using Width = Text<"width">;
using Worlds = Whole<"count", std::uint32_t>;

// A detector and who uses it. The arrays that its last call returned are views of its memory. Everything but
// `detector` is protected by Python's global lock.
struct SharedDetector {
  // Returns what `work(detector)` returns, which no other thread may disturb.
  template <class Work>
  auto use(Work work) {
    busy = true;
    struct Done {
      bool& busy;
      ~Done() { busy = false; }
    } done{busy};
    return unlocked([&] { return work(*detector); });
  }
  void check_idle() const {
    if (busy) throw Error("this detector is working in another thread: make one detector for each thread");
  }
  std::unique_ptr<detect::Detector> detector;
  std::uint64_t calls = 0, revision = 0;  // of the last call; 0 if it threw
  std::size_t bodies = 0;                 // of that revision
  std::size_t lent = 0;                   // arrays of the last call that Python still uses
  bool busy = false;
};

// What a call returned, as arrays that are views of its detector's memory.
class Views {
 public:
  Views(std::shared_ptr<SharedDetector> shared, detect::Memory memory, int device)
      : shared_(std::move(shared)), call_(shared_->calls), memory_(memory), device_(device) {}
  std::string backend() const { return shared_->detector->backend(); }

 protected:
  void check() const {
    if (shared_->calls != call_)
      throw Error(
          "these contacts are gone, because their detector was called again: take their arrays before that");
  }
  // Throws AttributeError if there are no such data although there could be some.
  static void require(const void* data, std::uint64_t count, const char* what, const char* where) {
    if (!data && count)
      throw py::attribute_error("there is no `" + std::string(what) + "`, which was not asked for: see `" +
                                where + "`");
  }
  template <class T>
  py::object array(const void* data, std::uint64_t rows, std::int64_t columns, std::int64_t row,
                   std::int64_t first) const {
    const auto n = static_cast<std::int64_t>(rows);
    const T* at = data ? static_cast<const T*>(data) + first : nullptr;
    if (memory_ == detect::Memory::device) {
      std::vector<std::int64_t> shape{n}, strides{row};
      if (columns > 1) shape.push_back(columns), strides.push_back(1);
      const char kind = std::is_same_v<T, bool> ? 'b' : std::is_floating_point_v<T> ? 'f' : 'u';
      return py::cast(DeviceArray(loan(), at, shape, strides, kind, sizeof(T), device_));
    }
    std::vector<py::ssize_t> shape{n}, strides{static_cast<py::ssize_t>(row * sizeof(T))};
    if (columns > 1) shape.push_back(columns), strides.push_back(sizeof(T));
    return view(at, shape, strides, loan());
  }
  std::shared_ptr<SharedDetector> shared_;

 private:
  // The owner of an array of the detector's memory. It keeps the detector alive, and the next call sees that
  // it exists.
  py::object loan() const {
    auto* shared = new std::shared_ptr<SharedDetector>(shared_);
    (*shared)->lent++;
    return py::capsule(shared, [](void* p) {
      auto* k = static_cast<std::shared_ptr<SharedDetector>*>(p);
      (*k)->lent--;
      delete k;
    });
  }
  std::uint64_t call_;
  detect::Memory memory_;
  int device_;
};

class PyContacts : public Views {
 public:
  PyContacts(std::shared_ptr<SharedDetector> shared, const detect::Contacts& contacts, int device)
      : Views(std::move(shared), contacts.memory, device), contacts_(contacts) {}

  std::uint64_t count() const { return contacts_.count; }
  std::uint64_t hash() const {
    check(), shared_->check_idle();
    return shared_->use([](const detect::Detector& d) { return d.hash(); });
  }
  py::object pairs() const {
    check();
    return array<std::uint32_t>(contacts_.pairs, contacts_.count, 2, 2, 0);
  }
  py::object history() const {
    check(), require(contacts_.history, contacts_.count, "history", "history");
    return array<std::uint32_t>(contacts_.history, contacts_.count, 1, 1, 0);
  }
  py::object normals() const { return reals(contacts_.normals, "normals", 3, 4, 0); }
  py::object depth() const { return reals(contacts_.normals, "depth", 1, 4, 3); }
  py::object points_i() const { return reals(contacts_.points, "points_i", 3, 6, 0); }
  py::object points_j() const { return reals(contacts_.points, "points_j", 3, 6, 3); }

 private:
  py::object reals(const void* data, const char* what, std::int64_t columns, std::int64_t row,
                   std::int64_t first) const {
    check(), require(data, contacts_.count, what, "width");
    return contacts_.scalar == detect::Scalar::f32
               ? array<float>(data, contacts_.count, columns, row, first)
               : array<double>(data, contacts_.count, columns, row, first);
  }
  detect::Contacts contacts_;
};

class PyWorldAnswers : public Views {
 public:
  PyWorldAnswers(std::shared_ptr<SharedDetector> shared, const detect::WorldAnswers& answers, int device)
      : Views(std::move(shared), answers.memory, device), answers_(answers) {}

  std::uint64_t worlds() const { return answers_.worlds; }
  py::object any() const { return one_each<bool>(answers_.any, "any", 1); }
  py::object count() const { return one_each<std::uint64_t>(answers_.count, "count", 1); }
  py::object distance() const { return one_each<double>(answers_.distance, "distance", 1); }
  py::object pair() const { return one_each<std::uint32_t>(answers_.pair, "pair", 2); }

 private:
  template <class T>
  py::object one_each(const void* data, const char* what, std::int64_t columns) const {
    check(), require(data, answers_.worlds, what, "answer");
    return array<T>(data, answers_.worlds, columns, columns, 0);
  }
  detect::WorldAnswers answers_;
};

// The arguments of a call as the detector reads them. It keeps the arrays alive.
struct Request {
  detect::Input input;
  detect::Scalar scalar = detect::Scalar::f64;
  detect::Memory memory = detect::Memory::host;  // where the contacts will lie
  std::uint32_t worlds = detect::kEveryWorld;    // that answers are asked for
  std::vector<Array> kept;

  const char* keep(const Array& a) {
    kept.push_back(a);
    return a.data;
  }
};

// The arguments that say what is to be tested, as Python gives them.
struct Scene {
  py::object centers, radii, family, mask, is_static, world;
  std::shared_ptr<Bodies> bodies;
  std::uint64_t revision = 0;
  py::object moved = py::none(), poses = py::none();
};

void add_spheres(Request& in, const Scene& scene) {
  const auto& [centers, radii, family, mask, is_static, world, bodies, revision, moved, poses] = scene;
  if (centers.is_none()) {
    if (!radii.is_none() || !family.is_none() || !mask.is_none() || !is_static.is_none() || !world.is_none())
      throw py::value_error(
          "radii, family, mask, is_static and world belong to loose spheres: give centers, too");
    return;
  }
  if (radii.is_none()) throw py::value_error("radii are missing: centers need them");
  using Kind = Contract::Kind;
  Array c = array_of(centers, {"centers", Kind::real, {kAny, 3}, "(N, 3)", false, true});
  const py::ssize_t n = c.shape[0];
  Array r = array_of(radii, {"radii", Kind::real, {n}, "(N,), or one number for all", true, true});
  const bool single = c.single() && (r.single() || r.one());  // one number takes the type of the centers
  if (r.one() && r.memory != c.memory)
    throw py::value_error(
        "radii is one number on the host, and centers lie on the device: give the radii as an array there");
  convert_real(c, "centers", single ? 4 : 8), convert_real(r, "radii", single ? 4 : 8);
  in.scalar = single ? detect::Scalar::f32 : detect::Scalar::f64, in.memory = c.memory;
  detect::Spheres& s = in.input.spheres;
  s.count = static_cast<std::uint64_t>(n), s.scalar = in.scalar, s.memory = c.memory;
  s.centers = in.keep(c), s.radii = in.keep(r);
  s.center_stride = static_cast<std::uint32_t>(n > 1 ? c.strides[0] / c.size : 3);
  s.radius_stride = static_cast<std::uint32_t>(r.one() ? 0 : n > 1 ? r.strides[0] / r.size : 1);
  const auto one_each = [&](const py::object& object, const char* name, Kind kind) -> const char* {
    return object.is_none() ? nullptr : in.keep(array_of(object, {name, kind, {n}, "(N,)"}));
  };
  s.family = reinterpret_cast<const std::uint32_t*>(one_each(family, "family", Kind::bits));
  s.mask = reinterpret_cast<const std::uint32_t*>(one_each(mask, "mask", Kind::bits));
  s.is_static = reinterpret_cast<const std::uint8_t*>(one_each(is_static, "is_static", Kind::flags));
  if (!world.is_none()) {
    const Array w = array_of(world, {"world", Kind::bits, {n}, "(N,), or one number for all", true});
    if (w.one() && w.memory != detect::Memory::host)
      throw py::value_error("world is one number on the device: give int(world), which lies on the host");
    if (w.one())
      s.world_of_all = *w.as<std::uint32_t>();
    else
      s.world = reinterpret_cast<const std::uint32_t*>(in.keep(w));
  }
  for (const Array& a : in.kept)
    if (a.memory != c.memory)
      throw py::value_error("all arrays of spheres must lie in one place: on the host or on the device");
}

void add_poses(Request& in, const py::object& poses, const py::object& moved) {
  const auto count = static_cast<py::ssize_t>(in.input.bodies.size());
  if (!moved.is_none()) {
    const Array a = array_of(moved, {"moved", Contract::Kind::bits, {kAny}, "(M,)"});
    if (a.memory != detect::Memory::host) throw py::type_error("moved must lie on the host");
    in.keep(a);
    in.input.moved = {a.as<std::uint32_t>(), static_cast<std::size_t>(a.shape[0])};
    for (const std::uint32_t b : in.input.moved)
      if (b >= in.input.bodies.size())
        throw py::index_error("moved names body " + std::to_string(b) + ", but there are " +
                              std::to_string(count));
  }
  if (poses.is_none()) return;
  const Array p =
      array_of(poses, {"poses", Contract::Kind::wide, {count, 12}, "(B, 12), a row for each body"});
  in.input.poses = reinterpret_cast<const detect::Pose*>(in.keep(p)), in.input.pose_memory = p.memory;
  if (in.input.spheres.count == 0) in.memory = p.memory;
}

// Checks the rotations that the call reads; those in device memory are not looked at. `again`: the revision
// is that of the previous call.
void check_rotations(const Request& in, bool again) {
  const detect::Input& input = in.input;
  if (input.pose_memory != detect::Memory::host) return;
  if (again && !input.poses) {
    for (const std::uint32_t b : input.moved) check_rotation(input.bodies[b].rotation, b);
    return;
  }
  for (std::size_t b = 0; b < input.bodies.size(); b++)
    if (!again || !input.bodies[b].is_static)
      check_rotation(input.poses ? input.poses[b].rotation : input.bodies[b].rotation, b);
}

// Does the input contain numbers that no detector takes? Asked only after the detector has refused the call,
// to choose the type of Python's error.
bool numbers_at_fault(const Request& in) {
  const auto bad = [](const detect::Sphere& s) { return detect::fault_of(s) != detect::Fault::none; };
  for (const detect::Shape& shape : in.input.shapes)
    if (std::any_of(shape.spheres, shape.spheres + shape.count, bad)) return true;
  const auto pose = [](const double* rotation, const double* position) {
    const auto fits = [](double v) { return std::abs(v) <= detect::kLargest; };
    return std::all_of(rotation, rotation + 9, fits) && std::all_of(position, position + 3, fits);
  };
  for (const detect::Body& b : in.input.bodies)
    if (!in.input.poses && !pose(b.rotation, b.position)) return true;
  for (std::size_t b = 0;
       in.input.poses && in.input.pose_memory == detect::Memory::host && b < in.input.bodies.size(); b++)
    if (!pose(in.input.poses[b].rotation, in.input.poses[b].position)) return true;
  const detect::Spheres& s = in.input.spheres;
  const auto loose = [&]<class T>(const T* centers, const T* radii) {
    for (std::uint64_t k = 0; k < s.count; k++) {
      const T *c = centers + k * s.center_stride, r = radii[k * s.radius_stride];
      if (bad(detect::Sphere{c[0], c[1], c[2], r})) return true;
    }
    return false;
  };
  if (s.memory != detect::Memory::host) return false;
  return s.scalar == detect::Scalar::f32
             ? loose(static_cast<const float*>(s.centers), static_cast<const float*>(s.radii))
             : loose(static_cast<const double*>(s.centers), static_cast<const double*>(s.radii));
}

// Is something in a world that no answer is asked for? Worlds in device memory are not looked at.
bool worlds_at_fault(const Request& in) {
  const auto outside = [&](std::uint32_t world) {
    return world >= in.worlds && world != detect::kEveryWorld;
  };
  const detect::Spheres& s = in.input.spheres;
  if (s.world && s.memory == detect::Memory::host && std::any_of(s.world, s.world + s.count, outside))
    return true;
  return (!s.world && s.count > 0 && outside(s.world_of_all)) ||
         std::ranges::any_of(in.input.bodies, outside, &detect::Body::world);
}

// An option that has no meaning is an argument at fault.
void check(const detect::CallOptions& options) {
  try {
    check_options(options);
  } catch (const Error& e) {
    throw py::value_error(e.what());
  }
}

class PyDetector {
 public:
  PyDetector(const std::string& width, const std::string& backend, const std::string& precision, int threads,
             int device, bool history = false) {
    using detect::BackendKind;
    static constexpr std::pair<const char*, detect::Width> widths[] = {{"pairs", detect::Width::pairs},
                                                                       {"normals", detect::Width::normals},
                                                                       {"points", detect::Width::points}};
    static constexpr std::pair<const char*, BackendKind> backends[] = {
        {"auto", BackendKind::automatic}, {"omp", BackendKind::omp}, {"cuda", BackendKind::cuda}};
    static constexpr std::pair<const char*, detect::Precision> precisions[] = {
        {"exact", detect::Precision::exact}, {"fast", detect::Precision::float32}};
    detect::CallOptions o;
    o.threads = threads, o.history = history;
    o.width = named(widths, width, "width must be \"pairs\", \"normals\" or \"points\"");
    const BackendKind kind = named(backends, backend, "backend must be \"auto\", \"omp\" or \"cuda\"");
    o.precision = named(precisions, precision, "precision must be \"exact\" or \"fast\"");
    check(o);
    device_ = device;
    shared_->detector = std::make_unique<detect::Detector>(detect::DeviceChoice{kind, device}, o);
    if (device != 0 && this->backend() == "omp")
      throw py::value_error(
          "device " + std::to_string(device) +
          " is a GPU that is not there or not asked for: leave device out for the backend omp");
  }

  std::string backend() const { return shared_->detector->backend(); }

  PyContacts detect(const Scene& scene, double margin) {
    detect::Contacts contacts;
    call(scene, margin, detect::kEveryWorld,
         [&](detect::Detector& d, const Request& in) { contacts = d.detect(in.input); });
    return {shared_, contacts, device_};
  }
  PyWorldAnswers worlds(std::uint32_t count, const std::string& answer, const Scene& scene, double margin) {
    static constexpr std::pair<const char*, detect::Answer> kinds[] = {
        {"any", detect::Answer::any},
        {"count", detect::Answer::count},
        {"distance", detect::Answer::distance}};
    const auto what = named(kinds, answer, "answer must be \"any\", \"count\" or \"distance\"");
    detect::WorldAnswers answers;
    call(scene, margin, count,
         [&](detect::Detector& d, const Request& in) { answers = d.detect_worlds(in.input, count, what); });
    return {shared_, answers, device_};
  }

 private:
  template <class Work>
  void call(const Scene& scene, double margin, std::uint32_t worlds, Work work) {
    Request in;
    in.worlds = worlds;
    if (scene.bodies) in.input.shapes = scene.bodies->shapes, in.input.bodies = scene.bodies->bodies;
    in.input.revision = scene.revision;
    add_spheres(in, scene);
    add_poses(in, scene.poses, scene.moved);
    shared_->check_idle();
    if (shared_->lent)
      throw Error(
          "arrays of the last contacts are still in use, and the detector would overwrite them: copy what "
          "you want to keep and delete the arrays before the next call");
    check_rotations(in, in.input.revision != 0 && in.input.revision == shared_->revision &&
                            in.input.bodies.size() == shared_->bodies);
    detect::CallOptions o = shared_->detector->options();
    o.scalar = in.scalar, o.output = in.memory, o.margin = margin;
    check(o);
    shared_->detector->options() = o;
    shared_->calls++, shared_->revision = 0;
    try {
      shared_->use([&](detect::Detector& d) { work(d, in); });
      shared_->revision = in.input.revision, shared_->bodies = in.input.bodies.size();
    } catch (const Error& e) {
      if (numbers_at_fault(in)) throw py::value_error(e.what());
      if (worlds_at_fault(in)) throw py::index_error(e.what());
      throw;
    }
  }

  std::shared_ptr<SharedDetector> shared_ = std::make_shared<SharedDetector>();
  int device_ = 0;
};

// How the functions named `detect` and `worlds` describe their arrays.
const std::string kArraysSaid =
    R"(Finds every contact of N loose spheres and of the spheres of bodies, and none twice.

centers: (N, 3). radii: (N,), or one number for all. They are read as float32 if both are float32, else as float64.
family, mask: (N,) uint32 or None. Two spheres of the same family other than 0 are never a contact, nor are two of which one's
mask has bit family - 1 of the other's family. is_static: (N,), the spheres that do not move; two static ones are never a contact.
world: (N,) uint32, or one number for all, or None for 0. Only spheres of one world meet, and those of EVERY_WORLD meet all.
margin: all pairs whose gap is at most this are contacts; the depth of those that do not touch is negative.
bodies: Bodies. Spheres are numbered in this order: those of bodies[0], of bodies[1], ..., and then those of centers.
NumPy arrays, and device arrays that offer __cuda_array_interface__ or DLPack, are read where they lie, and the contacts lie in
the same memory. Do not write to the arrays during the call. Other Python threads can run during the call.
)";
constexpr const char* kRevisionSaid =
    R"(revision: a number other than 0 that names a version of the bodies and the static spheres. If it is that of the previous
call, only the poses of the bodies that `moved` lists, (M,) numbers, are read again. Give a new one if anything else changes.
poses: (B, 12) float64, the poses of all bodies, instead of those in `bodies`; on the host or on the device. What is no rotation
is refused on the host and taken as it is on the device.
)";
const std::string kWorldsSaid =
    R"(For each of the worlds 0 to `count` - 1, an answer about the contacts that detect() would list, without a list.

answer: "any" (is there one?), "count" (how many?) or "distance" (the smallest signed distance, and the pair). Contacts of two
spheres of EVERY_WORLD belong to no world. The other arguments are those of detect(). Returns WorldAnswers. Raises padder.Error.
)";

void add_results(py::module_& m) {
  py::class_<PyContacts>(m, "Contacts",
                         "The contacts of a call: arrays with a row for each. Its length is their number.")
      .def("__len__", &PyContacts::count)
      .def_property_readonly("pairs", &PyContacts::pairs)
      .def_property_readonly("normals", &PyContacts::normals)
      .def_property_readonly("depth", &PyContacts::depth)
      .def_property_readonly("history", &PyContacts::history)
      .def_property_readonly("points_i", &PyContacts::points_i)
      .def_property_readonly("points_j", &PyContacts::points_j)
      .def_property_readonly("backend", &PyContacts::backend)
      .def_property_readonly("hash", &PyContacts::hash);
  py::class_<PyWorldAnswers>(m, "WorldAnswers", "The answers of a call: arrays with a row for each world.")
      .def("__len__", &PyWorldAnswers::worlds)
      .def_property_readonly("any", &PyWorldAnswers::any)
      .def_property_readonly("count", &PyWorldAnswers::count)
      .def_property_readonly("distance", &PyWorldAnswers::distance)
      .def_property_readonly("pair", &PyWorldAnswers::pair)
      .def_property_readonly("backend", &PyWorldAnswers::backend);
}

using Objects = const py::object&;
using MaybeBodies = const std::shared_ptr<Bodies>&;

}  // namespace

void add_detect(py::module_& m) {
  m.attr("EVERY_WORLD") = detect::kEveryWorld;
  m.attr("NO_CONTACT") = detect::kNoContact;
  add_results(m);
  const auto none = py::none();
  py::class_<PyDetector>(
      m, "Detector",
      "Finds contacts again and again, and keeps its memory, and what stands still, from call to call.")
      .def(py::init<Width, BackendName, Precision, Threads, Device, bool>(), py::kw_only(),
           "width"_a = "normals", "backend"_a = "auto", "precision"_a = "exact", "threads"_a = 0,
           "device"_a = 0, "history"_a = false)
      .def_property_readonly("backend", &PyDetector::backend)
      .def(
          "detect",
          [](PyDetector& d, Objects centers, Objects radii, Objects family, Objects mask, Objects is_static,
             Objects world, MaybeBodies bodies, Revision revision, Objects moved, Objects poses,
             Margin margin) {
            return d.detect({centers, radii, family, mask, is_static, world, bodies, revision, moved, poses},
                            margin);
          },
          "centers"_a = none, "radii"_a = none, "family"_a = none, "mask"_a = none, py::kw_only(),
          "is_static"_a = none, "world"_a = none, "bodies"_a = none, "revision"_a = 0, "moved"_a = none,
          "poses"_a = none, "margin"_a = 0.0,
          (kArraysSaid + kRevisionSaid +
           "The Contacts are valid until the next call. That call is refused while their arrays are in use. "
           "Raises padder.Error.")
              .c_str())
      .def(
          "worlds",
          [](PyDetector& d, Worlds count, const Answer& answer, Objects centers, Objects radii,
             Objects family, Objects mask, Objects is_static, Objects world, MaybeBodies bodies,
             Revision revision, Objects moved, Objects poses, Margin margin) {
            return d.worlds(count, answer,
                            {centers, radii, family, mask, is_static, world, bodies, revision, moved, poses},
                            margin);
          },
          "count"_a, "answer"_a = "any", "centers"_a = none, "radii"_a = none, "family"_a = none,
          "mask"_a = none, py::kw_only(), "is_static"_a = none, "world"_a = none, "bodies"_a = none,
          "revision"_a = 0, "moved"_a = none, "poses"_a = none, "margin"_a = 0.0, kWorldsSaid.c_str());

  m.def(
      "detect",
      [](Objects centers, Objects radii, Objects family, Objects mask, Objects is_static, Objects world,
         MaybeBodies bodies, Margin margin, const Width& width, const BackendName& backend,
         const Precision& precision, Threads threads, Device device) {
        return PyDetector(width, backend, precision, threads, device)
            .detect({centers, radii, family, mask, is_static, world, bodies}, margin);
      },
      "centers"_a = none, "radii"_a = none, "family"_a = none, "mask"_a = none, py::kw_only(),
      "is_static"_a = none, "world"_a = none, "bodies"_a = none, "margin"_a = 0.0, "width"_a = "normals",
      "backend"_a = "auto", "precision"_a = "exact", "threads"_a = 0, "device"_a = 0,
      (kArraysSaid +
       "Returns Contacts. Their arrays are views that keep the memory alive. Raises padder.Error.")
          .c_str());
  m.def(
      "worlds",
      [](Worlds count, const Answer& answer, Objects centers, Objects radii, Objects family, Objects mask,
         Objects is_static, Objects world, MaybeBodies bodies, Margin margin, const BackendName& backend,
         Threads threads, Device device) {
        return PyDetector("pairs", backend, "exact", threads, device)
            .worlds(count, answer, {centers, radii, family, mask, is_static, world, bodies}, margin);
      },
      "count"_a, "answer"_a = "any", "centers"_a = none, "radii"_a = none, "family"_a = none, "mask"_a = none,
      py::kw_only(), "is_static"_a = none, "world"_a = none, "bodies"_a = none, "margin"_a = 0.0,
      "backend"_a = "auto", "threads"_a = 0, "device"_a = 0, kWorldsSaid.c_str());
}

}  // namespace padder::python
