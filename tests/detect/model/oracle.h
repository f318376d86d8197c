// SPDX-License-Identifier: MIT
// Every contact of a scene of any size, written apart from the code under test: all pairs of a small scene, a
// tree of boxes over a large one. Only the midpoint of CallOptions::own is the detector's own (contact.h),
// for on a face of the box each bit of it counts.
#pragma once
#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <thread>
#include <vector>

#include "tests/detect/oracle.h"

namespace padder::detect {

class ModelOracle {
 public:
  explicit ModelOracle(const std::vector<Seen>& spheres, const Region& own = {}, double margin = 0)
      : spheres_(spheres), own_(own), margin_(margin) {
    for (int k = 0; k < 3; k++) bounded_ |= own.low[k] > -INFINITY || own.high[k] < INFINITY;
  }

  // By i, then j. False: there are more than `most`, or kExcluded times as many spheres touch that are of two
  // worlds or may not meet for another reason.
  bool contacts(std::vector<Pair>& pairs, std::uint64_t most, std::size_t few = 300) {
    const std::size_t n = spheres_.size();
    pairs.clear();
    if (n <= few) {
      for (std::uint32_t i = 0; i < n; i++)
        for (std::uint32_t j = i + 1; j < n; j++) add(i, j, pairs);
      return pairs.size() <= most;
    }
    order_.resize(n), nodes_.clear();
    std::iota(order_.begin(), order_.end(), 0u);
    nodes_.emplace_back();
    build(0, 0, static_cast<std::uint32_t>(n));
    return search(pairs, most);
  }

 private:
  static constexpr std::uint64_t kExcluded = 30;

  struct Box {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  };
  struct Node {
    Box box;
    std::uint32_t first = 0, end = 0, child = 0;  // child: the first of two; 0: a leaf
  };

  // Do they touch, whether they may meet or not?
  bool add(std::uint32_t i, std::uint32_t j, std::vector<Pair>& to) const {
    if (!oracle_touching(spheres_[i].sphere, spheres_[j].sphere, margin_)) return false;
    if (oracle_meets(spheres_[i], spheres_[j]) &&
        (!bounded_ || owns(own_, midpoint(spheres_[i].sphere, spheres_[j].sphere))))
      to.push_back({i, j});
    return true;
  }
  // Wider than the sphere and the margin by far more than what the decision rounds.
  Box box_of(const Sphere& s) const {
    const double c[3] = {s.x, s.y, s.z};
    Box b;
    for (int k = 0; k < 3; k++) {
      const double r = s.r + margin_, reach = r + 0x1p-40 * (std::abs(c[k]) + r) + 0x1p-1060;
      b.low[k] = c[k] - reach, b.high[k] = c[k] + reach;
    }
    return b;
  }
  static bool meet(const Box& a, const Box& b) {
    for (int k = 0; k < 3; k++)
      if (a.low[k] > b.high[k] || b.low[k] > a.high[k]) return false;
    return true;
  }
  void build(std::uint32_t at, std::uint32_t first, std::uint32_t end) {
    Box all, centers;
    for (std::uint32_t q = first; q < end; q++) {
      const Sphere& s = spheres_[order_[q]].sphere;
      const Box b = box_of(s);
      const double c[3] = {s.x, s.y, s.z};
      for (int k = 0; k < 3; k++) {
        all.low[k] = std::min(all.low[k], b.low[k]), all.high[k] = std::max(all.high[k], b.high[k]);
        centers.low[k] = std::min(centers.low[k], c[k]), centers.high[k] = std::max(centers.high[k], c[k]);
      }
    }
    nodes_[at].box = all, nodes_[at].first = first, nodes_[at].end = end;
    if (end - first <= 8) return;
    int axis = 0;
    for (int k = 1; k < 3; k++)
      if (centers.high[k] - centers.low[k] > centers.high[axis] - centers.low[axis]) axis = k;
    const std::uint32_t middle = first + (end - first) / 2;
    std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       const Sphere &p = spheres_[a].sphere, &q = spheres_[b].sphere;
                       return axis == 0 ? p.x < q.x : axis == 1 ? p.y < q.y : p.z < q.z;
                     });
    const auto child = static_cast<std::uint32_t>(nodes_.size());
    nodes_[at].child = child;
    nodes_.emplace_back(), nodes_.emplace_back();
    build(child, first, middle);
    build(child + 1, middle, end);
  }
  // Returns how many touch.
  std::uint64_t look(std::uint32_t i, std::vector<Pair>& to) const {
    std::uint64_t touch = 0;
    const Box mine = box_of(spheres_[i].sphere);
    const std::size_t begin = to.size();
    std::uint32_t stack[128], depth = 0;
    stack[depth++] = 0;
    while (depth) {
      const Node& n = nodes_[stack[--depth]];
      if (!meet(n.box, mine)) continue;
      if (n.child)
        stack[depth++] = n.child, stack[depth++] = n.child + 1;
      else
        for (std::uint32_t q = n.first; q < n.end; q++)
          if (order_[q] > i) touch += add(i, order_[q], to);
    }
    std::sort(to.begin() + static_cast<std::ptrdiff_t>(begin), to.end(),
              [](const Pair& a, const Pair& b) { return a.j < b.j; });
    return touch;
  }
  bool search(std::vector<Pair>& pairs, std::uint64_t most) const {
    const auto n = static_cast<std::uint32_t>(spheres_.size());
    const unsigned workers = n < 20000 ? 1 : std::max(1u, std::thread::hardware_concurrency());
    std::vector<std::vector<Pair>> found(workers);
    std::atomic<std::uint64_t> total{0}, touch{0};
    const auto work = [&](unsigned w) {
      const auto first = static_cast<std::uint32_t>(std::uint64_t(n) * w / workers),
                 end = static_cast<std::uint32_t>(std::uint64_t(n) * (w + 1) / workers);
      for (std::uint32_t i = first; i < end && total <= most && touch / kExcluded <= most; i++) {
        const std::size_t before = found[w].size();
        touch += look(i, found[w]);
        total += found[w].size() - before;
      }
    };
    std::vector<std::thread> threads;
    for (unsigned w = 1; w < workers; w++) threads.emplace_back(work, w);
    work(0);
    for (std::thread& t : threads) t.join();
    if (total > most || touch / kExcluded > most) return false;
    for (const auto& f : found) pairs.insert(pairs.end(), f.begin(), f.end());
    return true;
  }

  const std::vector<Seen>& spheres_;
  const Region own_;
  const double margin_;
  bool bounded_ = false;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace padder::detect
