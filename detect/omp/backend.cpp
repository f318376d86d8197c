// SPDX-License-Identifier: MIT
// The OpenMP backend: it places the bodies, summarizes the spheres, and lets a path find the contacts.
#include <omp.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>

#include "detect/core/neighbourhood.h"
#include "detect/omp/bodies.h"
#include "detect/omp/history.h"
#include "detect/omp/threads.h"
#include "detect/omp/worlds/world_search.h"
#include "detect/omp/worlds/worlds_apart.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace omp {
namespace {

std::uint64_t free_memory() {
  std::uint64_t kib = 0;
  if (std::FILE* f = std::fopen("/proc/meminfo", "r")) {
    char line[128];
    while (std::fgets(line, sizeof line, f))
      if (std::sscanf(line, "MemAvailable: %lu kB", &kib) == 1) break;
    std::fclose(f);
  }
  return kib ? kib * 1024 : ~std::uint64_t(0) / 2;  // not known (not Linux): the allocator decides
}

}  // namespace

bool Budget::take(std::uint64_t bytes) {
  const std::uint64_t held = held_.fetch_add(bytes) + bytes, taken = taken_.fetch_add(bytes) + bytes;
  bool ok = true;
  if (limit_) {
    ok = held <= limit_;
  } else if (bytes >= (1u << 20)) {  // a small allocation is not worth asking for
    if (free_ == 0) free_ = free_memory();
    ok = taken <= free_ / 16 * 15;
  }
  if (!ok) held_ -= bytes, taken_ -= bytes;
  return ok;
}

void throw_memory(const Budget& budget, std::uint64_t bytes, const char* what) {
  throw MemoryError(bytes + budget.held(), what, "host", budget.limit());
}
void throw_memory(const Budget& budget, std::uint64_t bytes, std::uint64_t entries, const char* what) {
  throw_memory(budget, bytes, (std::to_string(entries) + " " + what).c_str());
}

Stopwatch::Stopwatch() : last_(omp_get_wtime()) {}
double Stopwatch::lap() {
  const double now = omp_get_wtime(), passed = now - last_;
  last_ = now;
  return passed;
}

// The number of spheres by exponent_of(need) + 1023.
template <class T>
std::array<std::uint64_t, kExponents> exponents_of(const View<T>& spheres, int threads) {
  std::array<std::uint64_t, kExponents> all{};
#pragma omp parallel num_threads(threads)
  {
    std::array<std::uint64_t, kExponents> mine{};
#pragma omp for schedule(static) nowait
    for (std::int64_t k = 0; k < static_cast<std::int64_t>(spheres.count); k++)
      mine[static_cast<std::size_t>(exponent_of(need_of(spheres[static_cast<std::uint64_t>(k)])) + 1023)]++;
#pragma omp critical
    for (int e = 0; e < kExponents; e++)
      all[static_cast<std::size_t>(e)] += mine[static_cast<std::size_t>(e)];
  }
  return all;
}

template <class T>
void count_octaves(const View<T>& spheres, int threads, Summary& s) {
  const int top = exponent_of(s.need_max) - s.above;
  const auto n = static_cast<std::int64_t>(spheres.count);
  // Bounds of x, y, z and r, which a compiler makes vectors of.
  struct Bounds {
    double low[4] = {INFINITY, INFINITY, INFINITY, INFINITY},
           high[4] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY};
    std::uint64_t count = 0;
  };
  Bounds all[kOctaves];
#pragma omp parallel num_threads(threads)
  {
    Bounds mine[kOctaves];
    double v[4][kBatch];
    std::int64_t octaves[kBatch];
#pragma omp for schedule(static) nowait
    for (std::int64_t first = 0; first < n; first += kBatch) {
      const auto count = static_cast<int>(std::min<std::int64_t>(kBatch, n - first));
      load_batch(spheres, static_cast<std::uint64_t>(first), v);
      octaves_of(v[0], v[1], v[2], v[3], count, top, octaves);
      for (int k = 0; k < count; k++) {
        Bounds& o = mine[octaves[k]];
        o.count++;
        for (int a = 0; a < 4; a++) {
          o.low[a] = v[a][k] < o.low[a] ? v[a][k] : o.low[a];
          o.high[a] = v[a][k] > o.high[a] ? v[a][k] : o.high[a];
        }
      }
    }
#pragma omp critical
    for (int k = 0; k < kOctaves; k++) {
      all[k].count += mine[k].count;
      for (int a = 0; a < 4; a++)
        all[k].low[a] = std::min(all[k].low[a], mine[k].low[a]),
        all[k].high[a] = std::max(all[k].high[a], mine[k].high[a]);
    }
  }
  for (int k = 0; k < kOctaves; k++) {
    Summary::Octave& o = s.octave[k];
    o = {};
    if (all[k].count == 0) continue;
    double extent = 0;
    for (int a = 0; a < 3; a++) {
      o.low[a] = all[k].low[a], o.high[a] = all[k].high[a];
      extent = std::max({extent, std::abs(o.low[a]), std::abs(o.high[a])});
    }
    o.count = all[k].count, o.radius_max = all[k].high[3], o.need_max = need_of({extent, 0, 0, o.radius_max});
  }
}

