// SPDX-License-Identifier: MIT
#include "padding/asset/cluster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tests/error_of.h"
#include "tests/of_schema.h"
#include "tests/padding/random_input.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

// Doubles with all kinds of digits and exponents: their bits are random, not their values.
double any_double(std::mt19937_64& random) {
  for (;;) {
    const std::uint64_t bits = random();
    double x;
    std::memcpy(&x, &bits, sizeof x);
    if (std::isfinite(x)) return x;
  }
}

Cluster random_cluster(std::uint64_t seed, std::size_t n = 50) {
  std::mt19937_64 random(seed);
  const auto number = [&] { return any_double(random); };
  const auto positive = [&] { return std::abs(number()); };
  const auto vector = [&] { return Vector(number(), number(), number()); };
  Cluster c;
  c.name = "a \"part\" \\ with \n odd characters, \u00e9 and \U0001F9F1";
  c.unit = "mm", c.program = "padder test";
  c.source = {"part.obj", std::string(64, 'a'), 0xffffffffffull, "merged 3 points"};
  c.settings = R"({"z":1,"depth":0.2,"a":[1,2.5e-300,null,{"x":"y"}]})";
  c.family = 0xffffffff, c.mask = 0x80000001;
  c.bounds.low = Point(-1, -2, -5e-324), c.bounds.high = Point(0.1, 1e300, 3);
  c.mass.volume = positive(), c.mass.center = vector(), c.mass.moments = vector();
  for (int k = 0; k < 3; k++) c.mass.inertia.row(k) = vector(), c.mass.axes.row(k) = vector();
  c.volume_union = positive();
  const auto accuracy = [&] {
    Accuracy a;
    for (double* x : {&a.protrusion_max, &a.protrusion_mean, &a.protrusion_p95, &a.gap_max, &a.gap_mean,
                      &a.gap_p95, &a.volume_ratio, &a.protrusion_bound, &a.gap_bound, &a.wrap_distance})
      *x = positive();
    a.coverage = 1.0 / 3, a.normal_error_mean_deg = 0.1, a.normal_error_p95_deg = 179.99999999999997;
    a.certified = random() % 2;
    return a;
  };
  const auto spheres = [&](auto& of, std::size_t count) {
    for (std::size_t k = 0; k < count; k++) {
      of.centers.push_back(vector()), of.radii.push_back(std::max(positive(), 5e-324));
      of.triangle.push_back(static_cast<std::int64_t>(random() >> 2));
    }
  };
  c.accuracy = accuracy();
  c.accuracy.certified = true;
  c.accuracy.proved_against = SurfaceKind::input, c.mass_of = SurfaceKind::wrap;
  spheres(c, n);
  for (std::size_t k = 1; k < 4; k++) {
    Lod& lod = c.lods.emplace_back();
    lod.tolerance = positive(), lod.volume_union = positive(), lod.accuracy = accuracy();
    spheres(lod, n / (k + 1));
  }
  return c;
}

TEST(Cluster, ScalingTakesTheLengthsOfItsSettings) {
  Cluster c;
  c.settings =
      R"({"depth":0.2,"edge_length":1,"tolerance":2,"lod":[4,3],"effort":1,"thickness":0.5,"gap":0})";
  c.scale(10);
  EXPECT_EQ(
      c.settings,
      R"({"depth":0.2,"edge_length":10.0,"tolerance":20.0,"lod":[40.0,30.0],"effort":1,"thickness":5.0,"gap":0.0})");
}

TEST(Cluster, WritingAndReadingBackLosesNothing) {
  for (std::uint64_t seed = 1; seed <= 40; seed++) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Cluster c = random_cluster(seed);
    const std::string text = to_json(c);
    const Cluster back = cluster_from_json(text, "text");
    EXPECT_TRUE(c == back);
    EXPECT_EQ(to_json(back), text);
  }
}

TEST(Cluster, FileHoldsTheText) {
  const TemporaryFolder folder;
  const Cluster c = random_cluster(7);
  write_cluster(c, folder.path() / "a.spheres.json");
  EXPECT_EQ(read_file(folder.path() / "a.spheres.json"), to_json(c));
  EXPECT_TRUE(read_cluster(folder.path() / "a.spheres.json") == c);
}

