// SPDX-License-Identifier: GPL-3.0-or-later
// Turns pieces that border on each other across cracks, so that they face alike.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// The open triangles listed hang together by edges, in pieces. Where edges at the border of two pieces run
// beside each other, at most `width` apart, as along a crack or a T-junction, they must run in opposite
// directions. Turns pieces so that most of the length that runs so does. A piece that lies on another one, as
// a copy does, tells nothing of how that faces. Returns the number of triangles that were turned.
std::size_t face_alike(Mesh& mesh, const std::vector<std::uint32_t>& open, double width);

}  // namespace padder
