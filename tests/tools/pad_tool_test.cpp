// SPDX-License-Identifier: GPL-3.0-or-later
// The tool pad from outside, as a user meets it: what it prints, writes and returns.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "padding/asset/cluster.h"
#include "tests/error_of.h"
#include "tests/of_schema.h"
#include "tests/padding/shapes.h"
#include "tests/program_test.h"

namespace padder {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

const fs::path kAssets = PADDER_ASSETS;

std::string obj_of(const Mesh& mesh) {
  std::ostringstream out;
  for (const Point& p : mesh.points) out << "v " << p.transpose() << "\n";
  for (const auto& t : mesh.triangles) out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
  return out.str();
}

class Pad : public ProgramTest {
 protected:
  void SetUp() override {
    if (!fs::exists(fs::path(PADDER_BIN) / "pad")) GTEST_SKIP() << "the tool pad is not built here";
    cube("a.obj");
  }

  Outcome pad(const std::string& arguments, const std::string& before = "") const {
    return run("pad", arguments, before);
  }

  // Without those put there.
  std::set<std::string> files() const {
    std::set<std::string> names = ProgramTest::files();
    for (const std::string& name : put_) names.erase(name);
    return names;
  }
  std::string put(const std::string& name, const std::string& bytes) {
    write_file(folder_ / name, bytes);
    put_.insert(name);
    return name;
  }
  std::string cube(const std::string& name) { return put(name, obj_of(shapes::box({0, 0, 0}, {1, 1, 1}))); }

  static void expect_one_sentence(const Outcome& run, int code) {
    EXPECT_EQ(run.code, code) << run.err;
    EXPECT_EQ(run.out, "");
    EXPECT_EQ(std::ranges::count(run.err, '\n'), 1) << run.err;
    EXPECT_EQ(run.err.rfind("pad: ", 0), 0u) << run.err;
    EXPECT_EQ(run.err.find("unexpected"), std::string::npos) << run.err;
    EXPECT_GT(run.err.size(), 15u) << run.err;
  }
  void expect_refused(const std::string& arguments, int code) const {
    SCOPED_TRACE(arguments);
    expect_one_sentence(pad(arguments), code);
  }
  // What is printed with --json by a call that must succeed.
  Json report(const std::string& arguments, const std::string& before = "") const {
    const Outcome run = pad(arguments + " --json", before);
    EXPECT_EQ(run.code, 0) << run.err;
    return Json::parse(run.out);
  }