TEST(Cluster, EmptyAndMinimal) {
  const Cluster none;
  EXPECT_TRUE(cluster_from_json(to_json(none), "text") == none);  // its empty bounds stay empty
  const Cluster c = cluster_from_json(
      R"({"format":"padder.cluster","version":1,"spheres":{"centers":[[0,1,2]],"radii":[3]}})", "text");
  ASSERT_EQ(c.size(), 1u);
  EXPECT_EQ(c.centers[0], Point(0, 1, 2));
  EXPECT_EQ(c.radii[0], 3);
  EXPECT_EQ(c.triangle[0], -1);
  EXPECT_EQ(c.family, 0u);
  EXPECT_TRUE(c.bounds.empty());
  EXPECT_NO_THROW(cluster_from_json(to_json(c), "text"));
}

TEST(Cluster, NamesThatAreNoUtf8AreStillWritten) {
  Cluster c = random_cluster(1, 1);
  c.name = "caf\xe9";
  EXPECT_EQ(cluster_from_json(to_json(c), "text").name, "caf\xef\xbf\xbd");
}

TEST(Cluster, WhatIsNotFiniteIsNotWritten) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const std::function<void(Cluster&)> faults[] = {[&](Cluster& c) { c.centers[1].y() = nan; },
                                                  [&](Cluster& c) { c.radii[0] = inf; },
                                                  [&](Cluster& c) { c.radii[0] = 0; },
                                                  [&](Cluster& c) { c.radii[0] = -1; },
                                                  [&](Cluster& c) { c.radii.pop_back(); },
                                                  [&](Cluster& c) { c.triangle.push_back(1); },
                                                  [&](Cluster& c) { c.bounds.high.x() = inf; },
                                                  [&](Cluster& c) { c.mass.volume = nan; },
                                                  [&](Cluster& c) { c.mass.inertia(2, 1) = inf; },
                                                  [&](Cluster& c) { c.volume_union = nan; },
                                                  [&](Cluster& c) { c.accuracy.gap_p95 = nan; },
                                                  [&](Cluster& c) { c.lods[1].radii[0] = 0; },
                                                  [&](Cluster& c) { c.lods[0].accuracy.gap_max = nan; },
                                                  [&](Cluster& c) { c.lods[0].centers.pop_back(); },
                                                  [&](Cluster& c) { c.settings = "[1]"; },
                                                  [&](Cluster& c) { c.settings = "{"; }};
  for (const auto& fault : faults) {
    Cluster c = random_cluster(3, 8);
    EXPECT_NO_THROW(to_json(c));
    fault(c);
    EXPECT_THROW(to_json(c), Error);
  }
}

