// SPDX-License-Identifier: GPL-3.0-or-later
// Plots of the benches, by the program: a bench's own is what `bench draw` makes of its JSON; what no bench
// wrote, or is damaged, ends with one sentence and no picture.
#include <gtest/gtest.h>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "padding/asset/file.h"
#include "tests/error_of.h"
#include "tests/tools/bench_program.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

class BenchDraw : public BenchProgram {};

bool have_gnuplot() { return std::system("command -v gnuplot >/dev/null 2>&1") == 0; }

#define NEEDS_GNUPLOT() \
  if (!have_gnuplot()) GTEST_SKIP() << "gnuplot is not installed (Debian: gnuplot-nox)"

Json scaling_row(const char* scene, double contacts, const char* backend) {
  return {{"scene", scene},
          {"random_order", true},
          {"spheres", 2 * contacts},
          {"contacts", contacts},
          {"backend", backend},
          {"seconds_fast", 1e-9 * contacts},
          {"seconds_exact", 2e-9 * contacts},
          {"seconds_exact_fixed", 3e-9 * contacts}};
}

const Json kDocument = scaling_document(scaling_row("dense", 1e5, "cuda"), scaling_row("dense", 1e6, "cuda"));

Json frontier_row(const std::string& mesh, const char* method, double error, int spheres) {
  return {{"mesh", mesh},
          {"method", method},
          {"protrusion_bound", error},
          {"gap_bound", error / 2},
          {"spheres", spheres}};
}

TEST_F(BenchDraw, WhatABenchDrawsIsDrawnAgainTheSame) {
  NEEDS_GNUPLOT();
  for (const std::string name : {"scaling", "bodies", "stages"}) {
    const Outcome measured =
        bench(name + " --backend omp --spheres 3000,1000 --repeat 1 --threads 1 -q -o own");
    ASSERT_EQ(measured.code, 0) << measured.err;
    EXPECT_EQ(measured.err, "");
    const Outcome drawn = bench("draw own/" + name + ".json -o again --json");
    ASSERT_EQ(drawn.code, 0) << drawn.err;
    const Json rows = Json::parse(drawn.out)["rows"];
    ASSERT_EQ(rows.size(), name == "scaling" ? 2 : 1) << "scaling: loose spheres, and bodies";
    for (const Json& row : rows) {
      const std::string plot = row["plot"];
      EXPECT_EQ(row["file"], "own/" + name + ".json");
      EXPECT_EQ(read(plot), read("own" + plot.substr(plot.find('/')))) << plot;
    }
  }
  EXPECT_EQ(files(), (std::set<std::string>{"own/scaling.json", "own/scaling.svg", "own/scaling_bodies.svg",
                                            "own/bodies.json", "own/bodies.svg", "own/stages.json",
                                            "own/stages.svg", "again/scaling.svg", "again/scaling_bodies.svg",
                                            "again/bodies.svg", "again/stages.svg"}));
  EXPECT_EQ(read("own/bodies.json").find("dense"), std::string::npos);
  for (const char* words :
       {">dense<", ">dilute<", ">poly35<", ">poly100<", ">exact<", ">fast<", ">exact, fixed order<"})
    EXPECT_TRUE(holds(read("again/scaling.svg"), words)) << words;
  for (const char* words : {">stage 9<", ">total<", ">fast path<", ">1,000 spheres, ", ">3,000 spheres, "})
    EXPECT_TRUE(holds(read("again/stages.svg"), words)) << words;
}

TEST_F(BenchDraw, BesideTheFileWhereNoFolderIsNamed) {
  NEEDS_GNUPLOT();
  fs::create_directory(folder_ / "deep");
  write("deep/of today.json", kDocument.dump());
  const Outcome r = bench("draw 'deep/of today.json'");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_TRUE(holds(r.out, "deep/of today.svg"));
  EXPECT_EQ(files(), (std::set<std::string>{"deep/of today.json", "deep/of today.svg"}));
  // Another figure, another picture.
  Json faster = kDocument;
  faster["rows"][1]["seconds_exact_fixed"] = 1e-3;
  write("deep/faster.json", faster.dump());
  ASSERT_EQ(bench("draw deep/faster.json").code, 0);
  EXPECT_NE(read("deep/faster.svg"), read("deep/of today.svg"));
}