  std::set<std::string> put_;
};

bool is_cluster(const fs::path& document) {
  return !schemas_are_checked() || of_schema(document, "cluster.schema.json");
}

const std::string kCoarse = " --edge-length 20% ";  // quick

TEST_F(Pad, WrongUsageReturns2WithOneSentenceAndWritesNothing) {
  fs::create_directory(folder_ / "sub");
  cube("sub/a.obj");
  const std::pair<std::string, std::vector<std::string>> wrong[] = {
      {"--depth", {"x", "nan", "0x1p-3", "' 0.2'", "0", "1.5", "-0.2"}},
      {"--unit", {"ft", "''"}},
      {"--scale", {"0", "-1", "inf", "nan", "0x2", "2x"}},
      {"--repair", {"perhaps"}},
      {"--tolerance",
       {"0", "-1%", "5 %", "5%%", "5%x", "'5%% '", "nan%", "inf", "0x10%", "1e999", "+5%", "'% 5'"}},
      {"--max-spheres", {"0", "-1", "010", "1e3", "99999999999999999999"}},
      {"--lod", {"2%,x", "2%,nan", ",", "2%,,1%", "2%,", "''"}},
      {"--balance", {"both"}},
      {"--effort", {"4", "0x1", "1.5"}},
      {"--smooth", {"0", "inf"}},
      {"--edge-length", {"0", "-1%", "x%", "nan"}},
      {"--family", {"-1", "4294967296", "010"}},
      {"--mask", {"1.5", "0x", "0x1ffffffff"}},
      {"--threads", {"0", "x", "100000", "0x2", "-1"}},
      {"--max-radius", {"inf"}},
      {"--min-radius", {"0x1"}},
      {"--reach", {"''"}},
      {"--density", {"nan"}},
      {"--sharp-angle", {"nan"}}};
  for (const auto& [option, values] : wrong)
    for (const std::string& value : values) expect_refused("a.obj " + option + " " + value, 2);
  for (const char* arguments : {"",
                                "--no-such-option a.obj",
                                "a.obj -o=b.spheres.json",
                                "a.obj --preview a.jpg",
                                "a.obj --depth",
                                "a.obj sub/a.obj",
                                "a.obj sub/a.obj -o both.spheres.json",
                                "a.obj -o a.unknown",
                                "a.obj --write-mesh a.glb",
                                "a.obj -o b.obj --write-mesh ./b.obj",
                                "a.obj --write-mesh a.obj",
                                "a.obj a.stl --write-mesh both.obj",
                                "a.urdf --write-mesh a.obj",
                                "a.obj --robot-spheres 10",
                                "a.urdf --robot-spheres 9 --edge-length 2%",
                                "a.obj --joint elbow=1",
                                "a.obj -o ''",
                                "a.obj --max-radius 5%",
                                "a.obj --depth 0.2 --max-spheres 9",
                                "a.obj --lod , -o b.spheres.json",
                                "a.obj --edge-length 5% --tolerance 5%",
                                "a.obj --protrusion 1%",
                                "a.obj --protrusion 0 --gap 0",
                                "a.obj --reach 10% --repair never",
                                "a.obj --max-spheres 4294967297"})
    expect_refused(arguments, 2);
  EXPECT_TRUE(files().empty());
}

TEST_F(Pad, WhatCannotBeMeantIsRefusedUnlessForced) {
  for (const char* arguments :
       {"a.obj --tolerance 200%", "a.obj --tolerance 5", "a.obj --lod 1%,90%", "a.obj --edge-length 200%",
        "a.obj --tolerance 2% --min-radius 5", "a.obj --tolerance 2% --reach 0.00001%",
        "a.obj --tolerance 2% --reach 300%", "a.obj --tolerance 2% --min-radius 10% --max-radius 5%"})
    expect_refused(arguments, 1);
  EXPECT_TRUE(files().empty());
  expect_refused("a.obj --tolerance 1e300 --force", 1);
  EXPECT_EQ(pad("a.obj -q --tolerance 200% --force").code, 0);
  // A blank before the sign is none of these.
  EXPECT_NEAR(report("a.obj --tolerance '5 %'")["tolerance"], 0.05 * std::sqrt(3.0), 1e-12);
}

TEST_F(Pad, OfSeveralMeshesTheSentenceNamesTheOne) {
  cube("b.obj");
  for (const char* options :
       {"--tolerance 1e-30", "--edge-length 1e-9", "--tolerance 5% --min-radius 60% --force"}) {
    SCOPED_TRACE(options);
    const Outcome run = pad(std::string("a.obj b.obj -o out/ ") + options);
    EXPECT_EQ(run.code, 1);
    EXPECT_TRUE(run.err.starts_with("pad: a.obj: ")) << run.err;
    EXPECT_TRUE(holds(run.err, "\npad: b.obj: "));
    EXPECT_EQ(run.err.find("--max-radius"), std::string::npos) << run.err;
  }
}

TEST_F(Pad, WhatHasNoEffectIsSaid) {
  put("curve.obj", obj_of(shapes::box({0, 0, 0}, {1, 1, 1})) + "cstype bezier\ncurv 0 1 1 2\n");
  for (const char* arguments : {"a.obj --tolerance 5% --sharp-angle 10", "a.obj --tolerance 5% --colour gap"})
    expect_refused(arguments, 2);
  EXPECT_TRUE(files().empty());
  EXPECT_EQ(pad("a.obj --tolerance 10% --thickness 1% -q").code, 0);
  EXPECT_EQ(pad("a.obj --tolerance 10% --thickness 1% --colour never").err,
            "pad: warning: a.obj: it has no sheet, so that a thickness has no effect: leave it out\n");
  EXPECT_TRUE(holds(pad("curve.obj --tolerance 10%").out, "\n  note: 1 line, curve or point left out\n"));
}

TEST_F(Pad, WhatIsNotThereIsTheCause) {
  for (const std::string absent : {"absent/", "{a,b}.obj"})
    EXPECT_EQ(pad("'" + absent + "' -o out").err,
              "pad: cannot open " + absent + ": check the name and that it may be read\n");
}

TEST_F(Pad, RadiiThatExcludeEachOtherNameTheRemedy) {
  EXPECT_EQ(pad("a.obj --tolerance 2% --min-radius 10% --max-radius 5%").err,
            "pad: a.obj: a smallest radius of 0.173205 (10 % of the diagonal) is above the largest one of "
            "0.0866025 (5 % of the diagonal): use a smaller --min-radius or a larger --max-radius\n");
}

TEST_F(Pad, ASmoothnessThatIsMissedIsSaid) {
  const Outcome rough = pad("a.obj --max-spheres 20 --smooth 1 --json");
  ASSERT_EQ(rough.code, 0) << rough.err;
  EXPECT_TRUE(holds(rough.err, "--smooth asks for 1"));
  EXPECT_EQ(Json::parse(rough.out)["warnings"].size(), 1u);
  EXPECT_EQ(pad("a.obj --tolerance 5% --smooth 60 -q").err, "");
}

TEST_F(Pad, WithoutRepairWhatFacesInwardIsSaid) {
  put("turned.obj", obj_of(shapes::turned_over(shapes::box({0, 0, 0}, {1, 1, 1}))));
  const Outcome run = pad("turned.obj --repair never --tolerance 5% --json");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(holds(run.err, "face inward"));
  const Json j = Json::parse(run.out);
  EXPECT_EQ(j["warnings"].size(), 1u);
  const Cluster c = read_cluster(folder_ / "turned.spheres.json");
  EXPECT_EQ(c.mass.volume, 0);
  // Judged from outside: no sphere reaches farther from the cube's faces than was proved.
  if (j["accuracy"]["certified"]) {
    for (std::size_t k = 0; k < c.size(); k++) {
      const double out = ((c.centers[k] - Point(0.5, 0.5, 0.5)).cwiseAbs() - Point(0.5, 0.5, 0.5)).maxCoeff();
      EXPECT_LE(std::abs(out) + c.radii[k], 0.0501 * std::sqrt(3.0)) << k;
    }
  }
}

// Two boxes through each other, wrapped: the errors are against the input, and the mass is that of the wrap.
TEST_F(Pad, AWrapIsSaidToBeOneInEveryFigure) {
  put("cross.obj", obj_of(shapes::joined(shapes::box({0, 0, 0}, {1, 1, 1}),
                                         shapes::box({0.5, 0.25, 0.25}, {1.5, 0.75, 0.75}))));
  const Outcome run = pad("cross.obj --repair wrap --tolerance 4% --json --unit m -o cross.urdf");
  ASSERT_EQ(run.code, 0) << run.err;
  const Json j = Json::parse(run.out);
  EXPECT_EQ(j["accuracy"]["proved_against"], "wrap");
  EXPECT_EQ(j["accuracy"]["certified"], true);
  EXPECT_TRUE(j["reason"].is_null());
  EXPECT_TRUE(j["patches"].empty());
  EXPECT_TRUE(j["slots"].empty());
  ASSERT_EQ(j["warnings"].size(), 1u);
  EXPECT_EQ(std::ranges::count(run.err, '\n'), 1) << run.err;
  EXPECT_TRUE(holds(run.err, "wrap"));
  const Outcome text = pad("cross.obj --repair wrap --tolerance 4%");
  EXPECT_TRUE(holds(text.out, "both proved"));
  EXPECT_TRUE(holds(text.out, "body is all that a wrap"));
  EXPECT_EQ(text.out.find("not certified"), std::string::npos) << text.out;
  EXPECT_EQ(text.err, "");  // our own format says whose mass it is
  EXPECT_EQ(Json::parse(read_file(folder_ / "cross.spheres.json"))["mass_properties"]["of"], "wrap");
  EXPECT_TRUE(is_cluster(folder_ / "cross.spheres.json"));
  EXPECT_EQ(pad("cross.obj --repair wrap --tolerance 4% -q --unit m -o cross.urdf").err, "");
}

double to_triangle(const Mesh& mesh, std::size_t t, const Point& p) {  // from the nearest of many points
  const Point a = mesh.corner(t, 0), u = mesh.corner(t, 1) - a, v = mesh.corner(t, 2) - a;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= 60; i++)
    for (int j = 0; i + j <= 60; j++) least = std::min(least, (a + i / 60. * u + j / 60. * v - p).norm());
  return least;
}

