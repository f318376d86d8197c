// SPDX-License-Identifier: MIT
#include "padding/export/families.h"

#include <algorithm>
#include <bit>
#include <map>
#include <set>

namespace padder {
namespace {

bool masked(std::uint32_t mask, std::uint32_t family) {
  return family >= 1 && family <= 32 && (mask >> (family - 1) & 1) != 0;
}

// Bodies in classes: bodies of one class are translated alike. And which classes may touch.
struct Classes {
  std::vector<std::size_t> of;           // of each body
  std::vector<std::size_t> members;      // bodies in each class
  std::vector<std::vector<char>> touch;  // symmetric; the diagonal: two bodies of the class

  std::size_t size() const { return members.size(); }

  // May a and b become one class? With `once`, whether a class touches itself does not matter while it has
  // one member.
  bool alike(std::size_t a, std::size_t b, bool once) const {
    for (std::size_t k = 0; k < size(); k++)
      if (k != a && k != b && touch[a][k] != touch[b][k]) return false;
    const char between = touch[a][b];
    const auto fits = [&](std::size_t c) { return touch[c][c] == between || (once && members[c] == 1); };
    return fits(a) && fits(b);
  }

  void merge(std::size_t a, std::size_t b) {  // b into a
    const char between = touch[a][b];
    members[a] += members[b];
    touch[a][a] = between;
    for (auto& row : touch) row.erase(row.begin() + static_cast<std::ptrdiff_t>(b));
    touch.erase(touch.begin() + static_cast<std::ptrdiff_t>(b));
    members.erase(members.begin() + static_cast<std::ptrdiff_t>(b));
    for (std::size_t& c : of) c = c == b ? a : c > b ? c - 1 : c;
  }

