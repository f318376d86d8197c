// SPDX-License-Identifier: MIT
#include "detect/core/bodies/pieces.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <string_view>
#include <unordered_map>
#include <utility>

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
// `steps` that shrink by a fixed factor. The best centre of all is kept.
Sphere enclosing_ball(std::span<const Sphere> spheres, int steps) {
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
  const double shrink = std::pow(0.95, 150.0 / steps);
  for (int k = 0; k < steps; k++, step *= shrink) {
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

NearSphere near_of(const Sphere& s, const Sphere& ball) {
  if (!(ball.r > 0)) return {0, 0, 0, 0};
  return {static_cast<float>((s.x - ball.x) / ball.r), static_cast<float>((s.y - ball.y) / ball.r),
          static_cast<float>((s.z - ball.z) / ball.r), static_cast<float>(s.r / ball.r)};
}
// By how much balls and boxes around near spheres are enlarged: coordinates and radii are at most 1, and a
// rounding moves them by 2^-24.
constexpr float kNearMargin = 0x1p-20f;

// Halves the spheres along the longest axis of their centres, until no part has more than `most`. All parts
// but the last are full. Calls f(part) for each part, in order.
template <class F>
void for_parts(const Shape& shape, std::span<std::uint32_t> all, std::uint32_t most, F f) {
  const auto coordinate = [&](std::uint32_t k, int axis) {
    const Sphere& s = shape.spheres[k];
    const double v = axis == 0 ? s.x : axis == 1 ? s.y : s.z;
    return v == v ? v : 0;  // NaN cannot be ordered
  };
  std::vector<std::span<std::uint32_t>> parts{all};
  while (!parts.empty()) {
    const std::span<std::uint32_t> part = parts.back();
    parts.pop_back();
    if (part.empty()) continue;
    if (part.size() <= most) {
      f(part);
      continue;
    }
    int axis = 0;
    double widest = -1;
    for (int a = 0; a < 3; a++) {
      double low = INFINITY, high = -INFINITY;
      for (const std::uint32_t k : part)
        low = std::min(low, coordinate(k, a)), high = std::max(high, coordinate(k, a));
      if (high - low > widest) widest = high - low, axis = a;
    }
    const std::size_t middle = (part.size() + most - 1) / most / 2 * most;
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(middle), part.end(),
                     [&](std::uint32_t a, std::uint32_t b) {
                       const double x = coordinate(a, axis), y = coordinate(b, axis);
                       return x != y ? x < y : a < b;
                     });
    parts.push_back(part.subspan(middle)), parts.push_back(part.first(middle));
  }
}

std::string_view bytes_of(const Shape& shape) {
  return {reinterpret_cast<const char*>(shape.spheres), shape.count * sizeof(Sphere)};
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
  const Pieces old = std::exchange(*this, {});
  std::unordered_map<std::string_view, std::size_t> known;
  std::size_t given = 0;
  for (std::size_t k = 0; k < old.counts_.size(); given += old.counts_[k++])
    known.try_emplace(bytes_of({old.given_.data() + given, old.counts_[k]}), k);
  for (const Shape& shape : shapes) {
    shape_first.push_back(static_cast<std::uint32_t>(pieces.size()));
    const auto same_shape = known.find(bytes_of(shape));
    if (same_shape == known.end())
      cut(shape);
    else
      take(old, same_shape->second);
    counts_.push_back(shape.count);
    given_.insert(given_.end(), shape.spheres, shape.spheres + shape.count);
  }
  shape_first.push_back(static_cast<std::uint32_t>(pieces.size()));
  const Sphere loose{0, 0, 0, 1};
  add_near({&loose, 1}, loose);
  return true;
}

// A shape that was cut before.
void Pieces::take(const Pieces& from, std::size_t shape) {
  const std::uint32_t first = from.shape_first[shape], end = from.shape_first[shape + 1];
  if (first == end) return;
  const auto append = [](auto& to, const auto& all, std::size_t begin, std::size_t stop) {
    to.insert(to.end(), all.begin() + static_cast<std::ptrdiff_t>(begin),
              all.begin() + static_cast<std::ptrdiff_t>(stop));
  };
  const Piece& last = from.pieces[end - 1];
  const std::size_t begin = from.pieces[first].first, stop = last.first + last.count;
  const auto moved = static_cast<std::uint32_t>(spheres.size() - begin);
  append(spheres, from.spheres, begin, stop), append(numbers, from.numbers, begin, stop);
  append(near, from.near, begin, stop);
  append(groups, from.groups, std::size_t(first) * kPieceGroups, std::size_t(end) * kPieceGroups);
  append(boxes, from.boxes, first, end);
  for (std::uint32_t p = first; p < end; p++) {
    pieces.push_back(from.pieces[p]);
    pieces.back().first += moved;
  }
}

void Pieces::cut(const Shape& shape) {
  std::vector<std::uint32_t> order(shape.count);
  std::iota(order.begin(), order.end(), 0u);
  for_parts(shape, order, kPieceSpheres, [&](std::span<std::uint32_t> piece) {
    for_parts(shape, piece, kGroupSpheres,
              [](std::span<std::uint32_t> group) { std::sort(group.begin(), group.end()); });
    const auto first = static_cast<std::uint32_t>(spheres.size());
    for (const std::uint32_t k : piece) spheres.push_back(shape.spheres[k]), numbers.push_back(k);
    const auto of_piece = std::span<const Sphere>(spheres).subspan(first);
    const Sphere ball = enclosing_ball(of_piece, 150);
    pieces.push_back({ball, first, static_cast<std::uint32_t>(piece.size())});
    add_near(of_piece, ball);
  });
}

// Near spheres, the box and the groups of a piece.
void Pieces::add_near(std::span<const Sphere> of_piece, const Sphere& ball) {
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (const Sphere& s : of_piece) {
    const NearSphere n = near_of(s, ball);
    const float c[3] = {n.x, n.y, n.z};
    for (int k = 0; k < 3; k++)
      low[k] = std::min(low[k], c[k] - n.r), high[k] = std::max(high[k], c[k] + n.r);
    near.push_back(n);
  }
  NearBox box;
  for (int k = 0; k < 3; k++)
    box.center[k] = (low[k] + high[k]) / 2, box.half[k] = (high[k] - low[k]) / 2 + kNearMargin;
  boxes.push_back(box);
  for (std::size_t from = 0; from < kPieceSpheres; from += kGroupSpheres) {
    NearSphere group{0, 0, 0, 0};  // of no sphere
    if (from < of_piece.size()) {
      const std::size_t count = std::min<std::size_t>(kGroupSpheres, of_piece.size() - from);
      group = near_of(enclosing_ball(of_piece.subspan(from, count), 40), ball);
      group.r += kNearMargin;
    }
    groups.push_back(group);
  }
}

double Pieces::group_size(std::uint32_t shape) const {
  double sum = 0;
  std::uint64_t count = 0;
  for (std::uint32_t p = shape_first[shape]; p < shape_first[shape + 1]; p++)
    for (std::uint32_t g = 0; g < groups_of(pieces[p].count); g++, count++)
      sum += groups[std::uint64_t(p) * kPieceGroups + g].r;
  return count ? sum / static_cast<double>(count) : 1;
}

}  // namespace padder::detect
