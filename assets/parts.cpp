// SPDX-License-Identifier: GPL-3.0-or-later
#include "assets/parts.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <string>

#include "assets/solid.h"
#include "padding/asset/error.h"

namespace padder::assets {
namespace {

using std::numbers::pi;

void require(bool condition, const char* sentence) {
  if (!condition) throw Error(std::string(sentence));
}

// Rounded rectangles at heights: half sizes grow by `grow` at each.
struct Level {
  double z, grow_x, grow_y;
};
Mesh block(double x, double y, double half_x, double half_y, double radius,
           const std::vector<Level>& levels) {
  std::vector<Ring> rings;
  for (const Level& l : levels)
    rings.push_back(rounded_rectangle({x, y, l.z}, half_x + l.grow_x, half_y + l.grow_y,
                                      std::max(0.3 * radius, radius + std::min(l.grow_x, l.grow_y))));
  return loft(rings);
}

// A hole along y whose two ends open by `chamfer`; it stands out of [y0, y1] a little.
Mesh drill(double x, double z, double radius, double y0, double y1, double chamfer, int segments) {
  const double out = 0.5 * chamfer;
  return loft({circle(x, y0 - out, z, radius + chamfer + out, segments),
               circle(x, y0 + chamfer, z, radius, segments), circle(x, y1 - chamfer, z, radius, segments),
               circle(x, y1 + out, z, radius + chamfer + out, segments)});
}

}  // namespace

Mesh make_track_shoe(const TrackShoe& d) {
  const double pin = d.pitch / 2, top = d.plate / 2, clearance = 0.03 * d.pitch;
  const double edge =
      pin - d.boss / 2 - clearance;  // of the plate, in x: the neighbour's lug turns in front of it
  require(d.bore > 0 && d.boss > 1.3 * d.bore, "the boss must be at least 1.3 times as thick as its bore");
  require(d.plate > 0 && d.plate < d.boss, "the plate must be thinner than the boss");
  require(edge > 0.2 * d.pitch, "the bosses leave no room for a plate: lengthen the pitch");
  require(d.lugs >= 2 && d.lugs <= 25, "a shoe has 2 to 25 lugs");
  require(d.width > 1.2 * d.pitch, "the width must be more than 1.2 times the pitch");
  require(d.grouser > 0 && d.horn > 0.2 * d.pitch, "grouser and horn must have a height");
  require(d.segments >= 12 && d.segments <= 360, "a circle has 12 to 360 segments");

  // Plate, its long edges broken.
  const double c = 0.15 * d.plate;
  Ring section;
  for (const auto& [x, z] : {std::pair{edge, top - c},
                             {edge - c, top},
                             {c - edge, top},
                             {-edge, top - c},
                             {-edge, c - top},
                             {c - edge, -top},
                             {edge - c, -top},
                             {edge, c - top}})
    section.emplace_back(x, 0, z);
  Solid shoe(extrude(section, -d.width / 2, d.width / 2, c));

  // Roller paths, grousers, horn.
  const double path = 0.17 * d.width, path_half = 0.088 * d.width, rise = 0.54 * d.boss,
               bevel = 0.03 * d.boss;
  for (const double side : {-1.0, 1.0})
    shoe.add(block(0, side * path, edge - 2 * c, path_half,
                   0.4 * d.plate,  // above the bosses: wheels roll on them
                   {{0.5 * top, 0, 0},
                    {rise - bevel, -0.04 * d.boss, -0.04 * d.boss},
                    {rise, -0.04 * d.boss - bevel, -0.04 * d.boss - bevel}}));
  const double g = d.grouser, tip = 0.06 * g;
  for (const double side : {-1.0, 1.0})
    shoe.add(block(side * 0.66 * edge, 0, 0.27 * edge, d.width / 2 - 2 * c, 0.2 * edge,
                   {{-0.5 * top, 0, 0},
                    {-top - 0.08 * g, 0, 0},
                    {-top - g + tip, -0.15 * edge, -0.45 * g},
                    {-top - g, -0.15 * edge - tip, -0.45 * g - tip}}));
  const double fillet = 0.11 * d.horn, crown = 0.08 * d.horn, half_x = 0.68 * edge, half_y = 0.036 * d.width;
  std::vector<Level> levels = {{0.5 * top, fillet, fillet}};
  for (int k = 0; k <= 4; k++) {  // a hollow quarter circle out of the plate
    const double a = pi / 8 * k, out = fillet * (1 - std::sin(a));
    levels.push_back({top + fillet * (1 - std::cos(a)), out, out});
  }
  const double lean_x = 0.42 * half_x, lean_y = 0.35 * half_y;
  for (int k = 0; k <= 3; k++) {  // a round edge at its crown
    const double a = pi / 8 * k;
    levels.push_back({top + d.horn - crown * (1 - std::sin(a) / std::sin(3 * pi / 8)),
                      -lean_x - crown * (1 - std::cos(a)), -lean_y - crown * (1 - std::cos(a))});
  }
  shoe.add(block(0, 0, half_x, half_y, 0.7 * half_y, levels));
  shoe.cut(
      cylinder(0, top + 0.45 * d.horn, 0.16 * d.horn, -2 * half_y - fillet, 2 * half_y + fillet, d.segments));

  // Windows for the sprocket's teeth, between the grousers, their edges broken.
  for (const double side : {-1.0, 1.0}) {
    const double broken = 0.1 * d.plate;
    shoe.cut(block(0, side * 0.375 * d.width, 0.32 * edge, 0.062 * d.width, 0.2 * edge,
                   {{-top - broken, 2 * broken, 2 * broken},
                    {-top + broken, 0, 0},
                    {top - broken, 0, 0},
                    {top + broken, 2 * broken, 2 * broken}}));
  }

  // Lugs: the hull of the boss and a root inside the plate, drilled.
  const double slot = d.width / d.lugs, gap = 0.05 * slot;
  for (int k = 0; k < d.lugs; k++) {
    const double side = k % 2 ? 1 : -1, y0 = -d.width / 2 + k * slot + (k ? gap / 2 : 0);
    const double y1 = -d.width / 2 + (k + 1) * slot - (k + 1 < d.lugs ? gap / 2 : 0);
    Ring points = circle(side * pin, 0, 0, d.boss / 2, d.segments);
    for (const double z : {-0.55 * top, 0.55 * top}) points.emplace_back(side * 0.3 * edge, 0, z);
    Solid lug(extrude(hull(points), y0, y1, bevel));
    lug.cut(drill(side * pin, 0, d.bore / 2, y0, y1, bevel, d.segments));
    shoe.add(lug.mesh());
  }
  return finished(shoe.mesh(), 7);
}

Mesh make_road_wheel(const RoadWheel& d) {
  const double r = d.radius / 0.305, w = d.width / 0.150, b = d.bore / 2;
  require(r > 0 && w > 0, "a wheel needs a radius and a width");
  require(b > 0 && b < 0.040 * r, "the bore must be less than a quarter of the radius");
  require(d.bolts >= 0 && d.bolts <= 12 && d.windows >= 0 && d.windows <= 8,
          "a wheel has 0 to 12 bolts and 0 to 8 windows");
  require(d.segments >= 24 && d.segments <= 720, "a wheel has 24 to 720 segments");
  Ring profile;
  const auto at = [&](double radius, double y) { profile.emplace_back(r * radius, w * y, 0); };
  at(0.305, -0.058), at(0.305, 0.058), at(0.303, 0.064), at(0.298, 0.068), at(0.285, 0.070);  // tyre
  at(0.285, 0.075), at(0.264, 0.075), at(0.262, 0.073), at(0.262, 0.050), at(0.259, 0.042),
      at(0.252, 0.038);  // rim
  at(0.085, 0.010), at(0.073, 0.012), at(0.065, 0.018), at(0.062, 0.026), at(0.062, 0.042),
      at(0.059, 0.045);                                                                      // disc, hub
  profile.emplace_back(b + 0.003 * r, 0.045 * w, 0), profile.emplace_back(b, 0.042 * w, 0);  // bore
  profile.emplace_back(b, -0.042 * w, 0), profile.emplace_back(b + 0.003 * r, -0.045 * w, 0);
  at(0.059, -0.045), at(0.062, -0.042), at(0.062, -0.018), at(0.065, -0.010), at(0.073, -0.005),
      at(0.085, -0.004);
  at(0.252, 0.024), at(0.259, 0.020), at(0.262, 0.012), at(0.262, -0.073), at(0.264, -0.075);
  at(0.285, -0.075), at(0.285, -0.070), at(0.298, -0.068), at(0.303, -0.064);
  Solid wheel(revolve(profile, d.segments));
  const auto around = [&](int count, double at_radius, double radius, int segments) {
    for (int k = 0; k < count; k++) {
      const double angle = 2 * pi * (k + 0.25) / count;
      wheel.cut(cylinder(at_radius * std::cos(angle), at_radius * std::sin(angle), radius, -0.06 * w,
                         0.06 * w, segments));
    }
  };
  const double middle = 0.5 * (b + 0.062 * r);  // of the hub's ring
  around(d.bolts, middle, std::min(0.3 * (0.062 * r - b), 0.8 * middle * pi / std::max(d.bolts, 1) / 1.5),
         16);
  around(d.windows, 0.165 * r, 0.040 * r, 28);
  return finished(wheel.mesh(), 7);
}

Mesh make_grain(const Grain& d) {
  require(d.size > 0, "a grain needs a size");
  require(d.planes >= 8 && d.planes <= 1000, "a grain has 8 to 1000 planes");
  require(d.roundness > 0.02 && d.roundness <= 1, "the roundness lies above 0.02 and up to 1");
  require(d.frequency >= 1 && d.frequency <= 100, "the frequency lies between 1 and 100");
  std::mt19937 random(d.seed);
  const auto uniform = [&] {
    return (static_cast<double>(random()) + 0.5) / 4294967296.0;
  };  // the same everywhere
  struct Plane {
    Vector normal;
    double distance;
  };
  std::vector<Plane> planes;
  for (int k = 0; k < d.planes; k++) {  // spread over the sphere, then shaken: no side stays without a plane
    const double z = 1 - 2 * (k + 0.5) / d.planes, turn = pi * (3 - std::sqrt(5.0)) * k,
                 s = std::sqrt(1 - z * z);
    Vector shake;  // number by number: compilers differ in the order in which they evaluate arguments
    for (const int axis : {2, 1, 0}) shake[axis] = uniform() - 0.5;
    planes.push_back({(Vector(s * std::cos(turn), s * std::sin(turn), z) + 0.7 * shake).normalized(),
                      0.75 + 0.5 * uniform()});
  }
  const double power = 3 / d.roundness + 1;
  const Vector stretch(1.25, 0.95, 0.85);

  // A geodesic sphere, each point moved to where sum over the planes (n.p / distance)^power is 1.
  const double phi = (1 + std::sqrt(5.0)) / 2;
  const double v[12][3] = {{-1, phi, 0}, {1, phi, 0}, {-1, -phi, 0}, {1, -phi, 0},
                           {0, -1, phi}, {0, 1, phi}, {0, -1, -phi}, {0, 1, -phi},
                           {phi, 0, -1}, {phi, 0, 1}, {-phi, 0, -1}, {-phi, 0, 1}};
  const int f[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                        {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                        {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  Mesh mesh;
  std::map<std::array<int, 12>, std::uint32_t> known;  // by the integer weights of the twelve corners
  const auto vertex = [&](const int* face, int i, int j) {
    std::array<int, 12> key{};
    key[static_cast<std::size_t>(face[0])] = d.frequency - i - j;
    key[static_cast<std::size_t>(face[1])] = i, key[static_cast<std::size_t>(face[2])] = j;
    const auto [entry, fresh] = known.try_emplace(key, static_cast<std::uint32_t>(mesh.points.size()));
    if (fresh) {
      Vector u = Vector::Zero();
      for (std::size_t k = 0; k < 12; k++) u += key[k] * Vector(v[k][0], v[k][1], v[k][2]);
      u.normalize();
      double sum = 0;
      for (const Plane& p : planes) sum += std::pow(std::max(0.0, u.dot(p.normal)) / p.distance, power);
      mesh.points.push_back(0.5 * d.size * std::pow(sum, -1 / power) * u.cwiseProduct(stretch));
    }
    return entry->second;
  };
  for (const auto& face : f)
    for (int i = 0; i < d.frequency; i++)
      for (int j = 0; i + j < d.frequency; j++) {
        mesh.triangles.push_back({vertex(face, i, j), vertex(face, i + 1, j), vertex(face, i, j + 1)});
        if (i + j + 1 < d.frequency)
          mesh.triangles.push_back(
              {vertex(face, i + 1, j), vertex(face, i + 1, j + 1), vertex(face, i, j + 1)});
      }
  return rounded(mesh, 9);
}

Mesh make_hopper(const Hopper& d) {
  const double a = d.inlet / 2, o = d.outlet / 2, h = d.height, t = d.wall;
  require(t > 0 && o > 4 * t, "the outlet must be wider than eight walls");
  require(a > 1.5 * o, "the inlet must be more than 1.5 times as wide as the outlet");
  require(h > 0.3 * d.inlet, "the height must be more than 0.3 times the inlet");
  require(d.bolts >= 0 && d.bolts <= 20, "a flange has 0 to 20 bolts a side");
  require(d.segments >= 16 && d.segments <= 720 && d.segments % 8 == 0,
          "the segments are a multiple of 8 from 16 to 720");
  const int quarter = d.segments / 4, arc = quarter / 2;
  const auto square = [&](double half, double z) {  // with round corners; half of the chords at these
    Ring points;
    const double radius = 0.16 * a + half - a;
    for (int q = 0; q < 4; q++)
      for (int k = 0; k < quarter; k++) {
        const double angle = pi / 2 * k / arc, side = 2 * (half - radius) * (k - arc) / (quarter - arc);
        const Point p = k < arc ? Point(half - radius + radius * std::cos(angle),
                                        half - radius + radius * std::sin(angle), z)
                                : Point(half - radius - side, half, z);
        points.push_back(Eigen::AngleAxisd(pi / 2 * q, Vector::UnitZ()) * p);
      }
    return points;
  };
  const auto round = [&](double radius, double z) {
    Ring points;
    for (int k = 0; k < d.segments; k++) {
      const double angle = 2 * pi * (k - 0.5 * arc) / d.segments + pi / 4;
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
    return points;
  };
  const double tube = 0.13 * h, skirt = 0.17 * h, flange = 0.06 * d.inlet, plate = 2 * t;
  const double lean =
      t * (std::hypot(1, (a - o) / (h - tube - skirt)) - 1);  // keeps the wall's thickness where it leans
  const int steps = 8;
  const auto cone = [&](int k, double inside) {  // ruled between the square and the circle
    const double s = static_cast<double>(k) / steps;
    Ring points = square(a - inside, h - skirt);
    const Ring low = round(o - inside, tube);
    for (std::size_t i = 0; i < points.size(); i++) points[i] += s * (low[i] - points[i]);
    return points;
  };
  std::vector<Ring> rings = {square(a + flange, h), square(a + flange, h - plate), square(a, h - plate)};
  for (int k = 0; k <= steps; k++) rings.push_back(cone(k, 0));
  rings.push_back(round(o, 0)), rings.push_back(round(o - t, 0));
  for (int k = steps; k >= 0; k--) rings.push_back(cone(k, k == 0 || k == steps ? t : t + lean));
  rings.push_back(square(a - t, h));
  Solid hopper(loft(rings, true));
  for (int side = 0; side < 4; side++)
    for (int k = 0; k < d.bolts; k++) {
      const double along = 2 * a * ((k + 0.5) / d.bolts - 0.5), across = a + 0.5 * flange;
      const Eigen::AngleAxisd turn(pi / 2 * side, Vector::UnitZ());
      Mesh hole = cylinder(along, 0, 0.2 * flange, h - 2 * plate, h + plate, 16);
      for (Point& p : hole.points) p = turn * Point(p.x(), across + p.z(), p.y());
      for (auto& f : hole.triangles) std::swap(f[1], f[2]);  // y and z have changed places
      hopper.cut(hole);
    }
  return finished(hopper.mesh(), 7);
}

}  // namespace padder::assets
