// SPDX-License-Identifier: MIT
#include "padding/asset/npz.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "padding/asset/crc32.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");

namespace padder {
namespace {

void put(std::string& out, std::uint64_t value, int bytes) {
  for (int k = 0; k < bytes; k++, value >>= 8) out += static_cast<char>(value & 255);
}

std::uint64_t get(std::string_view in, std::uint64_t at, int bytes, const std::string& where) {
  if (at > in.size() || in.size() - at < static_cast<std::uint64_t>(bytes))
    throw Error(where + ": the zip archive is cut short: copy or export it again");
  std::uint64_t value = 0;
  for (int k = bytes; k-- > 0;)
    value = value << 8 | static_cast<unsigned char>(in[at + static_cast<std::uint64_t>(k)]);
  return value;
}

std::string npy_head(const NpyHead& a) {
  std::string header = "{'descr': '<" + std::string(1, a.kind) + std::to_string(a.size) +
                       "', 'fortran_order': False, 'shape': (";
  for (const std::uint64_t n : a.shape) header += std::to_string(n) + ", ";
  header += "), }";
  header.resize((10 + header.size() + 1 + 63) / 64 * 64 - 11,
                ' ');  // the data begins on a multiple of 64 bytes
  header += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  put(out, header.size(), 2);
  return out + header;
}

// Zip keeps sizes and places in 32 bits. A field that holds this is continued in 64 bits elsewhere.
constexpr std::uint64_t kContinued = 0xffffffff;

// The heads, the directory and the end of an archive in which sizes and places from `wide` on are continued.
struct ZipText {
  std::uint64_t wide;

  std::uint64_t plain(std::uint64_t value) const { return value < wide ? value : kContinued; }

  // What the head of an entry and the directory have in common.
  std::string common(std::uint32_t crc, std::uint64_t size, std::size_t name, std::size_t extra) const {
    std::string out;
    put(out, extra > 0 ? 45 : 20, 2), put(out, 0, 4), put(out, 0, 2),
        put(out, 0x21, 2);  // version, flags + stored, 1980-01-01
    put(out, crc, 4), put(out, plain(size), 4), put(out, plain(size), 4);
    put(out, name, 2), put(out, extra, 2);
    return out;
  }

  std::string head(const std::string& file, std::uint32_t crc, std::uint64_t size) const {
    std::string extra;
    if (size >= wide) put(extra, 1, 2), put(extra, 16, 2), put(extra, size, 8), put(extra, size, 8);
    return "PK\x03\x04" + common(crc, size, file.size(), extra.size()) + file + extra;
  }

  std::string directory_entry(const std::string& file, std::uint32_t crc, std::uint64_t size,
                              std::uint64_t at) const {
    std::string fields, extra;
    if (size >= wide) put(fields, size, 8), put(fields, size, 8);
    if (at >= wide) put(fields, at, 8);
    if (!fields.empty()) put(extra, 1, 2), put(extra, fields.size(), 2), extra += fields;
    std::string out = "PK\x01\x02";
    put(out, extra.empty() ? 20 : 45, 2);
    out += common(crc, size, file.size(), extra.size());
    put(out, 0, 10), put(out, plain(at), 4);
    return out + file + extra;
  }

