// SPDX-License-Identifier: MIT
// Random sequences of calls on a BoxedDetector: boxes_sequence.h.
#include <gtest/gtest.h>

#include "detect/boxes/boxed_detector.h"
#include "tests/detect/model/boxes_sequence.h"

namespace padder::detect {
namespace {

class Boxed final : public BoxesUnderTest {
 public:
  Boxed(BackendKind backend, std::uint64_t seed) {
    Dice dice(mixed(seed ^ 0x626f786573));
    options_.boxes = dice.of({0u, 1u, 2u, 3u, 5u, 8u, 27u, 200u});
    options_.devices.assign(dice.of({1, 1, 2, 3}), {backend, 0});
    if (backend == BackendKind::cuda && dice.chance(0.2)) options_.devices.push_back({BackendKind::omp, 0});
    if (dice.chance(0.15))
      options_.memory_limit = static_cast<std::uint64_t>(std::pow(10, dice.between(5, 8)));
    boxed_ = BoxedDetector(options_);
  }
  BoxesFound detect(const Input& input, Call& call) override {
    if (call.handed_on) boxed_ = BoxedDetector(std::move(boxed_));
    boxed_.options() = call.options;
    try {
      return found(input, call);
    } catch (const Error&) {
      require(boxed_.hash() == 0 && boxed_.report().contacts == 0, "a call that threw has contacts");
      throw;
    }
  }
  bool may_refuse(const Input&, const Call&) const override { return options_.memory_limit != 0; }
  std::string told() const override {
    return std::to_string(options_.boxes) + " boxes on " + std::to_string(options_.devices.size()) +
           " devices, limit " + std::to_string(options_.memory_limit);
  }

 private:
  BoxesFound found(const Input& input, Call& call) {
    BoxesFound f;
    if (call.fault.kind == Fault::too_many || call.dice.chance(0.7)) {
      const Contacts& c = boxed_.detect(input);
      f.lists.emplace(c), f.pairs = f.lists->pairs;
      require(c.width == call.options.width && c.scalar == call.options.scalar, "another width or scalar");
    } else if (call.dice.chance(0.3)) {
      f.listed = false;
      boxed_.detect(input, {});
    } else {
      boxed_.detect(input, [&](const ContactBatch& batch) {
        for (const WidePair& p : batch.pairs)
          f.pairs.push_back({static_cast<std::uint32_t>(p.i), static_cast<std::uint32_t>(p.j)});
      });
    }
    const BoxReport& r = boxed_.report();
    f.spheres = r.spheres, f.contacts = r.contacts, f.hash = r.hash, f.doubtful = r.doubtful;
    return f;
  }

  BoxOptions options_;
  BoxedDetector boxed_;
};

using BoxesModelTest = BackendTest;
TEST_P(BoxesModelTest, EveryCallIsThatOfOneDetector) {
  EXPECT_EQ(
      play_boxes(model_seed(), 100, [](auto seed) { return std::make_unique<Boxed>(GetParam(), seed); }), "");
}

ON_EVERY_BACKEND(BoxesModelTest);

}  // namespace
}  // namespace padder::detect
