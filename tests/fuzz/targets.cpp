// SPDX-License-Identifier: MIT
#include "tests/fuzz/targets.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace padder::fuzz {

std::span<const Target> targets() {
  static const auto all = [] {
    std::vector<Target> list(readers().begin(), readers().end());
    list.push_back({"detector", detector, ""});
    list.push_back({"fit", fit_balls, ""});
    return list;
  }();
  return all;
}

const Target* find_target(std::string_view name) {
  const auto it = std::ranges::find(targets(), name, &Target::name);
  return it == targets().end() ? nullptr : &*it;
}

void wrong(const std::string& what) {
  std::fprintf(stderr, "wrong: %s\n", what.c_str());
  std::abort();
}

}  // namespace padder::fuzz
