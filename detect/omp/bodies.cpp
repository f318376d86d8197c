// SPDX-License-Identifier: MIT
#include "detect/omp/bodies.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "detect/omp/avx2.h"

namespace padder::detect::omp {
namespace {

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
// What the broad phase finds.
constexpr const char* kPairs = "pairs of bodies that may touch";
std::uint64_t parts_of(std::uint64_t pairs) { return (pairs + kPart - 1) / kPart; }

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
    : grid_path_(b, kPairs),
      broad_(b, kPairs),
      balls_(b),
      family_(b),
      mask_(b),
      owner_(b),
      static_pairs_(b),
      pair_lists_(b, kPairs),
      hit_lists_(b, "contacts") {}

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
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::int64_t k = 0; k < static_cast<std::int64_t>(n); k++) {
    const Element e = assembly_.elements[static_cast<std::size_t>(k)];
    const bool is_loose = e.body == kLoose;
    const Filter f = is_loose ? filter_at(s, e.piece) : filter_of(bodies_[e.body], e.body);
    family[k] = f.family, mask[k] = f.mask, owner[k] = f.owner;
    balls[k] =
        is_loose ? ball_of(loose_at(s, e.piece)) : ball_of(bodies_[e.body], assembly_.pieces.pieces[e.piece]);
    balls[k].r += grown_by();
  }
  if (known) return true;
  if (!table_.build({balls + assembly_.moving, all - assembly_.moving}, assembly_.moving)) return false;
  static_extent_ = 0;
  for (const Sphere& b : table_.balls)
    static_extent_ =
        std::max({static_extent_, std::abs(b.x) + b.r, std::abs(b.y) + b.r, std::abs(b.z) + b.r});
  return true;
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
        list.add({e, table_.elements[k]});
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
  const std::uint64_t moving = assembly_.moving;
  pair_lists_.fill(parts_of(moving), threads, [&](std::uint64_t part, List<Pair>& list) {
    for (std::uint64_t e = part * kPart; e < std::min(moving, (part + 1) * kPart); e++)
      search_static(static_cast<std::uint32_t>(e), list);
  });
  static_count_ = pair_lists_.size();
  Pair* const to = static_pairs_.resize(static_count_, kPairs);
  pair_lists_.each(threads, [&](std::span<const Pair> pairs, std::uint64_t place) {
    std::copy(pairs.begin(), pairs.end(), to + place);
  });
}

void BodySearch::gather(std::uint32_t element, const Sphere& other, Survivors& out) const {
  const Element e = assembly_.elements[element];
  out.body = e.body, out.count = 0;
  if (e.body == kLoose) return out.add(e.piece, loose_at(*spheres_, e.piece));
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

// Do the boxes about two pieces show that no sphere of one touches one of the other? The balls of long or
// flat pieces touch many others.
bool BodySearch::boxes_are_apart(Pair p) const {
  const Element a = assembly_.elements[p.i], b = assembly_.elements[p.j];
  if (a.body == kLoose || b.body == kLoose) return false;
  const Pieces& pieces = assembly_.pieces;
  const Sphere &ball_a = balls_[p.i], &ball_b = balls_[p.j];
  // Stances are those of the balls before they grew by half of the margin: larger than these by no more than
  // what three operations round.
  const auto stance = [&](const Element& e, const Sphere& ball) {
    Stance s = stance_of(bodies_[e.body], e, pieces.pieces[e.piece], ball);
    s.over += 0x1p-50 * ball.r - grown_by();
    return s;
  };
  const Relative to = relative(stance(a, ball_a), ball_a, stance(b, ball_b), ball_b, margin_);
  return boxes_apart(pieces.boxes[a.piece], pieces.boxes[b.piece], to);
}

// Tests the spheres of pair k of elements.
void BodySearch::test_pair(std::uint64_t k, const CallOptions& options, Survivors& a, Survivors& b,
                           List<Hit>& hits) {
  const Pair p = pair(k);
  if (boxes_are_apart(p)) return;
  gather(p.i, balls_[p.j], a);
  if (a.count == 0) return;
  gather(p.j, balls_[p.i], b);
  const bool bounded = options.own != Region{};
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
      hits.add({a.body, a.slot[i], b.body, b.slot[j]});
    }
  }
}

void BodySearch::write(const CallOptions& options, int threads, Records& records) {
  records.resize(hit_lists_.size(), options);
  hit_lists_.each(threads, [&](std::span<const Hit> hits, std::uint64_t place) {
    RecordWriter writer(records, options, place);
    for (const Hit& h : hits) {
      const Sphere a = options.width == Width::pairs ? Sphere{} : sphere(h.a_body, h.a_slot);
      writer.add(sphere_number(h.a_body, h.a_slot), sphere_number(h.b_body, h.b_slot), a,
                 [&] { return sphere(h.b_body, h.b_slot); });
    }
  });
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
  const std::uint64_t pairs = broad_.count + static_count_;
  hit_lists_.fill(parts_of(pairs), threads, [&](std::uint64_t part, List<Hit>& list) {
    Survivors a, b;
    for (std::uint64_t k = part * kPart; k < std::min(pairs, (part + 1) * kPart); k++)
      test_pair(k, options, a, b, list);
  });
  seconds.stage[6] += watch.lap();
  write(options, threads, records);
  seconds.stage[8] += watch.lap();
  revision_ = input.revision, known_loose_ = input.spheres.count;
  return true;
}

}  // namespace padder::detect::omp
