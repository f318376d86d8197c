// SPDX-License-Identifier: MIT
#include "detect/core/bodies/assembly.h"

#include "detect/core/input.h"

namespace padder::detect {

void Assembly::update(const Input& input, const std::uint8_t* is_static) {
  pieces.update(input.shapes);
  elements.clear(), body_first.clear();
  std::vector<Element> static_elements;
  std::uint64_t first_sphere = 0;
  elements.reserve(input.bodies.size()), body_first.reserve(input.bodies.size() + 1);
  for (std::size_t b = 0; b < input.bodies.size(); b++) {
    const Body& body = input.bodies[b];
    body_first.push_back(static_cast<std::uint32_t>(first_sphere));
    first_sphere += input.shapes[body.shape].count;
    std::vector<Element>& to = body.is_static ? static_elements : elements;
    for (std::uint32_t p = pieces.shape_first[body.shape]; p < pieces.shape_first[body.shape + 1]; p++)
      to.push_back({static_cast<std::uint32_t>(b), p});
  }
  body_first.push_back(static_cast<std::uint32_t>(first_sphere));
  moving_pieces = static_cast<std::uint32_t>(elements.size());
  for (std::uint64_t k = 0; k < loose_count(input); k++)
    (is_static && is_static[k] ? static_elements : elements)
        .push_back({kLoose, static_cast<std::uint32_t>(k)});
  moving = static_cast<std::uint32_t>(elements.size());
  elements.insert(elements.end(), static_elements.begin(), static_elements.end());
}

}  // namespace padder::detect
