// SPDX-License-Identifier: MIT
// Reads MuJoCo's MJCF as a robot: bodies with their geoms, and joints.
#pragma once
#include "padding/input/urdf.h"

namespace padder {

// As read_urdf gives it, in metres and radians. The first link is "world"; bodies of the worldbody hang on
// it, fixed or by the joints that they have.
//
// * Of the geoms, those count that can touch something (contype or conaffinity is not 0); with
// options.visual, or
//   where none can, those that cannot. Sphere, capsule, ellipsoid, cylinder, box and mesh; planes and height
//   fields are the ground, not the robot, and are left out with a note. A mesh is taken as it is; MuJoCo
//   itself lets its convex hull touch.
// * A body with several joints, or with one whose anchor is off its origin, gets a link without shapes for
// each of
//   them, called BODY:JOINT. At the value 0 of each joint all stands where MuJoCo puts it, with `ref` taken
//   into account.
// * Limits, damping, friction, the effort of motors, and joint equalities of degree 1, which become mimics.
// * `exclude`, and bodies whose contype and conaffinity never match, become pairs in model.apart ("User").
// * Default classes, childclass, `include`, `frame`, and of the compiler: angle, eulerseq, meshdir, assetdir,
//   strippath.
// * Of a body without `inertial`, the mass follows from a density, not from that of its geoms: a note says
// so.
//
// Throws Error, which names the file and the element, for what changes the shape and is not read:
// coordinate="global", `replicate`, `composite`, `flexcomp`, `attach`, meshes whose vertices stand in the
// file, geoms that are fitted to a mesh, joints in a `frame`; and for what MuJoCo refuses, too: no number
// where one should be, a class or mesh that is not there, a name twice, a mesh file that is not there.
Urdf read_mjcf(const std::filesystem::path& path, const UrdfOptions& options = {});

// Is it a robot to be padded, and no file of spheres: MJCF that has a geom that is no sphere, or what cannot
// be read as MJCF and is no URDF?
bool is_mjcf_to_pad(const std::filesystem::path& path);

// By read_mjcf if the file ends in .xml, else by read_urdf.
Urdf read_robot(const std::filesystem::path& path, const UrdfOptions& options = {});

}  // namespace padder
