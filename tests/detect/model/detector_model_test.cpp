// SPDX-License-Identifier: MIT
// State between calls: random sequences of calls on one detector, each call against an oracle (oracle.h), and
// many against a fresh detector that is given the same scene.
//
// A sequence is drawn from a 64-bit seed (script.h). Between two calls the scene changes (world.h), and so
// may the options, the type and layout of the arrays (input.h), the memory they lie in, and the revision.
// Some calls are faulty. What is taken for the contract, of detector.h:
// - The pairs are those of the oracle, each once, i < j. With Precision::float32 at most Contacts::doubtful
//   of them differ.
// - hash() is the sum over the pairs, and 0 after a call that threw and after stages().
// - With Order::stable the list, normals and points are bit for bit those of a fresh detector, and of the
//   same call again.
// - Contacts says what was asked for: spheres, memory (host with OpenMP), width, scalar. What was not asked
//   for is null. Normals and points are those of the spheres: 4e-7 relative in float, 1e-14 in double.
// - Under the revision of the call before, a body that is neither named in `moved` nor has a pose in `poses`
//   stands where it stood, and so does every static one, whatever the arrays say: they say something else
//   here. Poses in device memory begin and end with a revision. Loose spheres that move are read in every
//   call.
// - Contacts::history names each pair's index in the list of the call before, which is empty after a call
// that threw, stages() and detect_worlds(). The answers of detect_worlds() are those of the oracle's
// contacts.
// - A faulty call throws padder::Error, which names the sphere or body at fault as a fresh detector does. The
//   next call reads everything, whatever its revision, and is right. A memory limit that is too small refuses
//   the call, or the call is right.
// - memory() is never above Options::memory_limit. A detector that was moved from has memory() 0, and throws.
//
// A failing sequence is replayed with as few calls as still fail, and told. Environment:
//   PADDER_MODEL_SEQUENCES  how many; 500 with OpenMP, 5,000 with CUDA; of large scenes 1 and 40
//   PADDER_MODEL_SEED       of the first; drawn when not set, and printed. The k-th has this seed + k
//   PADDER_MODEL_VERBOSE    prints every seed before it runs, and every step
// PADDER_MODEL_SEQUENCES=1 PADDER_MODEL_SEED=s replays sequence s.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <random>
#include <thread>

#include "detect/core/nine_stages.h"
#include "padding/asset/error.h"
#include "tests/detect/model/checks.h"
#include "tests/detect/model/script.h"
#include "tools/watchdog.h"

namespace padder::detect {
namespace {

// Seconds; then the test ends itself. PADDER_WATCHDOG multiplies it, and 0 takes the limit away.
double longest_step() {
  const double factor = padder::Watchdog::limit_factor();
  // The tree takes a minute on a CPU for worlds of 130,000 crowded spheres, where Bodies::first asks for it.
  return factor > 0 ? 240 * factor : INFINITY;
}

// Where the test is: told when the program crashes or a call does not come back.
std::atomic<std::uint64_t> current_seed{0}, current_step{0};
void tell_where() {
  char text[160];
  const int n = std::snprintf(text, sizeof text,
                              "\nmodel test: in step %llu of the sequence of PADDER_MODEL_SEED=%llu\n",
                              static_cast<unsigned long long>(current_step.load()),
                              static_cast<unsigned long long>(current_seed.load()));
  if (write(2, text, static_cast<std::size_t>(n)) < 0) return;
}
void crashed(int signal) {
  tell_where();
  std::signal(signal, SIG_DFL), std::raise(signal);
}
class StepWatchdog {
 public:
  StepWatchdog() : thread_([this] { watch(); }) {}
  ~StepWatchdog() { stop_ = true, thread_.join(); }

