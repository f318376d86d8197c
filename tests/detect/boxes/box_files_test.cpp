// SPDX-License-Identifier: MIT
// Spheres from mapped files, contacts to a file.

#include <cstring>

#include "detect/boxes/boxed_detector.h"
#include "detect/boxes/contact_writer.h"
#include "detect/scene/sphere_file.h"
#include "padding/asset/npz.h"
#include "tests/detect/boxes/boxed_scene.h"
#include "tests/error_of.h"
#include "tests/temporary_folder.h"

namespace padder::detect {
namespace {

std::filesystem::path place(const std::string& name) {
  static const TemporaryFolder folder;
  return folder.path() / name;
}

// An .npy as NumPy writes it: taken out of an archive that holds it alone.
std::string npy(const NpyArray& array) {
  const std::string zip = npz_bytes({{"a", array}});
  const auto begin = zip.find("\x93NUMPY");
  return zip.substr(begin, zip.find("PK\x01\x02") - begin);
}

struct Files {
  TestScene scene = random_scene(20000, 4, 0.5, 13).rounded();
  std::vector<float> four, centers, radii;
  std::vector<std::uint32_t> family, mask;
  Files() {
    for (std::size_t k = 0; k < scene.spheres.size(); k++) {
      const Sphere& s = scene.spheres[k];
      for (const double v : {s.x, s.y, s.z, s.r}) four.push_back(static_cast<float>(v));
      for (const double v : {s.x, s.y, s.z}) centers.push_back(static_cast<float>(v));
      radii.push_back(static_cast<float>(s.r));
      family.push_back(static_cast<std::uint32_t>(k % 5)), mask.push_back(static_cast<std::uint32_t>(k % 3));
    }
  }
  std::uint64_t n() const { return scene.spheres.size(); }
  std::uint64_t hash(bool tags) const {
    TestScene s = scene;
    if (tags) s.family = family, s.mask = mask;
    const Arranged a(s, Scalar::f32);
    Detector one = one_on_the_cpu(on_the_cpu(1).detector);
    one.detect(a.input);
    return one.hash();
  }
};

std::uint64_t hash_of(const SphereFile& file) {
  Input input;
  input.spheres = file.spheres();
  BoxOptions o = on_the_cpu(0, 2);
  o.memory_limit = 2 << 20;
  BoxedDetector boxed(o);
  return boxed.detect(input, {}).hash;
}

TEST(SphereFile, MappedSpheresGiveTheSameHash) {
  const Files f;
  const std::uint64_t shape = f.n();
  write_file(place("spheres.npy"), npy(npy_array(f.four.data(), {shape, 4})));
  EXPECT_EQ(hash_of(SphereFile(place("spheres.npy"))), f.hash(false));
  Npz arrays{{"centers", npy_array(f.centers.data(), {shape, 3})},
             {"radii", npy_array(f.radii.data(), {shape})}};
  write_file(place("spheres.npz"), npz_bytes(arrays));
  EXPECT_EQ(hash_of(SphereFile(place("spheres.npz"))), f.hash(false));
  arrays["family"] = npy_array(f.family.data(), {shape}), arrays["mask"] = npy_array(f.mask.data(), {shape});
  write_file(place("tagged.npz"), npz_bytes(arrays));
  EXPECT_EQ(hash_of(SphereFile(place("tagged.npz"))), f.hash(true));
  const std::vector<std::int64_t> families(f.family.begin(), f.family.end());  // NumPy's default
  const std::vector<double> masks(f.mask.begin(), f.mask.end());
  arrays["family"] = npy_array(families.data(), {shape}), arrays["mask"] = npy_array(masks.data(), {shape});
  write_file(place("converted.npz"), npz_bytes(arrays));
  EXPECT_EQ(hash_of(SphereFile(place("converted.npz"))), f.hash(true));
  arrays["mask"] = npy_array(f.mask.data(), {shape});
  arrays["world"] = npy_array(f.family.data(), {shape}), arrays.erase("family"), arrays.erase("mask");
  write_file(place("worlds.npz"), npz_bytes(arrays));
  Arranged worlds(f.scene, Scalar::f32);
  worlds.input.spheres.world = f.family.data();
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  one.detect(worlds.input);
  EXPECT_EQ(hash_of(SphereFile(place("worlds.npz"))), one.hash());
}

TEST(SphereFile, ADamagedByteIsFoundByTheChecksum) {
  const Files f;
  std::string bytes = npz_bytes(
      {{"centers", npy_array(f.centers.data(), {f.n(), 3})}, {"radii", npy_array(f.radii.data(), {f.n()})}});
  write_file(place("sound.npz"), bytes);
  SphereFile(place("sound.npz")).check();
  bytes[bytes.size() / 2] ^= 0x10;
  write_file(place("damaged.npz"), bytes);
  const SphereFile damaged(place("damaged.npz"));
  EXPECT_NE(error_of([&] { damaged.check(); }).find("centers is damaged"), std::string::npos);
}

TEST(SphereFileDeathTest, AFileThatIsShortenedWhileItIsReadEndsTheProgramWithASentence) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const Files f;
  write_file(place("shortened.npy"), npy(npy_array(f.four.data(), {f.n(), 4})));
  const auto read = [] {
    SphereFile::end_program_if_shortened("detect", [] { (void)::write(STDERR_FILENO, "cleaned; ", 9); });
    const SphereFile file(place("shortened.npy"));
    std::filesystem::resize_file(place("shortened.npy"), 8192);
    hash_of(file);
  };
  EXPECT_EXIT(
      read(), testing::ExitedWithCode(1),
      "cleaned; detect: .*shortened.npy: the file was shortened while it was read: leave it as it is");
}

// NumPy's own archives put arrays at any address.
TEST(SphereFile, ArraysMayBeginAtAnyAddress) {
  const Files f;
  std::string bytes(7, ' ');
  bytes.append(reinterpret_cast<const char*>(f.four.data()), f.four.size() * sizeof(float));
  std::string tags(3, ' ');
  tags.append(reinterpret_cast<const char*>(f.family.data()), f.family.size() * sizeof(std::uint32_t));
  Input input;
  input.spheres = {f.n(), Scalar::f32, Memory::host, bytes.data() + 7, bytes.data() + 7 + 12, 4, 4};
  input.spheres.family = reinterpret_cast<const std::uint32_t*>(tags.data() + 3);
  TestScene s = f.scene;
  s.family = f.family;
  const Arranged a(s, Scalar::f32);
  Detector one = one_on_the_cpu(on_the_cpu(1).detector);
  one.detect(a.input);
  BoxedDetector boxed(on_the_cpu(5));
  EXPECT_EQ(boxed.detect(input, {}).hash, one.hash());
}

std::string failure(const std::filesystem::path& path) {
  return error_of([&] { const SphereFile file(path); });
}

TEST(SphereFile, WhatIsNoFileOfSpheresIsNamed) {
  const Files f;
  const auto refused = [&](const std::string& name, const std::string& bytes, const std::string& reason) {
    write_file(place(name), bytes);
    const std::string said = failure(place(name));
    EXPECT_NE(said.find(reason), std::string::npos) << said;
    EXPECT_NE(said.find(name), std::string::npos) << said;
  };
  EXPECT_NE(failure(place("absent.npy")).find("there is no such file"), std::string::npos);
  refused("spheres.txt", "x", ".npy or .npz");
  refused("empty.npy", "", "empty");
  refused("other.npy", "not an array at all", "no NumPy array");
  refused("flat.npy", npy(npy_array(f.four.data(), {4 * f.n()})), "(N, 4)");
  const std::string whole = npy(npy_array(f.four.data(), {f.n(), 4}));
  refused("cut.npy", whole.substr(0, whole.size() / 2), "does not fit its shape");
  refused("tags.npy", npy(npy_array(f.family.data(), {f.n() / 4, 4})), "float32 or float64");
  refused("other.npz", "not an archive", "no zip archive");
  const NpyArray centers = npy_array(f.centers.data(), {f.n(), 3}),
                 radii = npy_array(f.radii.data(), {f.n()});
  refused("half.npz", npz_bytes({{"centers", centers}}), "are needed");
  refused("short.npz", npz_bytes({{"centers", centers}, {"radii", npy_array(f.radii.data(), {f.n() - 1})}}),
          "shape (N)");
  refused("mixed.npz", npz_bytes({{"centers", centers}, {"radii", radii}, {"mask", radii}}),
          "mask: a whole number from 0 to 4294967295 is wanted");
  refused("few.npz",
          npz_bytes({{"centers", centers}, {"radii", radii}, {"world", npy_array(f.family.data(), {3})}}),
          "world: one number for each sphere is wanted");
  const std::string zip = npz_bytes({{"centers", centers}, {"radii", radii}});
  refused("cut.npz", zip.substr(0, zip.size() / 2), "no zip archive");
  std::string damaged = zip;
  damaged[damaged.size() - 6] ^= 0x55;  // where the directory begins
  refused("damaged.npz", damaged, "damaged");
}

// The file as bytes: head, then records without gaps.
TEST(ContactWriter, RecordsAreThoseOfTheList) {
  const Files f;
  const Arranged a(f.scene, Scalar::f32);
  for (const Width width : {Width::pairs, Width::normals, Width::points})
    for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
      BoxOptions o = on_the_cpu(4);
      o.detector.width = width, o.detector.scalar = scalar;
      BoxedDetector boxed(o);
      ContactWriter writer(place("contacts.npy"), width, scalar);
      boxed.detect(a.input, writer.consumer());
      writer.finish();
      const std::string bytes = read_file(place("contacts.npy"));
      const Contacts& c = boxed.detect(a.input);
      const std::size_t real = scalar == Scalar::f32 ? 4 : 8;
      const std::size_t record =
          16 + (width == Width::pairs ? 0 : 4 * real) + (width == Width::points ? 6 * real : 0);
      ASSERT_EQ(bytes.size(), 256 + c.count * record);
      EXPECT_NE(bytes.find("'shape': (" + std::to_string(c.count) + ",)"), std::string::npos);
      EXPECT_EQ(bytes[255], '\n');
      for (std::uint64_t k = 0; k < c.count; k++) {
        const char* at = bytes.data() + 256 + k * record;
        std::uint64_t pair[2];
        std::memcpy(pair, at, 16);
        ASSERT_EQ(pair[0], c.pairs[k].i);
        ASSERT_EQ(pair[1], c.pairs[k].j);
        if (c.normals) {
          ASSERT_EQ(std::memcmp(at + 16, static_cast<const char*>(c.normals) + k * 4 * real, 4 * real), 0);
        }
        if (c.points) {
          const char* wanted = static_cast<const char*>(c.points) + k * 6 * real;
          ASSERT_EQ(std::memcmp(at + 16 + 4 * real, wanted, 6 * real), 0);
        }
      }
    }
}

TEST(ContactWriter, WithoutFinishNothingIsLeft) {
  const std::filesystem::path folder = place("writer_folder");
  std::filesystem::create_directory(folder);
  { const ContactWriter writer(folder / "contacts.npy", Width::pairs, Scalar::f32); }
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  EXPECT_THROW(ContactWriter(folder / "contacts.csv", Width::pairs, Scalar::f32), Error);
  ContactWriter writer(folder / "contacts.npy", Width::pairs, Scalar::f32);
  ContactBatch other;
  other.width = Width::normals;
  EXPECT_THROW(writer.consumer()(other), Error);
}

}  // namespace
}  // namespace padder::detect
