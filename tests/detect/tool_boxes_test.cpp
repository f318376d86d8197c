// SPDX-License-Identifier: MIT
// The program detect with --devices and --memory, run as a user runs it: the hash is that of one box.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "detect/scene/generate.h"
#include "padding/asset/npz.h"
#include "tests/program_test.h"

namespace padder::detect {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class DetectBoxes : public ProgramTest {
 protected:
  // spheres.npy, spheres.npz, and a scene of each.
  void write_spheres(std::uint64_t n) const { write_spheres(generate("dense", n)); }
  void write_spheres(const std::vector<FloatSphere>& spheres) const {
    const std::uint64_t n = spheres.size();
    std::vector<float> all, centers, radii;
    for (const FloatSphere& s : spheres) {
      all.insert(all.end(), {s.x, s.y, s.z, s.r}), centers.insert(centers.end(), {s.x, s.y, s.z});
      radii.push_back(s.r);
    }
    const std::string zip =
        npz_bytes({{"a", npy_array(all.data(), {n, 4})}});  // stored: the .npy lies in it as it is
    const auto begin = zip.find("\x93NUMPY");
    write_file(folder_ / "spheres.npy", zip.substr(begin, zip.find("PK\x01\x02") - begin));
    write_file(folder_ / "spheres.npz", npz_bytes({{"centers", npy_array(centers.data(), {n, 3})},
                                                   {"radii", npy_array(radii.data(), {n})}}));
    for (const std::string ending : {"npy", "npz"})
      write_file(
          folder_ / (ending + ".json"),
          R"({"format": "padder.scene", "version": 1, "spheres": [{"file": "spheres.)" + ending + "\"}]}");
  }

  Outcome run(const std::string& arguments, const std::string& before = "") const {
    return ProgramTest::run("detect", arguments, before);
  }
  std::string hash(const std::string& arguments) const {
    const Outcome r = run(arguments + " -q --hash");
    EXPECT_EQ(r.code, 0) << arguments << ": " << r.err;
    return r.out;
  }
};

TEST_F(DetectBoxes, EveryWayOfReadingAndSharingHasTheHashOfOneBox) {
  write_spheres(30000);
  const std::string wanted = hash("npz.json --backend omp");
  EXPECT_EQ(wanted.size(), 17u);
  for (const char* arguments :
       {"npy.json", "spheres.npy", "spheres.npz", "npz.json --backend omp --devices 3",
        "npz.json --devices all", "npy.json --backend omp --memory 400K",
        "spheres.npy --backend omp --devices 2 --memory 1M",
        "npy.json --backend omp --threads 64 --memory 1M",
        "spheres.npz --path nine-stages --backend omp --devices 2"})
    EXPECT_EQ(hash(arguments), wanted) << arguments;
}

// Mapped or read, named or given: numbers of any type.
TEST_F(DetectBoxes, OneAnswerForNumbersOfAnyType) {
  const std::vector<double> doubles = {0, 0, 0, 1, 0, 0, 5, 0, 0};
  const std::vector<std::int64_t> whole = {0, 0, 0, 1, 0, 0, 5, 0, 0}, ones = {1, 1, 1};
  const std::vector<float> floats = {1, 1, 1};
  const NpyArray c = npy_array(doubles.data(), {3, 3}), r = npy_array(floats.data(), {3});
  const NpyArray c_whole = npy_array(whole.data(), {3, 3}), r_whole = npy_array(ones.data(), {3});
  const std::string scene =
      R"({"format": "padder.scene", "version": 1, "spheres": [{"file": "spheres.npz"}]})";
  write_file(folder_ / "npz.json", scene);
  for (const auto& [centers, radii] : {std::pair(c, r), {c, r_whole}, {c_whole, r}, {c_whole, r_whole}}) {
    write_file(folder_ / "spheres.npz", npz_bytes({{"centers", centers}, {"radii", radii}}));
    for (const char* arguments : {"npz.json", "spheres.npz", "npz.json --memory 1G", "npz.json --devices 2",
                                  "spheres.npz -o contacts.npy"}) {
      const Outcome o = run(arguments + std::string(" --backend omp --json"));
      ASSERT_EQ(o.code, 0) << arguments << ": " << o.err;
      EXPECT_EQ(Json::parse(o.out)["contacts"], 1) << arguments;
    }
  }
}

