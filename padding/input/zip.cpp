// SPDX-License-Identifier: MIT
#include "padding/input/zip.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>

#include "padding/asset/crc32.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder {

const ZipEntry* Zip::find(std::string_view name) const {
  const auto same = [](char a, char b) {
    return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
  };
  const auto it = std::ranges::find_if(
      entries_, [&](const ZipEntry& e) { return std::ranges::equal(e.name, name, same); });
  return it == entries_.end() ? nullptr : &*it;
}

std::string Zip::read(std::string_view name, std::size_t most) const {
  const auto fail = [&](const std::string& what) {
    throw Error(where_ + ": its part '" + excerpt(name) + "' " + what);
  };
  const ZipEntry* e = find(name);
  if (!e) fail("is missing: export it again");
  if (e->size > most)
    fail("has " + std::to_string(e->size) + " bytes, and at most " + std::to_string(most) + " are read");
  // deflate shrinks to 1/1032 at most. So a false size is found here and does not allocate memory.
  if (e->size > 1032 * e->packed.size() + 1032) fail("is damaged: export it again");
  std::string out(e->size, '\0');
  if (e->method == 8) {
    z_stream z{};
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(e->packed.data()));
    z.avail_in = static_cast<uInt>(e->packed.size());
    z.next_out = reinterpret_cast<Bytef*>(out.data()), z.avail_out = static_cast<uInt>(out.size());
    const bool whole = inflateInit2(&z, -15) == Z_OK && inflate(&z, Z_FINISH) == Z_STREAM_END;  // no header
    const std::size_t left = z.avail_out;
    inflateEnd(&z);
    if (!whole || left > 0) fail("is damaged: export it again");
  } else if (e->method == 0 && e->packed.size() == out.size()) {
    out = e->packed;
  } else {
    fail("is packed in a way that is not read: export it again, with deflate");
  }
#if !defined(FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION)  // a fuzzer does not guess checksums
  if (crc32(out) != e->checksum) fail("is damaged (its checksum is another): export it again");
#endif
  return out;
}

}  // namespace padder
