// SPDX-License-Identifier: MIT
// The stepper: it advances a System step by step with contacts from the detector, on the CPU or on a GPU.
// Same input, same bits on one backend, for any number of threads and whether candidates are kept or not.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "detect/detector.h"
#include "detect/omp/threads.h"
#include "tools/settle/device_stepper.h"
#include "tools/settle/push.h"
#include "tools/settle/state.h"

namespace padder::settle {

struct StepperOptions {
  int threads = 0;   // 0: as many as OpenMP would use and the scene is large enough for
  double skin = -1;  // a length; below 0: chosen and adapted by the stepper; 0: detection in every step
  detect::BackendKind backend = detect::BackendKind::omp;  // automatic: a GPU if there is one and it pays
};

class Stepper {
 public:
  // Throws Error if the step of time is too long for the stiffness (the sentence says which would do), for a
  // system whose numbers make no sense, and if the backend that is asked for is not available.
  explicit Stepper(System system, const StepperOptions& options = {});

  // So many steps. Throws Error, in a sentence that says which mover and when, if a mover travels more than
  // half the smallest radius in one, or if two spheres overlap by more than the smaller radius: an explosion.
  // A GPU takes many steps in one call faster than one in each of many calls.
  void step(std::uint64_t count = 1);

  const char* backend() const { return device_ ? "cuda" : "omp"; }
  const System& system() const { return fetch(), s_; }  // after a step on a GPU this copies the state
  // Of the system; these copy nothing from a GPU.
  double mean_radius() const { return mean_; }
  double gravity() const { return length(s_.gravity); }
  double time_step() const { return s_.step; }
  std::uint64_t steps() const { return steps_; }
  double time() const { return static_cast<double>(steps_) * s_.step; }
  // Of the last step, those with walls among them; after watch() and before a step, as the spheres lie.
  std::uint64_t contacts() const { return contacts_; }
  // The deepest penetration of all steps and first looks so far, and as a ratio to the smaller radius. After
  // resume() it begins again.
  double deepest_so_far() const { return most_; }
  double deepest_ratio_so_far() const { return most_ratio_; }
  // The pairs of spheres that touched in the last step, by i, then j. On a GPU: candidates that touch at
  // placed(), wherever that is.
  std::vector<detect::Pair> touching_pairs() const;
  // The spheres where the last step saw them, in the detector's numbering; before the first step as given.
  const std::vector<detect::Sphere>& placed() const { return centers_; }
  void place();   // puts placed() where the movers are now
  Watch watch();  // a pass over everything in a fixed order; on the CPU it places

  // Everything is slow if nothing is faster than what falls a thousandth of the mean radius. At rest: the
  // last watch() saw that everything is slow and was at each look since another one, and is not faster than
  // it was then. Between the two lie rest_steps(), in which whatever hangs in the air, slides, tips over or
  // turns back would have become faster. Step 0 is no such look: it is too early for anything to be fast.
  // Never without gravity.
  bool at_rest() const { return at_rest_; }
  // The step in which a look can first find everything at rest; kNever: the last look saw something faster.
  std::uint64_t rest_step() const;

  Snapshot snapshot() const;
  void resume(const Snapshot& snapshot);  // throws Error if it is of another system

  // What keeping candidates did: how often the detector was asked, and the seconds in it and in all steps.
  struct Effort {
    std::uint64_t detections = 0;
    std::uint64_t candidates = 0;  // at present
    double skin = 0;               // at present
    double detection_seconds = 0, seconds = 0;
  };
  const Effort& effort() const { return effort_; }

 private:
  struct WallPair {
    std::uint32_t sphere, wall;
  };
  std::uint32_t mover(std::uint32_t sphere) const {
    return sphere < body_spheres_ ? owner_[sphere] : sphere - grain_shift_;
  }
  void check() const;
  void check_rims() const;
  double place_and_measure();
  double slow() const { return std::sqrt(2e-3 * gravity() * mean_); }  // the speed
  Watch sums();
  std::uint64_t rest_steps(double speed) const;
  void judge_rest(double speed);
  void find_first_candidates();
  void count_contacts();
  void find_candidates();
  void keep_deepest(double depth, double ratio) {
    most_ = std::max(most_, depth), most_ratio_ = std::max(most_ratio_, ratio);
  }
  void choose_skin();
  void detect_pairs();
  void take_sorted(std::span<const detect::Pair> found);
  void find_wall_pairs();
  void push_pairs();
  void push_walls();
  void push_bushings();
  void integrate();
  Load load_of(std::size_t mover) const;
  MoverState state_of(std::uint32_t mover) const {
    return {s_.position[mover], s_.velocity[mover], s_.spin[mover], s_.inverse_mass[mover],
            material_of(mover)};
  }
  std::uint32_t material_of(std::uint32_t mover) const {
    return s_.material.empty() ? 0u : s_.material[mover];
  }
  void step_on_host();
  void step_on_device(std::uint64_t count);
  std::pair<std::vector<SpringMemory>, std::vector<SpringMemory>> candidates() const;
  void fetch() const;  // the state from the GPU, if it is newer there
  std::string name_of(std::size_t mover) const;
  [[noreturn]] void explode_deep();
  [[noreturn]] void explode_wild(std::size_t mover) const;
  [[noreturn]] void explode(const std::string& what) const;

  mutable System s_;
  std::unique_ptr<DeviceStepper> device_;  // null on the CPU
  mutable bool newer_there_ = false;       // the state on the GPU is newer than s_
  std::uint32_t body_spheres_ = 0, grain_shift_ = 0;
  std::vector<std::uint32_t> owner_;  // of the spheres of bodies
  double smallest_ = 0, mean_ = 0;    // radius
  int asked_threads_ = 0, threads_ = 1;
  detect::omp::Threads chosen_;
  detect::Detector detector_;

  std::vector<detect::Sphere> centers_;
  std::vector<Vec3> reference_;  // the centres when candidates were found
  bool found_ = false;
  double skin_ = 0;
  bool fixed_skin_ = false;
  std::uint64_t steps_ = 0, steps_of_find_ = 0, slow_since_ = kNever;
  double slow_speed_ = 0;  // the liveliest then
  bool at_rest_ = false;
  int pause_ = 0;  // finds for which no candidates are kept, because keeping them did not pay

  // Candidates, by i, then j; of each its memory and its push on i. `starts_`: the first one of each sphere
  // i.
  std::vector<detect::Pair> pairs_;
  std::vector<Vec3> springs_;
  std::vector<Push> pushes_;
  std::vector<std::uint64_t> starts_;
  // The same candidates by j, then i, as indices.
  std::vector<std::uint32_t> by_second_;
  std::vector<std::uint64_t> second_starts_;
  std::vector<WallPair> wall_pairs_;
  std::vector<Vec3> wall_springs_;
  std::vector<Push> wall_pushes_;
  std::vector<std::uint64_t> wall_starts_;  // the first one of each sphere
  std::vector<Load> bushing_loads_;         // of each body

  std::uint64_t contacts_ = 0;
  double deepest_ = 0, deepest_ratio_ = 0;  // of the last step
  double most_ = 0, most_ratio_ = 0;        // of all
  Effort effort_;
};

}  // namespace padder::settle
