// SPDX-License-Identifier: MIT
// Arrays filled side by side, each at the place that the file's own head gives it.
#include "padding/asset/vtp.h"

#include <gtest/gtest.h>

#include <cstring>

#include "padding/asset/error.h"

namespace padder {
namespace {

const std::vector<double> kPositions{0, 1, 2, 3, 4, 5, 6, 7, 8};
const std::vector<std::uint32_t> kNumbers{7, 8, 9};

std::string_view bytes_of(const std::vector<double>& v) {
  return {reinterpret_cast<const char*>(v.data()), v.size() * sizeof(double)};
}

// The numbers of the array called `name`.
template <class T>
std::vector<T> array(const std::string& file, const std::string& name) {
  const std::size_t line = file.find("Name=\"" + name + "\""),
                    mark = file.find('_', file.find("<AppendedData"));
  const std::size_t offset = std::stoull(file.substr(file.find("offset=\"", line) + 8, 20));
  const char* from = file.data() + mark + 1 + offset;
  std::uint64_t size;
  std::memcpy(&size, from, sizeof size);
  std::vector<T> values(size / sizeof(T));
  std::memcpy(values.data(), from + sizeof size, size);
  return values;
}

TEST(Vtp, ArraysInPortionsByTurns) {
  std::string file;
  VtpWriter v(3, {{"number", 'u', 4, 1}, {"twice", 'f', 8, 3}}, write_into(file));
  v.append(2, bytes_of(kPositions).substr(0, 16));
  v.append(1, kPositions);
  v.append(0, kNumbers);
  v.append(2, bytes_of(kPositions).substr(16));
  v.finish();
  EXPECT_EQ(array<std::uint32_t>(file, "number"), kNumbers);
  EXPECT_EQ(array<double>(file, "twice"), kPositions);
  EXPECT_EQ(array<double>(file, "points"), kPositions);
  EXPECT_EQ(array<std::int64_t>(file, "connectivity"), (std::vector<std::int64_t>{0, 1, 2}));
  EXPECT_EQ(array<std::int64_t>(file, "offsets"), (std::vector<std::int64_t>{1, 2, 3}));
  EXPECT_NE(file.find("type=\"UInt32\" Name=\"number\" NumberOfComponents=\"1\""), std::string::npos);
  EXPECT_NE(file.find("type=\"Float64\" Name=\"twice\" NumberOfComponents=\"3\""), std::string::npos);
  EXPECT_TRUE(file.ends_with("\n</AppendedData>\n</VTKFile>\n"));
}

// Whoever writes the bytes at the places given may do so in any order, and may write the vertices, too.
TEST(Vtp, PlacesOfPortions) {
  std::string appended, placed;
  VtpWriter by_append(3, {{"number", 'u', 4, 1}}, write_into(appended));
  by_append.append(0, kNumbers), by_append.append(by_append.positions(), kPositions);
  by_append.finish();
  const WriteAt write = write_into(placed);
  VtpWriter by_place(3, {{"number", 'u', 4, 1}}, write);
  const std::string_view positions = bytes_of(kPositions);
  const std::uint64_t head = by_place.place(by_place.positions(), 16);
  const std::uint64_t tail = by_place.place(by_place.positions(), positions.size() - 16);
  write(tail, positions.substr(16)), write(head, positions.substr(0, 16));
  by_place.append(by_place.connectivity(), std::vector<std::int64_t>{0, 1, 2});
  by_place.append(by_place.offsets(), std::vector<std::int64_t>{1, 2, 3});
  by_place.append(0, kNumbers);
  by_place.finish();
  EXPECT_EQ(placed, appended);
}

// More points than a block of vertices.
TEST(Vtp, ManyVertices) {
  std::string file;
  const std::size_t n = 200001;
  VtpWriter v(n, {}, write_into(file));
  v.append(0, std::vector<double>(3 * n, 1.5));
  v.finish();
  const auto connectivity = array<std::int64_t>(file, "connectivity"),
             offsets = array<std::int64_t>(file, "offsets");
  ASSERT_EQ(connectivity.size(), n);
  ASSERT_EQ(offsets.size(), n);
  for (std::size_t k = 0; k < n; k++) {
    ASSERT_EQ(connectivity[k], static_cast<std::int64_t>(k));
    ASSERT_EQ(offsets[k], static_cast<std::int64_t>(k + 1));
  }
}

TEST(Vtp, AnArrayGetsItsBytesAndNoOthers) {
  std::string file;
  VtpWriter few(3, {}, write_into(file)), many(3, {}, write_into(file));
  few.append(0, bytes_of(kPositions).substr(8));
  EXPECT_THROW(few.finish(), Error);
  many.append(0, kPositions);
  EXPECT_THROW(many.append(0, "x"), Error);
}

}  // namespace
}  // namespace padder
