// SPDX-License-Identifier: MIT
// Every backend, path, precision and kind of input against brute force in double.
#include "detect/detector.h"

#include <chrono>
#include <functional>
#include <random>

#include "detect/core/nine_stages.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

struct Case {
  BackendKind backend;
  Path path;
  Precision precision;
  Scalar input;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << name_of(c.backend) << ' ' << name_of(c.path) << ' ' << name_of(c.precision) << ' '
       << name_of(c.input);
}
// The nine stages are exact.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const BackendKind backend : {BackendKind::omp, BackendKind::cuda})
    for (const Scalar input : {Scalar::f32, Scalar::f64}) {
      for (const Precision precision : {Precision::exact, Precision::float32})
        all.push_back({backend, Path::grid, precision, input});
      all.push_back({backend, Path::nine_stages, Precision::exact, input});
    }
  return all;
}

class DetectorTest : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    skip_without(GetParam().backend);
    device_.backend = GetParam().backend;
    options_.path = GetParam().path, options_.precision = GetParam().precision;
  }

  // One for all scenes of a test: memory is used again.
  Detector& detector() {
    if (!detector_) detector_ = std::make_unique<Detector>(device_, options_);
    return *detector_;
  }

  // The scene's contacts are those of brute force; in fast precision up to the doubtful ones.
  void expect_right(const TestScene& given, const std::string& what) {
    SCOPED_TRACE(what);
    const TestScene scene = GetParam().input == Scalar::f32 ? given.rounded() : given;
    const Arranged a(scene, GetParam().input);
    detector().options().threads = scene.spheres.size() < 1000 ? 1 : 2;
    const Contacts& c = detector().detect(a.input);
    ASSERT_EQ(c.spheres, scene.spheres.size());
    const std::vector<Pair> found = sorted(c.pair_span()), wanted = brute_force(scene);
    for (const Pair& p : found) ASSERT_LT(p.i, p.j);
    for (std::size_t k = 1; k < found.size(); k++) ASSERT_NE(found[k - 1], found[k]) << "reported twice";
    if (options_.precision == Precision::exact) {
      ASSERT_EQ(found.size(), wanted.size());
      ASSERT_EQ(found, wanted);
      ASSERT_EQ(detector().hash(), hash_of(wanted));
    } else {
      std::vector<Pair> differ;
      std::set_symmetric_difference(found.begin(), found.end(), wanted.begin(), wanted.end(),
                                    std::back_inserter(differ), before);
      ASSERT_LE(differ.size(), c.doubtful);
    }
    check_records(c, scene);
  }

  void check_records(const Contacts& c, const TestScene& scene) {
    if (options_.width == Width::pairs || options_.scalar != Scalar::f32) return;
    ASSERT_EQ(c.normal_span<float>().size(), c.count);
    for (std::uint64_t k = 0; k < c.count; k++) {
      expect_record(scene.spheres[c.pairs[k].i], scene.spheres[c.pairs[k].j], c.normal_span<float>()[k]);
      if (HasFatalFailure()) return;
    }
  }

  void expect_error(const TestScene& scene, const std::string& part) {
    const Arranged a(scene, GetParam().input);
    EXPECT_TRUE(refuses([&] { detector().detect(a.input); }, part));
  }

  DeviceChoice device_;
  CallOptions options_;
  std::unique_ptr<Detector> detector_;
};

TEST_P(DetectorTest, RandomScenes) {
  std::mt19937_64 random = random_of_new_seed();
  SomeCases some;
  for (const std::uint32_t n : {0u, 1u, 2u, 3u, 17u, 300u, 2000u, 5000u})
    for (const double ratio : {1.0, 4.0, 100.0})
      for (const double room : {0.05, 0.6, 40.0}) {
        if (some.left_out() || (n == 5000 && (ratio != 4 || room == 0.05))) continue;
        const auto seed = static_cast<std::uint32_t>(random());
        expect_right(random_scene(n, ratio, room, seed),
                     "n " + std::to_string(n) + " ratio " + std::to_string(ratio) + " room " +
                         std::to_string(room) + " seed " + std::to_string(seed));
        if (HasFatalFailure()) return;
      }
}

