// SPDX-License-Identifier: MIT
#include "tools/settle/page/page.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "tools/settle/page/page_template.h"

namespace padder::settle {
namespace {

constexpr std::uint64_t kMostPageBytes = std::uint64_t(512) << 20;
constexpr std::uint64_t kAllShown = 50000;  // spheres of a scene of which nothing is left out
constexpr float kMostSteps = 65535;         // along an axis of the box
constexpr double kLarge = 3;                // times the mean radius
constexpr std::size_t kManySpheres = 8;     // of a body

void replace(std::string& text, const std::string& mark, const std::string& by) {
  text.replace(text.find(mark), mark.size(), by);
}

std::string compressed(const std::vector<unsigned char>& bytes) {
  std::string out(compressBound(bytes.size()), '\0');
  uLongf size = out.size();
  if (compress(reinterpret_cast<Bytef*>(out.data()), &size, bytes.data(), bytes.size()) != Z_OK)
    throw Error("there is not enough memory to compress a frame: ask for fewer frames");
  out.resize(size);
  return out;
}

double mean_radius(const System& system) {
  double mean = 0;
  for (std::uint64_t k = 0; k < system.spheres(); k++)
    mean += system.radius_of(k) / static_cast<double>(system.spheres());
  return mean;
}

}  // namespace

std::vector<bool> seen_from_outside(std::span<const Vec3> points) {
  std::vector<bool> seen(points.size(), true);
  if (points.empty()) return seen;
  double low[3], size[3], volume = 1;
  for (int a = 0; a < 3; a++) {
    std::vector<double> values;
    for (const Vec3& p : points) values.push_back((&p.x)[a]);
    const std::size_t cut = values.size() / 200;  // what has fallen out of the scene does not count
    std::nth_element(values.begin(), values.begin() + cut, values.end());
    low[a] = values[cut];
    std::nth_element(values.begin(), values.end() - 1 - cut, values.end());
    size[a] = values[values.size() - 1 - cut] - low[a], volume *= size[a];
  }
  const double edge = 1.5 * std::cbrt(volume / static_cast<double>(points.size()));
  if (!(edge > 0)) return seen;
  // Cells 1 to n, and around them air; below them none, where the floor is.
  std::int64_t n[3];
  for (int a = 0; a < 3; a++) n[a] = static_cast<std::int64_t>(size[a] / edge) + 1;
  enum : std::uint8_t { empty, full, air };
  const auto number = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    return static_cast<std::size_t>((z * (n[1] + 2) + y) * (n[0] + 2) + x);
  };
  std::vector<std::uint8_t> cells(number(0, 0, n[2] + 2), empty);
  const auto cell_of = [&](const Vec3& p, int a) {
    const double at = std::floor(((&p.x)[a] - low[a]) / edge) + 1;
    return static_cast<std::int64_t>(std::clamp(at, a == 2 ? 1.0 : 0.0, static_cast<double>(n[a] + 1)));
  };
  for (const Vec3& p : points) cells[number(cell_of(p, 0), cell_of(p, 1), cell_of(p, 2))] = full;
  std::vector<std::array<std::int64_t, 3>> open;
  const auto flood = [&](std::int64_t x, std::int64_t y, std::int64_t z, bool border) {
    if (x < 0 || y < 0 || z < 1 || x > n[0] + 1 || y > n[1] + 1 || z > n[2] + 1) return;
    std::uint8_t& cell = cells[number(x, y, z)];
    if (cell == air || (cell == full && !border)) return;
    cell = air, open.push_back({x, y, z});
  };
  for (std::int64_t z = 1; z <= n[2] + 1; z++)
    for (std::int64_t y = 0; y <= n[1] + 1; y++)
      for (std::int64_t x = 0; x <= n[0] + 1; x++)
        if (x == 0 || y == 0 || x > n[0] || y > n[1] || z > n[2]) flood(x, y, z, true);
  while (!open.empty()) {
    const auto [x, y, z] = open.back();
    open.pop_back();
    for (const int d : {-1, 1})
      flood(x + d, y, z, false), flood(x, y + d, z, false), flood(x, y, z + d, false);
  }
  for (std::size_t k = 0; k < points.size(); k++) {
    const std::int64_t x = cell_of(points[k], 0), y = cell_of(points[k], 1), z = cell_of(points[k], 2);
    bool near = false;
    for (std::int64_t c = std::max<std::int64_t>(z - 2, 1); c <= std::min(z + 2, n[2] + 1); c++)
      for (std::int64_t b = std::max<std::int64_t>(y - 2, 0); b <= std::min(y + 2, n[1] + 1); b++)
        for (std::int64_t a = std::max<std::int64_t>(x - 2, 0); a <= std::min(x + 2, n[0] + 1); a++)
          near = near || cells[number(a, b, c)] == air;
    seen[k] = near;
  }
  return seen;
}

