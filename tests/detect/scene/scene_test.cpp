// SPDX-License-Identifier: MIT
// Scenes in JSON: what is read, what is refused and with which words, families settled, files beside them.
#include "detect/scene/scene.h"

#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "tests/error_of.h"
#include "tests/temporary_folder.h"

namespace padder::detect {
namespace {

class SceneTest : public testing::Test, protected TemporaryFolder {
 protected:
  void SetUp() override {
    Cluster c;
    c.name = "pair", c.unit = "m";
    c.centers = {Point(0, 0, 0), Point(1, 0, 0)}, c.radii = {0.75, 0.5}, c.triangle = {0, 1};
    c.bounds.add(Point(-1, -1, -1)), c.bounds.add(Point(2, 1, 1));
    write_cluster(c, folder_ / "pair.spheres.json");
    c.family = 7, c.mask = 6;
    write_cluster(c, folder_ / "seven.spheres.json");
    c.unit = "mm";
    write_cluster(c, folder_ / "mm.spheres.json");
  }

  Scene scene(const std::string& members) const {
    return scene_from_json(R"({"format": "padder.scene", "version": 1, )" + members + "}", "s.json", folder_);
  }
  void refused(const std::string& members, const std::string& sentence) const {
    EXPECT_EQ(error_of([&] { scene(members); }), sentence);
  }

  const std::string clusters_ = R"("clusters": {"p": "pair.spheres.json", "s": "seven.spheres.json"}, )";
};

TEST_F(SceneTest, WhatIsStatic) {
  const Scene s = scene(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0, 0], "static": true},
      {"cluster": "p", "position": [0, 0, 0], "static": false}, {"cluster": "p", "position": [0, 0, 0]}],
      "spheres": [{"centers": [[0, 0, 0]], "radii": 1}, {"centers": [[0, 0, 0], [1, 0, 0]], "radii": 1, "static": true},
                  {"centers": [[0, 0, 0]], "radii": 1}])");
  EXPECT_TRUE(s.bodies[0].is_static);
  EXPECT_FALSE(s.bodies[1].is_static);
  EXPECT_FALSE(s.bodies[2].is_static);
  EXPECT_EQ(s.loose.is_static, (std::vector<std::uint8_t>{0, 1, 1, 0}));
  EXPECT_EQ(s.input().spheres.is_static, s.loose.is_static.data());
  refused(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0, 0], "static": 1}])",
          "s.json, bodies 0, static: true or false is wanted");
}

TEST_F(SceneTest, BodiesAreTurnedAndMoved) {
  const Scene s = scene(clusters_ + R"("bodies": [{"cluster": "p", "position": [10, 20, 30],
      "quaternion": [0.7071067811865476, 0, 0, 0.7071067811865476]}, {"cluster": "s", "position": [0, 0, 0], "scale": 1}])");
  ASSERT_EQ(s.bodies.size(), 2u);
  EXPECT_EQ(s.size(), 4u);
  EXPECT_EQ(s.unit, "m");
  const Sphere p = placed(s.bodies[0], s.assets[s.bodies[0].shape].spheres[1]);  // a quarter turn about z
  EXPECT_NEAR(p.x, 10, 1e-15);
  EXPECT_NEAR(p.y, 21, 1e-14);
  EXPECT_EQ(p.z, 30);
  EXPECT_EQ(p.r, 0.5);
}

TEST_F(SceneTest, FamiliesAreSettled) {
  const Scene s = scene(clusters_ + R"("bodies": [
      {"cluster": "p", "position": [0, 0, 0]}, {"cluster": "p", "position": [0, 0, 0], "family": 33, "mask": 9},
      {"cluster": "s", "position": [0, 0, 0]}, {"cluster": "p", "position": [0, 0, 0], "family": 0},
      {"cluster": "p", "position": [0, 0, 0]}],
      "spheres": [{"centers": [[0, 0, 0]], "radii": 1, "family": 34}])");
  std::vector<std::uint32_t> families, masks;
  for (const Body& b : s.bodies) families.push_back(b.family), masks.push_back(b.mask);
  EXPECT_EQ(families, (std::vector<std::uint32_t>{35, 33, 7, 0, 36}))
      << "own ones above 32 that nothing else uses";
  EXPECT_EQ(masks, (std::vector<std::uint32_t>{0, 9, 6, 0, 0}));
}

TEST_F(SceneTest, LooseSpheresFromEverySource) {
  const std::vector<float> centers{0, 0, 0, 3, 0, 0}, radii{1, 2.5f};
  const std::vector<std::uint32_t> family{4, 5};
  write_file(folder_ / "l.npz", npz_bytes({{"centers", npy_array(centers.data(), {2, 3})},
                                           {"radii", npy_array(radii.data(), {2})},
                                           {"family", npy_array(family.data(), {2})}}));
  write_file(folder_ / "l.csv", "# two spheres\nx,y,z,r\n0.1,0,0,1\n\n2e0, 0 ,0,1\r\n");
  const Scene only = scene(R"("spheres": [{"file": "l.npz"}])");
  EXPECT_EQ(only.loose.scalar, Scalar::f32) << "float32 stays float";
  EXPECT_EQ(only.loose.family, family);
  const Scene all = scene(
      R"("spheres": [{"file": "l.npz"}, {"file": "l.csv", "mask": 3}, {"generate": "dense", "count": 10},
      {"centers": [[1, 2, 3], [4, 5, 6]], "radii": [1, 0]}])");
  ASSERT_EQ(all.loose.size(), 16u);
  EXPECT_EQ(all.loose.scalar, Scalar::f64);
  EXPECT_EQ(all.loose.twice[4 * 2], 0.1);
  EXPECT_EQ(all.loose.twice[4 * 1 + 3], 2.5);
  EXPECT_EQ(all.loose.family[1], 5u);
  EXPECT_EQ(all.loose.family[2], 0u);
  EXPECT_EQ(all.loose.mask[0], 0u);
  EXPECT_EQ(all.loose.mask[3], 3u);
  EXPECT_EQ(all.loose.mask[15], 0u);
}

