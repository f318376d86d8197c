// SPDX-License-Identifier: GPL-3.0-or-later
// What preview shows of a scene: its bodies placed, and the contacts that detect found in it.
#pragma once
#include <filesystem>

#include "detect/scene/scene.h"
#include "padding/view/view.h"

namespace padder {

// Spheres numbered through as the detector does: body after body, then the loose ones. Throws Error beyond
// 2^27 spheres, which no page or picture could hold.
View view_of(const detect::Scene& scene, const std::string& title);

// Reads what `detect -o` wrote, .csv or .npz, into view.contacts. Throws Error that names the line or array
// at fault, and for a number of a sphere that the view does not have: the file then belongs to another scene.
void add_contacts(View& view, const std::filesystem::path& path);

}  // namespace padder
