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

// Two bit fields a body: which class it is of (one bit), and which classes it may touch.
struct FilterBits {
  std::uint32_t own = 0;     // MuJoCo contype, Chrono family group, Jolt group, Bullet group
  std::uint32_t others = 0;  // MuJoCo conaffinity, Chrono family mask, Jolt mask, Bullet mask
};

// Bits for every body so that (own_i & others_j) != 0 exactly when the two may touch. That is symmetric, so
// it holds for programs that ask either side (MuJoCo) and for those that ask both (Chrono, Jolt, Bullet).
// Bodies that may touch the same others share a bit. Two copies of one body are told apart like the rest as
// long as the bits suffice; when they do not, a body that occurs once may share a bit with others it must not
// be confused with only through its copies. Empty when more than `bits` are needed. Cost: square of the
// number of different filters.
std::optional<std::vector<FilterBits>> filter_bits(const std::vector<CollisionFilter>& bodies, int bits);

// For programs that take lists of pairs: every pair of bodies that may not touch, i < j, ascending.
std::vector<std::pair<std::size_t, std::size_t>> filtered_pairs(const std::vector<CollisionFilter>& bodies);

// Families and masks under which exactly the given pairs (and each body with itself) may not touch. A family
// above 32 cannot be masked, but its bearer can mask others: so of each pair one side needs a family of 1 to
// 32, and far more than 32 bodies can be told apart when they form a tree. Empty when that does not suffice.
std::optional<std::vector<CollisionFilter>> families_of(
    std::size_t bodies, const std::vector<std::pair<std::size_t, std::size_t>>& pairs);

}  // namespace padder
