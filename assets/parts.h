// SPDX-License-Identifier: GPL-3.0-or-later
// The parts that ship with padder, each made from a few dimensions in metres. y is the axis of pins and
// wheels, x the direction of travel, z up. Each part is one closed, manifold, outward solid without
// self-intersections. Equal dimensions give equal meshes. The functions throw Error when the dimensions
// contradict each other.
#pragma once
#include <cstdint>

#include "padding/asset/mesh.h"

namespace padder::assets {

// One link of a single-pin track. Lugs in turn at the rear (-x) and the front (+x) carry the pins, so that
// the next shoe's lugs fit between them; grousers below, a guide horn and two roller paths above, two windows
// for the sprocket.
struct TrackShoe {
  double pitch = 0.160;    // from pin to pin
  double width = 0.400;    // along the pins
  double bore = 0.030;     // diameter of the pin's hole
  double boss = 0.058;     // outer diameter of a lug around it
  double plate = 0.024;    // thickness of the body
  double grouser = 0.034;  // height below the plate
  double horn = 0.085;     // height above the plate
  int lugs = 7;            // front and rear together
  int segments = 36;       // of a full circle
};
Mesh make_track_shoe(const TrackShoe& d = {});

// A rubber-tyred disc wheel: rim, dished disc with round windows, hub with a bore and bolt holes. Centred,
// axis y.
struct RoadWheel {
  double radius = 0.305;
  double width = 0.150;
  double bore = 0.060;  // diameter
  int bolts = 8;
  int windows = 6;
  int segments = 72;
};
Mesh make_road_wheel(const RoadWheel& d = {});

// A crushed and worn particle: the body where the p-norm of the distances to random planes is one. Convex and
// rounded.
struct Grain {
  double size = 0.006;  // about its diameter
  int planes = 22;
  double roundness = 0.3;  // 0: a polyhedron, 1: a pebble
  int frequency = 9;       // 20 frequency^2 triangles
  std::uint32_t seed = 1;
};
Mesh make_grain(const Grain& d = {});

// A bunker's funnel: square inlet with a flange and bolt holes, walls that run to a round outlet. Open at
// both ends, a closed thin-walled solid. Its outlet stands on z = 0.
struct Hopper {
  double inlet = 1.0;   // outer side of the square
  double outlet = 0.2;  // outer diameter
  double height = 0.9;
  double wall = 0.006;
  int bolts = 4;  // at each side of the flange
  int segments = 64;
};
Mesh make_hopper(const Hopper& d = {});

}  // namespace padder::assets
