// SPDX-License-Identifier: MIT
// Writes glTF 2.0 binary. Every sphere is a node that shows a shared mesh of a unit sphere, which every
// viewer draws. The instanced form has one node for each body, which EXT_mesh_gpu_instancing draws once for
// each sphere: smaller and faster, but few viewers know it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "padding/asset/colours.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/export/icosphere.h"
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");
using Json = nlohmann::ordered_json;

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

// A material for each colour of a family, and a mesh of the unit sphere in it. All meshes share one geometry.
class Meshes {
 public:
  explicit Meshes(Buffer& buffer) {
    const Icosphere sphere = icosphere(2);
    std::vector<float> points;
    for (const Vector& v : sphere.points)
      for (int k = 0; k < 3; k++) points.push_back(static_cast<float>(v[k]));
    constexpr int vertices = 34962;
    attributes_ = {{"POSITION", buffer.add(points, 3, vertices, true)},
                   {"NORMAL", buffer.add(points, 3, vertices, false)}};
    corners_ = buffer.add_indices(sphere.corners);
  }
  std::size_t of_family(std::uint32_t family) {
    const Colour colour = colour_of_kind(family);
    const auto [it, fresh] = known_.emplace(colour, meshes.size());
    if (fresh) {
      Json factor = Json::array();
      for (const std::uint8_t c : colour) factor.push_back(std::pow(c / 255.0, 2.2));  // glTF's is linear
      factor.push_back(1);
      materials.push_back({{"pbrMetallicRoughness",
                            {{"baseColorFactor", factor}, {"metallicFactor", 0}, {"roughnessFactor", 0.7}}}});
      meshes.push_back({{"name", "sphere"},
                        {"primitives", Json::array({{{"attributes", attributes_},
                                                     {"indices", corners_},
                                                     {"material", materials.size() - 1}}})}});
    }
    return it->second;
  }
  Json meshes = Json::array(), materials = Json::array();

 private:
  Json attributes_;
  int corners_ = 0;
  std::map<Colour, std::size_t> known_;
};

// The nodes: a root that turns Z up to glTF's Y up, below it the bodies as their joints hang together, and
// below each body its spheres.
class Nodes {
 public:
  Nodes(const Model& model, bool instanced) : model_(model), instanced_(instanced), meshes_(buffer_) {
    nodes_.push_back({{"name", model.name}});
    if (!is_of_gltf(model)) nodes_[0]["rotation"] = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
    std::vector<std::size_t> at;
    for (const Body& b : model.bodies) {
      at.push_back(nodes_.size());
      const std::size_t parent = b.parent < 0 ? 0 : at[static_cast<std::size_t>(b.parent)];
      nodes_.push_back({{"name", b.name}});
      nodes_[parent]["children"].push_back(at.back());
      const Eigen::Matrix4d m = b.pose.matrix();
      if (!m.isIdentity(0)) {
        Json columns = Json::array();
        for (int k = 0; k < 16; k++) columns.push_back(m(k % 4, k / 4));
        nodes_[at.back()]["matrix"] = columns;
      }
      if (b.cluster.size() > 0) add_spheres(b, at.back());
    }
  }

  std::string document() {
    Json j;
    j["asset"] = {{"version", "2.0"}, {"generator", origin(model_)}};
    if (instanced_) j["extensionsUsed"] = j["extensionsRequired"] = Json::array({"EXT_mesh_gpu_instancing"});
    j["scene"] = 0;
    j["scenes"] = {{{"nodes", {0}}}};
    j["nodes"] = nodes_, j["meshes"] = meshes_.meshes, j["materials"] = meshes_.materials;
    j["accessors"] = buffer_.accessors, j["bufferViews"] = buffer_.views;
    buffer_.bytes.resize((buffer_.bytes.size() + 3) / 4 * 4);
    j["buffers"] = {{{"byteLength", buffer_.bytes.size()}}};
    std::string text = j.dump(-1, ' ', false, Json::error_handler_t::replace);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const std::size_t size = 12 + 8 + text.size() + 8 + buffer_.bytes.size();
    if (size > 0xffffffffull) throw Error("the spheres are beyond the 4 GiB of a .glb: write .npz");
    std::string out = "glTF";
    append_u32(out, 2), append_u32(out, size);
    append_u32(out, text.size());
    out += "JSON" + text;
    append_u32(out, buffer_.bytes.size());
    return out + std::string("BIN\0", 4) + buffer_.bytes;
  }

 private:
  void add_spheres(const Body& body, std::size_t node) {
    const Cluster& c = body.cluster;
    const std::size_t mesh = meshes_.of_family(c.family);
    check_floats(body, Eigen::Isometry3d::Identity(), ".glb");
    if (instanced_) {
      add_instances(body, nodes_[node], mesh);
      return;
    }
    nodes_[node]["extras"] = {{"family", c.family}, {"mask", c.mask}};
    for (std::size_t k = 0; k < c.size(); k++) {
      Json place = Json::array(), scale = Json::array();
      for (int x = 0; x < 3; x++) {
        place.push_back(static_cast<float>(c.centers[k][x]));
        scale.push_back(static_cast<float>(c.radii[k]));
      }
      nodes_[node]["children"].push_back(nodes_.size());
      nodes_.push_back({{"mesh", mesh}, {"translation", place}, {"scale", scale}});
    }
  }

  void add_instances(const Body& body, Json& node, std::size_t mesh) {
    const Cluster& c = body.cluster;
    std::vector<float> translation, scale;
    for (std::size_t k = 0; k < c.size(); k++) {
      for (int x = 0; x < 3; x++) translation.push_back(static_cast<float>(c.centers[k][x]));
      scale.insert(scale.end(), 3, static_cast<float>(c.radii[k]));
    }
    const auto same = [&](std::uint32_t value, const char* what) {
      return buffer_.add(std::vector<float>(c.size(), as_float(value, body.name, what)), 1, 0, false);
    };
    Json attributes{{"TRANSLATION", buffer_.add(translation, 3, 0, false)},
                    {"SCALE", buffer_.add(scale, 3, 0, false)}};
    attributes["_FAMILY"] = same(c.family, "family"), attributes["_MASK"] = same(c.mask, "mask");
    node["mesh"] = mesh;
    node["extensions"] = {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}};
  }

  const Model& model_;
  bool instanced_;
  Buffer buffer_;
  Meshes meshes_;
  Json nodes_ = Json::array();
};

}  // namespace

bool is_of_gltf(const Model& model) {
  if (model.robot() || model.bodies.size() != 1) return false;
  const std::string ending = ending_of(model.bodies[0].cluster.source.file);
  return ending == ".gltf" || ending == ".glb";
}

Files write_glb(const Job& job) { return {{"", Nodes(job.model, false).document()}}; }

Files write_glb_instanced(const Job& job) { return {{"", Nodes(job.model, true).document()}}; }

}  // namespace padder::exporting
