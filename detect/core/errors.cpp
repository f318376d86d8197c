// SPDX-License-Identifier: MIT
#include "detect/core/errors.h"

#include <cmath>
#include <cstdio>

#include "detect/core/input.h"
#include "padding/asset/error.h"

namespace padder::detect {

std::string formatted(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", v);
  return text;
}

void check_enum(const char* name, unsigned value, unsigned last) {
  if (value > last)
    throw Error(std::string(name) + " is " + std::to_string(value) + ", and its values are 0 to " +
                std::to_string(last) + ": use one of their names");
}

BodyTally check_arrays(const Input& input, bool known) {
  const Spheres& s = input.spheres;
  check_enum("Spheres::scalar", s.scalar, Scalar::f64);
  check_enum("Spheres::memory", s.memory, Memory::device);
  check_enum("Input::pose_memory", input.pose_memory, Memory::device);
  BodyTally bodies;
  if (!known) bodies = tally_of(input);
  for (std::size_t k = 0; k < input.shapes.size(); k++)
    if (input.shapes[k].count && !input.shapes[k].spheres)
      throw Error("shape " + std::to_string(k) + " has spheres but no pointer to them");
  if (s.count && (!s.centers || !s.radii))
    throw Error("the loose spheres need a pointer to centres and one to radii");
  if (s.center_stride < 3) throw Error("the stride of the centres must be at least 3 numbers");
  return bodies;
}

BodyTally check_input(const Input& input, bool device_memory_allowed, bool known) {
  const Spheres& s = input.spheres;
  BodyTally bodies = check_arrays(input, known);
  if (s.memory == Memory::device && s.count && !device_memory_allowed)
    throw Error(
        "the spheres lie in device memory, which the OpenMP backend cannot read: copy them or choose cuda");
  if (input.poses && input.pose_memory == Memory::device && !device_memory_allowed)
    throw Error(
        "the poses lie in device memory, which the OpenMP backend cannot read: copy them or choose cuda");
  if (input.bodies.size() >= kStatic - 1)
    throw Error(std::to_string(input.bodies.size()) +
                " bodies are more than one detector can number (2^31 - 2): divide the scene into boxes");
  const std::uint64_t n = known ? 0 : sphere_count(bodies, loose_count(input));
  if (n >= 0xffffffffull)
    throw Error((n == ~std::uint64_t(0) ? "2^64 - 1 or more" : std::to_string(n)) +
                " spheres are more than one detector can number (2^32 - 2): divide the scene into boxes");
  return bodies;
}

void check_options(const CallOptions& o) {
  check_enum("CallOptions::path", o.path, Path::nine_stages);
  check_enum("CallOptions::precision", o.precision, Precision::float32);
  check_enum("CallOptions::order", o.order, Order::any);
  check_enum("CallOptions::width", o.width, Width::points);
  check_enum("CallOptions::scalar", o.scalar, Scalar::f64);
  check_enum("CallOptions::output", o.output, Memory::device);
  check_enum("CallOptions::bodies", o.bodies, Bodies::expanded);
  if (!(o.bin_size >= 0 && o.bin_size <= kLargest))
    throw Error("the bin size must be 0 (chosen) or a positive length up to 1e100, not " +
                formatted(o.bin_size));
  if (o.threads < 0 || o.threads > kMostThreads)
    throw Error("the number of threads must be 0 (chosen) or 1 to " + std::to_string(kMostThreads) +
                ", not " + std::to_string(o.threads));
  if (!(o.margin >= 0 && o.margin <= kLargest))
    throw Error("the margin must be a length from 0 to 1e100, not " + formatted(o.margin));
  for (int k = 0; k < 3; k++)
    if (std::isnan(o.own.low[k]) || std::isnan(o.own.high[k]))
      throw Error("the box to own (CallOptions::own) is not a number along " + std::string(1, "xyz"[k]) +
                  ": give both its faces, or leave them infinite");
}

void check_boxed_options(const CallOptions& o) {
  if (o.history)
    throw Error(
        "the contacts of several boxes have no history (CallOptions::history): match the lists yourself, or "
        "use one Detector");
}

void check_boxed_input(const Input& input) {
  check_arrays(input);
  if ((input.spheres.count && input.spheres.memory == Memory::device) ||
      (input.poses && input.pose_memory == Memory::device))
    throw Error(
        "detection by boxes reads spheres and poses from host memory: copy them, or use one Detector");
}

void check_range(const Summary& s, const CallOptions& o) {
  if (o.width != Width::pairs && o.scalar == Scalar::f32 && s.extent + s.radius_max > 1e38)
    throw Error("coordinates up to " + formatted(s.extent) +
                " do not fit a float record: ask for double records or pairs only");
}

std::string fault_sentence(const std::string& name, const Sphere& s) {
  const std::string at =
      name + " at (" + formatted(s.x) + ", " + formatted(s.y) + ", " + formatted(s.z) + ")";
  switch (fault_of(s)) {
    case Fault::negative_radius:
      return at + " has the negative radius " + formatted(s.r) + ": radii must be 0 or more";
    case Fault::too_large:
      return at + " with radius " + formatted(s.r) + " is beyond 1e100: scale the scene";
    default:
      return at + " with radius " + formatted(s.r) + " is not finite: correct or remove it";
  }
}

std::string fault_sentence(std::uint64_t index, const Sphere& s, const Input& input) {
  std::string name = "sphere " + std::to_string(index);
  std::uint64_t before = 0;
  for (std::size_t k = 0; k < input.bodies.size(); k++) {
    const std::uint64_t n = input.shapes[input.bodies[k].shape].count;
    if (index < before + n) {
      name += " (number " + std::to_string(index - before) + " of body " + std::to_string(k) + ")";
      break;
    }
    before += n;
  }
  return fault_sentence(name, s);
}

std::string world_sentence(bool loose, std::uint64_t index, std::uint32_t world, std::uint32_t worlds) {
  return (loose ? "loose sphere " : "body ") + std::to_string(index) + " is in world " +
         std::to_string(world) + ", but answers are asked for " +
         (worlds == 0 ? "no world" : "worlds 0 to " + std::to_string(worlds - 1)) + ": ask for more worlds";
}

MemoryError::MemoryError(std::uint64_t bytes, const char* what, const char* where, std::uint64_t limit)
    : Error(std::to_string(bytes) + " bytes of " + where + " memory are needed for " + what +
            // The host's arrays are rounded up to 64 bytes.
            (limit > 0 && (bytes + 63) / 64 * 64 > limit
                 ? ", but CallOptions::memory_limit is " + std::to_string(limit) + ": raise it, "
                 : ", but are not available: ") +
            // Of the nine stages: an entry for each bin that a sphere touches.
            (std::string_view(what).ends_with("array B")
                 ? "choose larger bins (--bin-size) or the fast path"
                 : "divide the scene into boxes or ask for a narrower record")) {}

}  // namespace padder::detect
