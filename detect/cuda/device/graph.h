// SPDX-License-Identifier: MIT
// Repeats the work of a call as a CUDA graph: no gaps between its kernels, and one launch instead of many.
// Only .cu files include this.
#pragma once
#include <utility>

#include "detect/cuda/device/memory.h"

namespace padder::detect::cuda {

// A stream that waits for no other stream by itself, and for which none does. Work is recorded on it: on a
// stream that waits for the default one, other threads could disturb the recording. Made when it is first
// asked for.
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

// Work beside that of a stream, which a recording of the stream holds, too: it begins when the stream has
// come to fork(), and the stream goes on. join() makes the stream wait for it, where it has been forked.
class Branch {
 public:
  Branch() = default;
  ~Branch() {
    for (const cudaEvent_t e : {begin_, end_})
      if (e) cudaEventDestroy(e);
  }
  Branch(const Branch&) = delete;
  Branch& operator=(const Branch&) = delete;

  template <class Enqueue>
  void fork(cudaStream_t stream, Enqueue enqueue) {
    pass(stream, begin_, side_.get());
    enqueue(side_.get());
    forked_ = true;
  }
  void join(cudaStream_t stream) {
    if (std::exchange(forked_, false)) pass(side_.get(), end_, stream);
  }

 private:
  static void pass(cudaStream_t from, cudaEvent_t& event, cudaStream_t to) {
    if (!event) cuda_check(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "make an event");
    cuda_check(cudaEventRecord(event, from), "order the work of two streams");
    cuda_check(cudaStreamWaitEvent(to, event, 0), "order the work of two streams");
  }
  SideStream side_;
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
  bool forked_ = false;
};

// Plan: everything that decides what is enqueued, and comparable. Whatever a kernel is given by value must
// follow from the plan; what stands behind addresses may change. A graph holds addresses, so the plan holds
// MemoryBook::moves. Several plans are kept: calls with a history have two memories for their lists in turn,
// and the quotas of a stable list change back and forth while spheres move.
template <class Plan>
class Recording {
 public:
  Recording() = default;
  ~Recording() {
    for (Recorded& r : recorded_) r.drop();
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Enqueues on `stream` what the plan stands for. The first and the second time, unless kKept other plans
  // came between, it calls enqueue(stream). The second time it also records enqueue() on `side`, while the
  // device works; afterwards it launches the recording alone. What enqueue() itself changes, such as the
  // memory that it takes, renew(plan) brings up to date in a plan. Returns the plan that was kept, until the
  // next run. Throws Error.
  template <class Enqueue, class Renew>
  const Plan& run(const Plan& plan, cudaStream_t stream, SideStream& side, Enqueue enqueue, Renew renew) {
    for (int k = 0; k < kKept && !(plan == recorded_[last_].plan); k++) last_ = (last_ + 1) % kKept;
    if (!(plan == recorded_[last_].plan)) last_ = oldest_, oldest_ = (oldest_ + 1) % kKept;
    Recorded& r = recorded_[last_];
    const bool again = plan == r.plan;
    if (again && r.graph) {
      cuda_check(cudaGraphLaunch(r.graph, stream), "launch a graph");
      return r.plan;
    }
    r.drop();
    r.plan = plan;
    enqueue(stream);
    renew(r.plan);
    if (!again || !(plan == r.plan)) return r.plan;
    r.graph = record(side.get(), enqueue);
    renew(r.plan);
    if (!(plan == r.plan)) r.drop();  // memory was taken while it was recorded: some addresses are old
    return r.plan;
  }

 private:
  struct Recorded {
    Plan plan;
    cudaGraphExec_t graph = nullptr;
    void drop() {
      if (graph) cudaGraphExecDestroy(graph);
      graph = nullptr;
    }
  };

  template <class Enqueue>
  cudaGraphExec_t record(cudaStream_t side, Enqueue enqueue) {
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
    return made;
  }

  static constexpr int kKept = 6;
  Recorded recorded_[kKept];
  int last_ = 0, oldest_ = 0;
};

}  // namespace padder::detect::cuda
