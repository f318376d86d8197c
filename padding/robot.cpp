// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/robot.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <mutex>
#include <numbers>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/meshing/pieces.h"
#include "padding/meshing/repair.h"
#include "padding/robots/robot_file.h"
#include "padding/self_collision.h"
#include "padding/shape_mesh.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

bool y_up(const fs::path& file) {
  const std::string ending = ending_of(file);
  return ending == ".gltf" || ending == ".glb";
}

Mesh placed(Mesh mesh, const RobotShape& shape) {
  for (Point& p : mesh.points) p = shape.pose * p.cwiseProduct(shape.scale);
  if (shape.scale.prod() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

double extent(const RobotLink& link, const std::vector<ReadResult>& files) {
  Box box;
  for (std::size_t k = 0; k < link.shapes.size(); k++) {
    const RobotShape& s = link.shapes[k];
    if (s.type == RobotShape::Type::mesh)
      for (const Point& p : files[k].mesh.points) box.add(s.pose * p.cwiseProduct(s.scale));
    else
      box.add(s.pose.translation() - s.size), box.add(s.pose.translation() + s.size);
  }
  return box.diagonal();
}

// Of round shapes: a twentieth of the gap, or of 1 % of the diagonal where none is asked for. It is taken off
// the gap, which costs spheres, and a smaller one costs triangles.
double chord_error_for(const PadOptions& options, double diagonal) {
  double error = diagonal / 100;
  if (!options.by_tolerance() && options.edge_length.given())
    error = std::min(error, options.depth_ratio_used() * options.edge_length.absolute(diagonal));
  for (const Length& l : options.lod) error = std::min(error, l.absolute(diagonal));
  const Length asked = options.gap_used().given() ? options.gap_used() : options.protrusion_used();
  return (asked.given() ? asked.absolute(diagonal) : error) / 20;
}

bool only_spheres(const RobotLink& link) {
  return std::all_of(link.shapes.begin(), link.shapes.end(),
                     [](const RobotShape& s) { return s.type == RobotShape::Type::sphere; });
}

// The spheres of the link as they are. The mass of several is left unknown, because they may overlap.
Cluster spheres_of(const RobotLink& link, const fs::path& file) {
  Cluster c;
  c.unit = "m";
  c.program = "padder " PADDER_VERSION;
  c.source.file = file.filename().string() + ", link " + link.name;
  c.source.repair = "none: its shapes are spheres";
  c.accuracy.coverage = 1;
  for (const RobotShape& s : link.shapes) {
    c.centers.push_back(s.pose.translation()), c.radii.push_back(s.size.x()), c.triangle.push_back(-1);
    c.bounds.add_ball(c.centers.back(), c.radii.back());
  }
  if (c.size() == 1) {
    const double r = c.radii[0];
    c.mass.volume = c.volume_union = 4 / 3. * std::numbers::pi * r * r * r;
    c.mass.center = c.centers[0];
    c.mass.moments = Vector::Constant(0.4 * c.mass.volume * r * r);
    c.mass.inertia = c.mass.moments.asDiagonal();
    c.accuracy.volume_ratio = 1;
  }
  return c;
}

// Of the shape that the spheres stand for; without moments where it encloses nothing.
Inertial inertial_for(const Cluster& c, double mass) {
  if (!(c.mass.volume > 0)) return {mass, 0.5 * (c.bounds.low + c.bounds.high)};
  return {mass, c.mass.center, mass / c.mass.volume * c.mass.inertia};
}

// Does repair find a cavity in the mesh of one shape? Where it fails, it says so when the link is padded.
bool has_cavity(const Mesh& mesh) try {
  return find_pieces(mesh).pieces.size() > 1 && repair(mesh, {}, "").steps.cavities > 0;
} catch (const Error&) {
  return false;
}

// As read_link. `solids`: the shapes are several, none with a cavity of its own.
ReadResult read_shapes(const RobotLink& link, const fs::path& file, const PadOptions& options, bool& solids) {
  std::vector<ReadResult> files(link.shapes.size());
  for (std::size_t k = 0; k < files.size(); k++) {
    if (link.shapes[k].type != RobotShape::Type::mesh) continue;
    files[k] = read_mesh(link.shapes[k].file, ReadOptions{1, "m"});
    if (y_up(link.shapes[k].file))
      for (Point& p : files[k].mesh.points) p = Point(p.x(), -p.z(), p.y());
  }
  const double chord_error = chord_error_for(options, extent(link, files));
  ReadResult all;
  all.unit = "m";
  solids = files.size() > 1;
  for (const ReadResult& f : files)
    for (const std::string& note : f.notes) all.notes.push_back(link.name + ": " + note);
  for (std::size_t k = 0; k < files.size(); k++) {
    const RobotShape& s = link.shapes[k];
    if (s.type == RobotShape::Type::mesh) {
      const Mesh mesh = placed(std::move(files[k].mesh), s);
      solids = solids && !has_cavity(mesh);
      all.mesh.add(mesh);
      all.source.triangles += files[k].source.triangles;
    } else {
      const ShapeMesh shape = shape_mesh(s, chord_error);
      all.mesh.add(placed(shape.mesh, s));
      all.source.triangles += shape.mesh.triangles.size();
      all.chord_error = std::max(all.chord_error, shape.chord_error);
    }
  }
  if (files.size() == 1 && link.shapes[0].type == RobotShape::Type::mesh)
    all.source.file = files[0].source.file, all.source.sha256 = files[0].source.sha256;
  else
    all.source.file = file.filename().string() + ", link " + link.name;
  return all;
}

// A link that is to be padded: its number, and its shapes as one mesh.
struct Task {
  std::size_t link;
  ReadResult file;
  bool solids;  // several shapes without cavities of their own: one inside another bounds none
};

bool same_body(const Task& a, const Task& b) {
  return a.file.mesh.points == b.file.mesh.points && a.file.mesh.triangles == b.file.mesh.triangles &&
         a.file.chord_error == b.file.chord_error && a.solids == b.solids;
}

}  // namespace

ReadResult read_link(const RobotLink& link, const fs::path& file, const PadOptions& options) {
  bool solids = false;
  return read_shapes(link, file, options, solids);
}

namespace {

// Pads the links side by side, the largest first. Each takes its portion of the threads. Of links with the
// same shapes, as the wheels of a base, the first is padded for all.
class Links {
 public:
  Links(const fs::path& path, const RobotTree& robot, std::vector<Task> tasks, const PadProgress& progress)
      : path_(path), robot_(robot), tasks_(std::move(tasks)), progress_(progress) {
    std::stable_sort(tasks_.begin(), tasks_.end(), [](const Task& a, const Task& b) {
      return a.file.mesh.triangles.size() > b.file.mesh.triangles.size();
    });
    for (std::size_t k = 0; k < tasks_.size(); k++) {
      std::size_t same = 0;  // k at last, as a mesh that holds NaN does not equal itself
      while (same < k && !same_body(tasks_[same], tasks_[k])) same++;
      first_.push_back(same);
    }
  }

  const std::vector<Task>& tasks() const { return tasks_; }

  std::vector<Padded> pad(const PadOptions& options) const {
    std::vector<Padded> out = pad_different(options);
    for (std::size_t k = 0; k < tasks_.size(); k++) {
      if (first_[k] == k) continue;
      out[k] = out[first_[k]];
      out[k].cluster.source.file = tasks_[k].file.source.file;
      out[k].report.seconds = {};
    }
    return out;
  }

  // The smallest tolerance, to a few percent, for which all links together have at most `most` spheres.
  double tolerance_for(std::uint64_t most, PadOptions options) const {
    if (most < tasks_.size())
      throw Error(path_.string() + ": " + std::to_string(most) + " spheres cannot cover its " +
                  std::to_string(tasks_.size()) + " links that need some: each takes at least one");
    double size = 0;
    for (const Task& t : tasks_) size = std::max(size, t.file.mesh.bounds().diagonal());
    options.force = true;  // a length that suits the whole robot may be beyond the half of a small link
    const auto count = [&](double tolerance) {
      options.tolerance = Length::of(tolerance);
      std::uint64_t n = 0;
      for (const Padded& p : pad(options)) n += p.cluster.size();
      return n;
    };
    // Counts fall with a power of the tolerance between 1 and 2. Coarse covers, which are found quickly, come
    // first.
    const auto goal = static_cast<double>(most);
    double low = 1e-4 * size, high = 2 * size, best = 0, next = 0.08 * size, power = 1.3;
    double last = 0, last_n = 0;
    for (int step = 0; step < 10 && high > 1.03 * low; step++) {
      const double n = static_cast<double>(count(next));
      (n <= goal ? high : low) = next;
      if (n <= goal) best = next;
      if (n <= goal && (n >= 0.95 * goal || n + 1 > goal)) break;
      if (last_n > 0 && last_n != n)
        power = std::clamp(std::log(n / last_n) / std::log(last / next), 0.7, 2.5);
      last = next, last_n = n;
      next = std::clamp(next * std::pow(n / (0.98 * goal), 1 / power), next / 4, 4 * next);
      if (!(next > low && next < high)) next = std::sqrt(low * high);
    }
    if (!(best > 0))
      throw Error(path_.string() + ": no cover with " + std::to_string(most) + " spheres was found");
    return best;
  }

 private:
  std::vector<Padded> pad_different(const PadOptions& options) const {
    std::vector<Padded> out(tasks_.size());
    std::vector<std::string> errors(tasks_.size());
    PadOptions united = options;
    if (united.repair == RepairMode::automatic) united.repair = RepairMode::united;
    const int threads = omp_get_max_threads(), levels = omp_get_max_active_levels();
    const int side_by_side = std::clamp(static_cast<int>(tasks_.size()), 1, threads);
    omp_set_max_active_levels(2);
    std::mutex mutex;
    std::size_t done = 0;
    std::exception_ptr stopped;  // what progress_ threw: no exception may leave the parallel region
    const auto tell = [&](const std::string& name) {
      const std::lock_guard lock(mutex);
      try {
        if (!stopped && progress_)
          progress_(name.c_str(), static_cast<int>(done), static_cast<int>(tasks_.size()));
      } catch (...) {
        stopped = std::current_exception();
      }
      if (stopped) std::rethrow_exception(stopped);
    };
#pragma omp parallel num_threads(side_by_side)
    {
      omp_set_num_threads(std::max(1, threads / side_by_side));
#pragma omp for schedule(dynamic, 1)
      for (std::size_t k = 0; k < tasks_.size(); k++) {
        const std::string& name = robot_.links[tasks_[k].link].name;
        try {
          tell(name);
          if (first_[k] == k)
            out[k] = padder::pad(tasks_[k].file, tasks_[k].solids ? united : options,
                                 [&](const char*, int, int) { tell(name); });
        } catch (const std::bad_alloc&) {
          errors[k] = "not enough memory: ask for fewer spheres, or fewer --threads";
        } catch (const std::exception& e) {
          errors[k] = e.what();
        } catch (...) {  // it is in `stopped`
        }
        const std::lock_guard lock(mutex);
        done++;
      }
    }
    omp_set_max_active_levels(levels);
    if (stopped) std::rethrow_exception(stopped);
    std::size_t first = tasks_.size();
    for (std::size_t k = 0; k < tasks_.size(); k++)
      if (!errors[k].empty() && (first == tasks_.size() || tasks_[k].link < tasks_[first].link)) first = k;
    if (first < tasks_.size()) {
      const std::string link = ", link " + robot_.links[tasks_[first].link].name + ": ";
      const std::string own = path_.filename().string() + link;  // how a link without one file names itself
      const std::string& said = errors[first];
      throw Error(path_.string() + link + (said.starts_with(own) ? said.substr(own.size()) : said));
    }
    return out;
  }

  const fs::path& path_;
  const RobotTree& robot_;
  std::vector<Task> tasks_;
  std::vector<std::size_t> first_;  // for each task the first one with the same mesh
  const PadProgress& progress_;
};

}  // namespace

PaddedRobot pad_robot(const fs::path& path, RobotTree robot, const PadOptions& asked,
                      const RobotOptions& whole, const PadProgress& progress) {
  PadOptions options = asked;
  if (whole.max_spheres > 0 && (options.by_tolerance() || options.depth_ratio))
    throw Error(
        "a number of spheres for the whole robot (--robot-spheres) excludes a tolerance, a count and a "
        "depth ratio for each link: leave these out");
  if (std::all_of(robot.links.begin(), robot.links.end(),
                  [](const RobotLink& l) { return l.shapes.empty(); }))
    throw Error(path.string() + ": no link has any geometry" +
                (robot.notes.empty() ? "" : " (" + robot.notes.front() + ")"));
  keep_neighbours_apart(robot);
  PaddedRobot out;
  out.notes = std::move(robot.notes);
  out.reports.resize(robot.links.size()), out.kept.resize(robot.links.size());
  out.meshes.resize(robot.links.size());
  std::vector<Task> tasks;
  std::uint64_t kept = 0;
  const auto store = [&](std::size_t k, Cluster cluster) {
    Cluster& at = robot.model.bodies[k].cluster;
    cluster.family = at.family, cluster.mask = at.mask;
    at = std::move(cluster);
  };
  for (std::size_t k = 0; k < robot.links.size(); k++) {
    const RobotLink& link = robot.links[k];
    if (link.shapes.empty()) continue;
    if (only_spheres(link)) {
      store(k, spheres_of(link, path));
      out.kept[k] = 1, kept += robot.model.bodies[k].cluster.size();
      continue;
    }
    try {
      Task task{k, {}, false};
      task.file = read_shapes(link, path, options, task.solids);
      tasks.push_back(std::move(task));
    } catch (const Error& e) {
      throw Error(path.string() + ", link " + link.name + ": " + e.what());
    }
    const auto& notes = tasks.back().file.notes;
    out.notes.insert(out.notes.end(), notes.begin(), notes.end());
    out.meshes[k] = tasks.back().file.mesh;
  }
  if (tasks.empty())
    out.notes.push_back(
        "all shapes are spheres already, which are kept as they are and not measured: to pad the visual "
        "meshes, ask for these (--visual)");
  const Links links(path, robot, std::move(tasks), progress);
  if (whole.max_spheres > 0 && !links.tasks().empty()) {
    out.tolerance = links.tolerance_for(whole.max_spheres - std::min(whole.max_spheres, kept), options);
    options.tolerance = Length::of(out.tolerance), options.force = true;
  }
  std::vector<Padded> padded = links.pad(options);
  for (std::size_t t = 0; t < padded.size(); t++) {
    store(links.tasks()[t].link, std::move(padded[t].cluster));
    out.reports[links.tasks()[t].link] = std::move(padded[t].report);
  }
  for (std::size_t k = 0; k < robot.links.size(); k++) {
    robot.model.bodies[k].cluster.name = robot.links[k].name;
    const Cluster& c = robot.model.bodies[k].cluster;
    const double stated = robot.links[k].mass,
                 mass = stated > 0 ? stated : robot.links[k].density * c.mass.volume;
    if (mass > 0) robot.model.bodies[k].inertial = inertial_for(c, mass);
  }
  for (Apart& pair : self_collisions(robot.model, whole.poses)) robot.model.apart.push_back(pair);
  out.model = std::move(robot.model);
  return out;
}

PaddedRobot pad_robot(const fs::path& path, const PadOptions& options, const RobotOptions& whole,
                      const PadProgress& progress) {
  return pad_robot(path, read_robot(path, whole.reading), options, whole, progress);
}

}  // namespace padder
