// SPDX-License-Identifier: GPL-3.0-or-later
// FCL (Pan, Chitta, Manocha: FCL, a general purpose library for collision and proximity queries, 2012), which
// motion planners use. It has no compound of spheres, so that each sphere is an object of its own: obstacles
// stand in a dynamic tree of boxes that is made once, and each sphere of a body is looked up in it. Bodies
// that meet each other have trees of their own, which are refitted in each configuration.
#include "tools/bench/peers/bodies.h"

#ifdef PADDER_FCL
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>

namespace padder::bench {
namespace {

struct Search {
  std::uint64_t found = 0;
  bool first_only = false;
};
bool test(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) {
  auto& search = *static_cast<Search*>(data);
  fcl::CollisionResultd result;
  fcl::collide(a, b, fcl::CollisionRequestd(1, false), result);
  search.found += result.isCollision();
  return search.first_only && search.found > 0;
}

// Objects stay where they are: the trees hold their addresses.
class Spheres {
 public:
  explicit Spheres(const SphereList& from) : from_(from) {
    for (const detect::Sphere& s : from)
      objects_.push_back(std::make_unique<fcl::CollisionObjectd>(std::make_shared<fcl::Sphered>(s.r)));
    place({});
    for (auto& o : objects_) tree_.registerObject(o.get());
    tree_.setup();
  }
  void place(const detect::Body& body) {
    for (std::size_t k = 0; k < from_.size(); k++) {
      const detect::Sphere s = placed(body, from_[k]);
      objects_[k]->setTranslation({s.x, s.y, s.z});
      objects_[k]->computeAABB();
    }
  }
  void refit() { tree_.update(); }
  void among(const Spheres& others, Search& search) const {
    for (const auto& o : objects_) {
      others.tree_.collide(o.get(), &search, test);
      if (search.first_only && search.found > 0) return;
    }
  }

 private:
  SphereList from_;
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects_;
  fcl::DynamicAABBTreeCollisionManagerd tree_;
};

class FclBodies : public BodyPeer {
 public:
  FclBodies(const std::vector<SphereList>& shapes, const SphereList& obstacles)
      : shapes_(shapes), obstacles_(obstacles) {}
  const char* name() const override { return "FCL"; }
  // Body k of every configuration has the same shape.
  std::uint64_t contacts(std::span<const detect::Body> bodies, bool first_only) override {
    Search search{0, first_only};
    for (std::size_t k = 0; k < bodies.size(); k++) {
      if (k == bodies_.size()) bodies_.push_back(std::make_unique<Spheres>(shapes_[bodies[k].shape]));
      bodies_[k]->place(bodies[k]);
      bodies_[k]->among(obstacles_, search);
      if (bodies[k].family == 0) bodies_[k]->refit();
      for (std::size_t q = 0; bodies[k].family == 0 && q < k; q++) bodies_[k]->among(*bodies_[q], search);
      if (first_only && search.found > 0) return 1;
    }
    return search.found;
  }

 private:
  std::vector<SphereList> shapes_;
  Spheres obstacles_;
  std::vector<std::unique_ptr<Spheres>> bodies_;
};

}  // namespace

std::unique_ptr<BodyPeer> make_fcl_bodies(const std::vector<SphereList>& shapes,
                                          const SphereList& obstacles) {
  return std::make_unique<FclBodies>(shapes, obstacles);
}

}  // namespace padder::bench

#else

namespace padder::bench {

std::unique_ptr<BodyPeer> make_fcl_bodies(const std::vector<SphereList>&, const SphereList&) {
  return nullptr;
}

}  // namespace padder::bench
#endif
