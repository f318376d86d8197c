// SPDX-License-Identifier: MIT
#include "padding/view/page.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

using Json = nlohmann::json;

// A template without script: what the page holds is read here as the script would.
class Page : public ::testing::Test, protected TemporaryFolder {
 protected:
  Page() {
    options.script =
        put("script.html", "<title><!--padder:title--></title>\n<body><!--padder:data--></body>");
    view.title = "part";
    view.unit = "m";
    view.centers = {{10, -3, 0.5}, {10.25, -2, 0.75}, {11, -3.5, 0.875}};
    view.radii = {0.5, 0.0625, 0.1};
    view.family = {4, 4, 4};
  }

  static std::string element(const std::string& html, const std::string& id) {
    const std::string mark = "id=\"" + id + "\">";
    const std::size_t at = html.find(mark);
    if (at == std::string::npos) return "";
    return html.substr(at + mark.size(), html.find("</script>", at) - at - mark.size());
  }
  template <class T>
  static std::vector<T> array(const std::string& html, const std::string& id) {
    std::string bytes;
    std::uint32_t word = 0;
    int bits = 0;
    for (const char c : element(html, id)) {
      if (c == '=') break;
      const int digit = c >= 'a'   ? c - 'a' + 26
                        : c >= 'A' ? c - 'A'
                        : c == '+' ? 62
                        : c == '/' ? 63
                                   : c - '0' + 52;
      word = word << 6 | std::uint32_t(digit), bits += 6;
      if (bits >= 8) bits -= 8, bytes += char(word >> bits & 255);
    }
    std::vector<T> out(bytes.size() / sizeof(T));
    std::memcpy(out.data(), bytes.data(), out.size() * sizeof(T));
    return out;
  }

  PageOptions options;
  View view;
};

TEST_F(Page, SpheresComeBackFromTheirTwelveBytes) {
  const std::string html = page_html(view, options);
  const Json head = Json::parse(element(html, "head"));
  EXPECT_EQ(head["spheres"], 3);
  const auto words = array<std::uint32_t>(html, "spheres");
  ASSERT_EQ(words.size(), 9u);
  const double scale = head["scale"], half = view.bounds().diagonal() / (1 << 21);
  for (int k = 0; k < 3; k++) {
    const std::uint64_t bits = words[3 * k] | std::uint64_t(words[3 * k + 1]) << 32;
    for (int i = 0; i < 3; i++) {
      const double at =
          head["low"][i].get<double>() + double(bits >> (21 * i) & 0x1fffff) * head["step"][i].get<double>();
      EXPECT_NEAR(head["center"][i].get<double>() + at * scale, view.centers[k][i], half) << k << " " << i;
    }
    EXPECT_NEAR(std::bit_cast<float>(words[3 * k + 2]) * scale, view.radii[k], 1e-6 * view.radii[k]);
  }
}

TEST_F(Page, ArraysOfOneValueOrNoneAreLeftOut) {
  const std::string html = page_html(view, options);
  EXPECT_EQ(Json::parse(element(html, "head"))["family"], 4);
  for (const char* id :
       {"family", "triangle", "protrusion", "body", "points", "triangles", "pairs", "contacts"})
    EXPECT_EQ(html.find("id=\"" + std::string(id) + "\""), std::string::npos) << id;
}

