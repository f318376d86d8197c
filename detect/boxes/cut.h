// SPDX-License-Identifier: MIT
// Cuts space into boxes that hold equal shares of the work: recursive coordinate bisection (section 2.2.4 and
// Fig. 5 of the paper cut by volume instead). The boxes are half-open and cover all of space without overlap,
// so every point, and with it the midpoint of every contact, lies in exactly one of them.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "detect/contact.h"

namespace padder::detect {

// The part that both regions share; it may be empty.
inline Region common(const Region& a, const Region& b) {
  Region r;
  for (int k = 0; k < 3; k++)
    r.low[k] = a.low[k] > b.low[k] ? a.low[k] : b.low[k],
    r.high[k] = a.high[k] < b.high[k] ? a.high[k] : b.high[k];
  return r;
}
inline bool is_empty(const Region& r) {
  return !(r.low[0] < r.high[0] && r.low[1] < r.high[1] && r.low[2] < r.high[2]);
}

// A point that has to be shared out: usually one sphere of a sample, which stands for `weight` units of work.
struct WeightedPoint {
  double at[3];
  double weight;
};

// An axis-aligned block of space with all six faces included, in the unit of the scene. Infinite faces are
// allowed. `low` above `high` means that it is empty.
struct Bounds {
  double low[3], high[3];
};
PADDER_HD bool meets(const Bounds& b, const Region& r) {
  bool meets = true;
  for (int a = 0; a < 3; a++) meets &= b.low[a] < r.high[a] && b.high[a] >= r.low[a];
  return meets;
}

// Do they meet no other region?
PADDER_HD bool lies_within(const Bounds& b, const Region& r) {
  bool within = true;
  for (int a = 0; a < 3; a++) within &= b.low[a] >= r.low[a] && b.high[a] < r.high[a];
  return within;
}

// The boxes and the planes that separate them. A default one has a single box, which is all of space.
// Copying costs memory for every box; all other functions are safe to call from several threads.
class BoxTree {
 public:
  std::uint32_t boxes() const { return static_cast<std::uint32_t>(regions_.size()); }
  std::uint64_t bytes() const {
    return nodes_.capacity() * sizeof(Node) + regions_.capacity() * sizeof(Region);
  }
  const Region& region(std::uint32_t box) const { return regions_[box]; }

  // The box that holds a point. Cost: the depth of the tree, which is log2(boxes) rounded up.
  std::uint32_t box_of(const double (&at)[3]) const;

  // The box that shares a point with `bounds`, if it is the only one. Cost: the depth of the tree at most.
  std::optional<std::uint32_t> only_box(const Bounds& bounds) const;

  // Calls use(box) for every box that shares a point with `bounds`, in ascending order.
  template <class Use>
  void each_box(const Bounds& bounds, Use use) const;

 private:
  friend BoxTree cut_space(std::vector<WeightedPoint>, std::uint32_t, const Region&, int);
  friend BoxTree tree_of(std::span<const Region>);
  static constexpr int kLeaf = 3;
  // Points below `cut` on `axis` are in the subtree of the next node, the others in that of node `upper`.
  struct Node {
    double cut = 0;
    std::uint32_t upper = 0;  // of a leaf: the number of its box
    std::uint32_t axis = kLeaf;
  };
  struct Plane {
    int axis;
    double cut;
  };
  static Plane plane_of(std::span<WeightedPoint> points, double share, const Region& region);
  void join(std::span<std::uint32_t> boxes, std::span<const Region> from, const Region& region);
  void divide(std::span<WeightedPoint> points, std::uint32_t node, std::uint32_t first, std::uint32_t boxes,
              const Region& region);

  std::vector<Node> nodes_ = {Node{}};
  std::vector<Region> regions_ = {Region{}};
};

// Cuts `whole` into exactly `boxes` boxes (at least 1) of nearly equal weight. Points that lie at one place
// cannot be separated, and then, or with fewer points than boxes, some boxes stay empty. Points outside of
// `whole` count where they are nearest to it. The result depends on the points and their order alone, not on
// `threads`. Weights must be at least 0 and coordinates finite. Cost: a sort of the points for each level of
// the tree, that is n log(n) log(boxes); hence callers pass a sample of a large scene.
BoxTree cut_space(std::vector<WeightedPoint> points, std::uint32_t boxes, const Region& whole = {},
                  int threads = 1);

// The tree of boxes that another program cut by bisection: the planes are found from the faces. The boxes of
// the tree have no gaps and no overlaps, even if the given ones do. If the given ones fit together, the boxes
// are the same. Throws Error if no plane separates them.
BoxTree tree_of(std::span<const Region> boxes);

// The largest work over the mean; 1: all boxes have the same.
double imbalance_of(const std::vector<double>& work);

inline std::optional<std::uint32_t> BoxTree::only_box(const Bounds& bounds) const {
  for (std::uint32_t at = 0;;) {
    const Node& node = nodes_[at];
    if (node.axis == kLeaf) return node.upper;
    const bool below = bounds.low[node.axis] < node.cut, above = bounds.high[node.axis] >= node.cut;
    if (below == above) return {};
    at = below ? at + 1 : node.upper;
  }
}

template <class Use>
void BoxTree::each_box(const Bounds& bounds, Use use) const {
  std::uint32_t waiting[64], count = 0, at = 0;  // a tree of 2^32 boxes is 32 levels deep
  for (;;) {
    const Node& node = nodes_[at];
    if (node.axis == kLeaf) {
      use(node.upper);
      if (count == 0) return;
      at = waiting[--count];
      continue;
    }
    const bool below = bounds.low[node.axis] < node.cut, above = bounds.high[node.axis] >= node.cut;
    if (below && above) waiting[count++] = node.upper;
    if (below) {
      at++;
    } else if (above) {
      at = node.upper;
    } else {  // empty bounds
      if (count == 0) return;
      at = waiting[--count];
    }
  }
}

}  // namespace padder::detect
