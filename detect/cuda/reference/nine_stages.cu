// SPDX-License-Identifier: MIT
#include "detect/cuda/reference/nine_stages.h"

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>

#include "detect/cuda/device/each.h"

namespace padder::detect::cuda {
namespace {

std::uint64_t value_at(const std::uint64_t* p, cudaStream_t stream) {
  std::uint64_t v = 0;
  cuda_check(cudaMemcpyAsync(&v, p, sizeof v, cudaMemcpyDeviceToHost, stream), "read a count");
  cuda_check(cudaStreamSynchronize(stream), "run the nine stages");
  return v;
}

struct HeadOfBin {  // is entry k the first of its bin?
  const std::uint64_t* bin;
  __device__ bool operator()(std::uint64_t k) const { return k == 0 || bin[k - 1] != bin[k]; }
};

// Every pair of one active bin: by one thread, as in the paper.
template <class F>
__device__ void pairs_of_bin(const DeviceSpheres& source, const StageGrid& grid, const Region& own,
                             std::uint64_t start, std::uint64_t end, std::uint64_t bin,
                             const std::uint32_t* object, F f) {
  for (std::uint64_t a = start; a < end; a++) {
    const std::uint32_t i = object[a];
    const Sphere si = source.sphere(i);
    const Filter fi = source.filter(i);
    const std::uint32_t world = source.world_of(i);
    for (std::uint64_t b = a + 1; b < end; b++) {
      const std::uint32_t j = object[b];
      if (j != i &&
          reports(grid, bin, si, source.sphere(j), fi, source.filter(j), world, source.world_of(j), own))
        f(min(i, j), max(i, j));
    }
  }
}

}  // namespace

Stages::Stages(MemoryBook& book)
    : T_(book, "array T"),
      S_(book, "array S"),
      B_bin_(book, "array B"),
      B_bin_sorted_(book, "array B"),
      C_start_(book, "array C"),
      C_start_sorted_(book, "array C"),
      C_end_(book, "array C"),
      C_bin_(book, "array C"),
      D_(book, "array D"),
      E_(book, "array E"),
      B_object_(book, "array B"),
      B_object_sorted_(book, "array B"),
      C_order_(book, "array C"),
      C_order_sorted_(book, "array C"),
      heads_(book, "array C"),
      scratch_(book, "sorting") {}

std::uint64_t Stages::count_bins(const DeviceSpheres& source, const StageGrid& grid, cudaStream_t stream) {
  source_ = source, grid_ = grid;
  std::uint64_t* T = T_.reserve(source.count);
  each(source.count, stream, "count the bins", [source, grid, T] __device__(std::uint64_t k) {
    T[k] = touched_count(touched_bins(grid, source.sphere(static_cast<std::uint32_t>(k))));
  });
  return source.count;
}

std::uint64_t Stages::scan_bins(cudaStream_t stream) {
  std::uint64_t *T = T_.data(), *S = S_.reserve(source_.count);
  std::size_t bytes = 0;
  cuda_check(cub::DeviceScan::InclusiveSum(nullptr, bytes, T, S, source_.count, stream), "scan array T");
  cuda_check(cub::DeviceScan::InclusiveSum(scratch_.reserve(bytes), bytes, T, S, source_.count, stream),
             "scan array T");
  return entries_ = source_.count ? value_at(S + source_.count - 1, stream) : 0;
}

void Stages::fill_bins(cudaStream_t stream) {
  std::uint64_t *T = T_.data(), *S = S_.data(), *bin = B_bin_.reserve(entries_);
  std::uint32_t* object = B_object_.reserve(entries_);
  const DeviceSpheres source = source_;
  const StageGrid grid = grid_;
  each(source.count, stream, "fill array B", [=] __device__(std::uint64_t k) {
    const TouchedBins t = touched_bins(grid, source.sphere(static_cast<std::uint32_t>(k)));
    std::uint64_t at = S[k] - T[k];
    for (std::int64_t z = t.low[2]; z <= t.high[2]; z++)
      for (std::int64_t y = t.low[1]; y <= t.high[1]; y++)
        for (std::int64_t x = t.low[0]; x <= t.high[0]; x++)
          bin[at] = bin_number(grid, x, y, z), object[at++] = static_cast<std::uint32_t>(k);
  });
}

void Stages::sort_by_bin(cudaStream_t stream) {
  std::uint64_t *bin = B_bin_.data(), *bin_sorted = B_bin_sorted_.reserve(entries_);
  std::uint32_t *object = B_object_.data(), *object_sorted = B_object_sorted_.reserve(entries_);
  const double numbers = static_cast<double>(grid_.side[0]) * static_cast<double>(grid_.side[1]) *
                         static_cast<double>(grid_.side[2]);
  int bits = 1;
  while (bits < 64 && std::ldexp(1.0, bits) < numbers) bits++;
  std::size_t bytes = 0;
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, bin, bin_sorted, object, object_sorted, entries_,
                                             0, bits, stream),
             "sort array B");
  cuda_check(cub::DeviceRadixSort::SortPairs(scratch_.reserve(bytes), bytes, bin, bin_sorted, object,
                                             object_sorted, entries_, 0, bits, stream),
             "sort array B");
}