// Two spheres in all kinds of relation.
struct NamedPair {
  const char* name;
  Sphere a, b;
};
const std::vector<NamedPair>& named_pairs() {
  static const std::vector<NamedPair> pairs = {
      {"disjoint", {0, 0, 0, 1}, {3, 0, 0, 1}},
      {"exactly touching along x", {0, 0, 0, 1}, {2, 0, 0, 1}},
      {"exactly touching, 3-4-5", {0, 0, 0, 2}, {3, 4, 0, 3}},
      {"exactly touching, unequal", {1, 1, 1, 0.25}, {1, 1, 2.5, 1.25}},
      {"apart by one ulp", {0, 0, 0, 1}, {std::nextafterf(2, 3), 0, 0, 1}},
      {"overlapping by one ulp", {0, 0, 0, 1}, {std::nextafterf(2, 1), 0, 0, 1}},
      {"overlapping", {0, 0, 0, 1}, {1, 1, 0.5, 1}},
      {"contained", {0, 0, 0, 4}, {1, 0.5, 0, 1}},
      {"contained, touching inside", {0, 0, 0, 4}, {3, 0, 0, 1}},
      {"concentric", {1, 2, 3, 2}, {1, 2, 3, 0.5}},
      {"alike", {1, 2, 3, 2}, {1, 2, 3, 2}},
      {"two points in one place", {1, 2, 3, 0}, {1, 2, 3, 0}},
      {"two points apart", {1, 2, 3, 0}, {1, 2, 3.5, 0}},
      {"a point on a sphere", {0, 0, 0, 1}, {1, 0, 0, 0}},
      {"a point off a sphere", {0, 0, 0, 1}, {1.0001, 0, 0, 0}},
      {"midpoint on a bin face", {3, 1, 1, 1}, {5, 1, 1, 1}},
      {"midpoint on a bin edge", {3, 3, 1, 1.5}, {5, 5, 1, 1.5}},
      {"midpoint on a bin corner", {3, 3, 3, 2}, {5, 5, 5, 2}},
      {"across the origin", {-0.5, -0.5, -0.5, 1}, {0.5, 0.5, 0.5, 1}},
      {"large beside small", {0, 0, 0, 1000}, {1000.05, 0, 0, 0.1}},
  };
  return pairs;
}

// Each alone, so that the bins are of its own size.
TEST_P(DetectorTest, PairsByName) {
  SomeCases some;
  for (const NamedPair& p : named_pairs())
    for (const double shift : {0.0, 1.0, -2.0, 100.0, 0.3}) {
      if (some.left_out()) continue;
      TestScene s{{p.a, p.b}, {}, {}};
      s.shift(shift);
      expect_right(s, std::string(p.name) + " shift " + std::to_string(shift));
      std::swap(s.spheres[0], s.spheres[1]);
      expect_right(s, std::string(p.name) + ", turned");
    }
}

// All together, 64 apart along y and z, so that no x is rounded, in bins of given sizes and at many places
// relative to the bins; pair k is of spheres 2 k and 2 k + 1.
TEST_P(DetectorTest, PairsByNameInGivenBins) {
  for (const double bin : {2.0, 4.0, 16.0})
    for (const double shift : {0.0, 1.0, -2.0, 100.0, 0.3})
      for (const bool turned : {false, true}) {
        TestScene s;
        int number = 0;
        for (const NamedPair& p : named_pairs()) {
          if (p.a.r > 100) continue;  // bins by the billion in the nine stages
          for (Sphere q : {turned ? p.b : p.a, turned ? p.a : p.b})
            q.y += 64 * (number % 5), q.z += 64 * (number / 5), s.spheres.push_back(q);
          number++;
        }
        s.shift(shift);
        detector().options().bin_size = bin;
        expect_right(s, "bin " + std::to_string(bin) + " shift " + std::to_string(shift));
      }
}

// A lattice of touching spheres: every midpoint lies on a face, edge or corner of a bin, every distance on
// the threshold.
TEST_P(DetectorTest, LatticeOfTouchingSpheres) {
  for (const double bin : {0.0, 2.0, 4.0, 3.0})
    for (const double shift : {0.0, -8.0, 0.5, 1e3}) {
      TestScene moved = lattice(9, 2, 1);
      moved.shift(shift);
      detector_.reset();
      options_.bin_size = bin;
      expect_right(moved, "bin " + std::to_string(bin) + " shift " + std::to_string(shift));
    }
}

