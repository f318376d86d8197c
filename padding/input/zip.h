// SPDX-License-Identifier: MIT
// Reads files out of a zip archive, stored or deflated ones. Not installed.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace padder {

// An archive in memory. Refers to the bytes and does not copy them.
class Zip {
 public:
  // Throws Error, which begins with `where`, for bytes that are no zip archive, damaged or encrypted.
  Zip(std::string_view bytes, const std::string& where);

  bool has(std::string_view name) const { return find(name) != nullptr; }
  // Returns the bytes of a file. The case of letters in its name does not count, as in packages of 3MF.
  // Throws Error when the file is missing, damaged (its checksum is compared), larger than `most`, or packed
  // in another way.
  std::string read(std::string_view name, std::size_t most) const;

 private:
  struct Entry {
    std::string name;
    std::size_t local = 0, packed = 0, size = 0;
    unsigned method = 0;
    unsigned long checksum = 0;
  };
  const Entry* find(std::string_view name) const;
  // Reads the numbers of an entry that ZIP64 continues in its extra field, those `extra` bytes at `at`.
  void widen(Entry& e, std::size_t at, std::size_t extra) const;
  std::uint64_t read_number(std::size_t at, int bytes) const;  // little-endian
  [[noreturn]] void fail(const std::string& what) const;

  std::string_view bytes_;
  std::string where_;
  std::vector<Entry> entries_;
};

}  // namespace padder
