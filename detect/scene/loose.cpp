// SPDX-License-Identifier: MIT
#include "detect/scene/loose.h"

#include <charconv>
#include <cstring>
#include <type_traits>

#include "detect/core/input.h"
#include "padding/asset/child.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/npz.h"

namespace padder::detect {
namespace {

std::vector<std::string_view> fields(std::string_view line) {
  std::vector<std::string_view> f;
  for (;;) {
    const auto comma = line.find(',');
    f.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return f;
    line.remove_prefix(comma + 1);
  }
}

template <class T>
bool parse(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

template <class T>
void append_tags(std::vector<T>& to, std::uint64_t before, const std::vector<T>& more, std::uint64_t count) {
  if (to.empty() && more.empty()) return;
  to.resize(before, 0);
  if (more.empty())
    to.resize(before + count, 0);
  else
    to.insert(to.end(), more.begin(), more.end());
}

LooseSpheres parse_csv(std::string_view text, const std::string& where) {
  LooseSpheres l;
  l.scalar = Scalar::f64;
  bool header = false;
  std::size_t columns = 0, family = 0, mask = 0;  // the columns of family and mask; 0: there is none
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // a byte order mark, as Excel writes it
  for (std::uint64_t line_number = 1; !text.empty(); line_number++) {
    const auto end = text.find('\n');
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string at = where + ":" + std::to_string(line_number) + ": ";
    const std::vector<std::string_view> f = fields(line);
    if (!header) {
      header = true, columns = f.size();
      bool ok = f.size() >= 4 && f[0] == "x" && f[1] == "y" && f[2] == "z" && f[3] == "r";
      for (std::size_t k = 4; k < f.size(); k++) {
        if (f[k] == "family" && !family)
          family = k;
        else if (f[k] == "mask" && !mask)
          mask = k;
        else
          ok = false;
      }
      if (!ok)
        throw Error(at + "the header must be x,y,z,r, which may be followed by family and mask, each once");
      continue;
    }
    if (f.size() != columns)
      throw Error(at + std::to_string(columns) + " numbers are wanted, there are " +
                  std::to_string(f.size()));
    for (std::size_t k = 0; k < 4; k++) {
      double v = 0;
      if (!parse(f[k], v)) throw Error(at + "'" + excerpt(f[k]) + "' is not a number");
      l.twice.push_back(v);
    }
    for (const auto& [column, to] : {std::pair(family, &l.family), std::pair(mask, &l.mask)}) {
      std::uint32_t v = 0;
      if (column && !parse(f[column], v))
        throw Error(at + "'" + excerpt(f[column]) + "' is not a whole number from 0 to 4294967295");
      if (column) to->push_back(v);
    }
  }
  if (!header) throw Error(where + ": the file is empty: its first line must be the header x,y,z,r");
  return l;
}

}  // namespace

void LooseSpheres::append(const LooseSpheres& more) {
  const std::uint64_t before = size(), count = more.size();
  append_tags(family, before, more.family, count), append_tags(mask, before, more.mask, count);
  append_tags(world, before, more.world, count);
  append_tags(is_static, before, more.is_static, count);
  if (before == 0) scalar = more.scalar;
  if (scalar == Scalar::f32 && more.scalar == Scalar::f64) {
    twice.assign(single.begin(), single.end());
    single.clear(), scalar = Scalar::f64;
  }
  const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  if (scalar == Scalar::f32)
    join(single, more.single);
  else if (more.scalar == Scalar::f32)
    join(twice, more.single);
  else
    join(twice, more.twice);
}

Spheres LooseSpheres::view() const {
  if (size() == 0) return {};  // no array, so no place of the first radius
  Spheres s = scalar == Scalar::f32 ? spheres_of<float>(size(), single.data(), single.data() + 3)
                                    : spheres_of<double>(size(), twice.data(), twice.data() + 3);
  s.center_stride = s.radius_stride = 4;
  if (!family.empty()) s.family = family.data();
  if (!mask.empty()) s.mask = mask.data();
  if (!world.empty()) s.world = world.data();
  if (!is_static.empty()) s.is_static = is_static.data();
  return s;
}

LooseSpheres loose_from(const std::vector<FloatSphere>& spheres) {
  LooseSpheres l;
  l.single.reserve(4 * spheres.size());
  for (const FloatSphere& s : spheres) l.single.insert(l.single.end(), {s.x, s.y, s.z, s.r});
  return l;
}

LooseSpheres loose_from(const Spheres& spheres) {
  LooseSpheres l;
  l.scalar = spheres.scalar;
  const auto copy = [&](auto& to) {
    using T = typename std::decay_t<decltype(to)>::value_type;
    to.reserve(4 * spheres.count);
    for (std::uint64_t k = 0; k < spheres.count; k++) {
      const Given<T> g = given<T>(spheres, k);
      to.insert(to.end(), {g.x, g.y, g.z, g.r});
    }
  };
  if (l.scalar == Scalar::f32)
    copy(l.single);
  else
    copy(l.twice);
  const auto tags = [&](const auto* from, auto& to) {
    if (!from) return;
    to.resize(spheres.count);
    std::memcpy(to.data(), from, spheres.count * sizeof *from);
  };
  tags(spheres.family, l.family), tags(spheres.mask, l.mask), tags(spheres.world, l.world);
  tags(spheres.is_static, l.is_static);
  return l;
}

LooseSpheres loose_from_npz(std::string_view bytes, const std::string& where) {
  const Npz arrays = npz_from_bytes(bytes, where);
  const auto at = [&](const char* name) -> const NpyArray& {
    const auto it = arrays.find(name);
    if (it == arrays.end()) throw Error(where + ": the array \"" + name + "\" is missing");
    return it->second;
  };
  const NpyArray &centers = at("centers"), &radii = at("radii");
  if (centers.shape.size() != 2 || centers.shape[1] != 3 || radii.shape.size() != 1 ||
      radii.shape[0] != centers.shape[0])
    throw Error(where + ": \"centers\" must be of shape (N, 3) and \"radii\" of shape (N)");
  const std::uint64_t n = radii.count();
  LooseSpheres l;
  const bool narrow = centers.kind == 'f' && centers.size == 4 && radii.kind == 'f' && radii.size == 4;
  l.scalar = narrow ? Scalar::f32 : Scalar::f64;
  const auto interleave = [&](auto& to, const auto& c, const auto& r) {
    to.reserve(4 * n);
    for (std::uint64_t k = 0; k < n; k++) to.insert(to.end(), {c[3 * k], c[3 * k + 1], c[3 * k + 2], r[k]});
  };
  if (narrow)
    interleave(l.single, centers.as<float>(), radii.as<float>());
  else
    interleave(l.twice, centers.as<double>(), radii.as<double>());
  const auto tags = [&](const char* name, std::vector<std::uint32_t>& to) {
    const auto it = arrays.find(name);
    if (it != arrays.end()) to = whole_numbers(it->second, n, where + ": " + name);
  };
  tags("family", l.family), tags("mask", l.mask), tags("world", l.world);
  return l;
}

LooseSpheres loose_from_csv(std::string_view text, const std::string& where) {
  LooseSpheres l;
  const auto send = [&](ChildPipe& pipe) {
    return pipe.put_array(l.twice) && pipe.put_array(l.family) && pipe.put_array(l.mask);
  };
  const auto receive = [&](ChildPipe& pipe) {
    l.scalar = Scalar::f64;
    const bool sent = pipe.get_array(l.twice) && pipe.get_array(l.family) && pipe.get_array(l.mask);
    const auto fits = [&](const auto& tags) { return tags.empty() || tags.size() == l.size(); };
    return sent && l.twice.size() % 4 == 0 && fits(l.family) && fits(l.mask);
  };
  in_child([&] { l = parse_csv(text, where); }, send, receive, text.size(), where);
  return l;
}

}  // namespace padder::detect
