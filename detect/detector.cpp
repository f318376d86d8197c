// SPDX-License-Identifier: MIT
#include "detect/detector.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "detect/core/backend.h"
#include "detect/core/revision.h"
#include "padding/asset/error.h"

namespace padder::detect {

std::string number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", v);
  return text;
}

std::uint64_t sphere_count(const Input& input) {
  std::uint64_t n = input.spheres.count;
  for (const Body& b : input.bodies) {
    const std::uint64_t more = input.shapes[b.shape].count;
    n = n > ~std::uint64_t(0) - more ? ~std::uint64_t(0) : n + more;
  }
  return n;
}

Body body_at(const Input& input, std::size_t k) {
  Body body = input.bodies[k];
  if (input.poses) {
    std::copy_n(input.poses[k].rotation, 9, body.rotation);
    std::copy_n(input.poses[k].position, 3, body.position);
  }
  return body;
}

void check_input(const Input& input, bool device_memory_allowed, bool known) {
  const Spheres& s = input.spheres;
  for (std::size_t k = 0; !known && k < input.bodies.size(); k++)
    if (input.bodies[k].shape >= input.shapes.size())
      throw Error("body " + std::to_string(k) + " names shape " + std::to_string(input.bodies[k].shape) +
                  ", but there are " + std::to_string(input.shapes.size()));
  for (std::size_t k = 0; k < input.shapes.size(); k++)
    if (input.shapes[k].count && !input.shapes[k].spheres)
      throw Error("shape " + std::to_string(k) + " has spheres but no pointer to them");
  if (s.count && (!s.centers || !s.radii))
    throw Error("the loose spheres need a pointer to centres and one to radii");
  if (s.center_stride < 3) throw Error("the stride of the centres must be at least 3 numbers");
  if (s.memory == Memory::device && s.count && !device_memory_allowed)
    throw Error(
        "the spheres lie in device memory, which the OpenMP backend cannot read: copy them or choose cuda");
  if (input.poses && input.pose_memory == Memory::device && !device_memory_allowed)
    throw Error(
        "the poses lie in device memory, which the OpenMP backend cannot read: copy them or choose cuda");
  if (input.bodies.size() >= kStatic - 1)
    throw Error(std::to_string(input.bodies.size()) +
                " bodies are more than one detector numbers (2^31 - 2): divide the scene into boxes");
  const std::uint64_t n = known ? 0 : sphere_count(input);
  if (n >= 0xffffffffull)
    throw Error((n == ~std::uint64_t(0) ? "2^64 - 1 or more" : std::to_string(n)) +
                " spheres are more than one detector numbers (2^32 - 2): divide the scene into boxes");
}

void check_options(const Options& o) {
  if (!(o.bin_size >= 0 && o.bin_size <= kLargest))
    throw Error("the bin size must be 0 (chosen) or a positive length up to 1e100, not " +
                number(o.bin_size));
  if (o.threads < 0 || o.threads > kMostThreads)
    throw Error("the number of threads must be 0 (chosen) or 1 to " + std::to_string(kMostThreads) +
                ", not " + std::to_string(o.threads));
  for (int k = 0; k < 3; k++)
    if (std::isnan(o.own.low[k]) || std::isnan(o.own.high[k]))
      throw Error("the box to own (Options::own) is not a number along " + std::string(1, "xyz"[k]) +
                  ": give both its faces, or leave them infinite");
}

void check_range(const Summary& s, const Options& o) {
  if (o.width != Width::pairs && o.scalar == Scalar::f32 && s.extent + s.radius_max > 1e38)
    throw Error("coordinates up to " + number(s.extent) +
                " do not fit a float record: ask for double records or pairs only");
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
  const std::string at = " at (" + number(s.x) + ", " + number(s.y) + ", " + number(s.z) + ")";
  switch (fault_of(s)) {
    case Fault::negative_radius:
      return name + at + " has the negative radius " + number(s.r) + ": radii must be 0 or more";
    case Fault::too_large:
      return name + at + " with radius " + number(s.r) + " is beyond 1e100: scale the scene";
    default:
      return name + at + " with radius " + number(s.r) + " is not finite: correct or remove it";
  }
}

std::string memory_sentence(std::uint64_t bytes, const char* what, const char* where) {
  return std::to_string(bytes) + " bytes of " + where + " memory are needed for " + what +
         " and are not to be had: divide the scene into boxes or ask for a narrower record";
}

Detector::Detector(const Options& options) : options_(options) {
  if (options.backend == BackendKind::cuda ||
      (options.backend == BackendKind::automatic && cuda_absence(options.device).empty()))
    backend_ = make_cuda_backend(options.device);
  else
    backend_ = make_omp_backend();
  revision_ = std::make_unique<RevisionKeeper>();
}
Detector::~Detector() = default;
Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;

Backend& Detector::own_backend() const {
  if (!backend_) throw Error("this detector was moved to another: use that one, or assign a new one");
  return *backend_;
}

// Every call into a backend: one that throws leaves no contacts, and no revision that the next could rely on.
template <class Work>
auto Detector::call(Work work) {
  Backend& backend = own_backend();
  contacts_ = {};
  try {
    check_options(options_);
    return work(backend);
  } catch (...) {
    backend.forget(), revision_->forget();
    throw;
  }
}

const Contacts& Detector::detect(const Input& input) {
  contacts_ = call([&](Backend& backend) {
    const auto read_poses = [&] { return backend.device_poses(input, options_); };
    return backend.detect(revision_->settle(input, read_poses), options_);
  });
  return contacts_;
}

Arrays Detector::stages(const Input& input) {
  if (revision_) revision_->forget();
  Input all = input;
  all.revision = 0;  // reads everything
  return call([&](Backend& backend) { return backend.stages(all, options_); });
}

std::uint64_t Detector::hash() const {
  const Backend& backend = own_backend();
  return contacts_.count > 0 ? backend.hash() : 0;
}
const char* Detector::backend() const { return own_backend().name(); }
std::uint64_t Detector::memory() const { return backend_ ? backend_->memory() : 0; }
bool cuda_present() { return cuda_absence(0).empty(); }

}  // namespace padder::detect
