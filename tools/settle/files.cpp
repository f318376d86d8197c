// SPDX-License-Identifier: MIT
#include "tools/settle/files.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <span>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "padding/asset/vtp.h"

namespace padder::settle {
namespace {

// Hashes numbers by their bits, in order.
class Hash {
 public:
  template <class T>
  void add(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % 8 == 0);
    for (const T& v : values) {
      std::uint64_t words[sizeof(T) / 8];
      std::memcpy(words, &v, sizeof v);
      for (const std::uint64_t w : words) state_ = detect::mixed(state_ ^ w);
    }
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(std::span<const T>(values));
  }
  void add(double value) { add(std::span<const double>(&value, 1)); }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0;
};

NpyArray of(const std::vector<Vec3>& v) {
  return npy_array(v.empty() ? nullptr : &v.data()->x, {v.size(), 3});
}

// What a frame says of each sphere. Its velocity is that of its mover, and what its spin adds.
struct Frame {
  std::vector<double> centers, radii;
  std::vector<std::uint32_t> mover;
  std::vector<Vec3> velocities;
};

Frame frame_of(const Stepper& stepper) {
  const System& s = stepper.system();
  Frame f;
  for (std::uint64_t k = 0; k < s.spheres(); k++) {
    const detect::Sphere& p = stepper.placed()[k];
    const std::uint32_t m = s.mover_of(k);
    f.centers.insert(f.centers.end(), {p.x, p.y, p.z}), f.radii.push_back(p.r), f.mover.push_back(m);
    f.velocities.push_back(s.velocity[m] + cross(s.spin[m], Vec3{p.x, p.y, p.z} - s.position[m]));
  }
  return f;
}

// Families with which the loose spheres of a frame touch as those of the scene do. Each body has one, so that
// its spheres do not touch each other: one without gets a number that nothing else has. Static movers share
// one, unless theirs says who may not touch them.
std::vector<std::uint32_t> families_of_movers(const System& s) {
  std::vector<std::uint32_t> families(s.movers());
  std::map<std::uint32_t, std::uint64_t> movers_in;
  for (std::size_t m = 0; m < s.movers(); m++) {
    const bool body = m < s.bodies.size();
    families[m] = body                     ? s.bodies[m].family
                  : s.grain_family.empty() ? 0
                                           : s.grain_family[m - s.bodies.size()];
    movers_in[families[m]]++;
  }
  std::uint32_t next = 33;  // the first that no mask can name
  const auto unused = [&] {
    while (movers_in.contains(next)) next++;
    return next++;
  };
  const std::uint32_t of_still = unused();
  for (std::size_t m = 0; m < s.movers(); m++) {
    const bool body = m < s.bodies.size(), still = s.inverse_mass[m] == 0 && !(body && s.driven[m]),
               alone = families[m] == 0 || (families[m] >= 33 && movers_in[families[m]] == 1);
    if (still && alone)
      families[m] = of_still;
    else if (body && families[m] == 0)
      families[m] = unused();
  }
  return families;
}

void write_npz(const Stepper& stepper, const std::filesystem::path& path) {
  const System& s = stepper.system();
  const Frame f = frame_of(stepper);
  const std::uint64_t n = f.radii.size();
  const std::vector<std::uint32_t> families = families_of_movers(s);
  std::vector<std::uint32_t> family, mask, world;
  for (const std::uint32_t m : f.mover) {
    const bool body = m < s.bodies.size();
    family.push_back(families[m]);
    mask.push_back(body ? s.bodies[m].mask : s.grain_mask.empty() ? 0 : s.grain_mask[m - s.bodies.size()]);
    world.push_back(body ? s.bodies[m].world : 0);
  }
  const double time = stepper.time();
  Npz arrays;
  arrays["centers"] = npy_array(f.centers.data(), {n, 3});
  arrays["radii"] = npy_array(f.radii.data(), {n});
  arrays["family"] = npy_array(family.data(), {n});
  const auto tags = [&](const char* name, const std::vector<std::uint32_t>& of_each) {
    if (std::ranges::any_of(of_each, [](std::uint32_t t) { return t != 0; }))
      arrays[name] = npy_array(of_each.data(), {n});
  };
  tags("mask", mask), tags("world", world);
  arrays["mover"] = npy_array(f.mover.data(), {n});
  arrays["velocities"] = of(f.velocities);
  arrays["time"] = npy_array(&time, {1});
  write_file(path, npz_bytes(arrays));
}

void write_vtp(const Stepper& stepper, const std::filesystem::path& path) {
  const Frame f = frame_of(stepper);
  FileWriter file(path);
  VtpWriter writer(f.radii.size(), {{"radius", 'f', 8, 1}, {"mover", 'u', 4, 1}, {"velocity", 'f', 8, 3}},
                   [&](std::uint64_t at, std::string_view bytes) { file.write_at(at, bytes); });
  writer.append(0, f.radii), writer.append(1, f.mover), writer.append(2, f.velocities);
  writer.append(writer.positions(), f.centers);
  writer.finish(), file.commit();
}

// Springs as rows i, j, x, y, z: in double, which holds every number of 32 bits.
NpyArray of(const std::vector<SpringMemory>& springs) {
  std::vector<double> rows;
  for (const SpringMemory& m : springs)
    rows.insert(rows.end(), {double(m.i), double(m.j), m.spring.x, m.spring.y, m.spring.z});
  return npy_array(rows.data(), {springs.size(), 5});
}

const NpyArray& array_in(const Npz& arrays, const char* name, std::uint64_t columns,
                         const std::string& where) {
  const auto found = arrays.find(name);
  if (found == arrays.end() || found->second.kind != 'f' || found->second.size != 8 ||
      found->second.shape.size() != 2 || found->second.shape[1] != columns)
    throw Error(where + ": the array \"" + name +
                "\" is missing or has another form: this is no checkpoint of settle");
  return found->second;
}

template <class T>
std::vector<T> rows_of(const NpyArray& a) {
  std::vector<T> out(a.shape[0]);
  if (!out.empty()) std::memcpy(out.data(), a.bytes.data(), out.size() * sizeof(T));
  return out;
}

std::vector<SpringMemory> springs_of(const NpyArray& a) {
  const std::vector<double> rows = a.as<double>();
  std::vector<SpringMemory> out;
  const auto number = [](double v) {
    return v >= 0 && v < 4294967295.0 ? static_cast<std::uint32_t>(v) : 0xffffffffu;
  };
  for (std::size_t k = 0; k + 5 <= rows.size(); k += 5)
    out.push_back({number(rows[k]), number(rows[k + 1]), {rows[k + 2], rows[k + 3], rows[k + 4]}});
  return out;
}

// 64 bits as two numbers of 32, which a double holds.
std::vector<double> halves(std::uint64_t v) { return {double(v >> 32), double(v & 0xffffffffu)}; }

// The number of those; Error if they are none.
std::uint64_t joined(const std::vector<double>& halves, const std::string& where) {
  const auto good = [](double v) { return v >= 0 && v <= 4294967295.0 && v == std::floor(v); };
  if (halves.size() != 2 || !good(halves[0]) || !good(halves[1]))
    throw Error(where + ": its number of steps is damaged: this is no checkpoint of settle");
  return static_cast<std::uint64_t>(halves[0]) << 32 | static_cast<std::uint64_t>(halves[1]);
}

}  // namespace