 private:
  void watch() {
    std::uint64_t seed = 0, step = 0;
    auto since = std::chrono::steady_clock::now();
    for (; !stop_; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
      const auto now = std::chrono::steady_clock::now();
      if (seed != current_seed || step != current_step) seed = current_seed, step = current_step, since = now;
      if (std::chrono::duration<double>(now - since).count() < longest_step()) continue;
      tell_where();
      std::fputs("model test: a step takes longer than allowed; the test ends here\n", stderr);
      std::_Exit(3);
    }
  }
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class Sequence {
 public:
  Sequence(BackendKind backend, std::uint64_t seed, bool large, void* stream)
      : script_(backend, seed, large), backend_(backend), stream_(stream) {
    detector_ = std::make_unique<Detector>(DeviceChoice{backend});
  }
  std::size_t steps() const { return script_.steps(); }

  // Throws Wrong. The world changes where the call is left out, too. False: a call left out would have been
  // needed, for what changed asks for it.
  bool step(std::size_t k, bool left_out, std::string& told) {
    current_step = k;
    Call call = script_.next();
    if (script_.heavy()) dirty_ = true;
    told =
        tell(call) + "; " + std::to_string(script_.spheres().size()) + " spheres: " + script_.world().story;
    if (std::getenv("PADDER_MODEL_VERBOSE"))
      std::printf("  step %zu%s: %s\n", k, left_out ? " (left out)" : "", told.c_str());
    pending_.insert(pending_.end(), call.moved.begin(), call.moved.end());
    if (left_out) return true;
    std::erase_if(pending_, [&](std::uint32_t b) { return b >= script_.world().bodies.size(); });
    call.moved.swap(pending_), pending_.clear();
    if (call.number != 0 && call.number == accepted_ && dirty_) return false;
    if (call.options.stream == nullptr && call.dice.chance(0.2)) call.options.stream = stream_;
    hand_on(call);
    carry_out(call);
    return true;
  }

 private:
  // The detector's contents to another object, and the one that is left is looked at.
  void hand_on(Call& call) {
    if (call.handed_on == 0) return;
    const std::uint64_t hash = detector_->hash();
    auto other = std::make_unique<Detector>(DeviceChoice{backend_}, call.options);
    if (call.handed_on == 1) {
      other = std::make_unique<Detector>(std::move(*detector_));
      require(other->hash() == hash, "another hash after a move");
    } else {
      const Sphere balls[] = {{0, 0, 0, 1}, {1, 0, 0, 1}};
      Input input = input_of(balls);
      input.revision = 77;
      other->options() = {};
      other->detect(input);
      *detector_ = std::move(*other);
      accepted_ = 0, list_before_ = {{0, 1}};
      require(detector_->hash() == pair_hash(0, 1), "another hash after an assignment");
      detector_.swap(other);
    }
    require(detector_->memory() == 0, "a detector that was moved from holds memory");
    bool threw = false;
    try {
      detector_->hash();
    } catch (const Error&) {
      threw = true;
    }
    require(threw, "a detector that was moved from has a hash");
    detector_ = std::move(other);
  }

  void carry_out(Call& call) {
    using K = ModelFault::Kind;
    const bool known = call.number != 0 && call.number == accepted_;
    ModelWorld seen = script_.world();
    if (known && !call.stages) mislead(seen, call);  // stages() reads everything
    ModelInput given(seen, call.form, call.dice);
    given.apply(call.fault);
    given.arrange(call.moved, call.number, call.fault);
    accepted_ = 0;
    detector_->options() = call.options;
    bool threw = false;
    std::string said;
    try {
      make(call, given.input);
    } catch (const Error& e) {
      threw = true, said = e.what();
    }
    if (threw || call.stages || call.answers) list_before_.clear(), list_known_ = true;
    const std::uint64_t limit = call.options.memory_limit;
    require(limit == 0 || detector_->memory() <= limit, "memory() is ", detector_->memory(),
            " under a limit of ", limit);
    const Range range = range_of(call, script_.spheres());
    const bool faulty = call.fault.kind != K::none && call.fault.kind != K::limit;
    require(threw || !(faulty || range == Range::too_large), "nothing was thrown");
    require(!threw || faulty || range != Range::fits || call.fault.kind == K::limit, "it threw: ", said);
    if (threw || call.stages || call.answers)
      require(detector_->hash() == 0, "hash() is not 0 after a call without contacts");
    if (threw) {
      require(said.size() > 20 && said.find(' ') != said.npos, "no sentence: ", said);
      require(range != Range::fits || said.find(call.fault.says) != said.npos, "the sentence is \"", said,
              "\", without \"", call.fault.says, "\"");
      if (range == Range::fits && by_number(call.fault.kind)) check_sentence(call, said);
      return;
    }
    dirty_ = false;
    if (call.stages) return;
    accepted_ = call.number;
    if (call.answers) return;
    if (call.again) check_again(given.input, call);
  }
  static bool by_number(ModelFault::Kind k) {
    using K = ModelFault::Kind;
    return k == K::sphere || k == K::pose || k == K::shape_sphere || k == K::shape_index;
  }

  // Poses that the detector must not look at say something else.
  void mislead(ModelWorld& w, Call& call) {
    std::vector<bool> named(w.bodies.size(), call.form.poses);
    for (const std::uint32_t b : call.moved) named[b] = true;
    const bool wild = call.dice.chance(0.5);
    if (!call.dice.chance(0.7)) return;
    for (std::size_t b = 0; b < w.bodies.size(); b++)
      if (!named[b] || w.bodies[b].is_static)
        for (double& p : w.bodies[b].position) p = wild ? NAN : p + w.unit;
  }

  // The call itself, and whether what it gives is right.
  void make(Call& call, const Input& input) {
    if (call.stages) return check_stages(detector_->stages(input), call);
    if (call.answers)
      return check_answers(detector_->detect_worlds(input, call.worlds, call.answer), call.answer,
                           call.worlds, script_.spheres(), script_.pairs());
    const Contacts& c = detector_->detect(input);
    // In float32 with bins far too large, all pairs may be doubtful: too many to compare.
    if (c.count > 10'000'000)
      call.again = list_known_ = false;
    else
      check(c, call);
  }

  void check(const Contacts& c, Call& call) {
    const CallOptions& o = call.options;
    require(c.spheres == script_.spheres().size(), "spheres: ", c.spheres, ", not ",
            script_.spheres().size());
    require(c.memory == (backend_ == BackendKind::cuda ? o.output : Memory::host),
            "the contacts lie elsewhere");
    require(c.width == o.width && c.scalar == o.scalar, "another width or scalar than asked for");
    require((c.normals == nullptr) == (o.width == Width::pairs) || c.count == 0, "normals");
    require(c.normals == nullptr || o.width != Width::pairs, "normals that nobody asked for");
    require(c.points == nullptr || o.width == Width::points, "points that nobody asked for");
    require(c.points != nullptr || o.width != Width::points || c.count == 0, "no points");
    require(c.seconds.total >= 0 && c.seconds.total < 1e4, "seconds");
    const Lists lists(c);
    check_pairs(lists, c.doubtful, call);
    follow(c, lists);
    require(detector_->hash() == hash_of(lists.pairs), "hash() is not that of the list");
    if (o.width != Width::pairs)
      o.scalar == Scalar::f32 ? check_records<float>(lists, script_.spheres())
                              : check_records<double>(lists, script_.spheres());
    if (call.fresh) check_fresh(lists, call);
    last_lists_ = std::make_unique<Lists>(lists);
  }

  void follow(const Contacts& c, const Lists& lists) {
    const bool wanted = detector_->options().history;
    require(wanted || c.history == nullptr, "a history that nobody asked for");
    require(!wanted || c.history != nullptr || c.count == 0, "no history");
    if (wanted && list_known_) check_history(lists, list_before_);
    list_before_ = lists.pairs, list_known_ = true;
  }

  void check_pairs(const Lists& lists, std::uint64_t doubtful, const Call& call) const {
    const std::vector<Pair>& wanted = script_.pairs();
    std::vector<Pair> found = lists.pairs, missing, excess;
    for (const Pair& p : found) require(p.i < p.j, "the pair ", text(p));
    std::sort(found.begin(), found.end(), before);
    const auto twice = std::adjacent_find(found.begin(), found.end());
    require(twice == found.end(), "the pair ", twice == found.end() ? "" : text(*twice), " is there twice");
    if (found == wanted) return;
    std::set_difference(wanted.begin(), wanted.end(), found.begin(), found.end(), std::back_inserter(missing),
                        before);
    std::set_difference(found.begin(), found.end(), wanted.begin(), wanted.end(), std::back_inserter(excess),
                        before);
    const bool rough = call.options.precision == Precision::float32 && call.options.path == Path::grid;
    require(rough && missing.size() + excess.size() <= doubtful, found.size(), " contacts, wanted ",
            wanted.size(), "; ", missing.size(), " missing",
            missing.empty() ? "" : ", as " + text(missing[0]), "; ", excess.size(), " too many",
            excess.empty() ? "" : ", as " + text(excess[0]), "; doubtful ", doubtful);
  }

  // The same scene, by a detector that has seen nothing.
  void check_fresh(const Lists& lists, Call& call) {
    ModelInput given(script_.world(), call.form, call.dice);
    given.arrange({}, 0, {});
    CallOptions o = call.options;
    o.memory_limit = 0;
    o.threads = call.dice.chance(0.05) ? 2 : 1;
    Detector fresh(DeviceChoice{backend_}, o);
    const Contacts& c = fresh.detect(given.input);
    const Lists other(c);
    if (o.order == Order::stable) {
      require(lists == other, "another list than a fresh detector's, of ", lists.pairs.size(), " and ",
              other.pairs.size());
    } else if (o.precision == Precision::exact) {
      require(fresh.hash() == hash_of(script_.pairs()), "a fresh detector has another hash");
    }
  }
  // The sentence is that of a detector that has seen nothing.
  void check_sentence(Call& call, const std::string& said) {
    if (!call.dice.chance(0.5)) return;
    ModelInput given(script_.world(), call.form, call.dice);
    given.apply(call.fault);
    given.arrange({}, 0, call.fault);
    CallOptions o = call.options;
    o.path = Path::nine_stages, o.bin_size = 0;
    Detector fresh(DeviceChoice{backend_}, o);
    try {
      fresh.detect(given.input);
    } catch (const Error& e) {
      require(said == e.what(), "the sentence is \"", said, "\", a fresh detector's \"", e.what(), "\"");
    }
  }
  void check_again(const Input& input, const Call& call) {
    const Contacts& c = detector_->detect(input);
    const Lists lists(c);
    follow(c, lists);
    require(call.options.order != Order::stable || lists == *last_lists_,
            "another list from the same call again");
    require(call.options.precision == Precision::float32 || hash_of(lists.pairs) == hash_of(script_.pairs()),
            "other contacts from the same call again");
  }
  void check_stages(const Arrays& a, const Call& call) const {
    require(call.fault.kind == ModelFault::Kind::none, "nothing was thrown by stages()");
    std::vector<Pair> found = a.F;
    std::sort(found.begin(), found.end(), before);
    require(found == script_.pairs(), "stages() has ", found.size(), " contacts, wanted ",
            script_.pairs().size());
    require(a.T.size() == script_.spheres().size(), "T of stages()");
  }

  Script script_;
  const BackendKind backend_;
  void* const stream_;
  std::unique_ptr<Detector> detector_;
  std::uint64_t accepted_ = 0;          // revision that the detector knows
  bool dirty_ = true;                   // something changed since that asks for another
  std::vector<std::uint32_t> pending_;  // moved in calls that were left out
  std::unique_ptr<Lists> last_lists_;
  std::vector<Pair> list_before_;  // of the call before, as a history counts it
  bool list_known_ = true;
};

class ModelTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (GetParam() == BackendKind::cuda && !IsSkipped()) stream_ = std::make_unique<TestStream>();
  }

