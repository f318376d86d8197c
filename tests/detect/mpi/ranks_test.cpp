// SPDX-License-Identifier: MIT
// Contacts among the ranks of MPI: mpirun starts this program with several numbers of ranks. Every rank makes
// the whole scene, passes its part, and compares with one detector.
#include <fstream>

#include "detect/mpi/rank_contact_file.h"
#include "detect/mpi/rank_detector.h"
#include "tests/detect/boxes/boxed_scene.h"
#include "tests/detect/mpi/run_tests.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

RankOptions on_cpu() {
  RankOptions o;
  o.detector.threads = 1, o.detector.width = Width::points, o.detector.scalar = Scalar::f64;
  o.device = {BackendKind::omp, 0};
  return o;
}

// The records of this rank are those of one detector, and together there are as many.
void expect_as_one(const Input& input, const Input& part, RankDetector& detector) {
  Detector one = one_on_the_cpu(detector.options());
  const Contacts& wanted = one.detect(input);
  Records mine;
  const RankReport& r = detector.detect(part, [&](const ContactBatch& b) {
    for (std::size_t k = 0; k < b.pairs.size(); k++)
      mine.add(b.pairs[k].i, b.pairs[k].j, static_cast<const Normal<double>*>(b.normals)[k],
               static_cast<const Points<double>*>(b.points)[k]);
  });
  EXPECT_TRUE(records_of(wanted).hold(mine));
  EXPECT_EQ(r.contacts, wanted.count);
  EXPECT_EQ(r.spheres, wanted.spheres);
  EXPECT_EQ(r.hash, one.hash());
  EXPECT_EQ(r.own_contacts, mine.size());
}

// All but a few of the spheres on the last rank, none on the first, if there are several.
Input uneven_part(const Input& input) {
  if (ranks == 1) return input;
  Input part = part_of(input, std::max(my_rank - 1, 0), ranks - 1);
  if (my_rank == 0) part.spheres.count = 0, part.bodies = {};
  return part;
}

TEST(Ranks, LooseSpheresGiveWhatOneDetectorGives) {
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  for (const std::uint32_t seed : {1u, 2u, 3u}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TestScene scene = random_scene(3000, seed == 3 ? 50 : seed, 0.4, seed);
    if (seed == 2) scene.tag(5, 3);
    const Arranged a(scene, seed % 2 ? Scalar::f32 : Scalar::f64);
    expect_as_one(a.input, part_of(a.input, my_rank, ranks), detector);
    expect_as_one(a.input, uneven_part(a.input), detector);
  }
}

TEST(Ranks, OddScenes) {
  const std::vector<TestScene> scenes = odd_scenes(10, 1000);
  RankDetector kept(MPI_COMM_WORLD, on_cpu());
  for (std::size_t k = 0; k < scenes.size(); k++) {
    SCOPED_TRACE("scene " + std::to_string(k));
    const Arranged a(scenes[k], Scalar::f64);
    expect_as_one(a.input, part_of(a.input, my_rank, ranks), kept);
    RankDetector fresh(MPI_COMM_WORLD, on_cpu());
    expect_as_one(a.input, part_of(a.input, my_rank, ranks), fresh);
  }
}

// Some ranks have floats, some doubles, families or static spheres: what one lacks is 0.
TEST(Ranks, PartsMayDiffer) {
  TestScene scene = random_scene(2000, 2, 0.3, 7).rounded();
  std::vector<std::uint8_t> is_static(scene.spheres.size(), 0);
  scene.family.assign(scene.spheres.size(), 0);
  const Arranged narrow(scene, Scalar::f32), wide(scene, Scalar::f64);
  const Part mine = part_of(scene.spheres.size(), my_rank, ranks);
  for (int r = 0; r < ranks; r++) {
    const Part s = part_of(scene.spheres.size(), r, ranks);
    for (std::uint64_t k = s.first; k < s.end; k++)
      scene.family[k] = r % 3 == 0 ? static_cast<std::uint32_t>(k % 4) : 0,
      is_static[k] = r % 2 == 1 && k % 3 == 0;
  }
  Input all = wide.input;
  all.spheres.family = scene.family.data(), all.spheres.is_static = is_static.data();
  Input part = part_of(my_rank % 2 ? narrow.input : wide.input, my_rank, ranks);
  part.spheres.family = my_rank % 3 == 0 ? scene.family.data() + mine.first : nullptr;
  part.spheres.is_static = my_rank % 2 ? is_static.data() + mine.first : nullptr;
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  expect_as_one(all, part, detector);
}

TEST(Ranks, BodiesAndRevisionsMeanWhatTheyMeanToOneDetector) {
  Pile pile(150);
  const Arranged loose(random_scene(500, 1, 1, 3), Scalar::f32);
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  Detector one = one_on_the_cpu(on_cpu().detector);
  const Part mine = part_of(pile.bodies.size(), my_rank, ranks);
  for (int step = 0; step < 30; step++) {
    Input input = pile.step(step);
    input.spheres = loose.input.spheres;
    std::vector<std::uint32_t> my_moved;
    for (const std::uint32_t k : input.moved)
      if (k >= mine.first && k < mine.end) my_moved.push_back(k - static_cast<std::uint32_t>(mine.first));
    Input part = part_of(input, my_rank, ranks);
    part.moved = my_moved;
    const std::uint64_t contacts = one.detect(input).count;
    EXPECT_EQ(detector.detect(part, {}).contacts, contacts) << "step " << step;
    EXPECT_EQ(detector.report().hash, one.hash()) << "step " << step;
  }
}

