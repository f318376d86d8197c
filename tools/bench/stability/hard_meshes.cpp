// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/stability/hard_meshes.h"

#include <cmath>
#include <numbers>

#include "detect/scene/generate.h"

namespace padder::bench {
namespace {

using detect::SplitMix64;
constexpr double kTurn = 2 * std::numbers::pi;

Mesh joined(Mesh mesh, const Mesh& more) {
  mesh.add(more);
  return mesh;
}

Mesh moved(Mesh mesh, const Vector& scale, const Vector& shift = Vector::Zero()) {
  for (Point& p : mesh.points) p = p.cwiseProduct(scale) + shift;
  return mesh;
}

Mesh turned(Mesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

// A grid of n x m quads over [0, 1]^2, two triangles each.
Mesh patch(int n, int m, const std::function<Point(double, double)>& at) {
  Mesh mesh;
  for (int i = 0; i <= n; i++)
    for (int j = 0; j <= m; j++) mesh.points.push_back(at(double(i) / n, double(j) / m));
  const auto index = [&](int i, int j) { return static_cast<std::uint32_t>(i * (m + 1) + j); };
  for (int i = 0; i < n; i++)
    for (int j = 0; j < m; j++) {
      mesh.triangles.push_back({index(i, j), index(i + 1, j), index(i + 1, j + 1)});
      mesh.triangles.push_back({index(i, j), index(i + 1, j + 1), index(i, j + 1)});
    }
  return mesh;
}

// Sides of [0, 1]^3 that are not joined: corners that are equal are separate points, as in an STL.
Mesh box(const Vector& size = Vector::Ones(), const Vector& low = Vector::Zero(), int n = 1) {
  Mesh mesh;
  for (int axis = 0; axis < 3; axis++)
    for (int side = 0; side < 2; side++) {
      Mesh face = patch(n, n, [&](double u, double v) {
        Point p;
        p[axis] = side, p[(axis + 1) % 3] = u, p[(axis + 2) % 3] = v;
        return p;
      });
      mesh.add(side ? face : turned(face));
    }
  return moved(mesh, size, low);
}

Mesh ball(double radius, int n = 24) {
  return patch(n, n / 2, [&](double u, double v) {
    const double a = kTurn * u, b = kTurn * (v - 0.5) / 2;
    return Point(radius * std::cos(a) * std::cos(b), radius * std::sin(a) * std::cos(b),
                 radius * std::sin(b));
  });
}

// A tetrahedron with its tip in the origin.
Mesh spike(double length, double width) {
  return {{{0, 0, 0}, {length, width, 0}, {length, -width, width}, {length, -width, -width}},
          {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}};
}

// A cone whose n triangles all meet in its tip, and a disc of n slivers below it.
Mesh cone(int n) {
  Mesh mesh;
  mesh.points = {{0, 0, 1}, {0, 0, 0}};
  for (int k = 0; k < n; k++) mesh.points.emplace_back(std::cos(kTurn * k / n), std::sin(kTurn * k / n), 0);
  for (int k = 0; k < n; k++) {
    const auto a = static_cast<std::uint32_t>(2 + k), b = static_cast<std::uint32_t>(2 + (k + 1) % n);
    mesh.triangles.push_back({0, a, b}), mesh.triangles.push_back({1, b, a});
  }
  return mesh;
}

Mesh moebius() {
  return patch(60, 6, [](double u, double v) {
    const double a = kTurn * u, w = v - 0.5, r = 1 + w * std::cos(a / 2);
    return Point(r * std::cos(a), r * std::sin(a), w * std::sin(a / 2));
  });
}

// The figure of eight, turned by half a turn on its way around.
Mesh klein() {
  return patch(60, 30, [](double u, double v) {
    const double a = kTurn * u, b = kTurn * v, x = std::sin(b), y = std::sin(2 * b);
    const double r = 2 + std::cos(a / 2) * x - std::sin(a / 2) * y;
    return Point(r * std::cos(a), r * std::sin(a), std::sin(a / 2) * x + std::cos(a / 2) * y);
  });
}

Mesh cross_cap() {
  return patch(40, 20, [](double u, double v) {
    const double a = kTurn * u, b = kTurn * v / 4;
    return Point(0.5 * std::cos(a) * std::sin(2 * b), 0.5 * std::sin(a) * std::sin(2 * b),
                 0.5 * (std::cos(b) * std::cos(b) - std::cos(a) * std::cos(a) * std::sin(b) * std::sin(b)));
  });
}

// A torus whose tube is wider than its hole: it crosses itself.
Mesh spindle() {
  return patch(48, 24, [](double u, double v) {
    const double w = 0.5 + std::cos(kTurn * v);
    return Point(w * std::cos(kTurn * u), w * std::sin(kTurn * u), std::sin(kTurn * v));
  });
}

// A plate with teeth, one body: each tooth's foot is cut out of the plate's upper side.
Mesh comb(int teeth) {
  Mesh profile;  // in the plane, counter-clockwise but for the plate's lower side
  std::vector<Point> outline = {{0, 0, 0}, {2.0 * teeth, 0, 0}};
  for (int k = teeth; k-- > 0;) {
    outline.insert(outline.end(), {{2.0 * k + 2, 5, 0}, {2.0 * k + 1.5, 5, 0}});
    outline.insert(outline.end(), {{2.0 * k + 1.5, 25, 0}, {2.0 * k + 0.5, 25, 0}, {2.0 * k + 0.5, 5, 0}});
  }
  outline.push_back({0, 5, 0});
  Mesh mesh;
  const auto n = static_cast<std::uint32_t>(outline.size());
  for (const double z : {0.0, 10.0})
    for (const Point& p : outline) mesh.points.push_back(p + Vector(0, 0, z));
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c}), mesh.triangles.push_back({a, c, d});
  };
  for (std::uint32_t k = 0; k < n; k++) quad(k, (k + 1) % n, n + (k + 1) % n, n + k);
  const auto face = [&](double x0, double x1, double y0, double y1) {  // both faces; joins by position
    const auto first = static_cast<std::uint32_t>(mesh.points.size());
    for (const double z : {0.0, 10.0})
      for (const Point& p : {Point(x0, y0, z), Point(x1, y0, z), Point(x1, y1, z), Point(x0, y1, z)})
        mesh.points.push_back(p);
    quad(first, first + 3, first + 2, first + 1), quad(first + 4, first + 5, first + 6, first + 7);
  };
  face(0, 2.0 * teeth, 0, 5);
  for (int k = 0; k < teeth; k++) face(2 * k + 0.5, 2 * k + 1.5, 5, 25);
  return mesh;
}

