// SPDX-License-Identifier: GPL-3.0-or-later
// Sorts a soup into pieces, and joins those that miss each other by a little.
#pragma once
#include "padding/geometry/repaired.h"
#include "padding/meshing/pieces.h"
#include "padding/meshing/repair.h"

namespace padder {

// find_pieces(), with edges split at corners that lie on them and with corners joined that lie close to each
// other, where fewer edges stay open then. This is what moves the surface; `steps` say how far. In mode
// `sheet` nothing is split or joined.
Pieces find_joined_pieces(const Mesh& input, const RepairOptions& options, double diagonal,
                          RepairSteps& steps);

}  // namespace padder
