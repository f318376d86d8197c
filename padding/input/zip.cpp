// SPDX-License-Identifier: MIT
// The format is in PKWARE's APPNOTE.TXT, sections 4.3 and 4.4.
#include "padding/input/zip.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder {

void Zip::fail(const std::string& what) const { throw Error(where_ + ": " + what); }

std::uint64_t Zip::read_number(std::size_t at, int bytes) const {
  if (at > bytes_.size() || bytes_.size() - at < static_cast<std::size_t>(bytes))
    fail("the zip archive is cut short: export it again");
  std::uint64_t value = 0;
  for (int k = bytes; k-- > 0;)
    value = value << 8 | static_cast<unsigned char>(bytes_[at + static_cast<std::size_t>(k)]);
  return value;
}

Zip::Zip(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {
  const std::size_t end = bytes.rfind("PK\x05\x06");
  if (end == bytes.npos)
    fail("it is no zip archive, or cut short: check that the file has the ending of its format");
  std::uint64_t files = read_number(end + 10, 2);
  std::size_t at = read_number(end + 16, 4);
  // lib3mf writes ZIP64 whatever the size: a longer end, whose place stands before the plain one.
  if (end >= 20 && bytes.substr(end - 20, 4) == "PK\x06\x07") {
    const std::size_t longer = read_number(end - 12, 8);
    if (read_number(longer, 4) != 0x06064b50) fail("the end of the zip archive is damaged: export it again");
    files = read_number(longer + 32, 8), at = read_number(longer + 48, 8);
  }
  for (std::uint64_t k = 0; k < files; k++) {
    if (read_number(at, 4) != 0x02014b50)
      fail("the directory of the zip archive is damaged: export it again");
    Entry e;
    if (read_number(at + 8, 2) & 1) fail("it is encrypted: save it without a password");
    e.method = static_cast<unsigned>(read_number(at + 10, 2)), e.checksum = read_number(at + 16, 4);
    e.packed = read_number(at + 20, 4), e.size = read_number(at + 24, 4), e.local = read_number(at + 42, 4);
    const std::size_t name = read_number(at + 28, 2);
    read_number(at + 46 + name, 0);  // fails if the archive ends before
    e.name = bytes.substr(at + 46, name);
    widen(e, at + 46 + name, read_number(at + 30, 2));
    at += 46 + name + read_number(at + 30, 2) + read_number(at + 32, 2);
    entries_.push_back(std::move(e));
  }
}

void Zip::widen(Entry& e, std::size_t at, std::size_t extra) const {
  constexpr std::size_t continued = 0xffffffffu;
  for (const std::size_t end = at + extra; at + 4 <= end;) {
    std::size_t field = at + 4;
    at = field + read_number(at + 2, 2);
    if (read_number(field - 4, 2) != 1) continue;
    for (std::size_t* number : {&e.size, &e.packed, &e.local})
      if (*number == continued) *number = read_number(field, 8), field += 8;
    break;
  }
  if (e.local > bytes_.size() || e.packed > bytes_.size())
    fail("the zip archive is cut short: export it again");
}

const Zip::Entry* Zip::find(std::string_view name) const {
  const auto same = [](char a, char b) {
    return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
  };
  const auto it =
      std::ranges::find_if(entries_, [&](const Entry& e) { return std::ranges::equal(e.name, name, same); });
  return it == entries_.end() ? nullptr : &*it;
}

std::string Zip::read(std::string_view name, std::size_t most) const {
  const std::string part = "its part '" + excerpt(name) + "' ";
  const Entry* e = find(name);
  if (!e) fail(part + "is missing: export it again");
  if (e->size > most)
    fail(part + "has " + std::to_string(e->size) + " bytes, and at most " + std::to_string(most) +
         " are read");
  const std::size_t begin = e->local + 30 + read_number(e->local + 26, 2) + read_number(e->local + 28, 2);
  read_number(begin + e->packed, 0);
  const std::string_view packed = bytes_.substr(begin, e->packed);
  // deflate shrinks to 1/1032 at most. So a false size is found here and does not allocate memory.
  if (e->size > 1032 * packed.size() + 1032) fail(part + "is damaged: export it again");
  std::string out(e->size, '\0');
  if (e->method == 8) {
    z_stream z{};
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    z.avail_in = static_cast<uInt>(packed.size());
    z.next_out = reinterpret_cast<Bytef*>(out.data()), z.avail_out = static_cast<uInt>(out.size());
    const bool whole = inflateInit2(&z, -15) == Z_OK && inflate(&z, Z_FINISH) == Z_STREAM_END;  // no header
    const std::size_t left = z.avail_out;
    inflateEnd(&z);
    if (!whole || left > 0) fail(part + "is damaged: export it again");
  } else if (e->method == 0 && packed.size() == out.size()) {
    out = packed;
  } else {
    fail(part + "is packed in a way that is not read: export it again, with deflate");
  }
#if !defined(FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION)  // a fuzzer does not guess checksums
  if (crc32(0, reinterpret_cast<const Bytef*>(out.data()), static_cast<uInt>(out.size())) != e->checksum)
    fail(part + "is damaged (its checksum is another): export it again");
#endif
  return out;
}

}  // namespace padder