// Walls of one sheet, to and fro.
Mesh folded_sheet() {
  return patch(400, 1, [](double u, double v) {
    const int k = static_cast<int>(std::lround(u * 400));
    return Point(k % 2, 1e-3 * k, v);
  });
}

Mesh soup(int n) {
  SplitMix64 random(1);
  Mesh mesh;
  for (int k = 0; k < 3 * n; k++)
    mesh.points.emplace_back(random.signed_unit(), random.signed_unit(), random.signed_unit());
  for (std::uint32_t k = 0; k < mesh.points.size(); k += 3) mesh.triangles.push_back({k, k + 1, k + 2});
  return mesh;
}

Mesh one_triangle(const Point& third) { return {{{0, 0, 0}, {1, 0, 0}, third}, {{0, 1, 2}}}; }

Mesh cut_sides() {
  Mesh mesh = box();
  mesh.triangles.resize(mesh.triangles.size() - 2);
  mesh.add(patch(7, 5, [](double u, double v) { return Point(u, v, 1); }));
  return mesh;
}

Mesh hairy_ball() {
  SplitMix64 random(2);
  Mesh mesh = ball(1);
  for (int k = 0; k < 100; k++) {
    const double a = kTurn * random.unit(), b = std::asin(random.signed_unit());
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(
        -Vector::UnitX(), Vector(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b)));
    Mesh hair = moved(spike(1, 1e-4), Vector::Ones(), Vector(-1.9, 0, 0));
    for (Point& p : hair.points) p = turn * p;
    mesh.add(hair);
  }
  return mesh;
}

Mesh random_turns() {
  SplitMix64 random(3);
  Mesh mesh = ball(1);
  for (auto& t : mesh.triangles)
    if (random.bits() % 2) std::swap(t[1], t[2]);
  return mesh;
}

Mesh shaken() {
  SplitMix64 random(4);
  Mesh mesh = box(Vector::Ones(), Vector::Zero(), 10), loose;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {  // by itself: cracks and overlaps of 1e-7
    auto corners = mesh.corners(t);
    for (Point& p : corners)
      p += 1e-7 * Vector(random.signed_unit(), random.signed_unit(), random.signed_unit());
    loose.add(corners);
  }
  return loose;
}

