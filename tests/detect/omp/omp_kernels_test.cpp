// SPDX-License-Identifier: MIT
// The inner loops of the CPU's search: those for this machine give what plain C++ gives, and both what they
// promise.
#include "detect/omp/batches.h"
#include "detect/omp/search/kernels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "detect/core/grid.h"
#include "tests/detect/oracle.h"

namespace padder::detect::omp {
namespace {

template <class Slot>
class KernelsTest : public testing::Test {
 protected:
  using Component = typename Slots<Slot>::Component;
  static constexpr std::uint32_t kCount = 4000;

  KernelsTest() : x_(kCount + kLanes), y_(x_), z_(x_), r_(kCount + kLanes) {
    const double unit = std::is_same_v<Slot, FixedPointSlot> ? 0x1p24 : 1;
    std::uniform_real_distribution<double> place(0, 3 * unit), radius(0.1 * unit, 0.5 * unit);
    for (std::uint32_t k = 0; k < kCount; k++) {
      x_[k] = static_cast<Component>(place(random_)), y_[k] = static_cast<Component>(place(random_));
      z_[k] = static_cast<Component>(place(random_)), r_[k] = static_cast<float>(radius(random_));
    }
    slots_ = {x_.data(), y_.data(), z_.data(), r_.data()};
  }

  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }

