// SPDX-License-Identifier: MIT
// The checks of a call's input and options, and the sentences that say what is wrong with them. The same for
// every backend. Internal; host code.
#pragma once
#include <string>

#include "detect/core/grid.h"
#include "detect/core/input.h"
#include "detect/detector.h"
#include "padding/asset/error.h"

namespace padder::detect {

// A number as the sentences show it: up to nine significant digits.
std::string formatted(double v);

// Throws Error for a value above `last`, the last of its enumeration, as only a cast makes it.
void check_enum(const char* name, unsigned value, unsigned last);
template <class Enum>
void check_enum(const char* name, Enum value, Enum last) {
  check_enum(name, static_cast<unsigned>(value), static_cast<unsigned>(last));
}
// Throws Error for options that no backend can carry out.
void check_options(const CallOptions& options);
// Throws Error for options that only one detector can carry out, and not one for each box of space.
void check_boxed_options(const CallOptions& options);
// Throws Error for a scene that boxes cannot read: missing pointers, shapes that are not there, device
// memory.
void check_boxed_input(const Input& input);
// Throws Error if a shape that is named, a pointer or a stride is missing. `known`: the previous call checked
// the bodies; then the tally is empty.
BodyTally check_arrays(const Input& input, bool known = false);
// The same, and whether one detector can read the memory and number the spheres and bodies.
BodyTally check_input(const Input& input, bool device_memory_allowed, bool known = false);
// Throws Error if lengths of this scene do not fit the records that are asked for.
void check_range(const Summary& summary, const CallOptions& options);

// What is wrong with a sphere; `name` tells which it is.
std::string fault_sentence(const std::string& name, const Sphere& sphere);
// What is wrong with sphere number `index`, and where it is in the input.
std::string fault_sentence(std::uint64_t index, const Sphere& sphere, const Input& input);
// A body (or a loose sphere) is in a world that detect_worlds() was not asked for.
std::string world_sentence(bool loose, std::uint64_t index, std::uint32_t world, std::uint32_t worlds);

// There is not enough memory, or the limit of the call does not allow what is needed. Says how much is
// needed, for what, and what the caller can do.
class MemoryError : public Error {
 public:
  // where: host or GPU. limit: CallOptions::memory_limit where it counts, else 0.
  MemoryError(std::uint64_t bytes_needed, const char* what, const char* where, std::uint64_t limit);
};

}  // namespace padder::detect
