// SPDX-License-Identifier: MIT
// Spheres that lie on the GPUs of several ranks: mpirun starts this program with several numbers of ranks.
// Every rank makes the whole scene, brings its part to its GPU, and compares with one detector. One GPU
// stands for several where there are fewer than ranks.
#include "detect/mpi/resident_ranks.h"
#include "detect/mpi/rank_detector.h"
#include "tests/detect/cuda/resident_scene.h"
#include "tests/detect/mpi/run_tests.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

// Messages from GPU to GPU, as an MPI library sends them that reads their memory.
class FromGpuToGpu : public ResidentRanks {
 public:
  int rank() const override { return mpi_->rank(); }
  int count() const override { return mpi_->count(); }
  int rank_on_host() const override { return mpi_->rank_on_host(); }
  bool reads_device_memory() const override { return true; }
  void together(const std::function<void()>& work) const override { mpi_->together(work); }
  void gather(const void* mine, void* all, std::uint64_t bytes) const override {
    mpi_->gather(mine, all, bytes);
  }
  void transpose(const std::uint64_t* to, std::uint64_t* from) const override { mpi_->transpose(to, from); }
  void add_up(std::span<double> values) const override { mpi_->add_up(values); }
  BoxTree cut(const std::vector<WeightedPoint>& points) const override { return mpi_->cut(points); }
  void exchange(std::span<const RankMessage> to, std::span<const RankMessage> from) const override {
    std::vector<std::vector<char>> out, in;
    std::vector<RankMessage> sent, got;
    for (const RankMessage& m : to) {
      out.push_back(from_gpu<char>(m.at, m.bytes));
      sent.push_back({m.rank, out.back().data(), m.bytes});
    }
    for (const RankMessage& m : from) got.push_back({m.rank, in.emplace_back(m.bytes).data(), m.bytes});
    mpi_->exchange(sent, got);
    for (std::size_t k = 0; k < in.size(); k++) {
      EXPECT_EQ(cudaMemcpy(from[k].at, in[k].data(), in[k].size(), cudaMemcpyHostToDevice), cudaSuccess);
    }
  }

 private:
  std::shared_ptr<ResidentRanks> mpi_ = resident_ranks(MPI_COMM_WORLD);
};

class ResidentRanksTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    if (gpus() == 0) GTEST_SKIP() << "there is no GPU";
  }
  static ResidentOptions options() {
    ResidentOptions o = on({});
    o.ranks = GetParam() ? std::make_shared<FromGpuToGpu>() : resident_ranks(MPI_COMM_WORLD);
    return o;
  }
};

std::vector<int> my_device() { return {my_rank % gpus()}; }

// The records of this rank are those of `one`, and together there are as many.
void expect_as(Detector& one, const Input& input, ResidentDetector& resident, const Spheres& part,
               const Input& bodies = {}, std::span<const ResidentPoses> poses = {}) {
  const Contacts& wanted = one.detect(input);
  const ResidentReport& r = resident.detect({&part, 1}, bodies, poses);
  EXPECT_EQ(r.contacts, wanted.count);
  EXPECT_EQ(r.spheres, wanted.spheres);
  EXPECT_EQ(resident.hash(), one.hash());
  const Records mine = records_of(resident);
  EXPECT_TRUE(records_of(wanted).hold(mine));
  unsigned long long count = mine.size(), all = 0;
  MPI_Allreduce(&count, &all, 1, MPI_UNSIGNED_LONG_LONG, MPI_SUM, MPI_COMM_WORLD);
  EXPECT_EQ(all, wanted.count);
}
void expect_as_one(const Input& input, ResidentDetector& resident, const Spheres& part) {
  Detector one = one_on_the_cpu(on({}).detector);
  expect_as(one, input, resident, part);
}

