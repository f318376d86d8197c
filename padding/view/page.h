// SPDX-License-Identifier: MIT
// Writes a view as one HTML file with everything inside, three.js and the data: it needs no network.
// docs/preview.md says what the page can do.
#pragma once
#include <filesystem>
#include <string>

#include "padding/view/view.h"

namespace padder {

// How a page opens.
struct PageOptions {
  double azimuth = -60, elevation = 30;  // degrees: from where the camera looks at the middle
  char up = 'z';                         // 'x', 'y' or 'z': the axis that points up
  std::size_t rung = 0;                  // the level of detail
  ColourBy colour = ColourBy::family;
  std::filesystem::path script;  // the template; empty: page_script()
};

// The page without data. It is share/padder/page.html beside the running program's folder when installed, and
// page/page.html in the build tree. The target `page` builds it with packages of npm. Throws Error, which
// says how to build it, when it is not there.
std::filesystem::path page_script();

// The whole page. Positions are kept to 2^-22 of their box, radii, protrusions and contacts in single
// precision: 12 bytes a sphere, and 4 more for each of protrusion, gap, triangle, family and body where a
// view has them; 12 bytes a point and a triangle of the mesh and of its error map; a third more as base64.
// Equal views give equal bytes. Throws Error for an empty view, more than 2^25 spheres, a rung or colours
// that are not there, or a template that is not one.
std::string page_html(const View& view, const PageOptions& options = {});

void write_page(const View& view, const std::filesystem::path& path,
                const PageOptions& options = {});  // whole or not at all

// A page or a picture, by the ending of the path: .html or .png. All options but the colours have their
// defaults. Throws Error.
bool is_preview(const std::filesystem::path& path);  // has it one of the two?
void write_preview(const View& view, const std::filesystem::path& path, ColourBy colour = ColourBy::family);

}  // namespace padder
