// SPDX-License-Identifier: MIT
// Bodies first: what is searched is not a body's spheres but the balls about its pieces, and only the spheres
// of pieces whose balls meet are looked at. Host and device but for Pieces, which is host code. Every ball is
// generous: rounding never lets a ball miss a sphere (proof in docs/detector.md, "Bodies first").
#pragma once
#include <span>
#include <vector>

#include "detect/body.h"
#include "detect/filter.h"

namespace padder::detect {

inline constexpr std::uint32_t kPieceSpheres = 64;  // of a piece, at most

// Neighbouring spheres of a shape, and a ball about them in the shape's frame. A faulty sphere makes it NaN.
struct Piece {
  Sphere ball;
  std::uint32_t first = 0, count = 0;  // in the order of Pieces
};

// A sphere relative to its piece's ball, in radii of the ball: for the sieve.
struct alignas(16) NearSphere {
  float x, y, z, r;
};

// All shapes cut into pieces by halving along the longest axis. Costs n log n once a shape.
class Pieces {
 public:
  // Builds what is not built yet; false when these shapes are those of the call before, byte for byte.
  bool update(std::span<const Shape> shapes);

  std::vector<Sphere> spheres;         // of all shapes, each shape's in the order of its pieces
  std::vector<std::uint32_t> numbers;  // of each its number in the shape
  std::vector<NearSphere> near;
  std::vector<Piece> pieces;               // of all shapes
  std::vector<std::uint32_t> shape_first;  // the first piece of each shape, and the end

 private:
  void cut(const Shape& shape);
  std::vector<Sphere> given_;
  std::vector<std::uint64_t> counts_;
};

// What the search over balls knows of one: a piece of a body, or a loose sphere by its number.
struct Element {
  std::uint32_t body = 0, piece = 0;
};
inline constexpr std::uint32_t kLoose = ~0u;  // as a body

// Margins of the proof: of a ball, relative to its radius, its distance from both origins, and absolute: a
// rounding below 2^-1022 moves a number by up to 2^-1075, and no ball sees a thousand of them.
inline constexpr double kBallMargin = 0x1p-46, kBallLeast = 0x1p-1060, kBallMost = 0x1p330;

// A number no less than the greatest factor by which the matrix stretches; 1 and a hair for a rotation.
PADDER_HD double stretch_of(const double (&m)[9]) {
  double e = 0;  // the entries of M'M - I, summed: at least its norm
  for (int i = 0; i < 3; i++)
    for (int j = i; j < 3; j++) {
      const double v =
          add(add(mul(m[i], m[j]), mul(m[3 + i], m[3 + j])), mul(m[6 + i], m[6 + j])) - (i == j ? 1 : 0);
      e += i == j ? magnitude(v) : 2 * magnitude(v);
    }
  return 1 + e + 0x1p-45;
}

// The ball of a piece where the body is. NaN where the body's place is none, or beyond all bounds: then the
// spheres themselves must be asked what is wrong with them.
PADDER_HD Sphere ball_of(const Body& body, const Piece& piece) {
  const Sphere& b = piece.ball;
  Sphere at = placed(body, b);
  const double n = stretch_of(body.rotation);
  const double reach = n * (magnitude(b.x) + magnitude(b.y) + magnitude(b.z) + b.r) +
                       magnitude(body.position[0]) + magnitude(body.position[1]) +
                       magnitude(body.position[2]);
  at.r = n * b.r + kBallMargin * reach + kBallLeast;
  if (!(reach < kBallMost)) at.r = NAN;
  return at;
}
PADDER_HD Sphere ball_of(const Sphere& loose) {
  Sphere at = loose;
  at.r = loose.r + kBallMargin * loose.r + kBallLeast;
  if (!(magnitude(at.x) < kBallMost && magnitude(at.y) < kBallMost && magnitude(at.z) < kBallMost &&
        loose.r >= 0 && loose.r < kBallMost))
    at.r = NAN;
  return at;
}

// The spheres of a piece that another ball may reach, told apart in float and in the piece's own frame.
struct Sieve {
  float x = 0, y = 0, z = 0, reach = INFINITY;
};
// `mine` and `other` are placed balls.
PADDER_HD Sieve sieve_of(const Body& body, const Piece& piece, const Sphere& mine, const Sphere& other) {
  const double r = piece.ball.r, per_r = 1 / r, *m = body.rotation;
  const double x = other.x - mine.x, y = other.y - mine.y, z = other.z - mine.z;
  const double tx = (m[0] * x + m[3] * y + m[6] * z) * per_r, ty = (m[1] * x + m[4] * y + m[7] * z) * per_r,
               tz = (m[2] * x + m[5] * y + m[8] * z) * per_r;
  const double over = mine.r - r;  // at least r (stretch - 1) and all that rounding moves a sphere by
  const double n = stretch_of(body.rotation);
  const double reach = (n * (other.r + over) + 3 * (n - 1) * r) * per_r;
  const double margin = 0x1p-18 * (1 + magnitude(tx) + magnitude(ty) + magnitude(tz) + reach);
  return {static_cast<float>(tx), static_cast<float>(ty), static_cast<float>(tz),
          static_cast<float>(reach + margin)};
}
PADDER_HD bool passes(const Sieve& s, const NearSphere& k) {
  const float x = k.x - s.x, y = k.y - s.y, z = k.z - s.z, reach = k.r + s.reach;
  return !(x * x + y * y + z * z > reach * reach);  // where numbers have no meaning all pass
}

}  // namespace padder::detect
