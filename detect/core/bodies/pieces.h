// SPDX-License-Identifier: MIT
// Searching bodies first: each shape is cut into pieces of neighbouring spheres, with a ball around each
// piece. The search finds the balls that touch, and only then tests the spheres of those pieces. Balls are a
// little larger than necessary, so that rounding never makes a ball miss one of its spheres (proof:
// docs/detector/exactness.md). For host and device, except for Pieces, which is host code.
#pragma once
#include <span>
#include <vector>

#include "detect/body.h"
#include "detect/filter.h"

namespace padder::detect {

inline constexpr std::uint32_t kPieceSpheres = 64;  // at most, in a piece
inline constexpr std::uint32_t kGroupSpheres = 8;   // at most, in a group
inline constexpr std::uint32_t kPieceGroups = kPieceSpheres / kGroupSpheres;
// Of a shape: all but one are full.
PADDER_HD std::uint64_t pieces_of(std::uint64_t spheres) {
  return (spheres + kPieceSpheres - 1) / kPieceSpheres;
}
PADDER_HD std::uint32_t groups_of(std::uint32_t spheres) {
  return (spheres + kGroupSpheres - 1) / kGroupSpheres;
}

// Neighbouring spheres of a shape, and a ball around them in the shape's frame. A faulty sphere makes the
// ball NaN.
struct Piece {
  Sphere ball;
  std::uint32_t first = 0, count = 0;  // its spheres in Pieces::spheres
};

// A sphere relative to the ball of its piece, in units of the ball's radius. Float tests read it.
struct alignas(16) NearSphere {
  float x, y, z, r;
};
// A box around the spheres of a piece, in the same frame and units.
struct alignas(16) NearBox {
  float center[3], half[3];
};

// All shapes, cut into pieces by halving along the longest axis, and each piece into groups in the same way:
// every kGroupSpheres consecutive spheres of a piece are a group. A shape of n spheres costs O(n log n) where
// the previous call had none like it.
class Pieces {
 public:
  // Cuts the shapes into pieces. False if they are the shapes of the previous call, byte for byte: then it
  // does nothing.
  bool update(std::span<const Shape> shapes);

  std::vector<Sphere> spheres;         // of all shapes; those of a shape in the order of its pieces
  std::vector<std::uint32_t> numbers;  // for each of these spheres, its number in its shape
  std::vector<Piece> pieces;           // of all shapes
  // For each of these spheres and pieces, and at last for a piece of one sphere, which stands for every loose
  // sphere. Groups: kPieceGroups balls for each piece.
  std::vector<NearSphere> near, groups;
  std::vector<NearBox> boxes;
  std::vector<std::uint32_t> shape_first;  // the first piece of each shape, and the end
  // The mean radius of the groups of a shape's pieces, in units of their balls.
  double group_size(std::uint32_t shape) const;

