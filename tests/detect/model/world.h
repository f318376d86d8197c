// SPDX-License-Identifier: MIT
// The scene of the model test and what may happen to it between two calls: light edits, which a caller may
// make under one revision, and heavy ones, which ask for another (detector.h, Input::revision). Drawn from a
// stream of numbers alone, so that a seed stands for a scene.
#pragma once
#include <array>
#include <numbers>
#include <string>
#include <vector>

#include "detect/scene/generate.h"
#include "tests/detect/model/oracle.h"

namespace padder::detect {

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  std::uint64_t bits() { return random_.bits(); }
  std::uint64_t below(std::uint64_t n) { return n ? random_.bits() % n : 0; }
  std::size_t index(std::size_t n) { return static_cast<std::size_t>(below(n)); }
  bool chance(double p) { return random_.unit() < p; }
  double between(double a, double b) { return a + (b - a) * random_.unit(); }
  double normal() {
    return std::sqrt(-2 * std::log(1 - random_.unit())) * std::cos(2 * std::numbers::pi * random_.unit());
  }
  template <class T>
  T of(std::initializer_list<T> list) {
    return list.begin()[index(list.size())];
  }

 private:
  SplitMix64 random_;
};

struct ModelWorld {
  enum class Radii { equal, four, hundred, log_normal, points };
  enum class Places { everywhere, crowds, lattice, chain, one };

  std::vector<Sphere> loose;
  std::vector<std::uint32_t> family, mask, world;  // of loose spheres: of each, or none
  std::vector<std::uint8_t> still;                 // likewise
  std::vector<std::vector<Sphere>> shapes;
  std::vector<Body> bodies;
  bool worlds_of_bodies = false;
  bool floats = true;  // coordinates and radii of loose spheres are floats

  // What new spheres are drawn from.
  double unit = 1, edge = 10, center[3] = {0, 0, 0};
  Radii radii = Radii::equal;
  Places places = Places::everywhere;
  std::string story;  // of the edits since it was last cleared

  std::size_t body_spheres() const {
    std::size_t n = 0;
    for (const Body& b : bodies) n += shapes[b.shape].size();
    return n;
  }
  bool is_still(std::size_t k) const { return !still.empty() && still[k]; }

  // All spheres by their numbers, each where it is.
  std::vector<Seen> spheres() const {
    std::vector<Seen> all;
    all.reserve(body_spheres() + loose.size());
    for (std::size_t b = 0; b < bodies.size(); b++) {
      const Body& body = bodies[b];
      const double *m = body.rotation, *p = body.position;
      for (const Sphere& s : shapes[body.shape])
        all.push_back(
            {{m[0] * s.x + m[1] * s.y + m[2] * s.z + p[0], m[3] * s.x + m[4] * s.y + m[5] * s.z + p[1],
              m[6] * s.x + m[7] * s.y + m[8] * s.z + p[2], s.r},
             body.family,
             body.mask,
             body.world,
             static_cast<std::uint32_t>(b + 1),
             body.is_static});
    }
    for (std::size_t k = 0; k < loose.size(); k++)
      all.push_back({loose[k], family.empty() ? 0 : family[k], mask.empty() ? 0 : mask[k],
                     world.empty() ? 0 : world[k], 0, is_still(k)});
    return all;
  }

  // --- what new things are made of

