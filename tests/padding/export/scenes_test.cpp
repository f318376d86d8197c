// SPDX-License-Identifier: MIT
// Formats to look at: padding/export/glb.cpp, usd.cpp.
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

using Json = nlohmann::json;
class ScenesTest : public ExportTest {};

// A .glb taken apart, with the container's own rules checked on the way.
struct Glb {
  Json j;
  std::string bin;

  explicit Glb(const std::string& bytes) {
    const auto u32 = [&](std::size_t at) {
      std::uint32_t v;
      std::memcpy(&v, bytes.data() + at, 4);
      return v;
    };
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(u32(4), 2u);
    EXPECT_EQ(u32(8), bytes.size());
    const std::size_t json = u32(12);
    EXPECT_EQ(json % 4, 0u);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    j = Json::parse(bytes.substr(20, json));
    EXPECT_EQ(u32(20 + json) % 4, 0u);
    EXPECT_EQ(bytes.substr(24 + json, 4), std::string("BIN\0", 4));
    bin = bytes.substr(28 + json);
    EXPECT_EQ(bin.size(), u32(20 + json));
    EXPECT_EQ(bin.size(), j["buffers"][0]["byteLength"]);
    for (const Json& a : j["accessors"]) {
      const Json& v = j["bufferViews"][a["bufferView"].get<std::size_t>()];
      const std::size_t item = (a["componentType"] == 5123 ? 2 : 4) * (a["type"] == "VEC3" ? 3 : 1);
      EXPECT_EQ(v["byteLength"], a["count"].get<std::size_t>() * item);
      EXPECT_EQ(v["byteOffset"].get<std::size_t>() % 4, 0u);
      EXPECT_LE(v["byteOffset"].get<std::size_t>() + v["byteLength"].get<std::size_t>(), bin.size());
    }
  }
  template <class T>
  std::vector<T> values(const Json& accessor) const {
    const Json& v =
        j["bufferViews"][j["accessors"][accessor.get<std::size_t>()]["bufferView"].get<std::size_t>()];
    std::vector<T> out(v["byteLength"].get<std::size_t>() / sizeof(T));
    std::memcpy(out.data(), bin.data() + v["byteOffset"].get<std::size_t>(), out.size() * sizeof(T));
    return out;
  }
};

// Where each sphere of a .glb ends up in the world, and how large: what a viewer makes of its nodes.
struct Seen {
  Point center;
  double radius;
  std::size_t mesh;
};
void see(const Json& nodes, std::size_t at, Eigen::Affine3d place, std::vector<Seen>& out) {
  const Json& n = nodes[at];
  if (n.contains("matrix")) {
    Eigen::Matrix4d m;
    for (int k = 0; k < 16; k++) m(k % 4, k / 4) = n["matrix"][std::size_t(k)];
    place = place * Eigen::Affine3d(m);
  }
  const auto number = [&](const char* key, std::size_t k) { return n[key][k].get<double>(); };
  if (n.contains("translation"))
    place = place * Eigen::Translation3d(number("translation", 0), number("translation", 1),
                                         number("translation", 2));
  if (n.contains("rotation"))
    place = place * Eigen::Quaterniond(number("rotation", 3), number("rotation", 0), number("rotation", 1),
                                       number("rotation", 2));
  if (n.contains("mesh") && n.contains("scale"))
    out.push_back({place.translation(), number("scale", 0), n["mesh"]});
  if (n.contains("children"))
    for (const Json& child : n["children"]) see(nodes, child, place, out);
}

