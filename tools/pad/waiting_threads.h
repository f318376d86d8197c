// SPDX-License-Identifier: GPL-3.0-or-later
// What threads do that wait for the others' work.
#pragma once

namespace padder {

// Lets them sleep at once, unless OMP_WAIT_POLICY or GOMP_SPINCOUNT says what they should do. By default
// those of libgomp first look for more work, some milliseconds each time, which other programs cannot use;
// OMP_WAIT_POLICY=active in the environment shows what that costs. libgomp reads the variable when it is
// loaded: so this starts the program again, with the variable, and returns where it is set or the program
// cannot be started.
void let_waiting_threads_sleep(char** argv);

}  // namespace padder