// This rank's part of the scene, on its GPU; every other part stays in host memory if `mixed`.
Parts my_part(const Input& input, bool mixed = false) {
  return {part_of(input, my_rank, ranks), my_device(), mixed ? static_cast<std::uint64_t>(my_rank) : 1};
}

TEST_P(ResidentRanksTest, LooseSpheresGiveWhatOneDetectorGives) {
  ResidentDetector resident(options());
  for (const std::uint32_t seed : {1u, 2u, 3u, 4u}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TestScene scene = random_scene(4000, seed == 3 ? 50 : seed, 0.4, seed);
    std::vector<std::uint8_t> is_static;
    if (seed % 2 == 0) scene.tag(5, 3);
    for (int k = 0; k < 4000; k++) is_static.push_back(k % 7 == 0);
    const Arranged a(scene, seed % 2 ? Scalar::f32 : Scalar::f64);
    Input input = a.input;
    if (seed == 4) input.spheres.is_static = is_static.data();
    expect_as_one(input, resident, my_part(input, seed == 1).spheres[0]);
  }
}

// Parts that lie in their boxes are read in place.
TEST_P(ResidentRanksTest, PartsThatLieWhereTheyAreNeededAreReadInPlace) {
  ResidentDetector resident(options());
  TestScene scene = random_scene(6000, 3, 0.4, 17).rounded();
  const Arranged before(scene, Scalar::f32);
  resident.detect(my_part(before.input).spheres);
  std::vector<Region> boxes(static_cast<std::size_t>(ranks));
  const Region own = resident.region(0);
  MPI_Allgather(&own, sizeof own, MPI_BYTE, boxes.data(), sizeof own, MPI_BYTE, MPI_COMM_WORLD);
  TestScene sorted;
  std::uint64_t first = 0, end = 0;
  for (int r = 0; r < ranks; r++) {
    if (r == my_rank) first = sorted.spheres.size();
    for (const Sphere& s : scene.spheres)
      if (owns(boxes[static_cast<std::size_t>(r)], {s.x, s.y, s.z})) sorted.spheres.push_back(s);
    if (r == my_rank) end = sorted.spheres.size();
  }
  ASSERT_EQ(sorted.spheres.size(), scene.spheres.size());
  const Arranged a(sorted, Scalar::f32);
  Input mine = a.input;
  mine.spheres.centers = static_cast<const float*>(mine.spheres.centers) + 4 * first;
  mine.spheres.radii = static_cast<const float*>(mine.spheres.radii) + 4 * first;
  mine.spheres.count = end - first;
  const Parts part(mine, my_device());
  bool cut = false;
  for (int call = 0; call < 2; call++) {
    expect_as_one(a.input, resident, part.spheres[0]);
    cut |= resident.report().cut;
  }
  if (cut) return;  // the boxes are others now
  EXPECT_EQ(resident.found()[0].own.count, end - first);
  EXPECT_EQ(resident.found()[0].own.centers, part.spheres[0].centers);
  EXPECT_EQ(resident.found()[0].others.count > 0, ranks > 1);
}

TEST_P(ResidentRanksTest, OddScenes) {
  const std::vector<TestScene> scenes = odd_scenes(10, 1000);
  ResidentDetector resident(options());
  for (std::size_t k = 0; k < scenes.size(); k++) {
    SCOPED_TRACE("scene " + std::to_string(k));
    const Arranged a(scenes[k], Scalar::f64);
    expect_as_one(a.input, resident, my_part(a.input).spheres[0]);
  }
}

TEST_P(ResidentRanksTest, FortyStepsGiveTheHashOfOneDetector) {
  ResidentDetector resident(options());
  const int cuts = expect_steps(40, 8000, 0.97, [&](const Input& input, int) {
    const bool cut = resident.detect(my_part(input).spheres).cut;
    return std::pair(resident.hash(), cut);
  });
  EXPECT_LT(cuts, 35);
  EXPECT_GT(cuts, ranks > 2 ? 1 : -1);
}

