// SPDX-License-Identifier: MIT
// Makes a picture of a view by ray tracing with Embree: it needs neither a display nor a GPU. A bright sky
// and one broad lamp light the view, on a ground that fades into the background. A strip at the bottom has
// the axes, a scale bar and what the colours mean; a picture of less than 320 x 200 pixels has none. With the
// colours of an error, the mesh is coloured point by point, and each sphere by its largest. Contacts are
// arrows.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "padding/view/view.h"

namespace padder {

// What of a view a picture shows.
enum class Show : std::uint8_t {
  mesh,
  spheres,
  wire,  // spheres, with the edges of the mesh drawn over them
  both,  // mesh and spheres as they lie in space: what is seen of the spheres stands out of the mesh
  side,  // mesh on the left, spheres on the right, from the same direction
};

// What is drawn, from where and how finely.
struct PictureOptions {
  int width = 1600, height = 800;  // pixels, 16 to 16384
  Show show = Show::side;          // a view without mesh shows its spheres, whatever is said here
  ColourBy colour = ColourBy::family;
  double azimuth = -60, elevation = 30;  // degrees: from where the camera looks at the middle
  char up = 'z';                         // 'x', 'y' or 'z': the axis that points up
  int samples = 32;                      // rays a pixel; noise falls with its square root
  std::size_t rung = 0;                  // the level of detail that is drawn: 0 the finest
  bool dark = false;                     // a dark background
  bool plain = false;                    // without legend, scale bar and axes
};

// Pixels row by row from the top left, 3 bytes each: red, green, blue, sRGB.
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;

  Colour at(int x, int y) const {
    const std::uint8_t* p = rgb.data() + 3 * (y * std::ptrdiff_t(width) + x);
    return {p[0], p[1], p[2]};
  }
};

// Gives the same pixels every time and for any number of threads, on one kind of processor. Takes about 7 s
// for each million pixels with 32 samples on 2 cores. Throws Error for options out of range, for a view with
// nothing in it, and for colours that the view lacks.
Picture render(const View& view, const PictureOptions& options = {});

std::string png_bytes(const Picture& picture);  // by libpng; equal pictures give equal bytes
void write_png(const Picture& picture,
               const std::filesystem::path& path);  // whole or not at all; throws Error

}  // namespace padder
