// SPDX-License-Identifier: MIT
// Spheres that lie on several GPUs: pairs, records and hash are those of one detector on the CPU. One GPU
// stands for several where there is only one.
#include "detect/scene/generate.h"
#include "tests/detect/cuda/resident_scene.h"
#include "tests/detect/some_cases.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

// What the resident detector found, and what one detector finds.
void expect_same(const ResidentDetector& resident, Detector& one, const Input& input) {
  const Contacts& wanted = one.detect(input);
  EXPECT_EQ(resident.report().contacts, wanted.count);
  EXPECT_EQ(resident.report().spheres, wanted.spheres);
  EXPECT_EQ(resident.hash(), one.hash());
  EXPECT_EQ(records_of(resident), records_of(wanted));
}
void expect_as_one(const Input& input, ResidentDetector& resident, const std::vector<int>& devices,
                   std::uint64_t seed = 1) {
  const Parts parts(input, devices, seed);
  resident.detect(parts.spheres);
  Detector one = one_on_the_cpu(resident.options());
  expect_same(resident, one, input);
}

using CudaResident = GpuTest;

TEST_F(CudaResident, AnyNumberOfGpusFindsWhatOneDetectorFinds) {
  SomeCases some;
  for (const std::size_t n : {1, 2, 3, 7, 40})
    for (const std::uint32_t seed : {1u, 2u}) {
      if (some.left_out()) continue;
      SCOPED_TRACE(std::to_string(n) + " GPUs, seed " + std::to_string(seed));
      const std::vector<int> devices = several(n);
      ResidentDetector resident(on(devices));
      for (const double ratio : {1., 30.}) {
        const Arranged a(random_scene(5000, ratio, 0.4, seed), seed % 2 ? Scalar::f32 : Scalar::f64);
        expect_as_one(a.input, resident, devices, seed);
      }
    }
}

// The spheres of a scene sorted by the box of a detector that has seen it. One of `astray` is put to the
// front of all, into the first part.
std::vector<std::uint64_t> sort_by_box(TestScene& scene, const ResidentDetector& resident,
                                       std::size_t astray) {
  TestScene sorted;
  std::vector<std::uint64_t> cuts;
  const auto take = [&](std::size_t k) {
    sorted.spheres.push_back(scene.spheres[k]);
    if (!scene.family.empty()) sorted.family.push_back(scene.family[k]), sorted.mask.push_back(scene.mask[k]);
  };
  const auto is_astray = [&](std::size_t k) { return astray && k % astray == 0; };
  for (std::size_t b = 0; b < resident.devices(); b++) {
    cuts.push_back(b ? sorted.spheres.size() : 0);
    for (std::size_t k = 0; b == 0 && k < scene.spheres.size(); k++)
      if (is_astray(k)) take(k);
    for (std::size_t k = 0; k < scene.spheres.size(); k++) {
      const Sphere& s = scene.spheres[k];
      if (!is_astray(k) && owns(resident.region(b), {s.x, s.y, s.z})) take(k);
    }
  }
  scene = sorted;
  return cuts;
}

