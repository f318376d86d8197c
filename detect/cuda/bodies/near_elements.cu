// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/near_elements.h"

#include <algorithm>
#include <utility>

#include "detect/boxes/cut.h"
#include "detect/boxes/halo.h"
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/device/warp.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 128, kWarps = kThreads / 32;

// Doubles that are not negative have the order of their bits. One that is not a number is larger than all:
// then nothing is left out, and the search finds the fault.
__global__ void __launch_bounds__(kThreads) largest_kernel(DeviceSpheres loose, unsigned long long* largest) {
  unsigned long long mine = 0;
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < loose.count; k += gridDim.x * kThreads)
    mine = max(mine, static_cast<unsigned long long>(__double_as_longlong(ball_of(loose.sphere(k)).r)));
  for (unsigned by = 16; by; by /= 2) mine = max(mine, __shfl_xor_sync(~0u, mine, by));
  if (threadIdx.x % 32 == 0) atomicMax(largest, mine);
}

// Where elements are placed in the order of their numbers, each block asks those before it how many they
// found: a word for each box and block, zero at the beginning, says how many the block found, or how many it
// and all blocks before it found.
using Word = unsigned long long;
constexpr Word kOfBlock = Word(1) << 62, kUpToBlock = Word(2) << 62, kValue = kOfBlock - 1;

// By one warp: how many elements the blocks before this one found. They have begun, so they end.
__device__ std::uint32_t found_before(volatile Word* words, std::uint32_t block, std::uint32_t count) {
  const std::uint32_t lane = threadIdx.x % 32;
  if (lane == 0) words[block] = (block == 0 ? kUpToBlock : kOfBlock) | count;
  std::uint32_t sum = 0;
  bool known = block == 0;
  for (std::int64_t at = std::int64_t(block) - 1 - lane; !known; at -= 32) {
    Word word = kUpToBlock;
    while (at >= 0 && (word = words[at]) == 0) {
    }
    const std::uint32_t up_to = __ballot_sync(kFullWarp, word >= kUpToBlock);
    const bool counts = up_to == 0 || lane < static_cast<std::uint32_t>(__ffs(static_cast<int>(up_to)));
    sum += __reduce_add_sync(kFullWarp, counts ? static_cast<std::uint32_t>(word & kValue) : 0);
    known = up_to != 0;
  }
  if (lane == 0 && block > 0) words[block] = kUpToBlock | (sum + count);
  return sum;
}

constexpr std::uint32_t kBegun = kMostPoseParts, kFirstWord = kBegun + 1;  // kBegun: of blocks
struct NearTask {
  Placing placing;
  PosePart part;
  ElementRange of_bodies, loose;
  double largest, margin;
  const double* largest_loose;
  Region boxes[kMostPoseParts];
  std::uint32_t box_count, room;
  bool ordered;
  Word* words;  // zero at the beginning: of each box how many were found; kBegun; those of found_before()
  std::uint32_t* numbers;

  __device__ std::uint32_t size() const { return of_bodies.count + loose.count; }
  __device__ std::uint32_t element(std::uint32_t k) const {
    return k < of_bodies.count ? of_bodies.first + k : loose.first + (k - of_bodies.count);
  }
  // The boxes that need an element, bit by bit.
  __device__ std::uint64_t boxes_of(const Element& e, const Sphere& ball) const {
    const double extent = larger(larger(magnitude(ball.x), magnitude(ball.y)), magnitude(ball.z));
    const bool odd = !(extent + ball.r < kBallInFloat);
    const Bounds halo = halo_of(ball, largest_loose ? larger(largest, *largest_loose) : largest, margin);
    std::uint64_t found = 0;
    const std::uint32_t asked = e.body == kLoose ? 1 : box_count;  // loose spheres were dealt out before
    for (std::uint32_t b = 0; b < asked; b++) found |= std::uint64_t(odd || meets(halo, boxes[b])) << b;
    return found;
  }
};

