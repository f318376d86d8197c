// SPDX-License-Identifier: GPL-3.0-or-later
// What bench says of options and files that are wrong, or that the chosen bench does not read.
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/error_of.h"
#include "tests/tools/bench_program.h"

namespace padder {
namespace {

class BenchUsage : public BenchProgram {
 protected:
  // The sentence of a call that must end with exit code 2, without "bench: ". It has 20 seconds.
  std::string refused(const std::string& arguments) const {
    const Outcome r = bench(arguments, "timeout 20");
    EXPECT_EQ(r.code, 2) << arguments << '\n' << r.err;
    EXPECT_EQ(r.out, "") << arguments;
    return r.err.starts_with("bench: ") ? r.err.substr(7, r.err.find('\n') - 7) : r.err;
  }
};

TEST_F(BenchUsage, NumbersAreDecimalAndInTheirRange) {
  for (const char* number : {"010", "0x10"})
    for (const char* option : {"--spheres", "--repeat", "--threads", "--devices"})
      EXPECT_EQ(refused(std::string("boxes --backend omp ") + option + " " + number),
                std::string(option) + ": \"" + number +
                    "\" is no whole number in decimal digits without a leading zero (see bench --help)");
  for (const char* number : {"-1", "-5", "0", "99999999999999999999", "18446744073709551615", "100,-1"})
    EXPECT_TRUE(refused(std::string("stages --spheres=") + number)
                    .starts_with("--spheres takes a whole number from 1 to 4294967294, not "))
        << number;
  EXPECT_EQ(refused("stages --repeat 3000000000"),
            "--repeat: \"3000000000\" is too large: write at most 2147483647 (see bench --help)");
}

TEST_F(BenchUsage, WhatTheBenchDoesNotReadIsRefused) {
  const std::string stages = "stages --spheres 1000 --repeat 1 --backend omp ";
  EXPECT_EQ(refused(stages + "--stable"),
            "--stable is for scenes, motions, mixtures and shapes: leave it out");
  for (const char* option : {"--moving", "--history", "--margin 7"}) {
    const std::string name = std::string(option).substr(0, std::string(option).find(' '));
    EXPECT_EQ(refused(stages + option), name + " is for scenes: leave it out");
  }
  EXPECT_EQ(refused(stages + "--devices 3"), "--devices is for boxes: leave it out");
  EXPECT_EQ(refused(stages + "--within 50%"), "--within is for compare: leave it out");
  EXPECT_EQ(refused(stages + "part.stl"), "stages reads no file: leave part.stl out");
  EXPECT_EQ(refused("compare a.json b.json --spheres 5").substr(0, 18), "--spheres is for t");
  EXPECT_EQ(bench(stages + "--json").code, 0);
}

TEST_F(BenchUsage, ASizeThatIsAskedForIsMeasured) {
  const Outcome r = bench("bodies --spheres 10 --backend omp --repeat 1 --threads 1 --json");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(Json::parse(r.out)["rows"][0]["spheres"], 64) << "one body";
  expect_refused("piles --scene loose --backend omp -q",
                 "nothing was measured, because no size of the bench's own is of this scene and backend");
  if (bench("stages --spheres 1000 --repeat 1 --backend cuda").code == 0) GTEST_SKIP() << "there is a GPU";
  EXPECT_TRUE(refused("boxes --spheres 1000 --devices 5").starts_with("--devices counts GPUs"));
  EXPECT_TRUE(refused("boxes --spheres 1000 --scene poly100").starts_with("--scene poly100 is measured on"));
  for (const char* name : {"table2", "stages", "boxes", "piles"}) {
    const Outcome absent = bench(std::string(name) + " --backend cuda", "timeout 20");
    EXPECT_EQ(absent.code, 1);
    EXPECT_TRUE(absent.err.ends_with("choose omp\n")) << absent.err;
    EXPECT_EQ(absent.err.find('\n'), absent.err.size() - 1) << "nothing was measured: " << absent.err;
  }
}

TEST_F(BenchUsage, RandomScenesComeAgainByTheirSeed) {
  const auto rows = [&](const std::string& arguments) {
    const Outcome r = bench(arguments + " --backend omp --threads 1 --repeat 1 --json");
    EXPECT_EQ(r.code, 0) << r.err;
    return r.code == 0 ? Json::parse(r.out)["rows"] : Json::array();
  };
  const Json three = rows("mixtures --spheres 2000 --seed 7 --count 3"),
             last = rows("mixtures --spheres 2000 --seed 9 --count 1");
  ASSERT_EQ(three.size(), 3);
  ASSERT_EQ(last.size(), 1);
  for (const char* key : {"seed", "scene", "contacts"}) EXPECT_EQ(three[2][key], last[0][key]);
  EXPECT_NE(three[0]["scene"], three[1]["scene"]);
  const Json bodies = rows("shapes --scene mixtures --seed 3 --count 1");
  ASSERT_EQ(bodies.size(), 2);  // moving, and read anew
  EXPECT_EQ(bodies[0]["contacts"], bodies[1]["contacts"]);
}

// As many contacts in each frame as the nine stages find, or it would fail.
TEST_F(BenchUsage, ScenesInMotionAreMeasured) {
  const Outcome r = bench("motions --scene poly35 --spheres 500 --backend omp --threads 1 --repeat 1 --json");
  ASSERT_EQ(r.code, 0) << r.err;
  const Json rows = Json::parse(r.out)["rows"];
  ASSERT_EQ(rows.size(), 9);
  for (const Json& row : rows) EXPECT_GT(row["seconds_moving_worst"], 0) << row["motion"];
  EXPECT_TRUE(refused("motions --scene none").starts_with("--scene of motions is one of dense, "));
}

TEST_F(BenchUsage, WhatIsWrongWithTheLastFileIsSaidFirst) {
  write("one.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  expect_refused("frontier one.off absent.off", "cannot open absent.off");
  EXPECT_TRUE(refused("frontier one.off ./one.off").starts_with("./one.off has the name of another mesh"));
  write("scene.json", R"({"format": "padder.scene", "version": 1})");
  expect_refused("piles scene.json", "scene.json: not a cluster");
}

TEST_F(BenchUsage, WhatWasMeasuredIsPrintedThoughItCannotBeWritten) {
  const Outcome r = bench("stages --spheres 1000 --repeat 1 --backend omp --threads 1 -o /proc/none");
  EXPECT_EQ(r.code, 1);
  EXPECT_TRUE(r.err.starts_with("bench: cannot write /proc/none/stages.json")) << r.err;
  EXPECT_EQ(r.out.empty(), ::geteuid() != 0) << "others than root are refused before the work";
  write("a file", "");
  expect_refused("stages -o 'a file/x'", "cannot write a file/x/stages.json (Not a directory)");
}

TEST_F(BenchUsage, WrongUsageIsNoFailure) {
  EXPECT_EQ(refused("table3 --scene nonsense --backend omp"),
            "--scene of table3 is one of silo and clumps, not \"nonsense\"");
  for (const char* name : {"scaling", "scenes", "piles", "shapes", "boxes"})
    EXPECT_TRUE(refused(std::string(name) + " --scene nonsense --backend omp")
                    .starts_with("--scene of " + std::string(name) + " is one of "));
  EXPECT_TRUE(
      refused("precision --scene nonsense --spheres 1000").starts_with("no scene of bench precision"));
}

}  // namespace
}  // namespace padder