// Packed parts of which few spheres lie elsewhere are not copied; those of other GPUs come around them.
TEST_F(CudaResident, PartsThatLieWhereTheyAreNeededAreReadInPlace) {
  SomeCases some;
  for (const bool tagged : {false, true})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64})
      for (const bool apart : {false, true})
        for (const std::size_t astray : {0, 50, 3}) {
          if (some.left_out()) continue;
          SCOPED_TRACE(std::to_string(tagged) + ", " + std::to_string(scalar == Scalar::f64) + ", " +
                       std::to_string(apart) + ", " + std::to_string(astray));
          const std::vector<int> devices = several(5);
          ResidentDetector resident(on(devices));
          TestScene scene = random_scene(6000, tagged ? 3 : 30, 0.4, 17).rounded();
          if (tagged) scene.tag(5, 16);
          {
            const Arranged a(scene, scalar);
            resident.detect(Parts(a.input, devices).spheres);
          }
          const std::vector<std::uint64_t> cuts = sort_by_box(scene, resident, astray);
          const Arranged a(scene, scalar);
          Input input = a.input;
          std::vector<std::uint8_t> is_static;
          for (std::size_t k = 0; k < scene.spheres.size(); k++) is_static.push_back(k % 3 == 0);
          if (tagged) input.spheres.is_static = is_static.data();
          std::vector<float> centers, radii;
          std::vector<double> wide_centers, wide_radii;
          for (const Sphere& s : scene.spheres) {
            for (const double v : {s.x, s.y, s.z})
              centers.push_back(static_cast<float>(v)), wide_centers.push_back(v);
            radii.push_back(static_cast<float>(s.r)), wide_radii.push_back(s.r);
          }
          if (apart && scalar == Scalar::f32)
            input.spheres = spheres_of<float>(radii.size(), centers.data(), radii.data());
          else if (apart)
            input.spheres = spheres_of<double>(radii.size(), wide_centers.data(), wide_radii.data());
          const Parts parts(input, devices, 0, cuts);
          Detector one = one_on_the_cpu(on({}).detector);
          bool cut = false;
          for (int call = 0; call < 2; call++) {
            cut |= resident.detect(parts.spheres).cut;
            expect_same(resident, one, input);
          }
          if (cut) continue;  // the boxes are others now
          for (std::size_t k = 0; k < devices.size(); k++) {
            const ResidentContacts& f = resident.found()[k];
            const bool copied = k == 0 && astray == 3;
            EXPECT_EQ(f.own.count, copied ? 0 : parts.spheres[k].count);
            EXPECT_EQ(f.own.centers == parts.spheres[k].centers, !copied && !apart);
            EXPECT_GT(f.others.count, 0u);
            EXPECT_EQ(f.contacts.spheres, f.own.count + f.others.count);
          }
        }
}

TEST_F(CudaResident, OddScenes) {
  const std::vector<TestScene> scenes = odd_scenes(12, 2000);
  for (const std::size_t n : {1, 2, 5, 8}) {
    const std::vector<int> devices = several(n);
    ResidentDetector resident(on(devices));
    for (std::size_t k = 0; k < scenes.size(); k++) {
      SCOPED_TRACE(std::to_string(n) + " GPUs, scene " + std::to_string(k));
      const Arranged a(scenes[k], Scalar::f64);
      expect_as_one(a.input, resident, devices, k);
    }
  }
}

TEST_F(CudaResident, TagsAndStaticSpheresTravelToo) {
  TestScene scene = random_scene(4000, 3, 0.3, 31);
  scene.tag(5, 16);
  std::vector<std::uint8_t> is_static;
  for (std::size_t k = 0; k < scene.spheres.size(); k++) is_static.push_back(k % 3 == 0);
  const Arranged a(scene, Scalar::f32);
  Input input = a.input;
  input.spheres.is_static = is_static.data();
  const std::vector<int> devices = several(4);
  ResidentDetector resident(on(devices));
  expect_as_one(input, resident, devices);
  resident.options().own.low[0] = 5;
  expect_as_one(input, resident, devices);
}

// Enough spheres for the search that fuses levels. Many midpoints lie on the faces of the regions.
TEST_F(CudaResident, RegionsShareTheContactsOfManySpheresOfAllSizes) {
  TestScene s = random_scene(200000, 30, 1, 71);
  double edge = 0;
  for (const Sphere& p : s.spheres) edge = std::max(edge, p.x);
  const double face = std::floor(edge / 2);
  for (int k = 0; k < 600; k++)
    s.spheres.push_back({face - 2 * (k % 5), face - 2 * (k / 5 % 5), face - 2 * (k / 25), 1.0 + k % 2});
  s = s.rounded();
  const Arranged a(s, Scalar::f32);
  for (const double margin : {0., 0.25}) {
    CallOptions o;
    o.order = Order::any, o.margin = margin;
    Detector one = one_on_the_cpu(o), gpu(DeviceChoice{BackendKind::cuda});
    const std::uint64_t wanted = one.detect(a.input).count;
    ASSERT_GT(wanted, 100000u);
    for (int call = 0; call < 3; call++) {
      std::uint64_t count = 0, hash = 0;
      for (int box = 0; box < 8; box++) {
        o.own = {};
        for (int c = 0; c < 3; c++) (box >> c & 1 ? o.own.low : o.own.high)[c] = face;
        gpu.options() = o;
        count += gpu.detect(a.input).count, hash += gpu.hash();
      }
      EXPECT_EQ(count, wanted);
      EXPECT_EQ(hash, one.hash());
    }
  }
}

