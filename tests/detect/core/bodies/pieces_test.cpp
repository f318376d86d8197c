// SPDX-License-Identifier: MIT
// What the float tests of the narrow phase may not do: refuse two spheres that touch by the exact test. The
// spheres are placed in double, as the detector places them; poses, sizes and places are drawn at random.
#include "detect/core/bodies/pieces.h"

#include <cstring>

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

using Random = std::mt19937_64;
double in(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

std::vector<Sphere> blob(std::size_t n, double size, double r_low, double r_high, Random& random) {
  std::vector<Sphere> s(n);
  for (Sphere& p : s)
    p = {in(random, -size, size), in(random, -size, size), in(random, -size, size) / 3,
         in(random, r_low, r_high)};
  return s;
}

// A piece of a body as another piece sees it; with no body, a loose sphere.
struct Side {
  Stance stance;
  Sphere ball;
  NearBox box;
  std::vector<Sphere> spheres;  // placed
  std::vector<NearSphere> near, groups;
};
Side piece_side(const Pieces& all, std::size_t k, const Body& body) {
  const Piece& piece = all.pieces[k];
  Side s;
  s.ball = ball_of(body, piece);
  s.stance = stance_of(body, {0, static_cast<std::uint32_t>(k)}, piece, s.ball);
  s.box = all.boxes[k];
  for (std::uint32_t q = piece.first; q < piece.first + piece.count; q++)
    s.spheres.push_back(placed(body, all.spheres[q])), s.near.push_back(all.near[q]);
  for (std::uint32_t g = 0; g < kPieceGroups; g++) s.groups.push_back(all.groups[k * kPieceGroups + g]);
  return s;
}
Side loose_side(const Pieces& all, const Sphere& sphere) {
  Side s;
  s.ball = ball_of(sphere), s.stance = stance_of({kLoose, 0}, sphere, s.ball);
  s.box = all.boxes.back(), s.near = {all.near.back()}, s.spheres = {sphere};
  s.groups.assign(all.groups.end() - kPieceGroups, all.groups.end());
  return s;
}

struct Counts {
  std::uint64_t touching = 0, candidates = 0;
};
// Each pair of spheres: what touches, or has a gap of at most `margin`, passes all float tests. They are
// counted in the frame of the larger side, which the narrow phase takes.
void check(const Side& a, const Side& b, double margin, Counts& counts) {
  const Relative to_a = relative(a.stance, a.ball, b.stance, b.ball, margin);
  const bool apart = boxes_apart(a.box, b.box, to_a);
  const NearSphere ball_b{to_a.t[0], to_a.t[1], to_a.t[2], to_a.scale + to_a.margin};
  for (std::size_t i = 0; i < a.spheres.size(); i++)
    for (std::size_t j = 0; j < b.spheres.size(); j++) {
      const NearSphere near_b = to_a(b.near[j]);
      const bool reached = overlap(a.near[i], ball_b) && overlap(near_b, {0, 0, 0, 1}),
                 groups = overlap(a.groups[i / kGroupSpheres], to_a(b.groups[j / kGroupSpheres])),
                 spheres = overlap(a.near[i], near_b);
      const bool counted = a.stance.radius >= b.stance.radius;
      counts.candidates += counted && reached && spheres && !apart;
      if (!touching(a.spheres[i], b.spheres[j], margin)) continue;
      counts.touching += counted;
      ASSERT_FALSE(apart) << i << ", " << j;
      ASSERT_TRUE(reached) << i << ", " << j;
      ASSERT_TRUE(groups) << i << ", " << j;
      ASSERT_TRUE(spheres) << i << ", " << j;
    }
}

// Two shapes, at a distance at which some of their spheres touch. `stretch`: how far from a rotation the
// matrices are. `offset`: how far from the origin both are, in sizes. Some spheres are moved so that they
// touch in one point, as far as doubles can say. `margin`: in sizes.
void check_random(Random& random, double scale, double ratio, double stretch, double offset, double margin,
                  Counts& counts) {
  const std::size_t n = 1 + random() % 130, m = 1 + random() % 130;
  auto one = blob(n, scale, 0.02 * scale, 0.3 * scale, random),
       two = blob(m, scale * ratio, 0.02 * scale * ratio, 0.3 * scale * ratio, random);
  Body a = body_at(0, 0, 0, 0, random), b = body_at(0, 0, 0, 0, random);
  for (Body* body : {&a, &b}) {
    if (random() % 4 == 0) continue;  // the other is stretched alone
    for (double& v : body->rotation) v *= 1 + stretch * in(random, -1, 1);
  }
  for (int k = 0; k < 3; k++) {
    a.position[k] = offset * scale * in(random, -1, 1);
    b.position[k] = a.position[k] + (1 + ratio) * scale * in(random, -0.8, 0.8);
  }
  for (std::size_t k = 0; k < 8; k++) {  // the distance of two placed centres becomes the sum of the radii
    Sphere& s = one[random() % n];
    const Sphere p = placed(a, s), q = placed(b, two[random() % m]);
    const double gap = std::hypot(p.x - q.x, p.y - q.y, p.z - q.z) - q.r;
    if (gap > margin * scale && gap < 2 * scale)
      s.r = (gap - margin * scale) * (1 + 0x1p-52 * static_cast<double>(random() % 5));
  }
  const Shape shapes[] = {{one.data(), n}, {two.data(), m}};
  Pieces pieces;
  pieces.update(shapes);
  for (std::uint32_t p = 0; p < pieces.shape_first[1]; p++) {
    const Side side = piece_side(pieces, p, a);
    for (std::uint32_t q = pieces.shape_first[1]; q < pieces.shape_first[2]; q++) {
      const Side other = piece_side(pieces, q, b);
      check(side, other, margin * scale, counts), check(other, side, margin * scale, counts);
    }
    for (int k = 0; k < 4; k++) {
      Sphere near = placed(b, two[random() % m]);
      if (k == 0) near = placed(a, one[random() % n]), near.r = 0;  // a point
      const Side other = loose_side(pieces, near);
      check(side, other, margin * scale, counts), check(other, side, margin * scale, counts);
    }
  }
}

TEST(Pieces, FloatTestsLetEveryTouchingPairPass) {
  std::mt19937_64 random = random_of_new_seed();
  for (const double scale : {1.0, 1e-150, 1e60, 3e-12})
    for (const double ratio : {1.0, 1e-3, 1e4})
      for (const double stretch : {0.0, 1e-12, 1e-3, 0.3})
        for (const double offset : {0.0, 100.0, 1e7, 1e12}) {
          SCOPED_TRACE("scale " + std::to_string(scale) + " ratio " + std::to_string(ratio) + " stretch " +
                       std::to_string(stretch) + " offset " + std::to_string(offset));
          Counts counts;
          for (const double margin : {0.0, 1e-3, 0.7})
            check_random(random, scale, ratio, stretch, offset, margin, counts);
          if (testing::Test::HasFatalFailure()) return;
        }
}

// They would be useless if they let everything pass.
TEST(Pieces, FloatTestsLetFewOthersPass) {
  Random random(7);
  Counts counts;
  for (int k = 0; k < 100; k++) check_random(random, 1, 1, 0, 100, 0, counts);
  EXPECT_GT(counts.touching, 10000u);
  EXPECT_LT(static_cast<double>(counts.candidates), 1.005 * static_cast<double>(counts.touching));
}

TEST(Pieces, AGroupHoldsItsSpheres) {
  Random random(3);
  const auto spheres = blob(1000, 1, 0.01, 0.2, random);
  const Shape shape[] = {{spheres.data(), spheres.size()}};
  Pieces p;
  p.update(shape);
  for (std::size_t k = 0; k < p.pieces.size(); k++)
    for (std::uint32_t q = 0; q < p.pieces[k].count; q++) {
      const NearSphere s = p.near[p.pieces[k].first + q], g = p.groups[k * kPieceGroups + q / kGroupSpheres];
      EXPECT_LE(std::hypot(double(s.x) - g.x, double(s.y) - g.y, double(s.z) - g.z) + s.r, g.r);
    }
  EXPECT_GT(p.group_size(0), 0.4);
  EXPECT_LT(p.group_size(0), 0.6);  // of the ball around the piece
}

TEST(Pieces, ARadiusStaysTheSameWhileABodyMoves) {
  for (double r = 1e-300; r < 1e300; r *= 7.3) {
    const double up = rounded_radius(r);
    EXPECT_GE(up, r);
    EXPECT_LE(up, r * (1 + 0x1p-23));
    EXPECT_EQ(rounded_radius(up), up);
  }
  Random random(5);
  const auto spheres = blob(64, 1, 0.01, 0.2, random);
  const Shape shape[] = {{spheres.data(), spheres.size()}};
  Pieces p;
  p.update(shape);
  Body body = body_at(0, 0, 0, 0, random);
  const double before = ball_of(body, p.pieces[0]).r;
  for (int k = 0; k < 100; k++) {
    body = body_at(0, 0, 0, 0, random);
    for (double& v : body.position) v = in(random, -50, 50);
    EXPECT_EQ(ball_of(body, p.pieces[0]).r, before);
  }
}

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

// Shapes that the call before had too are not cut again. What comes of them is the same.
TEST(Pieces, ShapesThatStayAreThoseOfNewPieces) {
  Random random = random_of_new_seed();
  std::vector<std::vector<Sphere>> blobs;
  for (const std::size_t n : {1, 64, 65, 300, 0, 1000}) blobs.push_back(blob(n, 3, 0.1, 1, random));
  const auto shapes_of = [&](std::initializer_list<std::size_t> which) {
    std::vector<Shape> shapes;
    for (const std::size_t k : which) shapes.push_back({blobs[k].data(), blobs[k].size()});
    return shapes;
  };
  Pieces kept;
  for (const auto& which : {shapes_of({0, 1, 2}), shapes_of({2, 3, 0}), shapes_of({5, 4, 2, 2}),
                            shapes_of({4}), shapes_of({}), shapes_of({3, 5}), shapes_of({3, 5, 1})}) {
    EXPECT_TRUE(kept.update(which));
    EXPECT_FALSE(kept.update(which));
    Pieces anew;
    anew.update(which);
    EXPECT_TRUE(same_bytes(kept.spheres, anew.spheres) && same_bytes(kept.numbers, anew.numbers));
    EXPECT_TRUE(same_bytes(kept.near, anew.near) && same_bytes(kept.groups, anew.groups));
    EXPECT_EQ(kept.shape_first, anew.shape_first);
    ASSERT_EQ(kept.boxes.size(), anew.boxes.size());
    for (std::size_t k = 0; k < kept.boxes.size(); k++)  // whose last bytes are nobody's
      EXPECT_EQ(std::memcmp(&kept.boxes[k], &anew.boxes[k], 6 * sizeof(float)), 0);
    ASSERT_EQ(kept.pieces.size(), anew.pieces.size());
    for (std::size_t p = 0; p < kept.pieces.size(); p++) {
      EXPECT_EQ(std::memcmp(&kept.pieces[p].ball, &anew.pieces[p].ball, sizeof(Sphere)), 0);
      EXPECT_EQ(kept.pieces[p].first, anew.pieces[p].first);
      EXPECT_EQ(kept.pieces[p].count, anew.pieces[p].count);
    }
    for (std::size_t k = 0; k < which.size(); k++)
      EXPECT_EQ(kept.shape_first[k + 1] - kept.shape_first[k], pieces_of(which[k].count));
  }
}

}  // namespace
}  // namespace padder::detect