// Partners put as close to the threshold as rounding lets them be, on both sides: float alone gets many of
// them wrong.
TEST_P(DetectorTest, OnTheThreshold) {
  for (const double far : {0.0, 1e3, 1e6}) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    TestScene s;
    for (int k = 0; k < 1500; k++) {
      const Sphere a{unit(random) * 200, unit(random) * 200, unit(random) * 200, 0.5 + unit(random)};
      double d[3], length = 0;
      for (double& v : d) v = normal(random), length += v * v;
      const double r = 0.5 + unit(random), t = (a.r + r) * (1 + 1e-15 * normal(random)) / std::sqrt(length);
      s.spheres.push_back(a), s.spheres.push_back({a.x + t * d[0], a.y + t * d[1], a.z + t * d[2], r});
    }
    s.shift(far);
    expect_right(s, "at " + std::to_string(far));
  }
}

TEST_P(DetectorTest, AllAlike) {
  expect_right({std::vector<Sphere>(300, Sphere{1, 2, 3, 0.5}), {}, {}}, "radius 0.5");
  expect_right({std::vector<Sphere>(300, Sphere{0, 0, 0, 0}), {}, {}}, "points at the origin");
  expect_right({std::vector<Sphere>(300, Sphere{1e6, 0, 7, 0}), {}, {}}, "points elsewhere");
}

TEST_P(DetectorTest, AllInOneBin) {
  TestScene s = random_scene(400, 1, 0.5, 3);
  for (Sphere& p : s.spheres) p.r *= 1e-3;
  s.spheres.push_back({0, 0, 0, 50});
  expect_right(s, "one large sphere sets the bins of the nine stages");
  options_.bin_size = 1000, detector_.reset();
  expect_right(s, "one bin for all");
}

// Twenty of them are there twice.
TestScene random_points(std::uint32_t n) {
  TestScene s = random_scene(n, 1, 1, 11);
  for (Sphere& p : s.spheres) p.r = 0;
  for (std::size_t k = 0; k < 20; k++) s.spheres.push_back(s.spheres[k * 7]);
  return s;
}
TEST_P(DetectorTest, PointsOnly) { expect_right(random_points(1000), "points"); }

TEST_P(DetectorTest, RatioOneToTenThousand) {
  TestScene s = random_scene(1500, 1, 30, 5);
  for (std::size_t k = 0; k < s.spheres.size(); k++)
    s.spheres[k].r = std::pow(1e4, static_cast<double>(k % 7) / 6) * 0.01;
  s.spheres.resize(1400);
  expect_right(s, "radii 0.01 to 100");
}

TEST_P(DetectorTest, FarFromTheOrigin) {
  TestScene s = random_scene(800, 2, 0.5, 9);
  s.scale(1e-3);  // millimetre spheres, in metres
  s.shift(1e7);
  expect_right(s, "at 1e7");
  s.shift(1e9);
  expect_right(s, "at 1e9");
  TestScene wide = random_scene(2000, 100, 0.6, 19);  // several levels
  wide.shift(1e7);
  expect_right(wide, "radii 1 to 100 at 1e7");
  wide.shift(1e12);
  if (GetParam().input == Scalar::f64) expect_right(wide, "radii 1 to 100 at 1e12");
}

TEST_P(DetectorTest, OneFarAwaySphere) {
  SomeCases some;
  for (const double far : {1e5, 1e9, 1e30}) {
    if (some.left_out()) continue;
    TestScene s = random_scene(800, 2, 0.5, 10);
    s.spheres.push_back({far, -far, far, 1});
    s.spheres.push_back({far, -far, far, 2});
    expect_right(s, "at " + std::to_string(far));
  }
}

// So far apart that rows are hashed.
TestScene strewn_pairs(int n, double edge) {
  TestScene s;
  std::mt19937_64 random(21);
  std::uniform_real_distribution<double> anywhere(-edge, edge), near(-1.5, 1.5);
  for (int k = 0; k < n; k++) {
    const Sphere a{anywhere(random), anywhere(random), anywhere(random), 1};
    s.spheres.push_back(a);
    s.spheres.push_back({a.x + near(random), a.y + near(random), a.z + near(random), 1});
  }
  return s;
}
// And a chain along the diagonal: bins by the billion, nearly all empty.
TEST_P(DetectorTest, SparseDomains) {
  TestScene chain;
  for (int k = 0; k < 2000; k++) chain.spheres.push_back({1.5 * k, 1.5 * k, -1.5 * k, 1 + 0.5 * (k % 3)});
  expect_right(chain, "a diagonal chain");
  expect_right(strewn_pairs(1000, 1e5), "pairs strewn over 1e15 bins");
}

