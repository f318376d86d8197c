// SPDX-License-Identifier: MIT
// Where a picture puts what it draws: from the frame of a view to pixels.
#pragma once
#include <Eigen/Core>

#include "padding/view/view.h"

namespace padder {

// From the view's frame to that of the tracer: the middle of the box at 0, its diagonal 1, z up.
struct Placement {
  Point middle = Point::Zero();
  double scale = 1;  // the view's lengths that are one of the tracer's
  char up = 'z';

  Placement() = default;
  Placement(const View& view, char axis) : up(axis) {
    const Box box = view.bounds();
    if (box.diagonal() > 0) scale = box.diagonal();
    middle = box.center();
  }
  Eigen::Vector3f turned(const Vector& v) const {
    const Eigen::Vector3f q = v.cast<float>();
    if (up == 'y') return {q.z(), q.x(), q.y()};
    if (up == 'x') return {q.y(), q.z(), q.x()};
    return q;
  }
  Eigen::Vector3f operator()(const Point& p) const { return turned((p - middle) / scale); }
};

// A camera that looks at the middle from so far away that everything is in the picture.
struct Camera {
  Eigen::Vector3f eye, right, up, forward;
  float tan_x = 0, tan_y = 0;  // of half the angles of view

  Eigen::Vector3f toward(float x, float y) const {  // x, y in -1 to 1, y upward
    return (forward + right * (x * tan_x) + up * (y * tan_y)).normalized();
  }
  Eigen::Vector2f project(const Eigen::Vector3f& p, float width, float height) const {  // to pixels
    const Eigen::Vector3f q = p - eye;
    const float z = q.dot(forward);
    return {(q.dot(right) / (z * tan_x) + 1) * width / 2, (1 - q.dot(up) / (z * tan_y)) * height / 2};
  }
};

}  // namespace padder
