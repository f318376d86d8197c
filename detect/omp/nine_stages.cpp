// SPDX-License-Identifier: MIT
// The nine stages of section 2.1 on the CPU, one function for each, in the order of the paper. They are the
// reference, written to be compared with the text and not to be fast.
#include <omp.h>

#include <numeric>

#include "detect/omp/paths.h"

namespace padder::detect::omp {
namespace {

// Calls work(thread, begin, end) with a contiguous block of 0 to n - 1 for each thread.
template <class Work>
void in_blocks(std::uint64_t n, int threads, Work work) {
#pragma omp parallel num_threads(threads)
  {
    const auto t = static_cast<std::uint64_t>(omp_get_thread_num()),
               all = static_cast<std::uint64_t>(omp_get_num_threads());
    work(t, n * t / all, n * (t + 1) / all);
  }
}

// The inclusive prefix sum: out[k] = a[0] + ... + a[k]. Returns the total.
std::uint64_t inclusive_scan(const std::uint64_t* a, std::uint64_t* out, std::uint64_t n, int threads) {
  std::vector<std::uint64_t> sum(static_cast<std::size_t>(threads) + 1, 0);
  in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
    std::uint64_t s = 0;
    for (std::uint64_t k = begin; k < end; k++) out[k] = s += a[k];
    sum[t + 1] = s;
  });
  std::partial_sum(sum.begin(), sum.end(), sum.begin());
  in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
    for (std::uint64_t k = begin; k < end; k++) out[k] += sum[t];
  });
  return n ? out[n - 1] : 0;
}

// How many of 0 to n - 1 are chosen before the block of each thread (in_blocks), and at last how many in all.
template <class Chosen>
std::vector<std::uint64_t> chosen_before(std::uint64_t n, int threads, Chosen chosen) {
  std::vector<std::uint64_t> before(static_cast<std::size_t>(threads) + 1, 0);
  in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
    std::uint64_t count = 0;
    for (std::uint64_t k = begin; k < end; k++) count += chosen(k);
    before[t + 1] = count;
  });
  std::partial_sum(before.begin(), before.end(), before.begin());
  return before;
}

// Stage 1: T[i], the number of bins object i touches.
template <class T>
void stage1(const View<T>& spheres, const StageGrid& g, std::uint64_t* counts, int threads) {
  in_blocks(spheres.count, threads, [&](std::uint64_t, std::uint64_t begin, std::uint64_t end) {
    for (std::uint64_t i = begin; i < end; i++) counts[i] = touched_count(touched_bins(g, spheres[i]));
  });
}

// Stage 2: S, the inclusive scan of T, which says where the entries of each object end.
std::uint64_t stage2(const std::uint64_t* counts, std::uint64_t* S, std::uint64_t n, int threads) {
  return inclusive_scan(counts, S, n, threads);
}

// Stage 3: B, an entry (bin, object) for each bin that an object touches.
template <class T>
void stage3(const View<T>& spheres, const StageGrid& g, const std::uint64_t* S, BinEntry* B, int threads) {
  in_blocks(spheres.count, threads, [&](std::uint64_t, std::uint64_t begin, std::uint64_t end) {
    for (std::uint64_t i = begin; i < end; i++) {
      std::uint64_t at = i ? S[i - 1] : 0;
      const TouchedBins t = touched_bins(g, spheres[i]);
      for (std::int64_t z = t.low[2]; z <= t.high[2]; z++)
        for (std::int64_t y = t.low[1]; y <= t.high[1]; y++)
          for (std::int64_t x = t.low[0]; x <= t.high[0]; x++)
            B[at++] = {bin_number(g, x, y, z), static_cast<std::uint32_t>(i)};
    }
  });
}

