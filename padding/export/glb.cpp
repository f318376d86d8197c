// SPDX-License-Identifier: MIT
// Writes glTF 2.0 binary: one mesh of a unit sphere, which EXT_mesh_gpu_instancing draws once for each sphere
// of a body.
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");
using Json = nlohmann::ordered_json;

struct Sphere {
  std::vector<Vector> points;  // on the unit sphere: also the normals
  std::vector<std::uint16_t> corners;
};

// An icosahedron, each triangle split in four `levels` times.
Sphere unit_sphere(int levels) {
  Sphere s;
  const double g = (1 + std::sqrt(5.0)) / 2;
  for (const auto& [a, b] : {std::pair(1.0, g), {1.0, -g}, {-1.0, g}, {-1.0, -g}})
    for (int k = 0; k < 3; k++) {
      Vector v = Vector::Zero();
      v[k] = a, v[(k + 1) % 3] = b;
      s.points.push_back(v.normalized());
    }
  // Its faces: the triples at the edge's length, turned outwards.
  const double edge = 2 / std::sqrt(1 + g * g) + 1e-9;
  for (std::uint16_t i = 0; i < 12; i++)
    for (std::uint16_t j = i + 1; j < 12; j++)
      for (std::uint16_t k = j + 1; k < 12; k++) {
        const Vector &a = s.points[i], &b = s.points[j], &c = s.points[k];
        if ((a - b).norm() > edge || (b - c).norm() > edge || (c - a).norm() > edge) continue;
        const bool outwards = (b - a).cross(c - a).dot(a) > 0;
        s.corners.insert(s.corners.end(), {i, outwards ? j : k, outwards ? k : j});
      }
  for (int level = 0; level < levels; level++) {
    std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint16_t> middles;
    const auto middle = [&](std::uint16_t a, std::uint16_t b) {
      const auto [it, fresh] =
          middles.emplace(std::minmax({a, b}), static_cast<std::uint16_t>(s.points.size()));
      if (fresh) s.points.push_back((s.points[a] + s.points[b]).normalized());
      return it->second;
    };
    std::vector<std::uint16_t> finer;
    for (std::size_t t = 0; t < s.corners.size(); t += 3) {
      const std::uint16_t a = s.corners[t], b = s.corners[t + 1], c = s.corners[t + 2];
      const std::uint16_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
    }
    s.corners = std::move(finer);
  }
  return s;
}

// The document's arrays: one buffer, a view and an accessor each.
class Buffer {
 public:
  Json views = Json::array(), accessors = Json::array();
  std::string bytes;

  int add(const std::vector<float>& values, int components, int target, bool bounds) {
    const int accessor = append(values.data(), values.size() * sizeof(float), target);
    Json& a = accessors.back();
    a["componentType"] = 5126, a["count"] = values.size() / static_cast<std::size_t>(components);
    a["type"] = components == 3 ? "VEC3" : "SCALAR";
    if (bounds) {  // POSITION must have them
      Json low = Json::array(), high = Json::array();
      for (int c = 0; c < components; c++) {
        float least = values[static_cast<std::size_t>(c)], most = least;
        for (std::size_t k = static_cast<std::size_t>(c); k < values.size();
             k += static_cast<std::size_t>(components))
          least = std::min(least, values[k]), most = std::max(most, values[k]);
        low.push_back(least), high.push_back(most);
      }
      a["min"] = low, a["max"] = high;
    }
    return accessor;
  }
  int add_indices(const std::vector<std::uint16_t>& values) {
    const int accessor = append(values.data(), values.size() * sizeof(std::uint16_t), 34963);
    accessors.back().update({{"componentType", 5123}, {"count", values.size()}, {"type", "SCALAR"}});
    return accessor;
  }

