// SPDX-License-Identifier: MIT
// The summary of the spheres: bounds, radii, the first faulty sphere; by octaves of size where radii differ.
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "detect/cuda/input/survey.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

using Word = unsigned long long;
constexpr int kThreads = 256, kOctaveWords = OctaveBounds::kWords;
// Blocks of the survey. The same number on every device, because each gives one term of the sum of the radii:
// so the mean, and the bins that follow from it, are the same everywhere.
constexpr int kBlocks = 528;
constexpr int kAll = kBounds + kOctaves * kOctaveWords;

__device__ Word warp_min(Word v) {
  for (int d = 16; d; d >>= 1) v = min(v, __shfl_xor_sync(~0u, v, d));
  return v;
}
__device__ Word warp_max(Word v) {
  for (int d = 16; d; d >>= 1) v = max(v, __shfl_xor_sync(~0u, v, d));
  return v;
}

// Blocks of the survey. Few spheres get few blocks: each block ends with atomic operations on the same words,
// and blocks without spheres would only add to the queue.
unsigned blocks_of(const DeviceSpheres& source) {
  return static_cast<unsigned>(
      std::clamp<std::uint64_t>((source.count + kThreads - 1ull) / kThreads, 1, kBlocks));
}

__global__ void begin_kernel(Word* v, int minima, int count, int period, int head) {
  const int k = threadIdx.x + blockIdx.x * blockDim.x;
  if (k < head) v[k - head] = 0;
  if (k < count) v[k] = k % period < minima ? ~0ull : 0;
}

// The sum of the radii is made in a fixed order (blocks, then the host), so that the mean is the same in
// every run.
__global__ void __launch_bounds__(kThreads) survey_kernel(DeviceSpheres source, Word* out, double* sums) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double r_min = INFINITY, r_max = 0, need = 0, extent = 0, sum = 0;
  Word fault = ~0ull;
  for (std::uint64_t k = blockIdx.x * kThreads + threadIdx.x; k < source.count; k += gridDim.x * kThreads) {
    const Sphere s = source.searched(static_cast<std::uint32_t>(k));
    if (fault_of(s) != Fault::none) {
      fault = min(fault, static_cast<Word>(k));
      continue;
    }
    low[0] = smaller(low[0], s.x), low[1] = smaller(low[1], s.y), low[2] = smaller(low[2], s.z);
    high[0] = larger(high[0], s.x), high[1] = larger(high[1], s.y), high[2] = larger(high[2], s.z);
    r_min = smaller(r_min, s.r), r_max = larger(r_max, s.r), sum += s.r;
    need = larger(need, need_of(s));
    extent = larger(extent, larger(magnitude(s.x), larger(magnitude(s.y), magnitude(s.z))));
  }
  const Word minima[5] = {ordered(low[0]), ordered(low[1]), ordered(low[2]), ordered(r_min), fault};
  const Word maxima[6] = {ordered(high[0]), ordered(high[1]), ordered(high[2]),
                          ordered(r_max),   ordered(need),    ordered(extent)};
  const bool first = (threadIdx.x & 31) == 0;
  __shared__ Word of_warps[kBounds][kThreads / 32];
  for (int k = 0; k < 5; k++) {
    const Word v = warp_min(minima[k]);
    if (first) of_warps[k][threadIdx.x >> 5] = v;
  }
  for (int k = 0; k < 6; k++) {
    const Word v = warp_max(maxima[k]);
    if (first) of_warps[5 + k][threadIdx.x >> 5] = v;
  }
  __shared__ double shared[kThreads];
  shared[threadIdx.x] = sum;
  for (int d = kThreads / 2; d; d >>= 1) {
    __syncthreads();
    if (threadIdx.x < d) shared[threadIdx.x] += shared[threadIdx.x + d];
  }
  if (const int k = threadIdx.x; k < kBounds) {
    Word v = of_warps[k][0];
    for (int w = 1; w < kThreads / 32; w++) v = k < 5 ? min(v, of_warps[k][w]) : max(v, of_warps[k][w]);
    if (k < 5)
      atomicMin(out + k, v);
    else
      atomicMax(out + k, v);
  }
  if (threadIdx.x == 0) sums[blockIdx.x] = shared[0];
}

