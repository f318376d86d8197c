// SPDX-License-Identifier: MIT
// The targets under libFuzzer: PADDER_FUZZ_TARGET=obj fuzz_guided CORPUS
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/targets.h"

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer looks for this name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const padder::fuzz::Target* const target = [] {
    const char* name = std::getenv("PADDER_FUZZ_TARGET");
    const padder::fuzz::Target* found = name ? padder::fuzz::find_target(name) : nullptr;
    if (!found) {
      std::fputs("PADDER_FUZZ_TARGET must be one of:", stderr);
      for (const auto& t : padder::fuzz::targets()) std::fprintf(stderr, " %s", t.name);
      std::fputs("\n", stderr);
      std::exit(2);
    }
    return found;
  }();
  target->run({reinterpret_cast<const char*>(data), size});
  return 0;
}
