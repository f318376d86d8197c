// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "padding/asset/error.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

void append(Mesh& mesh, const Mesh& more) {
  const auto first = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), more.points.begin(), more.points.end());
  for (const auto& t : more.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

Mesh box(const Vector& size) {
  Mesh mesh;
  for (int k = 0; k < 8; k++)
    mesh.points.push_back(size.cwiseProduct(Vector(k & 1, k >> 1 & 1, k >> 2 & 1) - Vector::Constant(0.5)));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// A cylinder along z. Its polygon has the area of the circle, so that the mass is right.
Mesh cylinder(double radius, double length, double chord_error) {
  const double half = std::acos(std::clamp(1 - chord_error / radius, 0.0, 1.0));
  const auto n =
      static_cast<std::uint32_t>(std::clamp(std::ceil(std::numbers::pi / std::max(half, 1e-3)), 16.0, 512.0));
  const double corner = 2 * std::numbers::pi / n;
  const double r = radius * std::sqrt(corner / std::sin(corner));
  Mesh mesh;
  for (std::uint32_t k = 0; k < n; k++)
    for (const double z : {-length / 2, length / 2})
      mesh.points.emplace_back(r * std::cos(k * corner), r * std::sin(k * corner), z);
  mesh.points.emplace_back(0, 0, -length / 2), mesh.points.emplace_back(0, 0, length / 2);
  for (std::uint32_t k = 0; k < n; k++) {
    const std::uint32_t a = 2 * k, b = 2 * ((k + 1) % n);  // below; above are a + 1, b + 1
    mesh.triangles.insert(mesh.triangles.end(),
                          {{a, b, a + 1}, {b, b + 1, a + 1}, {2 * n, b, a}, {2 * n + 1, a + 1, b + 1}});
  }
  return mesh;
}

// For a sphere among other shapes; a link of spheres alone is not meshed.
Mesh sphere(double radius) {
  constexpr std::uint32_t rings = 16, around = 32;
  Mesh mesh;
  mesh.points = {{0, 0, radius}, {0, 0, -radius}};
  for (std::uint32_t i = 1; i < rings; i++)
    for (std::uint32_t j = 0; j < around; j++) {
      const double t = std::numbers::pi * i / rings, f = 2 * std::numbers::pi * j / around;
      mesh.points.emplace_back(radius *
                               Point(std::sin(t) * std::cos(f), std::sin(t) * std::sin(f), std::cos(t)));
    }
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return 2 + (i - 1) * around + j % around; };
  for (std::uint32_t j = 0; j < around; j++) {
    mesh.triangles.insert(mesh.triangles.end(),
                          {{0, at(1, j), at(1, j + 1)}, {1, at(rings - 1, j + 1), at(rings - 1, j)}});
    for (std::uint32_t i = 1; i + 1 < rings; i++)
      mesh.triangles.insert(mesh.triangles.end(), {{at(i, j), at(i + 1, j), at(i + 1, j + 1)},
                                                   {at(i, j), at(i + 1, j + 1), at(i, j + 1)}});
  }
  return mesh;
}

bool y_up(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending == ".dae" || ending == ".gltf" || ending == ".glb";
}

Mesh placed(Mesh mesh, const UrdfShape& shape) {
  for (Point& p : mesh.points) p = shape.pose * p.cwiseProduct(shape.scale);
  if (shape.scale.prod() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

double extent(const UrdfLink& link, const std::vector<ReadResult>& files) {
  Box box;
  for (std::size_t k = 0; k < link.shapes.size(); k++) {
    const UrdfShape& s = link.shapes[k];
    if (s.type == UrdfShape::Type::mesh)
      for (const Point& p : files[k].mesh.points) box.add(s.pose * p.cwiseProduct(s.scale));
    else
      box.add(s.pose.translation() - s.size), box.add(s.pose.translation() + s.size);
  }
  return box.diagonal();
}

bool only_spheres(const UrdfLink& link) {
  return std::all_of(link.shapes.begin(), link.shapes.end(),
                     [](const UrdfShape& s) { return s.type == UrdfShape::Type::sphere; });
}

// The spheres of the link as they are. The mass of several is left unknown, because they may overlap.
Cluster spheres_of(const UrdfLink& link, const fs::path& urdf) {
  Cluster c;
  c.unit = "m";
  c.program = "padder " PADDER_VERSION;
  c.source.file = urdf.filename().string() + ", link " + link.name;
  c.source.repair = "none: its shapes are spheres";
  c.accuracy.coverage = 1;
  for (const UrdfShape& s : link.shapes) {
    c.centers.push_back(s.pose.translation()), c.radii.push_back(s.size.x()), c.triangle.push_back(-1);
    c.bounds.add(c.centers.back() - s.size), c.bounds.add(c.centers.back() + s.size);
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

}  // namespace

ReadResult read_link(const UrdfLink& link, const fs::path& urdf) {
  std::vector<ReadResult> files(link.shapes.size());
  for (std::size_t k = 0; k < files.size(); k++) {
    if (link.shapes[k].type != UrdfShape::Type::mesh) continue;
    files[k] = read_mesh(link.shapes[k].file, ReadOptions{1, "m"});
    if (y_up(link.shapes[k].file))
      for (Point& p : files[k].mesh.points) p = Point(p.x(), -p.z(), p.y());
  }
  const double chord_error = extent(link, files) / 400;
  ReadResult all;
  all.unit = "m";
  for (const ReadResult& f : files)
    for (const std::string& note : f.notes) all.notes.push_back(link.name + ": " + note);
  for (std::size_t k = 0; k < files.size(); k++) {
    const UrdfShape& s = link.shapes[k];
    if (s.type == UrdfShape::Type::mesh) {
      append(all.mesh, placed(std::move(files[k].mesh), s));
      all.source.triangles += files[k].source.triangles;
    } else {
      const Mesh mesh = s.type == UrdfShape::Type::box        ? box(s.size)
                        : s.type == UrdfShape::Type::cylinder ? cylinder(s.size.x(), s.size.z(), chord_error)
                                                              : sphere(s.size.x());
      append(all.mesh, placed(mesh, s));
      all.source.triangles += mesh.triangles.size();
    }
  }
  if (files.size() == 1 && link.shapes[0].type == UrdfShape::Type::mesh)
    all.source.file = files[0].source.file, all.source.sha256 = files[0].source.sha256;
  else
    all.source.file = urdf.filename().string() + ", link " + link.name;
  return all;
}

PaddedRobot pad_robot(const fs::path& path, const PadOptions& options, const RobotProgress& progress) {
  Urdf urdf = read_urdf(path);
  if (std::all_of(urdf.links.begin(), urdf.links.end(), [](const UrdfLink& l) { return l.shapes.empty(); }))
    throw Error(path.string() + ": no link has any geometry");
  keep_neighbours_apart(urdf);
  PaddedRobot out;
  out.notes = std::move(urdf.notes);
  out.reports.resize(urdf.links.size());
  for (std::size_t k = 0; k < urdf.links.size(); k++) {
    const UrdfLink& link = urdf.links[k];
    if (progress) progress(link.name, k, urdf.links.size());
    Cluster& cluster = urdf.model.bodies[k].cluster;
    if (!link.shapes.empty()) {
      const std::uint32_t family = cluster.family, mask = cluster.mask;
      if (only_spheres(link)) {
        cluster = spheres_of(link, path);
      } else {
        try {
          const ReadResult file = read_link(link, path);
          out.notes.insert(out.notes.end(), file.notes.begin(), file.notes.end());
          Padded padded = pad(file, options);
          cluster = std::move(padded.cluster), out.reports[k] = padded.report;
        } catch (const Error& e) {
          throw Error(path.string() + ", link " + link.name + ": " + e.what());
        }
      }
      cluster.family = family, cluster.mask = mask;
    }
    cluster.name = link.name;
  }
  out.model = std::move(urdf.model);
  return out;
}

}  // namespace padder
