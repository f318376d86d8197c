// SPDX-License-Identifier: MIT
#include "detect/omp/bodies.h"

#include <omp.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace padder::detect::omp {
namespace {

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_THREAD__)
#define PADDER_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define PADDER_CLONES
#endif

// These loops decide for each of n spheres, in vectors, and give the same bits on every processor.
// sift(): which spheres of a piece may the other ball touch?
PADDER_CLONES void sift(const Sieve& s, const NearSphere* near, std::uint32_t n, std::uint8_t* pass) {
  for (std::uint32_t k = 0; k < n; k++) pass[k] = passes(s, near[k]);
}
// test(): which spheres touch s? No radius is negative, so a sum of two radii is small only if both are.
PADDER_CLONES void test_unscaled(const Sphere& s, const double* x, const double* y, const double* z,
                                 const double* r, std::uint32_t n, std::uint8_t* hit) {
  for (std::uint32_t k = 0; k < n; k++) hit[k] = touching_unscaled(s, {x[k], y[k], z[k], r[k]});
}
void test(const Sphere& s, const double* x, const double* y, const double* z, const double* r,
          std::uint32_t n, std::uint8_t* hit) {
  if (s.r >= kSmallSum) return test_unscaled(s, x, y, z, r, n, hit);
  for (std::uint32_t k = 0; k < n; k++) hit[k] = touching(s, {x[k], y[k], z[k], r[k]});
}
// Which have a gap of at most `margin` to s?
PADDER_CLONES void test_margin(const Sphere& s, double margin, const double* x, const double* y,
                               const double* z, const double* r, std::uint32_t n, std::uint8_t* hit) {
  for (std::uint32_t k = 0; k < n; k++) hit[k] = touching(s, {x[k], y[k], z[k], r[k]}, margin);
}

// The bytes that are set, as bits; at most 64.
std::uint64_t bits_of(const std::uint8_t* set, std::uint32_t count) {
  std::uint64_t bits = 0;
  for (std::uint32_t k = 0; k < count; k += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, set + k, 8);
    bits |= ((eight & 0x0101010101010101) * 0x0102040810204080 >> 56) << k;
  }
  return count < 64 ? bits & ((std::uint64_t(1) << count) - 1) : bits;
}

// The pairs of elements in a part, which is the unit of work and of the stable order.
constexpr std::uint64_t kPart = 256;

}  // namespace

// The spheres of an element that the ball of the other element may touch, placed.
struct BodySearch::Survivors {
  std::uint32_t body, count, slot[kPieceSpheres];
  double x[kPieceSpheres], y[kPieceSpheres], z[kPieceSpheres], r[kPieceSpheres];
  void add(std::uint32_t s, const Sphere& p) {
    slot[count] = s, x[count] = p.x, y[count] = p.y, z[count] = p.z, r[count++] = p.r;
  }
  Sphere operator[](std::uint32_t k) const { return {x[k], y[k], z[k], r[k]}; }
};

BodySearch::BodySearch(Budget& b)
    : budget_(&b), grid_path_(b), broad_(b), balls_(b), family_(b), mask_(b), owner_(b), static_pairs_(b) {}

template <class T>
bool BodySearch::List<T>::add(Budget& budget, const T& value) {
  total++;
  if (size == buffer.capacity()) {
    Buffer<T> wider(budget);
    if (!wider.try_resize(std::max<std::uint64_t>(2 * size, 1024))) return false;
    if (size) std::memcpy(wider.data(), buffer.data(), size * sizeof(T));
    buffer.swap(wider);
  }
  buffer[size++] = value;
  return true;
}

Sphere BodySearch::loose(std::uint32_t k) const { return loose_at(*spheres_, k); }

void BodySearch::read_bodies(const Input& input, bool known) {
  if (!known) {
    bodies_.assign(input.bodies.begin(), input.bodies.end());
    if (input.poses)
      for (std::size_t b = 0; b < bodies_.size(); b++) bodies_[b] = body_at(input, b);
    assembly_.update(input, input.spheres.is_static);
    return;
  }
  // RevisionKeeper has put poses that lie in host memory into the bodies already.
  for (const std::uint32_t b : input.moved)
    if (!bodies_[b].is_static) bodies_[b] = input.bodies[b];
}

