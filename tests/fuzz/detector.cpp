// SPDX-License-Identifier: MIT
// Bytes to calls of one detector, each compared with brute force (tests/detect/oracle.h). Sequences of scenes
// that change little are the model test's (tests/detect/model/); here the numbers are the adversary: any
// double.

#include "tests/detect/oracle.h"
#include "tests/fuzz/targets.h"

namespace padder::fuzz {
namespace {

using namespace detect;

// Any double, or one of those at which something changes.
double number(Bytes& bytes) {
  static constexpr double kSpecial[] = {0,     -0.0,      1,    -1,    2,     0.5,     1e-300,
                                        1e100, -1e100,    1e99, 1e-30, 1e30,  4e-324,  1e16,
                                        1e-8,  1 + 2e-16, 3,    1e38,  1e-45, 16777217};
  switch (const std::uint32_t kind = bytes.below(4)) {
    case 0:
      return bytes.take<double>();
    case 1:
      return kSpecial[bytes.below(std::size(kSpecial))];
    case 2:
      return bytes.take<std::int8_t>() / 4.0;
    default:
      return bytes.take<float>() * (kind == 3 ? 1 : 0);
  }
}

bool good(const Sphere& s) {
  for (const double v : {s.x, s.y, s.z})
    if (!(std::abs(v) <= 1e100)) return false;
  return s.r >= 0 && s.r <= 1e100;
}

TestScene scene_of(Bytes& bytes, Scalar scalar) {
  TestScene scene;
  const std::uint32_t n = 1 + bytes.below(48);
  for (std::uint32_t k = 0; k < n; k++) {
    Sphere s{number(bytes), number(bytes), number(bytes), std::abs(number(bytes))};
    if (!good(s) && bytes.below(64) != 0)
      s = {double(k % 4), double(k / 4), 0, 0.5};  // few calls are to fail
    scene.spheres.push_back(s);
  }
  if (bytes.below(2))
    for (std::uint32_t k = 0; k < n; k++)
      scene.family.push_back(bytes.below(35)), scene.mask.push_back(bytes.take<std::uint32_t>());
  return scalar == Scalar::f32 ? scene.rounded() : scene;
}

void call(Detector& detector, Bytes& bytes) {
  const Scalar scalar = bytes.below(2) ? Scalar::f64 : Scalar::f32;
  CallOptions& o = detector.options();
  o = {};
  o.threads = 1;
  o.path = bytes.below(4) == 0 ? Path::nine_stages : Path::grid;
  o.width = static_cast<Width>(bytes.below(3));
  o.scalar = bytes.below(2) ? Scalar::f64 : Scalar::f32;
  const TestScene scene = scene_of(bytes, scalar);
  const bool must_throw = !std::ranges::all_of(scene.spheres, good);
  const Arranged arranged(scene, scalar);
  std::vector<Pair> found;
  try {
    found = sorted(detector.detect(arranged.input).pair_span());
  } catch (const Error& e) {
    // The nine stages refuse scenes whose largest sphere would lie in too many bins, and records in float
    // refuse what float does not hold.
    const std::string said = e.what();
    if (!must_throw && o.path == Path::grid && said.find("do not fit a float record") == said.npos)
      wrong("refused: " + said);
    return;
  }
  if (must_throw) wrong("a sphere that is none was taken");
  if (found != brute_force(scene))
    wrong(std::to_string(found.size()) + " contacts, brute force " +
          std::to_string(brute_force(scene).size()));
}

}  // namespace

void detector(std::string_view raw) {
  Bytes bytes(raw);
  Detector found({BackendKind::omp}, {});
  for (int k = 0; k < 4 && !bytes.empty(); k++) call(found, bytes);
}

}  // namespace padder::fuzz