// A line goes from left to right and a scene has one colour, whatever the order of the rows.
TEST_F(BenchDraw, RowsInAnyOrder) {
  NEEDS_GNUPLOT();
  Json one = kDocument, other = one;
  std::swap(other["rows"][0], other["rows"][1]);
  write("one.json", one.dump()), write("other.json", other.dump());
  ASSERT_EQ(bench("draw one.json other.json").code, 0);
  EXPECT_EQ(read("one.svg"), read("other.svg"));
  one["rows"].push_back(scaling_row("dense", 1e6, "omp"));
  one["rows"].push_back(scaling_row("dense", 0, "omp"));  // no place on a logarithmic axis
  write("one.json", one.dump());
  ASSERT_EQ(bench("draw one.json").code, 0);
  for (const char* words : {">dense, CPU<", ">dense, GPU<", ">a GPU, a processor<"})
    EXPECT_TRUE(holds(read("one.svg"), words)) << words;
}

TEST_F(BenchDraw, SpeedupAndFrontier) {
  NEEDS_GNUPLOT();
  const Json speedup = {{"bench", "speedup"},
                        {"rows",
                         {{{"contacts", 1e5}, {"backend", "omp"}, {"speedup", 20}},
                          {{"contacts", 1e5}, {"backend", "cuda"}, {"speedup", 300}},
                          {{"contacts", 1e6}, {"backend", "omp"}, {"speedup", 40}},
                          {{"contacts", 1e6}, {"backend", "cuda"}, {"speedup", 600}}}}};
  // A name that would leave the quotes, the folder and the shell if it were let.
  const std::string name = "it's/../a_\n$(touch gone)";
  const Json frontier = {{"bench", "frontier"},
                         {"rows",
                          {frontier_row("spot", "tolerance", 2, 20), frontier_row("spot", "tolerance", 1, 50),
                           frontier_row("spot", "depth", 1, 900), frontier_row("spot", "paper", 9, 900),
                           frontier_row(name, "paper", 1, 10)}}};
  write("speedup.json", speedup.dump()), write("frontier.json", frontier.dump());
  const Outcome r = bench("draw speedup.json frontier.json -o plots");
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(files(), (std::set<std::string>{"speedup.json", "frontier.json", "plots/speedup.svg",
                                            "plots/frontier_spot.svg",
                                            "plots/frontier_it's_.._a__$(touch gone).svg"}));
  for (const char* words : {">CPU<", ">GPU, from and to host memory<", ">the paper, at most<"})
    EXPECT_TRUE(holds(read("plots/speedup.svg"), words)) << words;
  for (const char* words :
       {">spot<", ">--tolerance<", ">--depth 0.2, refitted<", ">fixed depth 0.2 (paper)<"})
    EXPECT_TRUE(holds(read("plots/frontier_spot.svg"), words)) << words;
}