// The file's own faces, in its order, without the library: spheres.triangle counts them.
Mesh read_obj(const fs::path& path) {
  Mesh mesh;
  std::istringstream in(read_file(path));
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string head;
    words >> head;
    if (head == "v") {
      Point p;
      words >> p.x() >> p.y() >> p.z();
      mesh.points.push_back(p);
    } else if (head == "f") {
      std::array<std::uint32_t, 3> t;
      for (auto& v : t) {
        std::string word;
        words >> word;
        v = std::uint32_t(std::stoul(word)) - 1;
      }
      mesh.triangles.push_back(t);
    }
  }
  return mesh;
}

TEST_F(Pad, TheMeshWrittenHasTheTrianglesThatTheSpheresName) {
  cube("b.obj");
  const Json j = report("a.obj --scale 3 --edge-length 4% --write-mesh surface.obj");
  EXPECT_EQ(j["mesh"], "surface.obj");
  const Cluster c = read_cluster(folder_ / "a.spheres.json");
  const Mesh mesh = read_obj(folder_ / "surface.obj");
  EXPECT_EQ(mesh.triangles.size(), j["triangles_remeshed"]);
  EXPECT_NEAR((mesh.bounds().high - Point(3, 3, 3)).norm(), 0, 1e-6);
  std::size_t through = 0;
  for (std::size_t k = 0; k < c.size(); k++) {
    const auto t = std::size_t(c.triangle[k]);
    ASSERT_LT(t, mesh.triangles.size());
    bool all = true;
    for (int v = 0; v < 3; v++)
      all = all && std::abs((mesh.corner(t, v) - c.centers[k]).norm() - c.radii[k]) < 1e-6;
    through += all;
    // Refitted at an edge it still meets its triangle.
    EXPECT_LE(to_triangle(mesh, t, c.centers[k]), c.radii[k] + 0.02) << k;
  }
  EXPECT_GT(through, c.size() / 2);  // as fitted: through the corners
  const Outcome batch = pad("a.obj b.obj -q --tolerance 10% --write-mesh meshes/");
  ASSERT_EQ(batch.code, 0) << batch.err;
  EXPECT_EQ(read_obj(folder_ / "meshes/b.surface.obj").triangles.size(), 12u);  // nothing remeshed
  for (const char* name : {"s.off", "s.ply", "s.stl"}) {
    EXPECT_EQ(pad(std::string("a.obj -q --tolerance 10% --write-mesh ") + name).code, 0);
    EXPECT_TRUE(fs::exists(folder_ / name));
  }
  expect_refused("a.obj --tolerance 10% --write-mesh b.obj/s.obj", 1);  // below a file
}

