// SPDX-License-Identifier: MIT
// Searching bodies first: each shape is cut into pieces of neighbouring spheres, with a ball around each
// piece. The search finds the balls that touch, and only then tests the spheres of those pieces. Balls are a
// little larger than necessary, so that rounding never makes a ball miss one of its spheres (proof:
// docs/detector.md, "Bodies first"). For host and device, except for Pieces, which is host code.
#pragma once
#include <span>
#include <vector>

#include "detect/body.h"
#include "detect/filter.h"

namespace padder::detect {

inline constexpr std::uint32_t kPieceSpheres = 64;  // at most, in a piece

// Neighbouring spheres of a shape, and a ball around them in the shape's frame. A faulty sphere makes the
// ball NaN.
struct Piece {
  Sphere ball;
  std::uint32_t first = 0, count = 0;  // its spheres in Pieces::spheres
};

// A sphere relative to the ball of its piece, in units of the ball's radius. The sieve reads it.
struct alignas(16) NearSphere {
  float x, y, z, r;
};

// All shapes, cut into pieces by halving along the longest axis. A shape of n spheres costs O(n log n), once.
class Pieces {
 public:
  // Cuts the shapes into pieces. False if they are the shapes of the previous call, byte for byte: then it
  // does nothing.
  bool update(std::span<const Shape> shapes);

  std::vector<Sphere> spheres;             // of all shapes; those of a shape in the order of its pieces
  std::vector<std::uint32_t> numbers;      // for each of these spheres, its number in its shape
  std::vector<NearSphere> near;            // for each of these spheres
  std::vector<Piece> pieces;               // of all shapes
  std::vector<std::uint32_t> shape_first;  // the first piece of each shape, and the end

 private:
  void cut(const Shape& shape);
  std::vector<Sphere> given_;
  std::vector<std::uint64_t> counts_;
};

// What a ball of the search stands for: a piece of a body, or a loose sphere.
struct Element {
  std::uint32_t body = 0, piece = 0;  // for a loose sphere: kLoose, and its number among the loose ones
};
inline constexpr std::uint32_t kLoose = ~0u;

// Margins of the proof, by which balls are enlarged. kBallMargin is relative to the ball's radius and its
// distance from both origins. kBallLeast is absolute: below 2^-1022 a rounding moves a number by up to
// 2^-1075, and a ball suffers fewer than a thousand of them. Beyond kBallMost there are no balls.
inline constexpr double kBallMargin = 0x1p-46, kBallLeast = 0x1p-1060, kBallMost = 0x1p330;

// An upper bound for the factor by which the matrix stretches a vector. For a rotation it is hardly more
// than 1.
PADDER_HD double stretch_of(const double (&m)[9]) {
  double e = 0;  // the sum of the magnitudes of the entries of M'M - I; at least its norm
  for (int i = 0; i < 3; i++)
    for (int j = i; j < 3; j++) {
      const double v =
          add(add(mul(m[i], m[j]), mul(m[3 + i], m[3 + j])), mul(m[6 + i], m[6 + j])) - (i == j ? 1 : 0);
      e += i == j ? magnitude(v) : 2 * magnitude(v);
    }
  return 1 + e + 0x1p-45;
}

// The ball of a piece where the body is. NaN if the pose is not finite or beyond all bounds; then the spheres
// themselves must be checked to say what is wrong.
PADDER_HD Sphere ball_of(const Body& body, const Piece& piece) {
  const Sphere& b = piece.ball;
  Sphere at = placed(body, b);
  const double n = stretch_of(body.rotation);
  const double extent = n * (magnitude(b.x) + magnitude(b.y) + magnitude(b.z) + b.r) +
                        magnitude(body.position[0]) + magnitude(body.position[1]) +
                        magnitude(body.position[2]);
  at.r = n * b.r + kBallMargin * extent + kBallLeast;
  if (!(extent < kBallMost)) at.r = NAN;
  return at;
}
// The ball of a loose sphere.
PADDER_HD Sphere ball_of(const Sphere& loose) {
  Sphere at = loose;
  at.r = loose.r + kBallMargin * loose.r + kBallLeast;
  if (!(magnitude(at.x) < kBallMost && magnitude(at.y) < kBallMost && magnitude(at.z) < kBallMost &&
        loose.r >= 0 && loose.r < kBallMost))
    at.r = NAN;
  return at;
}

// A quick test that finds the spheres of a piece which another ball may touch. It works in float, in the
// frame of the piece and in units of its ball's radius, so it needs no placed spheres. It lets too many pass,
// never too few.
struct Sieve {
  float x = 0, y = 0, z = 0, radius = INFINITY;  // the other ball, enlarged by what rounding may move
};
// `mine` is the placed ball of the piece, `other` the other placed ball.
PADDER_HD Sieve sieve_of(const Body& body, const Piece& piece, const Sphere& mine, const Sphere& other) {
  const double r = piece.ball.r, per_r = 1 / r, *m = body.rotation;
  const double x = other.x - mine.x, y = other.y - mine.y, z = other.z - mine.z;
  const double tx = (m[0] * x + m[3] * y + m[6] * z) * per_r, ty = (m[1] * x + m[4] * y + m[7] * z) * per_r,
               tz = (m[2] * x + m[5] * y + m[8] * z) * per_r;
  const double over = mine.r - r;  // at least r (stretch - 1), and all that rounding moves a sphere by
  const double n = stretch_of(body.rotation);
  const double radius = (n * (other.r + over) + 3 * (n - 1) * r) * per_r;
  const double margin = 0x1p-18 * (1 + magnitude(tx) + magnitude(ty) + magnitude(tz) + radius);
  return {static_cast<float>(tx), static_cast<float>(ty), static_cast<float>(tz),
          static_cast<float>(radius + margin)};
}
PADDER_HD bool passes(const Sieve& s, const NearSphere& k) {
  const float x = k.x - s.x, y = k.y - s.y, z = k.z - s.z, sum = k.r + s.radius;
  return !(x * x + y * y + z * z > sum * sum);  // written so that NaN passes
}

}  // namespace padder::detect