// Stage 4: B sorted by bin. The sort is stable, so the objects of a bin stay in order. A radix sort, least
// significant digit first.
void stage4(Buffer<BinEntry>& B, Buffer<BinEntry>& spare, std::uint64_t n, std::uint64_t bins, int threads) {
  constexpr int kDigit = 11;
  constexpr std::uint64_t kValues = 1u << kDigit;
  for (int shift = 0; shift < 64 && (bins - 1) >> shift; shift += kDigit) {
    std::vector<std::uint64_t> count(static_cast<std::size_t>(threads) * kValues, 0);
    const BinEntry* from = B.data();
    BinEntry* to = spare.data();
    in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
      std::uint64_t* mine = &count[t * kValues];
      for (std::uint64_t k = begin; k < end; k++) mine[from[k].bin >> shift & (kValues - 1)]++;
    });
    std::uint64_t sum = 0;
    for (std::uint64_t digit = 0; digit < kValues; digit++)
      for (std::uint64_t t = 0; t < static_cast<std::uint64_t>(threads); t++) {
        const std::uint64_t c = count[t * kValues + digit];
        count[t * kValues + digit] = sum;
        sum += c;
      }
    in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
      std::uint64_t* mine = &count[t * kValues];
      for (std::uint64_t k = begin; k < end; k++) to[mine[from[k].bin >> shift & (kValues - 1)]++] = from[k];
    });
    B.swap(spare);
  }
}

// Stage 5: C, where each bin starts in B: where the bin of an entry differs from that of the previous entry.
// A bin with one object is inactive. Returns the number of bins that are touched. Only these have an entry in
// C. The paper's C has one for each bin of the grid, but a sparse domain has billions of bins.
std::uint64_t stage5(const BinEntry* B, std::uint64_t n, Buffer<BinStart>& C, Buffer<BinStart>& spare,
                     int threads) {
  const auto starts = [&](std::uint64_t k) { return k == 0 || B[k].bin != B[k - 1].bin; };
  const std::vector<std::uint64_t> first = chosen_before(n, threads, starts);
  const std::uint64_t bins = first.back();
  C.resize(bins, "bins (array C)"), spare.resize(bins, "bins (array C)");
  in_blocks(n, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
    std::uint64_t at = first[t];
    for (std::uint64_t k = begin; k < end; k++)
      if (starts(k)) C[at++] = {k, 0, B[k].bin};
  });
  in_blocks(bins, threads, [&](std::uint64_t, std::uint64_t begin, std::uint64_t end) {
    for (std::uint64_t k = begin; k < end; k++) C[k].end = k + 1 < bins ? C[k + 1].start : n;
  });
  in_blocks(bins, threads, [&](std::uint64_t, std::uint64_t begin, std::uint64_t end) {
    for (std::uint64_t k = begin; k < end; k++)
      if (C[k].end - C[k].start < 2) C[k].start = kInactive;
  });
  return bins;
}

// Stage 6: moves inactive bins to the end. The starts of the others ascend already, so the paper's sort by
// start is a stable partition here. Returns the number of active bins.
std::uint64_t stage6(Buffer<BinStart>& C, Buffer<BinStart>& spare, std::uint64_t bins, int threads) {
  const auto is_active = [&](std::uint64_t k) { return C[k].start != kInactive; };
  const std::vector<std::uint64_t> first = chosen_before(bins, threads, is_active);
  const std::uint64_t active = first.back();
  in_blocks(bins, threads, [&](std::uint64_t t, std::uint64_t begin, std::uint64_t end) {
    std::uint64_t at = first[t], rest = active + (begin - first[t]);
    for (std::uint64_t k = begin; k < end; k++) spare[is_active(k) ? at++ : rest++] = C[k];
  });
  C.swap(spare);
  return active;
}

// Stages 7 and 9 both do this: for every pair of a bin that this bin reports, call report().
template <class T, class Report>
void pairs_of_bin(const View<T>& spheres, const StageGrid& g, const BinEntry* B, const BinStart& bin,
                  const Region& own, Report report) {
  for (std::uint64_t p = bin.start; p < bin.end; p++)
    for (std::uint64_t q = p + 1; q < bin.end; q++) {
      const std::uint32_t i = B[p].object, j = B[q].object;  // i < j: the sort is stable
      const Sphere si = spheres[i], sj = spheres[j];
      if (reports(g, bin.bin, si, sj, spheres.filter(i), spheres.filter(j), spheres.world_of(i),
                  spheres.world_of(j), own))
        report(i, j, si, sj);
    }
}

