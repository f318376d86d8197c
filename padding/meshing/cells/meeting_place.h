// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once
#include "padding/meshing/cells/contacts.h"

namespace padder {

// Where a meeting point that is no vertex lies, right to about `near`. Where the edge runs nearly along what
// it meets, the distances of its ends from that would be rounding alone: they are computed in rational
// numbers.
Point place_of(const MeetingPoint& meeting, const Mesh& soup, double near);

}  // namespace padder
