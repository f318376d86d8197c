// SPDX-License-Identifier: MIT
// The tool detect, run as a user runs it: exit codes, one JSON document, one sentence for an error.
#include <nlohmann/json.hpp>

#include "padding/asset/cluster.h"
#include "tests/of_schema.h"
#include "tests/program_test.h"

namespace padder {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class DetectTool : public ProgramTest {
 protected:
  void SetUp() override {
    write_file(
        folder_ / "dense.json",
        R"({"format": "padder.scene", "version": 1, "spheres": [{"generate": "dense", "count": 3000}]})");
    write_file(folder_ / "small.json", R"({"format": "padder.scene", "version": 1,
        "spheres": [{"centers": [[0, 0, 0], [1.5, 0, 0], [0, 5, 0]], "radii": 1}]})");
  }

  Outcome run(const std::string& arguments, const std::string& before = "") const {
    return ProgramTest::run("detect", arguments, before);
  }
};

TEST_F(DetectTool, JsonAsPromised) {
  const Outcome r = run("dense.json --backend omp --json");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json j = Json::parse(r.out);
  EXPECT_EQ(j["spheres"], 3000);
  EXPECT_EQ(j["bodies"], 0);
  EXPECT_EQ(j["backend"], "omp");
  EXPECT_EQ(j["precision"], "exact");
  EXPECT_GT(j["contacts"], 8000);
  for (int k = 1; k <= 9; k++) EXPECT_TRUE(j["seconds"].contains("stage" + std::to_string(k)));
  EXPECT_TRUE(j["seconds"].contains("total"));
  EXPECT_EQ(r.err, "");
  const Json stages = Json::parse(run("dense.json --backend omp --path nine-stages --threads 1 --json").out);
  EXPECT_EQ(stages["hash"], j["hash"]);
  EXPECT_EQ(stages["contacts"], j["contacts"]);
}

TEST_F(DetectTool, TheNineStagesAndAMarginAreExact) {
  for (const std::string exact : {"--path nine-stages", "--margin 0.1"})
    for (const std::string boxes : {"", " --devices 1"}) {
      const std::string words = "dense.json --backend omp --precision fast " + exact + boxes;
      EXPECT_EQ(Json::parse(run(words + " --json").out)["precision"], "exact") << words;
      EXPECT_EQ(run(words).out.find("float only"), std::string::npos) << words;
    }
  EXPECT_EQ(Json::parse(run("dense.json --backend omp --precision fast --json").out)["precision"], "fast");
}

TEST_F(DetectTool, OneIsNoPlural) {
  write_file(
      folder_ / "one.json",
      R"({"format": "padder.scene", "version": 1, "spheres": [{"centers": [[0, 0, 0]], "radii": 1}]})");
  EXPECT_TRUE(run("one.json").out.starts_with("1 sphere, 0 bodies: 0 contacts ("));
}

TEST_F(DetectTool, HashIsOneLine) {
  const Outcome r = run("dense.json -q --hash");
  EXPECT_EQ(r.code, 0);
  EXPECT_EQ(r.out.size(), 17u) << r.out;
  EXPECT_EQ(run("dense.json -q").out, "");
}

TEST_F(DetectTool, StagesShowTheArrays) {
  const Outcome r = run("small.json --stages");
  EXPECT_EQ(r.code, 0);
  for (const char* part : {"\n  T ", "\n  S ", "\n  B ", "\n  C ", "\n  D ", "\n  E ", "\n  F (0,1)"})
    EXPECT_NE(r.out.find(part), std::string::npos) << part;
  const Json j = Json::parse(run("small.json --stages --json").out);
  EXPECT_EQ(j["stages"]["F"], Json::parse("[[0, 1]]"));
  EXPECT_EQ(run("dense.json --stages").code, 1);
}

TEST_F(DetectTool, FilesFromAnyBackendAndPathAreTheSame) {
  ASSERT_EQ(run("dense.json -o a.csv").code, 0);
  ASSERT_EQ(run("dense.json --path nine-stages --backend omp --threads 1 -o b.csv").code, 0);
  EXPECT_EQ(read_file(folder_ / "a.csv"), read_file(folder_ / "b.csv"));
}

