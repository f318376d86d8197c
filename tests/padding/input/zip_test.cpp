// SPDX-License-Identifier: MIT
#include "padding/input/zip.h"

#include <gtest/gtest.h>

#include "tests/error_of.h"
#include "tests/padding/input/zip_writer.h"

namespace padder {
namespace {

const std::vector<std::pair<std::string, std::string>> kFiles = {
    {"a.txt", "short"}, {"3D/Model.model", std::string(100000, 'x')}, {"empty", ""}};

std::string fault(const std::string& bytes, const std::string& name, std::size_t most = 1 << 20) {
  return error_of([&] { Zip(bytes, "z").read(name, most); });
}

TEST(Zip, EveryFileComesBack) {
  for (const bool zip64 : {false, true})
    for (const bool deflated : {false, true}) {
      const std::string bytes = zip_bytes(kFiles, deflated, zip64);
      const Zip zip(bytes, "z");
      for (const auto& [name, data] : kFiles) EXPECT_EQ(zip.read(name, 1 << 20), data);
      EXPECT_TRUE(zip.has("3d/3DMODEL.model") == false && zip.has("3d/MODEL.model"));
      if (deflated) {
        EXPECT_LT(bytes.size(), 1000u);
      }
    }
}

TEST(Zip, FaultsAreSentences) {
  const std::string good = zip_bytes(kFiles, true);
  EXPECT_EQ(fault(good, "b"), "z: its part 'b' is missing: export it again");
  EXPECT_EQ(fault(good, "3D/Model.model", 99999),
            "z: its part '3D/Model.model' has 100000 bytes, and at most 99999 are read");
  EXPECT_NE(fault("PK", "a.txt").find("no zip archive"), std::string::npos);
  std::string stored = zip_bytes(kFiles);
  stored[stored.find("short")] ^= 1;
  EXPECT_NE(fault(stored, "a.txt").find("checksum"), std::string::npos);
}

// Damaged archives give an answer or an Error, never a crash, and a false size never allocates memory.
TEST(Zip, NoByteMayHarm) {
  for (const int kind : {0, 1, 2}) {
    const bool deflated = kind > 0;
    const std::string good = zip_bytes(kFiles, deflated, kind == 2);
    const std::size_t step = deflated ? 1 : 97;
    for (std::size_t at = 0; at < good.size(); at += step) {
      std::string bad = good;
      for (const int flip : {0x01, 0x55, 0xff}) {
        bad[at] = static_cast<char>(good[at] ^ flip);
        for (const auto& [name, data] : kFiles) fault(bad, name, std::size_t(1) << 31);
      }
      fault(good.substr(0, at), "a.txt");
    }
  }
}

}  // namespace
}  // namespace padder