// glTF is Y up and we are Z up: a viewer must see the robot stand, with each sphere in its place.
TEST_F(ScenesTest, GlbStandsUprightAndShowsEverySphereByANode) {
  const Model m = arm();
  const Glb g(text(m, "arm.glb"));
  EXPECT_FALSE(g.j.contains("extensionsRequired"));
  std::vector<Seen> seen;
  for (const Json& root : g.j["scenes"][0]["nodes"])
    see(g.j["nodes"], root, Eigen::Affine3d::Identity(), seen);
  ASSERT_EQ(seen.size(), m.spheres());
  std::size_t s = 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::map<std::uint32_t, std::set<std::size_t>> meshes;
  for (const Body& b : m.bodies) {
    pose = pose * b.pose;  // the arm is a chain
    for (std::size_t k = 0; k < b.cluster.size(); k++, s++) {
      const Point p = pose * b.cluster.centers[k];
      EXPECT_LT((seen[s].center - Point(p.x(), p.z(), -p.y())).norm(), 1e-6) << b.name;
      EXPECT_EQ(seen[s].radius, float(b.cluster.radii[k]));
      meshes[b.cluster.family].insert(seen[s].mesh);
    }
  }
  EXPECT_EQ(g.j["meshes"].size(), 3u);  // one for each family, in its colour
  std::set<Json> colours;
  for (const auto& [family, used] : meshes) {
    ASSERT_EQ(used.size(), 1u) << family;
    const Json& mesh = g.j["meshes"][*used.begin()];
    EXPECT_EQ(mesh["primitives"][0]["indices"], g.j["meshes"][0]["primitives"][0]["indices"]);  // shared
    const std::size_t material = mesh["primitives"][0]["material"];
    colours.insert(g.j["materials"][material]["pbrMetallicRoughness"]["baseColorFactor"]);
  }
  EXPECT_EQ(colours.size(), 3u);
}

// So that the spheres lie over the part in a viewer.
TEST_F(ScenesTest, APartOfAGltfIsNotTurned) {
  Cluster c = brick();
  for (const auto& [file, turned] :
       {std::pair("part.gltf", false), {"part.GLB", false}, {"part.obj", true}}) {
    c.source.file = file;
    for (const char* format : {"glb", "glb-instanced"})
      EXPECT_EQ(Glb(text(model_of(c), "b.glb", format)).j["nodes"][0].contains("rotation"), turned) << file;
    EXPECT_EQ(holds(text(model_of(c), "b.usda"), "upAxis = \"Z\""), turned) << file;
  }
}

TEST_F(ScenesTest, GlbInstancedHasOneNodeABody) {
  Cluster c = brick();
  c.family = 7, c.mask = 0x00f00000;
  const Glb g(text(model_of(c), "b.glb", "glb-instanced"));
  EXPECT_EQ(g.j["extensionsRequired"], Json::array({"EXT_mesh_gpu_instancing"}));
  ASSERT_EQ(g.j["nodes"].size(), 2u);  // the first turns it upright
  EXPECT_TRUE(g.j["nodes"][0].contains("rotation"));
  const Json& node = g.j["nodes"][1];
  EXPECT_EQ(node["name"], "brick");
  const Json& attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  const auto translation = g.values<float>(attributes["TRANSLATION"]),
             scale = g.values<float>(attributes["SCALE"]);
  ASSERT_EQ(translation.size(), 9u);
  ASSERT_EQ(scale.size(), 9u);
  for (std::size_t k = 0; k < 3; k++)
    for (std::size_t x = 0; x < 3; x++) {
      EXPECT_EQ(translation[3 * k + x], float(c.centers[k][long(x)]));
      EXPECT_EQ(scale[3 * k + x], float(c.radii[k]));
    }
  EXPECT_EQ(g.values<float>(attributes["_FAMILY"]), std::vector<float>(3, 7));
  EXPECT_EQ(g.values<float>(attributes["_MASK"]), std::vector<float>(3, 0x00f00000));
}

