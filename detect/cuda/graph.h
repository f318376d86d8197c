// The same work again as a graph: no gaps between its launches, and one call instead of many. Only .cu files
// include this.
#pragma once
#include "detect/cuda/memory.h"

namespace padder::detect::cuda {

// Plan: everything that decides what is enqueued, comparable; plan.moves is MemoryBook::moves, since a graph
// holds addresses.
template <class Plan>
class Recording {
 public:
  Recording() = default;
  ~Recording() { drop(); }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Enqueues what the plan stands for: by calling enqueue() the first time, recorded the second time in a
  // row, from the record afterwards. `moves` is read after enqueue(), which may allocate. Throws Error.
  template <class Enqueue>
  void run(const Plan& plan, const std::uint64_t& moves, cudaStream_t stream, Enqueue enqueue) {
    if (!(plan == plan_)) {
      drop();
      plan_ = plan;
      enqueue();
      plan_.moves = moves;
      return;
    }
    if (!graph_) record(stream, enqueue);
    cuda_check(cudaGraphLaunch(graph_, stream), "launch a graph");
  }

 private:
  template <class Enqueue>
  void record(cudaStream_t stream, Enqueue enqueue) {
    cudaGraph_t recorded = nullptr;
    cuda_check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeRelaxed), "record a graph");
    try {
      enqueue();
    } catch (...) {
      cudaStreamEndCapture(stream, &recorded);
      if (recorded) cudaGraphDestroy(recorded);
      throw;
    }
    cuda_check(cudaStreamEndCapture(stream, &recorded), "record a graph");
    const cudaError_t e = cudaGraphInstantiate(&graph_, recorded, 0);
    cudaGraphDestroy(recorded);
    cuda_check(e, "record a graph");
  }
  void drop() {
    if (graph_) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }

  Plan plan_;
  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace padder::detect::cuda
