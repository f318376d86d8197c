// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/bullet.h"

#include <algorithm>

#include "padding/asset/error.h"

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

}  // namespace padder::bench
#endif