  std::mt19937_64 random_{3};
  std::vector<Component> x_, y_, z_;
  std::vector<float> r_;
  Slots<Slot> slots_;
  const Kernels<Slot> plain_ = plain_kernels<Slot>(), here_ = kernels_for_this_machine<Slot>();
};
using Both = testing::Types<FloatSlot, FixedPointSlot>;
TYPED_TEST_SUITE(KernelsTest, Both);

TYPED_TEST(KernelsTest, RunsGiveWhatTheFilterDoesNotCallApart) {
  std::vector<std::uint32_t> plain(this->kCount + kLanes), here(plain);
  int doubts = 0;
  for (int round = 0; round < 2000; round++) {
    std::vector<Run> runs;
    std::uint32_t at = this->below(100);
    for (std::uint32_t k = this->below(12); k > 0 && at < this->kCount; k--) {
      const std::uint32_t end = std::min(at + (k % 3 ? this->below(12) : this->below(60)), this->kCount);
      runs.push_back({at, end});  // some are empty
      at = end + this->below(400);
    }
    TypeParam me = this->slots_[this->below(this->kCount)];
    if (round % 2 && !runs.empty() &&
        runs[0].begin < runs[0].end) {  // just touches the first, as far as float can tell
      const TypeParam other = this->slots_[runs[0].begin];
      me = other, me.x = other.x + static_cast<decltype(me.x)>(me.r + other.r);
    }
    std::vector<std::uint32_t> expected;
    bool doubtful = false;
    for (const Run& run : runs)
      for (std::uint32_t k = run.begin; k < run.end; k++) {
        const Verdict v = verdict<TypeParam>(measured(me, this->slots_[k]));
        if (v != Verdict::apart) expected.push_back(k);
        doubtful |= v == Verdict::doubt;
      }
    doubts += doubtful;
    bool doubt_plain, doubt_here;
    const int count = static_cast<int>(runs.size());
    plain.resize(this->plain_.test_runs(this->slots_, me, runs.data(), count, plain.data(), doubt_plain));
    here.resize(this->here_.test_runs(this->slots_, me, runs.data(), count, here.data(), doubt_here));
    ASSERT_EQ(plain, expected);
    ASSERT_EQ(here, expected);
    ASSERT_EQ(doubt_plain, doubtful);
    ASSERT_TRUE(doubt_here || !doubtful);
    plain.resize(this->kCount + kLanes), here.resize(this->kCount + kLanes);
  }
  EXPECT_GT(doubts, 100);
}

// Several spheres with runs of their own find what each finds alone, some of them nothing.
TYPED_TEST(KernelsTest, SearchesGiveWhatTheirRunsGive) {
  for (int round = 0; round < 500; round++) {
    std::vector<Run> runs;
    std::vector<RunSearch<TypeParam>> searches;
    std::vector<std::uint32_t> wanted_a, wanted_b, found(this->kCount + kLanes);
    bool doubtful = false;
    for (std::uint32_t k = this->below(20); k > 0; k--) {
      const std::uint32_t a = this->below(this->kCount);
      searches.push_back({this->slots_[a], a, static_cast<int>(this->below(9))});
      for (int q = 0; q < searches.back().runs; q++) {
        const std::uint32_t begin = this->below(this->kCount - 20);
        runs.push_back({begin, begin + this->below(20)});
      }
      bool doubt;
      const std::uint32_t n =
          this->plain_.test_runs(this->slots_, searches.back().me,
                                 runs.data() + runs.size() - static_cast<std::size_t>(searches.back().runs),
                                 searches.back().runs, found.data(), doubt);
      wanted_a.insert(wanted_a.end(), n, a),
          wanted_b.insert(wanted_b.end(), found.begin(), found.begin() + n);
      doubtful |= doubt;
    }
    for (const Kernels<TypeParam>& kernels : {this->plain_, this->here_}) {
      std::vector<std::uint32_t> a(this->kCount + kLanes), b(a);
      const Searched s =
          kernels.test_searches(this->slots_, searches.data(), static_cast<std::uint32_t>(searches.size()),
                                runs.data(), {a.data(), b.data()});
      a.resize(s.hits), b.resize(s.hits);
      ASSERT_EQ(s.spheres, searches.size());
      ASSERT_EQ(a, wanted_a);
      ASSERT_EQ(b, wanted_b);
      ASSERT_TRUE(s.doubt || !doubtful);
    }
  }
}

// 9 * 8 * 7 bins with a border, of which every third is empty. Each sphere meets what lies behind it in its
// bin and in the 13 bins of the forward half, and the search goes on where it ended: for lack of room, or at
// the last key.
TYPED_TEST(KernelsTest, BinsGiveTheForwardHalf) {
  constexpr std::uint32_t kRow = 11, kPlane = kRow * 10, kKeys = kPlane * 9;
  std::vector<std::uint32_t> starts{0}, keys;
  for (std::uint32_t key = 0; key < kKeys; key++) {
    const std::uint32_t x = key % kRow, y = key / kRow % 10, z = key / kPlane;
    const bool border = x == 0 || x == 10 || y == 0 || y == 9 || z == 0 || z == 8;
    for (std::uint32_t k = border || key % 3 == 0 ? 0 : 1 + this->below(key % 50 ? 3 : 30); k > 0; k--)
      keys.push_back(key);
    starts.push_back(static_cast<std::uint32_t>(keys.size()));
  }
  const auto count = static_cast<std::uint32_t>(keys.size());
  ASSERT_LT(count, this->kCount);
  for (std::uint32_t k = 0; k + 1 < count; k += 10) {  // these just touch the next, as far as float can tell
    this->x_[k + 1] =
        this->x_[k] + static_cast<typename TestFixture::Component>(this->r_[k] + this->r_[k + 1]);
    this->y_[k + 1] = this->y_[k], this->z_[k + 1] = this->z_[k];
  }
  std::vector<Exact<TypeParam>> spheres(count + kLanes);
  for (std::uint32_t k = 0; k < count; k++)
    if constexpr (std::is_same_v<TypeParam, FloatSlot>) spheres[k] = this->slots_[k];
  Bins<TypeParam> bins{this->slots_, spheres.data(), keys.data(),     starts.data(),
                       kRow,         kPlane,         keys[count / 2], 0};
  const auto expected = [&](std::uint32_t a, bool& doubt) {
    std::vector<std::uint32_t> hits;
    const TypeParam me = this->slots_[a];
    for (std::uint32_t b = 0; b < count; b++) {
      const std::uint32_t key = keys[a], ahead = keys[b] - key;
      const auto about = [&](std::uint32_t centre) { return ahead + 1 - centre <= 2; };
      if (!(keys[b] == key
                ? b > a
                : ahead == 1 || about(kRow) || about(kPlane - kRow) || about(kPlane) || about(kPlane + kRow)))
        continue;
      TypeParam grown = me;
      grown.r += bins.grown_by;
      const Verdict v = verdict<TypeParam>(measured(grown, this->slots_[b]));
      if (v != Verdict::apart) hits.push_back(b);
      doubt |= v == Verdict::doubt;
    }
    return hits;
  };
  int doubts = 0;
  for (const auto test_bins : {this->plain_.test_bins, this->here_.test_bins, this->here_.test_sparse_bins})
    for (const float grown_by : {0.f, static_cast<float>(0.3 * this->r_[0])}) {
      bins.grown_by = grown_by;
      std::uint32_t first = 0;
      while (first < count && keys[first] <= bins.last_key) {
        const std::uint32_t room = 400 + this->below(400),
                            last = std::min(count, first + 1 + this->below(90));
        std::vector<std::uint32_t> out_a(room + kLanes, ~0u), out(out_a);
        const Searched s = test_bins(bins, first, last, {out_a.data(), out.data()}, room);
        ASSERT_GT(s.spheres, 0u);
        ASSERT_LE(first + s.spheres, last);
        std::uint32_t hits = 0;
        for (std::uint32_t k = 0; k < s.spheres; k++) {
          bool doubt = false;
          const std::vector<std::uint32_t> want = expected(first + k, doubt);
          for (const std::uint32_t b : want) {
            ASSERT_EQ(out_a[hits], first + k);
            ASSERT_EQ(out[hits++], b);
          }
          ASSERT_TRUE(!doubt || s.doubt);
          doubts += doubt;
        }
        ASSERT_EQ(hits, s.hits);
        first += s.spheres;
      }
      ASSERT_GT(first, count / 2);
      ASSERT_EQ(test_bins(bins, first, count, {}, 400).spheres, 0u) << "the last key";
    }
  EXPECT_GT(doubts, 10);
}

// 9 * 8 * 7 bins with a border, of which every third is empty. Each bin that has a point nearer than the
// ball's radius must be in a row's run; no run is empty.
TYPED_TEST(KernelsTest, RowsCoverTheBall) {
  constexpr std::uint32_t kRow = 11, kPlane = kRow * 10, kKeys = kPlane * 9;
  std::vector<std::uint32_t> starts{0};
  for (std::uint32_t key = 0; key < kKeys; key++) {
    const std::uint32_t x = key % kRow, y = key / kRow % 10, z = key / kPlane;
    const bool border = x == 0 || x == 10 || y == 0 || y == 9 || z == 0 || z == 8;
    starts.push_back(starts.back() + (border || key % 3 == 0 ? 0 : 1 + this->below(3)));
  }
  std::uniform_real_distribution<float> unit(0, 1);
  for (int round = 0; round < 3000; round++) {
    const int at[3] = {static_cast<int>(this->below(9)), static_cast<int>(this->below(8)),
                       static_cast<int>(this->below(7))};
    const int many[3] = {9, 8, 7};
    Ball b;
    b.x = unit(this->random_), b.y = unit(this->random_), b.z = unit(this->random_);
    b.radius = unit(this->random_) * (round % 2 ? 1 : 6);
    const auto range = [&](float centre, int axis, int& low, int& high) {
      low = std::max(static_cast<int>(std::floor(centre - b.radius)), -at[axis]);
      high = std::min(static_cast<int>(std::floor(centre + b.radius)), many[axis] - 1 - at[axis]);
    };
    range(b.x, 0, b.x_low, b.x_high), range(b.y, 1, b.y_low, b.y_high), range(b.z, 2, b.z_low, b.z_high);
    b.row = kRow, b.plane = kPlane;
    b.key = static_cast<std::uint32_t>((at[2] + 1) * 110 + (at[1] + 1) * 11 + at[0] + 1);
    std::vector<Run> plain(56 + kLanes), here(56 + kLanes);
    plain.resize(static_cast<std::size_t>(this->plain_.find_rows(b, starts.data(), plain.data())));
    here.resize(static_cast<std::size_t>(this->here_.find_rows(b, starts.data(), here.data())));
    ASSERT_EQ(plain.size(), here.size());
    for (std::size_t k = 0; k < plain.size(); k++) {
      ASSERT_EQ(plain[k].begin, here[k].begin);
      ASSERT_EQ(plain[k].end, here[k].end);
      ASSERT_LT(here[k].begin, here[k].end);
      ASSERT_LE(k ? here[k - 1].end : 0, here[k].begin) << "in order, each once";
    }
    const auto gap = [](int bin, float p) {
      return std::max({static_cast<double>(bin) - p, p - (static_cast<double>(bin) + 1), 0.0});
    };
    for (int z = b.z_low; z <= b.z_high; z++)
      for (int y = b.y_low; y <= b.y_high; y++)
        for (int x = b.x_low; x <= b.x_high; x++) {
          const double gx = gap(x, b.x), gy = gap(y, b.y), gz = gap(z, b.z);
          if (gx * gx + gy * gy + gz * gz > b.radius * b.radius * (1 - 1e-5) - 1e-6) continue;
          const std::uint32_t key = b.key + static_cast<std::uint32_t>(z * 110 + y * 11 + x);
          for (std::uint32_t slot = starts[key]; slot < starts[key + 1]; slot++)
            ASSERT_TRUE(std::any_of(here.begin(), here.end(),
                                    [&](const Run& r) { return r.begin <= slot && slot < r.end; }));
        }
  }
}

TEST(Kernels, PairsAreOrderedByNumber) {
  std::mt19937_64 random(5);
  constexpr std::uint32_t kSlots = 4000;
  std::vector<std::uint32_t> ids(kSlots), a(kBatch), b(kBatch), i(kBatch), j(kBatch);
  for (std::uint32_t k = 0; k < kSlots; k++) ids[k] = k % 2 ? k : 0xfffffff0u - k;  // also beyond 2^31
  std::shuffle(ids.begin(), ids.end(), random);
  std::vector<Pair> pairs(kBatch);
  for (std::uint32_t count = 0; count <= kBatch; count += 1 + count / 9) {
    for (std::uint32_t k = 0; k < count; k++)
      a[k] = static_cast<std::uint32_t>(random() % kSlots),
      b[k] = static_cast<std::uint32_t>(random() % kSlots);
    order_pairs(a.data(), b.data(), count, ids.data(), pairs.data(), i.data(), j.data());
    for (std::size_t k = 0; k < count; k++) {
      ASSERT_EQ(pairs[k], (Pair{std::min(ids[a[k]], ids[b[k]]), std::max(ids[a[k]], ids[b[k]])}));
      ASSERT_EQ(i[k], ids[a[k]] <= ids[b[k]] ? a[k] : b[k]);
      ASSERT_EQ(j[k], ids[a[k]] <= ids[b[k]] ? b[k] : a[k]);
    }
  }
}

// Bit for bit, signs of zeros included: what geometry() begins with, and what a record holds.
template <class Slot>
class DifferencesTest : public testing::Test {};
TYPED_TEST_SUITE(DifferencesTest, Both);
TYPED_TEST(DifferencesTest, AreThoseOfTheSpheres) {
  using Given = Exact<TypeParam>;
  std::mt19937_64 random(17);
  std::vector<Given> spheres;
  for (int k = 0; k < 300; k++) {
    const auto place = [&] {
      return static_cast<decltype(Given::x)>(k % 3                     ? signed_unit(random)
                                             : signed_unit(random) > 0 ? 0.0
                                                                       : -0.0);
    };
    Given s;
    s.x = place(), s.y = place(), s.z = place(),
    s.r = static_cast<decltype(Given::r)>(std::abs(signed_unit(random)));
    spheres.push_back(s);
  }
  const auto bits = [](double v) { return std::bit_cast<std::uint64_t>(v); };
  std::vector<std::uint32_t> i(kBatch), j(kBatch);
  for (std::uint32_t count = 1; count <= kBatch; count += 1 + count / 9) {
    for (std::uint32_t k = 0; k < kBatch; k++)
      i[k] = static_cast<std::uint32_t>(random() % 300), j[k] = static_cast<std::uint32_t>(random() % 300);
    Batch batch;
    differences(spheres.data(), i.data(), j.data(), count, batch);
    std::vector<Normal<float>> narrow(count);
    std::vector<Normal<double>> wide(count);
    copy_normals(batch, count, narrow.data()), copy_normals(batch, count, wide.data());
    for (std::size_t k = 0; k < count; k++) {
      const Sphere p = sphere_of(spheres[i[k]]), q = sphere_of(spheres[j[k]]);
      const double expected[4] = {q.x - p.x, q.y - p.y, q.z - p.z, p.r + q.r},
                   got[4] = {wide[k].x, wide[k].y, wide[k].z, wide[k].depth};
      const float rounded[4] = {narrow[k].x, narrow[k].y, narrow[k].z, narrow[k].depth};
      for (int c = 0; c < 4; c++) {
        ASSERT_EQ(bits(got[c]), bits(expected[c])) << k << " of " << count;
        ASSERT_EQ(bits(rounded[c]), bits(static_cast<float>(expected[c]))) << k << " of " << count;
      }
    }
  }
}

// Of a place and a radius of at most `by`.
Sphere random_sphere(std::mt19937_64& random, double by) {
  return {by * signed_unit(random), by * signed_unit(random), by * signed_unit(random), by * unit(random)};
}
void put(Batch& batch, std::uint32_t k, const Sphere& i, const Sphere& j) {
  batch.x[k] = j.x - i.x, batch.y[k] = j.y - i.y, batch.z[k] = j.z - i.z, batch.s[k] = i.r + j.r;
}

// Batches give what geometry() gives, bit for bit, of any size: without a tiny length among them, and with
// some.
TEST(Kernels, NormalsAreThoseOfTheRecord) {
  std::mt19937_64 random(9);
  for (const int exponent : {0, 300, -400, -500, -700, -1060, 1})
    for (int round = 0; round < 20; round++) {
      std::vector<Sphere> i(kBatch), j(kBatch);
      Batch batch;
      for (std::uint32_t k = 0; k < kBatch; k++) {
        const double by = std::ldexp(1.0, exponent == 1 && k % 7 == 0 ? -600 : exponent);
        i[k] = random_sphere(random, by), j[k] = random_sphere(random, by);
        if (round % 2 && k % 5 == 0) j[k] = i[k];
        put(batch, k, i[k], j[k]);
      }
      to_normals(batch, kBatch);
      for (std::uint32_t k = 0; k < kBatch; k++) {
        const Geometry g = geometry(i[k], j[k]);
        ASSERT_EQ(batch.x[k], g.normal[0]) << exponent;
        ASSERT_EQ(batch.y[k], g.normal[1]) << exponent;
        ASSERT_EQ(batch.z[k], g.normal[2]) << exponent;
        ASSERT_EQ(batch.s[k], g.depth) << exponent;
      }
    }
}

// Marks are those of touching(), or it says that the spheres are too small for them.
TEST(Kernels, MarksOfPairsThatTouch) {
  std::mt19937_64 random(12);
  int touch = 0, apart = 0, small = 0;
  for (const int exponent : {0, 300, -480, -510, -1000})
    for (const double margin : {0.0, std::ldexp(0.1, exponent)}) {
      const double by = std::ldexp(1.0, exponent);
      Batch batch;
      std::vector<Sphere> i(kBatch), j(kBatch);
      for (std::uint32_t k = 0; k < kBatch; k++) {
        i[k] = random_sphere(random, by), j[k] = random_sphere(random, by);
        if (k % 3 == 0) j[k] = i[k], j[k].x += i[k].r + j[k].r + margin;  // one point, but for rounding
        put(batch, k, i[k], j[k]);
      }
      std::int64_t marks[kBatch];
      if (!mark_touching(batch, kBatch, margin, marks)) {
        small++;
        continue;
      }
      for (std::uint32_t k = 0; k < kBatch; k++) {
        ASSERT_EQ(marks[k] != 0, touching(i[k], j[k], margin)) << exponent << ' ' << k;
        (marks[k] ? touch : apart)++;
      }
    }
  EXPECT_GT(touch, 100);
  EXPECT_GT(apart, 100);
  EXPECT_EQ(small, 4) << "2^-510 and 2^-1000";
}

TEST(BinNumbers, AndFixedPointsAreThoseOfSplit) {
  std::mt19937_64 random(11);
  for (const double size : {2.00390625, 1023.0 / 1024, 513 * 0x1p-60, 0x1p100}) {
    Level l;
    l.size = size, l.per_size = 1 / size, l.units = std::ldexp(l.per_size, kUnitBits);
    std::vector<double> x;
    for (const double far : {1.0, 1e3, 1e6, 1e12, 0x1p43})
      for (int k = 0; k < 2000; k++) {
        const double v = std::round(signed_unit(random) * far) * size;  // an edge of a bin
        for (const double near :
             {v, std::nextafter(v, INFINITY), std::nextafter(v, -INFINITY), signed_unit(random) * far * size})
          if (std::abs(near) <= 0x1p43 * size) x.push_back(near);
      }
    for (const double v : {0.0, -0.0, -1e-20, -5e-324, 5e-324}) x.push_back(v);
    for (std::size_t first = 0; first < x.size(); first += kBatch) {
      const int n = static_cast<int>(std::min<std::size_t>(kBatch, x.size() - first));
      std::uint32_t bins[kBatch];
      const std::vector<double> sizes(kBatch, l.size), per_size(kBatch, l.per_size);
      bin_numbers(x.data() + first, n, sizes.data(), per_size.data(), bins);
      std::int32_t places[kBatch];
      fixed_points(x.data() + first, n, l, places);
      for (int k = 0; k < n; k++) {
        const double v = x[first + static_cast<std::size_t>(k)];
        ASSERT_EQ(bins[k], static_cast<std::uint32_t>(split(l, v).bin)) << v << " in bins of " << size;
        ASSERT_EQ(places[k], fixed_point_of(l, split(l, v))) << v << " in bins of " << size;
      }
    }
  }
}

TEST(Octaves, AreThoseOfTheGrid) {
  std::mt19937_64 random(13);
  std::uniform_real_distribution<double> unit(-1, 1), exponent(-90, 90);
  for (int batch = 0; batch < 20; batch++) {
    double v[4][kBatch];
    for (auto& row : v)
      for (double& x : row) x = unit(random) * std::exp2(exponent(random));
    for (double& r : v[3]) r = std::abs(r);
    for (int k = 0; k < 4; k++) v[k][batch] = v[k][batch + 20] = v[3][batch + 40] = 0;
    const int top = 10 * batch - 100, n = kBatch - batch;
    std::int64_t octaves[kBatch];
    octaves_of(v[0], v[1], v[2], v[3], n, top, octaves);
    for (int k = 0; k < n; k++)
      ASSERT_EQ(octaves[k], octave_of(top, need_of({v[0][k], v[1][k], v[2][k], v[3][k]})));
  }
}

TEST(Widen, GivesTheBoundsAndNoticesWhatIsNoLength) {
  std::vector<double> x(256);
  std::mt19937_64 random(12);
  for (double& v : x) v = signed_unit(random);
  for (const double v :
       std::initializer_list<double>{0.5, kLargest, -kLargest, 2 * kLargest, -INFINITY, INFINITY, NAN})
    for (std::size_t at = 0; at < x.size(); at += 17) {
      std::vector<double> y = x;
      y[at] = v;
      double low = 0.1, high = 0.1;
      const bool good = widen(y.data(), 256, low, high);
      ASSERT_EQ(good, std::abs(v) <= kLargest);
      if (!good) continue;
      EXPECT_EQ(low, *std::min_element(y.begin(), y.end()));
      EXPECT_EQ(high, *std::max_element(y.begin(), y.end()));
    }
}

}  // namespace
}  // namespace padder::detect::omp