// Finds the words of OctaveBounds::kWords for each octave, of spheres in any format.
__global__ void __launch_bounds__(kThreads) octave_kernel(DeviceSpheres source, int top, Word* out) {
  __shared__ Word v[kOctaves * kOctaveWords];
  __shared__ std::uint32_t counts[kOctaves];
  for (int k = threadIdx.x; k < kOctaves; k += kThreads) counts[k] = 0;
  for (int k = threadIdx.x; k < kOctaves * kOctaveWords; k += kThreads)
    v[k] = k % kOctaveWords < 3 ? ~0ull : 0;
  __syncthreads();
  for (std::uint64_t k = blockIdx.x * kThreads + threadIdx.x; k < source.count; k += kBlocks * kThreads) {
    const Sphere s = source.searched(static_cast<std::uint32_t>(k));
    const double need = need_of(s);
    const int octave = octave_of(top, need);
    Word* o = v + octave * kOctaveWords;
    const Word low[3] = {ordered(s.x), ordered(s.y), ordered(s.z)}, high[2] = {ordered(s.r), ordered(need)};
    for (int c = 0; c < 3; c++) {  // reading first spares nearly every atomic operation
      if (low[c] < *static_cast<volatile Word*>(o + c)) atomicMin(o + c, low[c]);
      if (low[c] > *static_cast<volatile Word*>(o + 3 + c)) atomicMax(o + 3 + c, low[c]);
    }
    for (int c = 0; c < 2; c++)
      if (high[c] > *static_cast<volatile Word*>(o + 6 + c)) atomicMax(o + 6 + c, high[c]);
    const std::uint32_t peers = __match_any_sync(__activemask(), octave);
    if ((threadIdx.x & 31) == __ffs(peers) - 1) atomicAdd(counts + octave, __popc(peers));
  }
  __syncthreads();
  for (int k = threadIdx.x; k < kOctaves; k += kThreads) v[k * kOctaveWords + 8] = counts[k];
  __syncthreads();
  for (int k = threadIdx.x; k < kOctaves * kOctaveWords; k += kThreads) {
    if (v[k / kOctaveWords * kOctaveWords + 8] == 0) continue;
    const int c = k % kOctaveWords;
    if (c < 3)
      atomicMin(out + k, v[k]);
    else if (c < 8)
      atomicMax(out + k, v[k]);
    else
      atomicAdd(out + k, v[k]);
  }
}

// The same for packed float spheres, in float. Alone: all lie in one array.
template <bool Alone>
__global__ void __launch_bounds__(kThreads, tuning::kOctaveBlocks)
    float_octave_kernel(const __grid_constant__ DeviceSpheres source, int top, Word* out) {
  __shared__ OctaveBounds bounds;
  OctaveTaker taker;
  bounds.begin();
  __syncthreads();
  const std::uint32_t count = source.count;
  for (std::uint64_t from = blockIdx.x * kThreads; from < count; from += gridDim.x * kThreads) {
    const std::uint64_t k = from + threadIdx.x;
    const float4* const at = Alone ? static_cast<const float4*>(source.centers) + k
                                   : source.float_sphere(static_cast<std::uint32_t>(k));
    const float4 s = k < count ? __ldg(at) : make_float4(0, 0, 0, 0);
    if (from == blockIdx.x * kThreads) taker.begin(top, s, k < count);
    if (k < count) taker.take(bounds, top, s);
  }
  taker.give(bounds);
  __syncthreads();
  bounds.give(out);
}

// Counts the spheres of each exponent_of(need) + 1023.
__global__ void __launch_bounds__(kThreads) exponent_kernel(DeviceSpheres source, Word* out) {
  __shared__ std::uint32_t counts[kExponents];
  for (int k = threadIdx.x; k < kExponents; k += kThreads) counts[k] = 0;
  __syncthreads();
  for (std::uint64_t k = blockIdx.x * kThreads + threadIdx.x; k < source.count; k += gridDim.x * kThreads)
    atomicAdd(counts + exponent_of(need_of(source.searched(static_cast<std::uint32_t>(k)))) + 1023, 1u);
  __syncthreads();
  for (int k = threadIdx.x; k < kExponents; k += kThreads)
    if (counts[k]) atomicAdd(out + k, static_cast<Word>(counts[k]));
}

