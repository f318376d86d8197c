// SPDX-License-Identifier: MIT
// The ways of putting spheres in the order of their bins, each forced upon scenes that would take another,
// and bins in float against what the search asks of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <vector>

#include "detect/cuda/device/device.h"
#include "detect/cuda/order/bins.h"
#include "detect/cuda/order/order.h"
#include "tests/detect/backends.h"
#include "tests/detect/core/summary_of.h"
#include "tests/detect/random.h"
#include "tests/detect/some_cases.h"

namespace padder::detect::cuda {
namespace {

Summary summary_of(const std::vector<float4>& spheres) {
  std::vector<Sphere> wide;
  for (const float4& s : spheres) wide.push_back({s.x, s.y, s.z, s.w});
  return detect::summary_of(wide);
}

std::vector<float4> cloud(std::mt19937& random, std::size_t count, float side, float low, float least,
                          float most) {
  std::uniform_real_distribution<float> place(low, low + side), radius(least, most);
  std::vector<float4> spheres(count);
  for (float4& s : spheres) s = {place(random), place(random), place(random), radius(random)};
  return spheres;
}

// The one thing that the search needs of a bin: two centres no further apart on an axis than the largest
// diameter are at most one bin apart, `fine` bins along x; and what lies within the bounds is within the
// bins.
TEST(CudaBins, TouchingSpheresAreNeighbours) {
  std::mt19937 random(20261120);
  int on = 0;
  for (int scene = 0; scene < 300; scene++) {
    std::uniform_real_distribution<float> exponent(-8, 12), share(0, 1);
    // A radius whose diameter, with the little that need_of() adds, fills a bin of ten significant bits.
    const double size =
        std::ldexp(std::floor(512 + 511 * share(random)), static_cast<int>(exponent(random)) - 14);
    auto r = static_cast<float>(size / 2 / (1 + 0x1p-20));
    while (need_of({0, 0, 0, r}) > size) r = std::nextafter(r, 0.0f);
    const float side = 2 * r * std::exp2(share(random) * 11.9f), low = (share(random) - 0.5f) * 4 * side;
    auto spheres = cloud(random, 200, side, low, r, r);
    const Summary summary = summary_of(spheres);
    for (const std::uint64_t count : {200ull, 1ull << 31}) {  // so many that rows are fine
      const FloatBins b = float_bins(choose_grid(summary, 0, 1e12), SlotKind::equal, count);
      if (!b.on || b.size > 0) continue;
      on++;
      const auto coordinate = [](const float4& s, int k) { return k == 0 ? s.x : k == 1 ? s.y : s.z; };
      for (int k = 0; k < 3; k++)
        for (std::size_t p = 0; p < spheres.size(); p++) {
          // Just below a face, and as far as a touching sphere can be.
          const float limit = static_cast<float>(summary.high[k]);
          float x = coordinate(spheres[p], k), y;
          std::uint32_t i, j;
          ASSERT_TRUE(float_bin(x, b.origin[k], b.per_size[k], b.count[k], i));
          float from = static_cast<float>(i + 1) / b.per_size[k];
          do from = std::nextafter(from, 0.0f), x = b.origin[k] + from;
          while (float_bin(x, b.origin[k], b.per_size[k], b.count[k], j) && j > i);
          for (const float d : {2 * r, -2 * r, r}) {
            y = x + d;
            while (std::abs(static_cast<double>(y) - x) > 2.0 * r) y = std::nextafter(y, x);
            if (x > limit || y > limit || y < static_cast<float>(summary.low[k])) continue;
            ASSERT_TRUE(float_bin(y, b.origin[k], b.per_size[k], b.count[k], j)) << scene;
            const int apart = std::abs(static_cast<int>(i) - static_cast<int>(j));
            ASSERT_LE(apart, k == 0 ? static_cast<int>(b.fine) : 1)
                << "scene " << scene << " axis " << k << ": " << x << ", " << y << " with r " << r;
          }
        }
      std::uint32_t bin;
      ASSERT_FALSE(float_bin(NAN, b.origin[0], b.per_size[0], b.count[0], bin));
      ASSERT_FALSE(float_bin(static_cast<float>(summary.high[0]) + 4 * r, b.origin[0], b.per_size[0],
                             b.count[0], bin));
      ASSERT_FALSE(
          float_bin(static_cast<float>(summary.low[0]) - 4 * r, b.origin[0], b.per_size[0], b.count[0], bin));
    }
  }
  EXPECT_GT(on, 200);
}

// What the search needs where a sphere searches another level: the bin of one that touches it is among those
// that its reach covers. Along one axis, a sphere of level `at` at y and one of level `from` at x, as large
// as it must be.
void expect_within_reach(const Grid& grid, const LevelBins& bins, int from, int at, int axis, float y,
                         float x) {
  const FloatBins& b = bins.level[at];
  const double r = std::abs(static_cast<double>(y) - x) - grid.level[at].radius_max;
  std::uint32_t bin;
  if (r < 0 || !float_bin(y, b.origin[axis], b.per_size[axis], b.count[axis], bin)) return;
  const double place = (static_cast<double>(x) - b.origin[axis]) * b.per_size[axis],
               reach = search_radius(grid, bins, from, at, r), low = std::floor(place - reach),
               high = std::floor(place + reach);
  ASSERT_TRUE(low <= bin && bin <= high) << "bin " << bin << " of " << b.count[axis] << ", searched " << low
                                         << " to " << high << " from " << place << ", reach " << reach;
}

TEST(CudaBins, SpheresOfOtherLevelsReachThoseThatTouch) {
  std::mt19937 random(20261121);
  std::uniform_real_distribution<float> share(0, 1);
  int on = 0;
  for (int scene = 0; scene < 300; scene++) {
    const float r = std::exp2(share(random) * 20 - 10), wider = scene % 3 ? 1 : std::exp2(4 * share(random)),
                side = wider * r * std::exp2(3 + share(random) * 9.9f),
                low = (share(random) - 0.5f) * 4 * side;
    auto spheres = cloud(random, 400, side, low, 0.7f * r, r);
    for (int k = 0; k < 40; k++) spheres[10 * k].w = r * std::exp2(1 + 6 * share(random));
    const Summary summary = summary_of(spheres);
    const double bin_size = scene % 3 ? 0 : 2 * r * wider;
    const Grid grid = choose_grid(summary, bin_size, 1e12, Processor::gpu);
    const LevelBins bins = level_bins(grid, SlotKind::unequal);
    if (!bins.on) continue;
    on++;
    for (const float4& other : spheres)
      for (int f = 0; f < grid.levels; f++) {
        const FloatBins& b = bins.level[f];
        const Level& l = grid.level[f];
        if (f == level_of(bins, other) || l.hashed) continue;
        const double far = static_cast<double>(other.w) + l.radius_max;
        for (int k = 0; k < 3; k++)
          for (int step = -4; step <= 4; step++) {
            if (b.count[k] < 2) continue;
            // At a face, and the other sphere as far away as it can touch.
            const auto face = static_cast<float>(1 + std::floor(share(random) * (b.count[k] - 1)));
            float y = b.origin[k] + face / b.per_size[k];
            for (int ulp = 0; ulp < std::abs(step); ulp++)
              y = std::nextafter(y, step < 0 ? -INFINITY : INFINITY);
            auto x = static_cast<float>(step & 1 ? y + far : y - far);
            while (std::abs(static_cast<double>(y) - x) > far) x = std::nextafter(x, y);
            ASSERT_NO_FATAL_FAILURE(expect_within_reach(grid, bins, level_of(bins, other), f, k, y, x));
          }
      }
  }
  EXPECT_GT(on, 150);
}

// The same where bins are much wider than spheres, and many; and behind the last bin's end, where the origin
// of the bins, as a float, lies in front of that of the level.
TEST(CudaBins, SpheresOfOtherLevelsReachThoseInWideBins) {
  std::mt19937 random(20261126);
  int on = 0;
  for (int scene = 0; scene < 2'000; scene++) {
    Grid grid;
    grid.levels = 2;
    Level &l = grid.level[0], &other = grid.level[1];
    l.size = 600 + std::floor(400 * unit(random)), l.per_size = 1 / l.size;
    l.radius_max = l.size * std::exp2(-1.01 - 8 * unit(random)), l.buckets = 1 << 20;
    l.count[0] = static_cast<std::uint32_t>(std::exp2(12 * unit(random)));
    l.first[0] = static_cast<std::int64_t>(std::exp2(18 * unit(random))) - 2000;
    other.size = 1000 * l.size, other.per_size = 1 / other.size, other.radius_max = other.size / 2.1;
    const LevelBins bins = level_bins(grid, SlotKind::unequal);
    if (!bins.on) continue;
    on++;
    const FloatBins& b = bins.level[0];
    const double low = static_cast<double>(l.first[0]) * l.size, end = low + l.count[0] * l.size;
    for (int k = 0; k < 200; k++) {
      const double face = 1 + std::floor(l.count[0] * unit(random));
      auto y = static_cast<float>(b.origin[0] + face / b.per_size[0] * (1 + 0x1p-22 * (unit(random) - 0.5)));
      while (y >= end) y = std::nextafter(y, -INFINITY);
      const double far = l.radius_max * (1 + 0.1 * unit(random));
      if (y < low) continue;
      for (const double x : {y - far, y + far})
        ASSERT_NO_FATAL_FAILURE(expect_within_reach(grid, bins, 1, 0, 0, y, static_cast<float>(x)))
            << "scene " << scene << ", bins of " << l.size << " from " << l.first[0];
    }
  }
  EXPECT_GT(on, 1'000);
}

struct Way {
  OrderMethod method;
  double bucket_spheres;
  const char* name;
  friend void PrintTo(const Way& way, std::ostream* out) { *out << way.name; }
};

class CudaOrderTest : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override { skip_without(BackendKind::cuda); }

  template <class T>
  static std::vector<T> host(const T* device, std::size_t count) {
    std::vector<T> v(count);
    cuda_check(cudaMemcpy(v.data(), device, count * sizeof(T), cudaMemcpyDeviceToHost), "copy");
    return v;
  }

  static std::uint32_t code_on_host(const Ordered& o, const Grid& grid, SlotKind kind, std::uint32_t key,
                                    const float4& slot) {
    const FloatSlot s{slot.x, slot.y, slot.z, slot.w};
    if (o.bins.on)
      return kind == SlotKind::equal ? code_of<SlotKind::equal>(o.bins, s)
                                     : code_of<SlotKind::unequal>(o.bins, s);
    if (o.float_levels) {
      const LevelBins bins = level_bins(grid, kind);
      return code_of<SlotKind::unequal>(bins.level[level_of(bins, slot)], s);
    }
    const Level& l = grid.level[level_of_key(grid, key)];
    FixedPointSlot f;
    std::memcpy(&f, &slot, sizeof f);
    return kind == SlotKind::equal     ? code_of<SlotKind::equal>(l, s)
           : kind == SlotKind::unequal ? code_of<SlotKind::unequal>(l, s)
                                       : code_of<SlotKind::fixed_point>(l, f);
  }

  // Spheres of each table entry are those whose key says so, by number where stable, and none is missing;
  // each has its code.
  void expect_order(const std::vector<float4>& spheres, SlotKind kind, bool packed, bool stable, bool along) {
    Orderer orderer(book_);
    expect_order(orderer, summary_of(spheres), spheres, kind, packed, stable, along, false, 0);
  }
  // By an orderer that may keep the buckets of its last call, with the grid of this summary; `refused`: the
  // flags by which it says that they will not do.
  void expect_order(Orderer& orderer, const Summary& summary, const std::vector<float4>& spheres,
                    SlotKind kind, bool packed, bool stable, bool along, bool keep, std::uint32_t refused) {
    SCOPED_TRACE(testing::Message() << spheres.size() << " spheres, kind " << int(kind) << ", packed "
                                    << packed << ", stable " << stable << ", bounds " << along << ", kept "
                                    << keep);
    const auto count = static_cast<std::uint32_t>(spheres.size());
    Buffer<float> given(book_, "the test");
    cuda_check(cudaMemcpy(given.reserve(4ull * count), spheres.data(), 16ull * count, cudaMemcpyHostToDevice),
               "copy");
    DeviceSpheres source;
    source.centers = given.data(), source.radii = given.data() + 3;
    source.center_stride = source.radius_stride = 4, source.count = count, source.packed = packed;
    const Grid grid = choose_grid(summary, 0, 8, Processor::gpu);
    orderer.bucket_spheres = GetParam().bucket_spheres;
    // Mostly there is a list whose memory serves as work space.
    Buffer<float4> list(book_, "the test");
    const std::uint64_t room = kind == SlotKind::equal && !packed ? 0 : 64ull * count + 4096;
    const Lent lent{list.reserve(room + 1), room, nullptr, 0};
    Buffer<unsigned long long> words(book_, "the test");
    constexpr std::uint32_t kWords = Surveyor::kHead + kBounds + Gather::kWords;
    auto* const head = words.reserve(kWords);
    auto* const counters = reinterpret_cast<Counters*>(head);
    cuda_check(cudaMemset(head, along ? 0xff : 0, kWords * 8), "set");
    Gather gather;
    const bool octaves = along && needs_octaves(summary) && packed;
    if (along) gather.bounds = head + Surveyor::kHead, gather.top = exponent_of(summary.need_max);
    if (octaves) gather.octaves = gather.bounds + kBounds;
    const Ordered o = orderer.order({.source = source,
                                     .grid = grid,
                                     .kind = kind,
                                     .radius = summary.radius_max,
                                     .stable = stable,
                                     .method = GetParam().method,
                                     .crowding = crowding_,
                                     .gather = gather,
                                     .lent = lent,
                                     .counters = counters,
                                     .processors = processors_of(nullptr, 0),
                                     .stream = nullptr,
                                     .keep = keep});
    cuda_check(cudaDeviceSynchronize(), "put in order");
    const auto found = host(reinterpret_cast<const unsigned long long*>(head), kWords);
    ASSERT_EQ(host(&counters->flags, 1)[0], refused);
    if (refused) return;
    if (along) {
      const Summary is = summary_of(spheres);
      for (int k = 0; k < 3; k++) {
        ASSERT_EQ(unordered(found[Surveyor::kHead + kLow + k]), is.low[k]);
        ASSERT_EQ(unordered(found[Surveyor::kHead + kHigh + k]), is.high[k]);
      }
      ASSERT_EQ(unordered(found[Surveyor::kHead + kRadiusMin]), is.radius_min);
      ASSERT_EQ(unordered(found[Surveyor::kHead + kRadiusMax]), is.radius_max);
      ASSERT_EQ(found[Surveyor::kHead + kFault], ~0ull);
      for (int k = 0; k < kOctaves && octaves; k++) {
        const unsigned long long* const w =
            &found[Surveyor::kHead + kBounds + k * std::size_t(OctaveBounds::kWords)];
        const Summary::Octave& octave = is.octave[k];
        ASSERT_EQ(w[8], octave.count) << k;
        if (octave.count == 0) continue;
        for (int c = 0; c < 3; c++) {
          ASSERT_EQ(unordered(w[c]), octave.low[c]) << k;
          ASSERT_EQ(unordered(w[3 + c]), octave.high[c]) << k;
        }
        ASSERT_EQ(unordered(w[6]), octave.radius_max) << k;
        ASSERT_EQ(unordered(w[7]), octave.need_max) << k;
      }
    }
    const auto slots = host(static_cast<const float4*>(o.slots), count);
    const auto table = host(o.table, o.entries + 1);
    std::vector<std::uint32_t> ids(count), keys, codes;
    if (o.codes) codes = host(o.codes, count);
    if (kind == SlotKind::equal)
      for (std::uint32_t p = 0; p < count; p++) std::memcpy(&ids[p], &slots[p].w, 4);
    else
      ids = host(o.ids, count);
    const LevelBins levels = level_bins(grid, kind);
    ASSERT_EQ(o.float_levels, levels.on);
    if (o.keys) keys = host(o.keys, count);
    std::vector<char> seen(count, 0);
    std::vector<std::uint32_t> places(o.entries + 1, 0);
    for (std::uint32_t p = 0; p < count; p++) {
      ASSERT_LT(ids[p], count);
      ASSERT_EQ(seen[ids[p]]++, 0) << "listed twice";
      const float4& s = spheres[ids[p]];
      std::uint32_t key;
      if (o.bins.on)
        ASSERT_TRUE(key_of(o.bins, s.x, s.y, s.z, key));
      else if (o.float_levels)
        ASSERT_TRUE(key_of(levels, s, key));
      else
        ASSERT_EQ(
            key = key_of(grid.level[level_of(grid, {s.x, s.y, s.z, s.w})],
                         bin_of(grid.level[level_of(grid, {s.x, s.y, s.z, s.w})], {s.x, s.y, s.z, s.w})),
            keys[p]);
      const std::uint32_t entry = key >> o.merge;
      ASSERT_LE(table[entry], p);
      ASSERT_LT(p, table[entry + 1]);
      if (kind != SlotKind::fixed_point)
        ASSERT_TRUE(slots[p].x == s.x && slots[p].y == s.y && slots[p].z == s.z);
      if (kind == SlotKind::unequal) ASSERT_EQ(slots[p].w, s.w);
      if (o.codes) ASSERT_EQ(codes[p], code_on_host(o, grid, kind, key, slots[p]));
      if (stable && p > table[entry]) ASSERT_LT(ids[p - 1], ids[p]);
    }
    ASSERT_TRUE(std::is_sorted(table.begin(), table.end()));
    ASSERT_EQ(table[0], 0u);
    ASSERT_EQ(table.back(), count);
  }

  void expect_all_kinds() {
    std::mt19937 random(7);
    for (const std::size_t count : {1, 31, 1000, 20'000}) {
      const float side = std::cbrt(static_cast<float>(count));
      const auto equal = cloud(random, count, side, -3, 0.6f, 0.6f),
                 few = cloud(random, count, 8 * side, 5, 0.5f, 0.5f),
                 full = cloud(random, count, side, 0, 1.2f, 1.2f),
                 unequal = cloud(random, count, side, 1, 0.2f, 0.7f);
      auto levels = unequal;
      for (std::size_t k = 0; k < count; k += 50) levels[k].w = 3;
      for (const bool stable : {false, true}) {
        expect_order(equal, SlotKind::equal, true, stable, true);
        expect_order(levels, SlotKind::fixed_point, false, stable, true);
        if (count < 20'000) {
          expect_order(equal, SlotKind::fixed_point, false, stable, false);
          expect_order(few, SlotKind::equal, false, stable, true);
          expect_order(full, SlotKind::equal, true, stable, false);
          expect_order(unequal, SlotKind::unequal, true, stable, true);
          expect_order(levels, SlotKind::unequal, true, stable, false);
          expect_order(levels, SlotKind::unequal, true, stable, true);
        }
        if (HasFatalFailure()) return;
      }
    }
  }

  MemoryBook book_;
  int crowding_ = 0;
};

TEST_P(CudaOrderTest, EverySphereIsWhereItsKeySays) { expect_all_kinds(); }

// As on a GPU with 99 KB of shared memory a block (compute capability 8.6 and 8.9), and with too little to
// divide among buckets, where spheres are sorted instead.
TEST_P(CudaOrderTest, EverySphereIsWhereItsKeySaysInLessSharedMemory) {
  for (const std::size_t bytes : {99 * 1024, 16 * 1024}) {
    SCOPED_TRACE(bytes);
    const ScopedTestLimits limits({.shared_memory = bytes});
    expect_all_kinds();
    if (HasFatalFailure()) return;
  }
}

// More buckets than a block can count in its shared memory, as hundreds of millions of spheres have.
TEST_P(CudaOrderTest, BucketsAreCountedInPasses) {
  if (GetParam().method != OrderMethod::buckets || GetParam().bucket_spheres > 2)
    GTEST_SKIP() << "one pass counts these";
  std::mt19937 random(13);
  const auto equal = cloud(random, 400'000, 74, -3, 0.6f, 0.6f);
  auto levels = cloud(random, 400'000, 74, 1, 0.2f, 0.7f);
  for (std::size_t k = 0; k < levels.size(); k += 50) levels[k].w = 3;
  for (const std::size_t bytes : {99 * 1024, 227 * 1024}) {
    SCOPED_TRACE(bytes);
    const ScopedTestLimits limits({.shared_memory = bytes});
    for (const bool along : {true, false}) {
      expect_order(equal, SlotKind::equal, true, false, along);
      expect_order(levels, SlotKind::unequal, true, true, along);
      expect_order(levels, SlotKind::fixed_point, false, false, along);
      if (HasFatalFailure()) return;
    }
  }
}

// Layers that are fuller than their level is on average, in halved buckets. The ball beneath is a level whose
// bucket has few entries; the table of its bins takes none of the room of the others' spheres.
TEST_P(CudaOrderTest, HalvedBucketsHoldFullLayers) {
  if (GetParam().method != OrderMethod::buckets || GetParam().bucket_spheres < 6500)
    GTEST_SKIP() << "for buckets that fill shared memory";
  if (test_limits.shared_memory < 226 * 1024) GTEST_SKIP() << "other buckets in so little shared memory";
  std::mt19937 random(14);
  auto bed = cloud(random, 300'000, 464, -232, 1, 1);
  std::uniform_real_distribution<float> height(1, 17);
  for (float4& s : bed) s.z = height(random);
  bed[0] = {0, 0, -1e5f, 1e5f};
  crowding_ = 1;
  for (const bool along : {true, false}) {
    expect_order(bed, SlotKind::unequal, true, false, along);
    if (HasFatalFailure()) return;
  }
}

// Bins with more spheres than have a place of their own to tell their numbers: a few of them, and many.
TEST_P(CudaOrderTest, FullBinsAreStableToo) {
  std::mt19937 random(11);
  auto few = cloud(random, 5000, 17, 0, 0.6f, 0.6f);
  std::uniform_real_distribution<float> near(4, 4.2f);
  for (std::size_t k = 0; k < 25; k++) few[k * 190] = {near(random), near(random), near(random), 0.6f};
  const auto many = cloud(random, 5000, 6, 0, 0.6f, 0.6f);
  for (int again = 0; again < 5; again++)
    for (const auto& spheres : {few, many}) {
      expect_order(spheres, SlotKind::equal, true, true, true);
      if (HasFatalFailure()) return;
    }
}

// Buckets that keep the room of the call before hold spheres that moved a little. Those that all went to one
// corner are refused, and so is one of another radius. What outgrew its room has it in the next call.
TEST_P(CudaOrderTest, BucketsAreKept) {
  if (GetParam().method != OrderMethod::buckets) GTEST_SKIP() << "nothing to keep";
  if (test_limits.shared_memory < 226 * 1024)
    GTEST_SKIP() << "other buckets are kept in so little shared memory";
  std::mt19937 random(11);
  SomeCases some;
  for (const char* radii : {"equal", "unequal", "of several levels"}) {
    SCOPED_TRACE(radii);
    const bool same = radii[0] == 'e', several = radii[0] == 'o';
    const SlotKind kind = same ? SlotKind::equal : SlotKind::unequal;
    auto spheres = cloud(random, 20'000, 27, -3, same ? 0.6f : several ? 0.51f : 0.4f, 0.6f);
    for (std::size_t k = 0; k < spheres.size() && several; k += 20)
      spheres[k].w = std::ldexp(0.55f, static_cast<int>(k / 20) % 4);
    for (int k = 0; k < 4; k++) {  // the box stays, of each level
      const float r = several ? std::ldexp(0.6f, k) : 0.6f;
      spheres[2 * k] = {-4, -4, -4, r}, spheres[2 * k + 1] = {25, 25, 25, r};
    }
    const Summary summary = summary_of(spheres);
    ASSERT_EQ(choose_grid(summary, 0, 8, Processor::gpu).levels > 1, several);
    std::uniform_real_distribution<float> step(-0.05f, 0.05f);
    for (const bool along : {true, false}) {
      if (some.left_out()) continue;
      Orderer orderer(book_);
      for (int call = 0; call < 5; call++) {
        expect_order(orderer, summary, spheres, kind, call % 2 == 0, call<3, along, call> 0, 0);
        if (HasFatalFailure()) return;
        for (std::size_t k = 8; k < spheres.size(); k++)
          spheres[k].x += step(random), spheres[k].y += step(random), spheres[k].z += step(random);
      }
      const std::uint64_t kept = orderer.kept();
      auto crowd = spheres;
      for (std::size_t k = 8; k < crowd.size(); k++)
        crowd[k].x = 0.25f * crowd[k].x + 15, crowd[k].y = 0.25f * crowd[k].y + 15,
        crowd[k].z = 0.25f * crowd[k].z + 15;
      const bool groups = GetParam().bucket_spheres < 10;  // of so many buckets nothing is kept
      expect_order(orderer, summary, crowd, kind, true, true, along, true, groups ? 0 : kOutgrown);
      EXPECT_EQ(orderer.kept(), kept);
      expect_order(orderer, summary, spheres, kind, true, true, along, true, groups ? 0 : kOutgrown);
      expect_order(orderer, summary, spheres, kind, true, true, along, true, 0);
      if (same && !groups) {
        auto other = spheres;
        other[12'345].w = 0.59f;
        expect_order(orderer, summary, other, kind, true, true, along, true, kOutside);
      }
      if (HasFatalFailure()) return;
    }
  }
}

// Doubles that count as rounded: their buckets are kept although bins are wider than the radius asks for, the
// bounds are those of the floats, and the spheres as they were given stand beside the slots, but where those
// of one radius take one piece of memory each in the caller's arrays: there records find them.
TEST_P(CudaOrderTest, RoundedDoublesAreKeptAndGiven) {
  std::mt19937 random(12);
  for (const bool same : {true, false}) {
    const auto floats = cloud(random, 20'000, 27, -3, same ? 0.6f : 0.4f, 0.6f);
    std::vector<Sphere> doubles;
    const double origin[3] = {64.25, -32.5, 7};
    for (const float4& s : floats)
      doubles.push_back(
          {origin[0] + s.x * (1 + 0x1p-30), origin[1] + s.y, origin[2] + s.z * (1 - 0x1p-30), s.w});
    Buffer<Sphere> given(book_, "the test");
    Buffer<unsigned long long> words(book_, "the test");
    cuda_check(cudaMemcpy(given.reserve(doubles.size()), doubles.data(), 32 * doubles.size(),
                          cudaMemcpyHostToDevice),
               "copy");
    auto* const head = words.reserve(Surveyor::kHead + kBounds);
    auto* const counters = reinterpret_cast<Counters*>(head);
    Summary summary = summary_of(floats);
    summary.grown_by = 0x1p-8;
    const Grid grid = choose_grid(summary, 0, 8, Processor::gpu);
    Orderer orderer(book_);
    orderer.bucket_spheres = GetParam().bucket_spheres;
    for (const auto& [packed, known] : {std::pair(true, false), {false, false}, {false, same}}) {
      DeviceSpheres source;
      source.centers = given.data(), source.radii = &given.data()->r;
      source.center_stride = source.radius_stride = 4;
      source.count = static_cast<std::uint32_t>(doubles.size());
      source.wide = source.rounded = true, source.packed = packed;
      std::ranges::copy(origin, source.origin);
      if (known) source.radius_of_all = doubles[0].r;
      const Gather gather{head + Surveyor::kHead, nullptr, 0};
      const Ordered o = orderer.order({.source = source,
                                       .grid = grid,
                                       .kind = same ? SlotKind::equal : SlotKind::unequal,
                                       .radius = summary.radius_max,
                                       .given = true,
                                       .stable = true,
                                       .method = GetParam().method,
                                       .gather = gather,
                                       .lent = {},
                                       .counters = counters,
                                       .processors = processors_of(nullptr, 0),
                                       .stream = nullptr,
                                       .keep = true});
      cuda_check(cudaDeviceSynchronize(), "put in order");
      ASSERT_EQ(host(&counters->flags, 1)[0], 0u);
      const auto bounds = host(static_cast<const unsigned long long*>(gather.bounds), kBounds);
      for (int k = 0; k < 3; k++) {
        ASSERT_EQ(unordered(bounds[kLow + k]), summary.low[k]);
        ASSERT_EQ(unordered(bounds[kHigh + k]), summary.high[k]);
      }
      ASSERT_EQ(unordered(bounds[kRadiusMax]), summary.radius_max);
      const auto slots = host(static_cast<const float4*>(o.slots), o.count);
      const auto ids = o.ids ? host(o.ids, o.count) : std::vector<std::uint32_t>();
      ASSERT_EQ(o.given == nullptr, same && (packed || known));
      const auto spheres = o.given ? host(o.given, o.count) : std::vector<Sphere>();
      for (std::uint32_t p = 0; p < o.count; p++) {
        std::uint32_t id = 0;
        std::memcpy(&id, &slots[p].w, 4);
        const Sphere& d = doubles[o.ids ? ids[p] : id];
        if (o.given) {
          ASSERT_TRUE(spheres[p].x == d.x && spheres[p].y == d.y && spheres[p].z == d.z &&
                      spheres[p].r == d.r);
        }
        ASSERT_EQ(slots[p].x, static_cast<float>(d.x - origin[0]));
      }
    }
  }
}

// 20,000 spheres with 8 or 2 a bucket make more than are divided among in one pass.
INSTANTIATE_TEST_SUITE_P(Ways, CudaOrderTest,
                         testing::Values(Way{OrderMethod::cells, 6500, "cells"},
                                         Way{OrderMethod::buckets, 6500, "buckets"},
                                         Way{OrderMethod::buckets, 100, "small_buckets"},
                                         Way{OrderMethod::buckets, 8, "many_buckets"},
                                         Way{OrderMethod::buckets, 2, "groups_of_buckets"},
                                         Way{OrderMethod::sort, 6500, "sort"}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace padder::detect::cuda
