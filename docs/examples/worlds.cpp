// SPDX-License-Identifier: MIT
// Worlds: many copies of a robot in one call, against obstacles that are given once. First all contacts, then
// answers that need no list: which copies hit something, and how near the others are.
#include <cstdio>
#include <exception>
#include <vector>

#include "detect/detector.h"

namespace pd = padder::detect;

int main() try {
  // The robot is one link: five spheres along x. Copy w stands in world w, 0.1 w higher than the first.
  const std::vector<pd::Sphere> link = {
      {0, 0, 0, 0.2}, {0.3, 0, 0, 0.2}, {0.6, 0, 0, 0.2}, {0.9, 0, 0, 0.2}, {1.2, 0, 0, 0.2}};
  const std::vector<pd::Shape> shapes = {{link.data(), link.size()}};
  constexpr std::uint32_t kWorlds = 10;
  std::vector<pd::Body> robots(kWorlds);
  for (std::uint32_t w = 0; w < kWorlds; w++) robots[w].position[2] = 0.1 * w, robots[w].world = w;

  // One obstacle, which all copies meet.
  const double center[] = {1.2, 0, 0}, radius = 0.25;
  pd::Input input;
  input.shapes = shapes, input.bodies = robots;
  input.spheres = pd::spheres_of<double>(1, center, &radius);
  input.spheres.world_of_all = pd::kEveryWorld;
  input.revision = 1;  // bodies are read once; afterwards `moved` or `poses` say where they are

  pd::Detector detector;
  std::printf("%llu contacts in all worlds\n", static_cast<unsigned long long>(detector.detect(input).count));

  std::uint32_t hit = 0;
  const pd::WorldAnswers any = detector.detect_worlds(input, kWorlds, pd::Answer::any);
  for (std::uint32_t w = 0; w < kWorlds; w++) hit += any.any[w];
  std::printf("%u of %u copies hit the obstacle\n", hit, kWorlds);

  detector.options().margin = 0.3;  // pairs that are up to 0.3 apart count, with negative depths
  const pd::WorldAnswers near = detector.detect_worlds(input, kWorlds, pd::Answer::distance);
  for (std::uint32_t w = 0; w < kWorlds; w++)
    std::printf("world %u: distance %.2f between spheres %u and %u\n", w, near.distance[w], near.pair[w].i,
                near.pair[w].j);
  return hit == 5 ? 0 : 1;  // those that are less than 0.45 higher
} catch (const std::exception& error) {
  std::fprintf(stderr, "worlds: %s\n", error.what());
  return 1;
}
