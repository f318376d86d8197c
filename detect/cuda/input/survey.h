// SPDX-License-Identifier: MIT
// The first pass over the spheres: the summary from which the grid is chosen. Only .cu files include this.
#pragma once
#include "detect/core/neighbourhood.h"
#include "detect/cuda/device/memory.h"
#include "detect/cuda/device/report.h"
#include "detect/cuda/input/bounds.h"
#include "detect/cuda/input/device_spheres.h"

namespace padder::detect::cuda {

// Finds the summary that choose_grid() asks for.
class Surveyor {
 public:
  explicit Surveyor(MemoryBook& book);
  Summary survey(const DeviceSpheres& source, int processors, cudaStream_t stream);  // waits for the device

  // The survey in steps that do not wait for each other. `top` is the exponent that the largest need is
  // expected to have, and `octaves` says whether sizes are expected to differ so much that octaves are told
  // apart. begin() starts the survey. Where rides_along(), as floats do, begin() is not called: the kernels
  // that put the spheres in order clear the head and gather() the bounds. read() lets the report bring what
  // was found to the host. finish() is called after the stream has been waited for. It is false if an
  // expectation was wrong: then call survey().
  static bool rides_along(const DeviceSpheres& source) { return source.searched_as_floats(); }
  void begin(const DeviceSpheres& source, bool octaves, int top, int processors, cudaStream_t stream);
  static void begin_bounds(unsigned long long* bounds, cudaStream_t stream);  // and clears the head
  Gather gather(bool octaves, int top) const {
    unsigned long long* const bounds = values_.data() + kHead;
    return {bounds, octaves ? bounds + kBounds : nullptr, top};
  }
  // The bounds of the octaves, in a pass of their own.
  static void gather_octaves(const DeviceSpheres& source, const Gather& gather, int processors,
                             cudaStream_t stream);
  void read(const DeviceSpheres& source, bool octaves, bool along, Report& report);
  // Summary::near; waits for the device.
  std::shared_ptr<const Neighbourhood> neighbourhood(const DeviceSpheres& source, const Summary& s, Draw draw,
                                                     cudaStream_t stream);
  // The same in steps that do not wait, once neighbourhood() has been called, for spheres that are expected
  // to have these groups. probe() counts; read_probes() lets the report bring the counts to the host;
  // probed() is what they say once the stream has been waited for.
  void probe(const DeviceSpheres& source, const SizeGroups& groups, Draw draw, cudaStream_t stream);
  void read_probes(const SizeGroups& groups, Report& report);
  std::shared_ptr<const Neighbourhood> probed(const SizeGroups& groups, std::uint32_t spheres,
                                              Draw draw) const;
  // `above`: Summary::above, by which `top` is lower than the largest need's exponent.
  bool finish(const DeviceSpheres& source, bool octaves, int top, bool along, Summary& summary,
              int above = 0) const;

  // The caller's own words (Counters) in front of the summary, so that one report brings both to the host.
  static constexpr int kHead = 8;
  unsigned long long* head() { return values_.reserve(words()); }
  const unsigned long long* host_head() { return host_values_.reserve(words()); }
  void read_head(Report& report);

 private:
  static std::uint64_t words();
  int find_above(const DeviceSpheres& source, cudaStream_t stream);
  Buffer<unsigned long long> values_, host_values_;
  Buffer<double> sums_, host_sums_;
  Buffer<unsigned long long> exponents_;
  Buffer<std::uint32_t> probes_, host_probes_;
};

}  // namespace padder::detect::cuda
