// SPDX-License-Identifier: GPL-3.0-or-later
// pad --manifest: many parts, each in a worker process, into a tree of assets that a rerun completes.
#pragma once
#include <map>
#include <string>

#include "tools/pad/arguments.h"

namespace padder {

// Pads the parts that are missing or changed, and prints what became of all. `given` is settings_of the
// command line. Returns the exit code: 0 when every part of the shard is there, 1 when some are not, 128 and
// the signal's number when one ended the run. Throws cli::UsageError, and Error for a manifest or folder that
// cannot be used.
int run_parts(const PadArguments& a, const std::map<std::string, std::string>& given);

}  // namespace padder
