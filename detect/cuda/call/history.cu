// SPDX-License-Identifier: MIT
#include "detect/cuda/call/history.h"

#include <algorithm>
#include <bit>

#include "detect/contact.h"
#include "detect/cuda/device/overlapped_launch.h"

namespace padder::detect::cuda {
namespace {

using Word = unsigned long long;

constexpr unsigned kThreads = 256, kOfThread = 4;
// Pairs of a window; how far from its place it is looked for in the list before; places of its hash table, of
// which three quarters and more stay empty: with half of them the kernel takes 1.3 times as long.
constexpr std::uint32_t kWindow = kThreads * kOfThread, kReach = 128, kPlaces = 4 * kWindow, kEmpty = ~0u;
constexpr int kPlaceBits = std::bit_width(kPlaces - 1);
// One pair in 2^kSampleBits is a sample; the first kMostSamples of a window tell where it stood.
constexpr int kSampleBits = 6;
constexpr std::uint32_t kMostSamples = 32;
// Of a block that looks for the pairs that no window found. There are few, and each block counts itself as
// done: a quarter of the blocks saves 0.002 ms at dense 1e6.
constexpr unsigned kRestThreads = 1024;
constexpr std::uint32_t kMostBlocks = 32;  // a processor; beyond, a block takes several windows
// Up to so many places, an entry of the table has 32 bits: then the table of a million spheres stays in L2.
constexpr std::uint64_t kSmallTable = std::uint64_t(1) << 28;
constexpr std::uint32_t kMostPasses = 255;  // a mark is a byte
constexpr std::uint64_t kUnknown = ~std::uint64_t(0);

// What stands behind HistoryTask::pass.
struct PassState {
  std::uint32_t number, used, blocks_done;
};

struct Lengths {
  Word now, before;
  __device__ explicit Lengths(const HistoryTask& t)
      : now(min(*t.count, Word(t.capacity))), before(*t.count_before) {}
};

__device__ __forceinline__ std::uint32_t window_hash(const Pair& p) {
  std::uint32_t h = p.i * 0x9e3779b1u + p.j;
  h ^= h >> 15;
  return h * 0x85ebca77u;
}
__device__ __forceinline__ std::uint32_t place_in_window(std::uint32_t hash) {
  return hash >> (32 - kPlaceBits);
}
__device__ __forceinline__ bool is_sample(std::uint32_t hash) {
  return (hash & ((1u << kSampleBits) - 1)) == 0;
}
__device__ __forceinline__ std::uint32_t sample_place(const HistoryTask& t, std::uint32_t hash) {
  return (hash >> kSampleBits) & t.sample_mask;
}

// At once: a Pair alone is aligned to 4 bytes, those of a list to 8.
__device__ __forceinline__ Pair load_pair(const Pair* p) {
  const uint2 v = *reinterpret_cast<const uint2*>(p);
  return {v.x, v.y};
}

// Puts the index of a pair into the table, and above it in the word the pass, counted from 1. An entry that
// is in the way is moved on.
template <class Entry>
__device__ void put_entry(const HistoryTask& t, const Pair& p, Word index, std::uint32_t pass) {
  auto* const table = static_cast<Entry*>(t.table);
  Entry entry = static_cast<Entry>(pass) << t.index_bits | static_cast<Entry>(index);
  for (Word at = pair_hash(p.i, p.j) & t.mask;; at = (at + 1) & t.mask) {
    entry = atomicExch(table + at, entry);
    if (entry >> t.index_bits != pass) return;
  }
}

// By a warp: the shift with which most of the others nearly agree; 0 if there is none.
__device__ __forceinline__ long long agreed_shift(const long long* shifts, std::uint32_t count) {
  const std::uint32_t lane = threadIdx.x & 31;
  const long long mine = shifts[lane < count ? lane : 0];
  std::uint32_t votes = 0;
  for (std::uint32_t k = 0; k < count; k++) votes += llabs(shifts[k] - mine) <= kReach / 2;
  const std::uint32_t most = __reduce_max_sync(~0u, lane < count ? votes << 8 | lane : 0);
  return count ? shifts[most & 255] : 0;
}

// A window whose pairs do not all stand where they stood. `open`: which of the thread's.
template <class Entry>
__device__ void match_window(const HistoryTask& t, const Lengths& length, const Pair (&mine)[kOfThread],
                             unsigned open, Word first, std::uint32_t count) {
  __shared__ Pair pairs[kWindow];
  __shared__ bool found[kWindow];  // the pair is in the list before
  __shared__ std::uint32_t places[kPlaces], samples;
  __shared__ long long shifts[kMostSamples], shift;
  auto* const state = reinterpret_cast<PassState*>(t.pass);
  const std::uint32_t pass = state->number + 1;
  if (threadIdx.x == 0) samples = 0, state->used = pass;
  for (std::uint32_t k = threadIdx.x; k < kPlaces; k += kThreads) places[k] = kEmpty;
#pragma unroll
  for (unsigned u = 0; u < kOfThread; u++) {
    const std::uint32_t k = u * kThreads + threadIdx.x;
    pairs[k] = mine[u], found[k] = false;
  }
  __syncthreads();
#pragma unroll
  for (unsigned u = 0; u < kOfThread; u++) {
    const std::uint32_t k = u * kThreads + threadIdx.x, hash = window_hash(mine[u]);
    if (k < count && is_sample(hash)) {
      const Word b = __ldcg(t.samples_before + sample_place(t, hash));
      if (b < length.before && load_pair(t.before + b) == mine[u]) {
        const std::uint32_t at = atomicAdd(&samples, 1u);
        if (at < kMostSamples) shifts[at] = static_cast<long long>(b) - static_cast<long long>(first + k);
      }
    }
    if (!(open >> u & 1)) continue;
    std::uint32_t at = place_in_window(hash);
    while (atomicCAS(places + at, kEmpty, k) != kEmpty) at = (at + 1) % kPlaces;
  }
  __syncthreads();
  if (threadIdx.x < 32) {
    const long long agreed = agreed_shift(shifts, min(samples, kMostSamples));
    if (threadIdx.x == 0) shift = agreed;
  }
  __syncthreads();
  const long long from = max(static_cast<long long>(first) + shift - kReach, 0ll),
                  upto = min(static_cast<long long>(first + count) + shift + kReach,
                             static_cast<long long>(length.before));
  for (long long b = from + threadIdx.x; b < upto; b += kThreads) {
    const Pair p = load_pair(t.before + b);
    std::uint32_t k = 0;
    for (std::uint32_t at = place_in_window(window_hash(p)); (k = places[at]) != kEmpty && !(pairs[k] == p);)
      at = (at + 1) % kPlaces;
    if (k == kEmpty) continue;
    t.found[first + k] = static_cast<std::uint32_t>(b), t.marks[b] = static_cast<std::uint8_t>(pass);
    found[k] = true;
  }
  __syncthreads();
#pragma unroll
  for (unsigned u = 0; u < kOfThread; u++) {
    const std::uint32_t k = u * kThreads + threadIdx.x;
    if ((open >> u & 1) && !found[k]) put_entry<Entry>(t, mine[u], first + k, pass);
  }
}

// The last windows first: what the search wrote last is still in L2.
template <class Entry>
__global__ void __launch_bounds__(kThreads, 6) match_windows_kernel(const __grid_constant__ HistoryTask t) {
  wait_for_previous_kernel();
  const Lengths length(t);
  if (blockIdx.x == 0 && threadIdx.x == 0) *t.count_kept = length.now;
  const Word windows = (length.now + kWindow - 1) / kWindow;
  for (Word w = blockIdx.x; w < windows; w += gridDim.x) {
    const Word first = (windows - 1 - w) * kWindow;
    const auto count = static_cast<std::uint32_t>(min(length.now - first, Word(kWindow)));
    Pair mine[kOfThread], stood[kOfThread];
#pragma unroll
    for (unsigned u = 0; u < kOfThread; u++) {  // all are asked for before the first is needed
      const Word index = first + min(u * kThreads + threadIdx.x, count - 1);
      mine[u] = load_pair(t.now + index);
      stood[u] = index < length.before ? load_pair(t.before + index) : Pair{kEmpty, kEmpty};
    }
    unsigned open = 0;
#pragma unroll
    for (unsigned u = 0; u < kOfThread; u++) {
      const std::uint32_t k = u * kThreads + threadIdx.x;
      if (k >= count) continue;
      const bool here = stood[u] == mine[u];
      // To be evicted first: the lists are what is needed in L2.
      __stcs(t.found + first + k, here ? static_cast<std::uint32_t>(first + k) : kNoContact);
      open |= unsigned(!here) << u;
      const std::uint32_t hash = window_hash(mine[u]);
      if (is_sample(hash)) t.samples_now[sample_place(t, hash)] = static_cast<std::uint32_t>(first + k);
    }
    if (__syncthreads_or(open != 0)) match_window<Entry>(t, length, mine, open, first, count);
  }
}

// The pairs of the list before that no window found, among those of the list that are left.
template <class Entry>
__global__ void __launch_bounds__(kRestThreads) match_rest_kernel(const __grid_constant__ HistoryTask t) {
  wait_for_previous_kernel();
  auto* const state = reinterpret_cast<PassState*>(t.pass);
  const std::uint32_t pass = state->number + 1;
  if (state->used != pass) return;
  const auto* const table = static_cast<const Entry*>(t.table);
  const auto* const marks = reinterpret_cast<const std::uint32_t*>(t.marks);
  const Lengths length(t);
  for (Word first = (blockIdx.x * Word(kRestThreads) + threadIdx.x) * 4; first < length.before;
       first += gridDim.x * Word(kRestThreads) * 4) {
    const std::uint32_t four = marks[first / 4];
    for (unsigned u = 0; u < 4; u++) {
      const Word b = first + u;
      if (b >= length.before || (four >> 8 * u & 255) == pass) continue;
      const Pair p = load_pair(t.before + b);
      if (b < length.now && load_pair(t.now + b) == p) continue;
      Entry entry;
      for (Word at = pair_hash(p.i, p.j) & t.mask; (entry = __ldcg(table + at)) >> t.index_bits == pass;
           at = (at + 1) & t.mask) {
        const Word k = entry & ((Word(1) << t.index_bits) - 1);
        if (!(load_pair(t.now + k) == p)) continue;
        t.found[k] = static_cast<std::uint32_t>(b);
        break;
      }
    }
  }
  __syncthreads();
  if (threadIdx.x == 0 && atomicInc(&state->blocks_done, gridDim.x - 1) + 1 == gridDim.x) state->number++;
}

}  // namespace

History::History(MemoryBook& book)
    : found_(book, "the history of contacts"),
      table_(book, "the history of contacts"),
      marks_(book, "the history of contacts"),
      pass_(book, "the history of contacts"),
      samples_(book, "the history of contacts"),
      counts_(book, "the history of contacts"),
      known_{kUnknown, kUnknown} {}

void History::begin(const PairList& before, cudaStream_t stream) {
  if (before.count >= kNoContact)
    throw Error("the list of the call before has " + std::to_string(before.count) +
                " contacts, and a history can number 2^32 - 2: ask for it box by box (CallOptions::own)");
  Word* const counts = counts_.reserve(3);
  if (known_[now_] != before.count)
    cuda_check(cudaMemcpyAsync(counts + now_, &before.count, sizeof(Word), cudaMemcpyHostToDevice, stream),
               "begin the history");
  known_[now_] = before.count;
  now_ = 1 - now_, known_[now_] = kUnknown, before_ = before;
}

// The memory for a list of so many pairs.
void History::reserve(std::uint64_t capacity) {
  const std::uint64_t places = std::bit_ceil(capacity + capacity / 4 + kWindow),
                      marks = (before_.count + 3) & ~std::uint64_t(3);
  found_.reserve(capacity);
  if (places <= places_ && marks <= marks_.capacity()) return;
  last_pass_ = 0;  // all is cleared
  if (places > places_) {
    places_ = 0;  // until the memory is there
    table_.reserve(places * (places <= kSmallTable ? sizeof(std::uint32_t) : sizeof(Word)));
    samples_.reserve(2 * std::max<std::uint64_t>(places >> kSampleBits, 1));
    places_ = places;
  }
  marks_.reserve(marks + marks / 8), pass_.reserve(sizeof(PassState) / sizeof(std::uint32_t));
}

HistoryTask History::task(const Pair* now, std::uint64_t capacity, const Word* count) {
  reserve(capacity);
  const std::uint64_t samples = std::max<std::uint64_t>(places_ >> kSampleBits, 1);
  HistoryTask t;
  t.now = now, t.before = before_.pairs, t.found = found_.data();
  t.capacity = capacity, t.count = count;
  t.count_kept = counts_.data() + now_, t.count_before = counts_.data() + (1 - now_);
  t.table = table_.data(), t.mask = places_ - 1, t.marks = marks_.data(), t.pass = pass_.data();
  t.index_bits = places_ <= kSmallTable ? static_cast<std::uint32_t>(std::bit_width(t.mask)) : 32;
  t.samples_now = samples_.data() + static_cast<unsigned>(now_) * samples;
  t.samples_before = samples_.data() + static_cast<unsigned>(1 - now_) * samples;
  t.sample_mask = static_cast<std::uint32_t>(samples - 1);
  return t;
}

void History::begin_pass(const HistoryTask& t, cudaStream_t stream) {
  if (++pass_number_ > last_pass_) {
    const auto clear = [&](auto& buffer) {
      cuda_check(cudaMemsetAsync(buffer.data(), 0, buffer.capacity() * sizeof *buffer.data(), stream),
                 "clear the history");
    };
    clear(table_), clear(marks_), clear(pass_);
    if (last_pass_ == 0) clear(samples_);
    pass_number_ = 1;
    last_pass_ = t.index_bits == 32 ? kMostPasses : std::min(kMostPasses, (1u << (32 - t.index_bits)) - 1);
  }
}

void History::enqueue(const HistoryTask& task, int processors, cudaStream_t stream) {
  const auto run = [&]<class Entry>() {
    const auto blocks = static_cast<unsigned>(std::clamp<std::uint64_t>(
        (task.capacity + kWindow - 1) / kWindow, 1, kMostBlocks * static_cast<unsigned>(processors)));
    launch_overlapped(match_windows_kernel<Entry>, {blocks, kThreads}, stream, task);
    launch_overlapped(match_rest_kernel<Entry>,
                      {(blocks * kThreads + kRestThreads - 1) / kRestThreads, kRestThreads}, stream, task);
  };
  if (task.index_bits < 32)
    run.operator()<std::uint32_t>();
  else
    run.operator()<Word>();
}

void History::match(const PairList& now, int processors, cudaStream_t stream) {
  if (now.count == 0) return;
  Word* const count = counts_.data() + 2;
  cuda_check(cudaMemcpyAsync(count, &now.count, sizeof(Word), cudaMemcpyHostToDevice, stream),
             "begin the history");
  const HistoryTask t = task(now.pairs, now.count, count);
  begin_pass(t, stream);
  enqueue(t, processors, stream);
  cuda_check(cudaStreamSynchronize(stream), "find the contacts of the call before");
}

const std::uint32_t* History::end(std::uint64_t count) {
  if (count > 0) known_[now_] = count;  // where there are none, perhaps nothing was enqueued
  return found_.data();
}

}  // namespace padder::detect::cuda