TEST_F(SceneTest, FaultsAreNamedWithTheirPlace) {
  refused(R"("bodys": [])",
          "s.json: the key \"bodys\" is unknown: the keys here are format, version, name, unit, clusters, "
          "bodies, spheres, settle");
  refused(
      clusters_ +
          R"("bodies": [{"cluster": "p", "position": [0, 0, 0]}, {"cluster": "q", "position": [0, 0, 0]}])",
      "s.json, bodies 1, cluster: no cluster of that name is in \"clusters\"");
  refused(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0]}])",
          "s.json, bodies 0, position: 3 numbers are wanted");
  refused(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0, 0], "quaternion": [1, 1, 0, 0]}])",
          "s.json, bodies 0, quaternion: a quaternion [w, x, y, z] of length 1 is wanted");
  refused(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0, 0], "scale": 2}])",
          "s.json, bodies 0, scale: only 1 is possible: scale the mesh when it is padded (pad --scale)");
  refused(clusters_ + R"("bodies": [{"cluster": "p", "position": [0, 0, 0], "family": -1}])",
          "s.json, bodies 0, family: a whole number from 0 to 4294967295 is wanted");
  refused(R"("unit": "m", "clusters": {"a": "mm.spheres.json"})",
          "s.json, clusters, a: the cluster is in mm, the scene in m: pad it again in the scene's unit");
  refused(R"("spheres": [{"centers": [[0, 0, 0]], "radii": [1, 2]}])",
          "s.json, spheres 0, radii: one radius for each centre is wanted, or one number for all");
  refused(R"("spheres": [{"generate": "heap", "count": 3}])",
          "no generator is called 'heap': there are dense, dilute, poly35, poly045 and poly100");
  for (const char* key : {"count", "order", "radii"})
    refused("\"spheres\": [{\"file\": \"a.csv\", \"" + std::string(key) + "\": 1}]",
            "s.json, spheres 0, " + std::string(key) + ": only a block with \"" +
                (key == std::string("radii") ? "centers" : "generate") + "\" has this: leave it out");
  write_file(folder_ / "twice.csv", "x,y,z,r,family,family\n0,0,0,1,1,2\n");
  EXPECT_NE(error_of([&] { scene(R"("spheres": [{"file": "twice.csv"}])"); }).find("each once"),
            std::string::npos);
  refused(R"("name": 1)", "s.json, name: a string is wanted");
  refused(R"("unit": "furlong")",
          "s.json, unit: \"furlong\" is no unit of length known here: use m, cm, mm or in");
  refused(R"("unit": "m", "unit": "mm")", "s.json: the key \"unit\" stands twice in one object: remove one");
  refused(R"("spheres": [{"generate": "dense", "count": 1, "count": 2}])",
          "s.json, spheres 0: the key \"count\" stands twice in one object: remove one");
  refused(
      "\"" + std::string(1000, 'k') + "\": 1",
      "s.json: the key \"" + std::string(60, 'k') +
          "…\" is unknown: the keys here are format, version, name, unit, clusters, bodies, spheres, settle");
  refused(R"("clusters": {"a": "b\u0000c"})",
          "s.json, clusters, a: the name of a file is wanted, not 'b\\x00c'");
  refused(R"("clusters": {"a\u0000b": 7})", "s.json, clusters, a\\x00b: a string is wanted");
  EXPECT_THROW(scene(R"("spheres": [{"centers": [[0, 0, 1e999]], "radii": 1}])"), Error);
  EXPECT_THROW(scene(R"("spheres": [{"file": "/dev/zero"}])"), Error);
  EXPECT_THROW(scene(R"("clusters": {"a": "/dev/zero"})"), Error);
  EXPECT_THROW(scene_from_json("{", "s.json", folder_), Error);
  EXPECT_THROW(scene_from_json("[]", "s.json", folder_), Error);
  EXPECT_THROW(scene(R"("spheres": [{"file": "absent.csv"}])"), Error);
}

TEST_F(SceneTest, PileHasContactsBetweenBodiesOnly) {
  const Cluster c = read_cluster(folder_ / "pair.spheres.json");
  const Scene s = pile_of(c, 500);
  EXPECT_EQ(s.size(), 1000u);
  Detector d(DeviceChoice{BackendKind::omp});
  const Contacts& found = d.detect(s.input());
  EXPECT_GT(found.count, 50u);
  for (const Pair& p : found.pair_span()) EXPECT_NE(p.i / 2, p.j / 2);
  EXPECT_EQ(read_scene_or_cluster(folder_ / "pair.spheres.json", 500).size(), 1000u);
}

}  // namespace
}  // namespace padder::detect
