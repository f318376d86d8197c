// SPDX-License-Identifier: MIT
// Lists of indices, edges by the indices of their ends, and indices that hang together. Not installed.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

namespace padder {

using Corners = std::array<std::uint32_t, 3>;  // the indices of a triangle's points

// 0, 1, … up to n - 1.
inline std::vector<std::uint32_t> numbered(std::size_t n) {
  std::vector<std::uint32_t> list(n);
  std::iota(list.begin(), list.end(), 0u);
  return list;
}

// In ascending order, and each once.
template <class T>
void sort_unique(std::vector<T>& list) {
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

// An edge, whichever way it runs: its smaller vertex << 32 | its larger one.
inline std::uint64_t edge_of(std::uint32_t u, std::uint32_t v) {
  return std::uint64_t(std::min(u, v)) << 32 | std::max(u, v);
}
inline std::array<std::uint32_t, 2> ends_of(std::uint64_t edge) {  // the smaller one first
  return {static_cast<std::uint32_t>(edge >> 32), static_cast<std::uint32_t>(edge)};
}

// The corner of triangle t that has the vertex v, where corner k of triangle t counts as 3 t + k.
inline std::uint32_t corner_with(const std::vector<Corners>& triangles, std::uint32_t t, std::uint32_t v) {
  return 3 * t + (triangles[t][0] == v ? 0 : triangles[t][1] == v ? 1 : 2);
}

// The root of k in a forest of joined indices (union-find), in which a root is its own parent: numbered(n)
// has joined none. Shortens the way for later calls.
inline std::uint32_t root_of(std::vector<std::uint32_t>& parent, std::uint32_t k) {
  while (parent[k] != k) k = parent[k] = parent[parent[k]];
  return k;
}
// Joins a and b: their root is the smaller one of both. Returns whether they were apart.
inline bool join(std::vector<std::uint32_t>& parent, std::uint32_t a, std::uint32_t b) {
  a = root_of(parent, a), b = root_of(parent, b);
  parent[std::max(a, b)] = std::min(a, b);
  return a != b;
}

}  // namespace padder