TEST_F(Pad, AnOpenSheetIsMeasuredAndSaysThatNothingIsProved) {
  Mesh terrain = shapes::square(8, 8);
  for (Point& p : terrain.points) p.z() = 0.1 * (int(p.x() + p.y()) % 3);
  put("terrain.obj", obj_of(terrain));
  for (const char* arguments :
       {"terrain.obj --repair never --edge-length 10%", "terrain.obj --repair never --tolerance 2%"}) {
    SCOPED_TRACE(arguments);
    const Outcome run = pad(arguments);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_TRUE(holds(run.out, "an open sheet"));
    EXPECT_TRUE(holds(run.out, "measured, not proved"));
    EXPECT_EQ(run.out.find("both proved"), std::string::npos) << run.out;
  }
}

TEST_F(Pad, HelpBeginsWithExamplesAndVersionIsTheProjects) {
  const Outcome help = pad("--help");
  EXPECT_EQ(help.code, 0);
  EXPECT_EQ(help.out.rfind("Examples", 0), 0u) << help.out.substr(0, 100);
  EXPECT_EQ(help.err, "");
  for (const char* option : {"-o", "--depth", "--edge-length", "--repair", "--family", "--mask", "--scale",
                             "--unit", "--threads", "--json", "-q", "--tolerance", "--max-spheres", "--lod"})
    EXPECT_TRUE(holds(help.out, option)) << option;
  const Outcome version = pad("--version");
  EXPECT_EQ(version.code, 0);
  EXPECT_TRUE(holds(version.out, PADDER_VERSION));
  EXPECT_EQ(std::ranges::count(version.out, '\n'), 1);
}