// One pass, and a second one if the sizes vary, because octaves are counted from the largest need downwards.
template <class T>
Summary summarize(const View<T>& spheres, int threads) {
  Summary s;
  s.count = spheres.count;
  const auto n = static_cast<std::int64_t>(spheres.count);
#pragma omp parallel num_threads(threads)
  {
    Summary mine;
    double v[4][kBatch];
#pragma omp for schedule(static) nowait
    for (std::int64_t first = 0; first < n; first += kBatch) {
      const auto begin = static_cast<std::uint64_t>(first),
                 end = std::min(begin + kBatch, static_cast<std::uint64_t>(n));
      load_batch(spheres, begin, v);
      double low[4], high[4];
      bool good = true;
      for (int a = 0; a < 4; a++) {
        low[a] = INFINITY, high[a] = -INFINITY;
        good &= widen(v[a], kBatch, low[a], high[a]);
      }
      for (std::uint64_t k = begin; k < end && (!good || low[3] < 0); k++)
        if (fault_of(spheres[k]) != Fault::none) mine.first_fault = std::min(mine.first_fault, k);
      for (int a = 0; a < 3; a++)
        mine.low[a] = std::min(mine.low[a], low[a]), mine.high[a] = std::max(mine.high[a], high[a]);
      mine.radius_max = std::max(mine.radius_max, high[3]),
      mine.radius_min = std::min(mine.radius_min, low[3]);
    }
#pragma omp critical
    {
      for (int a = 0; a < 3; a++)
        s.low[a] = std::min(s.low[a], mine.low[a]), s.high[a] = std::max(s.high[a], mine.high[a]);
      s.radius_max = std::max(s.radius_max, mine.radius_max),
      s.radius_min = std::min(s.radius_min, mine.radius_min);
      s.first_fault = std::min(s.first_fault, mine.first_fault);
    }
  }
  if (n == 0 || s.first_fault != ~std::uint64_t(0)) return s;
  for (int a = 0; a < 3; a++) s.extent = std::max({s.extent, std::abs(s.low[a]), std::abs(s.high[a])});
  // need_of is the larger of two terms, each of which grows with its argument, so its largest value follows
  // from the largest coordinate and the largest radius.
  s.need_max = need_of({s.extent, 0, 0, s.radius_max});
  s.radius_sum = s.radius_max * static_cast<double>(n);
  if (!needs_octaves(s)) return s;

  s.octaves_known = true, s.radius_sum = 0;
  count_octaves(spheres, threads, s);
  if (s.octave[kOctaves - 1].count > 0) {  // it may hold spheres of very different sizes
    s.above = octaves_above(exponents_of(spheres, threads));
    if (s.above > 0) count_octaves(spheres, threads, s);
  }
  // An exact sum of the radii would depend on the number of threads. This estimate does not, and is good
  // enough for choosing bins.
  for (const Summary::Octave& o : s.octave)
    s.radius_sum += 0.75 * o.radius_max * static_cast<double>(o.count);
  s.near = probe_neighbourhood(s, [&](std::uint32_t k) { return spheres[k]; });
  return s;
}
template Summary summarize(const View<float>&, int);
template Summary summarize(const View<double>&, int);

}  // namespace omp

namespace {

// Fitted to 88 piles of bodies of 1 to 200 spheres, on one thread (docs/experiments/bodies.md); `static_each`
// with 100,000 loose spheres.
constexpr BodyCosts kBodyCosts{.octave = 0.5, .ball = 1.3, .pair = 0.9, .contact = 0.5, .static_each = 9};
// Worlds are searched by their spheres, side by side, where a body, or loose sphere, has no more on average;
// otherwise by the tree. Both ways were measured on both sides of it (docs/experiments/worlds.md).
constexpr std::uint64_t kSmallBody = 16;
// The tree gives up where so many tests for each sphere find nothing. They take less time than it takes to
// search the spheres side by side, which then follows.
constexpr std::uint64_t kTestsInVain = 16;

class OmpBackend final : public Backend {
 public:
  const char* name() const override { return "omp"; }
  bool has_history() const override { return true; }
  std::uint64_t memory() const override { return budget_.held(); }

