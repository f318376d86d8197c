// SPDX-License-Identifier: MIT
// Sparse and uneven scenes on the GPU, standing and in motion: levels are hashed, bins alias, rows run over
// the end of a ring, and grids are kept while spheres move. Small scenes are compared with brute force, large
// ones with the processor.
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

class SparseTest : public GpuTest {
 protected:
  double unit() { return signed_unit(random_); }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }

  // Heaps, chains and dust, far from each other or not, of radii 1 to `ratio`.
  TestScene scene(std::uint32_t n, double ratio) {
    TestScene s;
    const double far = std::pow(10, 1.5 + 2.5 * std::abs(unit()));
    while (s.spheres.size() < n) {
      const double at[3] = {far * unit(), far * unit(), far * unit()};
      const std::uint32_t kind = below(3), count = 1 + below(n / 2);
      const double d[3] = {unit(), unit(), unit()},
                   wide = std::max(1.5 * std::cbrt(count), std::pow(10, 1.5 * std::abs(unit())));
      for (std::uint32_t k = 0; k < count && s.spheres.size() < n; k++) {
        Sphere p{at[0], at[1], at[2], std::pow(ratio, std::pow(std::abs(unit()), 8))};
        if (kind == 0) p.x += wide * unit(), p.y += wide * unit(), p.z += wide * unit();
        if (kind == 1) p.x += 1.9 * k * d[0], p.y += 1.9 * k * d[1], p.z += 1.9 * k * d[2];
        if (kind == 2) p.x = far * unit(), p.y = far * unit(), p.z = far * unit();
        s.spheres.push_back(p);
      }
    }
    std::shuffle(s.spheres.begin(), s.spheres.end(), random_);
    return s;
  }
  void move(TestScene& s, double step) {
    for (Sphere& p : s.spheres) p.x += step * unit(), p.y += step * unit(), p.z += step * unit();
  }

  void expect_brute_force(double ratio, Scalar scalar) {
    Detector d({BackendKind::cuda}, {.order = below(2) ? Order::stable : Order::any});
    TestScene s = scene(200 + below(3000), ratio);
    if (below(3) == 0)
      for (std::size_t k = 0; k < s.spheres.size(); k++) s.family.push_back(below(4));
    for (int call = 0; call < 6; call++) {
      const TestScene given = scalar == Scalar::f32 ? s.rounded() : s;
      const Arranged input(given, scalar);
      const Contacts& c = d.detect(input.input);
      ASSERT_EQ(sorted({c.pairs, c.count}), brute_force(given)) << "call " << call;
      move(s, std::pow(10, unit() - 1));
    }
  }
  void expect_processor(std::uint32_t n, double ratio, Scalar scalar) {
    expect_processor(scene(n, ratio), scalar);
  }
  void expect_processor(TestScene s, Scalar scalar) {
    Detector cpu({BackendKind::omp}, {}), gpu({BackendKind::cuda}, {});
    for (int call = 0; call < 5; call++) {
      gpu.options().order = below(2) ? Order::stable : Order::any;
      SCOPED_TRACE("call " + std::to_string(call));
      ASSERT_NO_FATAL_FAILURE(expect_same(s, scalar, gpu, cpu));
      move(s, 0.1);
    }
  }
  static void expect_same(const TestScene& s, Scalar scalar, Detector& gpu, Detector& cpu) {
    const Arranged input(scalar == Scalar::f32 ? s.rounded() : s, scalar);
    ASSERT_EQ(gpu.detect(input.input).count, cpu.detect(input.input).count);
    ASSERT_EQ(gpu.hash(), cpu.hash());
  }

  std::mt19937_64 random_ = random_of_new_seed();
};