TEST_P(DetectorTest, TinyAndHuge) {
  for (const double scale : {1e-44, 1e-37, 1e-20, 1e-12, 1e12, 1e18, 1e30}) {
    TestScene s = random_scene(500, 3, 0.3, 13);
    s.scale(scale);
    expect_right(s, "scaled by " + std::to_string(scale));
  }
  if (GetParam().input == Scalar::f32) return;
  for (const double scale : {1e-320, 1e-310, 1e-280, 1e-200, 1e-160, 1e-150, 1e-140, 1e-100, 1e90, 2e97}) {
    TestScene s = random_scene(500, 3, 0.3, 13);
    s.scale(scale);
    if (scale > 1 && options_.width != Width::pairs) {
      expect_error(s, "do not fit a float record");
      options_.width = Width::pairs;
      detector_.reset();
    }
    expect_right(s, "scaled by " + std::to_string(scale));
  }
}

// Wide radii, points, a lattice on the threshold, hashed rows: at sizes where squares underflow. A scene
// times a power of two has the same contacts.
TEST_P(DetectorTest, ScenesOfAnySize) {
  if (GetParam().input == Scalar::f32) return;
  options_.width = Width::pairs;
  for (const TestScene& scene :
       {random_scene(400, 100, 0.3, 14), random_points(300), lattice(7, 2, 1), strewn_pairs(200, 1e4)}) {
    std::uint64_t contacts = 0;
    for (const int exponent : {0, -480, -499, -500, -501, -505, -512, -540, -700, -895, -950, -1060, 310}) {
      TestScene s = scene;
      s.scale(std::ldexp(1.0, exponent));
      expect_right(s, "times 2^" + std::to_string(exponent));
      if (HasFatalFailure()) return;
      const std::uint64_t found = brute_force(s).size();
      if (exponent == 0) contacts = found;
      if (exponent > -950) {
        EXPECT_EQ(found, contacts) << exponent;
      }
    }
  }
}

// Coordinates just below zero, of any size, beside larger spheres that look down: -1e-20 and -5e-324 are in
// one bin.
TEST_P(DetectorTest, JustBelowZero) {
  std::mt19937_64 random(5);
  for (int axis = 0; axis < 3; axis++)
    for (const bool large : {false, true}) {
      TestScene s;
      for (int k = 0; k < 1500; k++) {
        double p[3] = {40 * unit(random), 40 * unit(random), 40 * unit(random)};
        if (k % 20 == 0) p[axis] = k % 40 ? -1e-20 : -5e-324;
        s.spheres.push_back({p[0], p[1], p[2], large && k % 20 && unit(random) < 0.01 ? 12 : 1.2});
      }
      expect_right(s, "axis " + std::to_string(axis) + (large ? " and large ones" : ""));
    }
}

// One ball beyond all others among spheres of many sizes: each is still looked at by few, not by all.
TEST_P(DetectorTest, OneBallBeyondAll) {
  if (GetParam().path == Path::nine_stages) return;  // a bin there is three times the mean
  TestScene s = random_scene(3000, 100, 0.6, 51);
  options_.width = Width::pairs;
  for (const double r : {1e6, 1e15, 1e25}) {
    s.spheres[7].r = r;
    expect_right(s, "radius " + std::to_string(r));
  }
  TestScene many = random_scene(100000, 100, 0.6, 52);
  double seconds[2];
  for (const bool giant : {false, true}) {
    if (giant) many.spheres[7].r = 1e25;
    const Arranged a(many, GetParam().input);
    detector().detect(a.input), detector().options().timings = true;
    seconds[giant] = INFINITY;
    for (int k = 0; k < 3; k++)
      seconds[giant] = std::min(seconds[giant], detector().detect(a.input).seconds.total);
  }
  EXPECT_LT(seconds[1], 10 * seconds[0] + 0.1);
}

// Balls over bins by the hundred million, nearly all empty, and one so far away that by the box of their
// sizes hardly any of them is near a small sphere.
TEST_P(DetectorTest, BallsOverEmptyBins) {
  std::mt19937_64 random(53);
  std::uniform_real_distribution<double> at(-2000, 2000);
  TestScene s;
  for (int k = 0; k < 2030; k++)
    s.spheres.push_back({at(random), at(random), at(random), k % 70 == 0 ? 500.0 + k % 100 : 1});
  s.spheres.push_back({1e9, 0, 0, 600});
  options_.width = Width::pairs;
  const auto begin = std::chrono::steady_clock::now();
  expect_right(s, "thirty balls");
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
            SomeCases::every() > 1 ? 600 : 10);
}

