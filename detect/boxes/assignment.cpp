// SPDX-License-Identifier: MIT
#include "detect/boxes/assignment.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>

#include "detect/core/errors.h"
#include "detect/core/input.h"

namespace padder::detect {
namespace {

// Of an array inside a mapped file, which may begin at any address.
const void* tag_at(const std::uint32_t* tags, std::uint64_t k) {
  return reinterpret_cast<const char*>(tags) + k * sizeof *tags;
}

// Do x, y, z, r of each sphere lie together?
template <class T>
bool packed(const Spheres& s) {
  return s.center_stride == 4 && s.radius_stride == 4 &&
         s.radii == static_cast<const char*>(s.centers) + 3 * sizeof(T);
}

// The smallest and largest x, y, z and r of a run of spheres. A comparison passes over what is no number; a
// member of `not_finite` is not 0 if the run has such, or an infinity. By vectors: then memory limits the
// loop, and not arithmetic.
template <class T>
struct Extremes {
  using Lanes __attribute__((vector_size(16))) = T;
  static constexpr int kVectors = 4 * sizeof(T) / sizeof(Lanes);
  T low[4], high[4], not_finite[4] = {0, 0, 0, 0};
  Extremes(const Spheres& s, std::uint64_t first, std::uint64_t end) {
    std::fill_n(low, 4, std::numeric_limits<T>::infinity());
    std::fill_n(high, 4, -std::numeric_limits<T>::infinity());
    Lanes lows[kVectors], highs[kVectors], zeros[kVectors];
    std::memcpy(lows, low, sizeof low), std::memcpy(highs, high, sizeof high);
    std::memcpy(zeros, not_finite, sizeof not_finite);
    const bool together = packed<T>(s);
    for (std::uint64_t k = first; k < end; k++) {
      Lanes v[kVectors];
      if (together) {
        std::memcpy(v, static_cast<const char*>(s.centers) + k * sizeof v, sizeof v);
      } else {
        const Given<T> g = given<T>(s, k);
        std::memcpy(v, &g, sizeof v);
      }
      for (int a = 0; a < kVectors; a++) {
        lows[a] = v[a] < lows[a] ? v[a] : lows[a];
        highs[a] = v[a] > highs[a] ? v[a] : highs[a];
        zeros[a] += v[a] * 0;
      }
    }
    std::memcpy(low, lows, sizeof low), std::memcpy(high, highs, sizeof high);
    std::memcpy(not_finite, zeros, sizeof not_finite);
  }
  // The largest |coordinate|.
  double extent() const {
    double most = 0;
    for (int a = 0; a < 3; a++) most = larger(most, larger(magnitude(low[a]), magnitude(high[a])));
    return most;
  }
  bool sound() const {
    bool all = low[3] >= 0 && extent() <= kLargest && high[3] <= kLargest;
    for (int a = 0; a < 4; a++) all &= not_finite[a] == 0;
    return all;
  }
};

// The halos of loose spheres, for Distribution.
template <class T>
struct LooseHalos {
  const Spheres& spheres;
  double largest_radius, margin;
  Bounds one(std::uint64_t k) const { return halo_of(given<T>(spheres, k).sphere(), largest_radius, margin); }
  // A halo reaches farther the larger the radius and the coordinates are.
  Bounds all(std::uint64_t first, std::uint64_t end) const {
    const Extremes<T> e(spheres, first, end);
    const Bounds reach = halo_of({e.extent(), 0, 0, e.high[3]}, largest_radius, margin);
    Bounds b;
    for (int a = 0; a < 3; a++) b.low[a] = e.low[a] + reach.low[1], b.high[a] = e.high[a] + reach.high[1];
    return b;
  }
};

// The same of bodies.
struct BodyHalos {
  std::span<const Body> bodies;
  const std::vector<ShapeExtent>& extents;
  double largest_radius, margin;
  Bounds one(std::uint64_t b) const {
    return halo_of(bodies[b], extents[bodies[b].shape], largest_radius, margin);
  }
  Bounds all(std::uint64_t first, std::uint64_t end) const {
    Bounds sum = one(first);
    for (std::uint64_t k = first; k < end; k++) {
      const Bounds b = one(k);
      for (int a = 0; a < 3; a++) {
        if (!(b.low[a] <= b.high[a])) return everywhere();  // an empty body goes nowhere, with no other
        sum.low[a] = std::min(sum.low[a], b.low[a]), sum.high[a] = std::max(sum.high[a], b.high[a]);
      }
    }
    return sum;
  }
  static Bounds everywhere() { return {{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}}; }
};

// One number of each stretch of the numbers: `step` long, at a place in it that follows from its start. A
// fixed place could meet the same row of a lattice every time.
std::uint64_t drawn(std::uint64_t start, std::uint64_t step, std::uint64_t end) {
  return std::min(start + mixed(start) % step, end - 1);
}

}  // namespace

std::uint64_t BoxLoad::bytes() const {
  return single.bytes() + twice.bytes() + ids.bytes() + family.bytes() + mask.bytes() + world.bytes() +
         is_static.bytes() + bodies.bytes() + body_ids.bytes() +
         first_of_body.capacity() * sizeof(std::uint64_t);
}

Input BoxLoad::input() const {
  Input in;
  in.spheres = scalar == Scalar::f32 ? spheres_of<float>(loose, single.data(), single.data() + 3)
                                     : spheres_of<double>(loose, twice.data(), twice.data() + 3);
  in.spheres.center_stride = in.spheres.radius_stride = 4;
  if (has_family) in.spheres.family = family.data();
  if (has_mask) in.spheres.mask = mask.data();
  if (has_world) in.spheres.world = world.data();
  in.spheres.world_of_all = world_of_all;
  if (has_static) in.spheres.is_static = is_static.data();
  in.shapes = shapes;
  in.bodies = {bodies.data(), body_count};
  return in;
}

std::uint64_t BoxLoad::body_of(std::uint64_t local) const {
  const auto next = std::upper_bound(first_of_body.begin(), first_of_body.end(), local);
  return static_cast<std::uint64_t>(next - first_of_body.begin()) - 1;
}

Assignment::Assignment(const Input& input, int threads) : input_(input), threads_(threads) {
  for (const Body& b : input.bodies) numbering_.loose += input.shapes[b.shape].count;
  read();
}

Assignment::Assignment(const Input& input, int threads, const Numbering& numbering)
    : input_(input), threads_(threads), numbering_(numbering) {
  read();
}

void Assignment::read() {
  for (const Shape& s : input_.shapes) extents_.push_back(extent_of(s));
  read_bodies();
  if (input_.spheres.scalar == Scalar::f32)
    read_loose<float>();
  else
    read_loose<double>();
}

void Assignment::read_bodies() {
  first_of_body_.resize(input_.bodies.size() + 1);
  for (std::size_t b = 0; b < input_.bodies.size(); b++) {
    first_of_body_[b] = body_spheres_;
    body_spheres_ += extents_[input_.bodies[b].shape].count;
  }
  first_of_body_.back() = body_spheres_;
  std::size_t suspect = input_.bodies.size();
  double largest = 0;
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(min                      \
                                                                          : suspect) reduction(max \
                                                                                               : largest)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(input_.bodies.size()); k++) {
    const auto b = static_cast<std::size_t>(k);
    const ShapeExtent& e = extents_[input_.bodies[b].shape];
    if (e.count == 0) continue;
    const Bounds bounds = halo_of(input_.bodies[b], e, 0);
    bool small = !e.faulty;
    for (int a = 0; a < 3; a++) small &= bounds.low[a] >= -kLargest && bounds.high[a] <= kLargest;
    if (!small) {  // perhaps one of its spheres is faulty: place them all
      const Shape& shape = input_.shapes[input_.bodies[b].shape];
      for (std::uint64_t q = 0; q < shape.count; q++)
        if (fault_of(placed(input_.bodies[b], shape.spheres[q])) != Fault::none)
          suspect = std::min(suspect, b);
    }
    largest = std::max(largest, e.largest_radius);
  }
  if (suspect < input_.bodies.size()) throw_fault_of_body(suspect);
  largest_radius_ = largest;
}

