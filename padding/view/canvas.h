// SPDX-License-Identifier: MIT
// Lines, shapes and text on a picture, with smooth edges. Text is DejaVu Sans, which lies in the library, so
// that a picture looks alike everywhere.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "padding/view/picture.h"

namespace padder {

// Coordinates are pixels, x to the right and y down.
class Canvas {
 public:
  using Place = Eigen::Vector2f;

  explicit Canvas(Picture& picture);
  ~Canvas();

  // Even-odd filling of one polygon. What lies outside the picture is left out.
  void fill(const std::vector<Place>& polygon, const Colour& colour, float opacity = 1);
  void box(float x, float y, float width, float height, const Colour& colour, float opacity = 1);
  void line(const Place& from, const Place& to, float width, const Colour& colour);
  // A line with a head as wide as four lines.
  void arrow(const Place& from, const Place& to, float width, const Colour& colour);

  // Text on a line through `left`, its letters `size` pixels high from line to line. Only ASCII: any other
  // byte is drawn as a question mark.
  void text(const Place& left, float size, const std::string& text, const Colour& colour);
  float width_of(const std::string& text, float size) const;

 private:
  struct Font;
  void blend(int x, int y, const Colour& colour, float opacity);

  Picture& picture_;
  std::unique_ptr<Font> font_;
};

}  // namespace padder