// Computes the balls, families and masks of the elements; those of static elements only if the revision is
// new. False if the ball of a static element is faulty. Balls are larger by half of the margin: so they touch
// where spheres in them may have a gap of no more than it, and the sieve lets those pass.
bool BodySearch::place(const Input& input, bool known, int threads) {
  const std::uint64_t all = assembly_.elements.size(), n = known ? assembly_.moving : all;
  Sphere* balls = balls_.resize(all, "the balls about bodies");
  std::uint32_t* family = family_.resize(all, "families");
  std::uint32_t* mask = mask_.resize(all, "masks");
  std::uint32_t* owner = owner_.resize(all, "the bodies of spheres");
  const Spheres& s = input.spheres;
  // More than half, by far more than the decisions about it round.
  const double grown_by = 0.5 * margin_ * (1 + 0x1p-40);
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(n); k++) {
    const Element e = assembly_.elements[static_cast<std::size_t>(k)];
    if (e.body == kLoose) {
      balls[k] = ball_of(loose(e.piece));
      family[k] = s.family ? s.family[e.piece] : 0, mask[k] = s.mask ? s.mask[e.piece] : 0;
      owner[k] = s.is_static && s.is_static[e.piece] ? kStatic : 0;
    } else {
      const Body& body = bodies_[e.body];
      balls[k] = ball_of(body, assembly_.pieces.pieces[e.piece]);
      family[k] = body.family, mask[k] = body.mask, owner[k] = owner_of(e.body, body.is_static);
    }
    balls[k].r += grown_by;
  }
  if (known) return true;
  if (!table_.build({balls + assembly_.moving, all - assembly_.moving}, assembly_.moving)) return false;
  static_extent_ = 0;
  for (const Sphere& b : table_.balls)
    static_extent_ =
        std::max({static_extent_, std::abs(b.x) + b.r, std::abs(b.y) + b.r, std::abs(b.z) + b.r});
  return true;
}

// Calls f(first, end, list) for each part of 0 to count - 1, with the list of the thread that does it.
// Afterwards `parts` says where the entries of each part are. Throws Error if there was not enough memory for
// the lists.
template <class T, class F>
void BodySearch::in_parts(std::vector<List<T>>& lists, std::vector<Part>& parts, std::uint64_t count,
                          int threads, F f) {
  while (lists.size() < static_cast<std::size_t>(threads)) lists.emplace_back(*budget_);
  for (List<T>& l : lists) l.size = l.total = 0;
  parts.resize((count + kPart - 1) / kPart);
#pragma omp parallel num_threads(threads)
  {
    const int t = omp_get_thread_num();
    List<T>& mine = lists[static_cast<std::size_t>(t)];
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t p = 0; p < static_cast<std::int64_t>(parts.size()); p++) {
      const std::uint64_t first = static_cast<std::uint64_t>(p) * kPart, before = mine.size;
      f(first, std::min(count, first + kPart), mine);
      parts[static_cast<std::size_t>(p)] = {before, mine.size - before, t};
    }
  }
  std::uint64_t total = 0, kept = 0;
  for (const List<T>& l : lists) total += l.total, kept += l.size;
  if (kept < total)
    throw_memory(total * sizeof(T) + budget_->held(), (std::to_string(total) + " contacts").c_str());
}

// The static elements whose balls touch that of moving element e.
void BodySearch::search_static(std::uint32_t e, List<Pair>& list) {
  const Sphere& ball = balls_[e];
  const Filter mine = filter(e);
  // Tests the balls of table entries `from` to `to` - 1 for which in_bin() is true.
  const auto test = [&](std::uint32_t from, std::uint32_t to, auto in_bin) {
    for (std::uint32_t k = from; k < to; k++)
      if (touching(ball, table_.balls[k]) && in_bin(table_.balls[k]) &&
          admitted(mine, filter(table_.elements[k])))
        list.add(*budget_, {e, table_.elements[k]});
  };
  const auto any = [](const Sphere&) { return true; };
  for (int level = 0; level < table_.grid.levels; level++) {
    const Level& l = table_.grid.level[level];
    const std::uint32_t begin = table_.starts[l.offset], last = table_.starts[l.offset + l.buckets];
    BinBox box;
    if (begin == last || !bins_near(l, table_.bounds[level], ball, last - begin, box)) continue;
    if (box.whole) {
      test(begin, last, any);
      continue;
    }
    for (std::int64_t z = box.low[2]; z <= box.high[2]; z++)
      for (std::int64_t y = box.low[1]; y <= box.high[1]; y++) {
        const std::uint32_t row = row_of(l, y, z);
        if (!l.hashed) {
          test(table_.starts[key_in_row(l, row, box.low[0])],
               table_.starts[key_in_row(l, row, box.high[0]) + 1], any);
          continue;
        }
        for (std::int64_t x = box.low[0]; x <= box.high[0]; x++) {
          const std::uint32_t key = key_in_row(l, row, x);
          test(table_.starts[key], table_.starts[key + 1],
               [&](const Sphere& s) { return in_row(l, s, x, x, y, z); });
        }
      }
  }
}

void BodySearch::find_static_pairs(int threads) {
  static_count_ = 0;
  if (table_.count == 0) return;
  in_parts(pair_lists_, parts_, assembly_.moving, threads,
           [&](std::uint64_t first, std::uint64_t end, List<Pair>& list) {
             for (auto e = static_cast<std::uint32_t>(first); e < end; e++) search_static(e, list);
           });
  std::uint64_t all = 0;
  for (const Part& p : parts_) all += p.count;
  static_pairs_.resize(all, "pairs with static spheres");
  for (const Part& p : parts_) {
    const Pair* from = pair_lists_[static_cast<std::size_t>(p.thread)].buffer.data() + p.first;
    std::copy_n(from, p.count, static_pairs_.data() + static_count_);
    static_count_ += p.count;
  }
}

