// SPDX-License-Identifier: MIT
// Reads MuJoCo's MJCF as a robot: bodies with their geoms, and joints.
#pragma once
#include "padding/robots/robot_tree.h"

namespace padder {

// As read_urdf gives it, in metres and radians. The first link is "world". Bodies of the worldbody hang on
// it, fixed or by their joints.
//
// * Geoms: those that can touch something (contype or conaffinity is not 0, or a `pair` names them); where
//   none can, or with options.visual, those that cannot. A note names bodies that have only others. Sphere,
//   capsule, ellipsoid, cylinder, box and mesh. Planes and height fields are the ground, not the robot, and
//   are left out with a note. A mesh is taken as it is; MuJoCo itself lets its convex hull touch.
// * Joints: a body with several, or with one whose anchor is off its origin, gets a link without shapes for
//   each of them, called BODY:JOINT. At the value 0 of each joint all stands where MuJoCo puts it, with `ref`
//   taken into account. Limits, damping, friction and the effort of motors are read. Joint equalities of
//   degree 1 become mimics.
// * Pairs: `exclude`, and bodies whose contype and conaffinity never match, are in model.apart ("User"),
//   unless a `pair` lets geoms of theirs touch.
// * Of the rest, as loops, tendons and sensors, a note lists what was left out.
// * The file: default classes, childclass, `include`, `frame`, and of the compiler angle, eulerseq, meshdir,
//   assetdir, strippath and settotalmass.
// * Mass: a body without `inertial`, or with geoms and inertiafromgeom="true", gets that of its geoms,
//   whether seen or touching. If a mesh or a shell is among them, its moments follow from the shape that is
//   padded, and so does its mass, with the density that all of them state or else the caller's, unless all of
//   them state a mass. Without spheres such a body has no mass. Notes say so.
//
// Throws Error, which names the file and the element, for what changes the shape and is not read:
// coordinate="global", `replicate`, `composite`, `flexcomp`, `attach`, meshes whose vertices stand in the
// file, geoms that are fitted to a mesh, joints in a `frame`. It also throws for what MuJoCo refuses: no
// number where one should be, a class or mesh that is not there, a name twice, a mesh file that is not there.
// Of meshes that are not padded, the files are not read.
RobotTree read_mjcf(const std::filesystem::path& path, const RobotReadOptions& options = {});

}  // namespace padder
