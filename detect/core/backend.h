// SPDX-License-Identifier: MIT
// What the detector asks of a backend. A backend owns its memory and keeps it from call to call. Internal.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "detect/core/errors.h"
#include "detect/core/grid.h"
#include "detect/core/input.h"
#include "detect/core/nine_stages.h"
#include "detect/detector.h"

namespace padder::detect {

class Backend {
 public:
  virtual ~Backend() = default;
  virtual const char* name() const = 0;

  // Can detect() fill Contacts::history? Detector refuses such a call of a backend that cannot.
  virtual bool has_history() const { return false; }

  // Finds the contacts by options.path. The caller has checked the options (check_options); the backend
  // checks the input (check_input). Throws Error with fault_sentence for the first faulty sphere, and with
  // MemoryError if there is not enough memory. The backend can be used again after that.
  virtual Contacts detect(const Input& input, const CallOptions& options) = 0;

  // Detector::detect_worlds(), after the checks that detect() asks of the caller.
  virtual WorldAnswers detect_worlds(const Input& input, const CallOptions& options, std::uint32_t worlds,
                                     Answer answer) = 0;

  // The arrays of the nine stages, copied to the host.
  virtual Arrays stages(const Input& input, const CallOptions& options) = 0;

  // A copy in host memory of input.poses, which lie in device memory. Throws Error.
  virtual std::vector<Pose> device_poses(const Input& input, const CallOptions& options) = 0;

  // Called after detect() or stages() threw, and after the detector refused a call itself. The backend
  // forgets its list of contacts, what it planned from previous calls, and the revision: poses that the
  // failed call named in `moved` may not have been read, so the next call must read everything. It keeps its
  // memory.
  virtual void forget() noexcept = 0;

  // The sum of pair_hash over the contacts of the last detect(). Asked for only while there are some: not
  // after forget(), stages() or a call that found none.
  virtual std::uint64_t hash() const = 0;

  virtual std::uint64_t memory() const = 0;  // bytes that this backend holds
};

std::unique_ptr<Backend> make_omp_backend();
// Throws Error with the sentence of cuda_absence() if that is not empty.
std::unique_ptr<Backend> make_cuda_backend(int device);
// Why there is no CUDA backend on that device (the GPU is missing, too old, or not one that the build has
// code for), as a sentence; empty if there is one.
std::string cuda_absence(int device);
// GPUs that CUDA shows this process; 0 in a build without CUDA. Does not open them.
int cuda_device_count();

}  // namespace padder::detect