void BodySearch::gather(std::uint32_t element, const Sphere& other, Survivors& out) const {
  const Element e = assembly_.elements[element];
  out.body = e.body, out.count = 0;
  if (e.body == kLoose) return out.add(e.piece, loose(e.piece));
  const Body& body = bodies_[e.body];
  const Piece& piece = assembly_.pieces.pieces[e.piece];
  const Sieve sieve = sieve_of(body, piece, balls_[element], other);
  const NearSphere* near = &assembly_.pieces.near[piece.first];
  std::uint8_t pass[kPieceSpheres] = {};
  sift(sieve, near, piece.count, pass);
  for (std::uint64_t left = bits_of(pass, piece.count); left; left &= left - 1) {
    const std::uint32_t k = piece.first + static_cast<std::uint32_t>(std::countr_zero(left));
    out.add(k, placed(body, assembly_.pieces.spheres[k]));
  }
}

// Tests the spheres of pair k of elements.
void BodySearch::test_pair(std::uint64_t k, const CallOptions& options, Survivors& a, Survivors& b,
                           List<Hit>& hits) {
  const Pair p = pair(k);
  gather(p.i, balls_[p.j], a);
  if (a.count == 0) return;
  gather(p.j, balls_[p.i], b);
  bool bounded = false;
  for (int c = 0; c < 3; c++) bounded |= options.own.low[c] > -INFINITY || options.own.high[c] < INFINITY;
  for (std::uint32_t i = 0; i < a.count; i++) {
    const Sphere s = a[i];
    std::uint8_t hit[kPieceSpheres] = {};
    if (options.margin > 0)
      test_margin(s, options.margin, b.x, b.y, b.z, b.r, b.count, hit);
    else
      test(s, b.x, b.y, b.z, b.r, b.count, hit);
    for (std::uint64_t left = bits_of(hit, b.count); left; left &= left - 1) {
      const auto j = static_cast<std::uint32_t>(std::countr_zero(left));
      if (bounded) {
        const bool ordered = sphere_number(a.body, a.slot[i]) < sphere_number(b.body, b.slot[j]);
        if (!owns(options.own, ordered ? midpoint(s, b[j]) : midpoint(b[j], s))) continue;
      }
      hits.add(*budget_, {a.body, a.slot[i], b.body, b.slot[j]});
    }
  }
}

void BodySearch::write(const CallOptions& options, int threads, Records& records) {
  std::vector<std::uint64_t> first(parts_.size());
  std::uint64_t sum = 0;
  for (std::size_t p = 0; p < parts_.size(); p++) first[p] = sum, sum += parts_[p].count;
  records.resize(sum, options);
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(parts_.size()); k++) {
    const Part& p = parts_[static_cast<std::size_t>(k)];
    const Hit* hit = hit_lists_[static_cast<std::size_t>(p.thread)].buffer.data() + p.first;
    RecordWriter writer(records, options, first[static_cast<std::size_t>(k)]);
    for (std::uint64_t q = 0; q < p.count; q++) {
      const Hit& h = hit[q];
      const Sphere a = options.width == Width::pairs ? Sphere{} : sphere(h.a_body, h.a_slot);
      writer.add(sphere_number(h.a_body, h.a_slot), sphere_number(h.b_body, h.b_slot), a,
                 [&] { return sphere(h.b_body, h.b_slot); });
    }
  }
}

bool BodySearch::knows(const Input& input, double margin) const {
  return input.revision != 0 && input.revision == revision_ && input.bodies.size() == bodies_.size() &&
         input.spheres.count == known_loose_ && margin == margin_;
}

bool BodySearch::run(const Input& input, const CallOptions& options, int threads, Records& records,
                     Seconds& seconds) {
  Stopwatch watch;
  const bool known = knows(input, options.margin);
  revision_ = 0;  // set at the end, if nothing throws
  margin_ = options.margin;
  spheres_ = &input.spheres;
  read_bodies(input, known);
  if (!place(input, known, threads)) return false;
  seconds.place = watch.lap();
  const View<double> balls =
      view_of(balls_.data(), assembly_.moving, family_.data(), mask_.data(), owner_.data());
  const Summary summary = summarize(balls, threads);
  if (summary.first_fault != ~std::uint64_t(0)) return false;
  if (options.width != Width::pairs && options.scalar == Scalar::f32 &&
      std::max(summary.extent + summary.radius_max, static_extent_) > kBallInFloat)
    return false;
  CallOptions broad;
  broad.width = Width::pairs;
  seconds.stage[0] = watch.lap();
  grid_path_.run(balls, summary, broad, threads, broad_, seconds);
  watch.lap();
  find_static_pairs(threads);
  seconds.stage[6] += watch.lap();
  in_parts(hit_lists_, parts_, broad_.count + static_count_, threads,
           [&](std::uint64_t first, std::uint64_t end, List<Hit>& list) {
             Survivors a, b;
             for (std::uint64_t k = first; k < end; k++) test_pair(k, options, a, b, list);
           });
  seconds.stage[6] += watch.lap();
  write(options, threads, records);
  seconds.stage[8] += watch.lap();
  revision_ = input.revision, known_loose_ = input.spheres.count;
  return true;
}

}  // namespace padder::detect::omp