// Spheres are given in formats that contacts are written in, too.
TEST_F(DetectTool, FilesOfTheSceneAreNotOverwritten) {
  const std::string grains = "x,y,z,r\n0,0,0,1\n1,0,0,1\n";
  write_file(folder_ / "grains.csv", grains);
  fs::create_symlink("grains.csv", folder_ / "link.csv");
  write_file(folder_ / "grains.json",
             R"({"format": "padder.scene", "version": 1, "spheres": [{"file": "grains.csv"}]})");
  for (const char* output : {"grains.csv", "./grains.csv", "link.csv"}) {
    const Outcome r = run(std::string("grains.json -o ") + output);
    EXPECT_EQ(r.code, 2);
    EXPECT_NE(r.err.find("is a file that this run reads"), std::string::npos) << r.err;
    EXPECT_EQ(read_file(folder_ / output), grains);
  }
  EXPECT_EQ(run("grains.json -o other.csv").code, 0);
}

TEST_F(DetectTool, CopiesOfACluster) {
  Cluster c;
  c.name = "ball", c.centers = {Point(0, 0, 0), Point(1, 0, 0)}, c.radii = {1, 1}, c.triangle = {0, 0};
  c.bounds.add(Point(-1, -1, -1)), c.bounds.add(Point(2, 1, 1));
  write_cluster(c, folder_ / "ball.spheres.json");
  const Json j = Json::parse(run("ball.spheres.json --copies 100 --json").out);
  EXPECT_EQ(j["bodies"], 100);
  EXPECT_EQ(j["spheres"], 200);
  EXPECT_GT(j["contacts"], 10);
  EXPECT_EQ(run("dense.json --copies 3").code, 1);
}

TEST_F(DetectTool, ErrorsAreOneSentenceAndACode) {
  EXPECT_EQ(run("").code, 2);
  for (const char* length : {"--bin-size -1", "--bin-size 1e101", "--margin 1e101", "--margin -1"})
    EXPECT_EQ(run(std::string("dense.json --backend omp ") + length).code, 2) << length;
  EXPECT_NE(run("dense.json --devices 65537").err.find("1 to 9999"), std::string::npos);
  EXPECT_EQ(run("dense.json --devices 1000").code, 1);
  for (const char* threads : {"0", "-1", "1025", "100000", "2000000000", "3000000000"}) {
    const Outcome r = run(std::string("dense.json --backend omp --threads ") + threads);
    EXPECT_EQ(r.code, 2) << threads;
    EXPECT_NE(r.err.find("--threads"), std::string::npos) << r.err;
  }
  const Outcome unset = run("dense.json --backend omp -o ''");
  EXPECT_EQ(unset.code, 2);
  EXPECT_EQ(unset.err, "detect: -o is empty: say what it is to be, or leave it out\n");
  EXPECT_EQ(run("dense.json --backend omp --threads 1024").code, 0);
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_EQ(run("--version").out, "detect (padder) " PADDER_VERSION "\n");
  for (const char* wanted : {"--help", "--version"}) {
    const Outcome full = run(wanted, "sh -c '\"$0\" \"$@\" >/dev/full'");
    EXPECT_EQ(full.code, 1);
    EXPECT_EQ(full.err, "detect: cannot write to the standard output (No space left on device)\n");
  }
  const Outcome absent = run("absent.json");
  EXPECT_EQ(absent.code, 1);
  EXPECT_EQ(absent.err, "detect: cannot open absent.json: check the name and that it may be read\n");
  write_file(
      folder_ / "bad.json",
      R"({"format": "padder.scene", "version": 1, "spheres": [{"centers": [[0, 0, 0]], "radii": [-1]}]})");
  const Outcome bad = run("bad.json --backend omp --json");
  EXPECT_EQ(bad.code, 1);
  EXPECT_EQ(Json::parse(bad.out),
            (Json{{"input", "bad.json"}, {"error", bad.err.substr(8, bad.err.size() - 9)}}));  // "detect: "
  EXPECT_EQ(bad.err, "detect: sphere 0 at (0, 0, 0) has the negative radius -1: radii must be 0 or more\n");
}