// Threads that spin would take the processors from other programs.
TEST_F(Pad, WaitingThreadsSleepUnlessTheEnvironmentSaysOtherwise) {
  const auto spins = [&](const std::string& policy) {  // as libgomp says at last
    const std::string shown =
        pad("--version", "env -u OMP_WAIT_POLICY -u GOMP_SPINCOUNT OMP_DISPLAY_ENV=verbose " + policy).err;
    const std::size_t at = shown.rfind("GOMP_SPINCOUNT = '");
    return at == std::string::npos ? std::string()
                                   : shown.substr(at + 18, shown.find('\'', at + 18) - at - 18);
  };
  if (spins("").empty()) GTEST_SKIP() << "not libgomp";
  EXPECT_EQ(spins(""), "0");
  EXPECT_EQ(spins("GOMP_SPINCOUNT=77"), "77");
  EXPECT_NE(spins("OMP_WAIT_POLICY=active"), "0");
}

void expect_report(const Json& j) {
  for (const char* key : {"input", "output", "repair"}) EXPECT_TRUE(j.at(key).is_string()) << key;
  for (const char* key : {"triangles_in", "triangles_remeshed", "spheres"})
    EXPECT_TRUE(j.at(key).is_number_unsigned()) << key;
  for (const char* key : {"diagonal", "radius_min", "radius_max"}) EXPECT_TRUE(j.at(key).is_number()) << key;
  for (const char* key : {"depth", "tolerance"})  // null: not asked for
    EXPECT_TRUE(j.at(key).is_null() || j.at(key).is_number()) << key;
  for (const char* key :
       {"protrusion_max", "protrusion_mean", "protrusion_p95", "gap_max", "gap_mean", "gap_p95", "coverage",
        "normal_error_mean_deg", "normal_error_p95_deg", "volume_ratio"})
    EXPECT_GE(j.at("accuracy").at(key).get<double>(), 0) << key;
  const Json& accuracy = j.at("accuracy");
  EXPECT_TRUE(accuracy.at("certified").is_boolean());
  EXPECT_TRUE(j.at("within").is_boolean());
  EXPECT_EQ(j.at("reason").is_null(), accuracy["certified"]) << j["reason"];
  const Json against = accuracy.at("proved_against");
  EXPECT_TRUE(against.is_null() || against == "input" || against == "filled" || against == "wrap");
  if (accuracy["certified"]) {
    EXPECT_FALSE(against.is_null());
    EXPECT_TRUE(j["within"]);
  }
  if (!j["tolerance"].is_null() && j["within"]) {
    for (const char* key : {"protrusion_max", "gap_max"})
      EXPECT_LE(accuracy[key].get<double>(), j["tolerance"].get<double>() * (1 + 1e-8)) << key;
  }
  std::set<std::string> keys;
  double sum = 0, total = 0;
  for (const auto& [key, value] : j.at("seconds").items()) {
    keys.insert(key);
    (key == "total" ? total : sum) += value.get<double>();
  }
  EXPECT_EQ(keys,
            (std::set<std::string>{"read", "repair", "remesh", "fit", "refit", "cull", "accuracy", "total"}));
  EXPECT_NEAR(total, sum, 1e-6 + 0.1 * sum);
}

