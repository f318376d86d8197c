// SPDX-License-Identifier: MIT
// Makes a surface that was cut along lines fit to be remeshed: without slivers, and manifold.
#pragma once
#include "padding/asset/mesh.h"

namespace padder {

// Cuts that run close beside an edge leave short edges and thin triangles. This takes out those under `near`:
// a short edge becomes one of its ends, the one whose move changes the planes around it less. A triangle
// whose height is short is left out, and the triangles beyond its longest edge are split at its apex. What is
// left of two layers that then coincide and face apart is left out as well.
//
// The triangles may be any soup with common points. What closes (along each edge the directions cancel) still
// closes. This goes on for at most 20 rounds, in each of which the surface moves by at most about `near`;
// most often two or three do. Deterministic; the time is about linear.
Mesh without_slivers(const Mesh& mesh, double near);

// Thins the fans: a point of 500 triangles or more. Of an edge that faces the tip of one and is shorter than
// `longest`, one end becomes the other where that moves no plane around it by `most` or more. A remesher's
// time grows with the square of the triangles at a point. Rounds go on until no edge is left, and each takes
// every second point, so that the last ones move the surface most. Deterministic; the time is about linear.
// What closes still closes. A mesh without a fan stays as it is.
Mesh with_thinned_fans(const Mesh& mesh, double longest, double most);

// The same for all edges shorter than `longest`, whatever they face. No triangle comes to lie on another one,
// so that a thin body stays one.
Mesh with_short_edges_merged(const Mesh& mesh, double longest, double most);

// The same triangles, with points doubled where more than two of them share an edge, or where parts of the
// surface share a point alone. There the bodies are taken apart: triangles stay together that have the body
// between them, which lies behind counter-clockwise triangles. What has no such partner gets a border.
Mesh taken_apart(const Mesh& mesh);

}  // namespace padder
