// SPDX-License-Identifier: MIT
#include <cstdio>

#include "detect/detector.h"

int main() {
  const float centers[] = {0, 0, 0, 1.5f, 0, 0, 5, 0, 0}, radii[] = {1, 1, 1};
  padder::detect::Detector detector(padder::detect::DeviceChoice{padder::detect::BackendKind::omp});
  padder::detect::Input input;
  input.spheres = padder::detect::spheres_of(3, centers, radii);
  const padder::detect::Contacts& contacts = detector.detect(input);
  for (const auto& pair : contacts.pair_span()) std::printf("%u %u\n", pair.i, pair.j);
  return contacts.count == 1 && contacts.pairs[0] == padder::detect::Pair{0, 1} ? 0 : 1;
}
