// SPDX-License-Identifier: MIT
#include "tools/settle/read_scene.h"

#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"

namespace padder::settle {
namespace {

using Json = nlohmann::json;
using Place = JsonPlace<Json>;

Vec3 vector_at(const Place& r) {
  double v[3];
  r.reals(v);
  for (const double x : v)
    if (std::abs(x) > 1e100) r.fail("numbers of at most 1e100 are wanted");  // squares of more overflow
  return {v[0], v[1], v[2]};
}

Vec3 unit_at(const Place& r) {
  const Vec3 v = vector_at(r);
  if (!(length(v) > 0)) r.fail("a vector that is not 0 is wanted");
  return (1 / length(v)) * v;
}

double real_at(const Place& r, const char* key, double otherwise, double least = 0, bool above = false) {
  if (!r.has(key)) return otherwise;
  const double v = r.at(key).real();
  if (above ? !(v > least) : !(v >= least))
    r.at(key).fail(above ? "a number above 0 is wanted" : "a number of at least 0 is wanted");
  return v;
}

// Above 0.
double needed_at(const Place& r, const char* key) {
  r.at(key);
  return real_at(r, key, 0, 0, true);
}

// Of the material of density 1 in the frame of the cluster. A cluster without mass properties counts as if
// its spheres did not overlap.
MassProperties mass_of(const detect::Scene::Asset& asset) {
  if (asset.mass.volume > 0) {
    if (possible(asset.mass)) return asset.mass;
    throw Error(
        "cluster " + excerpt(asset.name) +
        ": no body has its mass_properties (moments below 0, axes that are no rotation, or an inertia "
        "of others): pad its mesh again, or leave them out");
  }
  MassProperties m;
  for (const detect::Sphere& s : asset.rungs[0].spheres) {
    const double v = 4.0 / 3 * std::numbers::pi * s.r * s.r * s.r;
    m.volume += v, m.center += v * Point(s.x, s.y, s.z);
  }
  m.center /= m.volume;
  for (const detect::Sphere& s : asset.rungs[0].spheres) {
    const double v = 4.0 / 3 * std::numbers::pi * s.r * s.r * s.r;
    const Vector d = Point(s.x, s.y, s.z) - m.center;
    m.inertia += v * ((0.4 * s.r * s.r + d.squaredNorm()) * Eigen::Matrix3d::Identity() - d * d.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m.inertia);
  m.axes = solver.eigenvectors(), m.moments = solver.eigenvalues();
  if (m.axes.determinant() < 0) m.axes.col(2) *= -1;
  return m;
}

Quaternion quaternion_of(const Eigen::Matrix3d& m) {
  const Eigen::Quaterniond q(m);
  return {q.w(), q.x(), q.y(), q.z()};
}

struct Material {
  std::string name;
  double density, friction, restitution;
};

struct BodySettings {
  Vec3 velocity, spin;
  double density = 0;
  std::uint8_t material = 0;
  bool driven = false;
};

class Reader {
 public:
  Reader(detect::Scene scene, const Place& r) : scene_(std::move(scene)), r_(r) {
    r_.only({"gravity", "material", "materials", "material_pairs", "seed", "time_step", "duration", "grains",
             "planes", "cylinder", "bodies", "bushings"});
    if (r_.has("seed")) seed_ = r_.at("seed").whole(kMostSeed);
    read_materials();
    read_walls();
    read_body_settings();
    given_ = scene_.loose.size();
    for (const Place& g : r_.all("grains"))
      if (g.has("cluster"))
        put_padded_grains(g);
      else
        put_grains(g);
  }

  const detect::Scene& scene() const { return scene_; }

  SettleScene read(const detect::RungRule& rule) {
    System& s = out_.system;
    s.unit = scene_.unit;
    s.gravity = r_.has("gravity") ? vector_at(r_.at("gravity")) : Vec3{0, 0, -9.81 / metres(s.unit)};
    take_rungs(rule);
    for (const auto& asset : scene_.assets) add_shape(asset);
    for (std::size_t b = 0; b < scene_.bodies.size(); b++) add(b);
    add_loose();
    for (const Place& b : r_.all("bushings")) add_bushing(b);
    if (s.spheres() == 0) r_.fail("the scene has no spheres: give it bodies, spheres or grains");
    if (s.law.stiffness == 0) s.law.stiffness = chosen_stiffness(s);
    s.law.tangential_stiffness = 2.0 / 7 * s.law.stiffness;  // as in Silbert et al., 2001
    s.step = real_at(r_, "time_step", 0, 0, true);
    if (s.step == 0) s.step = step_limits(s).chosen;
    out_.duration = real_at(r_, "duration", 1);
    return std::move(out_);
  }

 private:
  // A mass for each cubed unit of length. Nothing is a thousand times as dense as osmium: who writes so for a
  // scene in mm means kilograms a cubic metre.
  double density_at(const Place& r, double otherwise) const {
    const double density = real_at(r, "density", otherwise, 0, true),
                 cubic_metre = std::pow(metres(scene_.unit), 3);
    if (cubic_metre != 1 && density / cubic_metre > 2.3e7)
      r.at("density").fail("a density is a mass for each cubed unit of the scene, and this is " +
                           short_number(density / cubic_metre, 3) + " kg a cubic metre: for " +
                           short_number(density, 6) + " kg a cubic metre write " +
                           short_number(density * cubic_metre, 6));
    return density;
  }
  void read_default_material() {
    Law& law = out_.system.law;
    const Json empty = Json::object();
    const std::string where = "material";
    const Place m = r_.has("material") ? r_.at("material") : Place(empty, where);
    m.only({"density", "friction", "restitution", "stiffness"});
    law.stiffness = real_at(m, "stiffness", 0, 0, true);
    if (law.stiffness > 1e100)
      m.at("stiffness").fail("a number of at most 1e100 is wanted");  // squares overflow
    add_material("default", m, {"", 2500 * std::pow(metres(scene_.unit), 3), 0.5, 0.4});
  }

  // What a material says, and `otherwise` what it does not.
  void add_material(const std::string& name, const Place& m, const Material& otherwise) {
    materials_.push_back({name, density_at(m, otherwise.density), real_at(m, "friction", otherwise.friction),
                          restitution_at(m, otherwise.restitution)});
  }
  static double restitution_at(const Place& m, double otherwise) {
    const double e = real_at(m, "restitution", otherwise);
    if (!(e >= kLeastRestitution && e <= 1)) m.at("restitution").fail("a number from 0.01 to 1 is wanted");
    return e;
  }

  // The default one, those with a name, and what is between each two of them: the means, or what is given.
  void read_materials() {
    read_default_material();
    if (r_.has("materials")) {
      r_.at("materials").object();
      for (const auto& item : r_.at("materials").json().items()) {
        const Place m = r_.at("materials").at(item.key());
        m.only({"density", "friction", "restitution"});
        if (item.key() == "default") m.fail("this is the name of \"material\": choose another one");
        if (materials_.size() == kMostMaterials) m.fail("a scene has at most 7 materials with a name");
        add_material(item.key(), m, materials_.front());
      }
    }
    auto& surfaces = out_.system.law.surfaces;
    for (std::size_t a = 0; a < materials_.size(); a++)
      for (std::size_t b = 0; b < materials_.size(); b++)
        surfaces[a][b] = {damping_ratio_of(0.5 * (materials_[a].restitution + materials_[b].restitution)),
                          0.5 * (materials_[a].friction + materials_[b].friction)};
    std::set<std::pair<std::uint8_t, std::uint8_t>> said;
    for (const Place& p : r_.all("material_pairs")) {
      const Place of = p.at("of");
      p.only({"of", "friction", "restitution"});
      if (of.size() != 2) of.fail("the names of two materials are wanted");
      const std::uint8_t a = material_named(of.at(std::size_t(0))), b = material_named(of.at(1));
      if (!said.insert(std::minmax(a, b)).second)
        p.fail("an entry before is of the same two materials: write one for each");
      const double mean = 0.5 * (materials_[a].restitution + materials_[b].restitution);
      surfaces[a][b] = {damping_ratio_of(restitution_at(p, mean)),
                        real_at(p, "friction", surfaces[a][b].friction)};
      surfaces[b][a] = surfaces[a][b];
    }
  }
  std::uint8_t material_named(const Place& r) const {
    const std::string name = r.text();
    for (std::size_t m = 0; m < materials_.size(); m++)
      if (materials_[m].name == name) return static_cast<std::uint8_t>(m);
    r.fail("there is no material \"" + name + "\" in \"materials\"");
  }
  // Of a body, a block of grains or a wall.
  std::uint8_t material_of(const Place& r) const {
    return r.has("material") ? material_named(r.at("material")) : std::uint8_t(0);
  }

  void read_walls() {
    System& s = out_.system;
    for (const Place& p : r_.all("planes")) {
      p.only({"point", "normal", "friction", "material"});
      s.walls.push_back({Wall::Kind::plane, vector_at(p.at("point")), unit_at(p.at("normal")), 0,
                         real_at(p, "friction", -1), material_of(p)});
    }
    if (!r_.has("cylinder")) return;
    const Place c = r_.at("cylinder");
    c.only({"point", "axis", "radius", "friction", "material"});
    s.walls.push_back({Wall::Kind::cylinder, vector_at(c.at("point")), unit_at(c.at("axis")),
                       needed_at(c, "radius"), real_at(c, "friction", -1), material_of(c)});
  }

  void read_body_settings() {
    settings_.resize(scene_.bodies.size(), plain());
    std::vector<bool> named(scene_.bodies.size());
    for (const Place& b : r_.all("bodies")) {
      b.only({"body", "velocity", "spin", "density", "driven", "material"});
      const std::uint32_t number = body_number(b.at("body"));
      if (named[number]) b.fail("an entry before is of the same body: write one for each");
      named[number] = true;
      BodySettings& to = settings_[number];
      to = settings_of(b);
      if (b.has("spin")) to.spin = vector_at(b.at("spin"));
      to.driven = b.has("driven") && b.at("driven").truth();
      if (scene_.bodies[number].is_static && (to.driven || to.velocity != Vec3{} || to.spin != Vec3{}))
        b.fail("the body is static and stands still: leave \"static\" out, or what sets it in motion");
    }
  }

  std::uint32_t body_number(const Place& r) const {
    const std::uint32_t b = r.bits();
    if (b >= scene_.bodies.size())
      r.fail("there is no body " + std::to_string(b) + ": the scene has " +
             std::to_string(scene_.bodies.size()));
    return b;
  }

  void add(std::size_t b) {
    System& s = out_.system;
    const detect::Body& body = scene_.bodies[b];
    const BodySettings& with = settings_[b];
    const MassProperties& m = masses_[body.shape];
    const double density = with.density;
    const Eigen::Matrix3d turn =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(body.rotation);
    const Point center = turn * m.center + Eigen::Map<const Point>(body.position);
    const bool held = body.is_static || with.driven;
    const Mass mass{held ? 0 : density * m.volume,
                    held ? Vec3{} : density * Vec3{m.moments.x(), m.moments.y(), m.moments.z()}};
    if (!held && mass.mass == 0)
      throw Error("body " + std::to_string(b) + " has no mass: use other units, or a larger density");
    const std::uint32_t k =
        add_body(s, body.shape, mass, {center.x(), center.y(), center.z()}, quaternion_of(turn * m.axes));
    s.bodies[k].family = body.family, s.bodies[k].mask = body.mask, s.bodies[k].is_static = body.is_static;
    s.bodies[k].world = body.world;
    s.driven[k] = with.driven, s.velocity[k] = with.velocity, s.spin[k] = with.spin;
    set_material(k, with.material);
    if (held) return;
    double rows[9];
    matrix_of(s.orientation[k], rows);
    const Vec3 w = transposed_times(rows, with.spin);
    s.momentum[k] = times(rows, {mass.moments.x * w.x, mass.moments.y * w.y, mass.moments.z * w.z});
  }

  void add_shape(const detect::Scene::Asset& asset) {
    masses_.push_back(mass_of(asset));
    const MassProperties& m = masses_.back();
    std::vector<detect::Sphere> spheres;
    for (const detect::Sphere& p : asset.spheres) {
      const Vector local = m.axes.transpose() * (Point(p.x, p.y, p.z) - m.center);
      spheres.push_back({local.x(), local.y(), local.z(), p.r});
    }
    out_.system.shapes.push_back(std::move(spheres));
  }

  double loose_value(std::size_t k) const {
    const detect::LooseSpheres& l = scene_.loose;
    return l.scalar == detect::Scalar::f32 ? l.single[k] : l.twice[k];
  }
  void add_loose() {
    System& s = out_.system;
    const detect::LooseSpheres& l = scene_.loose;
    for (std::size_t k = 0; k < l.size(); k++) {
      const double radius = loose_value(4 * k + 3);
      if (!(radius > 0))
        throw Error("loose sphere " + std::to_string(k) + " has no radius above 0, and so no mass");
      if (!l.world.empty() && l.world[k] != 0)
        throw Error("loose sphere " + std::to_string(k) +
                    " is in a world: here only bodies may be, so leave its \"world\" out");
      const BodySettings with = k < given_ ? plain() : grain_settings_[k - given_];
      const std::uint32_t m =
          add_grain(s, {loose_value(4 * k), loose_value(4 * k + 1), loose_value(4 * k + 2)}, radius,
                    with.density, with.velocity);
      set_material(m, with.material);
      if (!l.is_static.empty() && l.is_static[k]) s.inverse_mass[m] = 0;
    }
    s.grain_family = l.family, s.grain_mask = l.mask, s.grain_static = l.is_static;
  }

  void take_rungs(const detect::RungRule& rule) {
    double smallest = INFINITY;
    for (std::size_t k = 0; k < scene_.loose.size(); k++)
      smallest = std::min(smallest, loose_value(4 * k + 3));
    std::vector<std::span<const detect::Rung>> shapes;
    for (const auto& asset : scene_.assets) shapes.push_back(asset.rungs);
    out_.rungs = detect::choose_rungs_anywhere(shapes, scene_.bodies, smallest, rule);
    detect::take_rungs(scene_, out_.rungs);
  }

  // Calls put(place) for as many places as the block g has grains: on a lattice in the middle of the box,
  // layer by layer from `low` upwards; places outside of the cylinder stay empty.
  template <class Put>
  void fill(const Place& g, double widest, Put put) {
    const std::uint64_t count = g.at("count").whole(0xfffffffeu);
    constexpr double least_bytes = 400;  // that a run takes for a grain
    const double memory = double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
    if (least_bytes * static_cast<double>(count) > memory)
      g.at("count").fail("so many grains take more memory than this machine has: make them fewer");
    const Vec3 low = vector_at(g.at("low")), high = vector_at(g.at("high"));
    const double edge = 2.04 * widest;
    const auto places = [&](double from, double to) {
      return static_cast<std::int64_t>(std::fmax(0, std::fmin(std::floor((to - from) / edge), 1e9)));
    };
    const std::int64_t nx = places(low.x, high.x), ny = places(low.y, high.y),
                       nz = nx > 0 && ny > 0 ? places(low.z, high.z) : 0;
    if (!random_) random_.emplace(seed_);
    for (const Wall& w : out_.system.walls)
      if (w.kind == Wall::Kind::cylinder && count > 0 && 1.02 * widest > w.radius)
        g.fail("its largest grain, of radius " + short_number(widest, 6) +
               ", does not fit into the cylinder of radius " + short_number(w.radius, 6) +
               ": widen the cylinder to more than " + short_number(1.02 * widest, 6) +
               ", or make the grain smaller");
    // A box far wider than its walls has places without end.
    std::uint64_t made = 0, empty = 0, most_empty = 10'000'000 + 1000 * count;
    for (std::int64_t z = 0; z < nz && made < count; z++)
      for (std::int64_t y = 0; y < ny && made < count; y++)
        for (std::int64_t x = 0; x < nx && made < count; x++) {
          const Vec3 at{
              0.5 * (low.x + high.x) + edge * (static_cast<double>(x) - 0.5 * static_cast<double>(nx - 1)),
              0.5 * (low.y + high.y) + edge * (static_cast<double>(y) - 0.5 * static_cast<double>(ny - 1)),
              low.z + edge * (static_cast<double>(z) + 0.5)};
          if (!blocked(at, 1.02 * widest))
            put(at), made++;
          else if (++empty > most_empty)
            g.fail("nearly all places between low and high are outside of the walls: draw both closer");
        }
    if (made < count)
      g.at("count").fail("only " + std::to_string(made) + " of " + std::to_string(count) +
                         " grains find room between low and high: make the box larger or the grains fewer");
  }

  BodySettings plain() const {
    BodySettings with;
    with.density = materials_.front().density;
    return with;
  }
  // Of a body or a block of grains.
  BodySettings settings_of(const Place& g) const {
    BodySettings with;
    if (g.has("velocity")) with.velocity = vector_at(g.at("velocity"));
    with.material = material_of(g);
    with.density = density_at(g, materials_[with.material].density);
    return with;
  }
  void set_material(std::uint32_t mover, std::uint8_t material) {
    std::vector<std::uint8_t>& all = out_.system.material;
    if (material) all.resize(mover + 1);
    if (!all.empty()) all.resize(mover + 1), all[mover] = material;
  }

  void put_grains(const Place& g) {
    g.only({"count", "radius", "density", "low", "high", "velocity", "material"});
    double range[2];
    if (g.at("radius").json().is_number())
      range[0] = range[1] = g.at("radius").real();
    else
      g.at("radius").reals(range);
    if (!(range[0] > 0 && range[0] <= range[1]))
      g.at("radius").fail("a radius above 0, or [smallest, largest], is wanted");
    const double jitter = 0.01 * range[1];
    detect::LooseSpheres block;
    block.scalar = detect::Scalar::f64;
    fill(g, range[1], [&](const Vec3& place) {
      const double radius = range[0] + (range[1] - range[0]) * random_->unit();
      const Vec3 at = place + Vec3{jitter * random_->signed_unit(), jitter * random_->signed_unit(),
                                   jitter * random_->signed_unit()};
      block.twice.insert(block.twice.end(), {at.x, at.y, at.z, radius});
    });
    grain_settings_.resize(grain_settings_.size() + block.size(), settings_of(g));
    scene_.loose.append(block);
  }

  // Each of them is turned another way. Whatever the turn, it stays in its place of the lattice.
  void put_padded_grains(const Place& g) {
    g.only({"count", "cluster", "density", "low", "high", "velocity", "material"});
    const std::string name = g.at("cluster").text();
    const auto named = [&](const auto& asset) { return asset.name == name; };
    const auto found = std::find_if(scene_.assets.begin(), scene_.assets.end(), named);
    if (found == scene_.assets.end()) g.at("cluster").fail("no cluster of that name is in \"clusters\"");
    detect::Body body;
    body.shape = static_cast<std::uint32_t>(found - scene_.assets.begin());
    body.family = found->family, body.mask = found->mask;
    const Point center = mass_of(*found).center;
    double reach = 0;
    for (const detect::Rung& rung : found->rungs)
      for (const detect::Sphere& p : rung.spheres)
        reach = std::max(reach, (Point(p.x, p.y, p.z) - center).norm() + p.r);
    fill(g, reach, [&](const Vec3& at) {
      double q[4];
      for (double& v : q) v = random_->signed_unit();
      detect::rotation_of(q[0], q[1], q[2], q[3], body.rotation);
      const Vec3 from = times(body.rotation, {center.x(), center.y(), center.z()});
      body.position[0] = at.x - from.x, body.position[1] = at.y - from.y, body.position[2] = at.z - from.z;
      scene_.bodies.push_back(body);
    });
    settings_.resize(scene_.bodies.size(), settings_of(g));
  }

  bool blocked(const Vec3& at, double radius) const {
    const auto inside = [&](const Wall& w) { return contact_with(w, at, radius).depth > 0; };
    return std::any_of(out_.system.walls.begin(), out_.system.walls.end(), inside);
  }

  void add_bushing(const Place& b) {
    b.only({"bodies", "at", "stiffness", "damping"});
    System& s = out_.system;
    Bushing u;
    if (b.at("bodies").size() != 2) b.at("bodies").fail("two bodies are wanted");
    u.a = body_number(b.at("bodies").at(std::size_t(0))), u.b = body_number(b.at("bodies").at(1));
    if (u.a == u.b) b.at("bodies").fail("two different bodies are wanted");
    const Vec3 at = vector_at(b.at("at"));
    u.on_a = transposed_times(s.bodies[u.a].rotation, at - s.position[u.a]);
    u.on_b = transposed_times(s.bodies[u.b].rotation, at - s.position[u.b]);
    u.stiffness = needed_at(b, "stiffness"), u.damping = real_at(b, "damping", 0);
    s.bushings.push_back(u);
  }

  detect::Scene scene_;  // as given, then with the grains as well
  Place r_;
  SettleScene out_;
  std::vector<Material> materials_;           // the first is the default one
  std::vector<BodySettings> settings_;        // of each body
  std::uint64_t given_ = 0;                   // loose spheres that are no grains of a block
  std::vector<BodySettings> grain_settings_;  // of each grain of a block
  std::vector<MassProperties> masses_;
  std::uint64_t seed_ = 1;
  std::optional<detect::SplitMix64> random_;
};

}  // namespace

double chosen_stiffness(const System& s) {
  const double g = length(s.gravity);
  if (g == 0) throw Error("without gravity no stiffness can be chosen: give material.stiffness");
  const Vec3 up = (-1 / g) * s.gravity;
  double smallest = INFINITY, mean = 0;
  for (std::uint64_t k = 0; k < s.spheres(); k++) {
    const double r = s.radius_of(k);
    smallest = std::min(smallest, r), mean += r / static_cast<double>(s.spheres());
  }
  double weight = 0, heaviest = 0;
  Vec3 low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
  for (std::size_t m = 0; m < s.movers(); m++) {
    if (s.inverse_mass[m] == 0) continue;
    // A ball lies on a quarter of the spheres that its cross-section covers; a body may stand on one.
    const double ratio = m < s.bodies.size() ? 0 : s.grain_radius[m - s.bodies.size()] / mean;
    weight += g / s.inverse_mass[m];
    heaviest = std::max(heaviest, g / s.inverse_mass[m] / std::max(1.0, 0.25 * ratio * ratio));
    const Vec3 flat = s.position[m] - dot(s.position[m], up) * up;
    low = {std::min(low.x, flat.x), std::min(low.y, flat.y), std::min(low.z, flat.z)};
    high = {std::max(high.x, flat.x), std::max(high.y, flat.y), std::max(high.z, flat.z)};
  }
  // The ground that the movers stand on: their bounds, at least a square of the mean diameter.
  const double x = high.x - low.x + 2 * mean, y = high.y - low.y + 2 * mean, z = high.z - low.z + 2 * mean;
  const double area = std::abs(up.x) * y * z + std::abs(up.y) * z * x + std::abs(up.z) * x * y;
  const double column = weight * 4 * mean * mean / area;
  return std::max({column, heaviest, 1e-300}) / (0.01 * smallest);
}

SettleScene settle_scene_from_json(const std::string& text, const std::string& where,
                                   const std::filesystem::path& folder, const detect::RungRule& rule) {
  if (text.find("\"padder.cluster\"") < text.find("\"padder.scene\""))
    throw Error(
        where +
        ": it is a cluster, and a scene of bodies made of it is wanted: docs/detector/settle.md shows "
        "one, and --make ball --cluster makes one");
  detect::Scene scene = detect::scene_from_json(text, where, folder);
  const Json json = parse_json<Json>(text, where);
  const Place document(json, where);
  if (!document.has("settle"))
    document.fail(
        "this scene has no object \"settle\": docs/detector/settle.md says what is in it; {} takes all as it "
        "is by default");
  std::vector<std::filesystem::path> files = scene.files;
  SettleScene out = Reader(std::move(scene), document.at("settle")).read(rule);
  out.files = std::move(files);
  if (document.has("name")) out.name = document.at("name").text();
  return out;
}

SettleScene read_settle_scene(const std::filesystem::path& path, const detect::RungRule& rule) {
  SettleScene out =
      settle_scene_from_json(read_file(path, kMostText), path.string(), path.parent_path(), rule);
  if (out.name.empty()) out.name = path.stem().stem().string();
  out.files.push_back(path);
  return out;
}

detect::Scene scene_at_start(const std::string& text, const std::string& where,
                             const std::filesystem::path& folder) {
  detect::Scene scene = detect::scene_from_json(text, where, folder);
  const Json json = parse_json<Json>(text, where);
  const Place document(json, where);
  return document.has("settle") ? Reader(std::move(scene), document.at("settle")).scene() : scene;
}

}  // namespace padder::settle