TEST_F(Pad, JsonIsOneDocumentAsPromisedAndTrueToTheFile) {
  const Outcome run = pad("a.obj --json --depth 0.2" + kCoarse);
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.err, "");  // no progress bar: this is no terminal
  const Json j = Json::parse(run.out);
  ASSERT_TRUE(j.is_object());
  expect_report(j);
  EXPECT_EQ(j["input"], "a.obj");
  EXPECT_EQ(j["output"], "a.spheres.json");
  EXPECT_EQ(j["triangles_in"], 12);
  EXPECT_NEAR(j["diagonal"], std::sqrt(3.0), 1e-12);
  EXPECT_EQ(files(), std::set<std::string>{"a.spheres.json"});
  const Cluster c = read_cluster(folder_ / "a.spheres.json");
  EXPECT_EQ(j["spheres"], c.size());
  EXPECT_EQ(j["radius_min"], *std::ranges::min_element(c.radii));
  EXPECT_EQ(j["radius_max"], *std::ranges::max_element(c.radii));
  EXPECT_EQ(j["accuracy"]["gap_max"], c.accuracy.gap_max);
  EXPECT_EQ(j["repair"], c.source.repair);
  EXPECT_EQ(c.name, "a");
  EXPECT_EQ(c.source.file, "a.obj");
  EXPECT_EQ(c.source.sha256.size(), 64u);
  EXPECT_EQ(c.family, 0u);
  EXPECT_NEAR(c.mass.volume, 1, 1e-9);
}

TEST_F(Pad, AToleranceIsKeptAndALadderHoldsItsRungs) {
  const Json j = report("a.obj --lod 4%,8%");
  expect_report(j);
  EXPECT_NEAR(j["tolerance"], 0.04 * std::sqrt(3.0), 1e-9);
  ASSERT_EQ(j["lods"].size(), 1u);
  const Cluster c = read_cluster(folder_ / "a.spheres.json");
  ASSERT_EQ(c.lods.size(), 1u);
  EXPECT_EQ(j["lods"][0]["spheres"], c.lods[0].radii.size());
  EXPECT_LE(c.lods[0].radii.size(), c.size());  // coarser
  EXPECT_LE(c.accuracy.protrusion_max, 0.04 * std::sqrt(3.0) * (1 + 1e-9));
  EXPECT_LE(c.accuracy.gap_max, 0.04 * std::sqrt(3.0) * (1 + 1e-9));
  EXPECT_LE(c.lods[0].accuracy.gap_max, 0.08 * std::sqrt(3.0) * (1 + 1e-9));
  EXPECT_TRUE(c.accuracy.certified);
  EXPECT_TRUE(is_cluster(folder_ / "a.spheres.json"));
}

