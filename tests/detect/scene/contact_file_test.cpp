// SPDX-License-Identifier: MIT
// Contacts as files: sorted, every number back to its last bit from each format, whole or not at all, and on
// memory that does not grow with them.
#include "detect/scene/contact_file.h"

#include <malloc.h>
#include <sys/resource.h>

#include <atomic>
#include <bit>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "tests/detect/oracle.h"
#include "tests/error_of.h"
#include "tests/temporary_folder.h"

// Every allocation of this program is counted: the bytes held, and the most since somebody last asked.
namespace {
std::atomic<std::int64_t> held{0}, most{0};
[[maybe_unused]] void count(std::int64_t bytes) {
  const std::int64_t now = held += bytes;
  for (std::int64_t seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
  }
}
}  // namespace

#if !defined(__SANITIZE_THREAD__)  // its runtime defines them itself
void* operator new(std::size_t bytes) {
  void* const p = std::malloc(bytes);
  if (!p) throw std::bad_alloc();
  count(static_cast<std::int64_t>(malloc_usable_size(p)));
  return p;
}
void operator delete(void* p) noexcept {
  if (p) count(-static_cast<std::int64_t>(malloc_usable_size(p)));
  std::free(p);
}
void operator delete(void* p, std::size_t) noexcept { operator delete(p); }
#endif

namespace padder::detect {
namespace {

namespace fs = std::filesystem;

// Contacts and the spheres that they are of.
struct ContactTable {
  TestScene scene;
  std::vector<Pair> pairs;

  Contacts contacts() const {
    Contacts c;
    c.count = pairs.size(), c.pairs = pairs.data();
    return c;
  }
  Geometry record(std::size_t k) const {
    return geometry(scene.spheres[pairs[k].i], scene.spheres[pairs[k].j]);
  }
};

class ContactFileTest : public testing::Test, protected TemporaryFolder {
 protected:
  void write(const ContactTable& t, const std::string& name, int threads = 0) const {
    write_contacts(t.contacts(), Arranged(t.scene, Scalar::f64).input, folder_ / name, threads);
  }
  std::string written(const ContactTable& t, const std::string& name, int threads = 0) const {
    write(t, name, threads);
    return read_file(folder_ / name);
  }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::recursive_directory_iterator(folder_), {}));
  }
};

ContactTable found_in(const TestScene& s) {
  const Arranged arranged(s, Scalar::f64);
  CallOptions o;
  o.width = Width::pairs, o.order = Order::any;
  Detector d({BackendKind::omp}, o);
  const auto pairs = d.detect(arranged.input).pair_span();
  return {s, {pairs.begin(), pairs.end()}};
}

// A row of spheres, each of which touches the next one: as many contacts as wanted, in no order.
ContactTable many(std::uint32_t count) {
  ContactTable t;
  t.scene.spheres.reserve(count + 1), t.pairs.reserve(count);
  for (std::uint32_t k = 0; k <= count; k++) t.scene.spheres.push_back({1. * k, 0, 0, 0.5 + 1 / (k + 3.)});
  for (std::uint32_t k = 0; k < count; k++) {
    const std::uint32_t i = static_cast<std::uint32_t>(k * std::uint64_t(2654435761) % count);
    t.pairs.push_back({i, i + 1});
  }
  return t;
}

// What a record may hold, and what a printer of numbers stumbles over.
ContactTable odd_numbers() {
  const double odd[] = {0.1,
                        1. / 3,
                        -0.,
                        5e-324,
                        2.2250738585072014e-308,
                        -1e99,
                        1e22,
                        123456789012345680.,
                        1 + 0x1p-52,
                        -9007199254740993.};
  ContactTable t;
  for (std::uint32_t k = 0; k < 10; k++) {
    t.scene.spheres.push_back({odd[k], odd[(k + 1) % 10], odd[(k + 3) % 10], std::abs(odd[(k + 7) % 10])});
    if (k > 0) t.pairs.push_back({0, k}), t.pairs.push_back({k - 1, k});
  }
  t.pairs.erase(t.pairs.begin());  // 0, 1 twice
  t.pairs = sorted(t.pairs);
  return t;
}

std::vector<double> row_of(const ContactTable& t, std::size_t k) {
  const Geometry g = t.record(k);
  return {g.normal[0], g.normal[1], g.normal[2], g.depth,   g.on_i[0],
          g.on_i[1],   g.on_i[2],   g.on_j[0],   g.on_j[1], g.on_j[2]};
}
void expect_same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); k++)
    ASSERT_EQ(std::bit_cast<std::uint64_t>(a[k]), std::bit_cast<std::uint64_t>(b[k])) << k << ": " << a[k];
}

