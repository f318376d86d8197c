// SPDX-License-Identifier: MIT
#include "detect/mpi/resident_ranks.h"

#if __has_include(<mpi-ext.h>)
#include <mpi-ext.h>  // of Open MPI and MPICH: MPIX_Query_cuda_support
#endif

#include "detect/mpi/messages.h"
#include "detect/mpi/rank_cut.h"
#include "detect/mpi/ranks.h"
#include "detect/mpi/together.h"

namespace padder::detect {
namespace {

bool mpi_reads_device_memory() {
#if defined(MPIX_CUDA_AWARE_SUPPORT) && MPIX_CUDA_AWARE_SUPPORT
  return MPIX_Query_cuda_support() == 1;
#else
  return false;
#endif
}

class MpiRanks final : public ResidentRanks {
 public:
  explicit MpiRanks(MPI_Comm ranks) : ranks_(ranks) {}
  int rank() const override { return ranks_.rank; }
  int count() const override { return ranks_.count; }
  int rank_on_host() const override { return ranks_.rank_on_host; }
  bool reads_device_memory() const override { return mpi_reads_device_memory(); }
  void together(const std::function<void()>& work) const override { detect::together(ranks_, work); }
  void gather(const void* mine, void* all, std::uint64_t bytes) const override {
    const int each = static_cast<int>(bytes);
    mpi_check(MPI_Allgather(mine, each, MPI_BYTE, all, each, MPI_BYTE, ranks_), "gather");
  }
  void transpose(const std::uint64_t* to, std::uint64_t* from) const override {
    mpi_check(MPI_Alltoall(to, 1, MPI_UINT64_T, from, 1, MPI_UINT64_T, ranks_), "tell what comes");
  }
  void add_up(std::span<double> values) const override {
    mpi_check(MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_SUM,
                            ranks_),
              "add up");
  }
  BoxTree cut(const std::vector<WeightedPoint>& points) const override {
    return cut_among_ranks(ranks_, points);
  }
  void exchange(std::span<const RankMessage> to, std::span<const RankMessage> from) const override {
    Messages messages(ranks_);
    for (const RankMessage& m : from) messages.receive(m.rank, m.at, m.bytes);
    for (const RankMessage& m : to) messages.send(m.rank, m.at, m.bytes);
    messages.wait();
  }

 private:
  Ranks ranks_;
};

}  // namespace

std::shared_ptr<ResidentRanks> resident_ranks(MPI_Comm ranks) { return std::make_shared<MpiRanks>(ranks); }

}  // namespace padder::detect
