// SPDX-License-Identifier: MIT
// Formats to look at: padding/export/glb.cpp, usd.cpp.
#include <cstring>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
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

TEST_F(ScenesTest, GlbHasOneSphereAndAnInstanceEach) {
  Cluster c = brick();
  c.family = 7, c.mask = 0x00f00000;
  const Glb g(text(model_of(c), "b.glb"));
  EXPECT_EQ(g.j["extensionsRequired"], Json::array({"EXT_mesh_gpu_instancing"}));
  const Json& node = g.j["nodes"][0];
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

TEST_F(ScenesTest, GlbPlacesBodiesAndSaysWhatFloatCannotHold) {
  const Model m = arm();
  const Glb g(text(m, "arm.glb"));
  EXPECT_EQ(g.j["nodes"].size(), 4u);
  EXPECT_FALSE(g.j["nodes"][0].contains("matrix"));
  const auto matrix = g.j["nodes"][1]["matrix"].get<std::vector<double>>();
  EXPECT_EQ(matrix[14], 0.5);  // columns: the last holds the translation
  Cluster c = brick();
  c.family = 0x01000001;
  EXPECT_THROW(write(model_of(c), "f.glb"), Error);
  c = brick();
  c.radii[0] = 1e-60;
  EXPECT_THROW(write(model_of(c), "f.glb"), Error);
  c.radii[0] = 1, c.centers[0].x() = 1e60;
  EXPECT_THROW(write(model_of(c), "f.glb"), Error);
  EXPECT_FALSE(fs::exists(folder_ / "f.glb"));
}

TEST_F(ScenesTest, UsdIsTheTextExpected) {
  Cluster c = brick();
  c.name = "2nd brick";
  c.unit = "mm";
  c.centers = {{1, -2, 0.5}}, c.radii = {0.25}, c.triangle = {0};
  EXPECT_EQ(text(model_of(c), "b.usda"), R"usd(#usda 1.0
(
    defaultPrim = "_2nd_brick"
    doc = "2nd brick (padder test, from brick.obj)"
    metersPerUnit = 0.001
    upAxis = "Z"
)

def Xform "_2nd_brick"
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
  EXPECT_NE(usd.find("rel physics:filteredPairs = [</arm/upper>, </arm/hand>]"), std::string::npos);
  EXPECT_NE(usd.find("rel physics:filteredPairs = [</arm/finger>]"), std::string::npos);
  EXPECT_EQ(std::count(usd.begin(), usd.end(), '{'), std::count(usd.begin(), usd.end(), '}'));
  std::size_t spheres = 0;
  for (std::size_t at = 0; (at = usd.find("def Sphere", at)) != std::string::npos; at++) spheres++;
  EXPECT_EQ(spheres, 12u);
}

}  // namespace
}  // namespace padder::samples
