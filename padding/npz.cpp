#include "padding/npz.h"

#include <array>
#include <bit>
#include <cstring>

#include "padding/error.h"
#include "padding/excerpt.h"

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");

namespace padder {
namespace {

std::uint32_t crc32(std::string_view bytes) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t k = 0; k < 256; k++) {
      t[k] = k;
      for (int bit = 0; bit < 8; bit++) t[k] = t[k] >> 1 ^ (t[k] & 1 ? 0xEDB88320u : 0);
    }
    return t;
  }();
  std::uint32_t c = 0xffffffffu;
  for (const char b : bytes) c = table[(c ^ static_cast<unsigned char>(b)) & 255] ^ c >> 8;
  return ~c;
}

void put(std::string& out, std::uint64_t value, int bytes) {
  for (int k = 0; k < bytes; k++, value >>= 8) out += static_cast<char>(value & 255);
}

std::uint64_t get(std::string_view in, std::uint64_t at, int bytes, const std::string& where) {
  if (at + static_cast<std::uint64_t>(bytes) > in.size()) throw Error(where + ": the archive is cut off");
  std::uint64_t value = 0;
  for (int k = bytes; k-- > 0;)
    value = value << 8 | static_cast<unsigned char>(in[at + static_cast<std::uint64_t>(k)]);
  return value;
}

std::string npy_bytes(const NpyArray& a) {
  std::string header = "{'descr': '<" + std::string(1, a.kind) + std::to_string(a.size) +
                       "', 'fortran_order': False, 'shape': (";
  for (const std::uint64_t n : a.shape) header += std::to_string(n) + ", ";
  header += "), }";
  header.resize((10 + header.size() + 1 + 63) / 64 * 64 - 11,
                ' ');  // the data begins on a multiple of 64 bytes
  header += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  put(out, header.size(), 2);
  return out + header + a.bytes;
}

NpyArray npy_from_bytes(std::string_view in, const std::string& where) {
  const auto fail = [&](const std::string& what) { throw Error(where + ": " + what); };
  if (in.size() < 12 || in.substr(0, 6) != "\x93NUMPY") fail("no NumPy array");
  const int wide = in[6] == 1 ? 2 : 4;
  const std::uint64_t length = get(in, 8, wide, where), begin = 8 + static_cast<std::uint64_t>(wide) + length;
  if (begin > in.size()) fail("the array is cut off");
  const std::string header(in.substr(8 + static_cast<std::uint64_t>(wide), length));
  NpyArray a;
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

template <class From, class T>
std::vector<T> converted(const NpyArray& a) {
  std::vector<T> out(a.count());
  for (std::uint64_t k = 0; k < out.size(); k++) {
    From v;
    std::memcpy(&v, a.bytes.data() + k * sizeof v, sizeof v);
    if constexpr (std::is_same_v<T, std::uint32_t>) {
      if (!(v >= 0) || !(static_cast<double>(v) <= 4294967295.0) ||
          static_cast<double>(static_cast<T>(v)) != static_cast<double>(v))
        throw Error("a family or mask must be a whole number from 0 to 4294967295");
    }
    out[k] = static_cast<T>(v);
  }
  return out;
}

}  // namespace

std::uint64_t NpyArray::count() const {
  std::uint64_t n = 1;
  for (const std::uint64_t s : shape) n *= s;
  return n;
}

template <class T>
std::vector<T> NpyArray::as() const {
  if (kind == 'f') return size == 4 ? converted<float, T>(*this) : converted<double, T>(*this);
  if (kind == 'u') return size == 4 ? converted<std::uint32_t, T>(*this) : converted<std::uint64_t, T>(*this);
  return size == 4 ? converted<std::int32_t, T>(*this) : converted<std::int64_t, T>(*this);
}
template std::vector<float> NpyArray::as() const;
template std::vector<double> NpyArray::as() const;
template std::vector<std::uint32_t> NpyArray::as() const;

std::string npz_bytes(const Npz& arrays) {
  std::string out, directory;
  for (const auto& [name, array] : arrays) {
    const std::string data = npy_bytes(array), file = name + ".npy";
    if (out.size() + data.size() + 4096 > 0xffffffffull)
      throw Error("the arrays are beyond the 4 GiB of a plain zip archive: write .csv, or a narrower record");
    std::string common;
    put(common, 20, 2), put(common, 0, 4), put(common, 0, 2),
        put(common, 0x21, 2);  // version, flags + stored, 1980-01-01
    put(common, crc32(data), 4), put(common, data.size(), 4), put(common, data.size(), 4),
        put(common, file.size(), 2);
    put(common, 0, 2);
    directory += std::string("PK\x01\x02\x14\x00", 6) + common;
    put(directory, 0, 10), put(directory, out.size(), 4);
    directory += file;
    out += "PK\x03\x04" + common + file + data;
  }
  std::string end = "PK\x05\x06";
  put(end, 0, 4), put(end, arrays.size(), 2), put(end, arrays.size(), 2), put(end, directory.size(), 4),
      put(end, out.size(), 4);
  put(end, 0, 2);
  return out + directory + end;
}

Npz npz_from_bytes(std::string_view in, const std::string& where) {
  const auto end = in.rfind("PK\x05\x06");
  if (end == std::string_view::npos) throw Error(where + ": not an .npz archive");
  const std::uint64_t files = get(in, end + 10, 2, where);
  std::uint64_t at = get(in, end + 16, 4, where);
  Npz arrays;
  for (std::uint64_t k = 0; k < files; k++) {
    if (get(in, at, 4, where) != 0x02014b50) throw Error(where + ": the archive's directory is damaged");
    const std::uint64_t method = get(in, at + 10, 2, where), name_size = get(in, at + 28, 2, where);
    std::uint64_t size = get(in, at + 24, 4, where), local = get(in, at + 42, 4, where);
    const std::uint64_t extra = get(in, at + 30, 2, where), comment = get(in, at + 32, 2, where);
    get(in, at + 46 + name_size, 0, where);
    std::string name(in.substr(at + 46, name_size));
    if (method != 0)
      throw Error(where + ": " + excerpt(name) +
                  " is compressed: save with numpy.savez, not savez_compressed");
    // NumPy always leaves room for the 64-bit sizes of large archives; only above 4 GiB are they used.
    if (size == 0xffffffffu || local == 0xffffffffu)
      throw Error(where + ": archives beyond 4 GiB are not read");
    const std::uint64_t data = local + 30 + get(in, local + 26, 2, where) + get(in, local + 28, 2, where);
    if (data + size > in.size()) throw Error(where + ": the archive is cut off");
    if (name.ends_with(".npy")) name.resize(name.size() - 4);
    const std::string array = where + ": " + excerpt(name);
    if (!arrays.emplace(name, npy_from_bytes(in.substr(data, size), array)).second)
      throw Error(array + " stands twice in the archive: remove one");
    at += 46 + name_size + extra + comment;
  }
  return arrays;
}

}  // namespace padder