// Doubles are searched as floats where no coordinate exceeds 2^16 smallest radii. Pairs whose gap is a small
// part of their radii, at all distances from the origin.
TEST_F(SparseTest, DoublesThatNearlyTouchAsByBruteForce) {
  for (int k = 0; k < 6; k++) {
    TestScene s;
    for (int n = 0; n < 1500; n++) {
      const double far = std::exp2(15.9 * std::abs(unit())), spread = k % 2 ? 0 : 2,
                   gap = std::copysign(std::exp2(-8 - 40 * std::abs(unit())), unit());
      const Sphere a{far * unit(), far * unit(), far * unit(), 1 + spread * std::abs(unit())};
      const double d[3] = {unit(), unit(), unit()}, r = 1 + spread * std::abs(unit()),
                   t = (a.r + r) * (1 + gap) / std::hypot(d[0], d[1], d[2]);
      s.spheres.push_back(a);
      s.spheres.push_back({a.x + t * d[0], a.y + t * d[1], a.z + t * d[2], r});
    }
    Detector d({BackendKind::cuda}, {.order = k < 3 ? Order::stable : Order::any});
    const Arranged input(s, Scalar::f64);
    const Contacts& c = d.detect(input.input);
    ASSERT_EQ(sorted({c.pairs, c.count}), brute_force(s)) << "scene " << k;
  }
}
TEST_F(SparseTest, EqualRadiiAsByBruteForce) {
  for (int k = 0; k < 12; k++) expect_brute_force(1, k % 3 ? Scalar::f32 : Scalar::f64);
}
TEST_F(SparseTest, UnequalRadiiAsByBruteForce) {
  for (int k = 0; k < 12; k++) expect_brute_force(k % 2 ? 3 : 100, k % 3 ? Scalar::f32 : Scalar::f64);
}
TEST_F(SparseTest, LargeScenesAsByTheProcessor) {
  for (const double ratio : {1.0, 3.0, 10.0})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
      expect_processor(100'000, ratio, scalar);
      expect_processor(300'000, ratio, scalar);
    }
}

// Levels whose bounds lie apart do not search each other; heaps that come near do.
TEST_F(SparseTest, HeapsOfTwoSizesAsTheyComeNear) {
  for (const std::uint32_t n : {2'000u, 200'000u})
    for (const Order order : {Order::any, Order::stable}) {
      Detector cpu({BackendKind::omp}), gpu({BackendKind::cuda}, {.order = order});
      const double edge = std::cbrt(6.0 * n);
      for (const double gap : {1e5, 200.0, 60.0, 30.0, -10.0, 1e4}) {
        TestScene s;
        for (std::uint32_t k = 0; k < n; k++) {
          const double x = edge * std::abs(unit()), y = edge * std::abs(unit()), z = edge * std::abs(unit());
          if (k % 2)
            s.spheres.push_back({x, y, z, 1 + 0.4 * std::abs(unit())});
          else
            s.spheres.push_back({edge + gap + 37 * x, 37 * y, 37 * z, 37 + 4 * std::abs(unit())});
        }
        ASSERT_NO_FATAL_FAILURE(expect_same(s, Scalar::f32, gpu, cpu)) << "gap " << gap;
      }
    }
}

// Grains on the surface of balls of one size and of two: the grains search the balls, among few spheres and
// in the fused search of many.
TEST_F(SparseTest, GrainsOnLargeBallsAsByTheProcessor) {
  for (const std::uint32_t balls : {20u, 200u})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
      TestScene s;
      const double edge = 200 * std::cbrt(balls);
      for (std::uint32_t k = 0; k < balls; k++) {
        const Sphere b{edge * unit(), edge * unit(), edge * unit(), k % 3 ? 100.0 : 12.0};
        s.spheres.push_back(b);
        for (int g = 0; g < 999; g++) {
          const double r = 1 + 0.4 * unit();
          s.spheres.push_back(grain_on(b, r, r * (1 - 0.1 * unit()), random_));
        }
      }
      expect_processor(s, scalar);
    }
}

// Unequal spheres in a plane across each axis, whose finest level is hashed and one bin thick: at the origin,
// a hair below a face of bins, and in a bin far away. They move off it between the calls.
TEST_F(SparseTest, UnequalSpheresInAPlaneAsByTheProcessor) {
  for (const std::uint32_t n : {6'000u, 200'000u})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64})
      for (const double height : {0.0, -1e-20, 4e5})
        for (int across = 0; across < 3; across++) {
          TestScene s;
          const double edge = std::sqrt(60.0 * n) / 2;
          while (s.spheres.size() < n) {
            const double u = edge * unit(), v = edge * unit(),
                         r = std::min(100.0, std::pow(1 - std::abs(unit()), -1 / 2.4));
            s.spheres.push_back(across == 0   ? Sphere{height, u, v, r}
                                : across == 1 ? Sphere{u, height, v, r}
                                              : Sphere{u, v, height, r});
          }
          ASSERT_NO_FATAL_FAILURE(expect_processor(s, scalar))
              << n << " at " << height << " across " << across;
        }
}

// A plane on a face of bins, whose spheres go to both sides of it and come back: their buckets hold twice as
// many then as in the call before.
TEST_F(SparseTest, PlanesThatComeBackToAFaceAsByTheProcessor) {
  constexpr std::uint32_t n = 300'000;
  for (const double ratio : {1.0, 10.0}) {
    TestScene flat;
    const double edge = std::sqrt((1 + ratio) * n) / 2;
    while (flat.spheres.size() < n)
      flat.spheres.push_back(
          {edge * unit(), edge * unit(), 0, std::pow(ratio, std::pow(std::abs(unit()), 8))});
    TestScene away = flat;
    move(away, 0.02);
    for (const Order order : {Order::any, Order::stable}) {
      Detector cpu({BackendKind::omp}), gpu({BackendKind::cuda}, {.order = order});
      for (int call = 0; call < 8; call++) {
        ASSERT_NO_FATAL_FAILURE(expect_same(call % 4 == 3 ? flat : away, Scalar::f32, gpu, cpu)) << call;
      }
    }
  }
}

// Everything in a few bins that share buckets with others far away: places repeat each 256 bins in fixed
// point.
TEST_F(SparseTest, PlacesThatRepeatAreToldApart) {
  for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
    TestScene s;
    for (int k = 0; k < 3000; k++)
      s.spheres.push_back({513.0 * below(300), 513.0 * below(300), 513.0 * below(300), 1});
    for (int k = 0; k < 200; k++) s.spheres.push_back({0.7 * k, 0.2 * k, 0.1 * k, 1});
    const TestScene given = s.rounded();
    const Arranged input(given, scalar);
    for (const Order order : {Order::any, Order::stable}) {
      Detector d({BackendKind::cuda}, {.order = order});
      const Contacts& c = d.detect(input.input);
      ASSERT_EQ(sorted({c.pairs, c.count}), brute_force(given));
    }
  }
}

}  // namespace
}  // namespace padder::detect