TEST_P(ResidentRanksTest, BodiesGiveTheContactsOfOneDetector) {
  for (const std::uint32_t loose : {0u, 2000u}) {
    SCOPED_TRACE("loose spheres: " + std::to_string(loose));
    MovingBodies scene(41 + loose, loose);
    ResidentDetector resident(options());
    Detector one = one_on_the_cpu(on({}).detector);  // it keeps what is static, too
    for (int step = 0; step < 5; step++) {
      const Arranged a(scene.grains, Scalar::f32);
      const bool on_gpus = step != 3;  // in between a call with poses in host memory
      Input input = scene.input();
      if (step == 3) input.revision = 8;
      Input bodies = input;
      input.spheres = a.input.spheres, input.poses = scene.poses.data();
      if (!on_gpus) bodies.poses = scene.poses.data();
      const Part mine = part_of(scene.poses.size(), my_rank, ranks);
      const std::vector<Pose> my_poses(scene.poses.begin() + static_cast<std::ptrdiff_t>(mine.first),
                                       scene.poses.begin() + static_cast<std::ptrdiff_t>(mine.end));
      const PoseParts poses(my_poses, my_device());
      Input loose_alone;
      loose_alone.spheres = a.input.spheres;
      expect_as(one, input, resident, my_part(loose_alone).spheres[0], bodies,
                on_gpus ? poses.parts : std::vector<ResidentPoses>());
      scene.turn(1);
    }
  }
}

TEST_P(ResidentRanksTest, WhatFailsOnOneRankFailsOnAllWithOneSentence) {
  TestScene scene = random_scene(1000, 1, 0.4, 9);
  const Arranged good(scene, Scalar::f64);
  scene.spheres[990].r = -1;  // the last rank's
  const Arranged bad(scene, Scalar::f64);
  ResidentDetector resident(options());
  const auto said_of = [&](const Input& part, const Input& bodies = {}) {
    const Parts parts(part, my_device());
    return error_of([&] { resident.detect(parts.spheres, bodies); });
  };
  const std::string rank = ranks == 1 ? "" : "rank " + std::to_string(ranks - 1) + ": ";
  std::string said = said_of(part_of(bad.input, my_rank, ranks));
  EXPECT_TRUE(said.starts_with(rank) && said.find("sphere 990 at (") != std::string::npos) << said;
  EXPECT_EQ(resident.report().contacts, 0u);
  MovingBodies bodies(3, 0);
  Input some = bodies.input();
  if (my_rank == ranks - 1) some.bodies = some.bodies.first(5);
  said = said_of(part_of(good.input, my_rank, ranks), some);
  EXPECT_EQ(said.find("different bodies") != std::string::npos, ranks > 1) << said;
  const Arranged narrow(random_scene(1000, 1, 0.4, 9), Scalar::f32);
  said = said_of(part_of(my_rank == 0 ? narrow.input : good.input, my_rank, ranks));
  EXPECT_EQ(said.find("all in float or all in double") != std::string::npos, ranks > 1) << said;
  ResidentOptions absent = options();
  absent.devices = {my_rank == ranks - 1 ? 1000 : my_device()[0]};
  said = error_of([&] { ResidentDetector{absent}; });
  EXPECT_TRUE(said.starts_with(rank) && !said.empty()) << said;
  absent.devices = {0, 0};
  said = error_of([&] { ResidentDetector{absent}; });
  EXPECT_NE(said.find("a rank for each GPU"), std::string::npos) << said;
  expect_as_one(good.input, resident, my_part(good.input).spheres[0]);
}

INSTANTIATE_TEST_SUITE_P(Messages, ResidentRanksTest, testing::Bool(), [](const auto& one) {
  return std::string(one.param ? "from_gpu_to_gpu" : "through_host_memory");
});

}  // namespace
}  // namespace padder::detect

int main(int argc, char** argv) { return padder::detect::run_tests(argc, argv); }
