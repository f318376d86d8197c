// SPDX-License-Identifier: MIT
// A scene as the search over balls sees it: elements, each a piece of a body or a loose sphere, the moving
// ones apart from the static ones. And the table in which the static ones wait to be met. Host code, used by
// both backends; internal.
#pragma once
#include "detect/core/backend.h"
#include "detect/core/pieces.h"
#include "detect/core/static_table.h"

namespace padder::detect {

struct Assembly {
  Pieces pieces;
  std::vector<Element> elements;  // moving ones, then static ones; each in the order of sphere numbers
  std::uint32_t moving = 0, moving_pieces = 0;  // elements; of them pieces of bodies, which come first
  std::vector<std::uint32_t>
      body_first;       // number of the first sphere of each body, and of the first loose one
  bool single = false;  // some element is a loose sphere

  // `is_static` of the loose spheres, in host memory or null.
  void update(const Input& input, const std::uint8_t* is_static);
};

// Is it worth it? `ball_cost`: of searching a ball, in spheres expanded and searched; `spheres`: of all.
bool bodies_first(const Input& input, const Options& options, std::uint64_t spheres, double ball_cost);

}  // namespace padder::detect
