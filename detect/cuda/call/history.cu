// SPDX-License-Identifier: MIT
#include "detect/cuda/call/history.h"

#include <bit>

#include "detect/contact.h"

namespace padder::detect::cuda {
namespace {

using Word = unsigned long long;

constexpr int kThreads = 256;
// Pairs of a window; how far from it a pair of the list before is looked for; places of its hash table, of
// which at least half stay empty.
constexpr std::uint32_t kWindow = 1024, kReach = 512, kPlaces = 2 * kWindow, kEmpty = ~0u;
constexpr int kPlaceBits = std::bit_width(kPlaces - 1);
constexpr std::uint32_t kLastCall = 255;  // a mark is a byte
constexpr int kCallShift = 56;            // of an entry

struct MatchTask {
  PairList now, before;
  std::uint32_t* found = nullptr;
  std::uint8_t* marks = nullptr;
  Word* entries = nullptr;
  std::uint64_t mask = 0;  // of the places of the table in global memory
  std::uint32_t* open = nullptr;
  std::uint32_t call = 0;
};

// Called for a pair of `now` that was not found near its place.
__device__ void put_entry(const MatchTask& t, const Pair& p, std::uint64_t k) {
  const Word mine = static_cast<Word>(t.call) << kCallShift | k;
  for (std::uint64_t at = pair_hash(p.i, p.j) & t.mask;; at = (at + 1) & t.mask) {
    Word there = __ldcg(t.entries + at);
    while (there >> kCallShift != t.call) {
      const Word seen = atomicCAS(t.entries + at, there, mine);
      if (seen == there) return;
      there = seen;
    }
  }
}

__device__ __forceinline__ std::uint32_t place_in_window(const Pair& p) {
  return ((p.i * 0x9e3779b1u) ^ (p.j * 0x85ebca77u)) >> (32 - kPlaceBits);
}

// A block looks for the pairs of its window: first each at its own index, then those that are not there among
// all pairs of the list before that stand near.
__global__ void __launch_bounds__(kThreads) match_near_kernel(const __grid_constant__ MatchTask t) {
  __shared__ Pair pairs[kWindow];
  __shared__ std::uint32_t places[kPlaces], found[kWindow];
  const std::uint64_t first = blockIdx.x * std::uint64_t(kWindow);
  const auto count = static_cast<std::uint32_t>(min(t.now.count - first, std::uint64_t(kWindow)));
  bool open = false;
  for (std::uint32_t k = threadIdx.x; k < count; k += kThreads) {
    const Pair p = t.now.pairs[first + k];
    const bool here = first + k < t.before.count && t.before.pairs[first + k] == p;
    pairs[k] = p, found[k] = here ? static_cast<std::uint32_t>(first + k) : kNoContact;
    if (here) t.marks[first + k] = static_cast<std::uint8_t>(t.call);
    open = open || !here;
  }
  if (__syncthreads_or(open)) {
    for (std::uint32_t k = threadIdx.x; k < kPlaces; k += kThreads) places[k] = kEmpty;
    __syncthreads();
    for (std::uint32_t k = threadIdx.x; k < count; k += kThreads) {
      if (found[k] != kNoContact) continue;
      std::uint32_t at = place_in_window(pairs[k]);
      while (atomicCAS(places + at, kEmpty, k) != kEmpty) at = (at + 1) % kPlaces;
    }
    __syncthreads();
    // Contacts come and go all over the list, so that the window's pairs stood where as large a part of the
    // list before lies in front of them.
    const auto stood = static_cast<std::uint64_t>(
        static_cast<double>(first) * static_cast<double>(t.before.count) / static_cast<double>(t.now.count));
    const std::uint64_t from = stood - min(stood, std::uint64_t(kReach)),
                        upto = min(stood + count + kReach, t.before.count);
    for (std::uint64_t b = from + threadIdx.x; b < upto; b += kThreads) {
      const Pair p = t.before.pairs[b];
      for (std::uint32_t at = place_in_window(p), k; (k = places[at]) != kEmpty; at = (at + 1) % kPlaces) {
        if (!(pairs[k] == p)) continue;
        found[k] = static_cast<std::uint32_t>(b);
        t.marks[b] = static_cast<std::uint8_t>(t.call);
        break;
      }
    }
    __syncthreads();
  }
  for (std::uint32_t k = threadIdx.x; k < count; k += kThreads) {
    t.found[first + k] = found[k];
    if (found[k] != kNoContact) continue;
    put_entry(t, pairs[k], first + k);
    *t.open = t.call;
  }
}

// The pairs of the list before that have no mark, among those of this list that were not found.
__global__ void __launch_bounds__(kThreads) match_rest_kernel(const __grid_constant__ MatchTask t) {
  if (*t.open != t.call) return;
  const auto* const marks = reinterpret_cast<const std::uint32_t*>(t.marks);
  for (std::uint64_t q = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; q * 4 < t.before.count;
       q += std::uint64_t(gridDim.x) * kThreads) {
    const std::uint32_t four = marks[q];
    for (std::uint64_t b = q * 4; b < min(q * 4 + 4, t.before.count); b++) {
      if ((four >> b % 4 * 8 & 255) == t.call) continue;
      const Pair p = t.before.pairs[b];
      Word entry;
      for (std::uint64_t at = pair_hash(p.i, p.j) & t.mask; (entry = t.entries[at]) >> kCallShift == t.call;
           at = (at + 1) & t.mask) {
        const Word k = entry & ((Word(1) << kCallShift) - 1);
        if (!(t.now.pairs[k] == p)) continue;
        t.found[k] = static_cast<std::uint32_t>(b);
        break;
      }
    }
  }
}

}  // namespace

History::History(MemoryBook& book)
    : found_(book, "the history of contacts"),
      marks_(book, "the history of contacts"),
      entries_(book, "the history of contacts"),
      open_(book, "the history of contacts") {}

// Takes the memory, and a number for this call that no mark and no entry has.
void History::begin(std::uint64_t places, std::uint64_t before, cudaStream_t stream) {
  const bool enough = entries_.capacity() >= places && marks_.capacity() >= before;
  if (!enough) {
    marks_.reserve((before + before / 8 + 16) & ~std::uint64_t(15)), entries_.reserve(places);
    open_.reserve(1);
  }
  if (!enough || call_ == kLastCall) {
    cuda_check(cudaMemsetAsync(marks_.data(), 0, marks_.capacity(), stream), "clear the history");
    cuda_check(cudaMemsetAsync(entries_.data(), 0, entries_.capacity() * sizeof(Word), stream),
               "clear the history");
    cuda_check(cudaMemsetAsync(open_.data(), 0, sizeof(std::uint32_t), stream), "clear the history");
    call_ = 0;
  }
  call_++;
}

const std::uint32_t* History::match(const PairList& now, const PairList& before, cudaStream_t stream) {
  if (before.count >= kNoContact)
    throw Error("the list of the call before has " + std::to_string(before.count) +
                " contacts, and a history can number 2^32 - 2: ask for it box by box (CallOptions::own)");
  if (now.count > found_.capacity()) found_.reserve(now.count + now.count / 8);
  if (before.count == 0 && now.count > 0)
    cuda_check(cudaMemsetAsync(found_.data(), 0xff, now.count * sizeof(std::uint32_t), stream),
               "write the history");
  if (before.count > 0 && now.count > 0) {
    MatchTask t{now, before, found_.data()};
    const std::uint64_t places = std::bit_ceil(now.count + now.count / 2 + 1);
    begin(places, before.count, stream);
    t.marks = marks_.data(), t.entries = entries_.data(), t.mask = places - 1, t.open = open_.data();
    t.call = call_;
    const auto blocks = [](std::uint64_t items, std::uint64_t of_thread) {
      return static_cast<unsigned>((items + kThreads * of_thread - 1) / (kThreads * of_thread));
    };
    match_near_kernel<<<blocks(now.count, kWindow / kThreads), kThreads, 0, stream>>>(t);
    match_rest_kernel<<<blocks(before.count, 4), kThreads, 0, stream>>>(t);
    cuda_launched("find the contacts of the call before");
  }
  cuda_check(cudaStreamSynchronize(stream), "find the contacts of the call before");
  return found_.data();
}

}  // namespace padder::detect::cuda