// A row of spheres beside a few balls, and rows 256 of the balls' bins away. There a fixed-point place is
// that of the balls again.
TEST_P(DetectorTest, RowsFarFromAFewBalls) {
  TestScene s;
  for (const double x : {-6e5, 0.0, 6e5}) s.spheres.push_back({x, 700, 0, 1000});
  for (int k = 0; k < 3000; k++)
    s.spheres.push_back({(k % 3 - 1) * 256 * 2002.0 + 0.8 * (k - 1500), 500, 100, 1});
  expect_right(s, "three balls");
}

// Small spheres strewn over fewer than 128 bins along each axis, and larger or distant ones beyond them, side
// by side. In fixed point, modulo 256 bins of the small ones, some of these are beside a small one.
TEST_P(DetectorTest, ThinlyStrewnAndFarAway) {
  if (GetParam().path == Path::nine_stages) return;  // its bins are three times the mean
  SomeCases some;
  std::mt19937_64 random(57);
  std::uniform_real_distribution<double> at(-200, 200), near(-2, 2), radius(1, 2);
  for (const double far : {256.0, 4096.0, 65536.0, 1048576.0, 1e22}) {
    if (some.left_out()) continue;
    TestScene s;
    for (int k = 0; k < 2000; k++)
      s.spheres.push_back({k % 20 ? at(random) : near(random), at(random), at(random), radius(random)});
    for (int k = 0; k < 2000; k += 20) {
      const Sphere& small = s.spheres[static_cast<std::size_t>(k)];
      s.spheres.push_back({-far * 4 * (1 + 0x1p-20), small.y, small.z, far > 1e20 ? 2.0 : 60.0});
    }
    expect_right(s, "at " + std::to_string(far));
  }
}

// Balls whose surface is covered with grains, which nearly touch it or do. `grains`: of each ball.
TestScene dusted(std::uint32_t balls, std::uint32_t grains, double ball, double grain, double far,
                 std::uint32_t seed) {
  std::mt19937_64 random(seed);
  TestScene s;
  for (std::uint32_t k = 0; k < balls; k++) {
    const Sphere b{far * (k & 1 ? 1 : -1) + 40 * ball * signed_unit(random),
                   far * (k & 2 ? 1 : -1) + 40 * ball * signed_unit(random), far * signed_unit(random), ball};
    s.spheres.push_back(b);
    for (std::uint32_t g = 0; g < grains; g++)
      s.spheres.push_back(grain_on(b, grain, grain * (1 - 0.01 * signed_unit(random)), random));
  }
  return s;
}

// Grains on balls a hundred times as large: their bins are too many for an array, and a ball reaches more of
// them than the buckets of a hash tell apart.
TEST_P(DetectorTest, GrainsOnLargeBalls) {
  expect_right(dusted(5, 700, 100, 1, 200, 61), "near the origin");
  expect_right(dusted(5, 700, 100, 1, 1e5, 62), "at 1e5");
}

// Millions of bins from the origin a coordinate over the edge of a bin, with the edge's inverse rounded to
// float, is off by a tenth of a bin. This edge has an inverse that is rounded by nearly as much as can be.
TEST_P(DetectorTest, GrainsOnBallsFarFromTheOrigin) {
  expect_right(dusted(24, 400, 5, 0.9959, 4e6, 63), "4e6 away");
}

// Sizes that have nothing to do with each other in one scene.
TEST_P(DetectorTest, SizesWithoutEnd) {
  if (GetParam().input == Scalar::f32) return;
  options_.width = Width::pairs;
  std::mt19937_64 random(31);
  TestScene s;
  for (int k = 0; k < 600; k++) {
    const double by = std::pow(10.0, -320 * unit(random)), r = by * unit(random);
    s.spheres.push_back(
        {by * signed_unit(random), by * signed_unit(random), by * signed_unit(random), k % 5 ? r : 0});
    s.spheres.push_back({s.spheres.back().x, s.spheres.back().y + 1.2 * r, s.spheres.back().z, r / 3});
  }
  expect_right(s, "1e-320 to 1");
  for (Sphere& p : s.spheres) p.x *= 1e90, p.r *= 1e90;
  expect_right(s, "1e-230 to 1e90");
}

