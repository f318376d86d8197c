// SPDX-License-Identifier: MIT
// The part of a stepper that works on a GPU. Everything stays there between two calls; only a few numbers of
// each step come back. Without CUDA there is none (device_none.cpp). Stepper is its only user.
#pragma once
#include <memory>

#include "tools/settle/state.h"

namespace padder::settle {

// What became of a row of steps.
struct StepsTaken {
  std::uint64_t steps = 0;          // that were taken whole
  bool detect = false;              // no further step is possible with these candidates
  std::uint64_t contacts = 0;       // of the last step
  double deepest = 0, ratio = 0;    // of the last step
  double most = 0, most_ratio = 0;  // the same, of all of them
  std::uint32_t wild = ~0u;         // the first mover that was too fast in a further step; ~0u: none
};

class DeviceStepper {
 public:
  virtual ~DeviceStepper() = default;

  // The state of movers, and springs by i, then j; they are the candidates until find() is called.
  virtual void put(const Snapshot& snapshot) = 0;
  // The movers' state to the host.
  virtual void get(System& system) = 0;
  // All candidates with their springs, by i, then j; those with walls apart.
  virtual void get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls) = 0;

  // New candidates, with a gap of at most `skin`; springs go from the old to the new. Returns the number of
  // pairs of spheres among them.
  virtual std::uint64_t find(double skin) = 0;
  // Takes up to `count` steps, fewer if candidates become too old. A step whose overlap is larger than a
  // radius (ratio > 1), or in which a mover is wild, is not counted and the last.
  virtual StepsTaken step(std::uint64_t count) = 0;
  // Sums over everything in a fixed order. The depths are left 0.
  virtual Watch watch() = 0;
};

// Throws Error where there is no GPU that this build can use.
std::unique_ptr<DeviceStepper> make_device_stepper(const System& system);

}  // namespace padder::settle