TEST(Ranks, AHundredStepsGiveTheHashOfOneBox) {
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  const int cuts = expect_steps(100, 3000, 0.985, [&](const Input& input, int) {
    const RankReport& r = detector.detect(part_of(input, my_rank, ranks), {});
    return std::pair(r.hash, r.cut);
  });
  EXPECT_LT(cuts, 60);
  EXPECT_GT(cuts, ranks > 2 ? 1 : 0);
}

// Four fifths of the spheres in a tenth of the space: the second cut knows the contacts.
TEST(Ranks, WorkIsShared) {
  TestScene scene = random_scene(20000, 1, 1, 5);
  for (std::size_t k = 0; k < 15000; k++) scene.spheres[k].x *= 0.1;
  const Arranged a(scene, Scalar::f32);
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  for (int k = 0; k < 4; k++) detector.detect(part_of(a.input, my_rank, ranks), {});
  EXPECT_LT(detector.report().imbalance, 1.2);
  EXPECT_FALSE(detector.report().cut);
}

TEST(Ranks, WhatFailsOnOneRankFailsOnAllWithOneSentence) {
  TestScene scene = random_scene(1000, 1, 0.4, 9);
  const Arranged good(scene, Scalar::f64);
  scene.spheres[990].r = -1;  // the last rank's
  const Arranged bad(scene, Scalar::f64);
  RankDetector detector(MPI_COMM_WORLD, on_cpu());
  const std::string rank = ranks == 1 ? "" : "rank " + std::to_string(ranks - 1) + ": ";
  std::string said = error_of([&] { detector.detect(part_of(bad.input, my_rank, ranks), {}); });
  EXPECT_TRUE(said.starts_with(rank + "sphere 990 at (")) << said;
  EXPECT_EQ(detector.report().contacts, 0u);
  said = error_of([&] {
    detector.detect(part_of(good.input, my_rank, ranks), [](const ContactBatch&) {
      if (my_rank == ranks - 1) throw std::runtime_error("the disk is full");
    });
  });
  EXPECT_EQ(said, rank + "the disk is full");
  detector.options().own.low[0] = NAN;
  said = error_of([&] { detector.detect(part_of(good.input, my_rank, ranks), {}); });
  EXPECT_NE(said.find("is not a number along x"), std::string::npos) << said;
  EXPECT_FALSE(said.starts_with("rank")) << said;  // the same on all
  detector.options().own = {};
  const Sphere ball{0, 0, 0, 1.0 + my_rank};
  const Shape shape{&ball, 1};
  Input different = part_of(good.input, my_rank, ranks);
  different.shapes = {&shape, 1};
  said = error_of([&] { detector.detect(different, {}); });
  EXPECT_EQ(said.find("different shapes") != std::string::npos, ranks > 1) << said;
  RankOptions absent = on_cpu();
  if (my_rank == ranks - 1) absent.device = {BackendKind::cuda, 1000};
  said = error_of([&] { RankDetector(MPI_COMM_WORLD, absent); });
  EXPECT_TRUE(said.starts_with(rank) && said != "") << said;
  expect_as_one(good.input, part_of(good.input, my_rank, ranks), detector);
}

TEST(Ranks, OneFileHoldsTheContactsOfAll) {
  const Arranged a(random_scene(5000, 1, 0.2, 13), Scalar::f32);
  RankOptions o = on_cpu();
  o.detector.width = Width::pairs;
  RankDetector detector(MPI_COMM_WORLD, o);
  const std::string path = testing::TempDir() + "/padder_ranks_" + std::to_string(ranks) + ".npy";
  {
    RankContactFile file(MPI_COMM_WORLD, path, o.detector.width, o.detector.scalar);
    detector.detect(part_of(a.input, my_rank, ranks), file.consumer());
    EXPECT_FALSE(std::filesystem::exists(path));
    MPI_Barrier(MPI_COMM_WORLD);
    file.finish();
  }
  MPI_Barrier(MPI_COMM_WORLD);
  std::ifstream in(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  EXPECT_EQ(bytes.size(), 256 + detector.report().contacts * sizeof(WidePair));
  EXPECT_NE(bytes.find("'shape': (" + std::to_string(detector.report().contacts) + ",)"), std::string::npos);
  std::uint64_t hash = 0;
  for (std::size_t k = 256; k + sizeof(WidePair) <= bytes.size(); k += sizeof(WidePair)) {
    WidePair p;
    std::memcpy(&p, &bytes[k], sizeof p);
    hash += wide_pair_hash(p.i, p.j);
  }
  EXPECT_EQ(hash, detector.report().hash);
  MPI_Barrier(MPI_COMM_WORLD);
  if (my_rank == 0) std::filesystem::remove(path);
  {
    RankContactFile file(MPI_COMM_WORLD, path, o.detector.width, o.detector.scalar);
    detector.detect(part_of(a.input, my_rank, ranks), file.consumer());
  }  // never finished
  MPI_Barrier(MPI_COMM_WORLD);
  EXPECT_FALSE(std::filesystem::exists(path) || std::filesystem::exists(path + ".part"));
  const auto make = [](const std::string& name) {
    return error_of([&] { RankContactFile(MPI_COMM_WORLD, name, Width::pairs, Scalar::f32); });
  };
  EXPECT_NE(make("/no/such/folder/c.npy").find("/no/such/folder/c.npy"), std::string::npos);
  EXPECT_NE(make("c.csv").find(".npy"), std::string::npos);
}

}  // namespace
}  // namespace padder::detect

int main(int argc, char** argv) { return padder::detect::run_tests(argc, argv); }