  // What follows the directory of `size` bytes at `at`.
  std::string end(std::uint64_t entries, std::uint64_t at, std::uint64_t size) const {
    std::string out;
    if (at >= wide || size >= wide) {
      out += "PK\x06\x06";
      put(out, 44, 8), put(out, 45, 2), put(out, 45, 2), put(out, 0, 8);
      put(out, entries, 8), put(out, entries, 8), put(out, size, 8), put(out, at, 8);
      out += "PK\x06\x07";  // where that stands
      put(out, 0, 4), put(out, at + size, 8), put(out, 1, 4);
    }
    out += "PK\x05\x06";
    put(out, 0, 4), put(out, entries, 2), put(out, entries, 2), put(out, plain(size), 4),
        put(out, plain(at), 4), put(out, 0, 2);
    return out;
  }
};

// Reads the fields of a directory entry that are continued in ZIP64's extra field, those `extra` bytes at
// `at`. NumPy leaves room for them in heads always; only beyond 4 GiB are they used.
void widen(std::string_view in, std::uint64_t at, std::uint64_t extra,
           std::initializer_list<std::uint64_t*> fields, const std::string& where) {
  for (const std::uint64_t end = at + extra; at + 4 <= end;) {
    const std::uint64_t kind = get(in, at, 2, where);
    std::uint64_t field = at + 4;
    at = field + get(in, at + 2, 2, where);
    if (kind != 1) continue;
    for (std::uint64_t* number : fields)
      if (*number == kContinued) *number = get(in, field, 8, where), field += 8;
    return;
  }
}

}  // namespace

NpyView npy_view(std::string_view in, const std::string& where) {
  const auto fail = [&](const std::string& what) { throw Error(where + ": " + what); };
  if (in.size() < 12 || in.substr(0, 6) != "\x93NUMPY") fail("no NumPy array");
  const int wide = in[6] == 1 ? 2 : 4;
  const std::uint64_t length = get(in, 8, wide, where), begin = 8 + static_cast<std::uint64_t>(wide) + length;
  if (begin > in.size()) fail("the array is cut off");
  const std::string header(in.substr(8 + static_cast<std::uint64_t>(wide), length));
  NpyView a;
  const auto descr = header.find("'descr':");
  const auto quote = descr == std::string::npos ? descr : header.find('\'', descr + 8);
  if (quote == std::string::npos || quote + 3 >= header.size()) fail("structured arrays are not read");
  a.kind = header[quote + 2], a.size = header[quote + 3] - '0';
  if ((header[quote + 1] != '<' && a.size != 1) || std::string("fui").find(a.kind) == std::string::npos ||
      (a.size != 4 && a.size != 8))
    fail("numbers must be little-endian of 4 or 8 bytes: save float32, float64, uint32 or int64");
  if (header.find("'fortran_order': False") == std::string::npos) fail("save the array in C order");
  const auto open = header.find('(');
  if (open == std::string::npos) fail("the array has no shape");
  for (std::size_t k = open + 1; k < header.size() && header[k] != ')';) {
    if (header[k] == '-') fail("the array's shape is not possible");
    if (header[k] < '0' || header[k] > '9') {
      k++;
      continue;
    }
    std::uint64_t n = 0;
    for (; k < header.size() && header[k] >= '0' && header[k] <= '9'; k++) {
      if (n > (std::uint64_t(1) << 40)) fail("the array's shape is not possible");
      n = n * 10 + static_cast<std::uint64_t>(header[k] - '0');
    }
    a.shape.push_back(n);
  }
  std::uint64_t count = 1;
  for (const std::uint64_t n : a.shape)
    if (__builtin_mul_overflow(count, n, &count)) fail("the array's shape is not possible");
  if ((in.size() - begin) / static_cast<std::uint64_t>(a.size) != count ||
      (in.size() - begin) % static_cast<std::uint64_t>(a.size))
    fail("the array's data does not fit its shape");
  a.bytes = in.substr(begin);
  return a;
}

namespace {

template <class From, class T, class Convert>
std::vector<T> converted(std::string_view bytes, const Convert& convert) {
  std::vector<T> out(bytes.size() / sizeof(From));
  for (std::uint64_t k = 0; k < out.size(); k++) {
    From v;
    std::memcpy(&v, bytes.data() + k * sizeof v, sizeof v);
    out[k] = convert(v);
  }
  return out;
}

template <class T, class Convert>
std::vector<T> converted(const NpyView& a, const Convert& convert) {
  const bool four = a.size == 4;
  switch (a.kind) {
    case 'f':
      return four ? converted<float, T>(a.bytes, convert) : converted<double, T>(a.bytes, convert);
    case 'u':
      return four ? converted<std::uint32_t, T>(a.bytes, convert)
                  : converted<std::uint64_t, T>(a.bytes, convert);
    default:
      return four ? converted<std::int32_t, T>(a.bytes, convert)
                  : converted<std::int64_t, T>(a.bytes, convert);
  }
}

}  // namespace

std::uint64_t NpyArray::count() const {
  std::uint64_t n = 1;
  for (const std::uint64_t s : shape) n *= s;
  return n;
}

template <class T>
std::vector<T> NpyArray::as() const {
  return converted<T>(*this, [](auto v) { return static_cast<T>(v); });
}
template std::vector<float> NpyArray::as() const;
template std::vector<double> NpyArray::as() const;
template std::vector<std::uint32_t> NpyArray::as() const;

std::vector<std::uint32_t> whole_numbers(const NpyView& a, std::uint64_t n, const std::string& where) {
  if (a.bytes.size() / static_cast<std::uint64_t>(a.size) != n)
    throw Error(where + ": one number for each sphere is wanted");
  return converted<std::uint32_t>(a, [&](auto v) {
    if (!(v >= 0) || !(static_cast<double>(v) <= 4294967295.0) ||
        static_cast<double>(static_cast<std::uint32_t>(v)) != static_cast<double>(v))
      throw Error(where + ": a whole number from 0 to 4294967295 is wanted for each sphere");
    return static_cast<std::uint32_t>(v);
  });
}

std::uint64_t NpyHead::bytes() const {
  std::uint64_t n = static_cast<std::uint64_t>(size);
  for (const std::uint64_t s : shape) n *= s;
  return n;
}

NpzWriter::NpzWriter(const std::vector<NpyHead>& heads, WriteAt write, std::uint64_t wide)
    : write_(std::move(write)), wide_(std::min(wide, kPlain)) {
  const ZipText zip{wide_};
  for (const NpyHead& head : heads) {
    Entry e;
    e.file = head.name + ".npy", e.npy = npy_head(head);
    e.size = e.npy.size() + head.bytes();
    e.local = end_, e.data = end_ + zip.head(e.file, 0, e.size).size();
    end_ = e.data + e.size;
    entries_.push_back(std::move(e));
  }
  for (std::size_t k = 0; k < entries_.size(); k++) append(k, entries_[k].npy);
}

std::uint64_t NpzWriter::place(std::size_t array, std::uint64_t size, std::uint32_t checksum) {
  Entry& e = entries_[array];
  if (size > e.size - e.got) throw Error("more bytes than the array " + e.file + " was said to have");
  const std::uint64_t offset = e.data + e.got;
  e.crc = crc32_joined(e.crc, checksum, size), e.got += size;
  return offset;
}

void NpzWriter::append(std::size_t array, std::string_view bytes) {
  write_(place(array, bytes.size(), crc32(bytes)), bytes);
}

void NpzWriter::finish() {
  const ZipText zip{wide_};
  std::string directory;
  for (const Entry& e : entries_) {
    if (e.got != e.size) throw Error("fewer bytes than the array " + e.file + " was said to have");
    write_(e.local, zip.head(e.file, e.crc, e.size));
    directory += zip.directory_entry(e.file, e.crc, e.size, e.local);
  }
  write_(end_, directory + zip.end(entries_.size(), end_, directory.size()));
}

std::string npz_bytes(const Npz& arrays) {
  std::string out;
  std::vector<NpyHead> heads;
  std::uint64_t size = 0;
  for (const auto& [name, a] : arrays)
    heads.push_back({name, a.kind, a.size, a.shape}), size += a.bytes.size();
  out.reserve(size + 1024 * arrays.size());  // with room for the heads, so that it is not copied as it grows
  NpzWriter writer(heads, write_into(out));
  std::size_t k = 0;
  for (const auto& [name, a] : arrays) writer.append(k++, a.bytes);
  writer.finish();
  return out;
}

std::vector<ZipEntry> zip_entries(std::string_view in, const std::string& where) {
  // The end record has 22 bytes, and a comment of up to 65535 behind it. A file may be terabytes of nothing.
  constexpr std::size_t kLongestEnd = 22 + 65535;
  const std::size_t before = in.size() - std::min(in.size(), kLongestEnd);
  const std::size_t found = in.substr(before).rfind("PK\x05\x06"), end = before + found;
  if (found == std::string_view::npos)
    throw Error(where +
                ": it is no zip archive, or cut short: check that the file has the ending of its format");
  std::uint64_t files = get(in, end + 10, 2, where), at = get(in, end + 16, 4, where);
  // The place of the longer end of ZIP64 stands before the plain one. lib3mf writes one whatever the size.
  if (end >= 20 && get(in, end - 20, 4, where) == 0x07064b50) {
    const std::uint64_t longer = get(in, end - 12, 8, where);
    if (get(in, longer, 4, where) != 0x06064b50)
      throw Error(where + ": the end of the zip archive is damaged: copy or export it again");
    files = get(in, longer + 32, 8, where), at = get(in, longer + 48, 8, where);
  }
  std::vector<ZipEntry> entries;
  for (std::uint64_t k = 0; k < files; k++) {
    if (get(in, at, 4, where) != 0x02014b50)
      throw Error(where + ": the directory of the zip archive is damaged: copy or export it again");
    if (get(in, at + 8, 2, where) & 1) throw Error(where + ": it is encrypted: save it without a password");
    const std::uint64_t name_size = get(in, at + 28, 2, where), extra = get(in, at + 30, 2, where);
    std::uint64_t packed = get(in, at + 20, 4, where), local = get(in, at + 42, 4, where);
    ZipEntry e;
    e.method = static_cast<int>(get(in, at + 10, 2, where));
    e.checksum = static_cast<std::uint32_t>(get(in, at + 16, 4, where)), e.size = get(in, at + 24, 4, where);
    const std::uint64_t name = at + 46;
    get(in, name + name_size, 0, where);
    e.name = in.substr(name, name_size);
    widen(in, name + name_size, extra, {&e.size, &packed, &local}, where);
    const std::uint64_t data = local + 30 + get(in, local + 26, 2, where) + get(in, local + 28, 2, where);
    if (data > in.size() || in.size() - data < packed)
      throw Error(where + ": the zip archive is cut short: copy or export it again");
    e.packed = in.substr(data, packed);
    entries.push_back(std::move(e));
    at = name + name_size + extra + get(in, at + 32, 2, where);
  }
  return entries;
}

std::map<std::string, NpzEntry> npz_entries(std::string_view in, const std::string& where) {
  std::map<std::string, NpzEntry> entries;
  for (ZipEntry& e : zip_entries(in, where)) {
    if (e.method != 0)
      throw Error(where + ": " + excerpt(e.name) +
                  " is compressed: save with numpy.savez, not savez_compressed");
    if (e.packed.size() != e.size)
      throw Error(where + ": the directory of the zip archive is damaged: copy or export it again");
    if (e.name.ends_with(".npy")) e.name.resize(e.name.size() - 4);
    if (!entries.emplace(e.name, NpzEntry{e.packed, e.checksum}).second)
      throw Error(where + ": " + excerpt(e.name) + " stands twice in the archive: remove one");
  }
  return entries;
}

void check_sum([[maybe_unused]] const NpzEntry& entry, [[maybe_unused]] const std::string& where) {
#if !defined(FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION)  // a fuzzer does not guess checksums
  if (crc32(entry.bytes) != entry.checksum)
    throw Error(where + " is damaged (its checksum is another): copy or save the file again");
#endif
}

Npz npz_from_bytes(std::string_view in, const std::string& where) {
  Npz arrays;
  for (const auto& [name, entry] : npz_entries(in, where)) {
    const NpyView v = npy_view(entry.bytes, where + ": " + excerpt(name));
    check_sum(entry, where + ": " + excerpt(name));
    arrays.emplace(name, NpyArray{v.kind, v.size, v.shape, std::string(v.bytes)});
  }
  return arrays;
}

}  // namespace padder