TEST_P(DetectorTest, BadInputIsNamed) {
  TestScene s = random_scene(100, 1, 1, 1);
  const auto with = [&](std::size_t k, Sphere bad) {
    TestScene t = s;
    t.spheres[k] = bad;
    return t;
  };
  expect_error(with(7, {NAN, 0, 0, 1}), "sphere 7 at (nan, 0, 0) with radius 1 is not finite");
  expect_error(with(99, {0, 0, INFINITY, 1}), "sphere 99 ");
  expect_error(with(0, {0, 0, 0, NAN}), "sphere 0 ");
  expect_error(with(3, {0, 0, 0, -0.5}), "sphere 3 at (0, 0, 0) has the negative radius -0.5");
  if (GetParam().input == Scalar::f64)
    expect_error(with(5, {1e101, 0, 0, 1}), "sphere 5 at (1e+101, 0, 0) with radius 1 is beyond 1e100");
  expect_right(s, "usable after errors");
}

TEST_P(DetectorTest, TheListIsFixed) {
  const TestScene s = random_scene(4000, 4, 0.3, 23).rounded();
  const Arranged a(s, GetParam().input);
  options_.width = Width::points;
  std::vector<Pair> first;
  for (const int threads : {1, 2, 3, 7}) {
    options_.threads = threads;
    Detector d(device_, options_);
    for (int again = 0; again < 2; again++) {
      const Contacts& c = d.detect(a.input);
      const std::vector<Pair> list(c.pairs, c.pairs + c.count);
      if (first.empty()) first = list;
      EXPECT_EQ(list, first);
    }
  }
}