void Stages::find_starts(cudaStream_t stream) {
  bins_ = 0;
  if (entries_ == 0) return;
  const std::uint64_t* bin = B_bin_sorted_.data();
  std::uint64_t* heads = heads_.reserve(entries_ + 1);
  const thrust::counting_iterator<std::uint64_t> entry(0);
  std::size_t bytes = 0;
  const HeadOfBin head{bin};
  std::uint64_t* const count = C_start_sorted_.reserve(1);
  cuda_check(cub::DeviceSelect::If(nullptr, bytes, entry, heads, count, entries_, head, stream),
             "find array C");
  cuda_check(
      cub::DeviceSelect::If(scratch_.reserve(bytes), bytes, entry, heads, count, entries_, head, stream),
      "find array C");
  bins_ = value_at(count, stream);
  std::uint64_t *start = C_start_.reserve(bins_), *end = C_end_.reserve(bins_),
                *number = C_bin_.reserve(bins_);
  const std::uint64_t bins = bins_, entries = entries_;
  each(bins, stream, "find array C", [=] __device__(std::uint64_t c) {
    const std::uint64_t from = heads[c], to = c + 1 < bins ? heads[c + 1] : entries;
    start[c] = to - from > 1 ? from : kInactive, end[c] = to, number[c] = bin[from];
  });
}

void Stages::push_inactive(cudaStream_t stream) {
  active_ = 0;
  if (bins_ == 0) return;
  if (bins_ > 0xffffffffull)
    throw Error("more than 2^32 bins are touched: choose larger bins or the fast path");
  std::uint64_t *start = C_start_.data(), *sorted = C_start_sorted_.reserve(bins_);
  std::uint32_t *order = C_order_.reserve(bins_), *order_sorted = C_order_sorted_.reserve(bins_);
  each(bins_, stream, "sort array C",
       [order] __device__(std::uint64_t c) { order[c] = static_cast<std::uint32_t>(c); });
  std::size_t bytes = 0;
  cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, start, sorted, order, order_sorted, bins_, 0, 64,
                                             stream),
             "sort array C");
  cuda_check(cub::DeviceRadixSort::SortPairs(scratch_.reserve(bytes), bytes, start, sorted, order,
                                             order_sorted, bins_, 0, 64, stream),
             "sort array C");
  // The index of the last valid entry.
  std::uint64_t* last = heads_.data();
  const std::uint64_t bins = bins_;
  cuda_check(cudaMemsetAsync(last, 0, sizeof *last, stream), "sort array C");
  each(bins, stream, "count the active bins", [=] __device__(std::uint64_t c) {
    if (sorted[c] != kInactive && (c + 1 == bins || sorted[c + 1] == kInactive)) *last = c + 1;
  });
  active_ = value_at(last, stream);
}

