// SPDX-License-Identifier: MIT
#include "detect/core/nine_stages.h"

#include <algorithm>

#include "detect/core/errors.h"
#include "padding/asset/error.h"

namespace padder::detect {

StageGrid choose_stage_grid(const Summary& given, double bin_size, double margin) {
  StageGrid g;
  g.margin = margin;
  if (given.count == 0) return g;
  Summary s = with_octaves(given);
  if (margin > 0) {
    s.radius_max += margin / 2, s.radius_sum += margin / 2 * static_cast<double>(s.count);
    for (Summary::Octave& o : s.octave) o.radius_max += margin / 2;
  }
  const double count = static_cast<double>(s.count), mean = s.radius_sum / count;
  double widest = 0;
  for (int k = 0; k < 3; k++) widest = std::max(widest, s.high[k] - s.low[k]);
  const auto entries = [&](double size) {  // an upper bound for the entries of array B
    double sum = 0;
    for (const Summary::Octave& o : s.octave) {
      if (o.count == 0) continue;
      double extent = 0;
      for (int k = 0; k < 3; k++) extent = std::max({extent, std::abs(o.low[k]), std::abs(o.high[k])});
      const double wide = 2 * (o.radius_max + bin_margin(extent, o.radius_max)) / size + 2;
      sum += static_cast<double>(o.count) * wide * wide * wide;
    }
    return sum;
  };
  if (bin_size > 0) {
    g.size = std::max(bin_size, 0x1p-900);
    if (entries(g.size) > 1e12)
      throw Error("bins of " + formatted(bin_size) +
                  " are too small for these spheres: choose larger bins or the fast path");
  } else {
    if (s.radius_max > 0)
      g.size = s.radius_max > 3 * mean ? 3 * mean : 2 * s.radius_max * (1 + 0x1p-20);
    else if (widest > 0)
      g.size = widest / std::cbrt(count);
    // A length near 2^-1074 would not grow by the factor 1.25 below.
    g.size = std::max(g.size, 0x1p-900);
    while (entries(g.size) > 64 * count + 4096) g.size *= 1.25;
  }
  Sphere low{s.low[0], s.low[1], s.low[2], given.radius_max},
      high{s.high[0], s.high[1], s.high[2], given.radius_max};
  const TouchedBins first = touched_bins(g, low), last = touched_bins(g, high);
  for (int k = 0; k < 3; k++) {
    g.first[k] = first.low[k];
    g.side[k] = std::min<std::uint64_t>(static_cast<std::uint64_t>(last.high[k] - first.low[k]) + 1,
                                        std::uint64_t(1) << kSideBits);
  }
  return g;
}

}  // namespace padder::detect
