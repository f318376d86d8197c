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

// Our rule, the same as in detect/filter.h: two bodies may touch unless both are of the same family other
// than 0, or the mask of one names the family of the other.
bool may_touch(const CollisionFilter& a, const CollisionFilter& b);

// Two bit fields a body: what it is, and what it may touch.
struct FilterBits {
  std::uint32_t own = 0;     // MuJoCo contype, Chrono family group
  std::uint32_t others = 0;  // MuJoCo conaffinity, Chrono family mask
  friend bool operator==(const FilterBits&, const FilterBits&) = default;
};

// In MuJoCo and Chrono, family k has bit k in every file. So files that were written one by one still agree.
// Bit 0 belongs to the program's own bodies, which have it by default: a body without a family touches
// everything, and everything touches a body without a family.

constexpr std::uint32_t kMujocoFamilies = 30;  // the last that has a bit; bit 31: no family, but a mask
constexpr std::uint32_t kChronoFamilies = 14;

// MuJoCo lets two geoms touch when the contype of one is in the conaffinity of the other, whichever of the
// two. So the bits cannot say that one side alone masks the other. The bits never keep apart two bodies that
// may touch. They fail to keep apart two that may not touch when only one masks the other, and when a family
// is above kMujocoFamilies; the writer excludes such pairs one by one within a file.
FilterBits mujoco_bits(const CollisionFilter& body);

// The family and mask whose bits these are; none for bits that mujoco_bits() does not make.
std::optional<CollisionFilter> filter_of_mujoco_bits(const FilterBits& bits);

// Chrono lets two bodies touch when each side's group is in the other's mask. That is our rule, as long as no
// family is above kChronoFamilies. Where one is, filter_bits() chooses bits 1 to 14 that hold among these
// bodies only. The result is empty when 14 bits are too few, and for a single body.
std::optional<std::vector<FilterBits>> chrono_bits(const std::vector<CollisionFilter>& bodies);

// Chooses bits for every body so that (own_i & others_j) != 0 exactly when i and j may touch, in either
// order. Bodies that may touch the same others share a bit, so the bits hold among these bodies only. First
// the bits also separate two copies of one body. When that takes too many, the rule for copies is dropped for
// bodies that occur once. Empty when more than `bits` bits are needed. Time: the square of the number of
// different filters.
std::optional<std::vector<FilterBits>> filter_bits(const std::vector<CollisionFilter>& bodies, int bits);

// For programs that take lists of pairs: every pair of bodies that may not touch, i < j, ascending.
std::vector<std::pair<std::size_t, std::size_t>> filtered_pairs(const std::vector<CollisionFilter>& bodies);

// Chooses families and masks under which exactly the given pairs may not touch (nor a body with itself). A
// mask has 32 bits, so it can name families 1 to 32 only; but a body of a family above 32 can mask others.
// So one side of each pair needs a family of 1 to 32, and that is enough for far more than 32 bodies when the
// pairs form a tree. Empty when 32 are too few.
std::optional<std::vector<CollisionFilter>> families_of(
    std::size_t bodies, const std::vector<std::pair<std::size_t, std::size_t>>& pairs);

}  // namespace padder
