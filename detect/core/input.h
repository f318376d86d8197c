// SPDX-License-Identifier: MIT
// What every backend asks of an Input. Internal; host code.
#pragma once
#include <cstring>
#include <functional>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Loose spheres on one GPU that lie apart from Input::spheres, since they came from other GPUs: x, y, z, r of
// each lie together. The first `before` are numbered before those of Input::spheres, the rest behind.
struct SpheresAround {
  Spheres spheres;
  std::uint64_t before = 0;
};

// The poses of bodies that follow one another, on the GPU where they lie.
struct PosePart {
  const double* poses = nullptr;       // of each body twelve doubles, `step` doubles behind those before
  std::uint32_t first = 0, count = 0;  // bodies
  std::uint32_t step = sizeof(Pose) / sizeof(double);
  friend bool operator==(const PosePart&, const PosePart&) = default;
};
inline constexpr std::size_t kMostPoseParts = 64;
// Elements that one GPU found for another (Assembly), on the GPU that found them.
struct ListedElements {
  const std::uint32_t* numbers = nullptr;
  std::uint32_t count = 0;
};
// Poses of all bodies that lie on several GPUs, each of which can read those of the others. Each GPU finds
// which elements of its part each box needs.
struct PosesAround {
  std::vector<PosePart> parts;  // of each GPU; at most kMostPoseParts
  std::size_t own = 0;          // that on the GPU which reads this
  std::vector<Region> boxes;    // of each GPU
  double largest_radius = 0;    // of all loose spheres, on any GPU
  // Gives each GPU the elements of the own part that its box needs, and returns those of each part that the
  // own box needs. Waits until every GPU has called it, or has failed. Lists stand until all calls have
  // ended.
  std::function<std::vector<ListedElements>(std::vector<ListedElements>)> exchange;
};
// Do poses lie in the memory of GPUs?
inline bool has_device_poses(const Input& input) {
  return input.poses_around || (input.poses && input.pose_memory == Memory::device);
}

inline std::uint64_t loose_count(const Input& input) {
  return input.spheres.count + (input.around ? input.around->spheres.count : 0);
}
// Are there marks of static loose spheres?
inline bool marks_static(const Input& input) {
  return input.spheres.is_static || (input.around && input.around->spheres.is_static);
}

// What one pass over the bodies tells. All of it stays within a revision.
struct BodyTally {
  std::uint64_t spheres = 0;          // of all bodies; 2^64 - 1 if they are more than that
  std::uint64_t moving = 0;           // bodies that are not static
  bool have_worlds = false;           // some body is not in world 0
  std::uint32_t world = kEveryWorld;  // of the first body that is in one world only
  bool apart = false;                 // some body is in another world than that
  // Of each shape: how many bodies have it, and how many of these move.
  std::vector<std::uint64_t> of_shape, moving_of_shape;
};
// Throws Error for a body that names no shape.
BodyTally tally_of(const Input& input);

// Spheres of all bodies and the loose ones; 2^64 - 1 if they are more than that.
std::uint64_t sphere_count(const BodyTally& bodies, std::uint64_t loose);
inline std::uint64_t sphere_count(const Input& input) {
  return sphere_count(tally_of(input), loose_count(input));
}
// Body k at its pose, which must lie in host memory.
Body body_at(const Input& input, std::size_t k);
// The numbers of loose sphere k as they were given, in host memory. Copied byte by byte: an array inside a
// mapped file may begin at any address.
template <class T>
struct Given {
  T x, y, z, r;
  Sphere sphere() const { return {x, y, z, r}; }
};
template <class T>
Given<T> given(const Spheres& s, std::uint64_t k) {
  Given<T> g;
  std::memcpy(&g, static_cast<const char*>(s.centers) + k * s.center_stride * sizeof(T), 3 * sizeof(T));
  std::memcpy(&g.r, static_cast<const char*>(s.radii) + k * s.radius_stride * sizeof(T), sizeof(T));
  return g;
}
inline Sphere loose_at(const Spheres& s, std::uint64_t k) {
  return s.scalar == Scalar::f32 ? given<float>(s, k).sphere() : given<double>(s, k).sphere();
}
// What decides with which others loose sphere k may be in contact. In host memory.
inline Filter filter_at(const Spheres& s, std::uint64_t k) {
  return {s.family ? s.family[k] : 0, s.mask ? s.mask[k] : 0, s.is_static && s.is_static[k] ? kStatic : 0};
}
// The same of the spheres of body k.
inline Filter filter_of(const Body& body, std::uint32_t k) {
  return {body.family, body.mask, owner_of(k, body.is_static)};
}

// Do worlds keep anything apart: are there two besides kEveryWorld? True of an array on a device, unread.
bool has_worlds(const BodyTally& bodies, const Input& input);

}  // namespace padder::detect
