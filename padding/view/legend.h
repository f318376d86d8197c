// SPDX-License-Identifier: MIT
// What a picture says in words and signs: colours with their lengths, a scale bar, the axes, contacts as
// arrows.
#pragma once
#include <vector>

#include "padding/view/camera.h"
#include "padding/view/picture.h"

namespace padder {

// A part of a picture with a camera of its own, `left` pixels from the picture's left side.
struct Panel {
  int left = 0, width = 0;
  Camera camera;
  bool spheres = true;  // and not the mesh alone
};

// The height of the strip at the bottom of a picture that its legend takes, in pixels. 0 when there is none:
// it is not wanted, or the picture is too small to read one.
int legend_height(const PictureOptions& options);

// Draws the contacts over each panel with spheres. An arrow from i to j, as long as the depth, the smaller
// radius or a few hundredths of the view, whichever is most; of more than 20,000 an even sample.
void draw_contacts(const View& view, const PictureOptions& options, const std::vector<Panel>& panels,
                   Picture& picture);

// Draws the legend. The scale bar is right at the distance of the middle of what is shown.
void draw_legend(const View& view, const PictureOptions& options, const std::vector<Panel>& panels,
                 Picture& picture);

}  // namespace padder
