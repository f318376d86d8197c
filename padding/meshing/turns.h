// SPDX-License-Identifier: GPL-3.0-or-later
// Finds which triangles, or pieces of them, must be turned so that all that are joined face alike.
#pragma once
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "padding/geometry/indices.h"

namespace padder {

// A forest of joined things (union-find) in which each knows whether it faces against its root.
class Turns {
 public:
  explicit Turns(std::size_t count) : parent_(numbered(count)), turned_(count, 0) {}
  // The root of k, and whether k is turned against it.
  std::pair<std::uint32_t, bool> root(std::uint32_t k) {
    bool turned = false;
    while (parent_[k] != k) {  // shortens the way for later calls, as root_of does
      const std::uint32_t above = parent_[k];
      turned_[k] = turned_[k] != turned_[above];
      turned = turned != static_cast<bool>(turned_[k]);
      k = parent_[k] = parent_[above];
    }
    return {k, turned};
  }
  // Says how the two face each other, unless they are joined already.
  void join(std::uint32_t a, std::uint32_t b, bool alike) {
    const auto [root_a, turned_a] = root(a);
    const auto [root_b, turned_b] = root(b);
    if (root_a == root_b) return;
    const std::uint32_t low = std::min(root_a, root_b);
    parent_[std::max(root_a, root_b)] = low;
    turned_[std::max(root_a, root_b)] = (turned_a != turned_b) == alike;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<char> turned_;  // against the parent; 0 for a root
};

}  // namespace padder
