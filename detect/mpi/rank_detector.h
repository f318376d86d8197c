// SPDX-License-Identifier: MIT
// Contacts of a scene that is spread over the ranks of MPI: machines, or GPUs of one machine. The contacts
// are those of one Detector, pair for pair, and so is the hash. docs/scale.md tells how it works.
#pragma once
#include <mpi.h>

#include <cstdint>
#include <memory>
#include <optional>

#include "detect/boxes/contact_batch.h"
#include "detect/detector.h"

namespace padder::detect {

// How the ranks detect.
struct RankOptions {
  // How each rank detects, as in BoxOptions. The same on all ranks. `threads` are those of one rank.
  CallOptions detector;
  // Where this rank detects. Without: GPU k for the k-th rank of a machine, again from the first on where
  // there are more ranks than GPUs, and the CPU where there is none.
  std::optional<DeviceChoice> device;
};

// What a call did. The first group tells of all ranks together and is the same on each of them.
struct RankReport {
  std::uint64_t contacts = 0, spheres = 0, bodies = 0;
  std::uint64_t copies = 0;    // spheres given to ranks; those above `spheres` are halo
  std::uint64_t hash = 0;      // order-free, as Detector::hash()
  std::uint64_t doubtful = 0;  // sum of Contacts::doubtful
  std::uint64_t splits = 0;    // boxes halved after their detector had run out of memory
  bool cut = false;            // space was cut anew in this call
  double imbalance = 0;        // work of the rank with the most over the mean; work: spheres plus contacts

  // Of this rank.
  std::uint64_t own_contacts = 0, own_spheres = 0;  // found here; given to this rank, halo included
  std::uint64_t sent_bytes = 0, messages = 0;       // to other ranks
  double cut_seconds = 0, exchange_seconds = 0, detect_seconds = 0;  // wall time of the three parts
};

// One object on each rank; every function but the accessors is collective: all ranks call it. Keeps its cut,
// its detector and their memory from call to call. Each rank has one box, which is cut anew when the work of
// the heaviest exceeds the mean by a tenth.
//
// When something fails on one rank, all ranks throw the same Error, which names it, and the object stays
// usable. MPI must have been initialised, with MPI_THREAD_FUNNELED at least, and the thread that did so makes
// the calls.
class RankDetector {
 public:
  // `ranks` is duplicated. Throws Error if a device is not available.
  explicit RankDetector(MPI_Comm ranks, const RankOptions& options = {});
  ~RankDetector();
  RankDetector(RankDetector&&) noexcept;
  RankDetector& operator=(RankDetector&&) noexcept;

  // Each rank passes its part of the scene, whichever spheres and bodies these are: the scene has the bodies
  // of rank 0, those of rank 1 and so on, and then the loose spheres in the same way. All ranks pass the same
  // shapes. What lies in its rank's own box needs no message, so a simulation should keep it there; region()
  // tells the box. `consumer` gets the contacts that this rank found, with the numbers of the scene; an empty
  // one only counts. Everything must lie in host memory. Input::revision, `moved` and `poses` mean for the
  // part what they mean to a Detector.
  const RankReport& detect(const Input& part, const ContactConsumer& consumer);

  const RankReport& report() const;  // of the last call
  Region region() const;             // of this rank's box, in the last call
  const char* backend() const;       // of this rank
  CallOptions& options();            // the same on all ranks

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

// The numbers from first to end - 1 that are `rank`'s part of n things.
struct Part {
  std::uint64_t first, end;
  std::uint64_t count() const { return end - first; }
};
Part part_of(std::uint64_t n, int rank, int ranks);

// The same part of an input: of its bodies, and of its loose spheres. Borrows the input.
Input part_of(const Input& input, int rank, int ranks);

}  // namespace padder::detect