  Contacts detect(const Input& input, const CallOptions& options) override {
    if (options.history) history_->keep(kept_->records);
    Contacts c = any(input, options, nullptr);
    if (options.history) {
      omp::Stopwatch watch;
      c.history = history_->match(kept_->records, threads_);
      c.seconds.history = watch.lap(), c.seconds.total += c.seconds.history;
    }
    chosen_.done();
    return c;
  }

  Arrays stages(const Input& input, const CallOptions& options) override {
    Arrays arrays;
    CallOptions o = options;
    o.path = Path::nine_stages;
    any(input, o, &arrays);
    kept_->records.count = 0;
    return arrays;
  }

  WorldAnswers detect_worlds(const Input& input, const CallOptions& options, std::uint32_t worlds,
                             Answer answer) override {
    begin(options);
    kept_->bodies.forget();
    const std::uint64_t spheres = sphere_count(check_input(input, false), input.spheres.count);
    omp::Stopwatch watch;
    choose_threads(options, spheres);
    kept_->answers.begin(input, worlds, answer);
    answer_worlds(input, options, spheres);
    kept_->records.count = 0;
    chosen_.done();
    WorldAnswers answers = kept_->answers.arrays();
    answers.seconds = watch.lap();
    return answers;
  }

  std::vector<Pose> device_poses(const Input& input, const CallOptions&) override {
    check_input(input, false);  // throws, because this backend cannot read device memory
    return {};
  }

  void forget() noexcept override {
    kept_->bodies.forget();
    kept_->records.count = 0;
    history_.emplace(budget_);  // its list alone may be larger than the limit of the call that failed
  }

  std::uint64_t hash() const override {
    std::uint64_t sum = 0;
    const auto n = static_cast<std::int64_t>(kept_->records.count);
#pragma omp parallel for schedule(static) num_threads(threads_) reduction(+ : sum)
    for (std::int64_t k = 0; k < n; k++) {
      const Pair p = kept_->records.pairs[static_cast<std::uint64_t>(k)];
      sum += pair_hash(p.i, p.j);
    }
    return sum;
  }

 private:
  void begin(const CallOptions& options) {
    if (options.output == Memory::device)
      throw Error(
          "the contacts are to lie in device memory (CallOptions::output), which the OpenMP backend has not: "
          "ask for host memory or choose cuda");
    if (options.memory_limit && budget_.held() > options.memory_limit)  // the limit was lowered
    {
      kept_ = nullptr, kept_ = std::make_unique<Kept>(budget_);
      if (!options.history) history_.emplace(budget_);
    }
    kept_->records.count = 0;
  }
  void choose_threads(const CallOptions& options, std::uint64_t work) {
    budget_.begin(options.memory_limit);
    threads_ = chosen_.choose(options.threads, work);
  }

  bool first_is_faster(const Input& input, const CallOptions& options, std::uint64_t spheres) {
    const Spheres& s = input.spheres;
    const std::uint64_t moving =
        s.is_static ? static_cast<std::uint64_t>(std::count(s.is_static, s.is_static + s.count, 0)) : s.count;
    Pieces& pieces = kept_->bodies.pieces();
    if (!census_) census_ = census_of(input.shapes, tally_, pieces);
    const double most = most_touching_balls(*census_, spheres, s.count, moving, kBodyCosts);
    return most > 0 && touching_balls(input, options.margin, pieces) < most;
  }

  static bool has_small_bodies(const Input& input, std::uint64_t spheres) {
    return spheres <= kSmallBody * (input.bodies.size() + input.spheres.count);
  }
  // Calls use(spheres), with the world of each; those of bodies are placed.
  template <class Use>
  auto with_spheres(const Input& input, Use use) {
    if (!input.bodies.empty()) return use(place(input, true));
    return input.spheres.scalar == Scalar::f32 ? use(view<float>(input.spheres))
                                               : use(view<double>(input.spheres));
  }
  Contacts search_worlds(const Input& input, const CallOptions& options, std::uint64_t n) {
    Contacts c;
    const auto tree = [&](std::uint64_t in_vain) {
      omp::Allowance allowance(in_vain);
      return kept_->worlds.run(input, options, threads_, allowance, kept_->records, c.seconds);
    };
    const bool automatic = options.bodies == Bodies::automatic,
               tree_first = options.bodies == Bodies::first || (automatic && !has_small_bodies(input, n));
    const std::uint64_t in_vain = automatic ? kTestsInVain * n : omp::Allowance::kUnlimited;
    if (tree_first && !input.bodies.empty() && tree(in_vain)) return delivered(c, n, options);
    const auto side_by_side = [&](const auto& spheres) {
      return kept_->worlds_apart.run(spheres, options, threads_, kept_->records, c);
    };
    if (!with_spheres(input, side_by_side)) tree(omp::Allowance::kUnlimited);
    return delivered(c, n, options);
  }

