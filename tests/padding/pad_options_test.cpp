// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/pad_options.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"

namespace padder {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(PadOptions, ALengthIsANumberOrAShareAndNothingElse) {
  EXPECT_EQ(length_of("0.25")->value, 0.25);
  EXPECT_FALSE(length_of("0.25")->share);
  EXPECT_EQ(length_of("1e-3")->value, 1e-3);
  for (const char* text : {"5%", "5 %", "5.0%", "0.5e1%"}) {
    const auto length = length_of(text);
    ASSERT_TRUE(length) << text;
    EXPECT_TRUE(length->share);
    EXPECT_EQ(length->value, 0.05);
  }
  for (const char* text : {"",     " ",     "%",      " %",  "5%%", "5 % ",  " 5",    "5 ",  "5\t%", "+5",
                           "-5",   "-5%",   "0",      "0%",  "-0",  "0x10",  "0x10%", "nan", "NaN%", "inf",
                           "inf%", "1e999", "1e-999", "5mm", "5,5", "1_000", "five",  "%5",  "5%5"})
    EXPECT_FALSE(length_of(text)) << '"' << text << '"';
}

PadOptions with(const std::function<void(PadOptions&)>& set) {
  PadOptions options;
  options.tolerance = {0.01, true};
  set(options);
  return options;
}

TEST(PadOptions, WhatMakesNoSenseIsRefused) {
  EXPECT_NO_THROW(check({}));
  EXPECT_NO_THROW(check(with([](PadOptions& o) { o.max_radius = {0.1, false}; })));
  const std::function<void(PadOptions&)> wrong[] = {
      [](PadOptions& o) {
        o.tolerance = {nan, true};
      },
      [](PadOptions& o) {
        o.tolerance = {infinity, false};
      },
      [](PadOptions& o) {
        o.tolerance = {-1, false};
      },
      [](PadOptions& o) {
        o.edge_length = {nan, false};
      },
      [](PadOptions& o) {
        o.reach = {infinity, true};
      },
      [](PadOptions& o) {
        o.min_radius = {-1, false};
      },
      [](PadOptions& o) {
        o.tolerance = {}, o.lod = {{nan, true}};
      },
      [](PadOptions& o) { o.depth = nan; },
      [](PadOptions& o) { o.depth = -0.1; },
      [](PadOptions& o) { o.smooth = nan; },
      [](PadOptions& o) { o.smooth = 200; },
      [](PadOptions& o) { o.sharp_angle = nan; },
      [](PadOptions& o) { o.sharp_angle = 0; },
      [](PadOptions& o) { o.effort = -1; },
      [](PadOptions& o) { o.effort = 4; },
      [](PadOptions& o) { o.max_spheres = 1ull << 32; },
      [](PadOptions& o) {
        o.tolerance = {}, o.max_radius = {0.1, false};
      },  // without effect
      [](PadOptions& o) {
        o.depth = 0.2, o.min_radius = {0.1, false};
      },
      [](PadOptions& o) { o.tolerance = {}, o.smooth = 5; },
  };
  for (std::size_t k = 0; k < std::size(wrong); k++) EXPECT_THROW(check(with(wrong[k])), Error) << k;
}

Box box(double x, double y, double z) {
  Box b;
  b.add({0, 0, 0}), b.add({x, y, z});
  return b;
}

TEST(PadOptions, WhatCannotBeMeantForThePartIsRefusedUnlessForced) {
  const Box cube = box(1, 1, 1), plate = box(1, 1, 1e-3);
  const auto refused = [](PadOptions options, const Box& b) {
    bool thrown = false;
    try {
      check_meant(options, b, "part.obj");
    } catch (const Error& e) {
      thrown = true;
      EXPECT_EQ(std::string(e.what()).rfind("part.obj: ", 0), 0u) << e.what();
    }
    options.force = true;
    EXPECT_NO_THROW(check_meant(options, b, "part.obj"));
    return thrown;
  };
  const auto tolerance = [](double value, bool share) {
    return with([&](PadOptions& o) { o.tolerance = {value, share}; });
  };
  EXPECT_FALSE(refused(tolerance(0.5, false), cube));
  EXPECT_TRUE(refused(tolerance(0.51, false), cube));
  EXPECT_TRUE(refused(tolerance(2, true), cube));
  EXPECT_TRUE(refused(tolerance(5, false), box(0.01, 0.004, 0.004)));  // 5 % without its sign
  EXPECT_FALSE(refused(tolerance(0.02, true), plate));  // thinner than the tolerance, and meant
  EXPECT_TRUE(refused(tolerance(0.11, true), plate));
  EXPECT_TRUE(refused(with([](PadOptions& o) {
                        o.tolerance = {}, o.lod = {{0.01, true}, {4, false}};
                      }),
                      cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.edge_length = {2, true}; }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.min_radius = {3, false}; }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) {
                        o.min_radius = {.2, false}, o.max_radius = {.1, false};
                      }),
                      cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.reach = {1e-5, true}; }), cube));
  EXPECT_TRUE(refused(with([](PadOptions& o) { o.reach = {0.6, true}; }), cube));
  EXPECT_FALSE(refused(with([](PadOptions& o) { o.reach = {0.05, true}; }), cube));
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