  struct Outcome {
    bool failed = false;
    std::size_t step = 0;
    std::string what, told;
  };
  // Steps 0 to `end` - 1, the calls in `left_out` not made.
  Outcome play(std::uint64_t seed, std::size_t end, const std::vector<bool>& left_out) {
    current_seed = seed;
    Outcome o;
    Sequence s(GetParam(), seed, large_, stream_ ? stream_->get() : nullptr);
    for (o.step = 0; o.step < std::min(end, s.steps()); o.step++) {
      const bool out = o.step < left_out.size() && left_out[o.step];
      std::string told;
      bool valid = true;
      try {
        valid = s.step(o.step, out, told);
      } catch (const Wrong& w) {
        o.failed = true, o.what = w.what;
      } catch (const std::exception& e) {
        o.failed = true, o.what = e.what();
      }
      if (!out) o.told += "  step " + std::to_string(o.step) + ": " + told + "\n";
      if (o.failed || !valid) return o;
    }
    return o;
  }
  // As few calls as still fail.
  Outcome shrink(std::uint64_t seed, Outcome first) {
    std::vector<bool> left_out(first.step, false);
    Outcome least = first;
    for (std::size_t k = 0; k < left_out.size(); k++) {
      left_out[k] = true;
      const Outcome o = play(seed, first.step + 1, left_out);
      if (o.failed && o.step == first.step)
        least = o;
      else
        left_out[k] = false;
    }
    return least;
  }