  // Of a list, where the tree tests too much in vain. Distances are first those of spheres that touch.
  void answer_worlds(const Input& input, const CallOptions& options, std::uint64_t n) {
    omp::AnswerArrays& answers = kept_->answers;
    const Answer answer = answers.answer();
    const auto tree = [&](std::uint64_t in_vain) {
      omp::Allowance allowance(in_vain);
      return kept_->worlds.answer(input, options, threads_, allowance, answers);
    };
    if ((answer != Answer::count || !has_small_bodies(input, n)) && tree(kTestsInVain * n)) return;
    CallOptions listed = options;
    listed.width = Width::pairs;
    if (answer == Answer::distance) listed.margin = 0;
    const auto list = [&](const auto& spheres) {
      Contacts c;
      if (!kept_->worlds_apart.run(spheres, listed, threads_, kept_->records, c)) return false;
      answers.add(spheres, kept_->records, threads_);
      return listed.margin == options.margin || answers.are_all_answered();
    };
    try {
      if (with_spheres(input, list)) return;
    } catch (const MemoryError&) {  // answers need no list
    }
    tree(omp::Allowance::kUnlimited);
  }

  // A call by any path. `arrays`: null, or where the arrays of the nine stages go.
  Contacts any(const Input& input, const CallOptions& options, Arrays* arrays) {
    begin(options);
    const bool may_go_first = !arrays && options.path == Path::grid && options.bodies != Bodies::expanded;
    const bool known = may_go_first && kept_->bodies.knows(input, options.margin);
    BodyTally tally = check_input(input, false, known);
    if (!known) tally_ = std::move(tally), census_.reset();
    const std::uint64_t n = sphere_count(tally_, input.spheres.count);
    // The worlds of bodies stay within a revision, those of loose spheres need not.
    std::optional<std::uint32_t> world_of_loose;
    if (!input.spheres.world) world_of_loose = input.spheres.world_of_all;
    const bool same_worlds = known && world_of_loose && world_of_loose == world_of_loose_;
    world_of_loose_ = world_of_loose;
    if (!same_worlds && options.path == Path::grid && has_worlds(tally_, input)) {
      choose_threads(options, n);
      kept_->bodies.forget();
      return search_worlds(input, options, n);
    }
    const bool first =
        may_go_first && (options.bodies == Bodies::first || first_is_faster(input, options, n));
    choose_threads(options, known && first ? kept_->bodies.work() : n);
    const Spheres& s = input.spheres;
    if (first) {
      Contacts c;
      if (kept_->bodies.run(input, options, threads_, kept_->records, c.seconds))
        return delivered(c, n, options);
    }
    kept_->bodies.forget();
    if (!input.bodies.empty()) return run(place(input, has_worlds(tally_, input)), input, options, arrays);
    if (s.scalar == Scalar::f32) return run(view<float>(s), input, options, arrays);
    return run(view<double>(s), input, options, arrays);
  }

  template <class T>
  static omp::View<T> view(const Spheres& s) {
    return {static_cast<const T*>(s.centers),
            static_cast<const T*>(s.radii),
            s.center_stride,
            s.radius_stride,
            s.count,
            s.family,
            s.mask,
            nullptr,
            s.is_static,
            s.world,
            s.world_of_all};
  }

