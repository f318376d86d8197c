// SPDX-License-Identifier: MIT
// Where the device reads spheres from: the caller's arrays, and bodies placed on the fly. Only .cu files
// include this.
#pragma once
#include "detect/body.h"
#include "detect/core/grid.h"
#include "detect/core/side_by_side.h"
#include "detect/filter.h"

namespace padder::detect::cuda {

// The sentence for a sphere outside bins that were made to hold all spheres.
inline constexpr const char* kChanged =
    "a sphere lies outside the bounds that were found a moment before: do not change the input while "
    "detect() "
    "runs";

// Device pointers. Sphere k belongs to a body if k < placed; else it is loose sphere k - placed.
struct DeviceSpheres {
  const void* centers = nullptr;
  const void* radii = nullptr;
  const std::uint32_t* family = nullptr;
  const std::uint32_t* mask = nullptr;
  const std::uint32_t* owner = nullptr;     // Filter::owner of each loose sphere; null: 0
  const std::uint8_t* is_static = nullptr;  // of loose spheres
  const Body* bodies = nullptr;
  const std::uint32_t* body_of = nullptr;      // of each placed sphere
  const std::uint32_t* body_first = nullptr;   // its first sphere's number
  const Sphere* shape_spheres = nullptr;       // of all shapes, one after another
  const std::uint32_t* shape_first = nullptr;  // of each shape
  // Of loose spheres; null: `world_of_all`. Where worlds lie apart: of all spheres, those of bodies too.
  const std::uint32_t* world = nullptr;
  std::uint32_t world_of_all = 0;
  // Of the loose spheres, `own` from number `before` on lie in the arrays above. The others came from other
  // GPUs and lie here, in the order of their numbers: x, y, z, r together, aligned to 16 bytes.
  struct Around {
    const void* spheres = nullptr;
    const std::uint32_t *family = nullptr, *mask = nullptr, *world = nullptr;
    const std::uint8_t* is_static = nullptr;
    friend bool operator==(const Around&, const Around&) = default;
  } around;
  std::uint32_t before = 0, own = ~0u;
  std::uint32_t count = 0, placed = 0, center_stride = 3, radius_stride = 1;
  bool wide = false;    // double input
  bool packed = false;  // x, y, z, r lie together, aligned to 16 bytes: a float sphere is one load
  // Doubles count as rounded to float. A radius below zero becomes no number, since it might round to zero.
  bool rounded = false;
  // Those count relative to here: floats are fine near the scene, wherever it lies.
  double origin[3] = {0, 0, 0};
  // Their radius; 0: they have several. Another one becomes no number.
  double radius_of_all = 0;
  bool filtered = false;
  // Of many worlds: spheres that are searched lie side by side, and count as rounded.
  bool worlds_apart = false;
  SideBySide side_by_side;
  friend bool operator==(const DeviceSpheres&, const DeviceSpheres&) = default;

  // Are all numbers of searched() floats?
  bool searched_as_floats() const { return worlds_apart || (placed == 0 && (rounded || !wide)); }

