// SPDX-License-Identifier: MIT
// What a call of the model test gave, and whether it is right.
#pragma once
#include <cstring>
#include <unordered_map>
#include <vector>

#include "tests/detect/model/script.h"
#include "tests/detect/world_answers.h"

namespace padder::detect {

// Do records of floats hold the spheres of a call? A detector may refuse what does not surely fit.
enum class Range { fits, may_be_refused, too_large };
inline Range range_of(const Call& call, const std::vector<Seen>& spheres) {
  const CallOptions& o = call.options;
  if (call.answers || o.width == Width::pairs || o.scalar == Scalar::f64) return Range::fits;
  double extent = 0, radius = 0, reach = 0;
  for (const Seen& s : spheres) {
    const double far = std::max({std::abs(s.sphere.x), std::abs(s.sphere.y), std::abs(s.sphere.z)});
    extent = std::max(extent, far), radius = std::max(radius, s.sphere.r);
    reach = std::max(reach, far + s.sphere.r);
  }
  return reach > 1e38 ? Range::too_large : extent + radius > 1e38 ? Range::may_be_refused : Range::fits;
}

// What a call gave, on the host.
struct Lists {
  std::vector<Pair> pairs;
  std::vector<std::byte> normals, points;
  std::vector<std::uint32_t> history;  // not compared: it depends on the call before
  explicit Lists(const Contacts& c) {
    const std::size_t scalar = c.scalar == Scalar::f32 ? 4 : 8;
    pairs.resize(c.count);
    if (c.normals) normals.resize(c.count * 4 * scalar);
    if (c.points) points.resize(c.count * 6 * scalar);
    const auto copy = [&](void* to, const void* from, std::size_t bytes) {
      if (bytes == 0) return;
      require(from != nullptr, "an array of the contacts is null");
      c.memory == Memory::device ? copy_from_device(to, from, bytes) : void(std::memcpy(to, from, bytes));
    };
    copy(pairs.data(), c.pairs, c.count * sizeof(Pair));
    copy(normals.data(), c.normals, normals.size()), copy(points.data(), c.points, points.size());
    if (c.history) history.resize(c.count);
    copy(history.data(), c.history, history.size() * sizeof(std::uint32_t));
  }
  friend bool operator==(const Lists& a, const Lists& b) {
    return a.pairs == b.pairs && a.normals == b.normals && a.points == b.points;
  }
};

// Where each pair stood in the list of the call before.
inline void check_history(const Lists& lists, const std::vector<Pair>& list_before) {
  std::unordered_map<std::uint64_t, std::uint32_t> index;
  const auto key = [](const Pair& p) { return std::uint64_t(p.i) << 32 | p.j; };
  for (std::uint32_t k = 0; k < list_before.size(); k++) index[key(list_before[k])] = k;
  for (std::size_t k = 0; k < lists.pairs.size(); k++) {
    const auto found = index.find(key(lists.pairs[k]));
    const std::uint32_t wanted = found == index.end() ? kNoContact : found->second;
    require(lists.history[k] == wanted, "history of ", text(lists.pairs[k]), " is ", lists.history[k],
            ", not ", wanted, " of ", list_before.size());
  }
}

// Normals, depths and points of some of the contacts, in long double.
template <class T>
void check_records(const Lists& lists, const std::vector<Seen>& spheres) {
  using Long = long double;
  const bool single = sizeof(T) == 4;
  const Long relative = single ? 4e-7 : 1e-14,
             least = single ? 2e-45 : 1e-323;  // least: half of the last digit
  const auto* normals = reinterpret_cast<const T*>(lists.normals.data());
  const auto* points = lists.points.empty() ? nullptr : reinterpret_cast<const T*>(lists.points.data());
  const std::size_t step = 1 + lists.pairs.size() / 100;
  for (std::size_t k = 0; k < lists.pairs.size(); k += step) {
    const Pair p = lists.pairs[k];
    const Sphere &a = spheres[p.i].sphere, &b = spheres[p.j].sphere;
    const Long x[3] = {Long(b.x) - a.x, Long(b.y) - a.y, Long(b.z) - a.z}, s = Long(a.r) + b.r,
               d = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    const T* n = normals + 4 * k;
    require(std::abs(Long(n[3]) - (s - d)) <= relative * (s + d) + least, "depth of ", text(p), " is ", n[3],
            ", not ", double(s - d));
    const Long per_d = d > 0 ? 1 / d : 0, c[6] = {a.x, a.y, a.z, b.x, b.y, b.z};
    for (int q = 0; q < 3; q++) {
      const Long wanted = d > 0 ? x[q] * per_d : q == 0;
      require(std::abs(n[q] - wanted) <= 3 * relative, "normal of ", text(p), " has ", n[q], ", not ",
              double(wanted));
      if (!points) continue;
      const Long on_i = c[q] + a.r * wanted, on_j = c[3 + q] - b.r * wanted;
      const T* at = points + 6 * k;
      require(std::abs(at[q] - on_i) <= 3 * relative * (std::abs(c[q]) + a.r) + least &&
                  std::abs(at[3 + q] - on_j) <= 3 * relative * (std::abs(c[3 + q]) + b.r) + least,
              "points of ", text(p), " are ", at[q], " and ", at[3 + q], ", not ", double(on_i), " and ",
              double(on_j));
    }
  }
}

}  // namespace padder::detect