TEST_F(ContactFileTest, SmallSceneInEveryFormat) {
  TestScene s;
  s.spheres = {{5, 0, 0, 1}, {0, 0, 0, 1}, {1.5, 0, 0, 1}, {6, 0, 0, 1}};
  const ContactTable t = found_in(s);
  EXPECT_EQ(written(t, "c.csv"),
            "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n0,3,1,0,0,1,6,0,0,5,0,0\n1,2,1,0,0,0.5,1,0,0,0.5,0,0\n");
  const Npz z = npz_from_bytes(written(t, "c.npz"), "c.npz");
  EXPECT_EQ(z.at("pairs").as<std::uint32_t>(), (std::vector<std::uint32_t>{0, 3, 1, 2}));
  EXPECT_EQ(z.at("depths").as<double>(), (std::vector<double>{1, 0.5}));
  EXPECT_EQ(z.at("points_j").as<double>(), (std::vector<double>{5, 0, 0, 0.5, 0, 0}));
  EXPECT_NE(written(t, "c.vtp").find("NumberOfPoints=\"2\""), std::string::npos);
}

// Many blocks, by one thread and by several: the same bytes, the checksums of the archive among them.
TEST_F(ContactFileTest, ThreadsWriteTheSameBytes) {
  const ContactTable t = many(50000);
  for (const char* name : {"c.csv", "c.npz", "c.vtp"}) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(written(t, name, 1) == written(t, name, 5));
  }
  const auto pairs = npz_from_bytes(read_file(folder_ / "c.npz"), "c.npz").at("pairs").as<std::uint32_t>();
  for (std::uint32_t k = 0; k < 50000; k++) ASSERT_EQ(pairs[2 * k], k);
  const std::string whole =
      " -c 'import sys, zipfile; sys.exit(zipfile.ZipFile(sys.argv[1]).testzip() != None)' ";
  EXPECT_EQ(std::system((PADDER_PYTHON + whole + (folder_ / "c.npz").string()).c_str()), 0);
}

// The records of these contacts alone are 88 MB, a text of them 200 MB.
TEST_F(ContactFileTest, MemoryDoesNotGrowWithTheContacts) {
  const ContactTable t = many(1000000);
  const Arranged scene(t.scene, Scalar::f64);
  for (const char* name : {"c.csv", "c.npz", "c.vtp"}) {
    SCOPED_TRACE(name);
    const std::int64_t before = held;
    most = before;
    write_contacts(t.contacts(), scene.input, folder_ / name, 16);
    EXPECT_LT(most - before, 64 << 20);
    fs::remove(folder_ / name);
  }
}

// A disk with room for a part of the file only: what the system says of it is said, and nothing is left.
TEST_F(ContactFileTest, FullDisk) {
  const ContactTable t = many(50000);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old;
  ::getrlimit(RLIMIT_FSIZE, &old);
  const rlimit small{1 << 20, old.rlim_max};
  for (const char* name : {"c.csv", "c.npz", "c.vtp"}) {
    SCOPED_TRACE(name);
    write_file(folder_ / name, "old");
    ::setrlimit(RLIMIT_FSIZE, &small);
    const std::string said = error_of([&] { write(t, name); });
    ::setrlimit(RLIMIT_FSIZE, &old);
    EXPECT_EQ(said, "cannot write " + (folder_ / name).string() +
                        " (File too large): check that the folder exists, may be written and has room");
    EXPECT_EQ(read_file(folder_ / name), "old");
    fs::remove(folder_ / name);
    EXPECT_EQ(entries(), 0u);
  }
  std::signal(SIGXFSZ, handler);
}

TEST_F(ContactFileTest, CsvGivesEveryBitBack) {
  const ContactTable t = odd_numbers();
  std::istringstream in(written(t, "c.csv"));
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz");
  std::size_t k = 0;
  for (; std::getline(in, line); k++) {
    std::vector<std::string> cells;
    std::istringstream of(line);
    for (std::string cell; std::getline(of, cell, ',');) cells.push_back(cell);
    ASSERT_EQ(cells.size(), 12u);
    EXPECT_EQ(cells[0], std::to_string(t.pairs[k].i));
    EXPECT_EQ(cells[1], std::to_string(t.pairs[k].j));
    std::vector<double> row;
    for (std::size_t c = 2; c < 12; c++) row.push_back(std::strtod(cells[c].c_str(), nullptr));
    expect_same_bits(row, row_of(t, k));
  }
  EXPECT_EQ(k, t.pairs.size());
}

