// SPDX-License-Identifier: MIT
#include "detect/core/bodies/body_choice.h"

#include <algorithm>
#include <cmath>

#include "detect/core/input.h"

namespace padder::detect {
namespace {

// A part of the bodies, each with one of its pieces, and of the loose spheres.
struct Sample {
  std::vector<float> x, y, z, r;
  std::vector<double> stands_for;  // so many balls
  std::vector<Filter> filter;
  void add(const Sphere& ball, double balls, const Filter& f) {
    x.push_back(static_cast<float>(ball.x)), y.push_back(static_cast<float>(ball.y));
    z.push_back(static_cast<float>(ball.z)), r.push_back(static_cast<float>(ball.r));
    stands_for.push_back(balls), filter.push_back(f);
  }
  std::size_t size() const { return x.size(); }
};

// A number below n that follows from k and looks as if drawn (the finalizer of SplitMix64).
std::uint64_t scattered(std::uint64_t k, std::uint64_t n) {
  k = (k + 0x9e3779b97f4a7c15) * 0xbf58476d1ce4e5b9;
  k = (k ^ k >> 30) * 0x94d049bb133111eb;
  return (k ^ k >> 31) % n;
}

// Calls each(k, m) for some of the numbers below n, each of which stands for m. They are spread evenly but
// for chance, because things are often listed in a pattern.
template <class Each>
void for_some(std::uint64_t n, const Each& each) {
  const auto most = 2 * static_cast<std::uint64_t>(std::sqrt(static_cast<double>(n))),
             count = std::min<std::uint64_t>(n, std::max<std::uint64_t>(128, most));
  for (std::uint64_t k = 0; k < count; k++) {
    const std::uint64_t from = k * n / count, to = (k + 1) * n / count;
    each(from + scattered(k, to - from), static_cast<double>(n) / static_cast<double>(count));
  }
}

bool touch(const Sample& s, std::size_t i, std::size_t j, float margin) {
  const float a = s.x[j] - s.x[i], b = s.y[j] - s.y[i], c = s.z[j] - s.z[i], sum = s.r[j] + (s.r[i] + margin);
  return a * a + b * b + c * c < sum * sum;
}

// How many of the balls from `first` on does ball i touch?
int touched(const Sample& s, std::size_t i, std::size_t first, float margin) {
  int count = 0;
  for (std::size_t j = first; j < s.size(); j++) count += touch(s, i, j, margin);
  return count;
}

}  // namespace

double touching_balls(const Input& input, double margin, const Pieces& pieces) {
  Sample s;
  if (!has_device_poses(input))
    for_some(input.bodies.size(), [&](std::uint64_t b, double bodies) {
      const Body body = body_at(input, b);
      const std::uint32_t first = pieces.shape_first[body.shape],
                          count = pieces.shape_first[body.shape + 1] - first;
      if (count == 0) return;
      const Piece& piece = pieces.pieces[first + scattered(b, count)];
      s.add(ball_of(body, piece), count * bodies, filter_of(body, static_cast<std::uint32_t>(b)));
    });
  const std::size_t of_bodies = s.size();
  if (input.spheres.memory == Memory::host)
    for_some(input.spheres.count, [&](std::uint64_t k, double spheres) {
      s.add(loose_at(input.spheres, k), spheres, filter_at(input.spheres, k));
    });
  double pairs = 0;
  const auto reach = static_cast<float>(margin);
  for (std::size_t i = 0; i < of_bodies; i++) {
    if (touched(s, i, i + 1, reach) == 0) continue;
    for (std::size_t j = i + 1; j < s.size(); j++)
      if (admitted(s.filter[i], s.filter[j]) && touch(s, i, j, reach))
        pairs += s.stands_for[i] * s.stands_for[j];
  }
  return pairs;
}

BodyCensus census_of(std::span<const Shape> shapes, const BodyTally& bodies, Pieces& pieces) {
  pieces.update(shapes);
  BodyCensus census;
  double pieces_seen = 0, spheres = 0, ball_volume = 0, sphere_volume = 0, contacts = 0, radii = 0,
         largest = 0;
  for (std::size_t k = 0; k < shapes.size(); k++) {
    const auto times = static_cast<double>(bodies.of_shape[k]);
    census.bodies += bodies.of_shape[k],
        census.balls += bodies.moving_of_shape[k] * pieces_of(shapes[k].count);
    for (std::uint32_t p = pieces.shape_first[k]; times > 0 && p < pieces.shape_first[k + 1]; p++) {
      const Piece& piece = pieces.pieces[p];
      double sum = 0, squares = 0, cubes = 0;
      for (std::uint32_t q = piece.first; q < piece.first + piece.count; q++) {
        const double r = pieces.spheres[q].r;
        sum += r, squares += r * r, cubes += r * r * r, largest = std::max(largest, r);
      }
      const double ball = piece.ball.r * piece.ball.r * piece.ball.r;
      pieces_seen += times, spheres += times * piece.count, radii += times * sum;
      ball_volume += times * ball, sphere_volume += times * cubes;
      // The sum of ((r + s) / 2)^3 over all pairs of radii.
      if (ball > 0) contacts += times * (piece.count * cubes + 3 * squares * sum) / (4 * ball);
    }
  }
  census.some_static = bodies.moving < census.bodies;
  if (ball_volume > 0) {
    census.filled = sphere_volume / ball_volume, census.contacts = contacts / pieces_seen;
    if (radii > 0) census.octaves = std::log2(largest * spheres / radii);
  }
  return census;
}

double most_touching_balls(const BodyCensus& census, std::uint64_t spheres, std::uint64_t loose,
                           std::uint64_t moving_loose, const BodyCosts& costs, double times) {
  const auto balls = static_cast<double>(census.balls), moving = static_cast<double>(moving_loose);
  const double expanded = static_cast<double>(spheres - loose) + costs.loose * static_cast<double>(loose);
  // A loose sphere costs as much again, because it is brought into the balls' order as well.
  double left = times * expanded * (1 + costs.octave * census.octaves) - costs.call -
                costs.body * static_cast<double>(census.bodies) - costs.ball * balls -
                (costs.loose + 1) * moving;
  if (census.some_static || moving_loose < loose)
    left -= costs.static_call + costs.static_each * (balls + moving);
  if (left <= 0) return 0;
  return left / (costs.pair + costs.contact * census.contacts + costs.crowd / std::max(balls + moving, 1.0));
}

}  // namespace padder::detect