void Assignment::throw_fault_of_body(std::size_t b) const {
  const Shape& shape = input_.shapes[input_.bodies[b].shape];
  std::uint64_t q = 0;
  while (fault_of(placed(input_.bodies[b], shape.spheres[q])) == Fault::none) q++;
  throw Error(fault_sentence("sphere " + std::to_string(numbering_.body_sphere + first_of_body_[b] + q) +
                                 " (number " + std::to_string(q) + " of body " +
                                 std::to_string(numbering_.body + b) + ")",
                             placed(input_.bodies[b], shape.spheres[q])));
}

template <class T>
void Assignment::read_loose() {
  const Spheres& s = input_.spheres;
  std::uint64_t faulty = s.count;
  double largest = largest_radius_;
  constexpr std::uint64_t kGroup = 256;
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(min                     \
                                                                          : faulty) reduction(max \
                                                                                              : largest)
  for (std::int64_t group = 0; group < static_cast<std::int64_t>((s.count + kGroup - 1) / kGroup); group++) {
    const std::uint64_t first = static_cast<std::uint64_t>(group) * kGroup,
                        end = std::min(first + kGroup, s.count);
    const Extremes<T> e(s, first, end);
    if (!e.sound()) [[unlikely]]
      for (std::uint64_t k = end; k-- > first;)
        if (fault_of(given<T>(s, k).sphere()) != Fault::none) faulty = std::min(faulty, k);
    largest = std::max(largest, double(e.high[3]));
  }
  if (faulty < s.count)
    throw Error(
        fault_sentence("sphere " + std::to_string(numbering_.loose + faulty), given<T>(s, faulty).sphere()));
  largest_radius_ = largest;
}

