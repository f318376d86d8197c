// SPDX-License-Identifier: GPL-3.0-or-later
// openusd_check FILE.usda FILE.xml: the USD that pad wrote, read by OpenUSD, against the MJCF of the same
// body or robot, read by MuJoCo. Every prim, schema and property must be known to OpenUSD. Spheres, masses,
// moments, joints and the pairs that may not touch must be the same with all joints at 0. Leaves with 1 and a
// sentence where they are not.
#include <mujoco/mujoco.h>
#include <pxr/base/tf/errorMark.h>
#include <pxr/base/tf/stringUtils.h>
#include <pxr/usd/usd/primDefinition.h>
#include <pxr/usd/usd/primRange.h>
#include <pxr/usd/usd/schemaRegistry.h>
#include <pxr/usd/usdGeom/metrics.h>
#include <pxr/usd/usdGeom/sphere.h>
#include <pxr/usd/usdGeom/xformCache.h>
#include <pxr/usd/usdPhysics/filteredPairsAPI.h>
#include <pxr/usd/usdPhysics/massAPI.h>
#include <pxr/usd/usdPhysics/metrics.h>
#include <pxr/usd/usdPhysics/prismaticJoint.h>
#include <pxr/usd/usdPhysics/revoluteJoint.h>
#include <pxr/usd/usdPhysics/rigidBodyAPI.h>
#include <pxr/usd/usdPhysics/sphericalJoint.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <set>
#include <string>
#include <vector>

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

void want(bool good, const std::string& what) {
  if (good) return;
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}
void want_near(double found, double wanted, double tolerance, const std::string& what) {
  char numbers[80];
  std::snprintf(numbers, sizeof numbers, ": %.9g and not %.9g", found, wanted);
  want(std::abs(found - wanted) <= tolerance, what + numbers);
}

class Check {
 public:
  Check(const char* usda, const char* xml) {
    TfErrorMark errors;
    stage_ = UsdStage::Open(usda);
    want(stage_ && errors.IsClean(), "OpenUSD does not open the file without an error");
    char error[1000] = "";
    model_ = mj_loadXML(xml, nullptr, error, sizeof error);
    want(model_ && !*error, std::string("MuJoCo: ") + error);
    data_ = mj_makeData(model_);
    mj_kinematics(model_, data_);
    metre_ = UsdGeomGetStageMetersPerUnit(stage_);
    want(UsdGeomGetStageUpAxis(stage_) == UsdGeomTokens->z, "the stage is not Z up");
    want_near(UsdPhysicsGetStageKilogramsPerUnit(stage_), 1, 0, "kilograms of a unit");
  }

  void schemas() const {
    const auto& registry = UsdSchemaRegistry::GetInstance();
    for (const UsdPrim& prim : stage_->Traverse()) {
      const std::string at = prim.GetPath().GetString();
      want(registry.IsConcrete(prim.GetTypeName()),
           at + " has the unknown type " + prim.GetTypeName().GetString());
      const TfTokenVector known = prim.GetPrimDefinition().GetPropertyNames();
      for (const UsdProperty& property : prim.GetAuthoredProperties()) {
        const std::string name = property.GetName().GetString();
        want(name.starts_with("xformOp:") || std::ranges::count(known, property.GetName()),
             at + "." + name + " is in no schema");
      }
      for (const UsdAttribute& attribute : prim.GetAuthoredAttributes()) {
        const auto defined = prim.GetPrimDefinition().GetAttributeDefinition(attribute.GetName());
        want(!defined || defined.GetTypeName() == attribute.GetTypeName(),
             at + "." + attribute.GetName().GetString() + " has another type than its schema");
      }
      for (const UsdRelationship& relationship : prim.GetAuthoredRelationships()) {
        SdfPathVector targets;
        relationship.GetTargets(&targets);
        for (const SdfPath& target : targets)
          want(bool(stage_->GetPrimAtPath(target)), at + " names " + target.GetString());
      }
    }
  }

