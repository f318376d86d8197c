// SPDX-License-Identifier: MIT
// What detect_worlds() answers on a GPU: arrays with an entry for each world, filled by the search of the
// tree or from a list of contacts. Only .cu files include this.
#pragma once
#include "detect/cuda/device/memory.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/detector.h"

namespace padder::detect::cuda {

// Where kernels write what they find. Of distances and pairs these are keys; the smaller one counts.
struct WorldKeys {
  std::uint32_t worlds = 0;
  std::uint8_t* any = nullptr;
  unsigned long long *totals = nullptr, *distances = nullptr, *pairs = nullptr;
  // Has the world an answer already? null: none has.
  const std::uint8_t* answered = nullptr;

  // Numbers as keys: ordered in the same way, for atomicMin().
  static __device__ __forceinline__ unsigned long long key_of(double v) {
    const auto bits = static_cast<unsigned long long>(__double_as_longlong(v));
    return bits >> 63 ? ~bits : bits | 1ull << 63;
  }
  static __device__ __forceinline__ double number_of(unsigned long long key) {
    return __longlong_as_double(static_cast<long long>(key >> 63 ? key ^ 1ull << 63 : ~key));
  }
  __device__ __forceinline__ bool has_any(std::uint32_t world) const {
    return *static_cast<const volatile std::uint8_t*>(any + world) != 0;
  }
  // The smallest distance so far.
  __device__ __forceinline__ double nearest(std::uint32_t world) const {
    return number_of(*static_cast<const volatile unsigned long long*>(distances + world));
  }
  __device__ __forceinline__ void keep_distance(std::uint32_t world, double d) const {
    atomicMin(distances + world, key_of(d));
  }
  __device__ __forceinline__ void keep_pair(std::uint32_t world, std::uint32_t a, std::uint32_t b) const {
    atomicMin(pairs + world, static_cast<unsigned long long>(min(a, b)) << 32 | max(a, b));
  }
};

class AnswerArrays {
 public:
  explicit AnswerArrays(MemoryBook& book);

  // No world has an answer yet.
  void begin(std::uint32_t worlds, Answer answer, cudaStream_t stream);
  Answer answer() const { return answer_; }
  const WorldKeys& keys() const { return keys_; }
  // The contacts of a list. `world`: of each sphere; null: all are of `world_of_all`.
  void add(const DeviceSpheres& source, const std::uint32_t* world, std::uint32_t world_of_all,
           const Pair* pairs, std::uint64_t count, cudaStream_t stream);
  // Of distances: the worlds that have a pair by now need no more. True: all have. Waits for the device.
  bool settle(cudaStream_t stream);
  // To where they were asked for. On the host they are there when the stream has got so far.
  WorldAnswers deliver(Memory memory, cudaStream_t stream);

 private:
  template <class T>
  const T* delivered(const Buffer<T>& from, Buffer<T>& host, Memory memory, cudaStream_t stream);

  Answer answer_ = Answer::any;
  WorldKeys keys_;
  Buffer<std::uint8_t> any_, host_any_, answered_;
  Buffer<std::uint64_t> count_, host_count_;
  Buffer<unsigned long long> distance_keys_, pair_keys_;
  Buffer<double> distance_, host_distance_;
  Buffer<Pair> pair_, host_pair_;
  Buffer<std::uint32_t> open_, host_open_;
};

}  // namespace padder::detect::cuda