  void play_all(std::uint64_t usual_count);

  bool large_ = false;
  std::unique_ptr<TestStream> stream_;
};

// The oracle against itself: all pairs and the tree.
TEST(ModelOracle, TreeAndAllPairsAgree) {
  Dice dice(std::random_device{}());
  for (int k = 0; k < 40; k++) {
    ModelWorld w;
    w.strew(dice, 50 + dice.index(600)), w.attributes(dice), w.populate(dice, 500);
    const auto spheres = w.spheres();
    std::vector<Pair> tree, all;
    ASSERT_TRUE(ModelOracle(spheres).contacts(tree, 10'000'000, 0));
    ASSERT_TRUE(ModelOracle(spheres).contacts(all, 10'000'000, ~std::size_t(0)));
    ASSERT_EQ(tree, all) << w.story;
  }
}

void ModelTest::play_all(std::uint64_t usual_count) {
  const std::uint64_t first = model_seed(), count = model_number("PADDER_MODEL_SEQUENCES", usual_count);
  std::printf("seeds %llu to %llu\n", static_cast<unsigned long long>(first),
              static_cast<unsigned long long>(first + count - 1));
  std::fflush(stdout);
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, crashed);
  const StepWatchdog watchdog;
  int failed = 0;
  for (std::uint64_t seed = first; seed < first + count && failed < 5; seed++) {
    if (std::getenv("PADDER_MODEL_VERBOSE"))
      std::printf("seed %llu\n", static_cast<unsigned long long>(seed)), std::fflush(stdout);
    const Outcome o = play(seed, ~std::size_t(0), {});
    if (!o.failed) continue;
    failed++;
    const Outcome least = shrink(seed, o);
    ADD_FAILURE() << "PADDER_MODEL_SEED=" << seed << " step " << o.step << ": " << o.what
                  << "\nleast calls that fail (" << least.what << "):\n"
                  << least.told;
  }
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, SIG_DFL);
}

TEST_P(ModelTest, EveryCallIsThatOfAFreshDetector) { play_all(GetParam() == BackendKind::cuda ? 5000 : 500); }
TEST_P(ModelTest, EveryCallOfALargeSceneIsThatOfAFreshDetector) {
  large_ = true;
  play_all(GetParam() == BackendKind::cuda ? 40 : 1);
}

ON_EVERY_BACKEND(ModelTest);

}  // namespace
}  // namespace padder::detect