  void merge_alike(bool once) {
    for (std::size_t a = 0; a < size(); a++)
      for (std::size_t b = a + 1; b < size();)
        if (alike(a, b, once))
          merge(a, b);
        else
          b++;
  }
};

Classes classes_of(const std::vector<CollisionFilter>& bodies) {
  Classes c;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> known;
  std::vector<CollisionFilter> filters;
  for (const CollisionFilter& f : bodies) {
    const auto [it, fresh] = known.emplace(std::pair(f.family, f.mask), filters.size());
    if (fresh) filters.push_back(f), c.members.push_back(0);
    c.of.push_back(it->second), c.members[it->second]++;
  }
  for (const auto& a : filters) {
    c.touch.emplace_back();
    for (const auto& b : filters) c.touch.back().push_back(may_touch(a, b));
  }
  return c;
}

}  // namespace

bool may_touch(const CollisionFilter& a, const CollisionFilter& b) {
  if (a.family == b.family && a.family != 0) return false;
  return !masked(a.mask, b.family) && !masked(b.mask, a.family);
}

namespace {

// Our mask has family k at bit k - 1. Here family k is bit k, and families that have no bit are left out.
std::uint32_t masked_bits(std::uint32_t mask, std::uint32_t families) {
  return (mask << 1) & ((std::uint32_t(2) << families) - 2);
}

}  // namespace

FilterBits mujoco_bits(const CollisionFilter& body) {
  constexpr std::uint32_t none_but_mask = std::uint32_t(1) << 31;
  const std::uint32_t masked = masked_bits(body.mask, kMujocoFamilies);
  if (body.family >= 1 && body.family <= kMujocoFamilies) {
    const std::uint32_t own = std::uint32_t(1) << body.family;
    return {own, ~none_but_mask & ~own & ~masked};
  }
  // Only bodies of this kind admit this bit. With all others the mask of this body alone decides.
  if (masked) return {none_but_mask, ~masked};
  return {~std::uint32_t(0),
          ~std::uint32_t(0)};  // so that it also touches a geom that sets only one of the two fields
}

std::optional<CollisionFilter> filter_of_mujoco_bits(const FilterBits& bits) {
  CollisionFilter filter;
  if (std::has_single_bit(bits.own) && bits.own >> 31 == 0)
    filter.family = static_cast<std::uint32_t>(std::countr_zero(bits.own));
  const std::uint32_t own = filter.family ? bits.own : 0;
  filter.mask = masked_bits(~std::uint32_t(0), kMujocoFamilies) & ~bits.others & ~own;
  filter.mask >>= 1;
  return mujoco_bits(filter) == bits ? std::optional(filter) : std::nullopt;
}

// ChCollisionModel.cpp of Chrono 8 and 9: a model begins with family_group(1) and family_mask(0x7FFF),
// SetFamily(k) makes the group 1 << k with 0 <= k < 15, SetFamilyGroup wants one bit, SetFamilyMask at most
// 0x7FFF, and "the contact is created only if the family is within the 'family mask' of the other, and
// viceversa" (ChCollisionModel.h). https://github.com/projectchrono/chrono/blob/main/src/chrono/collision/
std::optional<std::vector<FilterBits>> chrono_bits(const std::vector<CollisionFilter>& bodies) {
  constexpr std::uint32_t all = 0x7fff;
  const bool kept = std::ranges::all_of(bodies, [](const auto& b) { return b.family <= kChronoFamilies; });
  std::vector<FilterBits> out;
  if (kept) {
    for (const CollisionFilter& b : bodies) {
      const std::uint32_t own = std::uint32_t(1) << b.family;
      out.push_back({own, all & ~(b.family ? own : 0) & ~masked_bits(b.mask, kChronoFamilies)});
    }
    return out;
  }
  if (bodies.size() < 2) return {};
  const auto among = filter_bits(bodies, kChronoFamilies);
  if (!among) return {};
  for (const FilterBits& f : *among) out.push_back({f.own << 1, f.others << 1 | 1});
  return out;
}

std::optional<std::vector<FilterBits>> filter_bits(const std::vector<CollisionFilter>& bodies, int bits) {
  Classes classes = classes_of(bodies);
  classes.merge_alike(false);
  if (classes.size() > static_cast<std::size_t>(bits)) classes.merge_alike(true);
  if (classes.size() > static_cast<std::size_t>(bits)) return {};
  std::vector<FilterBits> out;
  for (const std::size_t c : classes.of) {
    FilterBits f;
    f.own = std::uint32_t(1) << c;
    for (std::size_t k = 0; k < classes.size(); k++)
      if (classes.touch[c][k]) f.others |= std::uint32_t(1) << k;
    out.push_back(f);
  }
  return out;
}

std::vector<std::pair<std::size_t, std::size_t>> filtered_pairs(const std::vector<CollisionFilter>& bodies) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < bodies.size(); i++)
    for (std::size_t j = i + 1; j < bodies.size(); j++)
      if (!may_touch(bodies[i], bodies[j])) pairs.emplace_back(i, j);
  return pairs;
}

std::optional<std::vector<CollisionFilter>> families_of(
    std::size_t bodies, const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  std::vector<std::set<std::size_t>> next(bodies);
  for (const auto& [a, b] : pairs)
    if (a != b) next[a].insert(b), next[b].insert(a);
  std::vector<char> low(bodies, bodies <= 32);  // has a family of 1 to 32
  if (bodies > 32) {
    // A vertex cover. The neighbour of a leaf is always a good choice (for a forest the cover is then the
    // least); without leaves, the body with the most neighbours.
    auto left = next;
    for (;;) {
      std::size_t chosen = bodies, most = 0;
      for (std::size_t k = 0; k < bodies; k++) {
        if (left[k].size() == 1) {
          chosen = *left[k].begin();
          break;
        }
        if (left[k].size() > most) chosen = k, most = left[k].size();
      }
      if (chosen == bodies) break;
      low[chosen] = 1;
      for (const std::size_t k : left[chosen]) left[k].erase(chosen);
      left[chosen].clear();
    }
    if (std::count(low.begin(), low.end(), 1) > 32) return {};
  }
  std::vector<CollisionFilter> out(bodies);
  std::uint32_t small = 1, large = 33;
  for (std::size_t k = 0; k < bodies; k++) out[k].family = low[k] ? small++ : large++;
  for (std::size_t k = 0; k < bodies; k++)
    for (const std::size_t n : next[k])
      if (low[n]) out[k].mask |= std::uint32_t(1) << (out[n].family - 1);
  return out;
}

}  // namespace padder