// Spheres of a lattice that just touch: a contact whose midpoint lies on a face between boxes is owned by the
// box that one of the two only touches.
TEST_F(DetectBoxes, ContactsOnTheFacesOfBoxesHaveTheSameHash) {
  std::vector<FloatSphere> lattice;
  for (int k = 0; k < 8000; k++)
    lattice.push_back(
        {static_cast<float>(k % 20), static_cast<float>(k / 20 % 20), static_cast<float>(k / 400), 0.5f});
  write_spheres(lattice);
  const std::string wanted = hash("spheres.npz --backend omp");
  for (const char* arguments :
       {"spheres.npz --backend omp --devices 2", "spheres.npy --backend omp --memory 500K"})
    EXPECT_EQ(hash(arguments), wanted) << arguments;
}

// The system itself keeps the limit: memory that a program writes to, the mapped file not included.
TEST_F(DetectBoxes, AFileTenTimesTheMemoryHasTheSameHash) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer takes more memory than the limit";
#endif
  write_spheres(2000000);
  const std::uint64_t size = fs::file_size(folder_ / "spheres.npy"), limit = size / 10;
  EXPECT_GT(size, 2 * 16000000u);  // twice what ulimit allows
  const Outcome small = run("spheres.npy --backend omp --threads 1 --json --memory " + std::to_string(limit),
                            "ulimit -d 16000 && OMP_STACKSIZE=1M");
  ASSERT_EQ(small.code, 0) << small.err;
  const Json found = Json::parse(small.out);
  const Json wanted = Json::parse(run("npy.json --backend omp --json").out);
  EXPECT_EQ(found["hash"], wanted["hash"]);
  EXPECT_EQ(found["contacts"], wanted["contacts"]);
  EXPECT_LE(found["memory"].get<std::uint64_t>(), limit);
  EXPECT_GT(found["memory_boxes"], 10);
  EXPECT_NE(run("npy.json --backend omp --threads 1", "ulimit -d 16000 && OMP_STACKSIZE=1M").code, 0)
      << "without boxes the limit should be too small";
}

TEST_F(DetectBoxes, FilesOfContacts) {
  write_spheres(5000);
  ASSERT_EQ(run("npz.json --backend omp -o one.csv").code, 0);
  ASSERT_EQ(run("npz.json --backend omp --devices 3 -o boxes.csv").code, 0);
  EXPECT_EQ(read_file(folder_ / "one.csv"), read_file(folder_ / "boxes.csv"));
  const Outcome streamed = run("npz.json --backend omp --devices 2 --memory 2M -o contacts.npy --json");
  ASSERT_EQ(streamed.code, 0) << streamed.err;
  const std::uint64_t contacts = Json::parse(streamed.out)["contacts"];
  // i, j, normal, depth, and both points in double
  const std::uint64_t size = fs::file_size(folder_ / "contacts.npy"), each = 16 + 10 * 8;
  EXPECT_GE(size, contacts * each + 64);
  EXPECT_LT(size, contacts * each + 1024);
}

TEST_F(DetectBoxes, WrongUsageIsASentence) {
  write_spheres(100);
  const auto expect_said = [&](const std::string& arguments, int code, const std::string& words) {
    const Outcome r = run(arguments);
    EXPECT_EQ(r.code, code) << arguments;
    EXPECT_NE(r.err.find(words), std::string::npos) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  };
  for (const char* memory : {"0", "-1", "12Q", "1e9", "20GB", "nan", ""})
    expect_said(std::string("npy.json --memory '") + memory + "'", 2, "--memory");
  expect_said("npy.json --devices 1000", 1, "");
  expect_said("npy.json --devices none", 2, "or all");
  expect_said("npy.json --memory 10", 1, "raise the limit");
  expect_said("npy.json --memory 1M -o c.csv", 2, "write a .npy");
  expect_said("spheres.npy --stages", 2, "--stages");
  expect_said("spheres.npy --copies 2", 2, "--copies");
  expect_said("npy.json --devices 2 --backend omp -o c.txt", 2, "cannot tell the format");
  EXPECT_FALSE(fs::exists(folder_ / "c.csv"));
  const std::string mapped = read_file(folder_ / "spheres.npy");
  expect_said("spheres.npy --backend omp -o spheres.npy", 2, "a file that this run reads");
  expect_said("npy.json --backend omp --memory 1M -o ./spheres.npy", 2, "a file that this run reads");
  EXPECT_EQ(read_file(folder_ / "spheres.npy"), mapped);
  write_spheres(5000);
  expect_said("npy.json --backend omp --memory 64K", 1, "raise the limit");
}

}  // namespace
}  // namespace padder::detect
