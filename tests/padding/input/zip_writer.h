// SPDX-License-Identifier: MIT
// Writes zip archives, for tests that read them.
#pragma once
#include <zlib.h>

#include <string>
#include <utility>
#include <vector>

namespace padder {

// With `zip64` all sizes and places stand in the fields of ZIP64, as lib3mf writes them.
inline std::string zip_bytes(const std::vector<std::pair<std::string, std::string>>& files,
                             bool deflated = false, bool zip64 = false) {
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
    const auto plain = [zip64](std::size_t value) { return zip64 ? 0xffffffffu : value; };
    put(common, plain(packed.size()), 4), put(common, plain(data.size()), 4), put(common, name.size(), 2);
    std::string sizes;
    if (zip64) put(sizes, data.size(), 8), put(sizes, packed.size(), 8);
    const auto extra = [&](const std::string& fields) {
      std::string field;
      if (zip64) put(field, 0x5455, 2), put(field, 0, 2), put(field, 1, 2), put(field, fields.size(), 2);
      return field + fields;
    };
    std::string place = sizes;
    if (zip64) put(place, out.size(), 8);
    directory += "PK\x01\x02";
    put(directory, 20, 2);
    directory += common;
    put(directory, extra(place).size(), 2), put(directory, 0, 10), put(directory, plain(out.size()), 4);
    directory += name + extra(place);
    out += "PK\x03\x04" + common;
    put(out, extra(sizes).size(), 2);
    out += name + extra(sizes) + packed;
  }
  std::string end;
  if (zip64) {
    const std::size_t longer = out.size() + directory.size();
    end = "PK\x06\x06";
    put(end, 44, 8), put(end, 45, 2), put(end, 45, 2), put(end, 0, 8), put(end, files.size(), 8);
    put(end, files.size(), 8), put(end, directory.size(), 8), put(end, out.size(), 8);
    end += "PK\x06\x07";
    put(end, 0, 4), put(end, longer, 8), put(end, 1, 4);
  }
  end += "PK\x05\x06";
  const std::size_t count = zip64 ? 0xffff : files.size();
  put(end, 0, 4), put(end, count, 2), put(end, count, 2);
  put(end, zip64 ? 0xffffffffu : directory.size(), 4), put(end, zip64 ? 0xffffffffu : out.size(), 4);
  put(end, 0, 2);
  return out + directory + end;
}

}  // namespace padder
