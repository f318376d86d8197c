// SPDX-License-Identifier: MIT
// Single instructions that CUDA C++ has no name for, and hints that keep the compiler from computing an
// address again and again. Only .cu files include this.
#pragma once
#include <cstdint>

namespace padder::detect::cuda {

inline constexpr std::uint32_t kFullWarp = ~0u;  // mask of all lanes

// The same value, but opaque to the compiler: it stays in a register instead of being computed again at each
// use.
__device__ __forceinline__ std::uint32_t kept_in_register(std::uint32_t v) {
  asm volatile("" : "+r"(v));
  return v;
}

// Shared memory by its 32-bit address, which costs one register where a pointer costs two.
__device__ __forceinline__ std::uint32_t shared_address(const void* p) {
  return kept_in_register(static_cast<std::uint32_t>(__cvta_generic_to_shared(p)));
}
__device__ __forceinline__ void store_shared(std::uint32_t address, std::uint32_t v) {
  asm volatile("st.shared.u32 [%0], %1;" ::"r"(address), "r"(v) : "memory");
}
__device__ __forceinline__ std::uint32_t load_shared(std::uint32_t address) {
  std::uint32_t v;
  asm volatile("ld.shared.u32 %0, [%1];" : "=r"(v) : "r"(address) : "memory");
  return v;
}
__device__ __forceinline__ void store_shared(std::uint32_t address, std::uint32_t x, std::uint32_t y) {
  asm volatile("st.shared.v2.u32 [%0], {%1, %2};" ::"r"(address), "r"(x), "r"(y) : "memory");
}
__device__ __forceinline__ uint2 load_shared_pair(std::uint32_t address) {
  uint2 v;
  asm volatile("ld.shared.v2.u32 {%0, %1}, [%2];" : "=r"(v.x), "=r"(v.y) : "r"(address) : "memory");
  return v;
}

__device__ __forceinline__ void prefetch_l1(const void* p) {
  asm volatile("prefetch.global.L1 [%0];" ::"l"(p));
}
// Copies from global to shared memory while the warp works on. wait_for_copies() waits for those of the same
// lane.
template <int Bytes>
__device__ __forceinline__ void copy_async(void* to, const void* from) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], %2;" ::"r"(
                   static_cast<std::uint32_t>(__cvta_generic_to_shared(to))),
               "l"(from), "n"(Bytes)
               : "memory");
}
__device__ __forceinline__ void wait_for_copies() { asm volatile("cp.async.wait_all;" ::: "memory"); }

// Off by about one unit in the last place; not a number where v is negative.
__device__ __forceinline__ float approximate_sqrt(float v) {
  float r;
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(v));
  return r;
}
// v must be normal: neither zero nor denormal.
__device__ __forceinline__ float approximate_rsqrt(float v) {
  float r;
  asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(v));
  return r;
}

}  // namespace padder::detect::cuda
