// SPDX-License-Identifier: MIT
// Reads the formats that assimp knows. Runs in a child process (mesh_from_child), because assimp 5.2 may
// abort on a damaged file.
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/MemoryIOWrapper.h>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cmath>
#include <map>
#include <new>
#include <set>
#include <string_view>
#include <utility>

#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"
#include "padding/input/packages.h"
#include "padding/input/read_internal.h"

namespace padder::reading {
namespace {

namespace fs = std::filesystem;

// Collects what assimp says during an import; nothing of it is printed. assimp has one log for the whole
// process, which here is the child.
class ImportLog : public Assimp::LogStream {
 public:
  ImportLog() {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(this, Assimp::Logger::Warn | Assimp::Logger::Err);
  }
  ~ImportLog() override {
    Assimp::DefaultLogger::get()->detachStream(this, Assimp::Logger::Warn | Assimp::Logger::Err);
    Assimp::DefaultLogger::kill();
  }
  void write(const char* message) override { text_ += message; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string one_line(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return c == '\n' || c == '\r'; }, ' ');
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return excerpt(text, 200);
}

// What assimp may open: the scene itself and the buffers of a glTF, from memory.
class Files : public Assimp::IOSystem {
 public:
  Files(const std::string& scene, const fs::path& path, const FilesBeside& beside)
      : scene_(scene), path_(path.lexically_normal()), beside_(beside) {}
  bool Exists(const char* name) const override { return bytes_of(name) != nullptr; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char*) override {
    const std::string* bytes = bytes_of(name);
    return bytes ? new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(bytes->data()),
                                              bytes->size())
                 : nullptr;
  }
  void Close(Assimp::IOStream* file) override { delete file; }

