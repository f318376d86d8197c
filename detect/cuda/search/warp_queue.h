// SPDX-License-Identifier: MIT
// What a warp found, in shared memory, until its producer has output slots. Only .cu files include this.
#pragma once
#include "detect/cuda/device/ptx.h"

namespace padder::detect::cuda {

// A bit of the number of contacts that a warp found: they are more than its queue holds, and are searched for
// again when their slots are known.
inline constexpr std::uint32_t kQueueOverflow = 1u << 31;

// Of a search of other levels: the index of j, and the lane or query of i.
template <std::uint32_t Capacity>
struct ContactQueue {
  static constexpr std::uint32_t kCapacity = Capacity;
  alignas(8) std::uint32_t index[Capacity];
  unsigned char who[Capacity];
};

// Of a search of the spheres' own level: j follows i, and seldom by more than 2^27, so that a pair is one
// word. In a hashed level it may follow beyond the last sphere, which the first one follows.
template <std::uint32_t Capacity>
struct PairWords {
  static constexpr std::uint32_t kCapacity = Capacity;
  alignas(8) std::uint32_t index[Capacity];
};
struct PairQueue {
  using Word = std::uint32_t;
  static constexpr std::uint32_t kFar = 1u << 27, kLaneShift = 27;
  std::uint32_t address, first, count;  // of the words; of the warp's spheres; spheres in all
  __device__ __forceinline__ void put(std::uint32_t k, std::uint32_t word) const {
    store_shared(address + 4 * k, word);
  }
  __device__ __forceinline__ std::uint32_t get(std::uint32_t k) const { return load_shared(address + 4 * k); }
  __device__ __forceinline__ std::uint32_t i(std::uint32_t word) const {
    return first + (word >> kLaneShift);
  }
  __device__ __forceinline__ std::uint32_t j(std::uint32_t word) const {
    const std::uint32_t at = first + (word & (kFar - 1));
    return min(at, at - count);
  }
};
// The same memory for half as many pairs, of any two spheres.
struct WidePairQueue {
  using Word = uint2;
  std::uint32_t address;
  __device__ __forceinline__ void put(std::uint32_t k, uint2 pair) const {
    store_shared(address + 8 * k, pair.x, pair.y);
  }
  __device__ __forceinline__ uint2 get(std::uint32_t k) const { return load_shared_pair(address + 8 * k); }
  __device__ __forceinline__ std::uint32_t i(uint2 pair) const { return pair.x; }
  __device__ __forceinline__ std::uint32_t j(uint2 pair) const { return pair.y; }
};

}  // namespace padder::detect::cuda
