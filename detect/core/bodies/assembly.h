// SPDX-License-Identifier: MIT
// A scene as the search over balls sees it: elements, each of them a piece of a body or a loose sphere, with
// the moving ones before the static ones. Host code that both backends use. Internal.
#pragma once
#include "detect/core/bodies/pieces.h"
#include "detect/detector.h"

namespace padder::detect {

struct Assembly {
  Pieces pieces;
  std::vector<Element> elements;    // moving ones, then static ones; each part in the order of sphere numbers
  std::uint32_t moving = 0;         // elements that move
  std::uint32_t moving_pieces = 0;  // those of them that are pieces of bodies; they come first
  // The number of the first sphere of each body, and of the first loose sphere.
  std::vector<std::uint32_t> body_first;

  // `is_static`: which loose spheres are static; in host memory, or null if none is.
  void update(const Input& input, const std::uint8_t* is_static);
};

}  // namespace padder::detect