std::uint64_t Movie::usual_frames(std::uint64_t spheres) {
  return std::clamp<std::uint64_t>(120'000'000 / std::max<std::uint64_t>(spheres, 1), 10, 100);
}

void Movie::add(const Stepper& stepper) {
  std::vector<float> frame;
  for (const detect::Sphere& s : stepper.placed())
    for (const double v : {s.x, s.y, s.z}) frame.push_back(static_cast<float>(v));
  centers_.push_back(std::move(frame)), times_.push_back(stepper.time());
  if (stepper.placed().size() <= kAllShown) return;
  const std::vector<bool> now = seen_from_outside(stepper.system().position);
  seen_.resize(now.size());
  for (std::size_t m = 0; m < now.size(); m++) seen_[m] = seen_[m] || now[m];
}

// The spheres of movers that are seen, and of all that are much larger than the others.
std::vector<std::uint32_t> Movie::spheres_to_show(const System& system) const {
  const double large_radius = kLarge * mean_radius(system);
  std::vector<std::uint32_t> shown;
  for (std::uint32_t k = 0; k < system.spheres(); k++) {
    const std::uint32_t m = system.mover_of(k);
    const bool large =
        system.radius_of(k) > large_radius ||
        (m < system.bodies.size() && system.shapes[system.bodies[m].shape].size() > kManySpheres);
    if (seen_.empty() || seen_[m] || large) shown.push_back(k);
  }
  return shown;
}

// What a page's places are counted in: steps from `low` on.
struct Movie::Box {
  float low[3], high[3], step[3];
};

// Grains that have fallen out of the scene do not widen the box: it is that of the bulk and of what is large,
// a third wider.
Movie::Box Movie::box_of(const System& system, std::span<const std::uint32_t> shown) const {
  const double large_radius = kLarge * mean_radius(system);
  double smallest = INFINITY;
  for (const std::uint32_t k : shown) smallest = std::min(smallest, system.radius_of(k));
  Box box;
  for (int a = 0; a < 3; a++) {
    float &low = box.low[a], &high = box.high[a];
    std::vector<float> values;
    for (const auto* frame : {&centers_.front(), &centers_.back()})
      for (std::size_t k = static_cast<std::size_t>(a); k < frame->size(); k += 3)
        values.push_back((*frame)[k]);
    std::sort(values.begin(), values.end());
    const std::size_t cut = values.size() / 200;
    low = values[cut], high = values[values.size() - 1 - cut];
    for (const std::uint32_t k : shown)
      for (const auto* frame : {&centers_.front(), &centers_.back()})
        if (const float at = (*frame)[3 * k + static_cast<std::size_t>(a)];
            system.radius_of(k) > large_radius)
          low = std::min(low, at), high = std::max(high, at);
    const float more = (high - low) / 3 + 1e-3f;
    low -= more, high += more;
    box.step[a] = std::max((high - low) / kMostSteps, static_cast<float>(smallest / 64));
  }
  return box;
}

