// SPDX-License-Identifier: MIT
// Messages between ranks, which do not wait for one another. Internal.
#pragma once
#include <mpi.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "detect/mpi/together.h"

namespace padder::detect {

// What this rank sent to others.
struct Traffic {
  std::uint64_t bytes = 0, messages = 0;
};

// The messages of two ranks come in the order in which they are sent.
class Messages {
 public:
  explicit Messages(MPI_Comm ranks) : ranks_(ranks) {}

  void receive(int rank, void* to, std::uint64_t bytes) {
    each_part(to, bytes, [&](char* at, int some, MPI_Request* request) {
      mpi_check(MPI_Irecv(at, some, MPI_BYTE, rank, kTag, ranks_, request), "receive");
    });
  }
  void send(int rank, void* from, std::uint64_t bytes) {
    each_part(from, bytes, [&](const char* at, int some, MPI_Request* request) {
      mpi_check(MPI_Isend(at, some, MPI_BYTE, rank, kTag, ranks_, request), "send");
      sent_.bytes += static_cast<std::uint64_t>(some), sent_.messages++;
    });
  }
  // Until all have come and gone.
  Traffic wait() {
    mpi_check(MPI_Waitall(static_cast<int>(waiting_.size()), waiting_.data(), MPI_STATUSES_IGNORE),
              "exchange messages");
    waiting_.clear();
    return sent_;
  }

 private:
  static constexpr int kTag = 7;
  static constexpr std::uint64_t kMostBytes = 1 << 30;  // of a message: MPI counts in int

  template <class Use>
  void each_part(void* data, std::uint64_t bytes, const Use& use) {
    for (std::uint64_t at = 0; at < bytes; at += kMostBytes)
      use(static_cast<char*>(data) + at, static_cast<int>(std::min(kMostBytes, bytes - at)),
          &waiting_.emplace_back());
  }

  MPI_Comm ranks_;
  std::vector<MPI_Request> waiting_;
  Traffic sent_;
};

}  // namespace padder::detect
