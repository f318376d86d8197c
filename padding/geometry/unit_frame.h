// SPDX-License-Identifier: MIT
// The frame that padding computes in: the part is centred and has a diagonal of 1. A part that is moved or
// scaled then gives the same spheres, moved or scaled, and one set of tolerances suits parts of every size.
#pragma once
#include <string>

#include "padding/asset/cluster.h"

namespace padder {

// The map between a part's own frame and its unit frame.
class UnitFrame {
 public:
  // Throws Error, with `name` in the sentence, for a box without extent or one so large or small that the
  // moments of inertia overflow or vanish.
  UnitFrame(const Box& box, const std::string& name);

  double scale() const { return scale_; }  // diagonal of the part, in its own unit

  // Coordinates are rounded to 2^-36 (1.5e-11): this removes what moving the part has done to its last
  // digits.
  Point into(const Point& p) const;
  // The part's own frame and unit again.
  Point back(const Point& p) const { return p * scale_ + center_; }
  // Where p stands once back(p) has been rounded to double, which matters far from the origin; p itself where
  // that moves it by less than into() does.
  Point written(const Point& p) const;
  // No point within the diagonal of the centre is moved farther by written().
  double coarseness() const;
  Accuracy back(Accuracy accuracy) const;
  MassProperties back(MassProperties mass) const;
  double back_volume(double volume) const;

 private:
  Point center_;
  double scale_;
};

}  // namespace padder