// Contacts that are only counted stay on the GPUs; those of bodies do not.
TEST_F(CudaResident, CountingByBoxesGivesTheHashOfOneDetector) {
  const Arranged a(random_scene(60000, 4, 0.6, 51), Scalar::f64);
  MovingBodies scene(52, 500);
  const Arranged loose(scene.grains, Scalar::f32);
  Input with_bodies = scene.input();
  with_bodies.spheres = loose.input.spheres;
  for (const Input& input : {a.input, with_bodies}) {
    BoxOptions o = on_the_cpu(5);
    o.devices.clear();
    for (const int k : several(3)) o.devices.push_back({BackendKind::cuda, k});
    BoxedDetector boxed(o);
    Detector one = one_on_the_cpu(on({}).detector);
    const std::uint64_t count = one.detect(input).count;
    const BoxReport& r = boxed.detect(input, {});
    EXPECT_EQ(r.contacts, count);
    EXPECT_EQ(r.hash, one.hash());
  }
}

TEST_F(CudaResident, SixtyStepsGiveTheHashOfOneDetector) {
  const std::vector<int> devices = several(4);
  ResidentDetector resident(on(devices));
  const int cuts = expect_steps(60, 20000, 0.97, [&](const Input& input, int step) {
    const Parts parts(input, devices, static_cast<std::uint64_t>(step));
    const bool cut = resident.detect(parts.spheres).cut;
    return std::pair(resident.hash(), cut);
  });
  EXPECT_GT(cuts, 1);
  EXPECT_LT(cuts, 50);
}

TEST_F(CudaResident, BodiesGiveTheContactsOfOneDetector) {
  SomeCases some;
  for (const std::uint32_t loose : {0u, 3000u})
    for (const std::size_t n : {1, 2, 5}) {
      SCOPED_TRACE(std::to_string(n) + " GPUs, loose spheres: " + std::to_string(loose));
      MovingBodies scene(41 + loose, loose);
      const std::vector<int> devices = several(n);
      ResidentDetector resident(on(devices));
      Detector one = one_on_the_cpu(on({}).detector);
      for (int step = 0; step < 8; step++) {
        if (some.left_out()) continue;
        const Arranged a(scene.grains, Scalar::f32);
        const Parts parts(a.input, devices, static_cast<std::uint64_t>(step));
        const bool on_gpus = step != 3;  // in between a call with poses in host memory
        const PoseParts poses(scene.poses, devices);
        Input input = scene.input();
        if (step == 3) input.revision = 8;
        Input bodies = input;
        input.spheres = a.input.spheres, input.poses = scene.poses.data();
        if (!on_gpus) bodies.poses = scene.poses.data();
        resident.detect(parts.spheres, bodies, on_gpus ? poses.parts : std::vector<ResidentPoses>());
        SCOPED_TRACE("step " + std::to_string(step));
        expect_same(resident, one, input);
        ASSERT_GT(resident.report().contacts, 500u);
        scene.turn(1);
      }
    }
}

