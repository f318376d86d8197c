// State between calls: random sequences of calls on one detector, each call against an oracle (model_oracle.h)
// and against a fresh detector that is given the same scene.
//
// A sequence is drawn from a 64-bit seed. Between two calls the scene changes (model_world.h), and so may the
// options, the type and layout of the arrays (model_input.h), the memory they lie in, and the revision. Some
// calls are faulty. What is taken for the contract, of detector.h:
// - The pairs are those of the oracle, each once, i < j; with Precision::fast at most Contacts::doubtful differ.
// - hash() is the sum over the pairs; 0 after a call that threw and after stages().
// - With Order::fixed the list, normals and points are bit for bit those of a fresh detector and of a second call.
// - Contacts says what was asked for: spheres, memory (host with OpenMP), width, scalar; what was not asked for
//   is null. Normals and points are those of the spheres: 4e-7 relative in float, 1e-14 in double.
// - Under the revision of the call before, a body that is neither named in `moved` nor has a pose in `poses`
//   stands where it stood, and so does every static one, whatever the arrays say: they say something else here.
//   Poses in device memory begin and end with a revision. Loose spheres that move are read in every call.
// - A faulty call throws padder::Error, which names the sphere or body at fault as a fresh detector names it. The
//   next call reads everything, whatever its revision, and is right. A call is refused for a memory limit or right.
// - memory() is never above Options::memory_limit. A detector that was moved from has memory() 0 and throws.
//
// A failing sequence is replayed with as few calls as still fail, and told. Environment:
//   PADDER_MODEL_SEQUENCES  how many; 500 with OpenMP, 5,000 with CUDA
//   PADDER_MODEL_SEED       of the first; drawn when not set, and printed. The k-th has this seed + k
//   PADDER_MODEL_VERBOSE    prints every seed before it runs, and every step
// PADDER_MODEL_SEQUENCES=1 PADDER_MODEL_SEED=s replays sequence s.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include "detect/stages.h"
#include "padding/error.h"
#include "tests/detect/model_input.h"

namespace padder::detect {
namespace {

constexpr std::uint64_t kMostContacts = 600'000;
constexpr double kLongestStep = 60;  // seconds; then the test ends itself

// What went wrong with a call.
struct Wrong {
  std::string what;
};
template <class... Parts>
void require(bool good, const Parts&... parts) {
  if (good) return;
  std::ostringstream text;
  (text << ... << parts);
  throw Wrong{text.str()};
}

// Where the test is: told when the program crashes or a call does not come back.
std::atomic<std::uint64_t> current_seed{0}, current_step{0};
void tell_where() {
  char text[160];
  const int n = std::snprintf(text, sizeof text, "\nmodel test: in step %llu of the sequence of PADDER_MODEL_SEED=%llu\n",
                              static_cast<unsigned long long>(current_step.load()),
                              static_cast<unsigned long long>(current_seed.load()));
  if (write(2, text, static_cast<std::size_t>(n)) < 0) return;
}
void crashed(int signal) {
  tell_where();
  std::signal(signal, SIG_DFL), std::raise(signal);
}
class Watchdog {
 public:
  Watchdog() : thread_([this] { watch(); }) {}
  ~Watchdog() { stop_ = true, thread_.join(); }