// The array called `name`, or the positions for "", by what a .vtp says of itself: each array is at its
// offset in the appended part, its size before it.
template <class T>
std::vector<T> vtp_array(const std::string& file, const std::string& name) {
  const std::size_t mark = file.find('_', file.find("<AppendedData"));
  const std::size_t at =
      name.empty() ? file.find("<DataArray", file.find("<Points>")) : file.find("Name=\"" + name + "\"");
  const std::size_t offset = file.find("offset=\"", at) + 8;
  const char* from = file.data() + mark + 1 + std::strtoull(file.data() + offset, nullptr, 10);
  std::uint64_t bytes;
  std::memcpy(&bytes, from, 8);
  std::vector<T> values(bytes / sizeof(T));
  std::memcpy(values.data(), from + 8, bytes);
  return values;
}

TEST_F(ContactFileTest, VtpHoldsWhatItsHeaderSays) {
  TestScene s;
  s.spheres = {{0, 0, 0, 1}, {1.5, 0, 0, 1}, {0, 1, 0, 0.25}};
  const ContactTable t = found_in(s);
  ASSERT_EQ(t.pairs.size(), 2u);
  const std::string file = written(t, "c.vtp");
  ASSERT_NE(file.find("<AppendedData encoding=\"raw\">\n_"), std::string::npos);
  ASSERT_NE(file.find("header_type=\"UInt64\""), std::string::npos);
  EXPECT_EQ(vtp_array<std::uint32_t>(file, "i"), (std::vector<std::uint32_t>{0, 0}));
  EXPECT_EQ(vtp_array<std::uint32_t>(file, "j"), (std::vector<std::uint32_t>{1, 2}));
  EXPECT_EQ(vtp_array<double>(file, "normal"), (std::vector<double>{1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(vtp_array<double>(file, "depth"), (std::vector<double>{0.5, 0.25}));
  // Halfway between the two points of each.
  EXPECT_EQ(vtp_array<double>(file, ""), (std::vector<double>{0.75, 0, 0, 0, 0.875, 0}));
  EXPECT_EQ(vtp_array<std::int64_t>(file, "connectivity"), (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(vtp_array<std::int64_t>(file, "offsets"), (std::vector<std::int64_t>{1, 2}));
}

// More contacts than are sorted at a time: the second run goes on where the first one ended.
TEST_F(ContactFileTest, SeveralRuns) {
  const std::uint32_t count = (1 << 22) + 5000;
  const std::string file = written(many(count), "c.vtp");
  const auto i = vtp_array<std::uint32_t>(file, "i");
  const auto depths = vtp_array<double>(file, "depth");
  const auto vertices = vtp_array<std::int64_t>(file, "connectivity"),
             ends = vtp_array<std::int64_t>(file, "offsets");
  ASSERT_EQ(i.size(), count);
  for (std::uint32_t k = 0; k < count; k++) {
    ASSERT_EQ(i[k], k);
    ASSERT_NEAR(depths[k], 1 / (k + 3.) + 1 / (k + 4.), 1e-9) << k;
    ASSERT_EQ(vertices[k], k);
    ASSERT_EQ(ends[k], k + 1);
  }
}

TEST_F(ContactFileTest, NoContacts) {
  EXPECT_EQ(written({}, "c.csv"), "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n");
  const Npz z = npz_from_bytes(written({}, "c.npz"), "c.npz");
  EXPECT_EQ(z.at("pairs").shape, (std::vector<std::uint64_t>{0, 2}));
  EXPECT_EQ(z.at("points_i").shape, (std::vector<std::uint64_t>{0, 3}));
  EXPECT_NE(written({}, "c.vtp").find("NumberOfPoints=\"0\""), std::string::npos);
}

// A list in the detector's order is sorted in the file, where each pair has its record. Bodies at poses of
// their own and of the call, and loose spheres whose arrays begin at odd addresses.
TEST_F(ContactFileTest, ANpzIsSortedAndHasTheBitsOfADetectorsRecords) {
  const TestScene s = random_scene(1500, 4, 0.8, 21).rounded();
  const std::vector<Shape> shapes = {{s.spheres.data(), 200}, {s.spheres.data() + 200, 1}, {nullptr, 0}};
  std::mt19937_64 random(21);
  std::vector<Body> bodies(40);
  std::vector<Pose> poses(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); k++) {
    rotation_of(signed_unit(random), signed_unit(random), signed_unit(random), signed_unit(random),
                bodies[k].rotation);
    rotation_of(signed_unit(random), signed_unit(random), signed_unit(random), signed_unit(random),
                poses[k].rotation);
    for (int a = 0; a < 3; a++)
      bodies[k].position[a] = 9 * signed_unit(random), poses[k].position[a] = 9 * signed_unit(random);
    bodies[k].shape = static_cast<std::uint32_t>(k % 3), bodies[k].is_static = k % 5 == 0;
  }
  for (const Scalar scalar : {Scalar::f32, Scalar::f64}) {
    const Arranged loose(s, scalar);
    Input input = loose.input;
    std::vector<char> moved(1 + 1500 * 4 * (scalar == Scalar::f32 ? 4 : 8));
    std::memcpy(moved.data() + 1, input.spheres.centers, moved.size() - 1);
    input.shapes = shapes, input.bodies = bodies;
    for (const bool posed : {false, true}) {
      input.poses = posed ? poses.data() : nullptr;
      CallOptions o;
      o.width = Width::points, o.scalar = Scalar::f64;
      Detector d({BackendKind::omp}, o);
      const Contacts c = d.detect(input);
      ASSERT_GT(c.count, 1000u);
      Input odd = input;
      odd.spheres.centers = moved.data() + 1;
      odd.spheres.radii = moved.data() + 1 + 3 * (scalar == Scalar::f32 ? 4 : 8);
      write_contacts(c, odd, folder_ / "c.npz");
      const Npz z = npz_from_bytes(read_file(folder_ / "c.npz"), "c.npz");
      const auto pairs = z.at("pairs").as<std::uint32_t>();
      const auto normals = z.at("normals").as<double>(), depths = z.at("depths").as<double>(),
                 on_i = z.at("points_i").as<double>(), on_j = z.at("points_j").as<double>();
      const std::vector<Pair> wanted = sorted(c.pair_span());
      EXPECT_FALSE(std::ranges::equal(c.pair_span(), wanted)) << "was sorted already";
      ASSERT_EQ(pairs.size(), 2 * c.count);
      for (std::size_t k = 0; k < c.count; k++)
        ASSERT_EQ((Pair{pairs[2 * k], pairs[2 * k + 1]}), wanted[k]) << "row " << k;
      EXPECT_EQ(z.at("pairs").shape, (std::vector<std::uint64_t>{c.count, 2}));
      EXPECT_EQ(z.at("depths").shape, (std::vector<std::uint64_t>{c.count}));
      for (const char* name : {"normals", "points_i", "points_j"})
        EXPECT_EQ(z.at(name).shape, (std::vector<std::uint64_t>{c.count, 3})) << name;
      EXPECT_TRUE(z.size() == 5 && z.at("pairs").kind == 'u' && z.at("pairs").size == 4);
      for (std::size_t k = 0; k < c.count; k++) {
        const auto at = std::size_t(std::ranges::lower_bound(wanted, c.pairs[k], before) - wanted.begin());
        const Normal<double>& n = c.normal_span<double>()[k];
        const Points<double>& p = c.point_span<double>()[k];
        expect_same_bits({normals[3 * at], normals[3 * at + 1], normals[3 * at + 2], depths[at]},
                         {n.x, n.y, n.z, n.depth});
        expect_same_bits({on_i.begin() + 3 * at, on_i.begin() + 3 * at + 3}, {p.on_i, p.on_i + 3});
        expect_same_bits({on_j.begin() + 3 * at, on_j.begin() + 3 * at + 3}, {p.on_j, p.on_j + 3});
      }
    }
  }
}

TEST_F(ContactFileTest, OtherMemoryAndOtherScenesAreRefused) {
  const ContactTable t = odd_numbers();
  const Arranged scene(t.scene, Scalar::f64);
  for (int wrong = 0; wrong < 3; wrong++) {
    Contacts c = t.contacts();
    Input input = scene.input;
    if (wrong == 0) c.memory = Memory::device;
    if (wrong == 1) input.spheres.memory = Memory::device;
    if (wrong == 2) input.spheres.count = 9;
    EXPECT_THROW(write_contacts(c, input, folder_ / "c.csv"), Error) << wrong;
  }
  EXPECT_EQ(entries(), 0u);
}

TEST_F(ContactFileTest, WhatCannotBeWrittenIsSaidAndLeavesNothing) {
  const ContactTable t = odd_numbers();
  write_file(folder_ / "c.txt", "mine");
  for (const char* name : {"c.txt", "c", ".csv", "c.CSV", "c.csv.gz"}) {
    SCOPED_TRACE(name);
    EXPECT_THROW(check_contact_ending(name), Error);
    EXPECT_EQ(error_of([&] { write(t, name); }), "cannot tell the format of " + (folder_ / name).string() +
                                                     ": contacts are written as .csv, .npz or .vtp");
  }
  EXPECT_EQ(read_file(folder_ / "c.txt"), "mine");
  EXPECT_NO_THROW(check_contact_ending("a folder/c.vtp"));
  fs::create_directory(folder_ / "folder.csv");
  EXPECT_THROW(write(t, "absent/c.csv"), Error);
  EXPECT_THROW(write(t, "folder.csv"), Error);
  EXPECT_EQ(entries(), 2u) << "c.txt and folder.csv";
}

}  // namespace
}  // namespace padder::detect
