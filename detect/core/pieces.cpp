// SPDX-License-Identifier: MIT
#include "detect/core/pieces.h"

#include <algorithm>
#include <cstring>
#include <numeric>

namespace padder::detect {
namespace {

double distance(const Sphere& a, const Sphere& b) { return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z); }

// The radius that a ball around `center` needs to hold all spheres, and the sphere that needs it.
double needed(std::span<const Sphere> spheres, const Sphere& center, std::size_t& farthest) {
  double most = 0;
  for (std::size_t k = 0; k < spheres.size(); k++) {
    const double r = distance(spheres[k], center) + spheres[k].r;
    if (r >= most) most = r, farthest = k;
  }
  return most;
}

// Nearly the smallest ball around the spheres (Badoiu and Clarkson, Smaller core-sets for balls, 2003). The
// centre starts in the middle of the bounding box and moves towards the sphere that stands out farthest, in
// steps that shrink by a fixed factor. The best centre of all is kept.
Sphere enclosing_ball(std::span<const Sphere> spheres) {
  for (const Sphere& s : spheres)
    if (fault_of(s) != Fault::none) return {NAN, NAN, NAN, NAN};
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (const Sphere& s : spheres) {
    const double c[3] = {s.x, s.y, s.z};
    for (int k = 0; k < 3; k++)
      low[k] = std::min(low[k], c[k] - s.r), high[k] = std::max(high[k], c[k] + s.r);
  }
  Sphere c{low[0] / 2 + high[0] / 2, low[1] / 2 + high[1] / 2, low[2] / 2 + high[2] / 2, 0};
  if (spheres.size() == 1) c = spheres[0];
  Sphere best = c;
  std::size_t far = 0;
  best.r = c.r = needed(spheres, c, far);
  double step = c.r / 8;
  for (int k = 0; k < 150; k++, step *= 0.95) {
    const double d = distance(spheres[far], c), t = d > 0 ? step / d : 0;
    if (t == 0) break;
    const Sphere& s = spheres[far];
    c.x += (s.x - c.x) * t, c.y += (s.y - c.y) * t, c.z += (s.z - c.z) * t;
    c.r = needed(spheres, c, far);
    if (c.r < best.r) best = c;
  }
  // hypot and the sums are off by some 2^-52 of the distance and of the coordinates. These margins cover
  // that.
  best.r = best.r * (1 + 0x1p-45) + 0x1p-48 * (std::abs(best.x) + std::abs(best.y) + std::abs(best.z)) +
           kBallLeast;
  return best;
}

}  // namespace

bool Pieces::update(std::span<const Shape> shapes) {
  bool same = counts_.size() == shapes.size();
  std::uint64_t at = 0;
  for (std::size_t k = 0; same && k < shapes.size(); at += shapes[k++].count)
    same = counts_[k] == shapes[k].count &&
           (shapes[k].count == 0 ||
            std::memcmp(&given_[at], shapes[k].spheres, shapes[k].count * sizeof(Sphere)) == 0);
  if (same && !shape_first.empty()) return false;
  spheres.clear(), numbers.clear(), near.clear(), pieces.clear(), shape_first.clear();
  given_.clear(), counts_.clear();
  for (const Shape& shape : shapes) {
    shape_first.push_back(static_cast<std::uint32_t>(pieces.size()));
    cut(shape);
    counts_.push_back(shape.count);
    given_.insert(given_.end(), shape.spheres, shape.spheres + shape.count);
  }
  shape_first.push_back(static_cast<std::uint32_t>(pieces.size()));
  return true;
}

void Pieces::cut(const Shape& shape) {
  const auto base = static_cast<std::uint32_t>(spheres.size());
  std::vector<std::uint32_t> order(shape.count);
  std::iota(order.begin(), order.end(), 0u);
  const auto coordinate = [&](std::uint32_t k, int axis) {
    const Sphere& s = shape.spheres[k];
    const double v = axis == 0 ? s.x : axis == 1 ? s.y : s.z;
    return v == v ? v : 0;  // NaN cannot be ordered
  };
  struct Part {
    std::uint64_t first, end;
  };
  std::vector<Part> parts{{0, shape.count}};
  while (!parts.empty()) {
    const Part p = parts.back();
    parts.pop_back();
    const std::uint64_t count = p.end - p.first;
    if (count == 0) continue;
    if (count > kPieceSpheres) {  // halved so that all pieces of the first half are full
      const std::uint64_t full = (count + kPieceSpheres - 1) / kPieceSpheres,
                          middle = p.first + full / 2 * kPieceSpheres;
      int axis = 0;
      double widest = -1;
      for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (std::uint64_t k = p.first; k < p.end; k++)
          low = std::min(low, coordinate(order[k], a)), high = std::max(high, coordinate(order[k], a));
        if (high - low > widest) widest = high - low, axis = a;
      }
      const auto from = order.begin();
      std::nth_element(from + static_cast<std::ptrdiff_t>(p.first),
                       from + static_cast<std::ptrdiff_t>(middle), from + static_cast<std::ptrdiff_t>(p.end),
                       [&](std::uint32_t a, std::uint32_t b) {
                         const double x = coordinate(a, axis), y = coordinate(b, axis);
                         return x != y ? x < y : a < b;
                       });
      parts.push_back({middle, p.end}), parts.push_back({p.first, middle});
      continue;
    }
    std::sort(order.begin() + static_cast<std::ptrdiff_t>(p.first),
              order.begin() + static_cast<std::ptrdiff_t>(p.end));
    Piece piece;
    piece.first = base + static_cast<std::uint32_t>(p.first), piece.count = static_cast<std::uint32_t>(count);
    for (std::uint64_t k = p.first; k < p.end; k++)
      spheres.push_back(shape.spheres[order[k]]), numbers.push_back(order[k]);
    piece.ball = enclosing_ball(std::span(spheres).subspan(piece.first, piece.count));
    const Sphere& b = piece.ball;
    for (std::uint32_t k = piece.first; k < piece.first + piece.count; k++) {
      const Sphere& s = spheres[k];
      const bool point = !(b.r > 0);
      near.push_back({point ? 0 : static_cast<float>((s.x - b.x) / b.r),
                      point ? 0 : static_cast<float>((s.y - b.y) / b.r),
                      point ? 0 : static_cast<float>((s.z - b.z) / b.r),
                      point ? 0 : static_cast<float>(s.r / b.r)});
    }
    pieces.push_back(piece);
  }
}

}  // namespace padder::detect