  // Places the spheres of the bodies, and appends the loose ones, in double. `worlds`: the world of each,
  // too.
  omp::View<double> place(const Input& input, bool worlds) {
    omp::Stopwatch watch;
    std::vector<std::uint64_t> first(input.bodies.size() + 1, 0);
    for (std::size_t b = 0; b < input.bodies.size(); b++)
      first[b + 1] = first[b] + input.shapes[input.bodies[b].shape].count;
    const std::uint64_t n = first.back() + input.spheres.count;
    Sphere* out = kept_->placed.resize(n, "the spheres of the bodies");
    std::uint32_t* family = kept_->family.resize(n, "families");
    std::uint32_t* mask = kept_->mask.resize(n, "masks");
    std::uint32_t* owner = kept_->owner.resize(n, "the bodies of spheres");
    std::uint32_t* world = worlds ? kept_->world.resize(n, "worlds") : nullptr;
    const auto bodies = static_cast<std::int64_t>(input.bodies.size());
#pragma omp parallel for schedule(dynamic, 16) num_threads(threads_)
    for (std::int64_t k = 0; k < bodies; k++) {
      const Body body = body_at(input, static_cast<std::size_t>(k));
      const Shape& shape = input.shapes[body.shape];
      const Filter f = filter_of(body, static_cast<std::uint32_t>(k));
      for (std::uint64_t q = 0, at = first[static_cast<std::size_t>(k)]; q < shape.count; q++, at++) {
        out[at] = placed(body, shape.spheres[q]);
        family[at] = f.family, mask[at] = f.mask, owner[at] = f.owner;
        if (world) world[at] = body.world;
      }
    }
    const auto loose = static_cast<std::int64_t>(input.spheres.count);
    const std::uint64_t base = first.back();
    const auto copy = [&](const auto& v) {
#pragma omp parallel for schedule(static) num_threads(threads_)
      for (std::int64_t k = 0; k < loose; k++) {
        const auto q = static_cast<std::uint64_t>(k);
        const Filter f = v.filter(q);
        out[base + q] = v[q];
        family[base + q] = f.family, mask[base + q] = f.mask, owner[base + q] = f.owner;
        if (world) world[base + q] = v.world_of(q);
      }
    };
    if (input.spheres.scalar == Scalar::f32)
      copy(view<float>(input.spheres));
    else
      copy(view<double>(input.spheres));
    place_seconds_ = watch.lap();
    omp::View<double> view = omp::view_of(out, n, family, mask, owner);
    view.world = world;
    return view;
  }

  template <class T>
  Contacts run(const omp::View<T>& spheres, const Input& input, const CallOptions& options, Arrays* arrays) {
    omp::Stopwatch watch;
    Contacts c;
    if (!input.bodies.empty()) c.seconds.place = place_seconds_;
    Summary summary = omp::summarize(spheres, threads_);
    if (options.path == Path::grid) summary.grown_by = options.margin / 2;
    if (summary.first_fault != ~std::uint64_t(0))
      throw Error(fault_sentence(summary.first_fault, spheres[summary.first_fault], input));
    check_range(summary, options);
    c.seconds.stage[0] = watch.lap();  // the summary counts as part of stage 1
    if (options.path == Path::nine_stages)
      kept_->nine_stages.run(spheres, summary, options, threads_, kept_->records, c.seconds, arrays);
    else
      c.doubtful = kept_->grid_path.run(spheres, summary, options, threads_, kept_->records, c.seconds);
    return delivered(c, spheres.count, options);
  }

  Contacts delivered(Contacts c, std::uint64_t spheres, const CallOptions& options) {
    c.count = kept_->records.count, c.spheres = spheres;
    c.width = options.width, c.scalar = options.scalar;
    c.pairs = kept_->records.pairs.data();
    if (options.width != Width::pairs) c.normals = kept_->records.normals.data();
    if (options.width == Width::points) c.points = kept_->records.points.data();
    for (const double t : c.seconds.stage) c.seconds.total += t;
    c.seconds.total += c.seconds.place;
    return c;
  }

  // All memory that is kept from call to call.
  struct Kept {
    explicit Kept(omp::Budget& b)
        : records(b),
          nine_stages(b),
          grid_path(b),
          bodies(b),
          worlds(b),
          worlds_apart(b),
          answers(b),
          placed(b),
          family(b),
          mask(b),
          owner(b),
          world(b) {}
    omp::Records records;
    omp::NineStages nine_stages;
    omp::GridPath grid_path;
    omp::BodySearch bodies;
    omp::WorldSearch worlds;
    omp::WorldsApart worlds_apart;
    omp::AnswerArrays answers;
    omp::Buffer<Sphere> placed;
    omp::Buffer<std::uint32_t> family, mask, owner, world;
  };
  omp::Budget budget_;
  std::unique_ptr<Kept> kept_ = std::make_unique<Kept>(budget_);
  // Beside what is kept: a limit that makes the backend give its memory back does not lose the list before.
  std::optional<omp::History> history_{budget_};
  omp::Threads chosen_;
  int threads_ = 1;
  BodyTally tally_;                              // of the revision that is known
  std::optional<BodyCensus> census_;             // likewise
  std::optional<std::uint32_t> world_of_loose_;  // in the last call; none: an array gave them
  double place_seconds_ = 0;
};

}  // namespace

std::unique_ptr<Backend> make_omp_backend() { return std::make_unique<OmpBackend>(); }

}  // namespace padder::detect
