// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/peers/bullet.h"

#include <algorithm>

#include "padding/asset/error.h"
#include "tools/bench/peers/bodies.h"

#ifdef PADDER_BULLET
#include <btBulletCollisionCommon.h>

namespace padder::bench {

bool have_bullet() { return true; }

struct BulletWorld::Parts {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btCollisionWorld world{&dispatcher, &broadphase, &configuration};
  std::vector<std::unique_ptr<btSphereShape>> shapes;
  std::vector<btCollisionObject> objects;
};

BulletWorld::BulletWorld(const std::vector<detect::FloatSphere>& spheres)
    : parts_(std::make_unique<Parts>()) {
  static_assert(sizeof(btScalar) == sizeof(double), "the oracle is Bullet in double precision");
  parts_->objects = std::vector<btCollisionObject>(spheres.size());
  parts_->shapes.reserve(spheres.size());
  for (std::size_t k = 0; k < spheres.size(); k++) {
    btCollisionObject& o = parts_->objects[k];
    parts_->shapes.push_back(std::make_unique<btSphereShape>(spheres[k].r));
    o.setCollisionShape(parts_->shapes.back().get());
    o.setCollisionFlags(0);  // by default an object is static, and static pairs are left out
    o.getWorldTransform().setIdentity();
    o.getWorldTransform().setOrigin(btVector3(spheres[k].x, spheres[k].y, spheres[k].z));
    o.setUserIndex(static_cast<int>(k));
    parts_->world.addCollisionObject(&o);
  }
}

// Removing a million objects one by one takes minutes. So each pair first frees its algorithm and manifold
// (those outside Bullet's pools would leak otherwise), and then the trees are deleted as a whole.
BulletWorld::~BulletWorld() {
  btOverlappingPairCache* cache = parts_->broadphase.getOverlappingPairCache();
  btBroadphasePairArray& pairs = cache->getOverlappingPairArray();
  for (int k = 0; k < pairs.size(); k++) cache->cleanOverlappingPair(pairs[k], &parts_->dispatcher);
  parts_->world.getCollisionObjectArray().clear();
}

void BulletWorld::step() { parts_->world.performDiscreteCollisionDetection(); }

std::uint64_t BulletWorld::count() const {
  std::uint64_t n = 0;
  const int manifolds = parts_->dispatcher.getNumManifolds();
  for (int k = 0; k < manifolds; k++)
    n += parts_->dispatcher.getManifoldByIndexInternal(k)->getNumContacts() > 0;
  return n;
}

std::vector<BulletContact> BulletWorld::contacts() const {
  std::vector<BulletContact> found;
  const int manifolds = parts_->dispatcher.getNumManifolds();
  for (int k = 0; k < manifolds; k++) {
    const btPersistentManifold* m = parts_->dispatcher.getManifoldByIndexInternal(k);
    if (m->getNumContacts() == 0) continue;
    const btManifoldPoint& p = m->getContactPoint(0);
    const auto a = static_cast<std::uint32_t>(m->getBody0()->getUserIndex()),
               b = static_cast<std::uint32_t>(m->getBody1()->getUserIndex());
    const bool ordered = a < b;
    BulletContact c{ordered ? a : b, ordered ? b : a, {}, -p.getDistance(), {}, {}};
    // Bullet's normal points from B to A.
    const btVector3 normal = ordered ? -p.m_normalWorldOnB : p.m_normalWorldOnB;
    const btVector3& i = ordered ? p.getPositionWorldOnA() : p.getPositionWorldOnB();
    const btVector3& j = ordered ? p.getPositionWorldOnB() : p.getPositionWorldOnA();
    for (int axis = 0; axis < 3; axis++)
      c.normal[axis] = normal[axis], c.on_i[axis] = i[axis], c.on_j[axis] = j[axis];
    found.push_back(c);
  }
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; });
  return found;
}

namespace {

struct Counter : btCollisionWorld::ContactResultCallback {
  std::uint64_t found = 0;
  btScalar addSingleResult(btManifoldPoint& p, const btCollisionObjectWrapper*, int, int,
                           const btCollisionObjectWrapper*, int, int) override {
    found += p.getDistance() <= 0;
    return 0;
  }
};

// Bodies, and all obstacles together, are compounds of spheres. Two bodies at a time are placed.
class BulletBodies : public BodyPeer {
 public:
  BulletBodies(const std::vector<SphereList>& shapes, const SphereList& obstacles) {
    for (const auto& s : shapes) shapes_.push_back(compound_of(s));
    obstacles_ = compound_of(obstacles);
    all_obstacles_.setCollisionShape(obstacles_.get());
    all_obstacles_.setWorldTransform(btTransform::getIdentity());
  }
  const char* name() const override { return "Bullet"; }
  std::uint64_t contacts(std::span<const detect::Body> bodies, bool first_only) override {
    Counter counter;
    for (std::size_t k = 0; k < bodies.size(); k++) {
      place(0, bodies[k]);
      if (obstacles_->getNumChildShapes() > 0) world_.contactPairTest(&body_[0], &all_obstacles_, counter);
      for (std::size_t q = k + 1; bodies[k].family == 0 && q < bodies.size(); q++) {
        place(1, bodies[q]);
        world_.contactPairTest(&body_[0], &body_[1], counter);
      }
      if (first_only && counter.found > 0) return 1;
    }
    return counter.found;
  }

 private:
  std::unique_ptr<btCompoundShape> compound_of(const SphereList& from) {
    auto compound = std::make_unique<btCompoundShape>(true, static_cast<int>(from.size()));
    for (const detect::Sphere& s : from) {
      spheres_.push_back(std::make_unique<btSphereShape>(s.r));
      btTransform at = btTransform::getIdentity();
      at.setOrigin(btVector3(s.x, s.y, s.z));
      compound->addChildShape(at, spheres_.back().get());
    }
    return compound;
  }
  void place(int which, const detect::Body& b) {
    const double *r = b.rotation, *p = b.position;
    body_[which].setCollisionShape(shapes_[b.shape].get());
    const btMatrix3x3 rotation(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]);
    body_[which].setWorldTransform(btTransform(rotation, btVector3(p[0], p[1], p[2])));
  }

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btCollisionWorld world_{&dispatcher_, &broadphase_, &configuration_};
  std::vector<std::unique_ptr<btSphereShape>> spheres_;
  std::vector<std::unique_ptr<btCompoundShape>> shapes_;
  std::unique_ptr<btCompoundShape> obstacles_;
  btCollisionObject body_[2], all_obstacles_;
};

}  // namespace

std::unique_ptr<BodyPeer> make_bullet_bodies(const std::vector<SphereList>& shapes,
                                             const SphereList& obstacles) {
  return std::make_unique<BulletBodies>(shapes, obstacles);
}

}  // namespace padder::bench

#else

namespace padder::bench {

struct BulletWorld::Parts {};
bool have_bullet() { return false; }
BulletWorld::BulletWorld(const std::vector<detect::FloatSphere>&) {
  throw Error(
      "this bench compares with Bullet, which was not found when padder was built (Debian: libbullet-dev)");
}
BulletWorld::~BulletWorld() = default;
void BulletWorld::step() {}
std::uint64_t BulletWorld::count() const { return 0; }
std::vector<BulletContact> BulletWorld::contacts() const { return {}; }
std::unique_ptr<BodyPeer> make_bullet_bodies(const std::vector<SphereList>&, const SphereList&) {
  return nullptr;
}

}  // namespace padder::bench
#endif
