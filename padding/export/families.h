// SPDX-License-Identifier: MIT
// Our rule of families and masks (docs/formats.md) in the words of other programs.
#pragma once
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace padder {

// family 0: none, equals nothing. mask bit k: no contact with family k + 1.
struct CollisionFilter {
  std::uint32_t family = 0, mask = 0;
  friend bool operator==(const CollisionFilter&, const CollisionFilter&) = default;
};

// Our rule, as detect/filter.h has it: no contact in one family other than 0, nor where either side masks the
// other.
bool may_touch(const CollisionFilter& a, const CollisionFilter& b);

// Two bit fields a body: what it is, and what it may touch.
struct FilterBits {
  std::uint32_t own = 0;     // MuJoCo contype, Chrono family group
  std::uint32_t others = 0;  // MuJoCo conaffinity, Chrono family mask
  friend bool operator==(const FilterBits&, const FilterBits&) = default;
};

// In both programs family k keeps bit k in every file, so that files written apart know each other, and bit 0
// is left to what the program's own bodies are of unless they are told otherwise: a body without a family
// meets everything, and every body meets those.

constexpr std::uint32_t kMujocoFamilies = 30;  // the last that has a bit; bit 31: no family, but a mask
constexpr std::uint32_t kChronoFamilies = 14;

// MuJoCo lets two geoms touch when either side's contype is in the other's conaffinity, so the bits cannot
// say that one side alone masks the other. They never keep apart what may touch, and of what may not touch
// they let through: a mask that the other side does not return, and families above kMujocoFamilies. Within
// one file such pairs are excluded one by one.
FilterBits mujoco_bits(const CollisionFilter& body);

// Chrono lets two bodies touch when each side's group is in the other's mask: exactly our rule, as long as no
// family is above kChronoFamilies. Where one is, the bodies are translated among themselves alone
// (filter_bits, on bits 1 to 14). Empty when that does not suffice, and for a single body, which has no
// others to be told from.
std::optional<std::vector<FilterBits>> chrono_bits(const std::vector<CollisionFilter>& bodies);

// Bits for every body so that (own_i & others_j) != 0 exactly when the two may touch, whichever of the sides
// is asked. Bodies that may touch the same others share a bit, so the numbers hold only among these bodies.
// Two copies of one body are told apart like the rest as long as the bits suffice; when they do not, a body
// that occurs once may share a bit with others it must not be confused with only through its copies. Empty
// when more than `bits` are needed. Cost: square of the number of different filters.
std::optional<std::vector<FilterBits>> filter_bits(const std::vector<CollisionFilter>& bodies, int bits);

// For programs that take lists of pairs: every pair of bodies that may not touch, i < j, ascending.
std::vector<std::pair<std::size_t, std::size_t>> filtered_pairs(const std::vector<CollisionFilter>& bodies);

// Families and masks under which exactly the given pairs (and each body with itself) may not touch. A family
// above 32 cannot be masked, but its bearer can mask others: so of each pair one side needs a family of 1 to
// 32, and far more than 32 bodies can be told apart when they form a tree. Empty when that does not suffice.
std::optional<std::vector<CollisionFilter>> families_of(
    std::size_t bodies, const std::vector<std::pair<std::size_t, std::size_t>>& pairs);

}  // namespace padder
