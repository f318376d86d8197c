// SPDX-License-Identifier: MIT
#include "tools/settle/page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/settle/page_template.h"

namespace padder::settle {
namespace {

constexpr std::uint64_t kMostPageBytes = std::uint64_t(512) << 20;
constexpr std::uint64_t kAllShown = 50000;  // spheres of a scene of which nothing is left out
constexpr double kLarge = 3;                // times the mean radius
constexpr std::size_t kManySpheres = 8;     // of a body

std::string base64(const void* data, std::size_t bytes) {
  static constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* p = static_cast<const unsigned char*>(data);
  std::string out;
  out.reserve((bytes + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes; k += 3) {
    const std::uint32_t three = std::uint32_t(p[k]) << 16 |
                                (k + 1 < bytes ? std::uint32_t(p[k + 1]) << 8 : 0) |
                                (k + 2 < bytes ? p[k + 2] : 0);
    for (int c = 0; c < 4; c++)
      out += k + static_cast<std::size_t>(c) > bytes ? '=' : letters[three >> (18 - 6 * c) & 63];
  }
  return out;
}

void replace(std::string& text, const std::string& mark, const std::string& by) {
  text.replace(text.find(mark), mark.size(), by);
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

Movie::Written Movie::write(const std::string& title, const System& system,
                            const std::filesystem::path& path) const {
  if (centers_.empty()) throw Error("there are no frames to show: ask for at least one");
  const std::vector<std::uint32_t> shown = spheres_to_show(system);
  if (centers_.size() * shown.size() * 6 > kMostPageBytes)
    throw Error(std::to_string(centers_.size()) + " frames of " + std::to_string(shown.size()) +
                " spheres are more than a page can hold: ask for fewer frames, or write .npz");
  // Grains that have fallen out of the scene do not widen the box: it is that of the bulk and of what is
  // large, a third wider.
  const double large_radius = kLarge * mean_radius(system);
  float low[3], high[3];
  for (int a = 0; a < 3; a++) {
    std::vector<float> values;
    for (const auto* frame : {&centers_.front(), &centers_.back()})
      for (std::size_t k = static_cast<std::size_t>(a); k < frame->size(); k += 3)
        values.push_back((*frame)[k]);
    std::sort(values.begin(), values.end());
    const std::size_t cut = values.size() / 200;
    low[a] = values[cut], high[a] = values[values.size() - 1 - cut];
    for (const std::uint32_t k : shown)
      for (const auto* frame : {&centers_.front(), &centers_.back()})
        if (const float at = (*frame)[3 * k + static_cast<std::size_t>(a)];
            system.radius_of(k) > large_radius)
          low[a] = std::min(low[a], at), high[a] = std::max(high[a], at);
    const float more = (high[a] - low[a]) / 3 + 1e-3f;
    low[a] -= more, high[a] += more;
  }
  std::string frames;
  std::vector<std::uint16_t> packed(3 * shown.size());
  for (const std::vector<float>& frame : centers_) {
    for (std::size_t k = 0; k < packed.size(); k++) {
      const float part = (frame[3 * shown[k / 3] + k % 3] - low[k % 3]) / (high[k % 3] - low[k % 3]);
      packed[k] = static_cast<std::uint16_t>(std::lround(65535 * std::clamp(part, 0.0f, 1.0f)));
    }
    frames += "\"" + base64(packed.data(), packed.size() * 2) + "\",\n";
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
                               {"low", low},
                               {"high", high},
                               {"times", times_}};
  std::string data = head.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = data.find("</", at)) != std::string::npos; at += 3)
    data.replace(at, 2, "<\\/");
  std::string page = kPageTemplate;
  replace(page, "@HEAD@", data);
  replace(page, "@RADII@", base64(radii.data(), radii.size() * 4));
  replace(page, "@MOVERS@", base64(movers.data(), movers.size() * 4));
  replace(page, "@FRAMES@", frames);
  write_file(path, page);
  return {shown.size(), page.size()};
}

}  // namespace padder::settle