// Calls whose spheres are a few more or less than before, or whose margin is another, begin with what the
// call before found. Their lists are those of a new detector, also where many come or go.
TEST_P(DetectorTest, SpheresComeAndGo) {
  if (options_.path == Path::nine_stages) GTEST_SKIP() << "begins anew in each call";
  TestScene equal = random_scene(12'000, 1, 1, 7), unequal = random_scene(12'000, 100, 1, 7), far = equal;
  far.spheres[0].x = 1e12;
  for (const TestScene& given : {equal, unequal, far})
    for (const Order order : {Order::stable, Order::any}) {
      if (order == Order::any && options_.precision != Precision::exact) continue;  // float decides otherwise
      const TestScene s = given.rounded();
      const Arranged a(s, GetParam().input);
      Input in = a.input;
      options_.order = order;
      int call = 0;
      for (const std::size_t less : {0, 1, 3, 3, 40, 39, 300, 900, 1400, 0, 2000, 6000, 6001, 11'990, 0}) {
        in.spheres.count = s.spheres.size() - less;
        options_.margin = call % 3 == 1 ? 0.01 : call % 7 == 2 ? 0.02 : 0;
        detector().options() = options_;
        Detector fresh(device_, options_);
        const auto list = [&](const Contacts& c) {
          return order == Order::any ? sorted(c.pair_span()) : std::vector<Pair>(c.pairs, c.pairs + c.count);
        };
        const std::vector<Pair> found = list(detector().detect(in)), wanted = list(fresh.detect(in));
        EXPECT_TRUE(found == wanted) << "call " << call << ", " << less << " fewer";
        call++;
      }
    }
}

// Faces lie where a sphere begins or ends, where its centre is, or through the midpoint of a contact, and a
// step of double to either side: whether contacts are the box's is then as hard to say as it can be.
TEST_P(DetectorTest, ABoxBetweenSpheresOwnsWhatTheirMidpointsSay) {
  if (options_.precision != Precision::exact) GTEST_SKIP() << "float decides doubtful pairs otherwise";
  std::mt19937_64 random = random_of_new_seed();
  for (const double ratio : {1.0, 1.0, 5.0, 60.0}) {
    TestScene s = random_scene(1200, ratio, 0.3, static_cast<unsigned>(random()));
    const bool far = random() % 2;
    if (far) s.shift(3000);
    s = s.rounded();
    const Arranged a(s, GetParam().input);
    const std::vector<Pair> all = brute_force(s);
    Detector d(device_, options_);
    for (int box = 0; box < 6; box++) {
      Region own;
      for (int c = 0; c < 3; c++) {
        const auto face = [&] {
          const Sphere& at = s.spheres[random() % s.spheres.size()];
          const double places[3] = {at.x, at.y, at.z};
          double v = places[c] + at.r * (static_cast<double>(random() % 3) - 1);
          if (random() % 3 == 0) {
            const Pair& p = all[random() % all.size()];
            const Midpoint m = midpoint(s.spheres[p.i], s.spheres[p.j]);
            v = c == 0 ? m.x : c == 1 ? m.y : m.z;
          }
          return random() % 2 ? v : std::nextafter(v, random() % 2 ? INFINITY : -INFINITY);
        };
        if (random() % 4) own.low[c] = face();
        if (random() % 4) own.high[c] = face();
      }
      std::vector<Pair> wanted;
      for (const Pair& p : all)
        if (owns(own, midpoint(s.spheres[p.i], s.spheres[p.j]))) wanted.push_back(p);
      d.options().own = own;
      ASSERT_EQ(sorted(d.detect(a.input).pair_span()), wanted) << "ratio " << ratio << (far ? ", far" : "");
    }
  }
}

TEST_P(DetectorTest, MemoryIsKeptAndShortageIsASentence) {
  const TestScene s = random_scene(3000, 2, 0.05, 37);
  const Arranged a(s, GetParam().input);
  options_.threads = 1;  // which thread finds how many is not fixed, and so neither is what each keeps
  Detector d(device_, options_);
  const std::uint64_t contacts = d.detect(a.input).count, held = d.memory();
  EXPECT_GT(held, 0u);
  d.detect(a.input);
  EXPECT_EQ(d.memory(), held);
  Detector narrow(device_, options_);
  narrow.options().memory_limit = held / 4;
  EXPECT_TRUE(refuses([&] { narrow.detect(a.input); }, " bytes of "));
  narrow.options().memory_limit = 0;
  EXPECT_EQ(narrow.detect(a.input).count, contacts);
}

// A scene that grows a little in each call does not need new arrays in each.
TEST_P(DetectorTest, MemoryGrowsInSteps) {
  if (GetParam().backend != BackendKind::omp) GTEST_SKIP() << "the steps of the CPU's arrays";
  const TestScene s = random_scene(3000, 2, 0.5, 40);
  Arranged a(s, GetParam().input);
  options_.threads = 1;
  Detector d(device_, options_);
  int changes = 0, calls = 0;
  std::uint64_t held = 0;
  for (a.input.spheres.count = 1000; a.input.spheres.count < 3000; a.input.spheres.count += 20, calls++) {
    d.detect(a.input);
    changes += d.memory() != held, held = d.memory();
  }
  EXPECT_LT(changes, calls / 2);
}

// Whatever threads hold counts, also after they became fewer and the limit lower.
TEST_P(DetectorTest, MemoryStaysBelowItsLimit) {
  const TestScene s = random_scene(3000, 20, 0.05, 38), small = random_scene(50, 1, 0.5, 39);
  const Arranged a(s, GetParam().input), b(small, GetParam().input);
  Detector d(device_, options_);
  std::uint64_t contacts = 0;
  for (const int threads : {1, 2, 5, 9, 17, 3}) {
    d.options().threads = threads;
    contacts = d.detect(a.input).count;
  }
  const std::uint64_t held = d.memory();
  d.options().threads = 1, d.options().memory_limit = 1u << 20;
  for (const Arranged* scene : {&b, &a, &b}) {
    try {
      d.detect(scene->input);
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(" bytes of "), std::string::npos) << e.what();
    }
    EXPECT_LE(d.memory(), d.options().memory_limit);
  }
  d.options().memory_limit = 0;
  EXPECT_EQ(d.detect(a.input).count, contacts);
  if (GetParam().backend == BackendKind::omp) {
    Detector fresh(device_, options_);
    fresh.options().threads = 1;
    fresh.detect(a.input);
    EXPECT_LE(d.memory(), 2 * fresh.memory()) << "held before: " << held;
  }
}

// ---- what is refused, by every entry, and what is left after it