  int spheres() {
    std::vector<int> seen(
        static_cast<std::size_t>(model_->nbody));  // spheres of each body, in the order of both files
    int count = 0;
    for (const UsdPrim& prim : stage_->Traverse()) {
      if (!prim.IsA<UsdGeomSphere>()) continue;
      const std::string name = prim.GetPath().GetString();
      want(prim.HasAPI(TfToken("PhysicsCollisionAPI")), name + " collides with nothing");
      const int b = body_of(prim.GetParent()), k = seen[static_cast<std::size_t>(b)]++;
      want(k < model_->body_geomnum[b], "MuJoCo has fewer spheres in the body of " + name);
      const int g = model_->body_geomadr[b] + k;
      double radius = 0;
      UsdGeomSphere(prim).GetRadiusAttr().Get(&radius);
      const GfVec3d center = metre_ * at_.GetLocalToWorldTransform(prim).ExtractTranslation();
      want_near(metre_ * radius, model_->geom_size[3 * g], 1e-9, "radius of " + name);
      for (int c = 0; c < 3; c++) want_near(center[c], data_->geom_xpos[3 * g + c], 1e-6, "place of " + name);
      count++;
    }
    want_near(count, model_->ngeom, 0, "spheres");
    return count;
  }

  int bodies() {
    int count = 0;
    for (const UsdPrim& prim : stage_->Traverse()) {
      if (!prim.HasAPI<UsdPhysicsRigidBodyAPI>()) continue;
      const int b = body_of(prim);
      count++;
      float mass = 0;
      if (!UsdPhysicsMassAPI(prim).GetMassAttr().Get(&mass)) continue;
      GfVec3f center, moments;
      GfQuatf axes;
      UsdPhysicsMassAPI(prim).GetCenterOfMassAttr().Get(&center);
      UsdPhysicsMassAPI(prim).GetDiagonalInertiaAttr().Get(&moments);
      UsdPhysicsMassAPI(prim).GetPrincipalAxesAttr().Get(&axes);
      const std::string name = prim.GetPath().GetString();
      want_near(mass, model_->body_mass[b], 1e-6 * mass + 1e-6, "mass of " + name);
      for (int k = 0; k < 3; k++)
        want_near(metre_ * center[k], model_->body_ipos[3 * b + k], 1e-6, "centre of mass of " + name);
      const double* q = model_->body_iquat + 4 * b;
      const double* m = model_->body_inertia + 3 * b;
      const GfMatrix3d a = tensor(GfQuatd(axes), GfVec3d(moments) * metre_ * metre_),
                       t = tensor(GfQuatd(q[0], q[1], q[2], q[3]), GfVec3d(m[0], m[1], m[2]));
      // MuJoCo mends the moments that no body can have, and those that are too small for it.
      const auto [least, most] = std::minmax({moments[0], moments[1], moments[2]});
      if (metre_ * metre_ * least < 1e-9F || moments[0] + moments[1] + moments[2] < 2 * most) continue;
      for (int k = 0; k < 9; k++)
        want_near(a[k / 3][k % 3], t[k / 3][k % 3], 1e-5 * (m[0] + m[1] + m[2]), "inertia of " + name);
    }
    return count;
  }

  int joints() {
    int moving = 0;
    for (const UsdPrim& prim : stage_->Traverse()) {
      if (!prim.IsA<UsdPhysicsJoint>()) continue;
      const std::string name = prim.GetPath().GetString();
      const UsdPhysicsJoint joint(prim);
      const UsdPrim parent = target(joint.GetBody0Rel()), child = target(joint.GetBody1Rel());
      const int b = body_of(child);
      want_near(model_->body_parentid[b], body_of(parent), 0, "parent at " + name);
      const GfMatrix4d here =
          frame(joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()) * at_.GetLocalToWorldTransform(parent);
      const GfMatrix4d there =
          frame(joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()) * at_.GetLocalToWorldTransform(child);
      for (int k = 0; k < 16; k++)
        want_near(here[k / 4][k % 4], there[k / 4][k % 4], 1e-6, "the two frames of " + name);
      const UsdPhysicsRevoluteJoint turns(prim);
      const UsdPhysicsPrismaticJoint slides(prim);
      const bool ball = prim.IsA<UsdPhysicsSphericalJoint>();
      moving += turns || slides || ball;
      want_near(model_->body_jntnum[b], turns || slides || ball ? 1 : 0, 0, "MuJoCo's joints at " + name);
      if (!turns && !slides) continue;
      const int j = model_->body_jntadr[b];
      want_near(model_->jnt_type[j], turns ? mjJNT_HINGE : mjJNT_SLIDE, 0, "kind of " + name);
      const GfVec3d axis = here.TransformDir(GfVec3d(1, 0, 0)), anchor = metre_ * here.ExtractTranslation();
      for (int k = 0; k < 3; k++) {
        want_near(axis[k], data_->xaxis[3 * j + k], 1e-6, "axis of " + name);
        want_near(anchor[k], data_->xanchor[3 * j + k], 1e-6, "anchor of " + name);
      }
      float low = -INFINITY, high = INFINITY;
      (turns ? turns.GetLowerLimitAttr() : slides.GetLowerLimitAttr()).Get(&low);
      (turns ? turns.GetUpperLimitAttr() : slides.GetUpperLimitAttr()).Get(&high);
      want(std::isfinite(low) == (model_->jnt_limited[j] != 0), "only one of the two limits " + name);
      const double unit = turns ? std::numbers::pi / 180 : metre_;
      if (std::isfinite(low)) {
        want_near(unit * low, model_->jnt_range[2 * j], 1e-5, "lower limit of " + name);
        want_near(unit * high, model_->jnt_range[2 * j + 1], 1e-5, "upper limit of " + name);
      }
    }
    want_near(moving, model_->njnt - free_joints(), 0, "joints that move");
    return moving;
  }

