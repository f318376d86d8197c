// SPDX-License-Identifier: MIT
// The calls of a sequence of the model test, drawn from its seed.
#pragma once
#include <cstdlib>
#include <random>
#include <sstream>

#include "tests/detect/model/input.h"

namespace padder::detect {

inline constexpr std::uint64_t kMostContacts = 250'000;  // of a scene, and 12 more for each sphere
inline constexpr double kLeastUnit = 1e-260;             // all that is smaller shares a bin

// What the environment says, or something else.
inline std::uint64_t model_number(const char* name, std::uint64_t otherwise) {
  const char* s = std::getenv(name);
  return s ? std::strtoull(s, nullptr, 10) : otherwise;
}

// Of the first sequence.
inline std::uint64_t model_seed() {
  return model_number("PADDER_MODEL_SEED", std::uint64_t(std::random_device{}()) << 16);
}

// Sizes of lists of loose spheres: about what the code decides by. On the CPU: pieces, batches, parts,
// vectors, chunks, candidates at a time. On the GPU: cells, flows, buckets.
inline std::size_t small_size(Dice& d) {
  return d.of<std::size_t>({0, 1, 2, 3, 7, 8, 9, 20, 31, 33, 63, 64, 65, 100, 129});
}
inline std::size_t usual_size(Dice& d) {
  if (d.chance(0.45)) return small_size(d);
  if (d.chance(0.75)) return d.of<std::size_t>({200, 255, 257, 400, 511, 513, 700, 1000, 1023, 1024, 1025});
  if (d.chance(0.95)) return d.of<std::size_t>({1500, 2047, 2048, 2049, 2500, 4095, 4097});
  return d.of<std::size_t>({6000, 8193, 16383, 16385});
}
inline std::size_t middle_size(Dice& d) {
  return d.chance(0.3) ? usual_size(d) : d.of<std::size_t>({10000, 16385, 20000, 33000, 65537});
}
inline std::size_t large_size(Dice& d) {
  return d.of<std::size_t>({20000, 139'990, 140'001, (1u << 18) - 1, 1u << 18, 299'999, 300'001, 400'000});
}

// One call, and what the world went through before it.
struct Call {
  std::uint64_t number = 0;  // revision
  std::vector<std::uint32_t> moved;
  CallOptions options;
  ModelForm form;
  ModelFault fault;
  bool stages = false, again = false, fresh = false;
  bool answers = false;  // detect_worlds(), of so many worlds
  Answer answer = Answer::any;
  std::uint32_t worlds = 0;
  int handed_on = 0;  // to another Detector before: 1 by construction, 2 by assignment
  Dice dice{0};
};

// A call in words.
inline std::string tell(const Call& c) {
  std::ostringstream t;
  const CallOptions& o = c.options;
  t << (c.stages ? "stages" : "detect") << " revision " << c.number << " [" << c.moved.size() << " moved] ";
  t << (o.path == Path::grid ? "" : "nine_stages ")
    << (o.precision == Precision::float32 ? "fast precision " : "")
    << (o.order == Order::any ? "any order " : "") << "width " << int(o.width) << " f"
    << (o.scalar == Scalar::f32 ? 32 : 64) << " bodies " << int(o.bodies) << " threads " << o.threads
    << " bin " << o.bin_size << (o.output == Memory::device ? " output device" : "")
    << (o.timings ? " timings" : "") << (o.own == Region{} ? "" : " own") << (o.history ? " history" : "");
  if (o.margin != 0) t << " margin " << o.margin;
  t << "; in f" << (c.form.scalar == Scalar::f32 ? 32 : 64) << " layout " << c.form.layout
    << (c.form.memory == Memory::device ? " device" : "") << (c.form.poses ? " poses" : "")
    << (c.form.poses && c.form.pose_memory == Memory::device ? " on device" : "");
  if (c.handed_on) t << "; handed on " << c.handed_on;
  if (c.fault.kind != ModelFault::Kind::none)
    t << "; FAULT " << name_of(c.fault.kind) << " at " << c.fault.at << " in " << c.fault.in << " value "
      << c.fault.value << " limit " << o.memory_limit;
  return t.str();
}

// Draws the calls of a sequence. What it draws depends on the seed alone, not on what the detector answers.
class Script {
 public:
  // `large`: of scenes for which the GPU has ways of its own.
  Script(BackendKind backend, std::uint64_t seed, bool large)
      : dice_(mixed(seed)), cuda_(backend == BackendKind::cuda) {
    options_.threads = 1;
    const double kind = dice_.between(0, 1);
    with_loose_ = kind<0.85, with_bodies_ = kind> 0.4;
    revisions_ = dice_.chance(with_bodies_ ? 0.8 : 0.5);
    size_ = large ? large_size : dice_.chance(0.002) ? middle_size : usual_size;
    steps_ = size_ == usual_size ? 5 + dice_.index(9) : 4 + dice_.index(4);
    world_.floats = dice_.chance(0.6);
    form_.scalar = world_.floats && dice_.chance(0.7) ? Scalar::f32 : Scalar::f64;
    begin();
    if (!world_.floats && dice_.chance(0.1)) {
      const double by = dice_.of({1e-310, 1e-200, 1e-160, 1e-140, 1e-90, 1e-40, 1e40, 1e85});
      if (by < kLeastUnit) size_ = small_size, begin();
      world_.scale(by);
    }
  }
  std::size_t steps() const { return steps_; }
  const ModelWorld& world() const { return world_; }
  const std::vector<Seen>& spheres() const { return spheres_; }
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
    while (!find()) {  // too many contacts: another scene
      heavy_ = true, call.number = call.number == last_ ? 0 : call.number;
      std::fill_n(world_.center, 3, 0.0);
      options_.margin = call.options.margin = 0;
      call.moved.clear(), begin(), change_form(), call.form = form_;
    }
    if (stages_cost() > 3e5) options_.path = call.options.path = Path::grid;
    if (spheres_.size() > 3000 && blurred()) options_.precision = call.options.precision = Precision::exact;
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
      world_.loose.clear(), world_.family.clear(), world_.mask.clear(), world_.world.clear(),
          world_.still.clear();
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
    for (std::size_t k = call.moved.size(); k > 1; k--)
      std::swap(call.moved[k - 1], call.moved[dice_.index(k)]);
  }
  void to_other_numbers() {
    if (world_.floats)
      world_.floats = false, world_.tell("doubles");
    else
      world_.to_floats(dice_);
  }

  void change_options() {
    CallOptions& o = options_;
    if (dice_.chance(0.15)) o.path = dice_.chance(0.25) ? Path::nine_stages : Path::grid;
    if (dice_.chance(0.1)) o.precision = dice_.chance(0.3) ? Precision::float32 : Precision::exact;
    if (dice_.chance(0.1)) o.order = dice_.chance(0.3) ? Order::any : Order::stable;
    if (dice_.chance(0.2)) o.width = dice_.of({Width::pairs, Width::normals, Width::points});
    if (dice_.chance(0.1)) o.scalar = dice_.of({Scalar::f32, Scalar::f64});
    if (cuda_ && dice_.chance(0.1)) o.output = dice_.of({Memory::host, Memory::device});
    if (dice_.chance(0.15)) o.bodies = dice_.of({Bodies::automatic, Bodies::first, Bodies::expanded});
    o.threads = dice_.chance(0.05) ? dice_.of({2, 3, 0})
                                   : 1;  // seldom: where cores are busy, threads wait for each other
    if (dice_.chance(0.1)) o.timings = !o.timings;
    if (dice_.chance(0.1)) o.memory_limit = o.memory_limit ? 0 : std::uint64_t(1) << 40;
    if (dice_.chance(0.1))
      o.bin_size = dice_.chance(0.5) ? 0 : world_.unit * dice_.of({0.01, 1.0, 2.5, 16.0, 200.0});
    if (world_.loose.size() > 20000) o.bin_size = 0;
    if (dice_.chance(0.1)) margin_ = dice_.of({0.0, 0.0, 1e-9, 0.01, 0.2, 2.0});
    o.margin = margin_ * world_.unit;
    if (dice_.chance(0.1)) o.history = !o.history;
    if (dice_.chance(0.15)) {
      o.own = {};
      for (int c = 0; c < 3 && dice_.chance(0.6); c++)
        (dice_.chance(0.5) ? o.own.low : o.own.high)[c] =
            world_.center[c] + world_.edge * dice_.between(-0.4, 0.4);
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
    return ModelOracle(spheres_, options_.own, options_.margin)
        .contacts(pairs_, kMostContacts + 12 * spheres_.size());
  }

  // So far out, or so small, that float alone could take every pair for a contact.
  bool blurred() const {
    double extent = 0;
    for (const double c : world_.center) extent = std::max(extent, std::abs(c));
    return world_.unit < kLeastUnit || extent > 1e9 * world_.unit;
  }

  // Entries of the bins of the nine stages, or pairs tested in given bins, about.
  double stages_cost() const {
    if (options_.bin_size == 0)
      return options_.path == Path::nine_stages ? 600.0 * static_cast<double>(spheres_.size()) : 0;
    double entries = 0;
    for (const Seen& s : spheres_) {  // with the hair by which the stages widen a sphere
      const double far = std::max({std::abs(s.sphere.x), std::abs(s.sphere.y), std::abs(s.sphere.z)});
      const double reach = s.sphere.r + options_.margin + 0x1p-47 * far;
      entries += std::pow(2 * reach / options_.bin_size + 2, 3);
    }
    return options_.path == Path::nine_stages ? entries : 0;
  }

  void decide(Call& call) {
    call.dice = Dice(dice_.bits());
    call.handed_on = dice_.chance(0.04) ? 1 + static_cast<int>(dice_.index(2)) : 0;
    call.again = dice_.chance(0.15);
    const bool large = spheres_.size() > 20000;
    call.fresh = dice_.chance(large ? 0.3 : cuda_ ? 0.25 : 0.6);
    if (dice_.chance(0.15)) call.fault = draw_fault(call);
    call.stages = call.fault.kind == ModelFault::Kind::stages_bin_size ||
                  (call.fault.kind == ModelFault::Kind::none && spheres_.size() < 3000 &&
                   call.options.bin_size == 0 && dice_.chance(0.04));
    if (!call.stages && dice_.chance(0.15)) draw_answers(call);
    if (call.stages || call.answers) call.again = call.fresh = false;
    // The second call would have a list before, which takes memory.
    if (call.fault.kind == ModelFault::Kind::limit && call.options.history) call.again = false;
  }
  // Not where a number of a world is so large that there would be more answers than spheres by far.
  void draw_answers(Call& call) {
    using K = ModelFault::Kind;
    std::uint32_t worlds = 0;
    const auto ask_for = [&](std::uint32_t world) {
      if (world != kEveryWorld) worlds = std::max(worlds, world + 1);
    };
    for (const Body& b : world_.bodies) ask_for(b.world);
    for (const Seen& s : spheres_) ask_for(s.world);
    if (worlds > 20000 || call.fault.kind == K::bin_size) return;
    call.answers = true, call.answer = dice_.of({Answer::any, Answer::count, Answer::distance});
    call.worlds = worlds + static_cast<std::uint32_t>(dice_.index(3));
    if (worlds > 0 && call.fault.kind == K::none && dice_.chance(0.03)) {
      call.worlds = static_cast<std::uint32_t>(dice_.index(worlds));
      call.fault.kind = K::world, call.fault.says = "world";
    }
  }

  ModelFault draw_fault(Call& call) {
    using K = ModelFault::Kind;
    ModelFault f;
    f.kind = static_cast<K>(1 + dice_.index(static_cast<std::size_t>(K::world) - 1));
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
        f.says = f.in == 3 && form_.layout == 3
                     ? "sphere "
                     : "sphere " + std::to_string(world_.body_spheres() + f.at) + " ";
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
      case K::shape_index:
        fits = bodies > 0 && !known, f.says = "names shape";
        break;
      case K::moved:
        f.says = "moved";
        break;
      case K::margin:
        call.options.margin = dice_.of({-1.0, double(NAN), double(INFINITY), 2e100}), f.says = "margin";
        break;
      case K::own:
        (f.in % 2 ? call.options.own.low : call.options.own.high)[f.in % 3] = NAN;
        break;
      case K::limit:
        call.options.memory_limit = static_cast<std::uint64_t>(std::pow(10, dice_.between(2, 7.5))),
        f.says = " bytes of ";
        break;
      case K::pointer:
        fits = loose > 0, f.says = "pointer";
        break;
      case K::stride:
        f.says = "stride";
        break;
      case K::device_memory:
        fits = !cuda_ && (f.in % 2 ? form_.poses && bodies > 0 : loose > 0), f.says = "device memory";
        break;
      case K::too_many:
        fits = loose > 0 && (f.in % 2 == 0 || world_.body_spheres() > 0), f.says = "spheres are more";
        break;
      default:
        break;
    }
    return fits ? f : ModelFault{};
  }

  Dice dice_;
  const bool cuda_;
  bool with_loose_, with_bodies_, revisions_;
  std::size_t (*size_)(Dice&);
  std::size_t steps_;
  ModelWorld world_;
  CallOptions options_;
  double margin_ = 0;  // in units of the world
  ModelForm form_;
  std::uint64_t last_ = 0;             // revision of the call before
  bool heavy_ = true, freed_ = false;  // freed_: that call was refused, so that nothing is known
  std::vector<Seen> spheres_;
  std::vector<Pair> pairs_;
};

}  // namespace padder::detect
