// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/waiting_threads.h"

#include <unistd.h>

#include <cstdlib>

namespace padder {

void let_waiting_threads_sleep(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") || std::getenv("GOMP_SPINCOUNT")) return;
  if (setenv("OMP_WAIT_POLICY", "passive", 1) == 0) execv("/proc/self/exe", argv);
}

}  // namespace padder