 private:
  void cut(const Shape& shape);
  void take(const Pieces& from, std::size_t shape);
  void add_near(std::span<const Sphere> spheres, const Sphere& ball);
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
// Records in float hold nothing beyond 1e38. Where a ball comes near it, the spheres themselves are checked.
inline constexpr double kBallInFloat = 1e37;

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

// A radius that is a little larger, by up to 2^-23 of itself. It has so few digits that it stays the same
// while a body moves, and so do the bins that follow from it.
PADDER_HD double rounded_radius(double r) {
  std::uint64_t bits;
  memcpy(&bits, &r, sizeof bits);
  bits = (bits + 0x1fffffff) & ~std::uint64_t(0x1fffffff);
  memcpy(&r, &bits, sizeof r);
  return r;
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
  at.r = rounded_radius(n * b.r + kBallMargin * extent + kBallLeast);
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

// How an element stands, for those who look at it from another element. A loose sphere stands like a piece of
// one sphere, without rotation.
struct alignas(16) Stance {
  float rotation[9];
  std::uint32_t body, piece;  // as in Element
  std::uint32_t count;        // spheres
  double radius, over;        // of the ball in its own frame; by how much the placed ball is larger
};
PADDER_HD Stance stance_of(const Body& body, const Element& e, const Piece& piece, const Sphere& ball) {
  Stance s{{}, e.body, e.piece, piece.count, piece.ball.r, ball.r - piece.ball.r};
  for (int k = 0; k < 9; k++) s.rotation[k] = static_cast<float>(body.rotation[k]);
  return s;
}
PADDER_HD Stance stance_of(const Element& e, const Sphere& loose, const Sphere& ball) {
  return {{1, 0, 0, 0, 1, 0, 0, 0, 1}, e.body, e.piece, 1, loose.r, ball.r - loose.r};
}

// Element b as seen from a: it turns near spheres of b into those of a. With `margin` added to a sum of
// radii, float tests let too many pairs pass, never too few (proof: docs/detector/exactness.md). Where a
// number overflows or is not a number, all pass.
struct alignas(16) Relative {
  float m[9], t[3];
  float scale, margin;  // the radius of b in units of a's

  PADDER_HD NearSphere operator()(const NearSphere& s) const {
    return {t[0] + m[0] * s.x + m[1] * s.y + m[2] * s.z, t[1] + m[3] * s.x + m[4] * s.y + m[5] * s.z,
            t[2] + m[6] * s.x + m[7] * s.y + m[8] * s.z, s.r * scale + margin};
  }
};
// `reach`: pairs whose gap is at most this shall pass.
PADDER_HD Relative relative(const Stance& a, const Sphere& ball_a, const Stance& b, const Sphere& ball_b,
                            double reach = 0) {
  const double unit = 1 / a.radius;
  const float d[3] = {static_cast<float>((ball_b.x - ball_a.x) * unit),
                      static_cast<float>((ball_b.y - ball_a.y) * unit),
                      static_cast<float>((ball_b.z - ball_a.z) * unit)};
  Relative to;
  to.scale = static_cast<float>(b.radius * unit);
  for (int i = 0; i < 3; i++) {
    const float x = a.rotation[i], y = a.rotation[3 + i], z = a.rotation[6 + i];
    to.t[i] = x * d[0] + y * d[1] + z * d[2];
    for (int j = 0; j < 3; j++)
      to.m[3 * i + j] = (x * b.rotation[j] + y * b.rotation[3 + j] + z * b.rotation[6 + j]) * to.scale;
  }
  const auto over_a = static_cast<float>(a.over * unit), over_b = static_cast<float>(b.over * unit);
  const float all = 1 + to.scale + ::fabsf(d[0]) + ::fabsf(d[1]) + ::fabsf(d[2]);
  // A ball of radius 0 has all its spheres in its centre, and nothing is stretched.
  const float stretch_b = b.radius > 0 ? over_b / to.scale : 0;
  to.margin = (1 + over_a) * (1 + stretch_b) * (4 * (over_a * (1 + to.scale) + over_b) + 0x1p-17f * all) +
              static_cast<float>(reach * unit * (1 + 0x1p-18));
  return to;
}
// Two near spheres of one frame, one of which has the margin of Relative.
PADDER_HD bool overlap(const NearSphere& a, const NearSphere& b) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, sum = a.r + b.r;
  return !(x * x + y * y + z * z > sum * sum);  // written so that NaN passes
}
// Are the boxes apart along an edge of one of them?
PADDER_HD bool boxes_apart(const NearBox& a, const NearBox& b, const Relative& to) {
  const NearSphere c = to({b.center[0], b.center[1], b.center[2], 0});
  const float d[3] = {c.x - a.center[0], c.y - a.center[1], c.z - a.center[2]};
  bool apart = false;
  for (int i = 0; i < 3; i++) {
    const float reach_b = ::fabsf(to.m[3 * i]) * b.half[0] + ::fabsf(to.m[3 * i + 1]) * b.half[1] +
                          ::fabsf(to.m[3 * i + 2]) * b.half[2],
                reach_a = ::fabsf(to.m[i]) * a.half[0] + ::fabsf(to.m[3 + i]) * a.half[1] +
                          ::fabsf(to.m[6 + i]) * a.half[2];
    const float along_b = to.m[i] * d[0] + to.m[3 + i] * d[1] + to.m[6 + i] * d[2];
    apart = apart || ::fabsf(d[i]) > a.half[i] + reach_b + 2 * to.margin ||
            ::fabsf(along_b) > reach_a + to.scale * (to.scale * b.half[i] + 4 * to.margin);
  }
  return apart;
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