 private:
  const std::string* bytes_of(const char* name) const {
    const fs::path path = fs::path(name).lexically_normal();
    const auto at = beside_.find(path);
    return path == path_ ? &scene_ : at != beside_.end() ? &at->second : nullptr;
  }
  const std::string& scene_;
  const fs::path path_;
  const FilesBeside& beside_;
};

// FBX says how many centimetres its unit has.
std::string unit_of(const aiScene& scene, const std::string& ending, double& factor) {
  if (ending == ".gltf" || ending == ".glb" || ending == ".dae") return "m";
  if (ending != ".fbx" || !scene.mMetaData) return "";
  double centimetres = 0;
  float single = 0;
  if (!scene.mMetaData->Get("UnitScaleFactor", centimetres) &&
      scene.mMetaData->Get("UnitScaleFactor", single))
    centimetres = single;
  if (!(centimetres > 0)) return "";
  for (const auto& [unit, size] : {std::pair{"m", 100.0}, {"cm", 1.0}, {"mm", 0.1}, {"in", 2.54}})
    if (std::abs(centimetres - size) < 1e-6 * size) return unit;
  factor = centimetres;
  return "cm";
}

Eigen::Matrix4d matrix(const aiMatrix4x4& m) {
  Eigen::Matrix4d d;
  d << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
  return d;
}

// Where the vertices of a mesh stand, and whether it is mirrored there.
struct Placed {
  std::vector<Point> points;
  bool mirrored = false;
};
bool mirrors(const Eigen::Matrix4d& place) { return place.topLeftCorner<3, 3>().determinant() < 0; }

Placed placed(const aiMesh& mesh, const Eigen::Matrix4d& place) {
  Placed out{{}, mirrors(place)};
  for (unsigned v = 0; v < mesh.mNumVertices; v++) {
    const aiVector3D& p = mesh.mVertices[v];
    out.points.push_back((place * Eigen::Vector4d(p.x, p.y, p.z, 1)).head<3>());
  }
  return out;
}

// The same for a mesh with a skin: each vertex stands where its joints hold it, and the place of the mesh's
// own node does not count (glTF 2.0, section 3.7.3.3). A vertex that no joint holds stays at that place.
Placed skinned(const aiMesh& mesh, const Eigen::Matrix4d& place,
               const std::map<std::string, Eigen::Matrix4d>& places) {
  Placed out = placed(mesh, place), held{std::vector<Point>(mesh.mNumVertices, Point::Zero()), false};
  std::vector<double> weights(mesh.mNumVertices, 0);
  double mirrored = 0, all = 0;
  for (unsigned b = 0; b < mesh.mNumBones; b++) {
    const aiBone& bone = *mesh.mBones[b];
    const auto joint = places.find(bone.mName.C_Str());
    if (joint == places.end()) continue;
    const Eigen::Matrix4d moved = joint->second * matrix(bone.mOffsetMatrix);
    const Placed by_bone = placed(mesh, moved);
    for (unsigned w = 0; w < bone.mNumWeights; w++) {
      const auto [v, weight] = bone.mWeights[w];
      if (v >= mesh.mNumVertices || !(weight > 0)) continue;
      held.points[v] += weight * by_bone.points[v], weights[v] += weight;
      all += weight, mirrored += mirrors(moved) ? weight : 0;
    }
  }
  for (unsigned v = 0; v < mesh.mNumVertices; v++)
    if (weights[v] > 0) out.points[v] = held.points[v] / weights[v];
  if (all > 0) out.mirrored = mirrored > 0.5 * all;
  return out;
}

void add(const aiMesh& mesh, const Placed& at, double factor, const std::string& where, Soup& soup) {
  check_counts(soup.points.size() + mesh.mNumVertices, soup.ends.size() + mesh.mNumFaces, where);
  const std::uint32_t first = static_cast<std::uint32_t>(soup.points.size());
  for (const Point& p : at.points) soup.points.push_back(factor * p);
  for (unsigned f = 0; f < mesh.mNumFaces; f++) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices < 3) {
      soup.thin++;
      continue;
    }
    for (unsigned k = 0; k < face.mNumIndices; k++) {
      const unsigned v = face.mIndices[at.mirrored ? face.mNumIndices - 1 - k : k];
      if (v >= mesh.mNumVertices)
        fail(where, "face " + std::to_string(f + 1) + " of mesh '" + one_line(mesh.mName.C_Str()) +
                        "' names vertex " + std::to_string(v) + " of " + std::to_string(mesh.mNumVertices) +
                        ": export it again");
      soup.corners.push_back(first + v);
    }
    soup.close_face();
  }
}

// The files with the buffers of a glTF, by the paths under which assimp will ask for them.
std::map<fs::path, fs::path> buffers_beside(const nlohmann::json& json, const fs::path& path) {
  std::map<fs::path, fs::path> beside;
  if (!json.is_object() || !json.contains("buffers")) return beside;
  for (const auto& buffer : json["buffers"]) {
    const auto uri = buffer.is_object() ? buffer.find("uri") : buffer.end();
    if (!buffer.is_object() || uri == buffer.end() || !uri->is_string()) continue;
    const std::string text = *uri;
    const fs::path asked = (path.parent_path() / text).lexically_normal();  // by assimp, as it stands there
    for (const std::string& name : {unescaped(text), text}) {               // some exporters forget to escape
      if (text.starts_with("data:") || name.find('\0') != name.npos) continue;
      // A pipe or a device among them would never end, and one outside of its folder is none of its business:
      // a scene that somebody else sends could show what is in it.
      const fs::path file = (path.parent_path() / name).lexically_normal(),
                     within = file.lexically_relative(path.lexically_normal().parent_path());
      std::error_code code;
      if (!within.empty() && *within.begin() != ".." && fs::is_regular_file(file, code))
        beside.emplace(asked, file);
    }
  }
  return beside;
}