TEST_F(ScenesTest, GlbsMeshIsAUnitSphereTurnedOutwards) {
  const Glb g(text(model_of(brick()), "b.glb"));
  const Json& primitive = g.j["meshes"][0]["primitives"][0];
  const auto p = g.values<float>(primitive["attributes"]["POSITION"]);
  const auto t = g.values<std::uint16_t>(primitive["indices"]);
  EXPECT_EQ(t.size(), 3u * 320);
  Mesh mesh;
  for (std::size_t k = 0; k < p.size(); k += 3) {
    mesh.points.emplace_back(p[k], p[k + 1], p[k + 2]);
    EXPECT_NEAR(mesh.points.back().norm(), 1, 1e-6);
  }
  for (std::size_t k = 0; k < t.size(); k += 3) mesh.triangles.push_back({t[k], t[k + 1], t[k + 2]});
  EXPECT_EQ(mesh.points.size(), 162u);  // Euler: 320 triangles, 480 edges
  EXPECT_NEAR(mass_properties(mesh).volume, 4 / 3. * std::numbers::pi, 0.15);
  const Json& bounds = g.j["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_TRUE(bounds.contains("min") && bounds.contains("max"));
}

TEST_F(ScenesTest, FilesOfFloatsSayWhatTheyCannotHold) {
  Cluster c = brick();
  c.family = 0x01000001;
  EXPECT_NO_THROW(write(model_of(c), "whole.glb"));  // families stand in the text, which holds them
  EXPECT_THROW(write(model_of(c), "f.glb", "glb-instanced"), Error);
  for (const char* file : {"f.glb", "f.stl", "f.ply"}) {
    const auto expect_refusal = [&](double radius, double x) {
      c = brick();
      c.radii[0] = radius, c.centers[0].x() = x;
      EXPECT_TRUE(refuses([&] { write(model_of(c), file); }, "as float32, which cannot hold sphere 0 of "))
          << file;
      EXPECT_NO_THROW(write(model_of(c), "f.obj"));
    };
    expect_refusal(1e-60, 0), expect_refusal(1, 1e60), expect_refusal(2e38, -2e38);
    EXPECT_FALSE(fs::exists(folder_ / file));
    c = brick();
    c.centers[0].x() = 1e-60;
    EXPECT_NO_THROW(write(model_of(c), file));
  }
}

// What stands in a mesh file: every triangle's corners lie on a sphere, no triangle is inside another one,
// and from outside no hole is seen: a ray from far away meets the union no earlier than the mesh.
TEST_F(ScenesTest, MeshFilesShowTheUnionFromOutside) {
  Cluster c = brick();
  c.family = 5;
  const std::string stl = text(model_of(c), "b.stl"), ply = text(model_of(c), "b.ply"),
                    obj = text(model_of(c), "b.obj");
  std::uint32_t count;
  std::memcpy(&count, stl.data() + 80, 4);
  ASSERT_EQ(stl.size(), 84u + 50u * count);
  EXPECT_LT(count, 3 * 320u);  // the spheres overlap
  EXPECT_GT(count, 2 * 320u / 2);
  std::vector<std::array<Point, 3>> triangles(count);
  for (std::uint32_t t = 0; t < count; t++)
    for (std::size_t v = 0; v < 3; v++) {
      float x[3];
      std::memcpy(x, stl.data() + 84 + 50 * t + 12 + 12 * v, 12);
      triangles[t][v] = Point(x[0], x[1], x[2]);
    }
  for (const auto& t : triangles) {
    std::size_t around = 0;
    bool on_one = false;
    for (std::size_t k = 0; k < c.size(); k++) {
      std::size_t on = 0, inside = 0;
      for (const Point& p : t) {
        const double gap = (p - c.centers[k]).norm() - c.radii[k];
        on += std::abs(gap) < 1e-6, inside += gap < -1e-6;
      }
      on_one |= on == 3, around += inside == 3;
    }
    EXPECT_TRUE(on_one);
    EXPECT_EQ(around, 0u);
  }
  const auto ray = [&](const Point& from, const Vector& along) {  // to the nearest triangle
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& t : triangles) {
      const Vector e = t[1] - t[0], f = t[2] - t[0], p = along.cross(f);
      const double det = e.dot(p);
      if (std::abs(det) < 1e-14) continue;
      const Vector s = from - t[0], q = s.cross(e);
      const double u = s.dot(p) / det, v = along.dot(q) / det;
      if (u >= 0 && v >= 0 && u + v <= 1) nearest = std::min(nearest, f.dot(q) / det);
    }
    return nearest;
  };
  for (std::size_t k = 0; k < c.size(); k++)
    for (const Vector& way :
         {Vector(1, 0.1, 0.2), Vector(-0.3, 1, 0.1), Vector(0.2, -0.1, 1), Vector(-1, -0.4, 0.3)}) {
      const Vector along = way.normalized();
      const Point from = c.centers[k] - 10 * along;
      double first = std::numeric_limits<double>::infinity();
      for (std::size_t o = 0; o < c.size(); o++) {
        const Vector to = c.centers[o] - from;
        const double middle = to.dot(along), off = (to - middle * along).norm();
        if (off < c.radii[o])
          first = std::min(first, middle - std::sqrt(c.radii[o] * c.radii[o] - off * off));
      }
      EXPECT_NEAR(ray(from, along), first, 0.05 * c.radii[k]);
    }
  EXPECT_TRUE(holds(ply, "element face " + std::to_string(count) + "\n"));
  EXPECT_EQ(std::count(obj.begin(), obj.end(), 'f') - 0,
            long(count) + long(obj.find("from brick.obj") != std::string::npos));
}