// Counts for Summary::near: probes of each group, then pairs of each two groups and distance. A thread has a
// probe, a block some targets. The report that brings the counts to the host clears them.
constexpr int kProbes = 128, kBlockTargets = 8;  // of a block
__host__ __device__ constexpr int probe_counts(int groups) { return groups + groups * groups * groups; }
constexpr int kMostCounts = probe_counts(kMaxLevels);
static_assert(sizeof(SizeGroups) / 4 <= kProbes);
// 32 registers a thread: with 40 its blocks find no room beside those of the search, which then waits.
__global__ void __launch_bounds__(kProbes, 16)
    probe_kernel(const __grid_constant__ DeviceSpheres source, const __grid_constant__ SizeGroups given,
                 Draw draw, std::uint32_t* sums) {
  __shared__ std::uint32_t counts[kMostCounts];
  __shared__ Sphere target[kBlockTargets];
  __shared__ std::uint32_t target_number[kBlockTargets];
  __shared__ int target_group[kBlockTargets];
  // Constant memory would answer a warp's lanes one after the other.
  __shared__ alignas(8) std::uint32_t words[sizeof(SizeGroups) / 4];
  const auto& groups = *reinterpret_cast<const SizeGroups*>(words);
  const int n = given.count, all = probe_counts(n);
  for (int k = threadIdx.x; k < all; k += kProbes) counts[k] = 0;
  if (threadIdx.x < sizeof(SizeGroups) / 4)
    words[threadIdx.x] = reinterpret_cast<const std::uint32_t*>(&given)[threadIdx.x];
  __syncthreads();
  const auto group_of = [&](const Sphere& s) { return groups.of_octave[octave_of(groups.top, need_of(s))]; };
  const std::uint32_t targets = targets_of(source.count, draw), probes = probes_of(source.count, draw),
                      begin = blockIdx.x * kBlockTargets,
                      some = targets > begin ? min(targets - begin, kBlockTargets) : 0;
  if (threadIdx.x < some) {
    const std::uint32_t number = drawn_at(begin + threadIdx.x, part_of_targets(source.count, draw));
    const Sphere s = source.searched(number);
    target[threadIdx.x] = s, target_number[threadIdx.x] = number, target_group[threadIdx.x] = group_of(s);
  }
  const std::uint32_t mine = blockIdx.y * kProbes + threadIdx.x;
  const bool has_probe = mine < probes;
  const std::uint32_t number = has_probe ? drawn_at(mine, part_of_probes(source.count, draw)) : 0;
  const Sphere probe = source.searched(number);
  const int group = group_of(probe);
  __syncthreads();
  if (has_probe && blockIdx.x == 0) atomicAdd(counts + group, 1u);
  for (std::uint32_t k = 0; k < some; k++) {
    const int distance = first_within(groups, chebyshev_distance(probe, target[k]));
    const bool near = has_probe && distance < n && target_number[k] != number;
    if (!__any_sync(~0u, near)) continue;
    // Most lanes count the same: one adds for all of them.
    const int at = near ? n + (group * n + target_group[k]) * n + distance : -1;
    const std::uint32_t same = __match_any_sync(~0u, at);
    if (near && (threadIdx.x & 31) == __ffs(same) - 1) atomicAdd(counts + at, __popc(same));
  }
  __syncthreads();
  for (int k = threadIdx.x; k < all; k += kProbes)
    if (counts[k]) atomicAdd(sums + k, counts[k]);
}

}  // namespace

Surveyor::Surveyor(MemoryBook& book)
    : values_(book, "the summary"),
      host_values_(book, "the summary", true),
      sums_(book, "the summary"),
      host_sums_(book, "the summary", true),
      exponents_(book, "the summary"),
      probes_(book, "the summary"),
      host_probes_(book, "the summary", true) {}

std::uint64_t Surveyor::words() { return kHead + kAll; }

