// SPDX-License-Identifier: MIT
// Crowded spheres on the GPU: at one point, towards a cusp, on a plane, beside each other in bins that are
// full, in a heap of small ones. Rows of bins that are long are deferred (detect/cuda/search/long_rows.h).
// The contacts are those of the processor, and a stable list is the same in each call, whatever the detector
// did before.
#include <cstring>

#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

class LongRows : public GpuTest {
 protected:
  double unit() { return signed_unit(random_); }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }

  // Of this radius, `far` from a point; on a disc about it where `flat`.
  Sphere about(const double (&at)[3], double far, bool flat, double radius) {
    const double turn = 3.14159265 * unit(), z = unit(), across = far * std::sqrt(1 - z * z);
    return {at[0] + across * std::cos(turn), at[1] + across * std::sin(turn), at[2] + (flat ? 0 : far * z),
            radius};
  }
  // Some `crowds` of some hundred spheres each, among `n` others of radii 1 to `ratio`.
  TestScene scene(std::uint32_t n, std::uint32_t crowds, double ratio) {
    TestScene s;
    const auto radius = [&] { return std::pow(ratio, std::pow(std::abs(unit()), 3)); };
    const double wide = 1.6 * std::cbrt(n);
    for (std::uint32_t k = 0; k < n; k++)
      s.spheres.push_back({wide * unit(), wide * unit(), wide * unit(), radius()});
    for (std::uint32_t c = 0; c < crowds; c++) {
      const double at[3] = {wide * unit(), wide * unit(), wide * unit()}, r = radius();
      const std::uint32_t kind = below(4), count = 60 + below(800);
      for (std::uint32_t k = 0; k < count; k++) {
        const double far = kind == 0 ? 0 : 3 * std::pow(std::abs(unit()), kind == 1 ? 3 : 1);
        s.spheres.push_back(about(at, far, kind == 2, kind == 3 ? radius() : r));
      }
    }
    std::shuffle(s.spheres.begin(), s.spheres.end(), random_);
    return s;
  }

  void expect_lists(TestScene s, Scalar scalar, const CallOptions& options) {
    CallOptions any = options, stable = options, pairs = options;
    any.order = Order::any, stable.order = Order::stable, pairs.width = Width::pairs;
    Detector cpu({BackendKind::omp}, pairs), gpu_any({BackendKind::cuda}, any),
        gpu_stable({BackendKind::cuda}, stable);
    const auto n = static_cast<std::uint32_t>(s.spheres.size());
    for (int scenes = 0; scenes < 3; scenes++) {
      if (scenes > 0)  // as many other spheres: first with more crowds, then with none
        s = scene(n, scenes == 1 ? 12 : 0, 2), s.spheres.resize(n);
      const TestScene given = scalar == Scalar::f32 ? s.rounded() : s;
      const Arranged input(given, scalar);
      const std::uint64_t count = cpu.detect(input.input).count;
      std::vector<Pair> list;
      for (int call = 0; call < 4; call++) {
        ASSERT_EQ(gpu_any.detect(input.input).count, count) << "call " << call;
        ASSERT_EQ(gpu_any.hash(), cpu.hash()) << "call " << call;
        Detector fresh({BackendKind::cuda}, stable);
        Detector& d = call == 1 ? fresh : gpu_stable;
        const Contacts& c = d.detect(input.input);
        ASSERT_EQ(c.count, count) << "call " << call;
        ASSERT_EQ(d.hash(), cpu.hash()) << "call " << call;
        if (call == 0) list.assign(c.pairs, c.pairs + c.count);
        ASSERT_EQ(std::memcmp(c.pairs, list.data(), c.count * sizeof(Pair)), 0) << "call " << call;
      }
    }
  }

  std::mt19937_64 random_ = random_of_new_seed();
};