std::filesystem::path frame_path(const std::filesystem::path& path, std::uint64_t number) {
  char digits[24];
  std::snprintf(digits, sizeof digits, "_%04llu", (unsigned long long)number);
  return path.parent_path() / (path.stem().string() + digits + path.extension().string());
}

void write_frame(const Stepper& stepper, const std::filesystem::path& path) {
  if (path.extension() == ".npz")
    write_npz(stepper, path);
  else if (path.extension() == ".vtp")
    write_vtp(stepper, path);
  else
    throw Error("cannot tell what to write to " + path.string() + ": frames end with .npz or .vtp");
}

std::uint64_t fingerprint(const System& s) {
  Hash h;
  for (const auto& shape : s.shapes) h.add(shape);
  for (const detect::Body& b : s.bodies)
    h.add(double(b.shape)), h.add(double(b.family)), h.add(double(b.mask)), h.add(double(b.world));
  for (const auto* tags : {&s.grain_family, &s.grain_mask})
    for (const std::uint32_t tag : *tags) h.add(double(tag));
  for (const auto* flags : {&s.driven, &s.grain_static})
    for (const std::uint8_t flag : *flags) h.add(double(flag));
  h.add(s.inverse_mass), h.add(s.inverse_inertia), h.add(s.grain_radius), h.add(s.gravity.x),
      h.add(s.gravity.y);
  h.add(s.gravity.z), h.add(s.step), h.add(s.law.stiffness), h.add(s.law.tangential_stiffness);
  for (const auto& of_material : s.law.surfaces)
    for (const Surface& f : of_material) h.add(f.damping_ratio), h.add(f.friction);
  for (const std::uint8_t m : s.material) h.add(double(m));
  for (const Wall& w : s.walls) {
    h.add(std::span<const Vec3>(&w.point, 1)), h.add(std::span<const Vec3>(&w.direction, 1));
    h.add(w.radius), h.add(w.friction), h.add(double(w.kind)), h.add(double(w.material));
  }
  for (const Bushing& u : s.bushings) {
    h.add(double(u.a)), h.add(double(u.b)), h.add(u.stiffness), h.add(u.damping);
    h.add(std::span<const Vec3>(&u.on_a, 1)), h.add(std::span<const Vec3>(&u.on_b, 1));
  }
  // Of what nothing can move: where it stands, or how a driven body goes on.
  for (std::size_t m = 0; m < s.movers(); m++) {
    if (s.inverse_mass[m] != 0) continue;
    const bool body = m < s.bodies.size(), driven = body && s.driven[m];
    h.add(std::span<const Vec3>(driven ? &s.velocity[m] : &s.position[m], 1));
    if (driven) h.add(std::span<const Vec3>(&s.spin[m], 1));
    if (body && !driven) h.add(std::span<const Quaternion>(&s.orientation[m], 1));
  }
  return h.value();
}

