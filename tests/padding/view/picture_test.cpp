// SPDX-License-Identifier: MIT
#include "padding/view/picture.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>

#include "padding/asset/error.h"
#include "tests/padding/shapes.h"
#include "tests/padding/threads.h"

namespace padder {
namespace {

// Spheres of family 1, which the palette paints red.
View spheres(std::vector<Point> centers, std::vector<double> radii) {
  View v;
  v.title = "test";
  v.centers = std::move(centers), v.radii = std::move(radii);
  v.family.assign(v.size(), 1);
  return v;
}

PictureOptions small(Show show = Show::spheres) {
  PictureOptions o;
  o.width = 96, o.height = 64, o.samples = 8, o.show = show;
  return o;
}

bool is_red(const Colour& c) { return c[0] > c[1] + 50 && c[0] > c[2] + 50; }
bool is_background(const Colour& c) { return c == palette().background; }
bool is_grey(const Colour& c) { return std::abs(c[0] - c[2]) < 60 && !is_background(c) && !is_red(c); }

template <class Is>
std::int64_t count(const Picture& p, Is is) {
  std::int64_t n = 0;
  for (int y = 0; y < p.height; y++)
    for (int x = 0; x < p.width; x++) n += is(p.at(x, y));
  return n;
}

TEST(Picture, OneSphereFillsTheMiddleAndNoCorner) {
  const Picture p = render(spheres({{5, 6, 7}}, {2}), small());
  EXPECT_TRUE(is_red(p.at(48, 32)));
  for (const int x : {0, 95}) EXPECT_TRUE(is_background(p.at(x, 0))) << x;
  // The frame leaves a margin of 1.12 around the outline, a disc as high as the picture.
  const double expected = std::numbers::pi * std::pow(64 / 1.12 / 2, 2);
  EXPECT_NEAR(double(count(p, is_red)), expected, 0.04 * expected);
}

TEST(Picture, UnitAndPlaceDoNotMatter) {
  const Picture a = render(spheres({{0, 0, 0}, {1, 0, 0}}, {0.5, 0.75}), small());
  const Picture b = render(spheres({{1024, 0, 0}, {1024 + 256, 0, 0}}, {128, 192}), small());
  EXPECT_EQ(a.rgb, b.rgb);
}

TEST(Picture, SamePixelsTwiceAndForAnyThreads) {
  View v = spheres({}, {});
  for (int k = 0; k < 500; k++) {
    v.centers.emplace_back(std::sin(k * 1.7), std::cos(k * 2.3), std::sin(k * 0.9));
    v.radii.push_back(0.1 + 0.0001 * k), v.family.push_back(k % 5);
  }
  const Picture first = render(v, small());
  EXPECT_EQ(first.rgb, render(v, small()).rgb);
  EXPECT_EQ(first.rgb, with_threads(1, [&] { return render(v, small()); }).rgb);
  EXPECT_EQ(png_bytes(first), png_bytes(render(v, small())));
}

TEST(Picture, WhatLiesBehindTheMeshIsHidden) {
  View v = spheres({{0, 0, 0}}, {0.3});
  v.mesh = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  EXPECT_EQ(count(render(v, small(Show::both)), is_red), 0);
  EXPECT_GT(count(render(v, small(Show::spheres)), is_red), 300);
  v.radii[0] = 0.56;  // a cap through each face
  const auto caps = count(render(v, small(Show::both)), is_red);
  EXPECT_GT(caps, 40);
  EXPECT_LT(caps, count(render(v, small(Show::spheres)), is_red) / 2);
}

TEST(Picture, MarksHaveTheirColoursAlsoOnTheMesh) {
  View v = spheres({{0, 0, 0}}, {0.1});
  v.mesh = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const auto is_green = [](const Colour& c) { return c[1] > c[0] + 30 && c[1] > c[2] + 10; };
  EXPECT_EQ(count(render(v, small(Show::mesh)), is_green), 0);
  v.marks.push_back({MarkKind::patch, v.mesh});  // where the mesh is, too
  EXPECT_GT(count(render(v, small(Show::mesh)), is_green), 800);
  EXPECT_EQ(count(render(v, small(Show::spheres)), is_green), 0);
}

TEST(Picture, AnErrorIsDrawnOnTheMesh) {
  View v = spheres({{0, 0, 0}}, {0.6});  // stands out of the middle of each face, and leaves the corners bare
  v.mesh = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  v.protrusion = {0.1f};
  add_errors(v);
  PictureOptions o = small(Show::mesh);
  o.azimuth = -90, o.elevation = 0;  // the face at y = -0.5
  const auto yellow = [](const Colour& c) { return c[0] > c[2] + 60 && c[1] > c[2] + 40; };
  // Yellow pixels within 12 of the middle of the face, and farther out.
  const auto yellow_at = [&](ColourBy by) {
    o.colour = by;
    const Picture p = render(v, o);
    std::array<int, 2> n{};
    for (int y = 0; y < p.height; y++)
      for (int x = 0; x < p.width; x++) n[std::hypot(x - 48, y - 32) > 12] += yellow(p.at(x, y));
    return n;
  };
  const auto gap = yellow_at(ColourBy::gap), protrusion = yellow_at(ColourBy::protrusion);
  EXPECT_EQ(gap[0], 0);
  EXPECT_GT(gap[1], 8);
  EXPECT_GT(protrusion[0], 100);
  EXPECT_EQ(protrusion[1], 0);
}

TEST(Picture, TheLegendStandsBelowAndCanBeLeftOut) {
  View v = spheres({{0, 0, 0}}, {1});
  v.unit = "mm";
  PictureOptions o = small();
  o.width = 480, o.height = 320, o.samples = 1;
  const Picture with = render(v, o);
  o.plain = true;
  const Picture without = render(v, o);
  const auto dark = [](const Colour& c) { return c[0] < 110 && c[1] < 110 && c[2] < 120; };
  std::int64_t ink = 0, red = 0, red_before = 0;  // on the strip of the legend, beside the axes
  for (int y = 320 - 30; y < 320; y++)
    for (int x = 60; x < 480; x++) {
      ink += dark(with.at(x, y));
      red += is_red(with.at(x, y)), red_before += is_red(without.at(x, y));
    }
  EXPECT_GT(ink, 100);
  EXPECT_GT(red_before, 500);
  EXPECT_EQ(red, 0);  // the sphere stands above it
  o.dark = true;
  EXPECT_EQ(render(v, o).at(0, 0), palette().dark_background);
}

TEST(Picture, ContactsAreArrowsOverTheSpheres) {
  View v = spheres({{0, 0, 0}, {1.8, 0, 0}}, {1, 1});
  PictureOptions o = small();
  o.azimuth = -90, o.elevation = 0;
  const Picture without = render(v, o);
  v.contacts.push_back({0, 1, {0.9, 0, 0}, {1, 0, 0}, 0.2});
  const Picture with = render(v, o);
  const auto yellow = [](const Colour& c) { return c[0] > 200 && c[1] > 180 && c[2] < 120; };
  EXPECT_EQ(count(without, yellow), 0);
  EXPECT_GT(count(with, yellow), 15);
  EXPECT_TRUE(yellow(with.at(48, 32)));  // through the contact, which is the deepest
}

TEST(Picture, SideBySideShowsMeshLeftAndSpheresRight) {
  View v = spheres({{0, 0, 0}}, {0.5});
  v.mesh = shapes::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const Picture p = render(v, small(Show::side));
  std::int64_t red[2] = {0, 0}, grey[2] = {0, 0};
  for (int y = 0; y < p.height; y++)
    for (int x = 0; x < p.width; x++)
      red[x >= 48] += is_red(p.at(x, y)), grey[x >= 48] += is_grey(p.at(x, y)) && y < 40;
  EXPECT_EQ(red[0], 0);
  EXPECT_GT(red[1], 200);
  EXPECT_GT(grey[0], 200);
}

TEST(Picture, EdgesOfTheMeshAreDrawnOverTheSpheres) {
  View v = spheres({{0, 0, 0}}, {0.52});  // the corners of the box lie 0.0004 below the sphere's surface
  v.mesh = shapes::box({-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3});
  PictureOptions o = small(Show::spheres);
  o.width = o.height = 200;
  const Picture without = render(v, o);
  o.show = Show::wire;
  const Picture with = render(v, o);
  std::int64_t darker = 0, brighter = 0;
  for (std::size_t k = 0; k < with.rgb.size(); k++)
    darker += with.rgb[k] + 8 < without.rgb[k], brighter += with.rgb[k] > without.rgb[k];
  EXPECT_GT(darker, 20);
  EXPECT_EQ(brighter, 0);
  EXPECT_EQ(with.at(100, 100), without.at(100, 100));  // the edges far below stay hidden
}

TEST(Picture, TheUpAxisPointsUp) {
  for (const char up : {'x', 'y', 'z'}) {
    SCOPED_TRACE(up);
    const int axis = up - 'x';
    Point top = Point::Zero();
    top[axis] = 2;
    View v = spheres({Point::Zero(), top}, {0.9, 0.9});
    v.family = {2, 1};  // blue below red
    PictureOptions o = small();
    o.up = up, o.elevation = 0;
    const Picture p = render(v, o);
    EXPECT_TRUE(is_red(p.at(48, 18)));
    EXPECT_GT(p.at(48, 46)[2], p.at(48, 46)[0] + 50);
  }
}

TEST(Picture, LightFallsFromAboveOntoTheGround) {
  PictureOptions o = small();
  o.elevation = 20;
  const Picture p = render(spheres({{0, 0, 0}}, {1}), o);
  EXPECT_GT(p.at(48, 12)[0], p.at(48, 54)[0] + 40);  // top and bottom of the sphere
  const auto shadow =
      count(p, [](const Colour& c) { return !is_red(c) && c[0] < palette().background[0] - 25; });
  EXPECT_GT(shadow, 30);
}

TEST(Picture, PngHoldsThePixels) {
  const Picture p = render(spheres({{0, 0, 0}}, {1}), small());
  const std::string bytes = png_bytes(p);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()));
  ASSERT_EQ(int(image.width), p.width);
  ASSERT_EQ(int(image.height), p.height);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(image));
  ASSERT_TRUE(png_image_finish_read(&image, nullptr, rgb.data(), 0, nullptr));
  EXPECT_EQ(rgb, p.rgb);
}