// assimp gives the shape without its morph targets. The weights of a node go before those of its mesh.
void check_morphs(const JsonPlace<nlohmann::json>& document) {
  for (const auto& node : document.all("nodes")) {
    if (!node.has("mesh") || !document.has("meshes")) continue;
    const std::uint64_t index = node.at("mesh").whole(~std::uint64_t(0));
    if (index >= document.at("meshes").size()) continue;  // assimp says so
    const auto mesh = document.at("meshes").at(index), holder = node.has("weights") ? node : mesh;
    for (const auto& weight : holder.all("weights"))
      if (weight.real() != 0)
        holder.at("weights").fail(
            "a morph target that shows is not read: export the mesh with its shape applied");
  }
}

// What assimp would take without a word, or end at. A quaternion that is not of length 1 stretches the part.
void check_places(const JsonPlace<nlohmann::json>& document) {
  for (const auto& node : document.all("nodes")) {
    if (node.has("rotation")) {
      double q[4];
      node.at("rotation").reals(q);
      if (!(std::abs(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) - 1) < 0.01))
        node.at("rotation").fail("the quaternion is not of length 1: export it again");
    }
    if (node.has("matrix")) {
      double m[16];
      node.at("matrix").reals(m);
      if (!(std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11]), std::abs(m[15] - 1)}) < 1e-6))
        node.at("matrix").fail("its last row is not 0, 0, 0, 1: export it again");
    }
  }
  for (const auto& skin : document.all("skins"))
    if (!skin.has("inverseBindMatrices"))
      skin.fail("a skin without inverseBindMatrices is not read: export it with them, or without the skin");
}

// assimp takes what comes for 32-bit floats, and quantized coordinates in silence for others.
void check_positions(const JsonPlace<nlohmann::json>& document) {
  for (const auto& mesh : document.all("meshes"))
    for (const auto& primitive : mesh.all("primitives")) {
      if (!primitive.has("attributes") || !primitive.at("attributes").has("POSITION")) continue;
      const std::uint64_t index = primitive.at("attributes").at("POSITION").whole(~std::uint64_t(0));
      if (!document.has("accessors") || index >= document.at("accessors").size()) continue;  // assimp says so
      const auto accessor = document.at("accessors").at(index);
      if (!(accessor.has("componentType") && accessor.at("componentType").whole(~std::uint64_t(0)) == 5126 &&
            accessor.has("type") && accessor.at("type").text() == "VEC3"))
        accessor.fail(
            "coordinates are read as VEC3 of floats (componentType 5126) alone: export it without "
            "quantization (KHR_mesh_quantization)");
    }
}

// The length of the JSON, which stands behind a header of 12 bytes, its length and its kind.
std::size_t glb_json_length(std::string_view bytes, const std::string& where) {
  std::uint32_t length = 0;
  if (bytes.size() < 20 || !bytes.starts_with("glTF") || bytes.substr(16, 4) != "JSON")
    fail(where, "it is no binary glTF 2, or cut short: export it again");
  for (std::size_t k = 4; k-- > 0;) length = length << 8 | static_cast<unsigned char>(bytes[12 + k]);
  if (length > bytes.size() - 20) fail(where, "it is cut short: export it again");
  return length;
}

// The same file with another JSON, whose end is filled up to a multiple of four bytes.
std::string glb_with_json(std::string_view bytes, std::size_t length, std::string json) {
  json.append(3 - (json.size() + 3) % 4, ' ');
  std::string out = std::string(bytes.substr(0, 20)) + json + std::string(bytes.substr(20 + length));
  const auto put = [&](std::size_t at, std::size_t value) {
    for (std::size_t k = 0; k < 4; k++) out[at + k] = static_cast<char>(value >> 8 * k);
  };
  put(8, out.size()), put(12, json.size());
  return out;
}

// A binary glTF whose JSON ends at a multiple of four bytes. Some exporters forget it, and assimp looks for
// the buffer only there. Empty where nothing is to be done.
std::string padded_glb(std::string_view bytes, const std::string& where) {
  const std::size_t length = glb_json_length(bytes, where), end = 20 + length;
  if (length % 4 == 0 || bytes.size() < end + 8 || bytes.substr(end + 4, 3) != "BIN") return {};
  return glb_with_json(bytes, length, std::string(bytes.substr(20, length)));
}