TEST_F(BenchDraw, WhatIsDamagedEndsWithOneSentenceAndNoPicture) {
  const std::string whole = kDocument.dump();
  Json less = kDocument;
  less["rows"][1].erase("contacts");
  const std::pair<std::string, std::string> cases[] = {
      {whole.substr(0, whole.size() / 2), "bad.json: not JSON at byte "},
      {"", "bad.json: not JSON at byte "},
      {"[]", "bad.json is not what a bench wrote"},
      {R"({"format": "padder.scene"})", "bad.json is not what a bench wrote"},
      {R"({"bench": 3})", "bad.json is not what a bench wrote"},
      {R"({"bench": "table2", "rows": []})", "bad.json: this bench has no plot"},
      {R"({"bench": "scaling"})", "bad.json: \"rows\" is not a list with rows in it"},
      {changed(kDocument, "/rows", Json::array()), "bad.json: \"rows\" is not a list with rows in it"},
      {changed(kDocument, "/rows/1", 3), "bad.json: rows[1] is not an object"},
      {changed(kDocument, "/rows/0/scene", 3), "bad.json: rows[0].scene is not a text"},
      {changed(kDocument, "/rows/0/random_order", 1), "bad.json: rows[0].random_order is not true or false"},
      {changed(kDocument, "/rows/1/seconds_fast", nullptr),
       "bad.json: rows[1].seconds_fast is not a number of at least 0"},
      {changed(kDocument, "/rows/1/seconds_exact", -1),
       "bad.json: rows[1].seconds_exact is not a number of at least 0"},
      {changed(kDocument, "/rows/1/contacts", "many"),
       "bad.json: rows[1].contacts is not a number of at least 0"},
      {less.dump(), "bad.json: rows[1].contacts is not a number of at least 0"},
      {changed(kDocument, "/device", nullptr), "bad.json: document.device is not a text"},
      {R"({"bench": "stages", "machine": "m", "device": "d", "rows": [{"backend": "omp", "path": "fast", "spheres": 1,
           "contacts": 1, "seconds": 3}]})",
       "bad.json: rows[0].seconds is not an object"},
      {R"({"bench": "frontier", "rows": [{"mesh": "a", "method": "new", "protrusion_bound": 1, "gap_bound": 1,
           "spheres": 1}]})",
       "bad.json: a has no row to draw"},
  };
  write("good.json", whole);
  for (const auto& [bytes, sentence] : cases) {
    write("bad.json", bytes);
    expect_refused("draw good.json bad.json -o plots", sentence);
  }
  EXPECT_EQ(files(), (std::set<std::string>{"good.json", "bad.json"}));
  EXPECT_EQ(bench("draw absent.json").err,
            "bench: cannot open absent.json: check the name and that it may be read\n");
  EXPECT_EQ(bench("draw").code, 2);
  EXPECT_EQ(bench("draw good.json ./good.json").err,
            "bench: ./good.json: another file is drawn under the same name: give each a folder of its own "
            "with -o\n");
}

TEST_F(BenchDraw, WithoutGnuplotABenchSaysSoAndDrawFails) {
  write("good.json", kDocument.dump());
  const Outcome drawn = bench("draw good.json", "PATH=/nowhere");
  EXPECT_EQ(drawn.code, 1);
  EXPECT_EQ(drawn.err, "bench: no plot: gnuplot is not installed (Debian: gnuplot-nox)\n");
  const Outcome measured =
      bench("stages --backend omp --spheres 1000 --repeat 1 --threads 1 -o own", "PATH=/nowhere");
  EXPECT_EQ(measured.code, 0);
  EXPECT_EQ(measured.err,
            "bench: no plot: gnuplot is not installed (Debian: gnuplot-nox); where it is, bench draw "
            "own/stages.json draws it\n");
  EXPECT_EQ(files(), (std::set<std::string>{"good.json", "own/stages.json"}));
}

// What docs/results shows was drawn from the figures beside it.
TEST_F(BenchDraw, ResultsOfTheDocs) {
  NEEDS_GNUPLOT();
  const fs::path results = fs::path(PADDER_ASSETS).parent_path() / "docs" / "results";
  int drawn = 0;
  for (const std::string name : {"h200/scaling", "h200/stages", "frontier/frontier", "stability/hard"}) {
    const fs::path json = results / (name + ".json");
    const Outcome r = bench("draw '" + json.string() + "' -o plots --json");
    ASSERT_EQ(r.code, 0) << r.err;
    const Json document = Json::parse(r.out);
    for (const Json& row : document["rows"]) {
      const std::string plot = row["plot"];
      const std::string ours = read(plot), theirs = read_file(json.parent_path() / fs::path(plot).filename());
      const auto version = [](const std::string& svg) {
        const std::size_t at = svg.find("Produced by GNUPLOT");
        return svg.substr(at, svg.find('<', at) - at);
      };
      if (version(ours) != version(theirs))
        GTEST_SKIP() << "drawn there by another gnuplot: " << version(theirs);
      EXPECT_TRUE(ours == theirs) << plot << " is not of today's figures: bench draw " << json
                                  << " renews it";
      drawn++;
    }
  }
  EXPECT_EQ(drawn, 6);
}

}  // namespace
}  // namespace padder