TEST(Picture, FaultsAreSentences) {
  const View v = spheres({{0, 0, 0}}, {1});
  EXPECT_THROW(render(spheres({}, {}), small()), Error);
  for (const auto change :
       {+[](PictureOptions& o) { o.width = 8; }, +[](PictureOptions& o) { o.height = 20000; },
        +[](PictureOptions& o) { o.samples = 0; }, +[](PictureOptions& o) { o.up = 'w'; },
        +[](PictureOptions& o) { o.elevation = 90; }, +[](PictureOptions& o) { o.azimuth = NAN; },
        +[](PictureOptions& o) { o.colour = ColourBy::body; }}) {
    PictureOptions o = small();
    change(o);
    EXPECT_THROW(render(v, o), Error);
  }
  EXPECT_THROW(write_png(render(v, small()), "/nowhere/at/all.png"), Error);
}

TEST(Picture, APointAndAFlatViewAreDrawn) {
  EXPECT_EQ(render(spheres({{1, 1, 1}}, {0}), small()).rgb.size(), 3u * 96 * 64);  // a sphere without size
  EXPECT_GT(count(render(spheres({{0, 0, 0}, {1, 0, 0}}, {0.01, 0.01}), small()), is_red), 0);
}

}  // namespace
}  // namespace padder