void Surveyor::begin_bounds(Word* bounds, cudaStream_t stream) {
  begin_kernel<<<1, 32, 0, stream>>>(bounds, 5, kBounds, kBounds, kHead);
}

void Surveyor::begin(const DeviceSpheres& source, bool octaves, int top, int processors,
                     cudaStream_t stream) {
  Word* v = head() + kHead;
  begin_bounds(v, stream);
  survey_kernel<<<blocks_of(source), kThreads, 0, stream>>>(source, v, sums_.reserve(kBlocks));
  if (octaves) gather_octaves(source, gather(true, top), processors, stream);
  cuda_launched("survey the spheres");
}

void Surveyor::gather_octaves(const DeviceSpheres& source, const Gather& gather, int processors,
                              cudaStream_t stream) {
  begin_kernel<<<3, 256, 0, stream>>>(gather.octaves, 3, kOctaves * kOctaveWords, kOctaveWords, 0);
  const bool floats = source.packed && !source.wide && source.placed == 0;
  const auto blocks = static_cast<unsigned>(processors * tuning::kOctaveBlocks);
  if (floats && source.count <= source.own)
    float_octave_kernel<true><<<blocks, kThreads, 0, stream>>>(source, gather.top, gather.octaves);
  else if (floats)
    float_octave_kernel<false><<<blocks, kThreads, 0, stream>>>(source, gather.top, gather.octaves);
  else
    octave_kernel<<<kBlocks, kThreads, 0, stream>>>(source, gather.top, gather.octaves);
}

void Surveyor::read_head(Report& report) {
  report.add(head(), host_values_.reserve(words()), kHead * sizeof(Word));
}

void Surveyor::read(const DeviceSpheres& source, bool octaves, bool along, Report& report) {
  report.add(head(), host_values_.reserve(words()), (kHead + (octaves ? kAll : kBounds)) * sizeof(Word));
  if (!along)
    report.add(sums_.reserve(kBlocks), host_sums_.reserve(kBlocks), blocks_of(source) * sizeof(double));
}

bool Surveyor::finish(const DeviceSpheres& source, bool octaves, int top, bool along, Summary& s,
                      int above) const {
  const Word* host = host_values_.data() + kHead;
  s = Summary{};
  s.count = source.count;
  s.first_fault = host[kFault];
  for (int k = 0; k < 3; k++) s.low[k] = unordered(host[kLow + k]), s.high[k] = unordered(host[kHigh + k]);
  s.radius_min = unordered(host[kRadiusMin]), s.radius_max = unordered(host[kRadiusMax]);
  // What was gathered along shows that there is a fault, but not which sphere has it.
  bool finite = s.radius_min >= 0 && std::isfinite(s.radius_max);
  for (int k = 0; k < 3; k++) finite = finite && std::isfinite(s.low[k]) && std::isfinite(s.high[k]);
  if (along && s.first_fault == ~std::uint64_t(0) && !finite) return false;
  if (along) {  // both grow with the radius and the coordinates, so the largest values follow from the bounds
    for (int k = 0; k < 3; k++)
      s.extent = larger(s.extent, larger(magnitude(s.low[k]), magnitude(s.high[k])));
    s.need_max = need_of({s.extent, 0, 0, s.radius_max});
  } else {
    s.need_max = unordered(host[kNeedMax]), s.extent = unordered(host[kExtent]);
  }
  for (unsigned k = 0; k < blocks_of(source) && !along; k++) s.radius_sum += host_sums_.data()[k];
  if (s.first_fault != ~std::uint64_t(0)) return true;
  if (octaves != needs_octaves(s) || (octaves && top != exponent_of(s.need_max) - above)) return false;
  if (!octaves) return true;
  host += kBounds;
  for (int o = 0; o < kOctaves; o++, host += kOctaveWords) {
    if (host[8] == 0) continue;
    Summary::Octave& octave = s.octave[o];
    octave.count = host[8];
    for (int k = 0; k < 3; k++) octave.low[k] = unordered(host[k]), octave.high[k] = unordered(host[3 + k]);
    octave.radius_max = unordered(host[6]), octave.need_max = unordered(host[7]);
  }
  s.octaves_known = true, s.above = above;
  return true;
}

