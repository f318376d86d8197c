// SPDX-License-Identifier: MIT
// What only scenes of a million spheres reach: the other ways of ordering, graphs, the bins of the call
// before. The answer is that of the OpenMP backend.
#include <cuda_runtime_api.h>

#include <utility>

#include "detect/core/input.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"

namespace padder::detect {
namespace {

class CudaTest : public GpuTest {
 protected:
  void expect_levels_agree(std::uint64_t n);
  void expect_right_between_faults(std::uint64_t n);
  void expect_one_order(const char* name, std::uint64_t n);

  // Centers and radii in two arrays.
  struct TwoArrays {
    std::vector<float> centers, radii;
    Input input(const std::vector<FloatSphere>& spheres) {
      centers.clear(), radii.clear();
      for (const FloatSphere& s : spheres)
        centers.insert(centers.end(), {s.x, s.y, s.z}), radii.push_back(s.r);
      return {.spheres = spheres_of(spheres.size(), centers.data(), radii.data())};
    }
  };

  // Some of the records are those of the spheres as they were given.
  static void expect_records(const Input& input, const Contacts& c) {
    const std::span<const Normal<float>> normals = c.normal_span<float>();
    const std::span<const Points<float>> points = c.point_span<float>();
    for (std::uint64_t k = 0; k < normals.size() && !HasFatalFailure(); k += 7) {
      const Sphere a = loose_at(input.spheres, c.pairs[k].i), b = loose_at(input.spheres, c.pairs[k].j);
      const Normal<float>& n = normals[k];
      expect_record(a, b, n);
      if (points.empty()) continue;
      const double on_a = a.x + a.r * n.x, on_b = b.z - b.r * n.z;
      ASSERT_NEAR(points[k].on_i[0], on_a, 1.2e-7 * (std::abs(on_a) + a.r));
      ASSERT_NEAR(points[k].on_j[2], on_b, 1.2e-7 * (std::abs(on_b) + b.r));
    }
  }

  void expect_same_order(const char* name, std::uint64_t n) {
    const auto spheres = generate(name, n);
    std::vector<Pair> first;
    std::vector<Normal<float>> normals;
    Detector d({BackendKind::cuda}, gpu_);
    SomeCases some;
    for (int run = 0; run < 20; run++) {
      if (some.left_out()) continue;
      Detector fresh({BackendKind::cuda}, gpu_);
      const Contacts& c = (run % 5 == 0 ? fresh : d).detect(input_of(spheres));
      if (first.empty()) {
        first.assign(c.pairs, c.pairs + c.count);
        normals.assign(c.normal_span<float>().begin(), c.normal_span<float>().end());
      }
      ASSERT_EQ(c.count, first.size());
      ASSERT_EQ(std::memcmp(c.pairs, first.data(), c.count * sizeof(Pair)), 0) << "run " << run;
      ASSERT_EQ(std::memcmp(c.normals, normals.data(), c.count * sizeof(Normal<float>)), 0) << "run " << run;
    }
  }

  // Bodies first: the same list, bit by bit, from each run, as a graph and alone; the pairs are those of the
  // CPU that expands every body.
  void expect_bodies_agree(std::uint32_t bodies, std::uint64_t grains) {
    BodyScene scene = generate_bodies(bodies);
    const Shape shapes[] = {{scene.shape.data(), scene.shape.size()}};
    const auto loose = generate("dilute", grains);
    Input input = input_of(loose);
    input.shapes = shapes, input.bodies = scene.bodies;
    cpu_.bodies = Bodies::expanded, gpu_.bodies = Bodies::first;
    for (const bool some_static : {false, true}) {
      for (std::size_t b = 0; b < scene.bodies.size(); b++) scene.bodies[b].is_static = some_static && b % 3;
      gpu_.order = Order::stable;
      Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
      const std::uint64_t count = cpu.detect(input).count;
      std::vector<Pair> first;
      for (int run = 0; run < 20; run++) {
        input.revision = run < 15 ? 1 : 0;
        Detector fresh({BackendKind::cuda}, gpu_);
        const Contacts& c = (run % 7 == 6 ? fresh : gpu).detect(input);
        ASSERT_EQ(c.count, count) << "run " << run;
        if (first.empty()) {
          EXPECT_EQ(gpu.hash(), cpu.hash());
          first.assign(c.pairs, c.pairs + c.count);
        }
        ASSERT_EQ(std::memcmp(c.pairs, first.data(), count * sizeof(Pair)), 0) << "run " << run;
      }
      gpu.options().order = Order::any;
      EXPECT_EQ(gpu.detect(input).count, count);
      EXPECT_EQ(gpu.hash(), cpu.hash());
    }
  }

