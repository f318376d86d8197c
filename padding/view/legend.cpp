// SPDX-License-Identifier: MIT
#include "padding/view/legend.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "padding/asset/excerpt.h"
#include "padding/view/canvas.h"

namespace padder {
namespace {

using Place = Canvas::Place;

constexpr std::size_t kMostArrows = 20000, kMostKinds = 8;

float font_size(const PictureOptions& o) {
  return std::clamp(float(std::min(o.height, o.width * 2 / 3)) / 44, 11.f, 40.f);
}

std::string number(double value) { return short_number(value, 3); }

std::string with_unit(const View& view, double value) {
  return number(value) + (view.unit.empty() ? "" : " " + view.unit);
}

// The largest of 1, 2 and 5 times a power of ten that is not above `most`.
double round_length(double most) {
  const double power = std::pow(10, std::floor(std::log10(most)));
  for (const double step : {5., 2.})
    if (step * power <= most) return step * power;
  return power;
}

double deepest(const View& view) {
  double most = 0;
  for (const ViewContact& c : view.contacts) most = std::max(most, c.depth);
  return most;
}

// Draws entries from left to right on one strip.
class Legend {
 public:
  Legend(const View& view, const PictureOptions& o, const std::vector<Panel>& panels, Picture& picture)
      : view_(view),
        o_(o),
        panel_(panels[0]),
        height_(picture.height),
        canvas_(picture),
        size_(font_size(o)),
        ink_(o.dark ? palette().dark_ink : palette().ink),
        x_(1.2f * size_),
        line_(float(picture.height) - 1.1f * size_) {
    const float top = float(picture.height - legend_height(o));
    canvas_.box(0, top, float(picture.width), float(legend_height(o)),
                o.dark ? palette().dark_background : palette().background, 0.85f);
  }

  void axes() {
    const float length = 1.9f * size_;
    const Place at(x_ + length, line_ - 0.7f * size_);
    struct Axis {
      Eigen::Vector3f to;
      int number;
    };
    std::vector<Axis> axes;
    const Placement place(view_, o_.up);
    for (int k = 0; k < 3; k++) {
      const Eigen::Vector3f v = place.turned(Vector::Unit(k));
      axes.push_back(
          {{v.dot(panel_.camera.right), v.dot(panel_.camera.up), v.dot(panel_.camera.forward)}, k});
    }
    std::sort(axes.begin(), axes.end(), [](const Axis& a, const Axis& b) { return a.to.z() > b.to.z(); });
    constexpr Colour colours[] = {{208, 64, 56}, {64, 152, 80}, {48, 112, 192}};
    for (const Axis& axis : axes) {
      const Place to = at + length * Place(axis.to.x(), -axis.to.y());
      canvas_.arrow(at, to, std::max(1.5f, 0.12f * size_), colours[axis.number]);
      const std::string name(1, char('x' + axis.number));
      const Place beyond = to + 0.55f * size_ * Place(axis.to.x(), -axis.to.y());
      canvas_.text(beyond + Place(-canvas_.width_of(name, size_) / 2, 0.3f * size_), size_, name,
                   colours[axis.number]);
    }
    x_ += 2 * length + 2 * size_;
  }

  void scale_bar() {
    const float distance = -panel_.camera.eye.dot(panel_.camera.forward);
    const double pixels =
        float(height_) / (2 * panel_.camera.tan_y * distance) / Placement(view_, o_.up).scale;
    const double length = round_length(0.22 * panel_.width / pixels);
    const auto width = float(length * pixels);
    const float thick = std::max(1.5f, 0.1f * size_);
    canvas_.line({x_, line_}, {x_ + width, line_}, thick, ink_);
    for (const float end : {x_, x_ + width})
      canvas_.line({end, line_ - 0.35f * size_}, {end, line_ + 0.35f * size_}, thick, ink_);
    canvas_.text({x_, line_ - 0.6f * size_}, size_, with_unit(view_, length), ink_);
    x_ += std::max(width, canvas_.width_of(with_unit(view_, length), size_)) + 2.5f * size_;
  }

  // A ramp with its lengths below, and what they are above.
  void ramp(const std::string& title, const ColourRange& range, bool arrow = false) {
    x_ = std::round(x_);  // whole pixels: each column has one colour
    const float width = std::round(11 * size_), height = 0.55f * size_, top = line_ - 0.75f * size_ - height;
    for (float x = 0; x < width; x++) canvas_.box(x_ + x, top, 1, height, along_ramp(x / (width - 1)));
    canvas_.text({x_, top - 0.35f * size_}, size_, title, ink_);
    if (arrow) {
      const float from = x_ + canvas_.width_of(title, size_) + 0.6f * size_, y = top - 0.65f * size_;
      canvas_.arrow({from, y}, {from + 2.2f * size_, y}, std::max(1.5f, 0.14f * size_), along_ramp(0.75));
    }
    const double diagonal = view_.has_mesh() ? view_.mesh.bounds().diagonal() : 0;
    std::string high = with_unit(view_, range.high);
    if (!arrow && diagonal > 0) high += " (" + number(100 * range.high / diagonal) + " %)";
    canvas_.text({x_, line_ + 0.35f * size_}, size_, number(range.low), ink_);
    canvas_.text({x_ + width - canvas_.width_of(with_unit(view_, range.high), size_), line_ + 0.35f * size_},
                 size_, high, ink_);
    x_ += width + 2.5f * size_ + canvas_.width_of(high, size_) -
          canvas_.width_of(with_unit(view_, range.high), size_);
  }

