// SPDX-License-Identifier: MIT
// Contacts of loose spheres and bodies that lie on several GPUs, of one machine or of several, as in a
// simulation that runs there. The spheres stay where they are; only those near a face travel from GPU to GPU.
// The contacts stay on the GPU that found them. Each GPU reads the poses of bodies that it needs from the
// others; all poses travel to all GPUs where these cannot read each other's memory, and between ranks. The
// contacts are those of one Detector, pair for pair. docs/scale.md tells how it works.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "detect/boxes/resident_ranks.h"
#include "detect/detector.h"
#include "detect/host_device.h"

namespace padder::detect {

// How the GPUs detect.
struct ResidentOptions {
  // How each GPU detects. `own` limits the contacts of the whole scene, `memory_limit` is for each GPU's
  // detector; `stream`, `output` and `threads` are not read.
  CallOptions detector;
  // The numbers of the GPUs. The same one may be named more than once. Empty: all there are. With `ranks`:
  // GPU k for the k-th rank of a machine; where there are more ranks than GPUs, they begin again at 0.
  std::vector<int> devices;
  // The ranks of MPI that share the scene: resident_ranks() of detect/mpi/resident_ranks.h. Each has one GPU
  // and one ResidentDetector. All its functions but found(), report(), region() and devices() are
  // collective: all ranks call them. Null: this process alone.
  std::shared_ptr<ResidentRanks> ranks;
};

// What a call did, by the GPUs of all ranks together; the seconds are those of this process.
struct ResidentReport {
  std::uint64_t contacts = 0, spheres = 0;
  std::uint64_t copies = 0;       // loose spheres in the loads, and all spheres of bodies once; those above
                                  // `spheres` are halo
  std::uint64_t moved_bytes = 0;  // from GPU to GPU; not the poses that one reads from another
  std::uint64_t doubtful = 0;     // sum of Contacts::doubtful
  bool cut = false;               // space was cut anew in this call
  double imbalance = 0;           // work of the GPU with the most over the mean; work: spheres plus contacts
  double upload_seconds = 0, deal_seconds = 0, detect_seconds = 0;  // wall time of the parts
};

// Gives the numbers in the scene of the spheres among which one GPU found contacts. A kernel on that GPU
// takes it by value.
struct ResidentNumbers {
  std::uint64_t same = ~std::uint64_t(0);  // below it, a number here is that in the scene
  std::uint64_t before = 0, own = 0;       // then so many from other GPUs, then so many of the GPU's own part
  std::uint64_t first_own = 0;             // the number in the scene of the first of its own
  // The numbers of all that come from other GPUs, before and behind its own; in the memory of the GPU.
  const std::uint64_t* others = nullptr;
  PADDER_HD std::uint64_t of(std::uint32_t k) const {
    if (k < same) return k;
    const std::uint64_t loose = k - same;
    if (loose < before) return others[loose];
    return loose < before + own ? first_own + (loose - before) : others[loose - own];
  }
};

// What one GPU found: all arrays lie in its memory, until the next call or the end of the detector. The pairs
// number the spheres of all bodies as in the scene, then the first numbers.before of `others`, then `own`,
// and then the rest of `others`. numbers.of(k) is the number in the scene of sphere k here.
struct ResidentContacts {
  int device = 0;
  Contacts contacts;
  Spheres own, others;  // the part that the caller gave, unless it was copied; copies
  ResidentNumbers numbers;
};

// The poses of bodies that follow one another, in the memory of one GPU.
struct ResidentPoses {
  const Pose* poses = nullptr;
  std::uint64_t count = 0;
};

// Keeps its cut, its detectors and their memory from call to call. Space is cut anew when the work of the
// heaviest GPU exceeds the mean by a tenth. Not for two threads at once. If a sphere is at fault, every
// function throws the Error that a Detector would throw. If a GPU fails, the Error names it. The object stays
// usable. What fails on one rank fails on all, with the same sentence.
class ResidentDetector {
 public:
  // Throws Error if a GPU is not available, and in a build without CUDA.
  explicit ResidentDetector(const ResidentOptions& options = {});
  ~ResidentDetector();
  ResidentDetector(ResidentDetector&&) noexcept;
  ResidentDetector& operator=(ResidentDetector&&) noexcept;

  // One part of the scene for each GPU, in the order of the GPUs: parts[k] lies in the memory of GPU k, or in
  // host memory, from where it is copied there (at full speed if it is pinned). The scene has the spheres of
  // part 0, then those of part 1, and so on; a rank gives its own part alone, and those of rank 0 come first.
  // Each part has below 2^32 - 1 spheres; all are in float or all in double. Which spheres a part holds is
  // the caller's choice, but those outside of region(k) travel, and the part is copied if they are more than
  // an eighth; else it is read where it lies. The call waits for work that was given to the default streams
  // of the GPUs before.
  const ResidentReport& detect(std::span<const Spheres> parts);

  // The same for a scene with bodies. `bodies` has no loose spheres, and parts may be empty. Every GPU knows
  // all bodies and leaves out those that its region does not meet. Give a revision: without one, every call
  // copies the bodies and divides them into pieces. poses[k] lies on GPU k: the poses of the first bodies on
  // the first GPU, those of the next on the second, and so on, one pose for each body. Without `poses`, those
  // of `bodies` in host memory count, as for a Detector. The spheres of bodies are numbered before the loose
  // ones. All ranks give the same bodies (only the counts are compared), and each rank gives its part of
  // the poses.
  const ResidentReport& detect(std::span<const Spheres> parts, const Input& bodies,
                               std::span<const ResidentPoses> poses = {});

  // Of the last call, one for each GPU of this process.
  std::span<const ResidentContacts> found() const;
  const ResidentReport& report() const;
  std::uint64_t hash() const;  // order-free, as Detector::hash(). Cost: a pass over the contacts.
  Region region(std::size_t device) const;  // of GPU number `device` of the list

  std::size_t devices() const;
  CallOptions& options();

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace padder::detect