TEST_F(ScenesTest, UsdIsTheTextExpected) {
  Cluster c = brick();
  c.name = "2nd brick";
  c.unit = "mm";
  c.centers = {{1, -2, 0.5}}, c.radii = {0.25}, c.triangle = {0};
  c.mass = {};
  EXPECT_EQ(text(model_of(c), "b.usda"), R"usd(#usda 1.0
(
    defaultPrim = "_2nd_brick"
    doc = "2nd brick (padder test, from brick.obj)"
    kilogramsPerUnit = 1
    metersPerUnit = 0.001
    upAxis = "Z"
)

def Xform "_2nd_brick" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI"]
)
{
    def Sphere "sphere_0" (
        prepend apiSchemas = ["PhysicsCollisionAPI"]
    )
    {
        double radius = 0.25
        double3 xformOp:translate = (1, -2, 0.5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
)usd");
}

TEST_F(ScenesTest, UsdFiltersPairsAndBracesClose) {
  const std::string usd = text(arm(), "arm.usda");
  EXPECT_TRUE(holds(usd, "rel physics:filteredPairs = [</arm/upper>, </arm/hand>]"));
  EXPECT_TRUE(holds(usd, "rel physics:filteredPairs = [</arm/finger>]"));
  EXPECT_EQ(std::count(usd.begin(), usd.end(), '{'), std::count(usd.begin(), usd.end(), '}'));
  std::size_t spheres = 0;
  for (std::size_t at = 0; (at = usd.find("def Sphere", at)) != std::string::npos; at++) spheres++;
  EXPECT_EQ(spheres, 12u);
}

// A body would fall, and with it the robot that is bolted to it.
TEST_F(ScenesTest, TheWorldOfARobotIsNoBodyInUsd) {
  Model m = arm();
  m.file = "arm.urdf", m.bodies[0].name = "world";
  const std::string usd = text(m, "w.usda");
  const std::string world = usd.substr(usd.find("def Xform \"world\""),
                                       usd.find("def Xform \"upper\"") - usd.find("def Xform \"world\""));
  EXPECT_EQ(world.find("RigidBodyAPI"), std::string::npos) << world;
  EXPECT_EQ(world.find("physics:mass"), std::string::npos) << world;
  EXPECT_TRUE(holds(world, "PhysicsFilteredPairsAPI"));
  EXPECT_EQ(usd.find("physics:body0 = </arm/world>"), std::string::npos);
  EXPECT_TRUE(holds(usd, "physics:body0 = </arm/upper>"));
}

}  // namespace
}  // namespace padder::samples