  Sphere given(const Sphere& s) const {  // as float input gives it
    if (!floats) return s;
    const auto f = [](double v) {
      const volatile float single = static_cast<float>(v);  // gcc 12 leaves the rounding of neighbours out
      return static_cast<double>(single);
    };
    return {f(s.x), f(s.y), f(s.z), f(s.r)};
  }
  double radius(Dice& dice) const {
    switch (radii) {
      case Radii::four:
        return unit * dice.between(1, 4);
      case Radii::hundred:
        return unit / (1 - 0.99 * dice.between(0, 1));
      case Radii::log_normal:
        return unit * std::exp(0.7 * dice.normal());
      case Radii::points:
        return 0;
      default:
        return unit;
    }
  }
  void place(Dice& dice, std::size_t k, Sphere& s) const {
    double* const to[3] = {&s.x, &s.y, &s.z};
    const auto side = static_cast<std::size_t>(std::cbrt(static_cast<double>(loose.size()))) + 1;
    const std::size_t at[3] = {k % side, k / side % side, k / side / side};
    const std::size_t crowd = dice.index(5);
    for (int c = 0; c < 3; c++) {
      double v = center[c];
      if (places == Places::everywhere) v += edge * dice.between(-0.5, 0.5);
      if (places == Places::crowds)
        v += edge * (0.3 * dice.between(-0.5, 0.5) + 0.15 * (static_cast<double>((crowd + c) % 5) - 2));
      if (places == Places::lattice) v += 2 * unit * static_cast<double>(at[c]);
      if (places == Places::chain) v += 1.5 * unit * static_cast<double>(k) * (c == 2 ? -1 : 1);
      *to[c] = v;
    }
  }
  Sphere new_sphere(Dice& dice, std::size_t k) const {
    Sphere s;
    s.r = radius(dice);
    place(dice, k, s);
    return given(s);
  }
  std::uint32_t new_family(Dice& dice) const {
    return dice.of<std::uint32_t>({0, 0, 0, 1, 2, 31, 32, 33, 40, 0xffffffffu});
  }
  std::uint32_t new_mask(Dice& dice) const {
    return dice.of<std::uint32_t>({0, 0, 0, 0, 1, 2, 1u << 30, 1u << 31});
  }
  void turn(Dice& dice, Body& b) const {
    rotation_of(dice.normal(), dice.normal(), dice.normal(), dice.normal(), b.rotation);
  }
  void new_place(Dice& dice, Body& b) const {
    for (int c = 0; c < 3; c++) b.position[c] = center[c] + edge * dice.between(-0.5, 0.5);
    turn(dice, b);
  }

  // --- heavy edits