TEST_F(LongRows, BruteForce) {
  for (int k = 0; k < 6; k++) {
    const TestScene s = scene(500 + below(1500), 1 + below(3), k % 2 ? 20 : 1);
    for (const Order order : {Order::any, Order::stable}) {
      Detector d({BackendKind::cuda}, {.order = order});
      const Arranged input(s, Scalar::f64);
      const std::vector<Pair> expected = brute_force(s);
      for (int call = 0; call < 3; call++) {
        const Contacts& c = d.detect(input.input);
        ASSERT_EQ(sorted({c.pairs, c.count}), expected) << "call " << call;
      }
    }
  }
}

TEST_F(LongRows, FewSpheres) {
  for (const Scalar scalar : {Scalar::f32, Scalar::f64})
    for (const double ratio : {1.0, 3.0, 50.0}) expect_lists(scene(20'000, 4, ratio), scalar, {});
}
TEST_F(LongRows, LargeScenes) {
  for (const Scalar scalar : {Scalar::f32, Scalar::f64})
    for (const double ratio : {1.0, 50.0}) expect_lists(scene(310'000, 6, ratio), scalar, {});
}
TEST_F(LongRows, FiltersARegionAndAMargin) {
  for (const double ratio : {1.0, 30.0}) {
    TestScene s = scene(20'000, 4, ratio);
    expect_lists(s, Scalar::f32, {.margin = 0.1});
    expect_lists(s, Scalar::f64, {.own = {{-20, -10, -30}, {30, 40, 3}}});
    for (std::size_t k = 0; k < s.spheres.size(); k++) s.family.push_back(below(4));
    expect_lists(s, Scalar::f32, {});
  }
}
// Doubles far from the origin go to the slots of fixed point.
TEST_F(LongRows, FixedPoint) {
  for (const double ratio : {1.0, 30.0}) {
    TestScene s = scene(20'000, 4, ratio);
    for (Sphere& p : s.spheres) p.x += 1e7, p.z -= 3e6;
    expect_lists(s, Scalar::f64, {});
  }
}
// One sphere that reaches all others, and a cusp of so many that all rows about it are long.
TEST_F(LongRows, AGiantAndACusp) {
  TestScene s;
  for (int k = 0; k < 8000; k++) {
    const double far = 40 * std::pow(std::abs(unit()), 2), radius = 0.25 + 0.2 * std::abs(unit());
    s.spheres.push_back(about({0, 0, 0}, far, false, radius));
  }
  s.spheres.push_back({5, 5, 5, 80});
  expect_lists(s, Scalar::f32, {});
  expect_lists(s, Scalar::f64, {});
}
// Small spheres in a heap, and strewn among large ones: their bounds alone would put all in one level
// (Summary::near). Units of the heap find more than their queues hold.
TEST_F(LongRows, AHeapAmongBoulders) {
  for (const std::uint32_t n : {20'000u, 200'000u})
    for (const double ratio : {8.0, 100.0}) {
      TestScene s;
      const double wide = 3 * ratio * std::cbrt(n);
      for (std::uint32_t k = 0; k < n; k++) {
        const double edge = k < n / 2 ? 1.5 * std::cbrt(n) : wide;
        s.spheres.push_back({edge * unit(), edge * unit(), edge * unit(), k > 3 * n / 4 ? ratio : 1});
      }
      std::shuffle(s.spheres.begin(), s.spheres.end(), random_);
      expect_lists(s, Scalar::f32, {});
      if (n < 100'000) expect_lists(s, Scalar::f64, {});
    }
}

// A list of the parts of these rows would be longer than kMostRowParts.
TEST_F(LongRows, AllInOneBin) {
  TestScene s = scene(75'000, 1, 1);
  const Arranged input(s, Scalar::f32);
  Detector cpu({BackendKind::omp}, {});
  const std::uint64_t count = cpu.detect(input.input).count;
  Detector d({BackendKind::cuda}, {.bin_size = 1000});
  for (const Order order : {Order::any, Order::stable})
    for (int call = 0; call < 2; call++) {
      d.options().order = order;
      ASSERT_EQ(d.detect(input.input).count, count) << "call " << call;
      ASSERT_EQ(d.hash(), cpu.hash()) << "call " << call;
    }
}

}  // namespace
}  // namespace padder::detect