  // AsGiven: not rounded.
  template <bool AsGiven = false>
  __device__ __forceinline__ Sphere sphere(std::uint32_t k) const {
    if (k < placed) {
      const std::uint32_t b = body_of[k];
      const Body& body = bodies[b];
      return detect::placed(body, shape_spheres[shape_first[body.shape] + (k - body_first[b])]);
    }
    k -= placed;
    const bool here = is_own(k);
    if ((packed || !here) && !wide) {
      const float4 s = *float_sphere(k);
      return {s.x, s.y, s.z, s.w};
    }
    const std::uint32_t at = here ? k - before : in_around(k);
    if (packed || !here) {
      const auto* const p =
          static_cast<const double2*>(here ? centers : around.spheres) + 2 * std::uint64_t(at);
      const double2 xy = __ldg(p), zr = __ldg(p + 1);
      return seen<AsGiven>({xy.x, xy.y, zr.x, zr.y});
    }
    const std::uint64_t c = std::uint64_t(at) * center_stride, r = std::uint64_t(at) * radius_stride;
    if (wide) {
      const auto* p = static_cast<const double*>(centers) + c;
      return seen<AsGiven>({p[0], p[1], p[2], static_cast<const double*>(radii)[r]});
    }
    const auto* p = static_cast<const float*>(centers) + c;
    return {p[0], p[1], p[2], static_cast<const float*>(radii)[r]};
  }
  // The double sphere k, where none is placed. Where `radius_of_all` stands, its radius is not fetched.
  __device__ __forceinline__ Sphere given_sphere(std::uint32_t k) const {
    if (packed || radius_of_all == 0 || !is_own(k)) return sphere<true>(k);
    const auto* p = static_cast<const double*>(centers) + std::uint64_t(k - before) * center_stride;
    return {__ldg(p), __ldg(p + 1), __ldg(p + 2), radius_of_all};
  }
  // Of loose sphere k.
  __device__ __forceinline__ bool is_own(std::uint32_t k) const { return k - before < own; }
  __device__ __forceinline__ std::uint32_t in_around(std::uint32_t k) const {
    return k < before ? k : k - own;
  }
  // Where loose sphere k lies, if all are packed floats.
  __device__ __forceinline__ const float4* float_sphere(std::uint32_t k) const {
    const std::uint32_t at = k - before;
    return at < own ? static_cast<const float4*>(centers) + at
                    : static_cast<const float4*>(around.spheres) + in_around(k);
  }
  // Where loose sphere `first` and the `count` - 1 after it lie one behind the other, if all are packed
  // floats of the arrays above and no sphere is placed; else null. For a block that asks once for all its
  // spheres: to ask for each takes large scenes 2 % longer.
  __device__ __forceinline__ const float4* float_run(std::uint32_t first, std::uint32_t count) const {
    const bool run = packed && !wide && placed == 0 && first >= before && first - before + count <= own;
    return run ? static_cast<const float4*>(centers) + (first - before) : nullptr;
  }
  // Where it is searched. (Not in sphere(): it would make the narrow phase of bodies a tenth slower.)
  __device__ __forceinline__ Sphere searched(std::uint32_t k) const {
    return worlds_apart ? rounded_sphere(side_by_side.moved(sphere<true>(k), world[k])) : sphere(k);
  }
  template <bool AsGiven>
  __device__ __forceinline__ Sphere seen(const Sphere& s) const {
    return AsGiven || !rounded ? s : rounded_sphere(s);
  }
  __device__ __forceinline__ Sphere rounded_sphere(const Sphere& s) const {
    const bool other = s.r < 0 || (radius_of_all > 0 && s.r != radius_of_all);
    return {static_cast<float>(s.x - origin[0]), static_cast<float>(s.y - origin[1]),
            static_cast<float>(s.z - origin[2]), other ? NAN : static_cast<float>(s.r)};
  }
  __device__ __forceinline__ std::uint32_t world_of(std::uint32_t k) const {
    if (k < placed) return bodies[body_of[k]].world;
    k -= placed;
    if (!is_own(k)) return around.world ? around.world[in_around(k)] : world_of_all;
    return world ? world[k - before] : world_of_all;
  }
  __device__ __forceinline__ Filter filter(std::uint32_t k) const {
    if (k < placed) {
      const Body& body = bodies[body_of[k]];
      return {body.family, body.mask, owner_of(body_of[k], body.is_static)};
    }
    k -= placed;
    if (!is_own(k)) {
      k = in_around(k);
      return {around.family ? around.family[k] : 0, around.mask ? around.mask[k] : 0,
              around.is_static && around.is_static[k] ? kStatic : 0};
    }
    k -= before;
    return {family ? family[k] : 0, mask ? mask[k] : 0,
            owner                       ? owner[k]
            : is_static && is_static[k] ? kStatic
                                        : 0};
  }
};

}  // namespace padder::detect::cuda
