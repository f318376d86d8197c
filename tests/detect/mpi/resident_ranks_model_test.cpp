// SPDX-License-Identifier: MIT
// Random sequences of calls on a ResidentDetector of each rank: cuda/resident_model.h. All ranks make the
// same scenes; each passes a part, on its GPU.
#include "detect/mpi/resident_ranks.h"
#include "tests/detect/cuda/resident_model.h"
#include "tests/detect/mpi/run_tests.h"

namespace padder::detect {
namespace {

class ResidentOnRanks final : public Resident {
 public:
  ResidentOnRanks()
      : Resident(std::vector<int>(static_cast<std::size_t>(ranks), my_rank % gpus()), options(),
                 static_cast<std::size_t>(my_rank)) {}
  BoxesFound detect(const Input& input, Call& call) override {
    BoxesFound f = Resident::detect(input, call);
    f.pairs = of_all_ranks(f.pairs);
    return f;
  }
  bool is_wrong(bool here) const override { return on_any_rank(here); }

 private:
  static ResidentOptions options() {
    ResidentOptions o = on({});
    o.ranks = resident_ranks(MPI_COMM_WORLD);
    return o;
  }
};

TEST(ResidentRanksModel, EveryCallIsThatOfOneDetector) {
  if (gpus() == 0) GTEST_SKIP() << "there is no GPU";
  std::uint64_t first = model_seed();
  MPI_Bcast(&first, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  EXPECT_EQ(play_boxes(first, 15, [](auto) { return std::make_unique<ResidentOnRanks>(); }), "");
}

}  // namespace
}  // namespace padder::detect

int main(int argc, char** argv) { return padder::detect::run_tests(argc, argv); }