 private:
  void watch() {
    std::uint64_t seed = 0, step = 0;
    auto since = std::chrono::steady_clock::now();
    for (; !stop_; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
      const auto now = std::chrono::steady_clock::now();
      if (seed != current_seed || step != current_step) seed = current_seed, step = current_step, since = now;
      if (std::chrono::duration<double>(now - since).count() < kLongestStep) continue;
      tell_where();
      std::fputs("model test: a step takes longer than a minute; the test ends here\n", stderr);
      std::_Exit(3);
    }
  }
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// Sizes of lists of loose spheres: about what the code decides by. On the CPU: pieces, batches, parts, vectors,
// chunks, candidates at a time. On the GPU: cells, flows, buckets.
std::size_t small_size(Dice& d) {
  return d.of<std::size_t>({0, 1, 2, 3, 7, 8, 9, 20, 31, 33, 63, 64, 65, 100, 129});
}
std::size_t usual_size(Dice& d) {
  if (d.chance(0.4)) return small_size(d);
  if (d.chance(0.6)) return d.of<std::size_t>({200, 255, 257, 400, 511, 513, 700, 1000, 1023, 1024, 1025});
  if (d.chance(0.85)) return d.of<std::size_t>({1500, 2047, 2048, 2049, 2500, 4095, 4097});
  return d.of<std::size_t>({6000, 8193, 16383, 16385});
}
std::size_t middle_size(Dice& d) {
  return d.chance(0.3) ? usual_size(d) : d.of<std::size_t>({10000, 16385, 20000, 33000, 65537});
}
std::size_t large_size(Dice& d) {
  return d.of<std::size_t>({20000, 139'990, 140'001, (1u << 18) - 1, 1u << 18, 299'999, 300'001, 400'000});
}

// One call, and what the world went through before it.
struct Call {
  std::uint64_t number = 0;  // revision
  std::vector<std::uint32_t> moved;
  Options options;
  ModelForm form;
  ModelFault fault;
  bool stages = false, again = false, fresh = false, renounce = false;
  int handed_on = 0;  // to another Detector before: 1 by construction, 2 by assignment
  Dice dice{0};
};

// Draws the calls of a sequence. What it draws depends on the seed alone, not on what the detector answers.
class Script {
 public:
  Script(Choice backend, std::uint64_t seed) : dice_(mixed(seed)), cuda_(backend == Choice::cuda) {
    options_.backend = backend, options_.threads = 1;
    const double kind = dice_.between(0, 1);
    with_loose_ = kind < 0.85, with_bodies_ = kind > 0.4;
    revisions_ = dice_.chance(with_bodies_ ? 0.8 : 0.5);
    size_ = dice_.chance(cuda_ ? 0.003 : 0) ? large_size : dice_.chance(0.01) ? middle_size : usual_size;
    steps_ = size_ == usual_size ? 5 + dice_.index(9) : 4 + dice_.index(4);
    world_.floats = dice_.chance(0.6);
    form_.scalar = world_.floats && dice_.chance(0.7) ? Scalar::f32 : Scalar::f64;
    begin();
    if (!world_.floats && dice_.chance(0.1)) world_.scale(dice_.of({1e-40, 1e-90, 1e40, 1e85}));
  }
  std::size_t steps() const { return steps_; }
  const ModelWorld& world() const { return world_; }
  const std::vector<ModelSphere>& spheres() const { return spheres_; }
  const std::vector<Pair>& pairs() const { return pairs_; }  // that the next call is to find
  bool heavy() const { return heavy_; }                      // the last edits asked for another revision

  Call next() {
    world_.story.clear();
    Call call;
    const bool same = revisions_ && last_ != 0 && dice_.chance(0.6);
    heavy_ = !same || freed_;
    const std::uint64_t other = 1 + (last_ + dice_.below(3)) % 4;  // never last_
    call.number = same ? last_ : !revisions_ || dice_.chance(0.2) ? 0 : other;
    edit(call);
    change_options();
    change_form();
    call.options = options_, call.form = form_;
    if (!find()) {  // too many contacts: another scene
      heavy_ = true, call.number = call.number == last_ ? 0 : call.number;
      call.moved.clear(), begin(), call.form = form_, find();
    }
    if (stages_cost() > 3e6) options_.path = call.options.path = Path::fast;
    decide(call);
    last_ = call.number;
    using K = ModelFault::Kind;
    freed_ = call.fault.kind != K::none && call.fault.kind != K::limit;
    return call;
  }

 private:
  void begin() {
    if (with_loose_)
      world_.strew(dice_, size_(dice_)), world_.attributes(dice_);
    else
      world_.loose.clear(), world_.family.clear(), world_.mask.clear(), world_.still.clear();
    world_.bodies.clear();
    if (with_bodies_) world_.populate(dice_, 3000);
  }

  void edit(Call& call) {
    const std::size_t edits = dice_.index(3) + (heavy_ ? 0 : dice_.index(2));
    for (std::size_t k = 0; k < edits && heavy_ && dice_.chance(0.6); k++)
      world_.heavy_edit(dice_, size_, with_bodies_, with_loose_);
    if (heavy_ && dice_.chance(0.03)) to_other_numbers();
    for (std::size_t k = 0; k < edits; k++) {
      if (with_bodies_ && dice_.chance(0.5)) {
        const auto moved = world_.move_bodies(dice_);
        call.moved.insert(call.moved.end(), moved.begin(), moved.end());
      } else if (with_loose_) {
        world_.light_edit_of_loose(dice_);
      }
    }
    while (!world_.bodies.empty() && dice_.chance(0.3))  // named in vain
      call.moved.push_back(static_cast<std::uint32_t>(dice_.index(world_.bodies.size())));
    for (std::size_t k = call.moved.size(); k > 1; k--) std::swap(call.moved[k - 1], call.moved[dice_.index(k)]);
  }
  void to_other_numbers() {
    if (world_.floats)
      world_.floats = false, world_.tell("doubles");
    else
      world_.to_floats(dice_);
  }

  void change_options() {
    Options& o = options_;
    if (dice_.chance(0.15)) o.path = dice_.chance(0.3) ? Path::nine_stages : Path::fast;
    if (dice_.chance(0.1)) o.precision = dice_.chance(0.3) ? Precision::fast : Precision::exact;
    if (dice_.chance(0.1)) o.order = dice_.chance(0.3) ? Order::any : Order::fixed;
    if (dice_.chance(0.2)) o.width = dice_.of({Width::pairs, Width::normals, Width::points});
    if (dice_.chance(0.1)) o.scalar = dice_.of({Scalar::f32, Scalar::f64});
    if (dice_.chance(0.1)) o.output = dice_.of({Memory::host, Memory::device});
    if (dice_.chance(0.15)) o.bodies = dice_.of({Bodies::automatic, Bodies::first, Bodies::expanded});
    if (dice_.chance(0.1)) o.threads = dice_.of({1, 1, 1, 1, 2, 3, 0});
    if (dice_.chance(0.1)) o.timings = !o.timings;
    if (dice_.chance(0.1)) o.memory_limit = o.memory_limit ? 0 : std::uint64_t(1) << 40;
    if (dice_.chance(0.1)) o.bin_size = dice_.chance(0.5) ? 0 : world_.unit * dice_.of({0.01, 1.0, 2.5, 16.0, 200.0});
    if (world_.loose.size() > 20000) o.bin_size = 0;
    if (dice_.chance(0.15)) {
      o.own = {};
      for (int c = 0; c < 3 && dice_.chance(0.6); c++)
        (dice_.chance(0.5) ? o.own.low : o.own.high)[c] = world_.center[c] + world_.edge * dice_.between(-0.4, 0.4);
    }
  }
  void change_form() {
    if (!world_.floats)
      form_.scalar = Scalar::f64;
    else if (dice_.chance(0.1))
      form_.scalar = dice_.of({Scalar::f32, Scalar::f64});
    if (dice_.chance(0.2)) form_.layout = dice_.of({0, 0, 1, 2, 3});
    if (cuda_ && dice_.chance(0.2)) form_.memory = dice_.of({Memory::host, Memory::device});
    if (dice_.chance(0.2) && (heavy_ || form_.pose_memory == Memory::host)) form_.poses = dice_.chance(0.5);
    if (cuda_ && heavy_ && dice_.chance(0.3)) form_.pose_memory = dice_.of({Memory::host, Memory::device});
  }

  bool find() {
    spheres_ = world_.spheres();
    return ModelOracle(spheres_, options_.own).contacts(pairs_, kMostContacts);
  }

  // Entries of the bins of the nine stages, or pairs tested in given bins, about.
  double stages_cost() const {
    if (options_.bin_size == 0) return options_.path == Path::nine_stages ? 100.0 * static_cast<double>(spheres_.size()) : 0;
    double entries = 0;
    for (const ModelSphere& s : spheres_) entries += std::pow(2 * s.at.r / options_.bin_size + 2, 3);
    return options_.path == Path::nine_stages ? entries : 0;
  }

  void decide(Call& call) {
    call.dice = Dice(dice_.bits());
    call.handed_on = dice_.chance(0.04) ? 1 + static_cast<int>(dice_.index(2)) : 0;
    call.again = dice_.chance(0.15);
    const bool large = spheres_.size() > 20000;
    call.fresh = dice_.chance(large ? 0.3 : cuda_ ? 0.25 : 0.7);
    if (dice_.chance(0.15)) call.fault = draw_fault(call);
    double entries = 0;
    for (const ModelSphere& s : spheres_) entries = std::max(entries, s.at.r);
    call.stages = call.fault.kind == ModelFault::Kind::stages_bin_size ||
                  (call.fault.kind == ModelFault::Kind::none && spheres_.size() < 3000 && call.options.bin_size == 0 &&
                   dice_.chance(0.04));
    if (call.stages) call.again = call.fresh = false;
  }

  ModelFault draw_fault(Call& call) {
    using K = ModelFault::Kind;
    ModelFault f;
    f.kind = static_cast<K>(1 + dice_.index(static_cast<std::size_t>(K::last) - 1));
    f.in = dice_.index(60);
    const std::size_t bodies = world_.bodies.size(), loose = world_.loose.size();
    const bool known = !heavy_, wide = form_.scalar == Scalar::f64;
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e101, -1e101};
    f.value = bad[dice_.index(wide ? 5 : 3)];
    f.at = dice_.index(f.kind == K::sphere ? loose : bodies);
    bool fits = true;
    switch (f.kind) {
      case K::bin_size:
      case K::stages_bin_size:
        call.options.bin_size = dice_.of({-1.0, double(NAN), double(INFINITY), 1e101}), f.says = "bin size";
        break;
      case K::sphere:
        f.in %= 4, fits = loose > 0 && !(known && world_.is_still(f.at));
        if (f.in == 3 && dice_.chance(0.4)) f.value = -world_.unit;
        f.says = f.in == 3 && form_.layout == 3 ? "sphere " : "sphere " + std::to_string(world_.body_spheres() + f.at) + " ";
        break;
      case K::pose:
        f.value = bad[f.in % 5], fits = bodies > 0 && !world_.shapes[world_.bodies[f.at].shape].empty() &&
                                 !(known && world_.bodies[f.at].is_static);
        if (fits) call.moved.push_back(static_cast<std::uint32_t>(f.at));
        f.says = "(number 0 of body " + std::to_string(f.at) + ")";
        break;
      case K::shape_sphere:
        fits = bodies > 0 && !known && !world_.shapes[world_.bodies[f.at].shape].empty();
        if (fits) f.in %= world_.shapes[world_.bodies[f.at].shape].size();
        f.value = bad[dice_.index(5)], f.says = " of body ";
        break;
      case K::shape_index: fits = bodies > 0 && !known, f.says = "names shape"; break;
      case K::moved: f.says = "moved"; break;
      case K::own: (f.in % 2 ? call.options.own.low : call.options.own.high)[f.in % 3] = NAN; break;
      case K::limit:
        call.options.memory_limit = static_cast<std::uint64_t>(std::pow(10, dice_.between(2, 7.5))), f.says = " bytes of ";
        break;
      case K::pointer: fits = loose > 0, f.says = "pointer"; break;
      case K::stride: f.says = "stride"; break;
      case K::device_memory:
        fits = !cuda_ && (f.in % 2 ? form_.poses && bodies > 0 : loose > 0), f.says = "device memory";
        break;
      case K::too_many: fits = loose > 0 && (f.in % 2 == 0 || world_.body_spheres() > 0), f.says = "spheres are more"; break;
      default: break;
    }
    return fits ? f : ModelFault{};
  }

  Dice dice_;
  const bool cuda_;
  bool with_loose_, with_bodies_, revisions_;
  std::size_t (*size_)(Dice&);
  std::size_t steps_;
  ModelWorld world_;
  Options options_;
  ModelForm form_;
  std::uint64_t last_ = 0;             // revision of the call before
  bool heavy_ = true, freed_ = false;  // freed_: that call was refused, so that nothing is known
  std::vector<ModelSphere> spheres_;
  std::vector<Pair> pairs_;
};

// What a call gave, on the host.
struct Lists {
  std::vector<Pair> pairs;
  std::vector<std::byte> normals, points;
  explicit Lists(const Contacts& c) {
    const std::size_t scalar = c.scalar == Scalar::f32 ? 4 : 8;
    pairs.resize(c.count);
    if (c.normals) normals.resize(c.count * 4 * scalar);
    if (c.points) points.resize(c.count * 6 * scalar);
    const auto copy = [&](void* to, const void* from, std::size_t bytes) {
      if (bytes == 0) return;
      require(from != nullptr, "an array of the contacts is null");
      c.memory == Memory::device ? copy_from_device(to, from, bytes) : void(std::memcpy(to, from, bytes));
    };
    copy(pairs.data(), c.pairs, c.count * sizeof(Pair));
    copy(normals.data(), c.normals, normals.size()), copy(points.data(), c.points, points.size());
  }
  friend bool operator==(const Lists&, const Lists&) = default;
};

bool before(const Pair& a, const Pair& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; }
std::uint64_t hash_of(const std::vector<Pair>& pairs) {
  std::uint64_t sum = 0;
  for (const Pair& p : pairs) sum += pair_hash(p.i, p.j);
  return sum;
}
std::string text(const Pair& p) { return "(" + std::to_string(p.i) + ", " + std::to_string(p.j) + ")"; }

// Normals, depths and points of some of the contacts, in long double.
template <class T>
void check_records(const Lists& lists, const std::vector<ModelSphere>& spheres) {
  using Long = long double;
  const bool single = sizeof(T) == 4;
  const Long relative = single ? 4e-7 : 1e-14, least = single ? 1e-30 : 1e-140;
  const auto* normals = reinterpret_cast<const T*>(lists.normals.data());
  const auto* points = lists.points.empty() ? nullptr : reinterpret_cast<const T*>(lists.points.data());
  const std::size_t step = 1 + lists.pairs.size() / 100;
  for (std::size_t k = 0; k < lists.pairs.size(); k += step) {
    const Pair p = lists.pairs[k];
    const Sphere &a = spheres[p.i].at, &b = spheres[p.j].at;
    const Long x[3] = {Long(b.x) - a.x, Long(b.y) - a.y, Long(b.z) - a.z}, s = Long(a.r) + b.r,
               d = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    if (s < least) continue;
    const T* n = normals + 4 * k;
    require(std::abs(Long(n[3]) - (s - d)) <= relative * (s + d), "depth of ", text(p), " is ", n[3], ", not ",
            double(s - d));
    const Long per_d = d > 0 ? 1 / d : 0, c[6] = {a.x, a.y, a.z, b.x, b.y, b.z};
    if (d > 0 && !(d > least)) continue;
    for (int q = 0; q < 3; q++) {
      const Long wanted = d > 0 ? x[q] * per_d : q == 0;
      require(std::abs(n[q] - wanted) <= 3 * relative, "normal of ", text(p), " has ", n[q], ", not ", double(wanted));
      if (!points) continue;
      const Long on_i = c[q] + a.r * wanted, on_j = c[3 + q] - b.r * wanted;
      const T* at = points + 6 * k;
      require(std::abs(at[q] - on_i) <= 3 * relative * (std::abs(c[q]) + a.r) &&
                  std::abs(at[3 + q] - on_j) <= 3 * relative * (std::abs(c[3 + q]) + b.r),
              "points of ", text(p), " are ", at[q], " and ", at[3 + q], ", not ", double(on_i), " and ", double(on_j));
    }
  }
}

class Sequence {
 public:
  Sequence(Choice backend, std::uint64_t seed, void* stream)
      : script_(backend, seed), backend_(backend), stream_(stream) {
    Options o;
    o.backend = backend;
    detector_ = std::make_unique<Detector>(o);
  }
  std::size_t steps() const { return script_.steps(); }

  // Throws Wrong. The world changes where the call is left out, too. False: a call left out would have been
  // needed, for what changed asks for it.
  bool step(std::size_t k, bool left_out, std::string& told) {
    current_step = k;
    Call call = script_.next();
    if (script_.heavy()) dirty_ = true;
    told = tell(call) + "; " + std::to_string(script_.spheres().size()) + " spheres: " + script_.world().story;
    if (std::getenv("PADDER_MODEL_VERBOSE")) std::printf("  step %zu%s: %s\n", k, left_out ? " (left out)" : "", told.c_str());
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
  static std::string tell(const Call& c) {
    std::ostringstream t;
    const Options& o = c.options;
    t << (c.stages ? "stages" : "detect") << " revision " << c.number << " [" << c.moved.size() << " moved] ";
    t << (o.path == Path::fast ? "" : "nine_stages ") << (o.precision == Precision::fast ? "fast precision " : "")
      << (o.order == Order::any ? "any order " : "") << "width " << int(o.width) << " f" << (o.scalar == Scalar::f32 ? 32 : 64)
      << " bodies " << int(o.bodies) << " threads " << o.threads << " bin " << o.bin_size
      << (o.output == Memory::device ? " output device" : "") << (o.timings ? " timings" : "")
      << (o.own == Region{} ? "" : " own") << "; in f" << (c.form.scalar == Scalar::f32 ? 32 : 64) << " layout " << c.form.layout
      << (c.form.memory == Memory::device ? " device" : "") << (c.form.poses ? " poses" : "")
      << (c.form.poses && c.form.pose_memory == Memory::device ? " on device" : "");
    if (c.handed_on) t << "; handed on " << c.handed_on;
    if (c.fault.kind != ModelFault::Kind::none)
      t << "; FAULT " << name_of(c.fault.kind) << " at " << c.fault.at << " in " << c.fault.in << " value " << c.fault.value
        << " limit " << o.memory_limit;
    return t.str();
  }

  // The detector's contents to another object, and the one that is left is looked at.
  void hand_on(Call& call) {
    if (call.handed_on == 0) return;
    const std::uint64_t hash = detector_->hash();
    auto other = std::make_unique<Detector>(call.options);
    if (call.handed_on == 1) {
      other = std::make_unique<Detector>(std::move(*detector_));
      require(other->hash() == hash, "another hash after a move");
    } else {
      const double ball[] = {0, 0, 0, 1, 1, 0, 0, 1};
      Input input;
      input.spheres = spheres_of<double>(2, ball, ball + 3);
      input.spheres.center_stride = input.spheres.radius_stride = 4, input.revision = 77;
      other->options() = {}, other->options().backend = backend_;
      other->detect(input);
      *detector_ = std::move(*other);
      accepted_ = 0;
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
    // Stages threw, or a call before this one: what is known, and what is dirty, is settled by this call.
    const std::uint64_t before = accepted_;
    accepted_ = 0;
    call.options.backend = backend_;
    detector_->options() = call.options;
    bool threw = false;
    std::string said;
    try {
      if (call.stages) {
        check_stages(detector_->stages(given.input), call);
      } else {
        const Contacts& c = detector_->detect(given.input);
        check(c, call);
      }
    } catch (const Error& e) {
      threw = true, said = e.what();
    }
    (void)before;
    const std::uint64_t limit = call.options.memory_limit;
    require(limit == 0 || detector_->memory() <= limit, "memory() is ", detector_->memory(), " under a limit of ", limit);
    const bool range = out_of_range(call.options);
    const bool must = (call.fault.kind != K::none && call.fault.kind != K::limit) || range;
    require(threw || !must, "nothing was thrown");
    require(!threw || must || call.fault.kind == K::limit, "it threw: ", said);
    if (threw || call.stages) require(detector_->hash() == 0, "hash() is not 0 after a call without contacts");
    if (threw) {
      require(said.size() > 20 && said.find(' ') != said.npos, "no sentence: ", said);
      require(range || said.find(call.fault.says) != said.npos, "the sentence is \"", said, "\", without \"", call.fault.says, "\"");
      if (!range && by_number(call.fault.kind)) check_sentence(call, said);
      return;
    }
    dirty_ = false;
    if (call.stages) return;
    accepted_ = call.number;
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

  bool out_of_range(const Options& o) const {
    double extent = 0, radius = 0;
    for (const ModelSphere& s : script_.spheres()) {
      extent = std::max({extent, std::abs(s.at.x), std::abs(s.at.y), std::abs(s.at.z)});
      radius = std::max(radius, s.at.r);
    }
    return o.width != Width::pairs && o.scalar == Scalar::f32 && extent + radius > 1e38;
  }

  void check(const Contacts& c, Call& call) {
    const Options& o = call.options;
    require(c.spheres == script_.spheres().size(), "spheres: ", c.spheres, ", not ", script_.spheres().size());
    require(c.memory == (backend_ == Choice::cuda ? o.output : Memory::host), "the contacts lie elsewhere");
    require(c.width == o.width && c.scalar == o.scalar, "another width or scalar than asked for");
    require((c.normals == nullptr) == (o.width == Width::pairs) || c.count == 0, "normals");
    require(c.normals == nullptr || o.width != Width::pairs, "normals that nobody asked for");
    require(c.points == nullptr || o.width == Width::points, "points that nobody asked for");
    require(c.points != nullptr || o.width != Width::points || c.count == 0, "no points");
    require(c.seconds.total >= 0 && c.seconds.total < 1e4, "seconds");
    const Lists lists(c);
    check_pairs(lists, c.doubtful, call);
    require(detector_->hash() == hash_of(lists.pairs), "hash() is not that of the list");
    if (o.width != Width::pairs)
      o.scalar == Scalar::f32 ? check_records<float>(lists, script_.spheres()) : check_records<double>(lists, script_.spheres());
    if (call.fresh) check_fresh(lists, call);
    last_lists_ = std::make_unique<Lists>(lists);
  }

  void check_pairs(const Lists& lists, std::uint64_t doubtful, const Call& call) const {
    const std::vector<Pair>& wanted = script_.pairs();
    std::vector<Pair> found = lists.pairs, missing, excess;
    for (const Pair& p : found) require(p.i < p.j, "the pair ", text(p));
    std::sort(found.begin(), found.end(), before);
    const auto twice = std::adjacent_find(found.begin(), found.end());
    require(twice == found.end(), "the pair ", twice == found.end() ? "" : text(*twice), " is there twice");
    if (found == wanted) return;
    std::set_difference(wanted.begin(), wanted.end(), found.begin(), found.end(), std::back_inserter(missing), before);
    std::set_difference(found.begin(), found.end(), wanted.begin(), wanted.end(), std::back_inserter(excess), before);
    const bool rough = call.options.precision == Precision::fast && call.options.path == Path::fast;
    require(rough && missing.size() + excess.size() <= doubtful, found.size(), " contacts, wanted ", wanted.size(), "; ",
            missing.size(), " missing", missing.empty() ? "" : ", as " + text(missing[0]), "; ", excess.size(), " too many",
            excess.empty() ? "" : ", as " + text(excess[0]), "; doubtful ", doubtful);
  }

  // The same scene, by a detector that has seen nothing.
  void check_fresh(const Lists& lists, Call& call) {
    ModelInput given(script_.world(), call.form, call.dice);
    given.arrange({}, 0, {});
    Options o = call.options;
    o.memory_limit = 0, o.backend = backend_;
    if (call.dice.chance(0.5)) o.threads = call.dice.of({1, 1, 2});
    Detector fresh(o);
    const Contacts& c = fresh.detect(given.input);
    const Lists other(c);
    if (o.order == Order::fixed) {
      require(lists == other, "another list than a fresh detector's, of ", lists.pairs.size(), " and ", other.pairs.size());
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
    Options o = call.options;
    o.backend = backend_, o.path = Path::nine_stages, o.bin_size = 0;
    Detector fresh(o);
    try {
      fresh.detect(given.input);
    } catch (const Error& e) {
      require(said == e.what(), "the sentence is \"", said, "\", a fresh detector's \"", e.what(), "\"");
    }
  }
  void check_again(const Input& input, const Call& call) {
    const Lists lists(detector_->detect(input));
    require(call.options.order != Order::fixed || lists == *last_lists_, "another list from the same call again");
    require(call.options.precision == Precision::fast || hash_of(lists.pairs) == hash_of(script_.pairs()),
            "other contacts from the same call again");
  }
  void check_stages(const Arrays& a, const Call& call) const {
    require(call.fault.kind == ModelFault::Kind::none, "nothing was thrown by stages()");
    std::vector<Pair> found = a.F;
    std::sort(found.begin(), found.end(), before);
    require(found == script_.pairs(), "stages() has ", found.size(), " contacts, wanted ", script_.pairs().size());
    require(a.T.size() == script_.spheres().size(), "T of stages()");
  }

  Script script_;
  const Choice backend_;
  void* const stream_;
  std::unique_ptr<Detector> detector_;
  std::uint64_t accepted_ = 0;  // revision that the detector knows
  bool dirty_ = true;           // something changed since that asks for another
  std::vector<std::uint32_t> pending_;  // moved in calls that were left out
  std::unique_ptr<Lists> last_lists_;
};

class ModelTest : public testing::TestWithParam<Choice> {
 protected:
  void SetUp() override {
    if (GetParam() == Choice::cuda && !cuda_present()) GTEST_SKIP() << "no GPU that this build can use";
    if (GetParam() == Choice::cuda) stream_ = std::make_unique<TestStream>();
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
    Sequence s(GetParam(), seed, stream_ ? stream_->get() : nullptr);
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

  std::unique_ptr<TestStream> stream_;
};

std::uint64_t number_from(const char* name, std::uint64_t otherwise) {
  const char* s = std::getenv(name);
  return s ? std::strtoull(s, nullptr, 10) : otherwise;
}

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

TEST_P(ModelTest, EveryCallIsThatOfAFreshDetector) {
  const std::uint64_t first = number_from("PADDER_MODEL_SEED", std::uint64_t(std::random_device{}()) << 16),
                      count = number_from("PADDER_MODEL_SEQUENCES", GetParam() == Choice::cuda ? 5000 : 500);
  std::printf("seeds %llu to %llu\n", static_cast<unsigned long long>(first),
              static_cast<unsigned long long>(first + count - 1));
  std::fflush(stdout);
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, crashed);
  const Watchdog watchdog;
  int failed = 0;
  for (std::uint64_t seed = first; seed < first + count && failed < 5; seed++) {
    if (std::getenv("PADDER_MODEL_VERBOSE")) std::printf("seed %llu\n", static_cast<unsigned long long>(seed)), std::fflush(stdout);
    const Outcome o = play(seed, ~std::size_t(0), {});
    if (!o.failed) continue;
    failed++;
    const Outcome least = shrink(seed, o);
    ADD_FAILURE() << "PADDER_MODEL_SEED=" << seed << " step " << o.step << ": " << o.what << "\nleast calls that fail ("
                  << least.what << "):\n"
                  << least.told;
  }
  for (const int s : {SIGSEGV, SIGABRT, SIGFPE}) std::signal(s, SIG_DFL);
}

std::string name_of_backend(const testing::TestParamInfo<Choice>& info) {
  return info.param == Choice::omp ? "omp" : "cuda";
}
INSTANTIATE_TEST_SUITE_P(Backends, ModelTest, testing::Values(Choice::omp, Choice::cuda), name_of_backend);

}  // namespace
}  // namespace padder::detect
