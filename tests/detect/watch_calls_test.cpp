// SPDX-License-Identifier: MIT
// The limit that the tests of the detector put on each of its calls.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/detect/oracle.h"
#include "tools/watchdog.h"

namespace padder::detect {
namespace {

// The nine stages on one thread take longer than the watchdog needs to look; the limit is set to nothing.
TEST(WatchCallsDeathTest, ACallThatTakesTooLongEndsTheTest) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  ::setenv("PADDER_WATCHDOG", "1e-6", 1);
  const auto call = [] {
    const auto spheres = generate("dense", 1000000);
    CallOptions o;
    o.path = Path::nine_stages, o.threads = 1;
    Detector({BackendKind::omp}, o).detect(input_of(spheres));
  };
  EXPECT_EXIT(call(), testing::ExitedWithCode(Watchdog::kEnded), "^detect: no answer after .* s, ended\n$");
}

}  // namespace
}  // namespace padder::detect
