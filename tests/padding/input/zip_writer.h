// SPDX-License-Identifier: MIT
// Writes zip archives, for tests that read them.
#pragma once
#include <zlib.h>

#include <string>
#include <utility>
#include <vector>

namespace padder {

inline std::string zip_bytes(const std::vector<std::pair<std::string, std::string>>& files,
                             bool deflated = false) {
  std::string out, directory;
  const auto put = [](std::string& to, std::size_t value, int bytes) {
    for (int k = 0; k < bytes; k++, value >>= 8) to += static_cast<char>(value & 255);
  };
  for (const auto& [name, data] : files) {
    std::string packed = data;
    if (deflated) {
      packed.resize(compressBound(data.size()) + 64);
      z_stream z{};
      deflateInit2(&z, 9, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY);
      z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(data.data()));
      z.avail_in = static_cast<uInt>(data.size());
      z.next_out = reinterpret_cast<Bytef*>(packed.data()), z.avail_out = static_cast<uInt>(packed.size());
      deflate(&z, Z_FINISH);
      packed.resize(z.total_out);
      deflateEnd(&z);
    }
    std::string common;
    put(common, 20, 2), put(common, 0, 2), put(common, deflated ? 8 : 0, 2), put(common, 0, 4);
    put(common, crc32(0, reinterpret_cast<const Bytef*>(data.data()), static_cast<uInt>(data.size())), 4);
    put(common, packed.size(), 4), put(common, data.size(), 4), put(common, name.size(), 2),
        put(common, 0, 2);
    directory += "PK\x01\x02";
    put(directory, 20, 2);
    directory += common;
    put(directory, 0, 10), put(directory, out.size(), 4);
    directory += name;
    out += "PK\x03\x04" + common + name + packed;
  }
  std::string end = "PK\x05\x06";
  put(end, 0, 4), put(end, files.size(), 2), put(end, files.size(), 2), put(end, directory.size(), 4);
  put(end, out.size(), 4), put(end, 0, 2);
  return out + directory + end;
}

}  // namespace padder
