// SPDX-License-Identifier: MIT
// The files of a run: frames and checkpoints. Each is written whole or not at all.
#pragma once
#include <filesystem>

#include "tools/settle/stepper.h"

namespace padder::settle {

// The spheres of the moment. .npz: `centers`, `radii` and `family`, which detect reads as a scene, and
// `velocities`, `mover` and `time`. .vtp: points with `radius`, `mover` and `velocity`. The family of a
// body's spheres is its own, so that they are no contacts. Throws Error for another ending.
void write_frame(const Stepper& stepper, const std::filesystem::path& path);
// "out.npz" and 7 give "out_0007.npz".
std::filesystem::path frame_path(const std::filesystem::path& path, std::uint64_t number);

// A snapshot and the fingerprint of its scene, as .npz.
void write_checkpoint(const Stepper& stepper, const std::filesystem::path& path);
// Puts `stepper` where the checkpoint was taken. Throws Error if that is of another scene.
void read_checkpoint(Stepper& stepper, const std::filesystem::path& path);

// A hash of what stays as it is during a run: shapes, masses, walls, the law, the time step, the poses of
// what is static and the velocities of what is driven. And one of the motion: positions, velocities,
// orientations and springs, to the bit.
std::uint64_t fingerprint(const System& system);
std::uint64_t state_hash(const Stepper& stepper);

}  // namespace padder::settle