  // n loose spheres, now and then of several kinds, each with a unit and a place of its own.
  void strew(Dice& dice, std::size_t n) {
    const std::size_t kinds = n > 1 && dice.chance(0.2) ? 2 + dice.index(2) : 1;
    const double unit_before = unit, center_before[3] = {center[0], center[1], center[2]};
    std::vector<Sphere> all;
    for (std::size_t k = 0; k < kinds; k++) {
      if (k > 0) {
        unit = unit_before * dice.of({1.0, 0.25, 8.0, 200.0});
        const double far = edge * dice.of({0.0, 0.3, 2.0, 1e4});
        for (int c = 0; c < 3; c++) center[c] = center_before[c] + far * dice.between(-1, 1);
      }
      strew_kind(dice, k + 1 < kinds ? dice.index(n - all.size()) : n - all.size());
      all.insert(all.end(), loose.begin(), loose.end());
    }
    if (kinds > 1)
      for (std::size_t k = n; k > 1; k--) std::swap(all[k - 1], all[dice.index(k)]);
    loose = std::move(all);
    unit = unit_before, std::copy_n(center_before, 3, center);
  }
  // n loose spheres in a domain of so many cubes of their mean diameter for each.
  void strew_kind(Dice& dice, std::size_t n) {
    radii = dice.of({Radii::equal, Radii::four, Radii::hundred, Radii::log_normal, Radii::equal});
    if (dice.chance(0.05)) radii = Radii::points;
    places =
        dice.of({Places::everywhere, Places::everywhere, Places::crowds, Places::lattice, Places::chain});
    if (n <= 150 && dice.chance(0.1)) places = Places::one;
    const double room = dice.of({0.5, 0.7, 2.0, 40.0, 1e6});
    double volume = 0;
    Dice other(dice.bits());
    for (std::size_t k = 0; k < std::min<std::size_t>(n, 1000); k++) {
      const double r = std::max(radius(other), unit) / unit;
      volume += 8 * r * r * r * static_cast<double>(n) / static_cast<double>(std::min<std::size_t>(n, 1000));
    }
    edge = unit * std::cbrt(room * std::max(volume, 8.0));
    if (dice.chance(0.2)) center[0] = center[1] = center[2] = edge / 2;  // a corner at the origin
    loose.resize(n);
    for (std::size_t k = 0; k < n; k++) loose[k] = new_sphere(dice, k);
    family.clear(), mask.clear(), world.clear(), still.clear();
    tell("strew " + std::to_string(n) + " radii " + std::to_string(static_cast<int>(radii)) + " places " +
         std::to_string(static_cast<int>(places)) + " room " + std::to_string(room));
  }
  void attributes(Dice& dice) {
    const std::size_t n = loose.size();
    const auto fill = [&](auto& v, double p, auto draw) {
      v.clear();
      if (dice.chance(p))
        for (std::size_t k = 0; k < n; k++) v.push_back(draw());
    };
    fill(family, 0.4, [&] { return new_family(dice); });
    fill(mask, 0.3, [&] { return new_mask(dice); });
    const std::uint64_t worlds = dice.of<std::uint64_t>({1, 2, 40, 5000});
    const std::uint32_t step = dice.of({1u, 1u, 2u, 40'000'000u});
    const double every = dice.of({0.0, 0.0, 0.02, 0.5});
    fill(world, 0.2, [&] {
      return dice.chance(every) ? kEveryWorld : static_cast<std::uint32_t>(dice.below(worlds)) * step;
    });
    if (dice.chance(0.3)) std::sort(world.begin(), world.end());
    const double share = dice.of({0.0, 0.2, 0.8, 1.0});
    fill(still, 0.3, [&] { return static_cast<std::uint8_t>(dice.chance(share)); });
    tell("attributes");
  }
  void new_shape(Dice& dice, std::size_t k) {
    const std::size_t n = dice.of<std::size_t>({0, 1, 1, 2, 5, 20, 63, 64, 65, 130, 300});
    const double size = unit * dice.of({0.0, 0.5, 2.0, 4.0});
    shapes[k].clear();
    for (std::size_t q = 0; q < n; q++) {
      const auto at = [&] { return size * dice.between(-1, 1); };
      const double x = at(), y = at(), z = at();
      shapes[k].push_back({x, y, z, unit * dice.between(0.1, 0.8)});
    }
    if (dice.chance(0.05))
      for (Sphere& s : shapes[k]) s.x += 1e4 * unit, s.z -= 1e4 * unit;
  }
  void new_body(Dice& dice) {
    Body b;
    new_place(dice, b);
    b.shape = static_cast<std::uint32_t>(dice.index(shapes.size()));
    if (dice.chance(0.3)) b.family = new_family(dice);
    if (dice.chance(0.2)) b.mask = new_mask(dice);
    b.is_static = dice.chance(0.3);
    if (worlds_of_bodies) b.world = dice.of({0u, 0u, 1u, 2u, kEveryWorld});
    bodies.push_back(b);
  }
  void populate(Dice& dice, std::size_t most) {
    shapes.resize(1 + dice.index(3));
    for (std::size_t k = 0; k < shapes.size(); k++) new_shape(dice, k);
    bodies.clear();
    const std::size_t n = dice.of<std::size_t>({0, 1, 2, 5, 12, 30, 100, 400});
    const bool all_move = dice.chance(0.4);
    worlds_of_bodies = dice.chance(0.15);
    for (std::size_t k = 0; k < n && body_spheres() < most; k++) {
      new_body(dice);
      if (all_move) bodies.back().is_static = false;
    }
    tell("populate " + std::to_string(bodies.size()) + " bodies of " + std::to_string(body_spheres()));
  }
  void scale(double by) {
    for (Sphere& s : loose) s = given({s.x * by, s.y * by, s.z * by, s.r * by});
    for (auto& shape : shapes)
      for (Sphere& s : shape) s = {s.x * by, s.y * by, s.z * by, s.r * by};
    for (Body& b : bodies)
      for (double& p : b.position) p *= by;
    unit *= by, edge *= by;
    for (double& c : center) c *= by;
    tell("scale by " + text(by));
  }
  void shift(double by) {
    for (Sphere& s : loose) s = given({s.x + by, s.y - by, s.z + 2 * by, s.r});
    for (Body& b : bodies) b.position[0] += by, b.position[1] -= by, b.position[2] += 2 * by;
    center[0] += by, center[1] -= by, center[2] += 2 * by;
    tell("shift by " + text(by));
  }
  // To a scene of about the same kind at the origin and of the unit 1, where a float can be all it is.
  void to_floats(Dice& dice) {
    floats = true, unit = 1, center[0] = center[1] = center[2] = 0;
    strew(dice, loose.size());
    populate(dice, 3000);
  }
  void heavy_edit(Dice& dice, std::size_t (*size)(Dice&), bool with_bodies, bool with_loose) {
    switch (dice.below(10)) {
      case 0:
      case 1:
        if (with_loose) strew(dice, size(dice)), attributes(dice);
        break;
      case 2:
        if (with_bodies) populate(dice, 3000);
        break;
      case 3:
        attributes(dice);
        break;
      case 4:
        if (!shapes.empty()) {
          const std::size_t k = dice.index(shapes.size());
          const std::vector<Sphere> before = shapes[k];
          new_shape(dice, k);
          if (body_spheres() > 20000) shapes[k] = before;
          tell("another shape " + std::to_string(k));
        }
        break;
      case 5: {
        const double by = dice.of({1e-3, 1e3, 0x1p-20, 1e-12, 1e12, 1e-30, 1e30, 0.1}), to = unit * by;
        if (floats ? to > 1e-40 && to < 1e25 && edge * by < 1e30 : to > 1e-250 && edge * by < 1e80) scale(by);
        break;
      }
      case 6:
        shift(edge * dice.of({0.5, 3.0, -100.0, floats ? 10.0 : 1e7}));
        break;
      case 7:  // what stands still goes elsewhere, or begins to move
        for (Body& b : bodies) {
          if (b.is_static && dice.chance(0.7)) new_place(dice, b);
          if (dice.chance(0.2)) b.is_static = !b.is_static;
        }
        tell("static bodies move");
        break;
      case 8:
        for (std::size_t k = 0; k < loose.size(); k++)
          if (is_still(k) && dice.chance(0.5)) loose[k] = new_sphere(dice, k);
        tell("static spheres move");
        break;
      case 9:
        if (!shapes.empty() && with_bodies) {
          if (bodies.size() > 1 && dice.chance(0.5))
            bodies.erase(bodies.begin() + static_cast<std::ptrdiff_t>(dice.index(bodies.size())));
          else if (body_spheres() < 6000)
            new_body(dice);
          tell("bodies " + std::to_string(bodies.size()));
        }
        break;
    }
  }