TEST_F(DetectTool, JsonTellsEveryFailureOfTheWork) {
  for (const char* arguments : {"absent.json", "dense.json --devices 1000", "dense.json --stages",
                                "dense.json -o absent/c.npz", "dense.json -o c.txt"}) {
    const Outcome r = run(std::string(arguments) + " --json");
    EXPECT_NE(r.code, 0);
    const Json j = Json::parse(r.out);
    EXPECT_EQ(j.size(), 2u);
    EXPECT_EQ(j["input"], std::string(arguments).substr(0, std::string(arguments).find(' ')));
    EXPECT_EQ("detect: " + j["error"].get<std::string>() + "\n", r.err);
  }
  const Outcome usage = run("dense.json --json --zzz");
  EXPECT_EQ(usage.code, 2);
  EXPECT_EQ(Json::parse(usage.out), (Json{{"input", ""}, {"error", "there is no option \"--zzz\""}}));
}

// What option, what was given, what is allowed; none of CLI11's own words.
TEST_F(DetectTool, WrongUsageIsASentence) {
  const auto said = [&](const std::string& arguments) {
    const Outcome r = run("dense.json " + arguments);
    EXPECT_EQ(r.code, 2) << arguments;
    EXPECT_TRUE(r.err.ends_with(" (see detect --help)\n")) << r.err;
    return r.err.substr(8, r.err.find(" (see") - 8);
  };
  EXPECT_EQ(said("--copies 0"), "--copies takes a whole number from 1 to 4294967294, not \"0\"");
  EXPECT_EQ(said("--copies=-5"), "--copies takes a whole number from 1 to 4294967294, not \"-5\"");
  EXPECT_EQ(said("--copies many"), "--copies takes a whole number from 1 to 4294967294, not \"many\"");
  for (const char* number : {"010", "0x10", "-010"})
    for (const char* option : {"--copies", "--threads"})
      EXPECT_EQ(said(option + (" " + std::string(number))),
                option + (": \"" + std::string(number)) +
                    "\" is no whole number in decimal digits without a leading zero");
  EXPECT_EQ(said("--bin-size 1e-320"),
            "--bin-size: \"1e-320\" is no length that can be computed with: write at least 2.3e-308");
  EXPECT_EQ(said("--devices 1e6"),
            "--devices: \"1e6\" is no number of devices: write a whole number from 1 to 9999, or all");
  EXPECT_EQ(said("--bin-size -1"), "--bin-size takes a number above 0, not \"-1\"");
  EXPECT_EQ(said("--bin-size wide"), "--bin-size takes a number above 0, not \"wide\"");
  EXPECT_EQ(said("--bin-size nan"),
            "--bin-size: \"nan\" is no length: write a decimal number of at most 1e100");
  EXPECT_EQ(said("--margin nan"), "--margin: \"nan\" is no length: write a decimal number of at most 1e100");
  EXPECT_EQ(said("--bin-size"), "--bin-size takes a number above 0, and none is given");
  EXPECT_EQ(said("--precision sloppy"), "--precision takes one of exact and fast, not \"sloppy\"");
  EXPECT_EQ(said("--backend gpu"), "--backend takes one of auto, omp and cuda, not \"gpu\"");
  EXPECT_EQ(said("-o a.csv -o b.csv"), "-o is given 2 times: give it once");
  EXPECT_EQ(said("-o"), "-o takes a value, and none is given");
  EXPECT_EQ(said("--hash=maybe"), "--hash takes no value, not \"maybe\"");
  EXPECT_EQ(said("--zzz"), "there is no option \"--zzz\"");
  EXPECT_EQ(said("other.json"), "\"other.json\" is one input too many");
  EXPECT_LT(said("--bin-size " + std::string(100000, '7')).size(), 200u);
  EXPECT_EQ(said("--stage"), "there is no option \"--stage\": --stages may be meant");
  EXPECT_EQ(said("--pre=fast"), "there is no option \"--pre=fast\": --precision may be meant");
  EXPECT_EQ(said("--copy=3"), "there is no option \"--copy=3\": --copies may be meant");
  EXPECT_TRUE(run("").err.starts_with("detect: SCENE is missing: a scene (.json), a cluster"));
  for (const auto& [arguments, sentence] : std::vector<std::pair<std::string, std::string>>{
           {"-o c.txt", "cannot tell the format of c.txt: end it with .csv, .npz, .vtp or .npy"},
           {"-o c", "cannot tell the format of c: end it with .csv, .npz, .vtp or .npy"},
           {"--stages --path fast",
            "--stages prints the nine stages, which --path fast leaves out: leave out one of both"}}) {
    const Outcome r = run("dense.json " + arguments);
    EXPECT_EQ(r.code, 2) << arguments;
    EXPECT_EQ(r.err, "detect: " + sentence + "\n");
  }
  EXPECT_EQ(run("dense.json --stages --path nine-stages --precision sloppy").code, 2);
  for (const char* mesh : {"part.3DS", "part.fbx", "part.STL", "part.stl"}) {
    write_file(folder_ / mesh, "solid part");
    EXPECT_NE(run(mesh).err.find("is a mesh: make spheres of it first"), std::string::npos) << mesh;
  }
  EXPECT_EQ(run("part.stl").err,
            "detect: SCENE: \"part.stl\" is a mesh: make spheres of it first, with pad part.stl (see detect "
            "--help)\n");
  EXPECT_EQ(run("s.csv").err,
            "detect: SCENE: \"s.csv\" holds spheres alone: name it in a scene, as \"spheres\": [{\"file\": "
            "\"s.csv\"}] (see detect --help)\n");
  write_file(folder_ / "arm.urdf", "<?xml version=\"1.0\"?><robot name='r'/>");
  EXPECT_EQ(run("arm.urdf").err,
            "detect: arm.urdf: it is not JSON, as it begins with '<?xml version=\"1.0\"?…': a scene or a "
            "cluster of padder is wanted; pad makes a cluster of a mesh or a robot\n");
}

