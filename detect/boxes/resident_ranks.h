// SPDX-License-Identifier: MIT
// How a ResidentDetector reaches those of other processes, with which it shares a scene. Each process has one
// GPU. detect/mpi/resident_ranks.h makes one for the ranks of MPI.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "detect/boxes/cut.h"

namespace padder::detect {

// A message to another rank, or from one: in the memory of the GPU if reads_device_memory(), else in host
// memory. Not to or from the rank itself.
struct RankMessage {
  int rank;
  void* at;
  std::uint64_t bytes;
};

// The ranks, as each of them sees them. Errors of the MPI library throw Error.
class ResidentRanks {
 public:
  ResidentRanks() = default;
  ResidentRanks(const ResidentRanks&) = delete;
  virtual ~ResidentRanks() = default;

  virtual int rank() const = 0;
  virtual int count() const = 0;
  virtual int rank_on_host() const = 0;  // among those of the same machine
  virtual bool reads_device_memory() const = 0;

  // Collective, all of them: every rank calls the same in the same order.

  // Does `work`, which must not be collective. If it throws on some ranks, all throw Error with the sentence
  // of the first of these, which names the rank.
  virtual void together(const std::function<void()>& work) const = 0;
  // all[k] becomes what rank k has in `mine`; items of `bytes`.
  virtual void gather(const void* mine, void* all, std::uint64_t bytes) const = 0;
  // from[k] becomes what rank k has in its to[rank()].
  virtual void transpose(const std::uint64_t* to, std::uint64_t* from) const = 0;
  // Each value becomes its sum over the ranks.
  virtual void add_up(std::span<double> values) const = 0;
  // The tree of a box for each rank, which share the weight of all ranks' points.
  virtual BoxTree cut(const std::vector<WeightedPoint>& points) const = 0;
  // Messages between two ranks are given in the same order on both.
  virtual void exchange(std::span<const RankMessage> to, std::span<const RankMessage> from) const = 0;
};

}  // namespace padder::detect
