// SPDX-License-Identifier: MIT
#include "tools/settle/page.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/settle/page_template.h"

namespace padder::settle {
namespace {

constexpr std::uint64_t kMostPageBytes = std::uint64_t(512) << 20;

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

}  // namespace

void Movie::add(const Stepper& stepper) {
  std::vector<float> frame;
  for (const detect::Sphere& s : stepper.placed())
    for (const double v : {s.x, s.y, s.z}) frame.push_back(static_cast<float>(v));
  if ((centers_.size() + 1) * frame.size() * 2 > kMostPageBytes)
    throw Error(std::to_string(centers_.size() + 1) + " frames of " + std::to_string(frame.size() / 3) +
                " spheres are more than a page can hold: ask for fewer frames, or write .npz");
  centers_.push_back(std::move(frame)), times_.push_back(stepper.time());
}

void Movie::write(const std::string& title, const System& system, const std::filesystem::path& path) const {
  if (centers_.empty()) throw Error("there are no frames to show: ask for at least one");
  // Grains that have fallen out of the scene do not widen the box: it is that of the bulk, a third wider.
  float low[3], high[3];
  for (int a = 0; a < 3; a++) {
    std::vector<float> values;
    for (const auto* frame : {&centers_.front(), &centers_.back()})
      for (std::size_t k = static_cast<std::size_t>(a); k < frame->size(); k += 3)
        values.push_back((*frame)[k]);
    std::sort(values.begin(), values.end());
    const std::size_t cut = values.size() / 200;
    low[a] = values[cut], high[a] = values[values.size() - 1 - cut];
    const float more = (high[a] - low[a]) / 3 + 1e-3f;
    low[a] -= more, high[a] += more;
  }
  std::vector<std::uint16_t> packed;
  for (const auto& frame : centers_)
    for (std::size_t k = 0; k < frame.size(); k++) {
      const float part = (frame[k] - low[k % 3]) / (high[k % 3] - low[k % 3]);
      packed.push_back(static_cast<std::uint16_t>(std::lround(65535 * std::clamp(part, 0.0f, 1.0f))));
    }
  std::vector<float> radii;
  std::vector<std::uint32_t> movers;
  for (std::uint64_t k = 0; k < system.spheres(); k++)
    radii.push_back(static_cast<float>(system.radius_of(k))), movers.push_back(system.mover_of(k));
  const nlohmann::json head = {
      {"title", title}, {"unit", system.unit}, {"spheres", radii.size()}, {"bodies", system.bodies.size()},
      {"low", low},     {"high", high},        {"times", times_}};
  std::string data = head.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = data.find("</", at)) != std::string::npos; at += 3)
    data.replace(at, 2, "<\\/");
  std::string page = kPageTemplate;
  replace(page, "@HEAD@", data);
  replace(page, "@FRAMES@", base64(packed.data(), packed.size() * 2));
  replace(page, "@RADII@", base64(radii.data(), radii.size() * 4));
  replace(page, "@MOVERS@", base64(movers.data(), movers.size() * 4));
  write_file(path, page);
}

}  // namespace padder::settle