// The lists for the other GPUs are longer than what there is room for at first.
TEST_F(CudaResident, OneGpuHasThePosesOfAllBodies) {
  const BodyScene scene = generate_bodies(20000);
  const Shape shape{scene.shape.data(), scene.shape.size()};
  std::vector<Pose> all(scene.bodies.size());
  for (std::size_t k = 0; k < all.size(); k++) all[k] = pose_of(scene.bodies[k]);
  Input input;
  input.shapes = {&shape, 1}, input.bodies = scene.bodies, input.revision = 1;
  Detector one = one_on_the_cpu(on({}).detector);
  const std::uint64_t wanted = one.detect(input).count;
  ASSERT_GT(wanted, 10000u);
  const std::vector<int> devices = several(4);
  const OnGpu there(devices[0], all.data(), all.size() * sizeof(Pose));
  std::vector<ResidentPoses> poses(devices.size());
  poses[0] = {static_cast<const Pose*>(there.data()), all.size()};
  const std::vector<Spheres> none(devices.size());
  for (const Order order : {Order::any, Order::stable}) {
    ResidentOptions options = on(devices);
    options.detector.order = order;
    ResidentDetector resident(options);
    for (int call = 0; call < 3; call++) {
      EXPECT_EQ(resident.detect(none, input, poses).contacts, wanted);
      EXPECT_EQ(resident.hash(), one.hash());
    }
  }
}

// Worlds are searched in another way, which takes all poses.
TEST_F(CudaResident, BodiesOfSeveralWorldsGiveTheContactsOfOneDetector) {
  MovingBodies scene(47, 0);
  for (std::size_t k = 0; k < scene.bodies.size(); k++)
    scene.bodies[k].world = static_cast<std::uint32_t>(k % 3);
  const std::vector<int> devices = several(3);
  const std::vector<Spheres> none(devices.size());
  ResidentDetector resident(on(devices));
  Detector one = one_on_the_cpu(on({}).detector);
  for (int step = 0; step < 4; step++) {
    const PoseParts poses(scene.poses, devices);
    Input input = scene.input();
    input.poses = scene.poses.data();
    const Contacts& wanted = one.detect(input);
    ASSERT_GT(wanted.count, 100u);
    EXPECT_EQ(resident.detect(none, scene.input(), poses.parts).contacts, wanted.count) << "step " << step;
    EXPECT_EQ(resident.hash(), one.hash()) << "step " << step;
    scene.turn(1);
  }
}

testing::AssertionResult refused(ResidentDetector& resident, std::span<const Spheres> parts,
                                 const std::string& words) {
  return refuses([&] { resident.detect(parts); }, words);
}

TEST_F(CudaResident, FailuresAreASentenceAndTheDetectorStaysUsable) {
  const std::vector<int> devices = several(3);
  ResidentDetector resident(on(devices));
  TestScene scene = random_scene(3000, 1, 0.5, 3);
  const Arranged good(scene, Scalar::f32);
  scene.spheres[2500].r = -1;
  const Arranged bad(scene, Scalar::f32);
  const Parts parts(bad.input, devices);
  EXPECT_TRUE(refused(resident, parts.spheres, "sphere 2500 at ("));
  EXPECT_EQ(resident.hash(), 0u);
  EXPECT_TRUE(refused(resident, std::span(parts.spheres).first(2), "2 parts"));
  resident.options().memory_limit = 1000;
  const Parts fine(good.input, devices);
  EXPECT_TRUE(refused(resident, fine.spheres, "GPU "));
  resident.options().memory_limit = 0;
  expect_as_one(good.input, resident, devices);
  MovingBodies scene3(3, 0);
  const std::vector<Spheres> none(devices.size());
  std::vector<Pose> poses = scene3.poses;
  poses[300].rotation[4] = NAN;
  for (const bool valid : {false, true, true}) {  // a call that failed is not what the next one builds on
    const PoseParts there(valid ? scene3.poses : poses, devices);
    const auto detect = [&] { resident.detect(none, scene3.input(), there.parts); };
    if (valid)
      detect();
    else
      EXPECT_THROW(detect(), Error);
  }
  Detector one = one_on_the_cpu(on({}).detector);
  one.detect(scene3.input());
  EXPECT_EQ(resident.hash(), one.hash());
  Input loose = scene3.input();
  loose.spheres = good.input.spheres;
  EXPECT_THROW(resident.detect(none, loose), Error);
  EXPECT_THROW(resident.detect(none, scene3.input(), std::vector<ResidentPoses>(2)), Error);
  EXPECT_THROW(ResidentDetector(on({gpus()})), Error);
}

}  // namespace
}  // namespace padder::detect
