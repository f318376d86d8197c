// SPDX-License-Identifier: MIT
// Spheres and contacts that stay in the memory of a GPU, as in a simulation that runs there: nothing but the
// number of contacts travels to the host. Ends with the code 77 where there is no GPU.
#include <cuda_runtime.h>

#include <cstdio>
#include <exception>
#include <vector>

#include "detect/detector.h"

namespace pd = padder::detect;

int main() try {
  if (!pd::cuda_present()) {
    std::puts("skipped: no GPU that this build can use");
    return 77;
  }
  // A lattice of 50 x 50 x 50 spheres, 1 apart, each of radius 0.55: neighbours along an axis touch.
  std::vector<float4> lattice;
  for (int x = 0; x < 50; x++)
    for (int y = 0; y < 50; y++)
      for (int z = 0; z < 50; z++) lattice.push_back({float(x), float(y), float(z), 0.55f});
  float* device = nullptr;
  const std::size_t bytes = lattice.size() * sizeof(float4);
  if (cudaMalloc(reinterpret_cast<void**>(&device), bytes) != cudaSuccess) return 1;
  cudaMemcpy(device, lattice.data(), bytes, cudaMemcpyHostToDevice);

  pd::Input input;
  input.spheres = pd::spheres_of(lattice.size(), device, device + 3, pd::Memory::device);
  input.spheres.center_stride = input.spheres.radius_stride = 4;  // x, y, z, r of each sphere lie together

  pd::CallOptions options;
  options.output = pd::Memory::device;
  options.width = pd::Width::pairs;
  pd::Detector detector(options);
  const pd::Contacts& contacts = detector.detect(input);

  // contacts.pairs is a device pointer, valid until the detector's next call: hand it to a kernel.
  pd::Pair first{};
  cudaMemcpy(&first, contacts.pairs, sizeof first, cudaMemcpyDeviceToHost);
  std::printf("%llu contacts in device memory; the first is of spheres %u and %u\n",
              static_cast<unsigned long long>(contacts.count), first.i, first.j);
  cudaFree(device);
  return contacts.count == 3 * 50 * 50 * 49 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "contacts_on_device: %s\n", error.what());
  return 1;
}
