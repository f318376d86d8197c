// SPDX-License-Identifier: GPL-3.0-or-later
// Closed shells within each other: which lie around which, and which of them repeat another one.
#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// Do the triangles listed, which close, follow other ones so closely that they are a copy of these, moved a
// little, and no wall lies between them? What lies between holds less than the share `between` of what they
// enclose. Only those for which `other` holds count. Ends at the first corner that lies apart.
bool is_copy(const Surface& surface, const std::vector<std::uint32_t>& triangles, double between,
             const std::function<bool(std::uint32_t)>& other);

// A closed shell, and the closed shells around it, by index.
struct NestedShell {
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> around;
  bool inward = false;  // it faced so in the file
  double volume = 0;    // that it encloses
};

// The shells around the first triangle of `shell`, by index, in ascending order. It meets none of them.
// `shell_of` tells of each triangle of the surface which one it is of; those to skip() do not count.
std::vector<std::uint32_t> shells_around(const Surface& surface, const std::vector<std::uint32_t>& shell,
                                         const std::vector<std::uint32_t>& shell_of,
                                         const std::function<bool(std::uint32_t)>& skip);

// For each shell: does it repeat the one next around it, as a copy or as a coarser level of detail? Such
// shells bound no cavity. One that faces as the shell around it does and fills most of it may be that, or the
// inner side of a wall. It repeats the other one
// - if its corners lie on the other one, whatever its triangles between them cut off;
// - if it is coarser, and its corners come much nearer to the other one than the middles of its triangles:
//   then not a wall parts them, but chords;
// - if it is one of three or more levels, each coarser than the one around it.
std::vector<char> find_repeats(const Mesh& mesh, const std::vector<NestedShell>& shells);

}  // namespace padder
