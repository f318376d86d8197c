// SPDX-License-Identifier: MIT
// State between calls of a detector that shares a scene among boxes, GPUs or ranks: the random sequences of
// the model test (script.h), each call against the oracle. The contacts are those of one Detector, whatever
// the boxes and the revision; a faulty call throws a sentence that names what is at fault, and the next call
// is right. Environment, as in detector_model_test.cpp: PADDER_MODEL_SEED, PADDER_MODEL_SEQUENCES.
#pragma once
#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "padding/asset/error.h"
#include "tests/detect/model/checks.h"

namespace padder::detect {

// What all boxes found together.
struct BoxesFound {
  std::uint64_t spheres = 0, contacts = 0, hash = 0, doubtful = 0;
  bool listed = true;  // false: they were only counted
  std::vector<Pair> pairs;
  std::optional<Lists> lists;  // with normals and points, where they are at hand
};

// Gives a part whose spheres are all of one world no array of worlds.
inline void name_one_world(Spheres& part) {
  const std::span<const std::uint32_t> worlds(part.world, part.world ? part.count : 0);
  if (!worlds.empty() && std::ranges::all_of(worlds, [&](auto w) { return w == worlds[0]; }))
    part.world_of_all = worlds[0], part.world = nullptr;
}

// The detector of a sequence.
class BoxesUnderTest {
 public:
  using Fault = ModelFault::Kind;
  virtual ~BoxesUnderTest() = default;
  virtual BoxesFound detect(const Input& input, Call& call) = 0;  // what it throws is the call's
  virtual bool takes(Fault) const { return true; }                // false: another fault in its place
  virtual bool may_refuse(const Input&, const Call&) const { return false; }  // without a fault
  virtual bool is_wrong(bool here) const { return here; }                     // on any of several processes?
  virtual std::string told() const = 0;
};

class BoxesSequence {
 public:
  BoxesSequence(std::uint64_t seed, BoxesUnderTest& boxes)
      : script_(BackendKind::omp, seed, false), boxes_(boxes), told_(boxes.told()) {}

  // What was wrong, and what was done; or nothing.
  std::string run() {
    for (std::size_t k = 0; k < script_.steps(); k++) {
      Call call = script_.next();
      told_ += "\n  step " + std::to_string(k) + ": " + tell(call) + "; " +
               std::to_string(script_.spheres().size()) + " spheres: " + script_.world().story;
      std::string wrong;
      try {
        carry_out(call);
      } catch (const Wrong& w) {
        wrong = w.what;
      }
      if (boxes_.is_wrong(!wrong.empty())) return wrong + "\n" + told_;
    }
    return {};
  }

 private:
  using Fault = ModelFault::Kind;

  void carry_out(Call& call) {
    call.stages = call.answers = call.options.history = false;
    Fault& fault = call.fault.kind;
    if (fault == Fault::world || !boxes_.takes(fault))  // the script relies on a fault
      fault = Fault::bin_size, call.options.bin_size = -1, call.fault.says = "bin size";
    if (fault == Fault::device_memory) call.fault.says = "host memory";
    ModelInput given(script_.world(), call.form, call.dice);
    given.apply(call.fault);
    given.arrange(call.moved, call.number, call.fault);
    std::string said;
    try {
      check(boxes_.detect(given.input, call), call);
    } catch (const Error& e) {
      said = e.what();
    }
    const bool faulty = fault != Fault::none && fault != Fault::limit,
               refused = fault == Fault::limit || boxes_.may_refuse(given.input, call) ||
                         range_of(call, script_.spheres()) != Range::fits;
    require(!said.empty() || !faulty, "nothing was thrown");
    require(said.empty() || faulty || refused, "it threw: ", said);
    require(said.empty() || refused || said.find(call.fault.says) != said.npos, "the sentence is \"", said,
            "\", without \"", call.fault.says, "\"");
  }

  void check(BoxesFound found, const Call& call) const {
    const std::vector<Pair>& wanted = script_.pairs();
    const bool rough = call.options.precision == Precision::float32 && call.options.path == Path::grid;
    require(found.spheres == script_.spheres().size(), "spheres: ", found.spheres);
    require(rough || found.contacts == wanted.size(), found.contacts, " contacts, wanted ", wanted.size());
    require(rough || found.hash == hash_of(wanted), "another hash");
    if (!found.listed) return;
    std::vector<Pair>& pairs = found.pairs;
    for (const Pair& p : pairs) require(p.i < p.j, "the pair ", text(p));
    std::sort(pairs.begin(), pairs.end(), before);
    require(std::adjacent_find(pairs.begin(), pairs.end()) == pairs.end(), "a pair is there twice");
    require(found.contacts == pairs.size() && found.hash == hash_of(pairs), "the report is of another list");
    std::vector<Pair> differ;
    std::set_symmetric_difference(wanted.begin(), wanted.end(), pairs.begin(), pairs.end(),
                                  std::back_inserter(differ), before);
    require(differ.size() <= (rough ? found.doubtful : 0), pairs.size(), " contacts, wanted ", wanted.size(),
            differ.empty() ? "" : ", not in both: " + text(differ[0]), "; doubtful ", found.doubtful);
    if (!found.lists || call.options.width == Width::pairs) return;
    call.options.scalar == Scalar::f32 ? check_records<float>(*found.lists, script_.spheres())
                                       : check_records<double>(*found.lists, script_.spheres());
  }

  Script script_;
  BoxesUnderTest& boxes_;
  std::string told_;
};

// Plays sequences from seed `first` on, as many as are asked for. What was wrong, or nothing.
inline std::string play_boxes(std::uint64_t first, std::uint64_t usual,
                              const std::function<std::unique_ptr<BoxesUnderTest>(std::uint64_t)>& make) {
  const std::uint64_t count = model_number("PADDER_MODEL_SEQUENCES", usual);
  std::printf("seeds %llu to %llu\n", static_cast<unsigned long long>(first),
              static_cast<unsigned long long>(first + count - 1));
  std::fflush(stdout);
  for (std::uint64_t seed = first; seed < first + count; seed++) {
    const std::unique_ptr<BoxesUnderTest> boxes = make(seed);
    const std::string wrong = BoxesSequence(seed, *boxes).run();
    if (!wrong.empty()) return "PADDER_MODEL_SEED=" + std::to_string(seed) + ": " + wrong;
  }
  return {};
}

}  // namespace padder::detect
