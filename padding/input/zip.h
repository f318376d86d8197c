// SPDX-License-Identifier: MIT
// Reads files out of a zip archive, stored or deflated ones. Not installed.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/npz.h"

namespace padder {

// An archive in memory. Refers to the bytes and does not copy them.
class Zip {
 public:
  // Throws Error, which begins with `where`, for bytes that are no zip archive, damaged or encrypted.
  Zip(std::string_view bytes, const std::string& where)
      : where_(where), entries_(zip_entries(bytes, where)) {}

  bool has(std::string_view name) const { return find(name) != nullptr; }
  // Returns the bytes of a file. The case of letters in its name does not count, as in packages of 3MF.
  // Throws Error when the file is missing, damaged (its checksum is compared), larger than `most`, or packed
  // in another way.
  std::string read(std::string_view name, std::size_t most) const;

 private:
  const ZipEntry* find(std::string_view name) const;

  std::string where_;
  std::vector<ZipEntry> entries_;
};

}  // namespace padder