// Gives a document without a scene one of all nodes that no other holds, as most readers show it, and a node
// for each mesh where there is none. Returns the note that says so.
std::string add_scene(nlohmann::json& json) {
  using Json = nlohmann::json;
  const auto is_list = [](const Json& in, const char* key) {
    return in.is_object() && in.contains(key) && in[key].is_array() && !in[key].empty();
  };
  const bool has_nodes = is_list(json, "nodes");
  if (!has_nodes) {
    json["nodes"] = Json::array();
    for (std::size_t k = 0; is_list(json, "meshes") && k < json["meshes"].size(); k++)
      json["nodes"].push_back({{"mesh", k}});
  }
  std::set<Json> held;
  for (const Json& node : json["nodes"])
    if (is_list(node, "children")) held.insert(node["children"].begin(), node["children"].end());
  Json roots = Json::array();
  for (std::size_t k = 0; k < json["nodes"].size(); k++)
    if (!held.contains(Json(k))) roots.push_back(k);
  json["scene"] = 0, json["scenes"] = Json::array({{{"nodes", roots}}});
  return has_nodes ? "it has no scene: all its nodes are read"
                   : "it has neither a scene nor nodes: its meshes are read where their coordinates say";
}

bool is_gltf_1(const nlohmann::json& json) {
  const nlohmann::json::json_pointer pointer("/asset/version");
  if (!json.contains(pointer)) return false;
  const auto& version = json[pointer];
  return version.is_string() ? version.get_ref<const std::string&>().starts_with("1.")
                             : version.is_number() && version.get<double>() < 2;
}

}  // namespace

FilesBeside check_gltf(std::string& bytes, const fs::path& path, const std::string& ending,
                       std::vector<std::string>& notes) {
  const std::string where = path.string();
  const std::size_t length = ending == ".glb" ? glb_json_length(bytes, where) : 0;
  using Json = nlohmann::json;
  Json json = parse_json<Json>(ending == ".glb" ? std::string_view(bytes).substr(20, length) : bytes, where,
                               "a glTF is wanted: export it again");
  const JsonPlace<Json> document(json, where);
  if (is_gltf_1(json)) fail(where, "it is glTF 1, which is not read: export it as glTF 2");
  const auto names = [&](const char* key) {
    std::vector<std::string> out;
    for (const auto& name : document.all(key)) out.push_back(name.text());
    return out;
  };
  const auto harmless = [](std::string_view name) {  // only how it looks
    return name.starts_with("KHR_materials_") || name.starts_with("KHR_texture_") ||
           name.starts_with("EXT_texture_") || name.starts_with("KHR_lights_") || name.starts_with("KHR_xmp");
  };
  for (const std::string& name : names("extensionsRequired"))
    if (!harmless(name))
      fail(where,
           "it needs the glTF extension '" + excerpt(name) + "', which is not read: export it without");
  for (const std::string& name : names("extensionsUsed"))
    if (name == "EXT_mesh_gpu_instancing" || name == "KHR_draco_mesh_compression" ||
        name == "EXT_meshopt_compression")
      fail(where, "it uses the glTF extension '" + name + "', which is not read: export it without");
  check_positions(document);
  check_places(document);
  check_morphs(document);
  FilesBeside beside;
  for (const auto& [asked, file] : buffers_beside(json, path)) beside[asked] = read_file(file);
  document.object();
  if (!document.has("scenes") || document.at("scenes").size() == 0) {
    notes.push_back(add_scene(json));
    bytes = ending == ".glb" ? glb_with_json(bytes, length, json.dump()) : json.dump();
  }
  return beside;
}

