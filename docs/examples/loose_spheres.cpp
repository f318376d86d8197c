// SPDX-License-Identifier: MIT
// Finds the contacts of loose spheres, and reads normal and penetration of each.
#include <cstdio>
#include <exception>
#include <random>
#include <vector>

#include "detect/detector.h"

namespace pd = padder::detect;

int main() try {
  // 20,000 spheres of equal radius at random places in a cube of edge 1.
  constexpr std::uint64_t count = 20000;
  const float radius = 0.01f;
  std::vector<float> centers(3 * count);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> coordinate(0, 1);
  for (float& c : centers) c = coordinate(random);

  pd::Input input;
  input.spheres = pd::spheres_of(count, centers.data(), &radius);
  input.spheres.radius_stride = 0;  // one radius for all

  pd::Detector detector;  // on the GPU where there is one; it keeps its memory from call to call
  const pd::Contacts& contacts = detector.detect(input);
  std::printf("%llu contacts by the backend %s\n", static_cast<unsigned long long>(contacts.count),
              detector.backend());

  // The pairs and the records are two arrays of the same length.
  const auto pairs = contacts.pair_span();
  const auto normals = contacts.normal_span<float>();
  std::size_t deepest = 0;
  for (std::size_t k = 0; k < pairs.size(); k++)
    if (normals[k].depth > normals[deepest].depth) deepest = k;
  if (pairs.empty()) return 1;
  const pd::Normal<float>& n = normals[deepest];
  std::printf("the deepest: spheres %u and %u, penetration %.4f along (%.3f, %.3f, %.3f)\n", pairs[deepest].i,
              pairs[deepest].j, n.depth, n.x, n.y, n.z);
  return n.depth <= 2 * radius ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "loose_spheres: %s\n", error.what());
  return 1;
}