  // Swatches of families or bodies, two under each other, the most frequent first in their order.
  void kinds() {
    std::map<std::uint64_t, std::size_t> count;
    const bool by_body = o_.colour == ColourBy::body;
    for (std::size_t k = 0; k < view_.size(); k++)
      count[by_body ? (view_.body[k] < view_.bodies.size() ? view_.body[k] + 1 : 0) : view_.family[k]]++;
    if (count.size() < 2) return;
    std::size_t row = 0;
    float widest = 0;
    std::size_t drawn = 0;
    for (const auto& [kind, spheres] : count) {
      if (drawn++ == kMostKinds) break;
      const std::string name = drawn == kMostKinds && count.size() > kMostKinds
                                   ? "and " + std::to_string(count.size() - kMostKinds + 1) + " more"
                               : by_body ? (kind ? "body " + std::to_string(kind - 1) : "loose")
                               : kind    ? "family " + std::to_string(kind)
                                         : "no family";
      const float y = line_ - 1.3f * size_ * float(1 - row) + 0.2f * size_;
      if (drawn < kMostKinds || count.size() <= kMostKinds)
        canvas_.box(x_, y - 0.75f * size_, 0.8f * size_, 0.8f * size_, colour_of_kind(kind));
      canvas_.text({x_ + 1.2f * size_, y}, size_, name, ink_);
      widest = std::max(widest, 1.2f * size_ + canvas_.width_of(name, size_));
      row = 1 - row;
      if (row == 0) x_ += widest + 1.5f * size_, widest = 0;
    }
    x_ += row == 1 ? widest + 1.5f * size_ : 0;
  }

 private:
  const View& view_;
  const PictureOptions& o_;
  const Panel& panel_;
  int height_;
  Canvas canvas_;
  float size_;
  Colour ink_;
  float x_, line_;  // where the next entry begins, and the strip's line
};

std::string title_of(ColourBy by, bool mesh) {
  switch (by) {
    case ColourBy::radius:
      return "radius";
    case ColourBy::gap:
      return mesh ? "gap: mesh outside the spheres" : "largest gap beside the sphere";
    default:
      return mesh ? "protrusion: spheres outside the mesh" : "protrusion of the sphere, at most";
  }
}

}  // namespace

int legend_height(const PictureOptions& o) {
  return o.plain || o.width < 320 || o.height < 200 ? 0 : int(4.6f * font_size(o));
}

void draw_contacts(const View& view, const PictureOptions& o, const std::vector<Panel>& panels,
                   Picture& picture) {
  if (view.contacts.empty()) return;
  Canvas canvas(picture);
  const Placement place(view, o.up);
  const std::size_t total = view.contacts.size(), drawn = std::min(total, kMostArrows);
  const double least = std::min(0.03, 0.6 / std::sqrt(double(total))), most = deepest(view);
  for (const Panel& panel : panels) {
    if (!panel.spheres) continue;
    const auto pixel = [&](const Point& p) -> Place {
      return panel.camera.project(place(p), float(panel.width), float(o.height)) +
             Place(float(panel.left), 0);
    };
    for (std::size_t k = 0; k < drawn; k++) {
      const ViewContact& c = view.contacts[k * total / drawn];
      const double smaller = std::min(view.radii[c.i], view.radii[c.j]);
      const Vector half = 0.5 * std::max({c.depth, smaller, least * place.scale}) * c.normal;
      const Place from = pixel(c.at - half), to = pixel(c.at + half);
      canvas.arrow(from, to, std::clamp((to - from).norm() / 10, 1.f, 6.f),
                   along_ramp(most > 0 ? c.depth / most : 0));
    }
  }
}

void draw_legend(const View& view, const PictureOptions& o, const std::vector<Panel>& panels,
                 Picture& picture) {
  if (legend_height(o) == 0) return;
  Legend legend(view, o, panels, picture);
  legend.axes();
  legend.scale_bar();
  if (const auto range = range_of(view, o.colour))
    legend.ramp(title_of(o.colour, o.show != Show::spheres && !view.errors.gap.empty()), *range);
  else if (o.colour != ColourBy::triangle)
    legend.kinds();
  if (!view.contacts.empty()) legend.ramp("contacts, depth", {0, deepest(view)}, true);
}

}  // namespace padder