TEST_F(Page, EverythingAViewHasIsThere) {
  view.family = {4, 0, 7};
  view.triangle = {11, -1, 13};
  view.protrusion = {0.5f, 0, 0.25f};
  view.bodies = {{"a", 0, 1, 4, 9}, {"b", 1, 1, 0, 0}, {"a", 2, 1, 7, 0}};
  view.body = {0, 1, 2};
  view.mesh = shapes::box({10, -4, 0}, {11, -3, 1});
  view.marks = {{MarkKind::slot, shapes::square(2)}};
  view.contacts = {{0, 2, {10.5, -3, 0.5}, {0, 0, 1}, 0.125}};
  view.rungs = {{"fine", 0, 2, {}}, {"coarse", 2, 1, std::vector<Accuracy>(1)}};
  view.rungs[1].accuracy[0].gap_max = 0.875;
  options.rung = 1;
  view.accuracy.resize(1);
  view.accuracy[0].gap_max = 0.75;
  add_errors(view);
  options.colour = ColourBy::gap;
  const std::string html = page_html(view, options);
  const Json head = Json::parse(element(html, "head"));
  EXPECT_EQ(array<std::uint32_t>(html, "family"), view.family);
  EXPECT_EQ(array<std::int32_t>(html, "triangle"), (std::vector<std::int32_t>{11, -1, 13}));
  EXPECT_EQ(array<float>(html, "protrusion"), view.protrusion);
  EXPECT_EQ(array<std::uint32_t>(html, "body"), view.body);
  EXPECT_EQ(array<float>(html, "gap"), view.gap);
  EXPECT_EQ(head["colour"], "gap");
  EXPECT_EQ(array<float>(html, "finer-points").size(),
            3 * (view.errors.mesh.points.size() - view.mesh.points.size()));
  EXPECT_EQ(array<std::uint32_t>(html, "finer-triangles").size(), 3 * view.errors.mesh.triangles.size());
  EXPECT_EQ(array<float>(html, "mesh-gap0"), view.errors.gap[0]);
  EXPECT_EQ(array<float>(html, "mesh-gap1"), view.errors.gap[1]);
  EXPECT_EQ(head["clusters"], (Json{"a", "b"}));
  EXPECT_EQ(head["bodies"], (Json{{0, 0, 1, 4, 9}, {1, 1, 1, 0, 0}, {0, 2, 1, 7, 0}}));
  EXPECT_EQ(head["rung"], 1);
  EXPECT_EQ(head["rungs"][0], (Json{{"name", "fine"}, {"first", 0}, {"count", 2}}));
  EXPECT_EQ(head["rungs"][1]["name"], "coarse");
  EXPECT_EQ(head["rungs"][1]["accuracy"]["gap_max"], 0.875);
  EXPECT_EQ(head["accuracy"]["gap_max"], 0.75);
  EXPECT_EQ(head["diagonal"].get<double>(), std::sqrt(3.0));  // the mesh's
  const auto points = array<float>(html, "points");
  ASSERT_EQ(points.size(), 3 * view.mesh.points.size());
  EXPECT_NEAR(points[0] * head["scale"].get<double>() + head["center"][0].get<double>(),
              view.mesh.points[0].x(), 1e-6);
  EXPECT_EQ(array<std::uint32_t>(html, "triangles").size(), 3 * view.mesh.triangles.size());
  ASSERT_EQ(head["marks"].size(), 1u);
  EXPECT_EQ(head["marks"][0]["name"], name_of(MarkKind::slot));
  EXPECT_EQ(head["marks"][0]["area"], 4);
  EXPECT_EQ(head["marks"][0]["colour"], Json(palette().marks[std::size_t(MarkKind::slot)]));
  const auto corners = array<float>(html, "mark0");
  ASSERT_EQ(corners.size(), 18u);  // three corners of each of two triangles
  EXPECT_NEAR(corners[3] * head["scale"].get<double>() + head["center"][0].get<double>(), 2, 1e-5);
  EXPECT_EQ(array<std::uint32_t>(html, "pairs"), (std::vector<std::uint32_t>{0, 2}));
  const auto contacts = array<float>(html, "contacts");
  ASSERT_EQ(contacts.size(), 7u);
  EXPECT_EQ(contacts[5], 1);
  EXPECT_EQ(contacts[6], 0.125f);
}

TEST_F(Page, ATitleCannotEndAnElement) {
  view.title = "</script><script>alert(1)</script> & \"co\" <!--padder:data-->";
  view.note = "</SCRIPT>";
  const std::string html = page_html(view, options);
  EXPECT_EQ(Json::parse(element(html, "head"))["title"], view.title);
  EXPECT_EQ(html.find("alert(1)</script>"), std::string::npos);
  EXPECT_EQ(html.find("</SCRIPT>"), std::string::npos);
  EXPECT_TRUE(holds(html, "<title>&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;co"));
}

TEST_F(Page, EqualViewsGiveEqualBytes) { EXPECT_EQ(page_html(view, options), page_html(view, options)); }

TEST_F(Page, OneSphereAndSpheresInAPlane) {
  view.centers = {{1, 2, 3}}, view.radii = {0}, view.family = {0};
  const Json head = Json::parse(element(page_html(view, options), "head"));
  EXPECT_EQ(head["step"], (Json{0, 0, 0}));
  EXPECT_GT(head["scale"].get<double>(), 0);
}

TEST_F(Page, FaultsAreSentences) {
  options.up = 'q';
  EXPECT_THROW(page_html(view, options), Error);
  options.up = 'z';
  options.rung = 1;  // there is one level, number 0
  EXPECT_THROW(page_html(view, options), Error);
  options.rung = 0;
  put("script.html", "<p>no template</p>");
  EXPECT_THROW(page_html(view, options), Error);
  options.script = folder_ / "absent.html";
  EXPECT_THROW(page_html(view, options), Error);
  EXPECT_THROW(page_html(View{}, options), Error);
  EXPECT_THROW(write_preview(view, "part.jpg"), Error);
  EXPECT_FALSE(is_preview("part.html.gz"));
}

}  // namespace
}  // namespace padder