std::vector<WeightedPoint> Assignment::sample(std::uint64_t most) const {
  std::vector<WeightedPoint> points;
  const Spheres& s = input_.spheres;
  const std::uint64_t step = s.count / most + 1;
  for (std::uint64_t start = 0; start < s.count; start += step) {
    const std::uint64_t k = drawn(start, step, std::min(start + step, s.count));
    const Sphere p = loose_at(s, k);
    points.push_back({{p.x, p.y, p.z}, static_cast<double>(step)});
  }
  const std::uint64_t bodies = input_.bodies.size(), stride = bodies / most + 1;
  for (std::uint64_t start = 0; start < bodies; start += stride) {
    const Body& b = input_.bodies[drawn(start, stride, std::min(start + stride, bodies))];
    const ShapeExtent& e = extents_[b.shape];
    if (e.count == 0) continue;
    WeightedPoint p{{0, 0, 0}, static_cast<double>(stride * e.count)};
    middle_of(b, e, p.at);
    bool finite = true;
    for (const double c : p.at) finite &= std::isfinite(c);
    if (finite) points.push_back(p);
  }
  return points;
}

template <class T>
void Assignment::count_loose(const BoxTree& tree, std::uint64_t table_bytes) {
  loose_.count(
      input_.spheres.count, tree, LooseHalos<T>{input_.spheres, largest_radius_, margin_},
      [](std::uint64_t first, std::uint64_t end) { return end - first; }, threads_, table_bytes);
}

void Assignment::count(const BoxTree& tree, std::uint64_t table_bytes) {
  const auto weight = [&](std::uint64_t first, std::uint64_t end) {
    std::uint64_t sum = 0;
    for (std::uint64_t b = first; b < end; b++) sum += extents_[input_.bodies[b].shape].count;
    return sum;
  };
  bodies_.count(input_.bodies.size(), tree, BodyHalos{input_.bodies, extents_, largest_radius_, margin_},
                weight, threads_, table_bytes / 2);
  if (input_.spheres.scalar == Scalar::f32)
    count_loose<float>(tree, table_bytes / 2);
  else
    count_loose<double>(tree, table_bytes / 2);
}

std::uint64_t Assignment::load_bytes(std::uint32_t box) const {
  const Spheres& s = input_.spheres;
  const std::uint64_t each = (s.scalar == Scalar::f32 ? 16u : 32u) + sizeof(std::uint64_t) +
                             (s.family ? 4u : 0u) + (s.mask ? 4u : 0u) + (s.world ? 4u : 0u) +
                             (s.is_static ? 1u : 0u);
  return loose_.count_of(box) * each + bodies_.count_of(box) * (sizeof(Body) + 2 * sizeof(std::uint64_t)) +
         64;
}