void Stages::count_contacts(const Region& own, cudaStream_t stream) {
  own_ = own;
  std::uint64_t *D = D_.reserve(active_), *start = C_start_sorted_.data(), *end = C_end_.data(),
                *number = C_bin_.data();
  const std::uint32_t *order = C_order_sorted_.data(), *object = B_object_sorted_.data();
  const DeviceSpheres source = source_;
  const StageGrid grid = grid_;
  each(active_, stream, "count the contacts", [=] __device__(std::uint64_t c) {
    std::uint64_t n = 0;
    pairs_of_bin(source, grid, own, start[c], end[order[c]], number[order[c]], object,
                 [&n](std::uint32_t, std::uint32_t) { n++; });
    D[c] = n;
  });
}

std::uint64_t Stages::scan_contacts(cudaStream_t stream) {
  contacts_ = 0;
  if (active_ == 0) return 0;
  std::uint64_t *D = D_.data(), *E = E_.reserve(active_);
  std::size_t bytes = 0;
  cuda_check(cub::DeviceScan::InclusiveSum(nullptr, bytes, D, E, active_, stream), "scan array D");
  cuda_check(cub::DeviceScan::InclusiveSum(scratch_.reserve(bytes), bytes, D, E, active_, stream),
             "scan array D");
  return contacts_ = value_at(E + active_ - 1, stream);
}

void Stages::write_contacts(Pair* F, cudaStream_t stream) {
  std::uint64_t *D = D_.data(), *E = E_.data(), *start = C_start_sorted_.data(), *end = C_end_.data(),
                *number = C_bin_.data();
  const std::uint32_t *order = C_order_sorted_.data(), *object = B_object_sorted_.data();
  const DeviceSpheres source = source_;
  const StageGrid grid = grid_;
  const Region own = own_;
  each(active_, stream, "write the contacts", [=] __device__(std::uint64_t c) {
    std::uint64_t at = E[c] - D[c];
    pairs_of_bin(source, grid, own, start[c], end[order[c]], number[order[c]], object,
                 [&](std::uint32_t i, std::uint32_t j) {
                   F[at++] = {i, j};
                 });
  });
}

namespace {

template <class T>
std::vector<T> copied(const T* p, std::uint64_t n, cudaStream_t stream) {
  std::vector<T> v(n);
  if (n)
    cuda_check(cudaMemcpyAsync(v.data(), p, n * sizeof(T), cudaMemcpyDeviceToHost, stream),
               "copy the arrays");
  cuda_check(cudaStreamSynchronize(stream), "copy the arrays");
  return v;
}

}  // namespace

Arrays Stages::arrays(const Pair* F, cudaStream_t stream) const {
  Arrays a;
  a.grid = grid_;
  a.T = copied(T_.data(), source_.count, stream);
  a.S = copied(S_.data(), source_.count, stream);
  const auto entries = [&](const std::uint64_t* bin, const std::uint32_t* object) {
    const auto bins = copied(bin, entries_, stream);
    const auto objects = copied(object, entries_, stream);
    std::vector<BinEntry> B(entries_);
    for (std::size_t k = 0; k < B.size(); k++) B[k] = {bins[k], objects[k]};
    return B;
  };
  a.B = entries(B_bin_.data(), B_object_.data());
  a.B_sorted = entries(B_bin_sorted_.data(), B_object_sorted_.data());
  const auto start = copied(C_start_.data(), bins_, stream),
             sorted = copied(C_start_sorted_.data(), bins_, stream),
             end = copied(C_end_.data(), bins_, stream), number = copied(C_bin_.data(), bins_, stream);
  const auto order = copied(C_order_sorted_.data(), bins_, stream);
  for (std::size_t c = 0; c < bins_; c++) {
    a.C.push_back({start[c], end[c], number[c]});
    a.C_sorted.push_back({sorted[c], end[order[c]], number[order[c]]});
  }
  a.active = active_;
  a.D = copied(D_.data(), active_, stream);
  a.E = copied(E_.data(), active_, stream);
  a.F = copied(F, contacts_, stream);
  return a;
}

}  // namespace padder::detect::cuda
