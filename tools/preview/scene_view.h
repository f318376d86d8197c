// SPDX-License-Identifier: GPL-3.0-or-later
// What preview shows of a scene: its bodies where they are, and the contacts that detect has found.
#pragma once
#include <filesystem>

#include "detect/scene/scene.h"
#include "padding/view/view.h"

namespace padder {

// The spheres in the order in which the detector numbers them: body after body, then the loose ones. Throws
// Error for more than 2^25 spheres, which no page or picture could show.
View view_of(const detect::Scene& scene, const std::string& title);

// Reads a file that `detect -o` wrote, .csv or .npz, into view.contacts. Throws Error that names the line or
// the array that is wrong. Also throws if a contact names a sphere that the view does not have: the file
// belongs to another scene then.
void add_contacts(View& view, const std::filesystem::path& path);

}  // namespace padder
