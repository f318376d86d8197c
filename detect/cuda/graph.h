// SPDX-License-Identifier: MIT
// The same work again as a graph: no gaps between its launches, and one call instead of many. Only .cu files
// include this.
#pragma once
#include "detect/cuda/memory.h"

namespace padder::detect::cuda {

// A stream that no other stream waits for, and that waits for none: work is recorded on it, which other
// threads may disturb on a stream that waits for the default one. Made when it is first asked for.
class SideStream {
 public:
  SideStream() = default;
  ~SideStream() {
    if (stream_) cudaStreamDestroy(stream_);
  }
  SideStream(const SideStream&) = delete;
  SideStream& operator=(const SideStream&) = delete;
  cudaStream_t get() {
    if (!stream_) cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "make a stream");
    return stream_;
  }

 private:
  cudaStream_t stream_ = nullptr;
};

// Plan: everything that decides what is enqueued, comparable: whatever a kernel is given by value follows
// from it. What stands behind the addresses may change. plan.moves is MemoryBook::moves, since a graph holds
// addresses.
template <class Plan>
class Recording {
 public:
  Recording() = default;
  ~Recording() { drop(); }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Enqueues on `stream` what the plan stands for: by calling enqueue(stream) the first time, recorded on
  // `side` the second time in a row, from the record afterwards. `moves` is read after enqueue(), which may
  // allocate. Throws Error.
  template <class Enqueue>
  void run(const Plan& plan, const std::uint64_t& moves, cudaStream_t stream, SideStream& side,
           Enqueue enqueue) {
    if (!(plan == plan_)) {
      drop();
      plan_ = plan;
      enqueue(stream);
      plan_.moves = moves;
      return;
    }
    if (!graph_) record(side.get(), enqueue);
    if (plan_.moves != moves) {  // memory was taken while it was recorded: some addresses are old
      drop();
      plan_.moves = moves;
      return enqueue(stream);
    }
    cuda_check(cudaGraphLaunch(graph_, stream), "launch a graph");
  }

 private:
  template <class Enqueue>
  void record(cudaStream_t side, Enqueue enqueue) {
    cudaGraph_t recorded = nullptr;
    cuda_check(cudaStreamBeginCapture(side, cudaStreamCaptureModeRelaxed), "record a graph");
    try {
      enqueue(side);
    } catch (...) {
      cudaStreamEndCapture(side, &recorded);
      if (recorded) cudaGraphDestroy(recorded);
      throw;
    }
    cuda_check(cudaStreamEndCapture(side, &recorded), "record a graph");
    cudaGraphExec_t made = nullptr;
    const cudaError_t e = cudaGraphInstantiate(&made, recorded, 0);
    cudaGraphDestroy(recorded);
    cuda_check(e, "record a graph");
    graph_ = made;
  }
  void drop() {
    if (graph_) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }

  Plan plan_;
  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace padder::detect::cuda
