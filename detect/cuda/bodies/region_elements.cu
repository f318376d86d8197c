// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/region_elements.h"

#include <cub/block/block_scan.cuh>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = ChosenElements::kRun;

// Doubles that are not negative have the order of their bits. One that is not a number is larger than all:
// then nothing is left out, and the search finds the fault.
__global__ void __launch_bounds__(kThreads) largest_kernel(DeviceSpheres loose, unsigned long long* largest) {
  unsigned long long mine = 0;
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < loose.count; k += gridDim.x * kThreads)
    mine = max(mine, static_cast<unsigned long long>(__double_as_longlong(ball_of(loose.sphere(k)).r)));
  for (unsigned by = 16; by; by /= 2) mine = max(mine, __shfl_xor_sync(~0u, mine, by));
  if (threadIdx.x % 32 == 0) atomicMax(largest, mine);
}

// Does the box need an element?
struct MayHaveContacts {
  BodyView view;
  PoseParts parts;
  DeviceSpheres loose;
  Region own;
  double largest;
  const double* largest_loose;
  double margin;

  // True as well where something may be wrong with it: the search finds that.
  __device__ bool reaches(const Sphere& ball) const {
    const double extent = larger(larger(magnitude(ball.x), magnitude(ball.y)), magnitude(ball.z));
    return !(extent + ball.r < kBallInFloat) ||
           meets(halo_of(ball, largest_loose ? larger(largest, *largest_loose) : largest, margin), own);
  }
  // Is its body marked?
  __device__ bool marked(const Element& e) const {
    if (e.body == kLoose) return true;
    const PosePart& part = part_of(parts, e.body);
    const std::uint32_t at = e.body - part.first;
    return part.marks[at / 32] >> at % 32 & 1;
  }
  // Of an element whose body is marked. A body with several pieces may need but some of them.
  __device__ bool operator()(std::uint32_t k, const Element& e) const {
    if (e.body == kLoose) return reaches(ball_of(loose.sphere(e.piece)));
    const bool before = k > 0 && view.elements[k - 1].body == e.body,
               behind = k + 1 < view.moving && view.elements[k + 1].body == e.body;
    return !(before || behind) ||
           reaches(ball_of(body_of(part_of(parts, e.body), e.body), view.pieces[e.piece]));
  }
};

// A block takes some runs, so that many loads are under way at once.
constexpr std::uint32_t kRuns = 4;
__global__ void __launch_bounds__(kThreads)
    choose_kernel(const __grid_constant__ MayHaveContacts needed, std::uint32_t runs, std::uint32_t* bits,
                  std::uint32_t* counts) {
  const std::uint64_t first = std::uint64_t(blockIdx.x) * kRuns * kThreads + threadIdx.x;
  Element element[kRuns];
  bool marked[kRuns];
#pragma unroll
  for (std::uint32_t r = 0; r < kRuns; r++)
    if (first + r * kThreads < needed.view.moving) element[r] = needed.view.elements[first + r * kThreads];
#pragma unroll
  for (std::uint32_t r = 0; r < kRuns; r++)
    marked[r] = first + r * kThreads < needed.view.moving && needed.marked(element[r]);
#pragma unroll
  for (std::uint32_t r = 0; r < kRuns; r++) {
    const std::uint32_t run = blockIdx.x * kRuns + r;
    const auto k = static_cast<std::uint32_t>(first + r * kThreads);
    const bool chosen = marked[r] && needed(k, element[r]);
    const std::uint32_t word = __ballot_sync(~0u, chosen);
    const int count = __syncthreads_count(chosen);
    if (run >= runs) continue;
    if (threadIdx.x % 32 == 0) bits[k / 32] = word;
    if (threadIdx.x == 0) counts[run] = static_cast<std::uint32_t>(count);
  }
}

// before[k] = counts[0] + … + counts[k - 1], for k up to `runs`, and the report of the last. By one block: a
// launch where exclusive_sum() and a report take three, which the host makes while the GPU waits.
constexpr std::uint32_t kSumThreads = 1024;
__global__ void __launch_bounds__(kSumThreads)
    sum_kernel(const std::uint32_t* counts, std::uint32_t runs, unsigned long long* before,
               const __grid_constant__ Report::Parts report) {
  using Scan = cub::BlockScan<unsigned long long, kSumThreads>;
  constexpr std::uint32_t kItems = 4;  // of a thread
  __shared__ typename Scan::TempStorage room;
  unsigned long long all = 0;
  for (std::uint64_t base = 0; base < runs; base += kSumThreads * kItems) {
    const std::uint64_t first = base + threadIdx.x * kItems;
    unsigned long long sums[kItems], sum = 0;
    for (std::uint32_t k = 0; k < kItems; k++) sums[k] = first + k < runs ? counts[first + k] : 0;
    Scan(room).ExclusiveSum(sums, sums, sum);
    for (std::uint32_t k = 0; k < kItems; k++)
      if (first + k < runs) before[first + k] = all + sums[k];
    all += sum;
    __syncthreads();  // the room is used again
  }
  if (threadIdx.x == 0) before[runs] = all;
  __syncthreads();
  write_report(report);
}

}  // namespace

RegionElements::RegionElements(MemoryBook& book)
    : marks_(book),
      bodies_(book, "the bodies near a box"),
      bits_(book, "the bodies near a box"),
      counts_(book, "the bodies near a box"),
      before_(book, "the bodies near a box"),
      host_count_(book, "the bodies near a box", true),
      largest_(book, "the bodies near a box") {}

void RegionElements::begin(const Input& input, const DeviceSpheres& loose, const Region& own, double margin,
                           cudaStream_t stream) {
  loose_ = loose, own_ = own, margin_ = margin;
  if (!knows_bodies_) marks_.learn(input.shapes, input.bodies, stream);
  knows_bodies_ = true;
  if (loose.count == 0) return;
  cuda_check(cudaMemsetAsync(largest_.reserve(1), 0, sizeof(unsigned long long), stream),
             "choose the bodies");
  largest_kernel<<<blocks_of_loop(loose.count, kThreads), kThreads, 0, stream>>>(loose, largest_.data());
  cuda_launched("choose the bodies");
}

const std::uint32_t* RegionElements::mark(const PosePart& all, cudaStream_t stream) {
  const MarkedBox own{own_, bodies_.reserve(marks_.words())};
  marks_.mark(all.poses, all.step, {&own, 1}, 0, largest_loose(), margin_, stream);
  return own.marks;
}

ChosenElements RegionElements::choose(const BodyView& view, const PoseParts& parts, cudaStream_t stream) {
  const std::uint32_t runs = blocks_for(view.moving, kThreads);
  std::uint32_t* const bits = bits_.reserve(std::uint64_t(runs) * (kThreads / 32));
  std::uint32_t* const counts = counts_.reserve(runs);
  unsigned long long* const before = before_.reserve(std::uint64_t(runs) + 1);
  report_.clear(), report_.add(before + runs, host_count_.reserve(1), sizeof *before), report_.expect();
  choose_kernel<<<blocks_for(runs, kRuns), kThreads, 0, stream>>>(
      {view, parts, loose_, own_, marks_.largest_radius(), largest_loose(), margin_}, runs, bits, counts);
  sum_kernel<<<1, kSumThreads, 0, stream>>>(counts, runs, before, report_.parts());
  cuda_launched("choose the bodies");
  return {bits, before};
}

std::uint32_t RegionElements::count(cudaStream_t stream) const {
  report_.arrived(stream, "choose the bodies");
  return static_cast<std::uint32_t>(*host_count_.data());
}

}  // namespace padder::detect::cuda