TEST_F(DetectTool, AFullDiskIsASentence) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the thread sanitizer's memory is a file, which the limit of file sizes cuts";
#endif
  const Outcome r = run("dense.json -o c.npz --json");
  ASSERT_EQ(r.code, 0);
  fs::remove(folder_ / "c.npz");
  for (const char* name : {"c.csv", "c.npz", "c.vtp"}) {
    const Outcome full = run(std::string("dense.json -o ") + name, "ulimit -f 100 &&");
    EXPECT_EQ(full.code, 1);
    EXPECT_EQ(full.err, "detect: cannot write " + std::string(name) +
                            " (File too large): check that the folder exists, may be written and has room\n");
    for (const auto& entry : fs::directory_iterator(folder_))
      EXPECT_FALSE(entry.path().filename().string().starts_with("c.")) << entry.path();
  }
  for (const char* option : {"--json", "-o - --format csv", "-o - --format npz"}) {
    if (!fs::exists("/dev/full")) break;
    const int status = std::system(
        ("cd " + folder_.string() + " && " PADDER_BIN "/detect dense.json -q " + option + " >/dev/full 2>err")
            .c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1);
    EXPECT_EQ(read_file(folder_ / "err"),
              "detect: cannot write to the standard output (No space left on device)\n");
  }
}

TEST_F(DetectTool, SchemaHoldsForScenesThatAreRead) {
  if (!schemas_are_checked()) GTEST_SKIP() << "python3-jsonschema is not installed";
  EXPECT_TRUE(of_schema(folder_ / "dense.json", "scene.schema.json"));
  EXPECT_TRUE(of_schema(folder_ / "small.json", "scene.schema.json"));
  write_file(folder_ / "wrong.json",
             R"({"format": "padder.scene", "version": 1, "bodies": [{"cluster": "a", "position": [0, 0]}]})");
  EXPECT_FALSE(of_schema(folder_ / "wrong.json", "scene.schema.json"));
}

}  // namespace
}  // namespace padder