TEST_F(Pad, ABatchPrintsAnArrayAndFillsAFolder) {
  cube("b.obj");
  const Json j = report("a.obj b.obj -o made/here/" + kCoarse);
  ASSERT_TRUE(j.is_array());
  ASSERT_EQ(j.size(), 2u);
  for (const Json& report : j) expect_report(report);
  EXPECT_EQ(j[0]["input"], "a.obj");
  EXPECT_EQ(j[1]["input"], "b.obj");
  EXPECT_EQ(files(), (std::set<std::string>{"made/here/a.spheres.json", "made/here/b.spheres.json"}));
}

TEST_F(Pad, AFaultyMeshInABatchHindersNoOther) {
  put("bad.obj", "v 0 0 0\nf 1 2 3\n"), cube("c.obj");
  const Outcome run = pad("a.obj bad.obj c.obj --json" + kCoarse);
  EXPECT_EQ(run.code, 1);
  EXPECT_EQ(std::ranges::count(run.err, '\n'), 1) << run.err;
  EXPECT_TRUE(holds(run.err, "bad.obj"));
  EXPECT_EQ(Json::parse(run.out).size(), 3u);
  EXPECT_EQ(files(), (std::set<std::string>{"a.spheres.json", "c.spheres.json"}));
}

TEST_F(Pad, TooLittleMemoryIsTheCauseThatIsNamed) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer takes more memory than the limit";
#endif
  const Outcome r = pad("a.obj --tolerance 5% --memory 1M");
  expect_one_sentence(r, 1);
  EXPECT_EQ(r.err, "pad: --memory 1M is less than the program itself needs: give it more\n");
}

TEST_F(Pad, APreviewThatFailsSaysOneSentence) {
  ASSERT_EQ(pad("a.obj" + kCoarse + "-q").code, 0);
  fs::remove(folder_ / "a.obj");
  const std::string small = "a.spheres.json --size 16x16 --samples 1 -o ";
  const Outcome failed = run("preview", small + "absent/a.png"), made = run("preview", small + "a.png");
  EXPECT_EQ(failed.code, 1);
  EXPECT_EQ(std::ranges::count(failed.err, '\n'), 1) << failed.err;
  EXPECT_TRUE(holds(failed.err, "cannot write absent/a.png"));
  EXPECT_TRUE(holds(made.err, "spheres alone are shown"));
}

TEST_F(Pad, ItTalksOnlyOfWhatItMadeAndOfThatUnlessQuiet) {
  const Outcome run = pad("a.obj -o other.spheres.json" + kCoarse);
  EXPECT_EQ(run.code, 0);
  EXPECT_EQ(run.err, "");
  EXPECT_TRUE(holds(run.out, "other.spheres.json"));
  const Outcome quiet = pad("a.obj -q" + kCoarse);
  EXPECT_EQ(quiet.code, 0);
  EXPECT_EQ(quiet.out + quiet.err, "");
  EXPECT_EQ(files(), (std::set<std::string>{"a.spheres.json", "other.spheres.json"}));
  expect_refused("absent.obj -q", 1);
}

TEST_F(Pad, ScaleUnitFamilyAndMaskArriveInTheAsset) {
  ASSERT_EQ(pad("a.obj -q --scale 2 --unit cm --family 7 --mask 5" + kCoarse).code, 0);
  const Cluster c = read_cluster(folder_ / "a.spheres.json");
  EXPECT_EQ(c.unit, "cm");
  EXPECT_EQ(c.family, 7u);
  EXPECT_EQ(c.mask, 5u);
  EXPECT_NEAR(c.mass.volume, 8, 1e-9);
  EXPECT_NEAR(c.bounds.high.x(), 2, 1e-12);
}

TEST_F(Pad, NothingHalfWrittenAndTheOldFileKept) {
  put("bad.obj", "v 0 0 0\nf 1 2 3\n");
  write_file(folder_ / "old.spheres.json", "old");
  expect_refused("bad.obj -o old.spheres.json", 1);
  EXPECT_EQ(read_file(folder_ / "old.spheres.json"), "old");
  expect_one_sentence(pad("a.obj -o a.obj/a.spheres.json" + kCoarse), 1);  // below a file
  fs::create_directory(folder_ / "taken.spheres.json");
  expect_one_sentence(pad("a.obj -o bad.obj/" + kCoarse), 1);
  EXPECT_EQ(files(), std::set<std::string>{"old.spheres.json"});
}