std::vector<fs::path> files_beside_gltf(const fs::path& path) {
  std::vector<fs::path> files;
  const auto json = parse_json<nlohmann::json>(read_file(path, kMostText), path.string());
  for (const auto& [asked, file] : buffers_beside(json, path)) files.push_back(file);
  return files;
}

Soup read_scene(const std::string& bytes, const FilesBeside& beside, const fs::path& path,
                const std::string& ending) {
  const std::string where = path.string();
  // Of COLLADA no skin is looked at, as RViz, MoveIt and Gazebo do.
  const bool gltf = ending == ".gltf" || ending == ".glb";
  Soup soup;
  const std::string plain = ending == ".dae"   ? plain_collada(bytes, soup.notes, where)
                            : ending == ".glb" ? padded_glb(bytes, where)
                                               : std::string();
  ImportLog log;
  Assimp::Importer importer;
  // The importer owns the files, which have the bytes by reference.
  importer.SetIOHandler(new Files(plain.empty() ? bytes : plain, path, beside));
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                  aiComponent_TEXCOORDS | aiComponent_ANIMATIONS | aiComponent_TEXTURES |
                                  aiComponent_LIGHTS | aiComponent_CAMERAS | aiComponent_MATERIALS |
                                  (gltf ? 0 : int(aiComponent_BONEWEIGHTS)));
  for (const char* part : {AI_CONFIG_IMPORT_FBX_READ_MATERIALS, AI_CONFIG_IMPORT_FBX_READ_TEXTURES,
                           AI_CONFIG_IMPORT_FBX_READ_LIGHTS, AI_CONFIG_IMPORT_FBX_READ_CAMERAS,
                           AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS, AI_CONFIG_IMPORT_FBX_READ_WEIGHTS})
    importer.SetPropertyBool(part, false);
  // Bones and nodes without a mesh have no surface, but assimp would make meshes of them.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  // ROS and Gazebo look at no up axis of COLLADA, and its files are made for them.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* scene = importer.ReadFile(where, aiProcess_RemoveComponent);
  const std::string error = importer.GetErrorString();
  if (error.find("bad_alloc") != std::string::npos)
    throw std::bad_alloc();  // nodes of a COLLADA that multiply one another, say
  // assimp drops such faces and only says so in its log. Without a scene it says "out of range" of other
  // things.
  const auto logged = [&](const char* words) { return log.text().find(words) != std::string::npos; };
  if (logged("out-of-range") || (scene && logged("out of range")))
    fail(where, "faces with an index out of range (" + one_line(log.text()) + "): export the mesh again");
  if (!scene || !scene->mRootNode)
    fail(where, "assimp cannot read it (" + one_line(error) +
                    "): check that the file is whole, beside the files it refers to, and has the ending of "
                    "its format");

  double factor = 1;
  soup.unit = unit_of(*scene, ending, factor);
  std::vector<std::pair<const aiNode*, Eigen::Matrix4d>> nodes,
      open = {{scene->mRootNode, matrix(scene->mRootNode->mTransformation)}};
  std::map<std::string, Eigen::Matrix4d> places;
  while (!open.empty()) {  // not by recursion: a file may nest nodes deeper than the stack
    nodes.push_back(open.back());
    const auto [node, place] = open.back();
    open.pop_back();
    places.emplace(node->mName.C_Str(), place);
    for (unsigned k = node->mNumChildren; k-- > 0;)  // so that the first child is taken next
      open.emplace_back(node->mChildren[k], place * matrix(node->mChildren[k]->mTransformation));
  }
  for (const auto& [node, place] : nodes)
    for (unsigned k = 0; k < node->mNumMeshes; k++) {
      const aiMesh& mesh = *scene->mMeshes[node->mMeshes[k]];
      add(mesh, mesh.mNumBones > 0 ? skinned(mesh, place, places) : placed(mesh, place), factor, where, soup);
    }
  return soup;
}

}  // namespace padder::reading
