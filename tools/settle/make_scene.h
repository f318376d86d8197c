// SPDX-License-Identifier: MIT
// Scenes for settle, as JSON: the paper's silo (Table 3), a ball on many bodies (Fig. 2) and a track of
// padded shoes on gravel (Figs. 1 and 4). In metres and kilograms; seeded, so that equal arguments give equal
// bytes.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace padder::settle {

struct MakeOptions {
  std::uint64_t count = 2000;     // grains (silo, track) or bodies (ball)
  std::filesystem::path cluster;  // of the bodies: ball, track, which need one
  std::uint64_t seed = 1;
};

// The names that make_scene() knows.
const std::vector<std::string>& scene_makers();

// `name`: one of these. `folder`: where the scene will be, because it names its cluster relative to it.
// Throws Error where the cluster cannot be read or has no mass.
std::string make_scene(const std::string& name, const MakeOptions& options,
                       const std::filesystem::path& folder);

// The silo's grains: their radius, the height to which they fill it, and their share of its volume.
inline constexpr double kSiloGrain = 0.01, kSiloHeight = 1.0, kSiloPacking = 0.6;
double silo_radius(std::uint64_t grains);

}  // namespace padder::settle
