// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad_options.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/error_of.h"

namespace padder {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

PadOptions with(const std::function<void(PadOptions&)>& set) {
  PadOptions options;
  options.tolerance = Length::share(0.01);
  set(options);
  return options;
}

TEST(PadOptions, WhatMakesNoSenseIsRefused) {
  EXPECT_NO_THROW(check({}));
  EXPECT_NO_THROW(check(with([](PadOptions& o) { o.max_radius = Length::of(0.1); })));
  EXPECT_NO_THROW(check(with([](PadOptions& o) { o.depth_ratio = 0.2, o.sharp_angle = 10, o.effort = 3; })));
  const std::function<void(PadOptions&)> wrong[] = {
      [](PadOptions& o) { o.tolerance = Length::share(kNan); },
      [](PadOptions& o) { o.tolerance = Length::of(kInfinity); },
      [](PadOptions& o) { o.tolerance = Length::of(-1); },
      [](PadOptions& o) { o.edge_length = Length::of(kNan); },
      [](PadOptions& o) { o.min_grain_radius = Length::share(kInfinity); },
      [](PadOptions& o) { o.min_radius = Length::of(-1); },
      [](PadOptions& o) { o.tolerance = {}, o.lod = {Length::share(kNan)}; },
      [](PadOptions& o) { o.depth_ratio = kNan; },
      [](PadOptions& o) { o.depth_ratio = -0.1; },
      [](PadOptions& o) { o.smooth = kNan; },
      [](PadOptions& o) { o.smooth = 200; },
      [](PadOptions& o) { o.sharp_angle = kNan; },
      [](PadOptions& o) { o.sharp_angle = 0; },
      [](PadOptions& o) { o.effort = -1; },
      [](PadOptions& o) { o.effort = 4; },
      [](PadOptions& o) { o.max_spheres = 1ull << 32; },
      [](PadOptions& o) { o.tolerance = {}, o.max_radius = Length::of(0.1); },  // without effect
      [](PadOptions& o) { o.depth_ratio = 0.2, o.min_radius = Length::of(0.1); },
      [](PadOptions& o) { o.tolerance = {}, o.smooth = 5; },
      [](PadOptions& o) { o.sharp_angle = 10; },
      [](PadOptions& o) { o.gap = Length::of(-1); },
      [](PadOptions& o) { o.protrusion = Length::share(kNan); },
      [](PadOptions& o) { o.tolerance = {}, o.gap = Length::of(0); },         // no protrusion
      [](PadOptions& o) { o.tolerance = {}, o.protrusion = Length::of(1); },  // no gap
      [](PadOptions& o) { o.gap = o.protrusion = Length::of(0); },
      [](PadOptions& o) { o.gap = Length::of(0), o.max_spheres = 9; },
      [](PadOptions& o) { o.gap = Length::of(0), o.balance = Balance::mean; },
      [](PadOptions& o) { o.thickness = Length::of(1), o.repair = RepairMode::wrap; },  // without effect
      [](PadOptions& o) { o.thickness = Length::of(1), o.min_grain_radius = Length::of(1); },
      [](PadOptions& o) { o.tolerance = {}, o.lower_bound = true; },  // of a sphere for each triangle
  };
  for (std::size_t k = 0; k < std::size(wrong); k++) EXPECT_THROW(check(with(wrong[k])), Error) << k;
}

TEST(PadOptions, EachErrorReplacesItsSideOfTheTolerance) {
  const PadOptions conservative = with([](PadOptions& o) { o.gap = Length::of(0); });
  EXPECT_NO_THROW(check(conservative));
  EXPECT_EQ(conservative.gap_used().absolute(1), 0);
  EXPECT_EQ(conservative.protrusion_used().absolute(1), 0.01);
  const PadOptions both = with(
      [](PadOptions& o) { o.tolerance = {}, o.gap = Length::share(0.02), o.protrusion = Length::of(0); });
  EXPECT_NO_THROW(check(both));
  EXPECT_TRUE(both.by_tolerance() && !both.by_depth());
  const auto settings = nlohmann::json::parse(settings_json(both, 10, 0));
  EXPECT_EQ(settings["protrusion"], 0);
  EXPECT_NEAR(settings["gap"].get<double>(), 0.2, 1e-15);
  EXPECT_FALSE(settings.contains("tolerance"));
}

Box box(double x, double y, double z) {
  Box b;
  b.add({0, 0, 0}), b.add({x, y, z});
  return b;
}

TEST(PadOptions, WhatCannotBeMeantForThePartIsRefusedUnlessForced) {
  const Box cube = box(1, 1, 1), plate = box(1, 1, 1e-3);
  const auto refused = [](PadOptions options, const Box& b) {
    const std::string said = error_of([&] { check_meant(options, b, "part.obj"); });
    EXPECT_TRUE(said.empty() || said.starts_with("part.obj: ")) << said;
    options.force = true;
    EXPECT_NO_THROW(check_meant(options, b, "part.obj"));
    return !said.empty();
  };
  const auto tolerance = [](double value, bool share) {
    return with([&](PadOptions& o) { o.tolerance = share ? Length::share(value) : Length::of(value); });
  };
  EXPECT_FALSE(refused(tolerance(0.5, false), cube));
  EXPECT_TRUE(refused(tolerance(0.51, false), cube));
  EXPECT_TRUE(refused(tolerance(2, true), cube));
  EXPECT_TRUE(refused(tolerance(5, false), box(0.01, 0.004, 0.004)));  // 5 % without its sign
  EXPECT_FALSE(refused(tolerance(0.02, true), plate));  // thinner than the tolerance, and meant
  EXPECT_TRUE(refused(tolerance(0.11, true), plate));
  EXPECT_TRUE(refused(with([](PadOptions& o) {
                        o.tolerance = {}, o.lod = {Length::share(0.01), Length::of(4)};
                      }),
                      cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.edge_length = Length::share(2); }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.min_radius = Length::of(3); }), cube));
  EXPECT_TRUE(refused(
      with([](PadOptions& o) { o.min_radius = Length::of(.2), o.max_radius = Length::of(.1); }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.min_grain_radius = Length::share(1e-5); }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.min_grain_radius = Length::share(0.6); }), cube));
  EXPECT_FALSE(refused(with([](PadOptions& o) { o.min_grain_radius = Length::share(0.05); }), cube));
  EXPECT_FALSE(refused({}, cube));
}

TEST(PadOptions, SettingsHoldLengthsAsUsed) {
  const auto j = nlohmann::json::parse(settings_json(with([](PadOptions&) {}), 20, 0));
  EXPECT_EQ(j["tolerance"], 0.2);
  EXPECT_EQ(j["repair"], "auto");
  EXPECT_FALSE(j.contains("force"));
}

}  // namespace
}  // namespace padder
