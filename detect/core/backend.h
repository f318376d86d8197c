// SPDX-License-Identifier: MIT
// What the detector asks of a backend; internal. A backend owns its memory and keeps it from call to call.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "detect/core/grid.h"
#include "detect/core/nine_stages.h"
#include "detect/detector.h"

namespace padder::detect {

class Backend {
 public:
  virtual ~Backend() = default;
  virtual const char* name() const = 0;

  // The contacts by options.path; calls check_input first. The options were checked (check_options). Throws
  // Error: fault_sentence for the first faulty sphere, memory_sentence when memory is short. Leaves the
  // backend usable in every case.
  virtual Contacts detect(const Input& input, const Options& options) = 0;

  // The arrays of the nine stages, copied to the host.
  virtual Arrays stages(const Input& input, const Options& options) = 0;

  // input.poses, which lie in device memory, copied to the host. Throws Error.
  virtual std::vector<Pose> device_poses(const Input& input, const Options& options) = 0;

  // Called whenever detect or stages threw, or a call was refused before it came here. A backend forgets the
  // revision (poses that the call named as moved may not have been read, so the next call reads everything),
  // whatever it planned from the calls before, and its list of contacts. Memory is kept.
  virtual void forget() noexcept = 0;

  // Sum of pair_hash over the contacts of the last detect, where they lie. Asked for only while there are
  // some: not after forget(), stages() or a call that found none.
  virtual std::uint64_t hash() const = 0;

  virtual std::uint64_t memory() const = 0;  // bytes held
};

std::unique_ptr<Backend> make_omp_backend();
// Throws Error in a build without CUDA, and where the GPU is missing, too old or not one that the build has
// code for.
std::unique_ptr<Backend> make_cuda_backend(int device);
// The sentence that make_cuda_backend would throw; "" if it would not throw.
std::string cuda_absence(int device);

// Common to all backends, in detector.cpp.
std::string number(double v);  // as sentences say it
// What no backend can do with these options, wherever the call comes from; throws Error.
void check_options(const Options& options);
// Pointers, counts, shapes; throws Error. `known`: the bodies were checked in the call before.
void check_input(const Input& input, bool device_memory_allowed, bool known = false);
std::uint64_t sphere_count(const Input& input);   // 2^64 - 1 also for more
Body body_at(const Input& input, std::size_t k);  // with its pose, which must lie in host memory
void check_range(const Summary& summary,
                 const Options& options);  // the record can hold such lengths; throws Error
std::string fault_sentence(std::uint64_t index, const Sphere& sphere, const Input& input);
std::string memory_sentence(std::uint64_t bytes_needed, const char* what, const char* where);

}  // namespace padder::detect
