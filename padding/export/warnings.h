// SPDX-License-Identifier: MIT
// What a file states that its reader should not take at its word.
#pragma once
#include <string>
#include <vector>

#include "padding/export/export.h"

namespace padder {

// Does a file of this format carry mass, centre of mass or moments of inertia?
bool states_mass(const Format& format);

// One sentence for each body whose mass the file would state although it is that of a wrap around the mesh,
// which can be far from the body's. write_model returns these.
std::vector<std::string> mass_warnings(const Model& model, const Format& format);

}  // namespace padder
