// SPDX-License-Identifier: MIT
// Random sequences of calls on a RankDetector: model/boxes_sequence.h. All ranks make the same scenes; each
// passes a part.
#include "detect/mpi/rank_detector.h"
#include "tests/detect/model/boxes_sequence.h"
#include "tests/detect/mpi/run_tests.h"

namespace padder::detect {
namespace {

class OnRanks final : public BoxesUnderTest {
 public:
  OnRanks() : detector_(MPI_COMM_WORLD, on_cpu()) {}
  BoxesFound detect(const Input& input, Call& call) override {
    if (call.handed_on) detector_ = RankDetector(std::move(detector_));
    detector_.options() = call.options;
    const Input part = part_of_moved(input);
    BoxesFound f;
    f.listed = call.dice.chance(0.7);
    std::vector<Pair> mine;
    const ContactConsumer take = [&](const ContactBatch& batch) {
      for (const WidePair& p : batch.pairs)
        mine.push_back({static_cast<std::uint32_t>(p.i), static_cast<std::uint32_t>(p.j)});
    };
    const RankReport& r = detector_.detect(part, f.listed ? take : ContactConsumer{});
    require(!f.listed || r.own_contacts == mine.size(), "own contacts: ", r.own_contacts);
    f.spheres = r.spheres, f.contacts = r.contacts, f.hash = r.hash, f.doubtful = r.doubtful;
    f.pairs = of_all_ranks(mine);
    return f;
  }
  // No part of an input without pointers, or of so many spheres.
  bool takes(Fault f) const override { return f != Fault::pointer && f != Fault::too_many; }
  bool is_wrong(bool here) const override { return on_any_rank(here); }
  std::string told() const override {
    return "rank " + std::to_string(my_rank) + " of " + std::to_string(ranks);
  }

 private:
  static RankOptions on_cpu() {
    RankOptions o;
    o.device = {BackendKind::omp, 0};
    return o;
  }
  Input part_of_moved(const Input& input) {
    Input part = part_of(input, my_rank, ranks);
    const Part bodies = part_of(input.bodies.size(), my_rank, ranks);
    moved_.clear();
    for (const std::uint32_t k : input.moved)  // an index out of range goes to the last rank
      if (k >= bodies.first && (k < bodies.end || my_rank + 1 == ranks))
        moved_.push_back(k - static_cast<std::uint32_t>(bodies.first));
    part.moved = moved_;
    name_one_world(part.spheres);
    return part;
  }
  RankDetector detector_;
  std::vector<std::uint32_t> moved_;
};

TEST(RanksModel, EveryCallIsThatOfOneDetector) {
  std::uint64_t first = model_seed();
  MPI_Bcast(&first, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  EXPECT_EQ(play_boxes(first, 15, [](auto) { return std::make_unique<OnRanks>(); }), "");
}

}  // namespace
}  // namespace padder::detect

int main(int argc, char** argv) { return padder::detect::run_tests(argc, argv); }
