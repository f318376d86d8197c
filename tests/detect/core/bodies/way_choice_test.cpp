// SPDX-License-Identifier: MIT
// Calls go the way that is faster by the clock.
#include "detect/core/bodies/way_choice.h"

#include <gtest/gtest.h>

namespace padder::detect {
namespace {

// A scene whose calls take so long, bodies first and expanded.
struct Scene {
  double first, expanded;
  bool worth_trying = true;
};
struct Calls {
  int first = 0, expanded = 0;
};
Calls calls(WayChoice& way, const Scene& scene, int count) {
  Calls made;
  for (int k = 0; k < count; k++) {
    const bool first = way.first();
    ++(first ? made.first : made.expanded);
    const double seconds = first ? scene.first : scene.expanded;
    way.took(way.times() ? seconds : 1e-9, scene.worth_trying);
  }
  return made;
}

TEST(WayChoice, TheFasterWayWinsWhateverWasForetold) {
  for (const bool foretold : {false, true})
    for (const bool first_is_faster : {false, true}) {
      WayChoice way(foretold);
      const Scene scene = first_is_faster ? Scene{1, 1.2} : Scene{1.2, 1};
      EXPECT_EQ(calls(way, scene, 200).first, foretold ? 200 : 0);  // who calls a few times sees no try
      calls(way, scene, 20);
      EXPECT_EQ(calls(way, scene, 150).first, first_is_faster ? 150 : 0) << "foretold " << foretold;
    }
}

TEST(WayChoice, AWayThatIsNotWorthTryingIsNotTried) {
  WayChoice way(true);
  EXPECT_EQ(calls(way, {1, 0.5, false}, 5000).expanded, 0);
  EXPECT_FALSE(way.by_clock());
}

TEST(WayChoice, FollowsASceneThatChanges) {
  WayChoice way(true);
  calls(way, {1, 2}, 500);
  EXPECT_TRUE(way.first() && way.by_clock());
  calls(way, {2, 1}, 1000);
  EXPECT_FALSE(way.first());
  calls(way, {1, 2}, 1000);
  EXPECT_TRUE(way.first());
}

// What looking costs is little, however slow the other way is.
TEST(WayChoice, SlowTriesAreShortAndRare) {
  WayChoice way(true);
  EXPECT_EQ(calls(way, {1, 9}, 250).expanded, 5);
  EXPECT_LT(calls(way, {1, 9}, 100'000).expanded, 100);
}

// Too many balls touch, so the call is made by the other way. It is tried later whether that was right.
TEST(WayChoice, GivesUp) {
  WayChoice way(true);
  way.gave_up();
  EXPECT_FALSE(way.first() || way.by_clock());
  calls(way, {0.5, 1}, 208);
  EXPECT_TRUE(way.trying() && way.first() && way.by_clock());
  way.gave_up();
  EXPECT_FALSE(way.trying() || way.first() || way.by_clock());
  EXPECT_EQ(calls(way, {0.5, 1}, 400).first, 0);
}

}  // namespace
}  // namespace padder::detect
