// SPDX-License-Identifier: MIT
// Bodies: one shape in several places. Families say who may touch whom, and a revision says what has not
// changed since the last call, so that the detector need not read it again.
#include <cstdio>
#include <exception>
#include <vector>

#include "detect/detector.h"

namespace pd = padder::detect;

int main() try {
  // A rod of four spheres along x, and a floor of one large sphere below it.
  const std::vector<pd::Sphere> rod = {
      {-1.5, 0, 0, 0.65}, {-0.5, 0, 0, 0.65}, {0.5, 0, 0, 0.65}, {1.5, 0, 0, 0.65}};
  const std::vector<pd::Sphere> floor = {{0, 0, 0, 100}};
  const std::vector<pd::Shape> shapes = {{rod.data(), rod.size()}, {floor.data(), floor.size()}};

  std::vector<pd::Body> bodies(4);
  for (int b = 0; b < 3; b++) {
    bodies[b].position[2] = 2 + b;     // 1 apart: rods whose spheres have a radius of 0.65 overlap
    bodies[b].family = b < 2 ? 1 : 0;  // no contact inside family 1, so none between the first two
  }
  // A quarter of a turn about z, from a quaternion (w, x, y, z) of any length.
  pd::rotation_of(1, 0, 0, 1, bodies[2].rotation);
  bodies[3].shape = 1, bodies[3].position[2] = -100, bodies[3].is_static = true;

  pd::Detector detector;
  pd::Input input;
  input.shapes = shapes, input.bodies = bodies;
  input.revision = 1;  // as long as shapes, families and what is static stay the same
  const std::vector<std::uint32_t> moved = {0, 1, 2};
  input.moved = moved;

  bool landed = false;
  for (int step = 0; step < 30 && !landed; step++) {
    const pd::Contacts& contacts = detector.detect(input);
    // Spheres are numbered through: body 0 has 0 to 3, body 1 has 4 to 7, body 2 has 8 to 11, the floor 12.
    std::uint64_t on_floor = 0, between_rods = 0;
    for (const pd::Pair& pair : contacts.pair_span()) (pair.j == 12 ? on_floor : between_rods)++;
    if (step == 0)
      std::printf("step 0: %llu contacts between rods\n", static_cast<unsigned long long>(between_rods));
    landed = on_floor > 0;
    if (landed) std::printf("step %d: a rod meets the floor\n", step);
    for (int b = 0; b < 3; b++) bodies[b].position[2] -= 0.1;
  }
  return landed ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "bodies: %s\n", error.what());
  return 1;
}
