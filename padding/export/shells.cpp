// SPDX-License-Identifier: MIT
// Writes the spheres' surfaces as triangle meshes to look at: .stl, .ply, .obj. Each sphere is an icosphere,
// less the triangles that lie wholly inside another sphere of the same body. What is left shows the surface
// of the union from outside; it is no closed mesh, because triangles that cross another sphere stay whole.
// (A closed mesh of the union would need its arcs and their triangulation, for no gain to the eye.)
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "padding/asset/colours.h"
#include "padding/asset/error.h"
#include "padding/export/icosphere.h"
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

// For each sphere those that it overlaps, in any order.
std::vector<std::vector<std::uint32_t>> overlapping(const Cluster& c) {
  std::vector<std::uint32_t> order(c.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto low = [&](std::uint32_t k) { return c.centers[k].x() - c.radii[k]; };
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return low(a) < low(b); });
  std::vector<std::vector<std::uint32_t>> out(c.size());
  for (std::size_t i = 0; i < order.size(); i++) {
    const std::uint32_t a = order[i];
    for (std::size_t j = i + 1; j < order.size() && low(order[j]) < c.centers[a].x() + c.radii[a]; j++) {
      const std::uint32_t b = order[j];
      if ((c.centers[a] - c.centers[b]).norm() < c.radii[a] + c.radii[b])
        out[a].push_back(b), out[b].push_back(a);
    }
  }
  return out;
}

// The triangles of one body that are seen from outside, placed in the world.
Mesh shell_of(const Cluster& c, const Eigen::Isometry3d& pose) {
  static const Icosphere sphere = icosphere(2);
  constexpr std::uint32_t unused = ~std::uint32_t(0);
  auto others = overlapping(c);
  Mesh out;
  std::vector<std::uint32_t> index(sphere.points.size());
  for (std::uint32_t k = 0; k < c.size(); k++) {
    std::fill(index.begin(), index.end(), unused);
    const auto corner = [&](std::uint16_t v) -> Point {
      return c.centers[k] + c.radii[k] * sphere.points[v];
    };
    std::vector<std::uint32_t>& near = others[k];
    for (std::size_t t = 0; t < sphere.corners.size(); t += 3) {
      const std::uint16_t* v = &sphere.corners[t];
      // A ball is convex: with its corners, the triangle is inside.
      const auto hides = [&](std::uint32_t other) {
        for (int n = 0; n < 3; n++)
          if (!((corner(v[n]) - c.centers[other]).norm() < c.radii[other])) return false;
        return true;
      };
      const auto hider = std::ranges::find_if(near, hides);
      if (hider != near.end()) {
        std::iter_swap(near.begin(), hider);  // it may hide the next triangle, too
        continue;
      }
      std::array<std::uint32_t, 3> triangle;
      for (int n = 0; n < 3; n++) {
        if (index[v[n]] == unused) {
          index[v[n]] = static_cast<std::uint32_t>(out.points.size());
          out.points.push_back(pose * corner(v[n]));
        }
        triangle[static_cast<std::size_t>(n)] = index[v[n]];
      }
      out.triangles.push_back(triangle);
    }
    if (out.points.size() > 0xf0000000u)
      throw Error("too many spheres for a file of triangles: write .glb, .vtp or .npz");
  }
  return out;
}

template <class T>
void append_bytes(std::string& out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

void append_bytes(std::string& out, const Vector& v) {
  for (int k = 0; k < 3; k++) append_bytes(out, static_cast<float>(v[k]));
}

// Each body's shell, and what it is. `floats`: the ending of a file that holds floats, or null.
template <class Each>
void each_shell(const Model& model, const char* floats, Each&& each) {
  const auto poses = poses_at(model);
  for (std::size_t b = 0; b < model.bodies.size(); b++) {
    const Body& body = model.bodies[b];
    if (floats) check_floats(body, poses[b], floats);
    if (body.cluster.size() > 0) each(body, shell_of(body.cluster, poses[b]));
  }
}

}  // namespace

// Binary STL: a head of 80 bytes, a count, and for each triangle its normal, its corners and two bytes.
Files write_stl(const Job& job) {
  std::string out = origin(job.model).substr(0, 70);
  out.resize(80, ' ');
  append_bytes(out, std::uint32_t(0));
  std::uint64_t count = 0;
  each_shell(job.model, ".stl", [&](const Body&, const Mesh& shell) {
    count += shell.triangles.size();
    for (const auto& t : shell.triangles) {
      const Point &a = shell.points[t[0]], &b = shell.points[t[1]], &c = shell.points[t[2]];
      append_bytes(out, Vector((b - a).cross(c - a).normalized()));
      append_bytes(out, a), append_bytes(out, b), append_bytes(out, c);
      append_bytes(out, std::uint16_t(0));
    }
  });
  if (count > 0xffffffffu) throw Error("too many triangles for a .stl: write .ply");
  const auto total = static_cast<std::uint32_t>(count);
  std::memcpy(out.data() + 80, &total, 4);
  return {{"", std::move(out)}};
}

Files write_ply(const Job& job) {
  std::string vertices, faces;
  std::uint64_t points = 0, triangles = 0;
  each_shell(job.model, ".ply", [&](const Body& body, const Mesh& shell) {
    const Colour colour = colour_of_kind(body.cluster.family);
    for (const Point& p : shell.points) {
      append_bytes(vertices, p);
      for (const std::uint8_t c : colour) append_bytes(vertices, c);
      append_bytes(vertices, body.cluster.family);
    }
    for (const auto& t : shell.triangles) {
      append_bytes(faces, std::uint8_t(3));
      for (const std::uint32_t v : t) append_bytes(faces, static_cast<std::uint32_t>(points + v));
    }
    points += shell.points.size(), triangles += shell.triangles.size();
  });
  if (points > 0x7fffffffu) throw Error("too many triangles for a .ply: write .glb, .vtp or .npz");
  return {{"", "ply\nformat binary_little_endian 1.0\ncomment " + origin(job.model) + "\nelement vertex " +
                   std::to_string(points) +
                   "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty "
                   "uchar green\nproperty uchar blue\nproperty uint family\nelement face " +
                   std::to_string(triangles) + "\nproperty list uchar int vertex_indices\nend_header\n" +
                   vertices + faces}};
}

// Colours stand behind the coordinates of each vertex, which most readers take or leave.
Files write_obj(const Job& job) {
  std::string out = "# " + origin(job.model) + "\n";
  std::uint64_t points = 1;  // the first vertex is number 1
  const std::vector<std::string> names = identifiers(job.model);
  each_shell(job.model, nullptr, [&](const Body& body, const Mesh& shell) {
    out += "o " + names[static_cast<std::size_t>(&body - job.model.bodies.data())] + "\n";
    std::string colour;
    for (const std::uint8_t c : colour_of_kind(body.cluster.family))
      colour += " " + number(std::round(c / 255.0 * 1000) / 1000);
    for (const Point& p : shell.points) out += "v " + numbers(p) + colour + "\n";
    for (const auto& t : shell.triangles)
      out += "f " + std::to_string(points + t[0]) + " " + std::to_string(points + t[1]) + " " +
             std::to_string(points + t[2]) + "\n";
    points += shell.points.size();
  });
  return {{"", std::move(out)}};
}

}  // namespace padder::exporting