  CallOptions cpu_{.width = Width::pairs}, gpu_;
};

TEST_F(CudaTest, LargeScenesAgree) {
  Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
  for (const char* name : {"dense", "dilute", "poly35", "poly100"})
    for (const bool random_order : {true, false}) {
      const auto spheres = generate(name, 1'100'000, random_order);
      const Input input = input_of(spheres);
      const std::uint64_t count = cpu.detect(input).count, hash = cpu.hash();
      for (int again = 0; again < 4;
           again++) {  // alone, with the bins of the call before, recorded, as a graph
        EXPECT_EQ(gpu.detect(input).count, count) << name << " call " << again;
        EXPECT_EQ(gpu.hash(), hash) << name << " call " << again;
      }
    }
}

// With a margin and without, in floats and in doubles near the origin and far from it, and one sphere so far
// away that no bins in float hold it: by each family of kernels.
TEST_F(CudaTest, LargeScenesAgreeWithAMargin) {
  Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
  for (const char* name : {"dense", "dilute", "poly35", "poly100"})
    for (const std::uint64_t n : {60'000, 300'000})
      for (const double far : {0.0, 2e3, 1e9, 1e12}) {
        const auto spheres = generate(name, n);
        std::vector<Sphere> doubles;
        for (const FloatSphere& s : spheres) doubles.push_back({s.x + 0x1p-30 * s.y, s.y, s.z, s.r});
        if (far > 1e10)
          doubles[0].x = far;
        else
          for (Sphere& s : doubles) s.x += far;
        std::vector<Input> inputs{input_of(doubles)};
        if (far == 0) inputs.push_back(input_of(spheres));
        for (const Input& in : inputs)
          for (const double margin : {0.0, 0.2, 1.5}) {
            cpu.options().margin = gpu.options().margin = margin;
            const std::uint64_t count = cpu.detect(in).count, hash = cpu.hash();
            for (int again = 0; again < 3; again++) {
              SCOPED_TRACE(std::string(name) + " " + std::to_string(n) + " at " + std::to_string(far) +
                           " margin " + std::to_string(margin) + " call " + std::to_string(again));
              gpu.options().order = again == 2 ? Order::any : Order::stable;
              const Contacts& found = gpu.detect(in);
              ASSERT_EQ(found.count, count);
              ASSERT_EQ(gpu.hash(), hash);
              expect_records(in, found);
              if (HasFailure()) return;
            }
          }
      }
}

// What is named Large is left out under racecheck, where it takes an hour; the same is done there in little.
TEST_F(CudaTest, TheOrderIsTheSameInTwentyRuns) { expect_same_order("poly35", 30'000); }
// Too many for tiles that wait for each other: of one level, of several.
TEST_F(CudaTest, TheOrderIsTheSameInTwentyRunsOfMore) {
  expect_same_order("poly35", 140'000);
  expect_same_order("poly100", 140'000);
}
TEST_F(CudaTest, TheOrderIsTheSameInTwentyLargeRuns) {
  expect_same_order("poly35", 1'100'000);
  expect_same_order("poly100", 1'100'000);
}

// A detector that has seen another scene answers as a fresh one does, in the same order.
TEST_F(CudaTest, WhatWasDetectedBeforeDoesNotMatter) {
  auto spheres = generate("dense", 20'000);
  Detector d({BackendKind::cuda}, gpu_);
  for (int step = 0; step < 12; step++) {
    for (std::size_t k = 0; k < spheres.size(); k++) spheres[k].x += step % 3 == 0 ? 3.f : 0.01f;
    if (step == 7) spheres[5].x = 500;
    if (step == 8) spheres[6].r = 2;
    if (step == 9) spheres[6].r = 30;
    Detector fresh({BackendKind::cuda}, gpu_);
    const Contacts &a = d.detect(input_of(spheres)), &b = fresh.detect(input_of(spheres));
    ASSERT_EQ(a.count, b.count) << "step " << step;
    ASSERT_EQ(std::memcmp(a.pairs, b.pairs, a.count * sizeof(Pair)), 0) << "step " << step;
  }
}

// So does one whose doubles travel, of which floats are made relative to an origin near the scene.
// The same where some come and go between calls: buckets then have the room that others needed.
TEST_F(CudaTest, SpheresThatComeAndGoDoNotMatter) {
  for (const char* name : {"dense", "poly100"}) {
    const auto spheres = generate(name, 400'000);
    for (const Order order : {Order::stable, Order::any}) {
      gpu_.order = order;
      Detector d({BackendKind::cuda}, gpu_);
      SomeCases some;
      for (const std::size_t less :
           {0, 0, 1, 400, 2, 2, 390, 12'000, 11'900, 36'000, 0, 48'000, 100, 0, 90'000, 89'000, 89'000}) {
        Input in = input_of(spheres);
        in.spheres.count -= less;
        const Contacts& c = d.detect(in);
        if (some.left_out()) continue;
        Detector fresh({BackendKind::cuda}, gpu_);
        const Contacts& wanted = fresh.detect(in);
        ASSERT_EQ(c.count, wanted.count) << name << ", " << less << " fewer";
        ASSERT_EQ(d.hash(), fresh.hash()) << name << ", " << less << " fewer";
        if (order == Order::stable) {
          ASSERT_TRUE(std::equal(c.pairs, c.pairs + c.count, wanted.pairs))
              << name << ", " << less << " fewer";
        }
      }
    }
  }
}

TEST_F(CudaTest, DoublesThatTravelDoNotMatter) {
  for (const char* name : {"dense", "poly100"})
    for (const double from : {-20.0, 1e7}) {
      std::vector<Sphere> spheres;
      for (const FloatSphere& s : generate(name, 20'000)) spheres.push_back({from + s.x, s.y, s.z, s.r});
      Detector d({BackendKind::cuda}, gpu_);
      for (int step = 0; step < 30; step++) {
        for (std::size_t k = 0; k < spheres.size(); k++)
          spheres[k].x += 0.9 + 1e-3 * static_cast<double>(k % 7), spheres[k].z -= 0.1;
        if (step == 10) spheres[5].y += 5000;
        if (step == 13) spheres[5].y -= 5000;
        Detector fresh({BackendKind::cuda}, gpu_);
        const Contacts &a = d.detect(input_of(spheres)), &b = fresh.detect(input_of(spheres));
        ASSERT_GT(a.count, 5'000u);
        ASSERT_EQ(a.count, b.count) << name << " step " << step;
        ASSERT_EQ(std::memcmp(a.pairs, b.pairs, a.count * sizeof(Pair)), 0) << name << " step " << step;
      }
    }
}

// So does one that has seen doubles which cannot be searched as floats: a sphere was too far away.
TEST_F(CudaTest, DoublesThatWereFarAwayBeforeDoNotMatter) {
  for (const char* name : {"dense", "poly100"}) {
    std::vector<double> centers;
    std::vector<double> radii;
    for (const FloatSphere& s : generate(name, 20'000))
      centers.insert(centers.end(), {s.x + 1e-9, s.y + 1e-9, s.z + 1e-9}), radii.push_back(s.r);
    const Input input{.spheres = spheres_of(radii.size(), centers.data(), radii.data())};
    Detector d({BackendKind::cuda}, gpu_), fresh({BackendKind::cuda}, gpu_);
    const double near = std::exchange(centers[0], 1e9);
    for (int call = 0; call < 2; call++) d.detect(input);
    centers[0] = near;
    const Contacts& b = fresh.detect(input);
    for (int call = 0; call < 2; call++) {
      const Contacts& a = d.detect(input);
      ASSERT_EQ(a.count, b.count) << name << ", call " << call;
      ASSERT_EQ(std::memcmp(a.pairs, b.pairs, a.count * sizeof(Pair)), 0) << name << ", call " << call;
    }
  }
}

// Of doubles in two arrays the radius is fetched once, if it is that of all: not where one of them is the
// same as a float alone, from the first call on or from a later one.
TEST_F(CudaTest, DoublesOfOneRadiusMayBecomeOthers) {
  for (const std::uint64_t n : {3'000, 60'000}) {
    std::vector<double> centers, radii;
    for (const FloatSphere& s : generate("dense", n))
      centers.insert(centers.end(), {s.x + 1e-9, s.y, s.z}), radii.push_back(1 + 0x1p-40);
    // Spheres 6 and 7 touch by less than a float can tell.
    for (int k = 0; k < 3; k++) centers[21 + k] = centers[18 + k] = 2;
    centers[21] += 2 + 0x1p-40;
    const Input input{.spheres = spheres_of(radii.size(), centers.data(), radii.data())};
    cpu_.width = gpu_.width;
    Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
    const auto expect_right = [&](const char* when) {
      const std::uint64_t count = cpu.detect(input).count, hash = cpu.hash();
      ASSERT_GT(count, n / 2);
      for (int call = 0; call < 3; call++) {
        SCOPED_TRACE(std::to_string(n) + " spheres, " + when + ", call " + std::to_string(call));
        const Contacts& found = gpu.detect(input);
        ASSERT_EQ(found.count, count);
        ASSERT_EQ(gpu.hash(), hash);
        ASSERT_NO_FATAL_FAILURE(expect_records(input, found));
      }
    };
    ASSERT_NO_FATAL_FAILURE(expect_right("one radius"));
    radii[7] = 1 - 0x1p-38;
    ASSERT_NO_FATAL_FAILURE(expect_right("one that is another as a double alone"));
    radii[7] = radii[6];
    ASSERT_NO_FATAL_FAILURE(expect_right("one radius again"));
    for (double& r : radii) r = 1 - 0x1p-38;
    ASSERT_NO_FATAL_FAILURE(expect_right("all another as doubles alone"));
  }
}

// One bad or far sphere between good calls of one size: it is refused or found, and the call after it is
// right.
void CudaTest::expect_right_between_faults(std::uint64_t n) {
  for (const auto& [name, apart] : {std::pair("dense", false),
                                    {"dense", true},
                                    {"poly35", false},
                                    {"poly100", false},
                                    {"poly100", true}}) {
    auto spheres = generate(name, n);
    TwoArrays arrays;
    const auto input = [&] { return apart ? arrays.input(spheres) : input_of(spheres); };
    cpu_.width = gpu_.width;  // what a record can hold is refused alike
    Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
    cpu.detect(input_of(spheres));
    const std::uint64_t hash = cpu.hash();
    const auto expect_right = [&](const char* when) {
      gpu.detect(input());
      ASSERT_EQ(gpu.hash(), hash) << name << " " << n << " " << when;
    };
    int step = 0;
    SomeCases some;
    for (const float evil : {NAN, INFINITY, -INFINITY, 3e38f, -3e38f, 1e30f, 1e6f, -1e-42f})
      for (const bool radius : {false, true}) {
        if (some.left_out()) continue;
        for (int good = 0; good <= ++step % 5; good++) expect_right("before");
        float& at = radius ? spheres[n / 2].r : spheres[n / 2].x;
        const float keep = std::exchange(at, evil);
        try {
          const std::uint64_t count = gpu.detect(input()).count;
          ASSERT_EQ(count, cpu.detect(input_of(spheres)).count) << name << " " << n << " " << evil;
          ASSERT_EQ(gpu.hash(), cpu.hash());
        } catch (const Error&) {
          EXPECT_EQ(gpu.hash(), 0u);
          EXPECT_THROW(cpu.detect(input_of(spheres)), Error) << name << " " << n << " " << evil;
        }
        at = keep;
        expect_right("after");
      }
  }
}
// The bounds of spheres in two arrays are gathered by the kernels that put them in order.
TEST_F(CudaTest, TwoArraysThatMove) {
  for (const char* name : {"dense", "poly100"})
    for (const std::uint64_t n : {20'000u, 300'000u})
      for (const Order order : {Order::any, Order::stable}) {
        auto spheres = generate(name, n);
        gpu_.order = order;
        TwoArrays arrays;
        Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
        for (int call = 0; call < 5; call++) {
          ASSERT_EQ(gpu.detect(arrays.input(spheres)).count, cpu.detect(input_of(spheres)).count)
              << name << ' ' << n << ", call " << call;
          ASSERT_EQ(gpu.hash(), cpu.hash()) << name << ' ' << n << ", call " << call;
          for (FloatSphere& s : spheres) s.x += s.r * (0.1f + s.y - std::floor(s.y)), s.z -= 0.2f * s.r;
        }
      }
}
TEST_F(CudaTest, RightBetweenFaults) {
  expect_right_between_faults(1'000), expect_right_between_faults(20'000);
}
TEST_F(CudaTest, LargeScenesAreRightBetweenFaults) {
  expect_right_between_faults(150'000), expect_right_between_faults(300'000);
}

// A list that grows from call to call finds its memory most of the time: pinned memory is dear.
TEST_F(CudaTest, AGrowingListKeepsItsMemory) {
  auto spheres = generate("dense", 20'000);
  Detector gpu({BackendKind::cuda}, gpu_);
  const Pair* last = nullptr;
  int moves = 0;
  for (int call = 0; call < 30; call++) {
    const Contacts& c = gpu.detect(input_of(spheres));
    moves += c.pairs != last, last = c.pairs;
    for (FloatSphere& s : spheres) s.r *= 1.002f;
  }
  EXPECT_LE(moves, 4);
}

// Static bodies stand elsewhere with each new revision, which a graph of the one before must not be launched
// for.
TEST_F(CudaTest, AGraphDoesNotOutliveItsRevision) {
  std::vector<Sphere> ground;
  const std::vector<Sphere> ball{{0, 0, 0, 0.6}};
  for (int x = 0; x < 40; x++)
    for (int y = 0; y < 40; y++) ground.push_back({x * 0.5, y * 0.5, 0, 0.5});
  const Shape shapes[2] = {{ground.data(), ground.size()}, {ball.data(), ball.size()}};
  std::vector<Body> bodies(501);
  bodies[0].is_static = true;
  for (int k = 0; k < 500; k++) {
    Body& b = bodies[static_cast<std::size_t>(k) + 1];
    b.shape = 1, b.position[0] = k % 25 * 3.0 - 5, b.position[1] = k / 25 * 1.0, b.position[2] = 0.7;
  }
  Input input;
  input.shapes = shapes, input.bodies = bodies;
  for (const Order order : {Order::stable, Order::any}) {
    gpu_.bodies = Bodies::first, gpu_.order = order;
    Detector gpu({BackendKind::cuda}, gpu_), cpu({BackendKind::omp}, cpu_);
    for (std::uint64_t revision = 1; revision <= 5; revision++) {
      input.revision = revision, bodies[0].position[0] = static_cast<double>(revision - 1) * 12;
      Input fresh = input;
      fresh.revision = 0;
      const std::uint64_t count = cpu.detect(fresh).count;
      for (int call = 0; call < 5; call++) {
        EXPECT_EQ(gpu.detect(input).count, count) << "revision " << revision << " call " << call;
        EXPECT_EQ(gpu.hash(), cpu.hash());
      }
    }
  }
}

TEST_F(CudaTest, BodiesAgree) { expect_bodies_agree(1'000, 3'000); }
TEST_F(CudaTest, LargePilesOfBodiesAgree) { expect_bodies_agree(20'000, 60'000); }

// Loose spheres and what is static of them in device memory.
TEST_F(CudaTest, StaticOnesInDeviceMemory) {
  const auto spheres = generate("dense", 20'000);
  std::vector<std::uint8_t> is_static;
  for (std::size_t k = 0; k < spheres.size(); k++) is_static.push_back(k % 5 != 0);
  Input host = input_of(spheres), device = host;
  host.spheres.is_static = is_static.data();
  void *memory = nullptr, *flags = nullptr;
  ASSERT_EQ(cudaMalloc(&memory, spheres.size() * sizeof(FloatSphere)), cudaSuccess);
  ASSERT_EQ(cudaMalloc(&flags, spheres.size()), cudaSuccess);
  ASSERT_EQ(cudaMemcpy(memory, spheres.data(), spheres.size() * sizeof(FloatSphere), cudaMemcpyHostToDevice),
            cudaSuccess);
  ASSERT_EQ(cudaMemcpy(flags, is_static.data(), spheres.size(), cudaMemcpyHostToDevice), cudaSuccess);
  device.spheres.centers = memory, device.spheres.radii = static_cast<float*>(memory) + 3;
  device.spheres.memory = Memory::device, device.spheres.is_static = static_cast<std::uint8_t*>(flags);
  device.revision = 3;
  Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
  const std::uint64_t count = cpu.detect(host).count;
  for (int again = 0; again < 4; again++) {
    EXPECT_EQ(gpu.detect(device).count, count);
    EXPECT_EQ(gpu.hash(), cpu.hash());
  }
  cudaFree(memory), cudaFree(flags);
}

// Levels that look down (float and double slots), and sizes so far apart that they look up; few coarse
// spheres, whose level has many empty bins; one sphere that holds all the others.
void CudaTest::expect_levels_agree(std::uint64_t n) {
  const auto expect_same = [&](const Input& input, const char* what) {
    Detector cpu({BackendKind::omp}, cpu_);
    const std::uint64_t count = cpu.detect(input).count;
    EXPECT_GT(count, 0u);
    for (const Order order : {Order::stable, Order::any})
      for (const Width width : {Width::pairs, Width::normals, Width::points}) {
        CallOptions options = gpu_;
        options.order = order, options.width = width;
        Detector gpu({BackendKind::cuda}, options);
        for (int again = 0; again < 3; again++) {
          const Contacts& c = gpu.detect(input);
          EXPECT_EQ(c.count, count) << what;
          EXPECT_EQ(gpu.hash(), cpu.hash()) << what;
          expect_records(input, c);
          if (HasFailure()) return;
        }
      }
  };
  auto spheres = generate("poly100", n);
  std::vector<double> centers, radii;
  for (const FloatSphere& s : spheres) {
    // No floats: records of floats would differ from these.
    for (const float x : {s.x, s.y, s.z}) centers.push_back(x * (1 + 0x1p-24 * std::sin(s.x + 3 * s.y)));
    radii.push_back(s.r);
  }
  Input wide;
  wide.spheres = spheres_of(n, centers.data(), radii.data());
  expect_same(wide, "in double");
  // Many lie near one face: units that look down find more or less there than the mean lets expect.
  auto uneven = spheres;
  float edge = 0;
  for (const FloatSphere& s : spheres) edge = std::max(edge, s.x);
  for (FloatSphere& s : uneven) s.x *= s.x / edge;
  expect_same(input_of(uneven), "uneven");
  spheres[7].r = 3000;
  expect_same(input_of(spheres), "one holds most");
  for (std::size_t k = 0; k < n; k += 100) spheres[k].r = 0.01f;
  expect_same(input_of(spheres), "1 to 300,000");
  spheres = generate("dense", n);
  for (std::size_t k = 0; k < 5; k++) spheres[k * 1000].r = 9;
  expect_same(input_of(spheres), "five coarse ones");
  for (int k = 0; k < 600; k++) {  // more in a row of bins than is looked at at a time
    const float x = 8 + static_cast<float>(k % 9), y = 8 + static_cast<float>(k / 9 % 9),
                z = 8 + static_cast<float>(k / 81);
    spheres[static_cast<std::size_t>(k) * 30] = {x, y, z, 3};
  }
  expect_same(input_of(spheres), "crowded coarse ones");
}
TEST_F(CudaTest, LevelsAgree) { expect_levels_agree(20'000); }
TEST_F(CudaTest, LargeLevelsAgree) { expect_levels_agree(400'000); }

// The places of a list of fixed order follow from its contacts alone, not from the list before: longer,
// shorter, nearly and quite empty ones.
void CudaTest::expect_one_order(const char* name, std::uint64_t n) {
  const auto given = generate(name, n);
  Detector d({BackendKind::cuda}, gpu_);
  SomeCases some;
  for (const float grown : {1.f, 1.01f, 1.3f, 0.9f, 0.05f, 0.f, 2.f, 1.f}) {
    if (some.left_out()) continue;
    auto spheres = given;
    for (FloatSphere& s : spheres) s.r *= grown;
    Detector fresh({BackendKind::cuda}, gpu_), cpu({BackendKind::omp}, cpu_);
    const Contacts &a = d.detect(input_of(spheres)), &b = fresh.detect(input_of(spheres));
    ASSERT_EQ(a.count, cpu.detect(input_of(spheres)).count) << name << " " << n << " " << grown;
    ASSERT_EQ(d.hash(), cpu.hash()) << name << " " << n << " " << grown;
    ASSERT_EQ(a.count, b.count) << name << " " << n << " " << grown;
    ASSERT_EQ(std::memcmp(a.pairs, b.pairs, a.count * sizeof(Pair)), 0) << name << " " << n << " " << grown;
    ASSERT_EQ(std::memcmp(a.normals, b.normals, a.count * sizeof(Normal<float>)), 0)
        << name << " " << n << " " << grown;
  }
}
TEST_F(CudaTest, ListsOfAllLengthsInOneOrder) {
  for (const char* name : {"poly35", "poly100"})
    for (const std::uint64_t n : {30'000, 130'000})
      expect_one_order(name, n);  // tiles that wait; that do not
}
// Units that look down have places of their own.
TEST_F(CudaTest, LargeListsOfAllLengthsInOneOrder) {
  for (const std::uint64_t n : {150'000, 320'000, 950'000}) expect_one_order("poly100", n);
}

// Units of two pieces; so many tiles that no one kernel both numbers and moves what spilled.
TEST_F(CudaTest, LargestListsInOneOrder) {
  for (const std::uint64_t n : {3'200'000, 14'000'000}) {
    const auto spheres = generate("poly100", n);
    Detector cpu({BackendKind::omp}, cpu_), gpu({BackendKind::cuda}, gpu_);
    const std::uint64_t count = cpu.detect(input_of(spheres)).count;
    std::vector<Pair> first;
    for (int run = 0; run < 5; run++) {
      Detector fresh({BackendKind::cuda}, gpu_);
      Detector& d = run == 2 ? fresh : gpu;
      const Contacts& c = d.detect(input_of(spheres));
      ASSERT_EQ(c.count, count) << n << " run " << run;
      ASSERT_EQ(d.hash(), cpu.hash()) << n << " run " << run;
      if (first.empty()) first.assign(c.pairs, c.pairs + c.count);
      ASSERT_EQ(std::memcmp(c.pairs, first.data(), count * sizeof(Pair)), 0) << n << " run " << run;
    }
  }
}

TEST_F(CudaTest, CrowdedBins) {
  std::vector<FloatSphere> spheres;
  for (int k = 0; k < 1500; k++) spheres.push_back({0.001f * static_cast<float>(k % 11), 0, 0, 0.0001f});
  for (int k = 0; k < 400; k++) spheres.push_back({static_cast<float>(k), 5, 5, 0.5f});
  Detector cpu({BackendKind::omp}, cpu_);
  const std::uint64_t count = cpu.detect(input_of(spheres)).count;
  for (const Order order : {Order::stable, Order::any}) {
    gpu_.order = order;
    Detector gpu({BackendKind::cuda}, gpu_);
    for (int again = 0; again < 3; again++) EXPECT_EQ(gpu.detect(input_of(spheres)).count, count);
    EXPECT_EQ(gpu.hash(), cpu.hash());
  }
}

TEST_F(CudaTest, DeviceMemoryAndAStream) {
  const auto spheres = generate("dense", 50'000);
  void* device = nullptr;
  ASSERT_EQ(cudaMalloc(&device, spheres.size() * sizeof(FloatSphere)), cudaSuccess);
  cudaStream_t stream;
  ASSERT_EQ(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), cudaSuccess);
  ASSERT_EQ(cudaMemcpyAsync(device, spheres.data(), spheres.size() * sizeof(FloatSphere),
                            cudaMemcpyHostToDevice, stream),
            cudaSuccess);
  Input input = input_of(spheres);
  input.spheres.centers = device, input.spheres.radii = static_cast<float*>(device) + 3;
  input.spheres.memory = Memory::device;
  gpu_.stream = stream, gpu_.output = Memory::device;
  Detector gpu({BackendKind::cuda}, gpu_), cpu({BackendKind::omp}, cpu_);
  std::uint64_t held = 0;
  for (int again = 0; again < 5; again++) {
    const Contacts& c = gpu.detect(input);
    EXPECT_EQ(c.memory, Memory::device);
    if (again == 2) held = gpu.memory();
    if (again > 2) {
      EXPECT_EQ(gpu.memory(), held);
    }
    EXPECT_EQ(c.count, cpu.detect(input_of(spheres)).count);
    EXPECT_EQ(gpu.hash(), cpu.hash());
  }
  cudaStreamDestroy(stream), cudaFree(device);
}

}  // namespace
}  // namespace padder::detect