TEST(Cluster, FaultyDocumentsEndInASentenceThatNamesTheKey) {
  const std::string head = R"({"format":"padder.cluster","version":1,)";
  const std::string spheres = R"("spheres":{"centers":[[0,0,0]],"radii":[1]})";
  const std::pair<std::string, std::string> table[] = {
      {"", "not JSON at byte"},
      {"{", "not JSON at byte"},
      {"\n<sdf version='1.6'>",
       "it is not JSON, as it begins with '\\n<sdf version='1.6'>': a cluster of padder is wanted"},
      {head + spheres, "not JSON at byte"},
      {"[]", "\"format\" must be"},
      {"{}", "\"format\" must be"},
      {R"({"format":7})", "\"format\" must be"},
      {R"({"format":"padder.scene","version":1})", "\"format\" must be"},
      {R"({"format":"padder.cluster","version":2,)" + spheres + "}", "version 1"},
      {R"({"format":"padder.cluster",)" + spheres + "}", "version 1"},
      {R"({"format":"padder.cluster","version":1})", "\"spheres\" is missing"},
      {head + R"("spheres":[]})", "text, spheres: an object is wanted"},
      {head + R"("spheres":{"centers":[[0,0,0]]}})", "text, spheres: \"radii\" is missing"},
      {head + R"("spheres":{"centers":[[0,0]],"radii":[1]}})", "text, spheres, centers 0: 3 numbers"},
      {head + R"("spheres":{"centers":[[0,0,"1"]],"radii":[1]}})", "text, spheres, centers 0 2: a number"},
      {head + R"("spheres":{"centers":[[0,0,null]],"radii":[1]}})", "text, spheres, centers 0 2: a number"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":["1"]}})", "text, spheres, radii 0: a number"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":[1,2]}})", "one length"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":[1],"triangle":[]}})", "one length"},
      {head + R"("spheres":{"count":2,"centers":[[0,0,1]],"radii":[1]}})",
       "text, spheres, count: it is not the number of spheres"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":[0]}})", "sphere 0 has a radius"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":[-1]}})", "sphere 0 has a radius"},
      {head + R"("spheres":{"centers":[[0,0,1e999]],"radii":[1]}})",
       "text, spheres, centers 0: the number '1e999' at byte 71 (line 1) is too large"},
      {head + R"("family":-1,)" + spheres + "}", "text, family: a whole number from 0 to 4294967295"},
      {head + R"("mask":4294967296,)" + spheres + "}", "text, mask: a whole number from 0 to 4294967295"},
      {head + R"("mask":1.5,)" + spheres + "}", "text, mask: a whole number from 0 to 4294967295"},
      {head + R"("mask":-1.0,)" + spheres + "}", "text, mask: a whole number from 0 to 4294967295"},
      {head + R"("mask":1e300,)" + spheres + "}", "text, mask: a whole number from 0 to 4294967295"},
      {head + R"("name":7,)" + spheres + "}", "text, name: a string"},
      {head + R"("source":7,)" + spheres + "}", "text, source: an object"},
      {head + R"("settings":7,)" + spheres + "}", "text, settings: an object"},
      {head + R"("bounds":{"low":[0,0,0]},)" + spheres + "}", "text, bounds: \"high\" is missing"},
      {head + R"("mass_properties":{"volume":1},)" + spheres + "}", "text, mass_properties: \"center\""},
      {head + R"("accuracy":{"gap_max":"0"},)" + spheres + "}", "text, accuracy, gap_max: a number"},
      {head + R"("accuracy":{"certified":1},)" + spheres + "}", "text, accuracy, certified: true or false"},
      {head + R"("source":{"triangles":1.5},)" + spheres + "}", "text, source, triangles: a whole number"},
      {head + R"("spheres":{"centers":[[0,0,1]],"radii":[1],"triangle":[0.5]}})",
       "triangle 0: a whole number"}};
  for (const auto& [text, words] : table) {
    const std::string sentence = error_of([&text = text] { cluster_from_json(text, "text"); });
    EXPECT_EQ(sentence.rfind("text", 0), 0u) << text << "\n" << sentence;
    EXPECT_EQ(sentence.find("json."), std::string::npos) << sentence;  // the library's own words
    EXPECT_NE(sentence.find(words), std::string::npos) << text << "\n" << sentence;
  }
}

// JSON has one kind of number. Programs that have one, too, write 3.0.
TEST(Cluster, AWholeNumberMayBeWrittenWithAPoint) {
  const Cluster c =
      cluster_from_json(R"({"format":"padder.cluster","version":1.0,"family":3.0,"mask":4.294967295e9,
    "source":{"triangles":12e0},"spheres":{"count":2.0,"centers":[[0,0,0],[1,0,0]],"radii":[1,1],"triangle":[-1.0,7.0]}})",
                        "text");
  EXPECT_EQ(c.family, 3u);
  EXPECT_EQ(c.mask, 4294967295u);
  EXPECT_EQ(c.source.triangles, 12u);
  EXPECT_EQ(c.triangle, (std::vector<std::int64_t>{-1, 7}));
}