// A thread takes an element. Ten blocks of a processor leave each thread 48 registers, and nothing spills.
__global__ void __launch_bounds__(kThreads, 10) near_kernel(const __grid_constant__ NearTask task) {
  __shared__ PosesOfWarp poses_of_warp[kWarps];
  __shared__ std::uint32_t begun, places[kMostPoseParts][kWarps];
  const unsigned warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  PosesOfWarp& poses = poses_of_warp[warp];
  if (threadIdx.x == 0)
    begun = task.ordered ? static_cast<std::uint32_t>(atomicAdd(task.words + kBegun, 1)) : blockIdx.x;
  __syncthreads();
  const std::uint32_t block = begun, k = block * kThreads + threadIdx.x;
  const bool here = k < task.size();
  Element e{kLoose, 0};
  if (here) e = task.placing.view.elements[task.element(k)];
  read_poses(task.placing, task.part, e, poses);
  Sphere ball;
  std::uint64_t found = 0;
  if (here) ball = placed_ball(task.placing, e, poses[lane]), found = task.boxes_of(e, ball);
  for (std::uint32_t b = 0; b < task.box_count; b++) {
    const std::uint32_t word = __ballot_sync(kFullWarp, found >> b & 1);
    if (lane == 0) places[b][warp] = static_cast<std::uint32_t>(__popc(word));
  }
  __syncthreads();
  for (std::uint32_t b = warp; b < task.box_count; b += kWarps) {
    std::uint32_t count = 0, before = 0;
    const std::uint32_t within = sum_before(lane < kWarps ? places[b][lane] : 0, count);
    if (task.ordered) before = found_before(task.words + kFirstWord + b * gridDim.x, block, count);
    if (lane == 0 && count > 0) {
      const auto at = static_cast<std::uint32_t>(atomicAdd(task.words + b, count));
      if (!task.ordered) before = at;
    }
    before = __shfl_sync(kFullWarp, before, 0);
    if (lane < kWarps) places[b][lane] = before + within;
  }
  __syncthreads();
  for (std::uint32_t b = 0; b < task.box_count; b++) {
    const bool mine = found >> b & 1;
    const std::uint32_t word = __ballot_sync(kFullWarp, mine);
    const std::uint32_t at = places[b][warp] + static_cast<std::uint32_t>(__popc(word & ((1u << lane) - 1)));
    if (mine && b == 0) put(task.placing, at, e, poses[lane], ball);
    if (mine && b > 0 && at < task.room)
      task.numbers[std::uint64_t(b - 1) * task.room + at] = task.element(k);
  }
}

}  // namespace

NearElements::NearElements(MemoryBook& book)
    : numbers_(book, "the bodies near a box"),
      words_(book, "the bodies near a box"),
      host_counts_(book, "the bodies near a box", true),
      largest_(book, "the bodies near a box") {}

std::uint32_t NearElements::place(const Task& task, cudaStream_t stream) {
  host_counts_.reserve(kMostPoseParts);
  if (task.of_bodies.count + task.loose.count == 0) {
    std::fill_n(host_counts_.data(), task.boxes.size(), 0);
    return 0;
  }
  room_ = std::max(room_, task.of_bodies.count / 8 + 1024);
  while (!try_place(task, stream)) {
  }
  return static_cast<std::uint32_t>(host_counts_.data()[0]);
}

// False: there was no room for a list; now there is.
bool NearElements::try_place(const Task& given, cudaStream_t stream) {
  NearTask task{given.placing, given.part, given.of_bodies, given.loose, given.largest, given.margin};
  task.box_count = static_cast<std::uint32_t>(given.boxes.size());
  std::copy(given.boxes.begin(), given.boxes.end(), task.boxes);
  task.room = room_, task.ordered = given.ordered;
  task.numbers = numbers_.reserve(std::uint64_t(task.box_count - 1) * room_);
  const DeviceSpheres& loose = given.placing.loose;
  if (given.loose.count > 0 && task.box_count == 1) {
    const auto bytes = sizeof(unsigned long long);
    cuda_check(cudaMemsetAsync(largest_.reserve(1), 0, bytes, stream), "choose the bodies");
    largest_kernel<<<blocks_of_loop(loose.count, kThreads), kThreads, 0, stream>>>(loose, largest_.data());
    task.largest_loose = reinterpret_cast<const double*>(largest_.data());
  }
  const unsigned blocks = blocks_for(std::uint64_t(given.of_bodies.count) + given.loose.count, kThreads);
  const std::uint64_t words = kFirstWord + (given.ordered ? std::uint64_t(task.box_count) * blocks : 0);
  task.words = words_.reserve(words);
  const auto clear = [&](std::uint64_t count) {
    cuda_check(cudaMemsetAsync(task.words, 0, count * sizeof(Word), stream), "choose the bodies");
  };
  if (std::exchange(clear_, 0) != words_.capacity()) clear(words_.capacity());
  report_.clear(), report_.add(task.words, host_counts_.data(), task.box_count * sizeof(Word));
  report_.expect();
  near_kernel<<<blocks, kThreads, 0, stream>>>(task);
  cuda_launched("choose the bodies");
  report_.send(stream);
  clear(words), clear_ = words_.capacity();  // for the next call, while the host waits
  report_.arrived(stream, "choose the bodies");
  const Word* const counts = host_counts_.data();
  const Word longest = task.box_count > 1 ? *std::max_element(counts + 1, counts + task.box_count) : 0;
  if (longest <= room_) return true;
  room_ = static_cast<std::uint32_t>(std::min<Word>(longest + longest / 8, given.of_bodies.count));
  return false;
}

}  // namespace padder::detect::cuda
