// SPDX-License-Identifier: MIT
// Archives of arrays: written as a whole or side by side, plain and as ZIP64, and what reads them.
#include "padding/asset/npz.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>

#include "padding/asset/crc32.h"
#include "padding/asset/error.h"
#include "tests/error_of.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

const std::vector<std::uint32_t> kCounts{1, 2, 3, 4, 5, 6, 7};
const std::vector<double> kNumbers{0.5, -1, 1. / 3, 1e300, 5e-324, 7};

template <class T>
std::string_view bytes_of(const std::vector<T>& v) {
  return {reinterpret_cast<const char*>(v.data()), v.size() * sizeof(T)};
}

// Both arrays in portions, by turns.
std::string written(std::uint64_t wide) {
  std::string out;
  NpzWriter w({{"counts", 'u', 4, {7}}, {"numbers", 'f', 8, {2, 3}}}, write_into(out), wide);
  w.append(1, bytes_of(kNumbers).substr(0, 8));
  w.append(0, bytes_of(kCounts).substr(0, 20));
  w.append(1, bytes_of(kNumbers).substr(8));
  w.append(0, bytes_of(kCounts).substr(20));
  w.finish();
  return out;
}

void expect_read(const std::string& bytes) {
  const Npz z = npz_from_bytes(bytes, "z");
  ASSERT_EQ(z.size(), 2u);
  EXPECT_EQ(z.at("counts").as<std::uint32_t>(), kCounts);
  EXPECT_EQ(z.at("numbers").as<double>(), kNumbers);
  EXPECT_EQ(z.at("numbers").shape, (std::vector<std::uint64_t>{2, 3}));
}

TEST(Npz, InPortionsAsInOnePiece) {
  const std::string whole = npz_bytes(
      {{"counts", npy_array(kCounts.data(), {7})}, {"numbers", npy_array(kNumbers.data(), {2, 3})}});
  EXPECT_EQ(written(NpzWriter::kPlain), whole);
  expect_read(whole);
}

// Whoever writes the bytes at the places given may do so in any order.
TEST(Npz, PlacesOfPortions) {
  std::string out;
  const WriteAt write = write_into(out);
  NpzWriter w({{"counts", 'u', 4, {7}}, {"numbers", 'f', 8, {2, 3}}}, write);
  const std::string_view a = bytes_of(kCounts).substr(0, 20), b = bytes_of(kCounts).substr(20);
  const std::uint64_t at_a = w.place(0, a.size(), crc32(a)), at_b = w.place(0, b.size(), crc32(b));
  EXPECT_EQ(at_b, at_a + a.size());
  w.append(1, bytes_of(kNumbers));
  write(at_b, b), write(at_a, a);
  w.finish();
  EXPECT_EQ(out, written(NpzWriter::kPlain));
}

// Sizes alone, places alone, both: each beyond a limit that is 4 GiB in earnest.
TEST(Npz, Zip64IsRead) {
  for (const std::uint64_t wide : {0, 1, 150, 170, 200, 250, 300}) {
    SCOPED_TRACE(wide);
    const std::string bytes = written(wide);
    EXPECT_NE(bytes, written(NpzWriter::kPlain));
    expect_read(bytes);
    for (std::size_t cut = 1; cut + 2 < bytes.size(); cut++)  // the last two bytes tell of a comment
      EXPECT_THROW(npz_from_bytes(std::string_view(bytes).substr(0, cut), "z"), Error) << cut;
  }
}

TEST(Npz, NumpyReadsZip64AndItsChecksums) {
  if (std::system(PADDER_PYTHON " -c 'import numpy' 2>/dev/null") != 0)
    GTEST_SKIP() << "python3-numpy is not installed";
  const TemporaryFolder folder;
  for (const std::uint64_t wide :
       {std::uint64_t(0), std::uint64_t(170), std::uint64_t(250), NpzWriter::kPlain}) {
    SCOPED_TRACE(wide);
    const fs::path file = folder.put("z.npz", written(wide));
    const std::string check =
        " -c 'import numpy, sys, zipfile; z = numpy.load(sys.argv[1]); "
        "assert zipfile.ZipFile(sys.argv[1]).testzip() is None; assert list(z[\"counts\"]) == list(range(1, "
        "8)); "
        "assert z[\"numbers\"].shape == (2, 3) and z[\"numbers\"][1, 1] == 5e-324' ";
    EXPECT_EQ(std::system((PADDER_PYTHON + check + file.string()).c_str()), 0);
  }
}

TEST(Npz, ADamagedByteIsFound) {
  const std::string whole = written(NpzWriter::kPlain);
  const auto damaged = [&](std::size_t at, char to) {
    std::string bytes = whole;
    bytes[at] = to;
    return error_of([&] { npz_from_bytes(bytes, "z"); });
  };
  for (const std::string_view data : {bytes_of(kCounts), bytes_of(kNumbers)})
    EXPECT_NE(damaged(whole.find(data), '\x55').find("its checksum is another"), std::string::npos);
  EXPECT_NE(damaged(whole.find("(7") + 1, '-').find("shape is not possible"), std::string::npos);
}

TEST(Npz, AnArrayGetsItsBytesAndNoOthers) {
  const auto fails = [](const std::function<void(NpzWriter&)>& work) {
    std::string out;
    NpzWriter w({{"counts", 'u', 4, {7}}}, write_into(out));
    EXPECT_THROW(work(w), Error);
  };
  fails([](NpzWriter& w) { w.finish(); });
  fails([](NpzWriter& w) { w.append(0, bytes_of(kCounts).substr(1)), w.finish(); });
  fails([](NpzWriter& w) { w.append(0, bytes_of(kCounts)), w.append(0, "x"); });
}

}  // namespace
}  // namespace padder