TEST_P(DetectorTest, OptionsThatCannotBeMeantAreRefused) {
  const Arranged a(random_scene(50, 1, 0.1, 1), GetParam().input);
  const auto refused = [&](CallOptions o, const std::string& part) {
    o.path = options_.path;
    Detector d(device_, o);
    EXPECT_TRUE(refuses([&] { d.detect(a.input); }, part));
    EXPECT_TRUE(refuses([&] { d.stages(a.input); }, part)) << "of stages()";
  };
  CallOptions o;
  for (const double size : {-1.0, double(NAN), double(INFINITY), 1e101}) {
    o.bin_size = size;
    refused(o, "the bin size must be 0 (chosen) or a positive length");
  }
  o = {};
  for (const int threads : {-1, 1025, 100000, 2000000000}) {
    o.threads = threads;
    refused(o, "the number of threads must be 0 (chosen) or 1 to 1024, not " + std::to_string(threads));
  }
  for (int k = 0; k < 6; k++) {
    o = {};
    double* const side = k % 2 ? o.own.high : o.own.low;
    side[k / 2] = NAN;
    refused(o, std::string("is not a number along ") + "xyz"[k / 2]);
  }
}

TEST_P(DetectorTest, AsManyThreadsAsMayBeAskedFor) {
  const TestScene s = random_scene(3000, 100, 0.3, 2).rounded();
  const Arranged a(s, GetParam().input);
  Detector one(device_, options_), all(device_, options_);
  one.options().threads = 1, all.options().threads = kMostThreads;
  EXPECT_EQ(all.detect(a.input).count, one.detect(a.input).count);
  EXPECT_EQ(all.hash(), one.hash());
}

TEST_P(DetectorTest, MoreSpheresThanNumbersAreRefused) {
  const Sphere sphere[] = {{0, 0, 0, 1}, {0, 0, 0, 1}};
  const Shape shapes[] = {{sphere, 2}, {sphere, ~std::uint64_t(0) - 1}};
  Body two;
  two.shape = 1;
  const Body bodies[] = {Body{}, two};
  Detector d(device_, options_);
  Arranged a({{{1, 2, 3, 4}}, {}, {}}, GetParam().input);
  const auto refused = [&](const char* part) { EXPECT_TRUE(refuses([&] { d.detect(a.input); }, part)); };
  a.input.spheres.count = 0xffffffff;
  refused("4294967295 spheres are more than one detector can number");
  a.input.spheres.count = ~std::uint64_t(0);
  refused("2^64 - 1 or more spheres");
  a.input.shapes = shapes, a.input.bodies = {bodies, 1};
  refused("2^64 - 1 or more spheres");
  a.input.spheres.count = 0, a.input.bodies = bodies;
  refused("2^64 - 1 or more spheres");
}

TEST_P(DetectorTest, ACallThatThrewLeavesNoContacts) {
  const TestScene s = random_scene(100, 1, 0.1, 1);
  const Arranged a(s, GetParam().input), bad({{{NAN, 0, 0, 1}}, {}, {}}, GetParam().input);
  Detector d(device_, options_);
  EXPECT_EQ(d.hash(), 0u) << "before the first call";
  for (int how = 0; how < 3; how++) {
    const Contacts& c = d.detect(a.input);
    ASSERT_GT(c.count, 0u);
    ASSERT_NE(d.hash(), 0u);
    if (how == 0) {
      EXPECT_THROW(d.detect(bad.input), Error);
    }
    if (how == 1) {
      d.options().bin_size = -1;
      EXPECT_THROW(d.detect(a.input), Error);
      d.options().bin_size = 0;
    }
    if (how == 2) d.stages(a.input);
    EXPECT_EQ(d.hash(), 0u) << how;
    EXPECT_EQ(c.count, 0u) << how;
  }
}

TEST_P(DetectorTest, AMovedFromDetectorSaysSo) {
  const TestScene s = random_scene(100, 1, 0.1, 1);
  const Arranged a(s, GetParam().input);
  Detector d(device_, options_);
  d.detect(a.input);
  const std::uint64_t hash = d.hash();
  Detector other(std::move(d));
  EXPECT_EQ(other.hash(), hash);
  EXPECT_GT(other.memory(), 0u);
  EXPECT_EQ(d.memory(), 0u);
  for (const auto& call : std::initializer_list<std::function<void()>>{
           [&] { d.detect(a.input); }, [&] { d.stages(a.input); }, [&] { d.hash(); }, [&] { d.backend(); }})
    EXPECT_TRUE(refuses(call, "was moved to another"));
  d.options().threads = 1;
  d = Detector(device_, options_);
  d.detect(a.input);
  EXPECT_EQ(d.hash(), hash);
}

INSTANTIATE_TEST_SUITE_P(Matrix, DetectorTest, testing::ValuesIn(cases()), name_in_one_word<Case>);

}  // namespace
}  // namespace padder::detect
