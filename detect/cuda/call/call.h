// SPDX-License-Identifier: MIT
// What every part of one call to detect() works with. Only .cu files include this.
#pragma once
#include "detect/cuda/call/contact_list.h"
#include "detect/cuda/call/history.h"
#include "detect/cuda/device/graph.h"
#include "detect/cuda/device/stage_clock.h"

namespace padder::detect::cuda {

struct Call {
  const Input& input;
  const CallOptions& options;
  cudaStream_t stream;
  SideStream& side;  // records what is enqueued
  int processors;    // processors_of(stream)
  StageClock& clock;
  ContactList& list;
  History* history;  // null: none is asked for
};

}  // namespace padder::detect::cuda
