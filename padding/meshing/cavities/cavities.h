// SPDX-License-Identifier: GPL-3.0-or-later
// Tells which closed pieces of a surface bound cavities, and which only repeat another one.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/meshing/cells/contacts.h"
#include "padding/meshing/cells/outer_cells.h"

namespace padder {

// What each triangle of a surface is: its role, and the unit that it belongs to. A unit is a closed piece
// that faces outward, or what bounds nothing.
struct Units {
  std::vector<TriangleRole> roles;
  std::vector<std::uint32_t> unit_of;
  std::size_t count = 0;
  std::vector<char> inward;  // of the closed units, which are the first: it faced inward in the file
};

struct Cavities {
  std::vector<char> cavity, copy;  // of each unit
};

// A closed unit that meets no other one and lies inside others an odd number of times is a cavity, unless it
// repeats one that faces as it does. So is one that meets others and was cut out of them. `contacts` are
// those of the surface; `diagonal` is that of the input.
Cavities find_cavities(const Surface& surface, const Units& units, const Contacts& contacts, double diagonal);

}  // namespace padder