std::vector<HardMesh> shapes() {
  const Right ok = Right::certified;
  const auto boxed = [](const Vector& size) { return [=] { return box(size); }; };
  const auto triangle = [](const Point& third) { return [=] { return one_triangle(third); }; };
  return {
      {"needle", "a box of 1e6 : 1 : 1", ok, boxed({1e6, 1, 1})},
      {"plate", "a box of 1e6 : 1e6 : 1", ok, boxed({1e6, 1e6, 1})},
      {"ribbon", "a box of 1e6 : 1e3 : 1", ok, boxed({1e6, 1e3, 1})},
      {"film", "a box of 1 : 1 : 1e-15", ok, boxed({1, 1, 1e-15})},
      {"spike", "a tetrahedron with a tip of 1e-6 rad", ok, [] { return spike(1, 1e-6); }},
      {"slivers", "4,000 triangles that meet in two points", ok, [] { return cone(2000); }},
      {"comb", "1,000 teeth", ok, [] { return comb(1000); }},
      {"hairy ball", "100 spikes of 1e-4 : 1 in a ball", ok, hairy_ball},
      {"million", "1,000,000 triangles in 6 planes", ok,
       [] { return box(Vector::Ones(), Vector::Zero(), 289); }},
      {"T-junctions", "a side is cut into 35 quads, its neighbours are not", ok, cut_sides},
      {"soup of a box", "each triangle by itself, off by 1e-7", ok, shaken},
      {"turned at random", "half of a ball's triangles face inward", ok, random_turns},
      {"inside out", "a box that faces inward", ok, [] { return turned(box()); }},
      {"Moebius strip", "one side, no inside", ok, moebius},
      {"Klein bottle", "closed, and no inside", ok, klein},
      {"cross cap", "closed, no inside, pinched along a line", ok, cross_cap},
      {"spindle torus", "crosses itself: winding numbers 1 and 2", ok, spindle},
      {"folded sheet", "400 walls of no thickness, 0.001 apart", ok, folded_sheet},
      {"1,000 triangles", "at random places", ok, [] { return soup(1000); }, 0.02},
      {"one triangle", "nothing else", ok, triangle({0.3, 0.8, 0})},
      {"sliver", "one triangle of 1 : 1e-9", ok, triangle({0.5, 1e-9, 0})},
      {"no area", "one triangle, its corners on a line", Right::refused, triangle({2, 0, 0})},
      {"one point", "three corners at one place", Right::refused,
       [triangle] {
         return moved(triangle({0, 1, 0})(), Vector::Zero());
       }},
  };
}

std::vector<HardMesh> pairs_and_sizes() {
  const Right ok = Right::certified;
  const auto two = [](const Vector& shift) {
    return [=] { return joined(box(), box(Vector::Ones(), shift)); };
  };
  const auto far = [](double at) { return [=] { return box(Vector::Ones(), Vector::Constant(at)); }; };
  std::vector<HardMesh> out = {
      {"twice the same", "two shells at one place", ok, two(Vector::Zero())},
      {"two ways", "a shell, and the same turned inside out", ok,
       [] { return joined(box(), turned(box())); }},
      {"nested", "a ball in a ball in a ball, all facing outward", ok,
       [] { return joined(joined(ball(1), ball(0.6)), ball(0.3)); }},
      {"hollow", "a ball with a hollow in it", ok, [] { return joined(ball(1), turned(ball(0.6))); }},
      {"thin hollow", "a wall of 1e-9", ok,
       [] { return joined(box(), turned(box(Vector::Constant(1 - 2e-9), Vector::Constant(1e-9)))); }},
      {"gap", "two boxes 1e-12 apart", ok, two({1 + 1e-12, 0, 0})},
      {"overlap", "two boxes that overlap by 1e-12", ok, two({1 - 1e-12, 0.3, 0})},
      {"face", "two boxes that share a face", ok, two({1, 0, 0})},
      {"edge", "two boxes that share an edge", ok, two({1, 1, 0})},
      {"point", "two boxes that share a corner", ok, two({1, 1, 1})},
      {"far pair", "two boxes 1e6 of their size apart", ok, two({1e6, 0, 0})},
      {"at 1e7", "a box of 1 at 1e7", ok, far(1e7)},
      {"at 1e15", "a box of 1 at 1e15: doubles are 0.125 apart", Right::not_certified, far(1e15)},
      {"at 1e17", "a box of 1 at 1e17: it vanishes in rounding", Right::refused, far(1e17)},
  };
  for (const char* size : {"1e-300", "1e-150", "1e-30", "1e-12", "1e12", "1e30", "1e38", "1e150", "1e300"}) {
    const double by = std::strtod(size, nullptr);
    const bool square = by < 1e-100 || by > 1e99;  // lengths whose powers leave the range of doubles
    out.push_back({std::string("size ") + size, "a box of that size", square ? Right::refused : ok,
                   [by] { return box(Vector::Constant(by)); }});
  }
  return out;
}

}  // namespace

const std::vector<HardMesh>& hard_meshes() {
  static const std::vector<HardMesh> all = [] {
    std::vector<HardMesh> list = shapes();
    for (HardMesh& mesh : pairs_and_sizes()) list.push_back(std::move(mesh));
    return list;
  }();
  return all;
}

}  // namespace padder::bench