void Surveyor::probe(const DeviceSpheres& source, const SizeGroups& groups, Draw draw, cudaStream_t stream) {
  const auto blocks = [](std::uint32_t all, std::uint32_t of_block) {
    return (all + of_block - 1) / of_block;
  };
  const std::uint32_t targets = targets_of(source.count, draw), probes = probes_of(source.count, draw);
  const dim3 grid(blocks(std::max(targets, 1u), kBlockTargets), blocks(std::max(probes, 1u), kProbes));
  probe_kernel<<<grid, kProbes, 0, stream>>>(source, groups, draw, probes_.data());
  cuda_launched("survey the spheres");
}

void Surveyor::read_probes(const SizeGroups& groups, Report& report) {
  const auto words = static_cast<std::uint64_t>(probe_counts(groups.count) + 1) / 2;
  report.add_and_clear(probes_.data(), host_probes_.data(), words * sizeof(Word));
}

std::shared_ptr<const Neighbourhood> Surveyor::probed(const SizeGroups& groups, std::uint32_t spheres,
                                                      Draw draw) const {
  const auto made = std::make_shared<Neighbourhood>();
  Neighbourhood& n = *made;
  n.groups = groups, n.targets = targets_of(spheres, draw);
  const std::uint32_t* count = host_probes_.data();
  for (int i = 0; i < groups.count; i++) n.probes[i] = *count++;
  for (int i = 0; i < groups.count; i++)
    for (int k = 0; k < groups.count; k++)
      for (int d = 0; d < groups.count; d++) n.pairs[i][k][d] = *count++;
  return made;
}

std::shared_ptr<const Neighbourhood> Surveyor::neighbourhood(const DeviceSpheres& source, const Summary& s,
                                                             Draw draw, cudaStream_t stream) {
  if (!s.octaves_known) return {};
  if (!probes_.data()) {
    constexpr std::uint64_t kCounts = kMostCounts + 1;  // whole words of 8 bytes are read
    cuda_check(cudaMemsetAsync(probes_.reserve(kCounts), 0, kCounts * sizeof(std::uint32_t), stream),
               "clear the counters");
    host_probes_.reserve(kCounts);
  }
  Report report;
  const SizeGroups groups = size_groups(s);
  read_probes(groups, report);
  report.expect();
  probe(source, groups, draw, stream);
  report.send(stream);
  report.arrived(stream, "survey the spheres");
  return probed(groups, source.count, draw);
}

// Finds Summary::above, for sizes that differ by more than kOctaves octaves.
int Surveyor::find_above(const DeviceSpheres& source, cudaStream_t stream) {
  Word* const device = exponents_.reserve(kExponents);
  std::vector<std::uint64_t> found(kExponents);
  cuda_check(cudaMemsetAsync(device, 0, kExponents * sizeof(Word), stream), "clear the counters");
  exponent_kernel<<<blocks_of(source), kThreads, 0, stream>>>(source, device);
  cuda_launched("survey the spheres");
  cuda_check(cudaMemcpyAsync(found.data(), device, kExponents * sizeof(Word), cudaMemcpyDeviceToHost, stream),
             "survey the spheres");
  cuda_check(cudaStreamSynchronize(stream), "survey the spheres");
  return octaves_above(std::span<const std::uint64_t, kExponents>(found));
}

Summary Surveyor::survey(const DeviceSpheres& source, int processors, cudaStream_t stream) {
  Summary s;
  const auto look = [&](bool octaves, int above) {
    const int top = octaves ? exponent_of(s.need_max) - above : 0;
    Report report;
    read(source, octaves, false, report);
    report.expect();
    begin(source, octaves, top, processors, stream);
    report.send(stream);
    report.arrived(stream, "survey the spheres");
    return finish(source, octaves, top, false, s, above);
  };
  if (look(false, 0)) return s;
  bool done = look(true, 0);
  if (done && s.octave[kOctaves - 1].count > 0) {  // the last octave holds all smaller spheres, too
    const int above = find_above(source, stream);
    if (above > 0) done = look(true, above);
  }
  if (!done) throw Error(kChanged);
  return s;
}

}  // namespace padder::detect::cuda
