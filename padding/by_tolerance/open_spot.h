// SPDX-License-Identifier: MIT
// A spot of the surface that a cover leaves open, and why.
#pragma once
#include "padding/asset/mesh.h"

namespace padder {

// Why a spot is open.
enum class WhyOpen {
  nothing,     // all is covered
  min_radius,  // no ball as large as min_radius was found that covers it
  no_inside,   // no ball inside the body was found that covers it, and with a protrusion of 0 no other may
  unfinished   // the search came to its last round
};

// Of several, the worst.
struct OpenSpot {
  WhyOpen why = WhyOpen::nothing;
  Point at = Point::Zero();  // of the surface
};

}  // namespace padder