 private:
  int append(const void* data, std::size_t size, int target) {
    bytes.resize((bytes.size() + 3) / 4 * 4);
    Json view{{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", size}};
    if (target) view["target"] = target;
    views.push_back(view);
    accessors.push_back({{"bufferView", views.size() - 1}});
    bytes.append(static_cast<const char*>(data), size);
    return static_cast<int>(accessors.size()) - 1;
  }
};

void append_u32(std::string& out, std::size_t value) {
  for (int k = 0; k < 4; k++) out += static_cast<char>(value >> 8 * k & 255);
}

// Attributes of instances cannot be 32-bit integers in glTF, so families are floats, which hold 24 bits.
float as_float(std::uint32_t value, const std::string& body, const char* what) {
  const float f = static_cast<float>(value);
  if (static_cast<double>(f) != value)
    throw Error("a .glb holds numbers as float32, which cannot hold the " + std::string(what) + " " +
                std::to_string(value) + " of " + body + ": write .npz or .vtp");
  return f;
}

float as_length(double value, const std::string& body) {
  const float f = static_cast<float>(value);
  if (!std::isfinite(f) || (value != 0 && f == 0))
    throw Error("a .glb holds numbers as float32, which cannot hold the length " + number(value) + " of " +
                body + ": give the mesh a --unit or a --scale");
  return f;
}

}  // namespace

Files write_glb(const Job& job) {
  Buffer buffer;
  const Sphere sphere = unit_sphere(2);
  std::vector<float> points;
  for (const Vector& v : sphere.points)
    for (int k = 0; k < 3; k++) points.push_back(static_cast<float>(v[k]));
  constexpr int vertices = 34962;
  const int positions = buffer.add(points, 3, vertices, true),
            normals = buffer.add(points, 3, vertices, false);
  const int corners = buffer.add_indices(sphere.corners);

  const auto poses = world_poses(job.model);
  Json nodes = Json::array(), roots = Json::array();
  for (std::size_t b = 0; b < job.model.bodies.size(); b++) {
    const Body& body = job.model.bodies[b];
    const Cluster& c = body.cluster;
    if (c.size() == 0) continue;
    std::vector<float> translation, scale;
    for (std::size_t k = 0; k < c.size(); k++) {
      for (int x = 0; x < 3; x++) translation.push_back(as_length(c.centers[k][x], body.name));
      scale.insert(scale.end(), 3, as_length(c.radii[k], body.name));
    }
    Json attributes{{"TRANSLATION", buffer.add(translation, 3, 0, false)},
                    {"SCALE", buffer.add(scale, 3, 0, false)}};
    attributes["_FAMILY"] =
        buffer.add(std::vector<float>(c.size(), as_float(c.family, body.name, "family")), 1, 0, false);
    attributes["_MASK"] =
        buffer.add(std::vector<float>(c.size(), as_float(c.mask, body.name, "mask")), 1, 0, false);
    Json node{{"name", body.name}, {"mesh", 0}};
    const Eigen::Matrix4d m = poses[b].matrix();
    if (!m.isIdentity(0)) {
      Json columns = Json::array();
      for (int k = 0; k < 16; k++) columns.push_back(m(k % 4, k / 4));
      node["matrix"] = columns;
    }
    node["extensions"] = {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}};
    roots.push_back(nodes.size());
    nodes.push_back(node);
  }

  Json j;
  j["asset"] = {{"version", "2.0"}, {"generator", origin(job.model)}};
  j["extensionsUsed"] = j["extensionsRequired"] = Json::array({"EXT_mesh_gpu_instancing"});
  j["scene"] = 0;
  j["scenes"] = {{{"nodes", roots}}};
  j["nodes"] = nodes;
  j["meshes"] = {{{"name", "sphere"},
                  {"primitives",
                   {{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}},
                     {"indices", corners},
                     {"material", 0}}}}}};
  j["materials"] = {
      {{"pbrMetallicRoughness",
        {{"baseColorFactor", {0.8, 0.8, 0.8, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.7}}}}};
  j["accessors"] = buffer.accessors, j["bufferViews"] = buffer.views;
  buffer.bytes.resize((buffer.bytes.size() + 3) / 4 * 4);
  j["buffers"] = {{{"byteLength", buffer.bytes.size()}}};
  std::string text = j.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t size = 12 + 8 + text.size() + 8 + buffer.bytes.size();
  if (size > 0xffffffffull) throw Error("the spheres are beyond the 4 GiB of a .glb: write .npz");
  std::string out = "glTF";
  append_u32(out, 2), append_u32(out, size);
  append_u32(out, text.size());
  out += "JSON" + text;
  append_u32(out, buffer.bytes.size());
  out += std::string("BIN\0", 4) + buffer.bytes;
  return {{"", out}};
}

}  // namespace padder::exporting
