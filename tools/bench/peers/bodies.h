// SPDX-License-Identifier: GPL-3.0-or-later
// Programs on the CPU that test bodies of spheres, one configuration after another, beside which the worlds
// of the detector are measured.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "detect/body.h"

namespace padder::bench {

class BodyPeer {
 public:
  virtual ~BodyPeer() = default;
  virtual const char* name() const = 0;
  // The contacts of the bodies with the obstacles, and, if they have no family, with each other.
  // `first_only`: 1 if there is any.
  virtual std::uint64_t contacts(std::span<const detect::Body> bodies, bool first_only) = 0;
};

using SphereList = std::vector<detect::Sphere>;
// shapes: of bodies, which name them by number. Null in a build without the library.
std::unique_ptr<BodyPeer> make_bullet_bodies(const std::vector<SphereList>& shapes,
                                             const SphereList& obstacles);
std::unique_ptr<BodyPeer> make_fcl_bodies(const std::vector<SphereList>& shapes, const SphereList& obstacles);

}  // namespace padder::bench