// Of every frame whose number differs from the last one's by a multiple of `stride`: the steps that each
// sphere has moved since the one before, first along x for all spheres, then y, then z. A step back lies
// between two steps forth (0, -1, 1, -2, 2), and low bytes stand before high ones, most of which are 0.
std::vector<std::string> Movie::packed(const Box& box, std::span<const std::uint32_t> shown,
                                       std::size_t stride) const {
  std::vector<std::string> frames;
  const std::size_t numbers = 3 * shown.size();
  std::vector<std::uint16_t> before(numbers, 0);
  std::vector<unsigned char> bytes(2 * numbers);
  for (std::size_t f = (centers_.size() - 1) % stride; f < centers_.size(); f += stride) {
    for (std::size_t k = 0; k < numbers; k++) {
      const std::size_t axis = k / shown.size();
      const float place = (centers_[f][3 * shown[k % shown.size()] + axis] - box.low[axis]) / box.step[axis];
      const auto now = static_cast<std::uint16_t>(std::lround(std::clamp(place, 0.0f, kMostSteps)));
      const auto moved = static_cast<std::int16_t>(now - before[k]);
      const auto folded = static_cast<std::uint16_t>(2 * moved ^ (moved < 0 ? -1 : 0));
      bytes[k] = static_cast<unsigned char>(folded),
      bytes[numbers + k] = static_cast<unsigned char>(folded >> 8);
      before[k] = now;
    }
    frames.push_back(compressed(bytes));
  }
  return frames;
}

Movie::Written Movie::write(const std::string& title, const System& system, const std::filesystem::path& path,
                            std::uint64_t usual) const {
  if (centers_.empty()) throw Error("there are no frames to show: ask for at least one");
  const std::vector<std::uint32_t> shown = spheres_to_show(system);
  const Box box = box_of(system, shown);
  std::size_t stride = 1;
  std::vector<std::string> frames;
  for (;; stride *= 2) {
    frames = packed(box, shown, stride);
    std::uint64_t bytes = 11 * shown.size();  // of radii and movers
    for (const std::string& f : frames) bytes += f.size() / 3 * 4;
    if (bytes > kMostPageBytes && (usual == 0 || frames.size() <= 2))
      throw Error(std::to_string(frames.size()) + " frames of " + std::to_string(shown.size()) +
                  " spheres are more than a page can hold: ask for fewer frames, or write .npz");
    if (usual == 0 || bytes <= usual || frames.size() <= 2) break;
  }
  std::string text;
  std::vector<double> times;
  for (std::size_t f = 0; f < frames.size(); f++) {
    text += "\"" + base64(frames[f]) + "\",\n";
    times.push_back(times_[(centers_.size() - 1) % stride + f * stride]);
  }
  std::vector<float> radii;
  std::vector<std::uint32_t> movers;
  for (const std::uint32_t k : shown)
    radii.push_back(static_cast<float>(system.radius_of(k))), movers.push_back(system.mover_of(k));
  const nlohmann::json head = {{"title", title},
                               {"unit", system.unit},
                               {"spheres", shown.size()},
                               {"all", system.spheres()},
                               {"bodies", system.bodies.size()},
                               {"low", box.low},
                               {"high", box.high},
                               {"step", box.step},
                               {"times", times}};
  std::string data = head.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = data.find("</", at)) != std::string::npos; at += 3)
    data.replace(at, 2, "<\\/");
  std::string page = kPageTemplate;
  replace(page, "@HEAD@", data);
  replace(page, "@RADII@", base64({reinterpret_cast<const char*>(radii.data()), radii.size() * 4}));
  replace(page, "@MOVERS@", base64({reinterpret_cast<const char*>(movers.data()), movers.size() * 4}));
  replace(page, "@FRAMES@", text);
  write_file(path, page);
  return {frames.size(), shown.size(), page.size()};
}

}  // namespace padder::settle