// A message must not repeat all of a file, nor pass on its control characters.
TEST(Cluster, HostileDocumentsEndInAShortSentence) {
  const std::string head = R"({"format":"padder.cluster","version":1,)", large(10000000, 'k');
  const std::string spheres = R"("spheres":{"centers":[[0,0,0]],"radii":[1]})";
  std::string deep = head + R"("settings":{"a":)";
  for (int k = 0; k < 1000000; k++) deep += '[';
  const std::pair<std::string, std::string> table[] = {
      {head + spheres + "," + spheres + "}", "text: the key \"spheres\" stands twice in one object"},
      {head + R"("spheres":{"centers":[[0,0,0]],"radii":[1],"radii":[2]}})",
       "text, spheres: the key \"radii\" stands twice"},
      {head + R"("lods":[{"spheres":{"radii":[],"radii":[]}}],)" + spheres + "}",
       "text, lods 0, spheres: the key \"radii\" stands twice"},
      {head + '"' + large + "\":1,\"" + large + "\":2," + spheres + "}", "stands twice"},
      {head + R"("a\nb":1,"a\nb":2})", "the key \"a\\nb\" stands twice"},
      {head + R"("name":")" + large, "it ends too early"},
      {head + R"("name":)" + large + "}", "near '\"name\":k'"},
      {head + R"("name":)" + std::string(1000000, '9') + "e9}", "is too large for a double"},
      {head + "\"name\":\"\x1b[2J\"}", "near '\"<U+001B>'"},
      {deep, "nested deeper than 64 levels"}};
  for (const auto& [text, words] : table) {
    const std::string sentence = error_of([&text = text] { cluster_from_json(text, "text"); });
    EXPECT_NE(sentence.find(words), std::string::npos) << text.substr(0, 200) << "\n"
                                                       << sentence.substr(0, 400);
    EXPECT_LT(sentence.size(), 300u);
    EXPECT_TRUE(std::ranges::all_of(sentence, [](char c) { return static_cast<unsigned char>(c) >= 32; }));
  }
  // Reading many unknown keys takes time in proportion to their bytes.
  std::string many = head;
  for (int k = 0; k < 200000; k++) many += '"' + std::to_string(k) + "\":0,";
  EXPECT_EQ(cluster_from_json(many + spheres + "}", "text").size(), 1u);
}

TEST(Cluster, CutAnywhereItIsRefused) {
  const std::string text = to_json(random_cluster(5, 3));
  for (std::size_t length = 0; length + 2 < text.size(); length += 3)
    EXPECT_THROW(cluster_from_json(text.substr(0, length), "text"), Error) << length;
}

TEST(Cluster, TheSchemaHoldsForWhatIsWrittenAndForNothingElse) {
  if (!schemas_are_checked()) GTEST_SKIP() << "python3-jsonschema is not installed";
  const std::string kSchema = "cluster.schema.json";
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "c.json";
  Cluster c = random_cluster(11, 5);
  c.unit = "";
  write_cluster(c, file);
  EXPECT_TRUE(of_schema(file, kSchema));
  write_cluster(Cluster(), file);
  EXPECT_TRUE(of_schema(file, kSchema));
  const std::string good = to_json(c);
  const std::pair<std::string, std::string> faults[] = {{"\"version\": 1", "\"version\": 2"},
                                                        {"\"unit\": \"\"", "\"unit\": \"ft\""},
                                                        {"\"family\": 4294967295", "\"family\": -1"},
                                                        {"\"radii\": [", "\"radii\": [0,"},
                                                        {"\"centers\": [", "\"centers\": [[1,2],"},
                                                        {"\"certified\":true", "\"certified\":1"},
                                                        {"\"mask\"", "\"masks\""},
                                                        {"\"coverage\":0.", "\"coverage\":1."},
                                                        {"aaaa", "AAAA"}};
  for (const auto& [from, to] : faults) {
    std::string bad = good;
    const std::size_t at = bad.find(from);
    ASSERT_NE(at, bad.npos) << from;
    write_file(file, bad.replace(at, from.size(), to));
    EXPECT_FALSE(of_schema(file, kSchema)) << from << " as " << to;
  }
}

TEST(Cluster, SaysWhichSurfaceIsMeant) {
  Cluster c;
  c.centers = {Point::Zero()}, c.radii = {1}, c.triangle = {-1};
  for (const auto kind : {SurfaceKind::none, SurfaceKind::input, SurfaceKind::filled, SurfaceKind::wrap}) {
    c.mass_of = c.accuracy.proved_against = kind;
    const Cluster back = cluster_from_json(to_json(c), "text");
    EXPECT_EQ(back.mass_of, kind);
    EXPECT_EQ(back.accuracy.proved_against, kind);
  }
  std::string text = to_json(c);
  text.replace(text.find("\"wrap\""), 6, "\"hull\"");
  EXPECT_THROW(cluster_from_json(text, "text"), Error);
}

}  // namespace
}  // namespace padder