  // --- light edits: of spheres that move, the end of the list of loose ones, poses

  void resize_tail(Dice& dice, std::size_t n) {
    std::size_t fixed = 0;  // up to the last one that stands still
    for (std::size_t k = 0; k < loose.size(); k++)
      if (is_still(k)) fixed = k + 1;
    n = std::max(n, fixed);
    const std::size_t before = loose.size();
    loose.resize(n);
    for (std::size_t k = before; k < n; k++) loose[k] = new_sphere(dice, k);
    const auto fit = [&](auto& v) {
      if (!v.empty()) v.resize(n, 0);
    };
    const bool had = before > 0;
    fit(family), fit(mask), fit(world), fit(still);
    if (!had || n == 0) family.clear(), mask.clear(), world.clear(), still.clear();
    tell("loose to " + std::to_string(n));
  }
  template <class F>
  void each_moving(Dice& dice, double share, F f) {
    for (std::size_t k = 0; k < loose.size(); k++)
      if (!is_still(k) && (share == 1 || dice.chance(share))) f(k), loose[k] = given(loose[k]);
  }
  void light_edit_of_loose(Dice& dice) {
    const std::size_t n = loose.size();
    switch (dice.below(9)) {
      case 0:
      case 1: {
        const double by = unit * dice.of({1e-3, 0.05, 0.3});
        each_moving(dice, 1, [&](std::size_t k) {
          Sphere& s = loose[k];
          s.x += by * dice.between(-1, 1), s.y += by * dice.between(-1, 1), s.z += by * dice.between(-1, 1);
        });
        tell("jiggle");
        break;
      }
      case 2:
        each_moving(dice, dice.of({0.02, 0.3, 1.0}), [&](std::size_t k) { place(dice, k, loose[k]); });
        tell("teleport");
        break;
      case 3:
        if (dice.chance(0.3)) radii = dice.of({Radii::equal, Radii::four, Radii::hundred});
        each_moving(dice, dice.of({0.1, 1.0}), [&](std::size_t k) { loose[k].r = radius(dice); });
        tell("other radii");
        break;
      case 4:
        if (n < 100000) resize_tail(dice, n + dice.of<std::size_t>({1, 2, 7, 60, n / 2}));
        break;
      case 5:
        resize_tail(dice, n - std::min(n, dice.of<std::size_t>({1, 2, 7, n / 2, n})));
        break;
      case 6:
        for (std::size_t k = 0; k < n; k++) {
          if (!family.empty() && !is_still(k) && dice.chance(0.3)) family[k] = new_family(dice);
          if (!mask.empty() && !is_still(k) && dice.chance(0.3)) mask[k] = new_mask(dice);
        }
        tell("families");
        break;
      case 7:
        odd_spheres(dice);
        break;
      case 8: {
        const double by = dice.of({0.5, 0.99, 1.01, 1.3});
        each_moving(dice, 1, [&](std::size_t k) { loose[k].r *= by; });
        tell("grow " + text(by));
        break;
      }
    }
  }
  // Some far away, huge, a hair from zero, or in one place.
  void odd_spheres(Dice& dice) {
    const std::uint64_t kind = dice.below(5), many = dice.of<std::uint64_t>({1, 3, 30});
    const double far = edge * dice.of({30.0, 1e5, 1e9, 1e20}), sign = dice.of({-1.0, 1.0});
    const std::size_t along = dice.index(3), smallest = dice.index(3);
    for (std::size_t q = 0; q < many && !loose.empty(); q++) {
      const std::size_t k = dice.index(loose.size());
      if (is_still(k)) continue;
      Sphere& s = loose[k];
      double* const axis = along == 0 ? &s.x : along == 1 ? &s.y : &s.z;
      if (kind == 0 && std::abs(far) < (floats ? 1e37 : 1e98)) *axis = sign * far;
      if (kind == 1)
        *axis = sign * std::array{1e-7, 1e-20, 1e-300, 5e-324, 0.0}[smallest + dice.index(3)] * unit;
      if (kind == 2 && edge < 1e30)
        s.r = dice.of({0.5, 1.0, 100.0, 1e6}) * (loose.size() < 5000 ? edge : unit);
      if (kind == 3) s.x = center[0], s.y = center[1], s.z = center[2];
      if (kind == 4) s.r = 0;
      s = given(s);
    }
    tell("odd spheres " + std::to_string(kind));
  }
  // Of bodies that move; gives their numbers.
  std::vector<std::uint32_t> move_bodies(Dice& dice) {
    std::vector<std::uint32_t> moved;
    const double share = dice.of({0.1, 0.5, 1.0}), by = dice.of({0.01, 0.5, 0.0}) * unit;
    for (std::uint32_t b = 0; b < bodies.size(); b++) {
      if (bodies[b].is_static || !dice.chance(share)) continue;
      if (by == 0)
        new_place(dice, bodies[b]);
      else
        for (double& p : bodies[b].position) p += by * dice.normal();
      if (dice.chance(0.3)) turn(dice, bodies[b]);
      moved.push_back(b);
    }
    tell("move " + std::to_string(moved.size()) + " bodies");
    return moved;
  }

  static std::string text(double v) {
    char t[40];
    std::snprintf(t, sizeof t, "%g", v);
    return t;
  }
  void tell(const std::string& what) { story += (story.empty() ? "" : ", ") + what; }
};

}  // namespace padder::detect
