// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/scenes/shown_spheres.h"

#include <algorithm>
#include <ctime>
#include <string_view>
#include <utility>

#include "padding/asset/error.h"
#include "tools/bench/device.h"

namespace padder::bench {

ShownSpheres::ShownSpheres([[maybe_unused]] std::uint64_t most, [[maybe_unused]] bool on_device) {
#ifdef PADDER_CUDA
  if (on_device && cudaMalloc(&device_, most * sizeof(detect::FloatSphere) + 1) != cudaSuccess)
    throw Error("the spheres do not fit the GPU's memory: choose fewer");
#endif
}

ShownSpheres::~ShownSpheres() {
#ifdef PADDER_CUDA
  cudaFree(device_);
#endif
}

void ShownSpheres::show(std::vector<detect::FloatSphere> spheres) {
  spheres_ = std::move(spheres);
  input_ = input_of(spheres_);
#ifdef PADDER_CUDA
  if (!device_ || spheres_.empty()) return;
  must(cudaMemcpy(device_, spheres_.data(), spheres_.size() * sizeof(detect::FloatSphere),
                  cudaMemcpyHostToDevice),
       "copy the spheres");
  must(cudaDeviceSynchronize(), "copy the spheres");
  detect::Spheres& there = input_.spheres;
  there.centers = device_, there.radii = static_cast<const float*>(device_) + 3;
  there.memory = detect::Memory::device;
#endif
}

void check_contacts(const detect::Detector& detector, std::uint64_t count, const detect::Input& input,
                    const detect::Input& on_host, const Checked& what) {
  detect::CallOptions o;
  o.margin = what.margin, o.width = detect::Width::pairs;
  o.path = what.crowds_nine_stages ? detect::Path::grid : detect::Path::nine_stages;
  const bool cuda = std::string_view(detector.backend()) != "omp" && !what.crowds_nine_stages;
  if (cuda) o.output = detect::Memory::device;
  detect::Detector reference({cuda ? detect::BackendKind::cuda : detect::BackendKind::omp}, o);
  if (detect_watched(reference, cuda ? input : on_host).count != count ||
      hash_watched(reference) != hash_watched(detector))
    throw Error("the fast path and the reference differ at " + what.scene);
}

Times timed(detect::Detector& detector, const detect::Input& input, int calls,
            const std::function<void(int)>& show) {
  constexpr int kBefore = 8;
  std::vector<double> times, processor;
  for (int k = 0; k < kBefore + calls; k++) {
    if (show) show(k);
    const std::clock_t before = std::clock();
    const double seconds = seconds_of([&] { detect_watched(detector, input); });
    if (k < kBefore) continue;
    times.push_back(seconds);
    processor.push_back(static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC);
  }
  return {median(times), *std::max_element(times.begin(), times.end()), median(processor)};
}

}  // namespace padder::bench