TEST_F(Pad, ASignalEndsItCleanly) {
  const std::string slow = "'" + (kAssets / "track_shoe.obj").string() + "' --depth 0.1 --edge-length 0.1%";
  for (const auto& [signal, code] : {std::pair{"INT", 130}, {"TERM", 143}, {"HUP", 129}}) {
    const Outcome run = pad(slow, std::string("timeout --preserve-status -s ") + signal + " 0.3");
    EXPECT_EQ(run.code, code);
    EXPECT_TRUE(files().empty());
  }
}

TEST_F(Pad, TheAssetsPadAsTheFirstCommandSays) {
  const Json j = report("'" + (kAssets / "track_shoe.obj").string() + "' --depth 0.2");
  expect_report(j);
  EXPECT_EQ(j["repair"], read_cluster(folder_ / "track_shoe.spheres.json").source.repair);
  EXPECT_TRUE(is_cluster(folder_ / "track_shoe.spheres.json"));
}

// The meshes that tests/data/make_data.py makes.
class PadData : public Pad {
 protected:
  // Within 60 s and 4 GiB.
  void expect_cluster_or_sentence(const fs::path& mesh, const std::string& options) {
    SCOPED_TRACE(mesh.string());
    const Outcome run = pad("'" + mesh.string() + "' --json -o out.spheres.json " + options, limits);
    if (run.code == 1) {
      EXPECT_EQ(std::ranges::count(run.err, '\n'), 1) << run.err;
      EXPECT_EQ(run.err.rfind("pad: ", 0), 0u) << run.err;
      EXPECT_TRUE(holds(run.err, mesh.filename().string()));
      EXPECT_TRUE(files().empty());
      return;
    }
    ASSERT_EQ(run.code, 0) << run.err;
    expect_report(Json::parse(run.out));
    const Cluster c = read_cluster(folder_ / "out.spheres.json");
    EXPECT_GT(c.size(), 0u);
    EXPECT_EQ(c.source.file, mesh.filename().string());
    fs::remove(folder_ / "out.spheres.json");
  }
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  const std::string limits = "timeout 600";
#else
  const std::string limits = "ulimit -v 4194304; timeout 60";
#endif
  const fs::path data_ = fs::path(PADDER_BIN).parent_path() / "data";
};

TEST_F(PadData, EveryFormatGivesACertifiedCluster) {
  for (const auto& entry : fs::directory_iterator(data_ / "formats")) {
    SCOPED_TRACE(entry.path().string());
    const Json j =
        report("'" + entry.path().string() + "' --tolerance 4% --effort 0 -o out.spheres.json", limits);
    EXPECT_EQ(j["triangles_in"], 128);
    EXPECT_EQ(j["accuracy"]["certified"], true);
    EXPECT_GT(read_cluster(folder_ / "out.spheres.json").size(), 0u);
  }
}

TEST_F(PadData, HardMeshesGiveAClusterOrOneSentence) {
  for (const auto& entry : fs::directory_iterator(data_ / "hard"))
    expect_cluster_or_sentence(entry.path(), "--edge-length 10%");
}

TEST_F(PadData, AMalformedMeshIsNamedInTheSentence) {
  for (const auto& entry : fs::directory_iterator(data_ / "malformed")) {
    const Outcome run = pad("'" + entry.path().string() + "'", limits);
    expect_one_sentence(run, 1);
    EXPECT_TRUE(holds(run.err, entry.path().string()));
    EXPECT_TRUE(files().empty());
  }
}

}  // namespace
}  // namespace padder
