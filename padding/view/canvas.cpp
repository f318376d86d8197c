// SPDX-License-Identifier: MIT
#include "padding/view/canvas.h"

#include <ft2build.h>
#include FT_FREETYPE_H

#include <algorithm>
#include <cmath>

#include "padding/asset/error.h"

// The font's file, as the build found it.
asm(".section .rodata\n"
    ".balign 16\n"
    ".local kPadderFont, kPadderFontEnd\n"
    "kPadderFont:\n"
    ".incbin \"" PADDER_FONT
    "\"\n"
    "kPadderFontEnd:\n"
    ".previous\n");
extern "C" const unsigned char kPadderFont[], kPadderFontEnd[];

namespace padder {

struct Canvas::Font {
  FT_Library library = nullptr;
  FT_Face face = nullptr;

  Font() {
    if (FT_Init_FreeType(&library) != 0 ||
        FT_New_Memory_Face(library, kPadderFont, FT_Long(kPadderFontEnd - kPadderFont), 0, &face) != 0)
      throw Error("FreeType cannot read the font of the legends: build padder again");
  }
  ~Font() { FT_Done_FreeType(library); }

  // Calls glyph(slot, x) for each letter at its pen position, and returns the width.
  template <class Glyph>
  float each(const std::string& text, float size, const Glyph& glyph) const {
    FT_Set_Char_Size(face, 0, FT_F26Dot6(std::lround(64 * size)), 72, 72);
    float x = 0;
    for (const char c : text) {
      // Without hinting a letter has the same shape at every size.
      const FT_ULong code = c >= ' ' && c < 127 ? FT_ULong(c) : '?';
      if (FT_Load_Char(face, code, FT_LOAD_RENDER | FT_LOAD_NO_HINTING) != 0) continue;
      glyph(*face->glyph, x);
      x += float(face->glyph->linearHoriAdvance) / 65536;
    }
    return x;
  }
};

Canvas::Canvas(Picture& picture) : picture_(picture), font_(std::make_unique<Font>()) {}
Canvas::~Canvas() = default;

void Canvas::blend(int x, int y, const Colour& colour, float opacity) {
  if (x < 0 || y < 0 || x >= picture_.width || y >= picture_.height) return;
  std::uint8_t* p = picture_.rgb.data() + 3 * (std::size_t(y) * picture_.width + x);
  for (int k = 0; k < 3; k++)
    p[k] = std::uint8_t(std::lround(p[k] + opacity * (float(colour[k]) - float(p[k]))));
}

void Canvas::fill(const std::vector<Place>& polygon, const Colour& colour, float opacity) {
  Place low = polygon[0], high = polygon[0];
  for (const Place& p : polygon) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const int x0 = std::max(0, int(low.x())), x1 = std::min(picture_.width - 1, int(high.x()));
  const int y0 = std::max(0, int(low.y())), y1 = std::min(picture_.height - 1, int(high.y()));
  const auto inside = [&](float x, float y) {
    bool in = false;
    for (std::size_t k = 0, n = polygon.size(); k < n; k++) {
      const Place &a = polygon[k], &b = polygon[(k + 1) % n];
      if ((a.y() > y) != (b.y() > y) && x < a.x() + (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y())) in = !in;
    }
    return in;
  };
  constexpr int n = 4;  // samples across a pixel
  for (int y = y0; y <= y1; y++)
    for (int x = x0; x <= x1; x++) {
      int hits = 0;
      for (int k = 0; k < n * n; k++)
        hits += inside(float(x) + (float(k % n) + 0.5f) / n, float(y) + (float(k / n) + 0.5f) / n);
      if (hits > 0) blend(x, y, colour, opacity * float(hits) / (n * n));
    }
}

void Canvas::box(float x, float y, float width, float height, const Colour& colour, float opacity) {
  fill({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}}, colour, opacity);
}

void Canvas::line(const Place& from, const Place& to, float width, const Colour& colour) {
  const Place along = (to - from).normalized(), side = Place(-along.y(), along.x()) * (width / 2);
  fill({from + side, to + side, to - side, from - side}, colour);
}

void Canvas::arrow(const Place& from, const Place& to, float width, const Colour& colour) {
  const float length = (to - from).norm();
  if (!(length > 0)) return;
  const Place along = (to - from) / length, side(-along.y(), along.x());
  const Place neck = to - along * std::min(4 * width, length);
  line(from, neck, width, colour);
  fill({to, neck + side * (2 * width), neck - side * (2 * width)}, colour);
}

void Canvas::text(const Place& left, float size, const std::string& text, const Colour& colour) {
  font_->each(text, size, [&](const FT_GlyphSlotRec_& glyph, float x) {
    const int x0 = int(std::lround(left.x() + x)) + glyph.bitmap_left,
              y0 = int(std::lround(left.y())) - glyph.bitmap_top;
    for (unsigned v = 0; v < glyph.bitmap.rows; v++)
      for (unsigned u = 0; u < glyph.bitmap.width; u++)
        blend(x0 + int(u), y0 + int(v), colour,
              float(glyph.bitmap.buffer[std::ptrdiff_t(v) * glyph.bitmap.pitch + u]) / 255);
  });
}

float Canvas::width_of(const std::string& text, float size) const {
  return font_->each(text, size, [](const FT_GlyphSlotRec_&, float) {});
}

}  // namespace padder
