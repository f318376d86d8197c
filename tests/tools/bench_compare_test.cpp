// SPDX-License-Identifier: GPL-3.0-or-later
// `bench compare` by the program: which times count, what is printed, and the exit code.
#include <gtest/gtest.h>

#include "tests/error_of.h"
#include "tests/tools/bench_program.h"

namespace padder {
namespace {

Json scaling_row(const char* scene, double seconds) {
  return {{"scene", scene},
          {"random_order", true},
          {"spheres", 1000000},
          {"contacts", 3444339},
          {"hash", "1448"},
          {"backend", "cuda"},
          {"seconds_fast", seconds},
          {"seconds_exact", seconds},
          {"seconds_exact_fixed", seconds},
          {"seconds_exact_points", seconds}};
}

Json document_of(double dense, double dilute) {
  return scaling_document(scaling_row("dense", dense), scaling_row("dilute", dilute));
}

class BenchCompare : public BenchProgram {
 protected:
  void SetUp() override {
    BenchProgram::SetUp();
    write("old.json", document_of(1e-3, 2e-3).dump());
  }
  // Compares old.json with this document.
  Outcome compare(const Json& document, const std::string& options = "") const {
    write("new.json", document.dump());
    return bench("compare old.json new.json " + options);
  }
};

TEST_F(BenchCompare, ARunAsFastAsTheOldOnePasses) {
  const Outcome same = bench("compare old.json old.json");
  EXPECT_EQ(same.code, 0);
  EXPECT_EQ(same.err, "");
  EXPECT_TRUE(
      holds(same.out, "| dense cuda random 1000000  | seconds_fast         | 1.000    | 1.000    | 1.000"));
  EXPECT_EQ(compare(document_of(1.02e-3, 1e-3)).code, 0) << "2 % slower, and faster";
}

TEST_F(BenchCompare, OneTimeThatIsSlowerFails) {
  Json slow = document_of(1e-3, 2e-3);
  slow["rows"][1]["seconds_exact"] = 2.1e-3;
  const Outcome r = compare(slow);
  EXPECT_EQ(r.code, 1);
  EXPECT_EQ(r.err, "bench: 1 time is slower than the old by more than 3 %, at worst 1.050 times as long\n");
  EXPECT_TRUE(holds(
      r.out,
      "| dilute cuda random 1000000 | seconds_exact        | 2.000    | 2.100    | 1.050     | SLOWER |"));
  EXPECT_EQ(compare(slow, "--within 6%").code, 0);
  EXPECT_EQ(compare(slow, "--within 0.06").code, 0);
  EXPECT_EQ(compare(document_of(1.0001e-3, 2e-3), "--within 0").code, 1);
}

TEST_F(BenchCompare, JsonSaysTheSame) {
  const Outcome r = compare(document_of(1.1e-3, 2e-3), "--json");
  EXPECT_EQ(r.code, 1);
  const Json j = Json::parse(r.out);
  EXPECT_EQ(j["passed"], false);
  EXPECT_EQ(j["within"], 0.03);
  ASSERT_EQ(j["rows"].size(), 8u);
  EXPECT_EQ(j["rows"][0]["slower"], true);
  EXPECT_NEAR(j["rows"][0]["ratio"], 1.1, 1e-12);
  EXPECT_EQ(j["rows"][4]["slower"], false);
}

TEST_F(BenchCompare, RowsOfOneSideAreNamed) {
  Json other = document_of(1e-3, 2e-3);
  other["rows"][1]["scene"] = "poly35";
  const Outcome r = compare(other);
  EXPECT_EQ(r.code, 0);
  EXPECT_TRUE(holds(r.out,
                    "| dilute cuda random 1000000 |                      |          |          |           | "
                    "missing in NEW |"));
  EXPECT_TRUE(holds(r.out, "missing in OLD"));
  other["rows"][0]["scene"] = "poly100";
  EXPECT_EQ(compare(other).err,
            "bench: old.json and new.json have no row in common: were they run with other options?\n");
}

TEST_F(BenchCompare, OtherContactsFail) {
  Json other = document_of(1e-3, 2e-3);
  other["rows"][0]["hash"] = "1449";
  const Outcome r = compare(other);
  EXPECT_EQ(r.code, 1);
  EXPECT_EQ(r.err, "bench: 1 row found other contacts than the old\n");
}

TEST_F(BenchCompare, AnotherMachineIsSaid) {
  Json other = document_of(1e-3, 2e-3);
  other["device"] = "another GPU";
  const Outcome r = compare(other);
  EXPECT_EQ(r.code, 0);
  EXPECT_EQ(r.err,
            "bench: the two files name different values for \"device\": \"a GPU\" and \"another GPU\"\n");
  EXPECT_EQ(compare(other, "-q").err, "");
}

TEST_F(BenchCompare, WhatABenchWritesIsCompared) {
  ASSERT_EQ(
      bench("stages --backend omp --spheres 1000 --repeat 1 --threads 1 -q -o own", "PATH=/nowhere").code, 0);
  const Outcome r = bench("compare own/stages.json own/stages.json");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_TRUE(holds(r.out, "omp nine stages 1000"));
  const std::string results = source_folder() + "/docs/results/";
  for (const std::string name : {"h200/scaling", "h200/stages", "frontier/frontier", "bullet/speedup"}) {
    const std::string file = "'" + results + name + ".json'";
    const Outcome same = bench("compare " + file + " " + file);
    EXPECT_EQ(same.code, 0) << name << ": " << same.err;
  }
}

TEST_F(BenchCompare, WhatCannotBeComparedEndsWithOneSentence) {
  const Json whole = document_of(1e-3, 2e-3);
  const std::pair<std::string, std::string> cases[] = {
      {"", "bad.json: not JSON at byte "},
      {"[]", "bad.json is not what a bench wrote"},
      {R"({"bench": "table2", "rows": []})", "bad.json is of the bench table2, and old.json of scaling"},
      {R"({"bench": "scaling"})", "bad.json: \"rows\" is not a list with rows in it"},
      {changed(whole, "/rows/1", 3), "bad.json: rows[1] is not an object"},
      {changed(whole, "/rows/1/scene", "dense"),
       "bad.json: rows[1]: an earlier row is of dense cuda random 1000000"},
      {changed(whole, "/rows/0/seconds_fast", "x"),
       "bad.json: rows[0].seconds_fast is not a number of at least 0"},
      {changed(whole, "/rows/0/seconds_fast", 0), "bad.json: rows[0]: seconds_fast is 0"},
      {changed(whole, "/rows/0/random_order", 1), "bad.json: rows[0].random_order is not true or false"},
      {R"({"bench": "scaling", "rows": [1e999]})", "bad.json, rows: the number '1e999'"},
      {R"({"machine": )" + std::string(300000, '[') + std::string(300000, ']') + "}",
       "bad.json, machine 0 0"},
  };
  for (const auto& [bytes, sentence] : cases) {
    write("bad.json", bytes);
    expect_refused("compare old.json bad.json", sentence);
  }
  write("table2.json", R"({"bench": "table2", "rows": []})");
  EXPECT_EQ(
      bench("compare table2.json table2.json").err,
      "bench: table2.json: table2 measures no time; scaling, bodies, stages, speedup and frontier do\n");
  EXPECT_EQ(bench("compare old.json").err,
            "bench: name two files that the same bench wrote: bench compare OLD.json NEW.json\n");
  EXPECT_EQ(bench("compare old.json").code, 2);
  const Outcome usage = bench("compare old.json old.json --within fast");
  EXPECT_EQ(usage.code, 2);
  EXPECT_TRUE(holds(usage.err, "as 3% or 0.03"));
  EXPECT_EQ(bench("compare old.json old.json --within -1%").code, 2);
}

}  // namespace
}  // namespace padder