  std::size_t pairs() const {
    std::set<std::pair<int, int>> ours, theirs;
    for (const UsdPrim& prim : stage_->Traverse()) {
      SdfPathVector others;
      if (prim.HasAPI<UsdPhysicsFilteredPairsAPI>())
        UsdPhysicsFilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets(&others);
      for (const SdfPath& other : others)
        ours.insert(std::minmax({body_of(prim), body_of(stage_->GetPrimAtPath(other))}));
    }
    for (int k = 0; k < model_->nexclude; k++)
      theirs.insert(std::minmax(
          {(model_->exclude_signature[k] >> 16) - 1, (model_->exclude_signature[k] & 0xffff) - 1}));
    want(ours == theirs, std::to_string(ours.size()) + " pairs may not touch, and not the " +
                             std::to_string(theirs.size()) + " of MuJoCo");
    return ours.size();
  }

 private:
  static GfMatrix3d tensor(const GfQuatd& axes, const GfVec3d& moments) {
    const GfMatrix3d turn(axes);
    return turn.GetTranspose() * GfMatrix3d(moments) * turn;  // OpenUSD's vectors are rows
  }
  static GfMatrix4d frame(const UsdAttribute& place, const UsdAttribute& turn) {
    GfVec3f p;
    GfQuatf q;
    place.Get(&p), turn.Get(&q);
    return GfMatrix4d(GfMatrix3d(GfQuatd(q).GetNormalized()), GfVec3d(p));
  }
  UsdPrim target(const UsdRelationship& relationship) const {
    SdfPathVector targets;
    relationship.GetTargets(&targets);
    want(targets.size() == 1, relationship.GetPath().GetString() + " names no body or several");
    return stage_->GetPrimAtPath(targets[0]);
  }
  int body_of(const UsdPrim& prim) const {
    if (model_->nbody == 2) return 1;
    for (int b = 0; b < model_->nbody; b++)
      if (TfMakeValidIdentifier(mj_id2name(model_, mjOBJ_BODY, b)) == prim.GetName().GetString()) return b;
    want(false, "MuJoCo has no body " + prim.GetName().GetString());
    return 0;
  }
  int free_joints() const {
    return int(std::count(model_->jnt_type, model_->jnt_type + model_->njnt, int(mjJNT_FREE)));
  }

  UsdStageRefPtr stage_;
  UsdGeomXformCache at_;
  mjModel* model_ = nullptr;
  mjData* data_ = nullptr;
  double metre_ = 1;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "openusd_check FILE.usda FILE.xml\n"), 2;
  Check check(argv[1], argv[2]);
  check.schemas();
  const int spheres = check.spheres(), bodies = check.bodies(), joints = check.joints();
  std::printf("OpenUSD %d.%02d: %d spheres, %d bodies, %d joints that move, %zu pairs that may not touch\n",
              PXR_MINOR_VERSION, PXR_PATCH_VERSION, spheres, bodies, joints, check.pairs());
}
