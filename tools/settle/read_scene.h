// SPDX-License-Identifier: MIT
// Makes a System of a scene: the clusters, bodies and loose spheres that detect reads, and the object
// `settle` beside them with forces, grains, walls and time. docs/detector/settle.md and
// assets/scene.schema.json describe it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "detect/scene/scene.h"
#include "tools/settle/system.h"

namespace padder::settle {

// The largest "seed" of a scene.
inline constexpr std::uint64_t kMostSeed = ~std::uint64_t(0) >> 1;

struct SettleScene {
  System system;
  double duration = 1;
  std::string name;
  std::vector<std::filesystem::path> files;  // those that it was read from
  detect::RungChoice rungs;                  // what was taken; no body is left out
};

// Throws Error that names the file and the place in it. The time step is checked by Stepper.
SettleScene read_settle_scene(const std::filesystem::path& path, const detect::RungRule& rule = {});
// The same of text; files that it names are relative to `folder`, and `where` begins the sentence of an
// Error.
SettleScene settle_scene_from_json(const std::string& text, const std::string& where,
                                   const std::filesystem::path& folder, const detect::RungRule& rule = {});

// The scene at the beginning, with all grains; one without an object `settle` as it is.
detect::Scene scene_at_start(const std::string& text, const std::string& where,
                             const std::filesystem::path& folder);

// The stiffness at which the heaviest column of the scene, or its heaviest mover, presses its lowest contact
// in by a hundredth of the smallest radius. Throws Error without gravity.
double chosen_stiffness(const System& system);

}  // namespace padder::settle