void Assignment::prepare(BoxLoad& load, std::uint32_t box, const BoxTree& tree) const {
  const Spheres& s = input_.spheres;
  load.region = tree.region(box), load.scalar = s.scalar, load.shapes = input_.shapes;
  load.loose = loose_.count_of(box), load.body_count = bodies_.count_of(box);
  load.body_spheres = bodies_.weight_of(box);
  load.has_world = s.world, load.world_of_all = s.world_of_all;
  load.has_family = s.family, load.has_mask = s.mask, load.has_static = s.is_static;
  const std::uint64_t loose = load.room.loose_before + load.loose + load.room.loose_behind,
                      bodies = load.room.bodies_before + load.body_count + load.room.bodies_behind;
  if (s.scalar == Scalar::f32)
    load.single.at_least(4 * loose);
  else
    load.twice.at_least(4 * loose);
  load.ids.at_least(loose);
  if (s.family) load.family.at_least(loose);
  if (s.mask) load.mask.at_least(loose);
  if (s.world) load.world.at_least(loose);
  if (s.is_static) load.is_static.at_least(loose);
  load.bodies.at_least(bodies), load.body_ids.at_least(bodies);
}

template <class T>
void Assignment::fill_loose(const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads,
                            const Done& done) const {
  const Spheres& s = input_.spheres;
  const auto put = [&](std::uint64_t k, std::uint64_t end, std::uint32_t box, std::uint64_t place) {
    BoxLoad& load = loads[box - first];
    place += load.room.loose_before;
    T* const to = [&] {
      if constexpr (sizeof(T) == 4)
        return load.single.data() + 4 * place;
      else
        return load.twice.data() + 4 * place;
    }();
    const std::uint64_t n = end - k;
    if (packed<T>(s)) {
      std::memcpy(to, static_cast<const char*>(s.centers) + 4 * k * sizeof(T), 4 * n * sizeof(T));
    } else {
      for (std::uint64_t q = 0; q < n; q++) {
        const Given<T> g = given<T>(s, k + q);
        std::memcpy(to + 4 * q, &g, sizeof g);
      }
    }
    for (std::uint64_t q = 0; q < n; q++) load.ids.data()[place + q] = numbering_.loose + k + q;
    if (s.family) std::memcpy(load.family.data() + place, tag_at(s.family, k), n * sizeof *s.family);
    if (s.mask) std::memcpy(load.mask.data() + place, tag_at(s.mask, k), n * sizeof *s.mask);
    if (s.world) std::memcpy(load.world.data() + place, tag_at(s.world, k), n * sizeof *s.world);
    if (s.is_static) std::memcpy(load.is_static.data() + place, s.is_static + k, n);
  };
  loose_.deliver(first, first + static_cast<std::uint32_t>(loads.size()), tree,
                 LooseHalos<T>{s, largest_radius_, margin_}, put, done, threads_);
}

void Assignment::fill_bodies(const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads) const {
  const auto put = [&](std::uint64_t b, std::uint64_t end, std::uint32_t box, std::uint64_t place) {
    BoxLoad& load = loads[box - first];
    place += load.room.bodies_before;
    for (; b < end; b++, place++)
      load.bodies.data()[place] = input_.bodies[b],
      load.body_ids.data()[place] = numbering_.body_sphere + first_of_body_[b];
  };
  bodies_.deliver(
      first, first + static_cast<std::uint32_t>(loads.size()), tree,
      BodyHalos{input_.bodies, extents_, largest_radius_, margin_}, put, [](std::uint32_t) {}, threads_);
  for (BoxLoad& load : loads) {
    load.first_of_body.assign(load.body_count + 1, 0);
    for (std::uint64_t b = 0; b < load.body_count; b++)
      load.first_of_body[b + 1] =
          load.first_of_body[b] + extents_[load.bodies.data()[load.room.bodies_before + b].shape].count;
  }
}

void Assignment::fill(const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads,
                      const Done& done) const {
  for (std::size_t k = 0; k < loads.size(); k++)
    prepare(loads[k], first + static_cast<std::uint32_t>(k), tree);
  fill_bodies(tree, first, loads);
  if (input_.spheres.scalar == Scalar::f32)
    fill_loose<float>(tree, first, loads, done);
  else
    fill_loose<double>(tree, first, loads, done);
}

}  // namespace padder::detect