// Stage 7: D, the contacts of each active bin.
template <class T>
void stage7(const View<T>& spheres, const StageGrid& g, const BinEntry* B, const BinStart* C,
            std::uint64_t active, const Region& own, std::uint64_t* D, int threads) {
  const auto n = static_cast<std::int64_t>(active);
#pragma omp parallel for schedule(dynamic, 256) num_threads(threads)
  for (std::int64_t k = 0; k < n; k++) {
    std::uint64_t count = 0;
    pairs_of_bin(spheres, g, B, C[k], own, [&](auto...) { count++; });
    D[k] = count;
  }
}

// Stage 8: E, the inclusive scan of D. Its last element is the number of contacts.
std::uint64_t stage8(const std::uint64_t* D, std::uint64_t* E, std::uint64_t active, int threads) {
  return inclusive_scan(D, E, active, threads);
}

// Stage 9: F, the contacts themselves.
template <class T>
void stage9(const View<T>& spheres, const StageGrid& g, const BinEntry* B, const BinStart* C,
            std::uint64_t active, const CallOptions& options, const std::uint64_t* E, Records& F,
            int threads) {
  const auto n = static_cast<std::int64_t>(active);
#pragma omp parallel for schedule(dynamic, 256) num_threads(threads)
  for (std::int64_t k = 0; k < n; k++) {
    std::uint64_t at = k ? E[k - 1] : 0;
    pairs_of_bin(spheres, g, B, C[k], options.own,
                 [&](std::uint32_t i, std::uint32_t j, const Sphere& si, const Sphere& sj) {
                   F.write(at++, i, j, si, sj, options);
                 });
  }
}

}  // namespace

NineStages::NineStages(Budget& b) : T_(b), S_(b), D_(b), E_(b), B_(b), B_spare_(b), C_(b), C_spare_(b) {}

template <class T>
void NineStages::run(const View<T>& spheres, const Summary& summary, const CallOptions& options, int threads,
                     Records& records, Seconds& seconds, Arrays* arrays) {
  Stopwatch watch;
  const std::uint64_t n = spheres.count;
  const auto lap = [&](int stage) { seconds.stage[stage - 1] += watch.lap(); };
  const auto copy = [&](auto& to, const auto* from, std::uint64_t count) {
    if (arrays) to.assign(from, from + count);
  };
  Arrays none;
  Arrays& show = arrays ? *arrays : none;

  const StageGrid g = choose_stage_grid(summary, options.bin_size, options.margin);
  show.grid = g;
  stage1(spheres, g, T_.resize(n, "array T"), threads), lap(1);
  copy(show.T, T_.data(), n);
  const std::uint64_t entries = stage2(T_.data(), S_.resize(n, "array S"), n, threads);
  lap(2);
  copy(show.S, S_.data(), n);
  B_.resize(entries, "array B"), B_spare_.resize(entries, "sorting array B");
  stage3(spheres, g, S_.data(), B_.data(), threads), lap(3);
  copy(show.B, B_.data(), entries);
  stage4(B_, B_spare_, entries, g.side[0] * g.side[1] * g.side[2], threads), lap(4);
  copy(show.B_sorted, B_.data(), entries);
  const std::uint64_t bins = stage5(B_.data(), entries, C_, C_spare_, threads);
  lap(5);
  copy(show.C, C_.data(), bins);
  const std::uint64_t active = stage6(C_, C_spare_, bins, threads);
  lap(6);
  copy(show.C_sorted, C_.data(), bins);
  show.active = active;
  stage7(spheres, g, B_.data(), C_.data(), active, options.own, D_.resize(active, "array D"), threads),
      lap(7);
  copy(show.D, D_.data(), active);
  const std::uint64_t contacts = stage8(D_.data(), E_.resize(active, "array E"), active, threads);
  lap(8);
  copy(show.E, E_.data(), active);
  records.resize(contacts, options);
  stage9(spheres, g, B_.data(), C_.data(), active, options, E_.data(), records, threads), lap(9);
  copy(show.F, records.pairs.data(), contacts);
}
template void NineStages::run(const View<float>&, const Summary&, const CallOptions&, int, Records&, Seconds&,
                              Arrays*);
template void NineStages::run(const View<double>&, const Summary&, const CallOptions&, int, Records&,
                              Seconds&, Arrays*);

}  // namespace padder::detect::omp
