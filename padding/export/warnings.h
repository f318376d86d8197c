// SPDX-License-Identifier: MIT
// What a file states that is not exact, and that its reader should know.
#pragma once
#include <string>
#include <vector>

#include "padding/export/export.h"

namespace padder {

// Does a file of this format carry mass, centre of mass or moments of inertia?
bool states_mass(const Format& format);

// One sentence for each body whose mass is that of a wrap around the mesh. Such a mass can be far from the
// mass of the body itself. write_model returns these sentences.
std::vector<std::string> mass_warnings(const Model& model, const Format& format);

}  // namespace padder