std::uint64_t state_hash(const Stepper& stepper) {
  const Snapshot s = stepper.snapshot();
  Hash h;
  h.add(double(s.steps)), h.add(s.position), h.add(s.velocity), h.add(s.momentum), h.add(s.spin),
      h.add(s.orientation);
  for (const auto* list : {&s.contacts, &s.walls})
    for (const SpringMemory& m : *list) {
      h.add(double(m.i)), h.add(double(m.j)), h.add(std::span<const Vec3>(&m.spring, 1));
    }
  return h.value();
}

void write_checkpoint(const Stepper& stepper, const std::filesystem::path& path) {
  const Snapshot s = stepper.snapshot();
  const std::vector<double> scene = halves(fingerprint(stepper.system())), steps = halves(s.steps);
  Npz arrays;
  arrays["scene"] = npy_array(scene.data(), {1, 2}), arrays["steps"] = npy_array(steps.data(), {1, 2});
  const std::vector<double> slow = halves(s.slow_since);
  if (s.slow_since != kNever) {
    arrays["slow_since"] = npy_array(slow.data(), {1, 2});
    arrays["slow_speed"] = npy_array(&s.slow_speed, {1, 1});
  }
  arrays["position"] = of(s.position), arrays["velocity"] = of(s.velocity);
  arrays["momentum"] = of(s.momentum), arrays["spin"] = of(s.spin);
  arrays["orientation"] =
      npy_array(s.orientation.empty() ? nullptr : &s.orientation.data()->w, {s.orientation.size(), 4});
  arrays["contacts"] = of(s.contacts), arrays["walls"] = of(s.walls);
  write_file(path, npz_bytes(arrays));
}

void read_checkpoint(Stepper& stepper, const std::filesystem::path& path) {
  const std::string where = path.string();
  const Npz arrays = npz_from_bytes(read_file(path), where);
  const auto pair_of = [&](const char* name) { return array_in(arrays, name, 2, where).as<double>(); };
  if (pair_of("scene") != halves(fingerprint(stepper.system())))
    throw Error(
        where +
        ": the checkpoint is of another scene: resume it with the scene and the time step that wrote it");
  Snapshot s;
  s.steps = joined(pair_of("steps"), where);
  if (arrays.contains("slow_since") && arrays.contains("slow_speed")) {
    s.slow_since = joined(pair_of("slow_since"), where);
    for (const double v : array_in(arrays, "slow_speed", 1, where).as<double>()) s.slow_speed = v;
  }
  const auto vectors = [&](const char* name) { return rows_of<Vec3>(array_in(arrays, name, 3, where)); };
  s.position = vectors("position"), s.velocity = vectors("velocity");
  s.momentum = vectors("momentum"), s.spin = vectors("spin");
  s.orientation = rows_of<Quaternion>(array_in(arrays, "orientation", 4, where));
  s.contacts = springs_of(array_in(arrays, "contacts", 5, where));
  s.walls = springs_of(array_in(arrays, "walls", 5, where));
  stepper.resume(s);
}

}  // namespace padder::settle
