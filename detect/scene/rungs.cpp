// SPDX-License-Identifier: MIT
#include "detect/scene/rungs.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "detect/core/input.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

using Rungs = std::span<const Rung>;
constexpr double kNothing = std::numeric_limits<double>::infinity();

// A ball around all rungs of a shape.
Sphere ball_around_all(Rungs rungs) {
  std::vector<Sphere> all;
  for (const Rung& r : rungs) all.insert(all.end(), r.spheres.begin(), r.spheres.end());
  return ball_around(all);
}

double size_of(Rungs rungs) {
  double size = 0;
  for (const Sphere& s : rungs[0].spheres) size = std::max(size, s.r);
  return size;
}

std::uint32_t rung_for(Rungs rungs, const RungRule& rule, double smallest) {
  const auto last = static_cast<std::uint32_t>(rungs.size() - 1);
  if (rule.kind == RungRule::Kind::numbered) return std::min(rule.number, last);
  for (std::uint32_t k = last; k > 0; k--) {
    const double error = error_between(rungs[0], rungs[k]);
    if (std::isfinite(error) && error <= rule.share * smallest) return k;
  }
  return 0;
}

// `smallest_near(b)`: the size of the smallest thing that can touch body b; infinity: nothing can.
template <class Smallest>
RungChoice rungs_chosen(std::span<const Rungs> shapes, std::span<const Body> bodies, const RungRule& rule,
                        bool leave_out, Smallest smallest_near) {
  RungChoice out;
  out.rungs.resize(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); b++) {
    const Rungs rungs = shapes[bodies[b].shape];
    out.finest += rungs[0].spheres.size();
    const double smallest = smallest_near(b);
    if (leave_out && smallest == kNothing) {
      out.rungs[b] = kLeftOut, out.left_out++, out.out_of_reach += rungs[0].spheres.size();
      continue;
    }
    const std::uint32_t rung = out.rungs[b] = rung_for(rungs, rule, smallest);
    out.fewer += rule.kind == RungRule::Kind::numbered && rule.number >= rungs.size();
    out.taken += rungs[rung].spheres.size();
    if (rung > 0) out.error = std::max(out.error, error_between(rungs[0], rungs[rung]));
  }
  return out;
}

// Of each body the size of its smallest partner.
std::vector<double> smallest_partners(std::span<const Rungs> shapes, std::span<const Body> bodies,
                                      const Spheres& loose, double margin, const DeviceChoice& device) {
  std::vector<Sphere> balls;
  std::vector<double> sizes;
  for (const Rungs rungs : shapes) balls.push_back(ball_around_all(rungs)), sizes.push_back(size_of(rungs));
  // A hair larger, for the rounding of what is placed: it grows with the distance from the origin.
  std::vector<double> farthest(shapes.size(), 0);
  for (const Body& b : bodies)
    for (const double p : b.position) farthest[b.shape] = std::max(farthest[b.shape], std::abs(p));
  for (std::size_t k = 0; k < balls.size(); k++) balls[k].r += 1e-9 * balls[k].r + 0x1p-46 * farthest[k];
  std::vector<Shape> ball_shapes;
  for (const Sphere& ball : balls) ball_shapes.push_back({&ball, 1});
  CallOptions options;
  options.margin = margin, options.width = Width::pairs, options.order = Order::any;
  Detector detector(device, options);
  Input input;
  input.shapes = ball_shapes, input.bodies = bodies, input.spheres = loose;
  const auto size = [&](std::uint32_t k) {
    return k < bodies.size() ? sizes[bodies[k].shape] : loose_at(loose, k - bodies.size()).r;
  };
  std::vector<double> smallest(bodies.size(), kNothing);
  for (const Pair& p : detector.detect(input).pair_span()) {
    if (p.i < bodies.size()) smallest[p.i] = std::min(smallest[p.i], size(p.j));
    if (p.j < bodies.size()) smallest[p.j] = std::min(smallest[p.j], size(p.i));
  }
  return smallest;
}

}  // namespace

Sphere ball_around(std::span<const Sphere> spheres) {
  if (spheres.empty()) return {};
  double low[3] = {kNothing, kNothing, kNothing}, high[3] = {-kNothing, -kNothing, -kNothing};
  for (const Sphere& s : spheres) {
    const double c[3] = {s.x, s.y, s.z};
    for (int k = 0; k < 3; k++)
      low[k] = std::min(low[k], c[k] - s.r), high[k] = std::max(high[k], c[k] + s.r);
  }
  Sphere ball{(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2, 0};
  for (const Sphere& s : spheres)
    ball.r = std::max(ball.r, std::hypot(s.x - ball.x, s.y - ball.y, s.z - ball.z) + s.r);
  return ball;
}

double error_between(const Rung& finest, const Rung& coarse) {
  return std::max(finest.protrusion + coarse.gap, coarse.protrusion + finest.gap);
}

RungRule rung_rule(const std::string& text) {
  if (text == "auto") return {RungRule::Kind::chosen};
  RungRule rule;
  const char* const end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, rule.number);
  if (error != std::errc() || read != end || rule.number == kLeftOut)
    throw Error("a level of detail is auto or a whole number (0 is the finest), not \"" + text + "\"");
  return rule;
}

RungChoice choose_rungs(std::span<const Rungs> shapes, std::span<const Body> bodies, const Spheres& loose,
                        const RungRule& rule, double margin, const DeviceChoice& device) {
  const bool chosen = rule.kind == RungRule::Kind::chosen;
  const std::vector<double> smallest = chosen ? smallest_partners(shapes, bodies, loose, margin, device)
                                              : std::vector<double>(bodies.size(), 0);
  return rungs_chosen(shapes, bodies, rule, chosen, [&](std::size_t b) { return smallest[b]; });
}

RungChoice choose_rungs_anywhere(std::span<const Rungs> shapes, std::span<const Body> bodies, double smallest,
                                 const RungRule& rule) {
  double first = kNothing, second = kNothing;  // the smallest two bodies: each may be the other's partner
  for (const Body& b : bodies) {
    const double size = size_of(shapes[b.shape]);
    second = std::min(second, std::max(first, size)), first = std::min(first, size);
  }
  return rungs_chosen(shapes, bodies, rule, false, [&](std::size_t b) {
    return std::min(smallest, size_of(shapes[bodies[b].shape]) == first ? second : first);
  });
}

std::vector<TakenShape> take_rungs(std::span<Body> bodies, const RungChoice& choice, std::uint32_t first) {
  std::vector<TakenShape> taken;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> known;
  for (std::size_t b = 0; b < bodies.size(); b++) {
    if (choice.rungs[b] == 0) continue;
    const TakenShape wanted{bodies[b].shape, choice.rungs[b]};
    const auto next = static_cast<std::uint32_t>(first + taken.size());
    const auto [found, is_new] = known.try_emplace({wanted.of, wanted.rung}, next);
    if (is_new) taken.push_back(wanted);
    bodies[b].shape = found->second;
  }
  return taken;
}

}  // namespace padder::detect
