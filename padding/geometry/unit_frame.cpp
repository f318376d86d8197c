// SPDX-License-Identifier: MIT
#include "padding/geometry/unit_frame.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "padding/asset/error.h"

namespace padder {
namespace {

constexpr double kGrid = 0x1p36;

}  // namespace

UnitFrame::UnitFrame(const Box& box, const std::string& name)
    : center_(box.center()), scale_(box.diagonal()) {
  if (box.empty() || box.low == box.high)
    throw Error(name + ": all its points are one, so there is no surface to pad");
  // Moments of inertia grow with the fifth power of the length.
  if (!(scale_ < 1e60 && scale_ > 1e-60) || !center_.allFinite())
    throw Error(name + ": its size is beyond what double precision can measure: scale it (--scale) to " +
                (scale_ < 1 ? "above 1e-60" : "below 1e60"));
}

Point UnitFrame::into(const Point& p) const {
  return ((p - center_) / scale_ * kGrid).array().round().matrix() / kGrid;
}

Point UnitFrame::written(const Point& p) const {
  const Point there = (back(p) - center_) / scale_;
  return (there - p).norm() * kGrid < 1 ? p : there;
}

double UnitFrame::coarseness() const {
  const double largest = center_.cwiseAbs().maxCoeff() + scale_;
  const double moved = std::numbers::sqrt3 * std::numeric_limits<double>::epsilon() * largest / scale_;
  return moved * kGrid < 1 ? 0 : moved;
}

Accuracy UnitFrame::back(Accuracy a) const {
  a.scale(scale_);
  return a;
}

MassProperties UnitFrame::back(MassProperties m) const {
  m.volume *= std::pow(scale_, 3);
  m.center = back(m.center);
  m.inertia *= std::pow(scale_, 5);
  m.moments *= std::pow(scale_, 5);
  return m;
}

double UnitFrame::back_volume(double volume) const { return volume * std::pow(scale_, 3); }

}  // namespace padder
