// SPDX-License-Identifier: MIT
#include "padding/geometry/triangle_tree.h"

#include <atomic>

#include "padding/geometry/indices.h"

namespace padder {
namespace {

using Node = TriangleTree::Node;

constexpr std::uint32_t kLeafSize = 4;
constexpr std::uint32_t kTreeParallelSize = 4096;  // fewer triangles than these are not worth another thread

// Binned surface-area heuristic; returns the node's index.
std::uint32_t build(std::vector<Node>& nodes, std::vector<std::uint32_t>& order,
                    const std::vector<Box>& boxes, std::uint32_t begin, std::uint32_t end) {
  constexpr int bins = 16;
  Box centers;
  for (auto k = begin; k < end; k++) centers.add(boxes[order[k]].center());
  int axis;
  const double width = (centers.high - centers.low).maxCoeff(&axis);
  std::uint32_t middle = begin;
  if (width > 0) {
    std::array<Box, bins> box;
    std::array<std::uint32_t, bins> count{};
    const auto bin_of = [&](std::uint32_t t) {
      const double x = (boxes[t].center()[axis] - centers.low[axis]) / width * bins;
      return std::clamp(static_cast<int>(x), 0, bins - 1);
    };
    for (auto k = begin; k < end; k++) {
      const int b = bin_of(order[k]);
      count[b]++, box[b].add(boxes[order[k]].low), box[b].add(boxes[order[k]].high);
    }
    std::array<double, bins> right{};  // cost of bins b and above
    Box sweep;
    std::uint32_t total = 0;
    for (int b = bins - 1; b > 0; b--) {
      if (count[b]) sweep.add(box[b].low), sweep.add(box[b].high);
      total += count[b], right[b] = sweep.half_area() * total;
    }
    sweep = Box(), total = 0;
    double best = std::numeric_limits<double>::infinity();
    int split = 0;
    for (int b = 1; b < bins; b++) {
      if (count[b - 1]) sweep.add(box[b - 1].low), sweep.add(box[b - 1].high);
      total += count[b - 1];
      const double cost = sweep.half_area() * total + right[b];
      if (cost < best && total > 0 && total < end - begin) best = cost, split = b;
    }
    if (split > 0)
      middle = static_cast<std::uint32_t>(std::partition(order.begin() + begin, order.begin() + end,
                                                         [&](auto t) { return bin_of(t) < split; }) -
                                          order.begin());
  }
  // Uneven splits could make the tree as deep as there are triangles: below 1/32 the median splits instead.
  const std::uint32_t smaller = std::min(middle - begin, end - middle);
  if (smaller == 0 || (end - begin > 4 * kLeafSize && smaller < (end - begin) / 32)) {
    middle = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end, [&](auto s, auto t) {
      const double x = boxes[s].center()[axis], y = boxes[t].center()[axis];
      return x != y ? x < y : s < t;
    });
  }
  const auto index = static_cast<std::uint32_t>(nodes.size());
  nodes.emplace_back();
  const std::uint32_t from[2] = {begin, middle}, to[2] = {middle, end};
  // The halves of a large node are built side by side, each into nodes of its own that are then appended.
  const bool apart = end - begin > kTreeParallelSize;
  std::vector<Node> own[2];
  const auto build_side = [&](int side) {
    Box box;
    for (auto k = from[side]; k < to[side]; k++) box.add(boxes[order[k]].low), box.add(boxes[order[k]].high);
    std::uint32_t child = from[side], count = to[side] - from[side];
    if (count > kLeafSize)
      child = build(apart ? own[side] : nodes, order, boxes, from[side], to[side]), count = 0;
    Node& node = nodes[index];
    node.set(side, box);
    node.child[side] = child, node.count[side] = count;
  };
  if (!apart) return build_side(0), build_side(1), index;
#pragma omp task shared(build_side)
  build_side(0);
  build_side(1);
#pragma omp taskwait
  for (int side = 0; side < 2; side++) {
    const auto offset = static_cast<std::uint32_t>(nodes.size());
    for (Node& node : own[side]) {
      for (int k = 0; k < 2; k++) node.child[k] += node.count[k] == 0 ? offset : 0;
      nodes.push_back(node);
    }
    if (nodes[index].count[side] == 0) nodes[index].child[side] += offset;
  }
  return index;
}

// A work item is two parts of the tree whose boxes touch, or twice the same part. A part is a child of a
// node.
class PairWalk {
 public:
  using Visit = std::function<bool(std::uint32_t, std::uint32_t)>;
  PairWalk(const TriangleTree& tree, const Mesh& mesh, const Visit& visit)
      : mesh_(mesh), nodes_(tree.nodes()), triangles_(tree.triangles()), visit_(visit) {}

  void run() {
    std::vector<Item> items, next;
    push_node(0, items);
    constexpr std::size_t enough = 4096;  // for even work on all threads
    for (int level = 0; level < TriangleTree::kStackSize && !items.empty() && items.size() < enough;
         level++) {
      next.clear();
      for (const Item& item : items) step(item, next);
      items.swap(next);
    }
#pragma omp parallel
    {
      std::vector<Item> stack;
#pragma omp for schedule(dynamic, 8)
      for (std::size_t k = 0; k < items.size(); k++) {
        stack.push_back(items[k]);
        while (!stack.empty()) {
          const Item item = stack.back();
          stack.pop_back();
          step(item, stack);
        }
      }
    }
  }

 private:
  struct Part {
    std::uint32_t node, side;
    bool operator==(const Part&) const = default;
  };
  struct Item {
    Part a, b;
  };

  std::uint32_t count(Part p) const { return nodes_[p.node].count[p.side]; }
  Part child(Part p, std::uint32_t side) const { return {nodes_[p.node].child[p.side], side}; }
  using Corner = std::array<double, 3>;
  static Corner corner(const Eigen::Array2d* of, std::uint32_t side) {
    return {of[0][side], of[1][side], of[2][side]};
  }
  Corner low(Part p) const { return corner(nodes_[p.node].low, p.side); }
  Corner high(Part p) const { return corner(nodes_[p.node].high, p.side); }

  static bool touch(const Corner& low_a, const Corner& high_a, const Corner& low_b, const Corner& high_b) {
    bool apart = false;
    for (int k = 0; k < 3; k++) apart |= low_a[k] > high_b[k] || high_a[k] < low_b[k];
    return !apart;
  }

  void push_node(std::uint32_t node, std::vector<Item>& items) const {
    const Part a{node, 0}, b{node, 1};
    items.push_back({a, a});
    if (nodes_[node].empty(1)) return;
    items.push_back({b, b});
    if (touch(low(a), high(a), low(b), high(b))) items.push_back({a, b});
  }

  double size(Part p) const {
    const Node& node = nodes_[p.node];
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += node.high[k][p.side] - node.low[k][p.side];
    return sum;
  }

  void step(const Item& item, std::vector<Item>& items) {
    if (stop_.load(std::memory_order_relaxed)) return;
    const auto [a, b] = item;
    if (a == b && count(a) == 0) return push_node(nodes_[a.node].child[a.side], items);
    if (count(a) > 0 && count(b) > 0) return compare(a, b);
    const bool cut_a = count(b) > 0 || (count(a) == 0 && size(a) >= size(b));
    const Part whole = cut_a ? b : a;
    for (const std::uint32_t side : {0u, 1u}) {
      const Part half = child(cut_a ? a : b, side);
      if (touch(low(half), high(half), low(whole), high(whole))) items.push_back({half, whole});
    }
  }

  // The triangles of a leaf whose boxes touch that of the other leaf.
  struct Leaf {
    std::array<std::uint32_t, kLeafSize> triangle;
    std::array<Corner, kLeafSize> low, high;
    std::size_t count = 0;
  };
  Leaf leaf(Part p, Part other) const {
    Leaf out;
    const std::uint32_t first = nodes_[p.node].child[p.side];
    for (std::uint32_t k = first; k < first + count(p); k++) {
      const std::uint32_t t = triangles_[k];
      auto &l = out.low[out.count], &h = out.high[out.count];
      for (int axis = 0; axis < 3; axis++) {
        const auto [least, most] =
            std::minmax({mesh_.corner(t, 0)[axis], mesh_.corner(t, 1)[axis], mesh_.corner(t, 2)[axis]});
        l[axis] = least, h[axis] = most;
      }
      if (touch(l, h, low(other), high(other))) out.triangle[out.count++] = t;
    }
    return out;
  }

  void compare(Part a, Part b) {
    const Leaf s = leaf(a, b), t = a == b ? s : leaf(b, a);
    for (std::size_t i = 0; i < s.count; i++)
      for (std::size_t j = a == b ? i + 1 : 0; j < t.count; j++) {
        if (!touch(s.low[i], s.high[i], t.low[j], t.high[j])) continue;
        const auto [first, second] = std::minmax(s.triangle[i], t.triangle[j]);
        if (visit_(first, second)) stop_ = true;
      }
  }

  const Mesh& mesh_;
  const std::vector<Node>& nodes_;
  const std::vector<std::uint32_t>& triangles_;
  const Visit& visit_;
  std::atomic<bool> stop_ = false;
};

}  // namespace

void TriangleTree::SlabPair::set(int side, std::span<const std::array<Point, 3>> triangles) {
  Vector sum = Vector::Zero();
  for (const auto& [a, b, c] : triangles) sum += (b - a).cross(c - a);
  sum.normalize();                             // a zero vector stays zero
  if (!sum.allFinite()) sum = Vector::Zero();  // and rules out nothing
  for (int axis = 0; axis < 3; axis++) normal[axis][side] = sum[axis];
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const auto& triangle : triangles)
    for (const Point& p : triangle) least = std::min(least, sum.dot(p)), most = std::max(most, sum.dot(p));
  low[side] = least, high[side] = most;
}

TriangleTree::TriangleTree(const Mesh& mesh) : triangles_(numbered(mesh.triangles.size())) {
  const std::size_t n = mesh.triangles.size();
  std::vector<Box> boxes(n);
#pragma omp parallel for if (n > kTreeParallelSize)
  for (std::size_t t = 0; t < n; t++)
    for (int k = 0; k < 3; k++) boxes[t].add(mesh.corner(t, k));
  if (n > kLeafSize) {
#pragma omp parallel if (n > kTreeParallelSize)
#pragma omp single
    build(nodes_, triangles_, boxes, 0, static_cast<std::uint32_t>(n));
  } else if (n > 0) {
    Box bounds;
    for (const Box& b : boxes) bounds.add(b.low), bounds.add(b.high);
    Node root{};
    root.set(0, bounds), root.set(1, {});
    root.count[0] = static_cast<std::uint32_t>(n);
    nodes_.push_back(root);
  }
}

void TriangleTree::find_slabs(const Mesh& mesh, const std::vector<std::uint32_t>& triangles) {
  const std::size_t n = nodes_.size();
  slabs_.resize(n), extent_ = 0;
  std::vector<std::array<Point, 3>> corners;
  corners.reserve(triangles.size());
  for (const auto t : triangles) {
    corners.push_back(mesh.corners(t));
    for (const Point& p : corners.back()) extent_ = std::max(extent_, p.cwiseAbs().sum());
  }
  std::vector<std::array<std::uint32_t, 2>> begin(n), end(n);  // of the slots below each child
  for (std::size_t k = n; k-- > 0;)
    for (int side = 0; side < 2; side++) {
      const std::uint32_t child = nodes_[k].child[side];
      const bool leaf = nodes_[k].count[side] > 0 || nodes_[k].empty(side);
      begin[k][side] = leaf ? child : begin[child][0];
      end[k][side] = leaf ? child + nodes_[k].count[side] : end[child][1];
    }
#pragma omp parallel for schedule(dynamic, 64) if (corners.size() > kTreeParallelSize)
  for (std::size_t k = 0; k < n; k++)
    for (int side = 0; side < 2; side++)
      slabs_[k].set(side, std::span(corners).subspan(begin[k][side], end[k][side] - begin[k][side]));
}

void TriangleTree::visit(const Box& box, const std::function<void(std::uint32_t)>& visit) const {
  if (nodes_.empty()) return;
  std::uint32_t stack[kStackSize];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = nodes_[stack[--top]];
    for (int side = 0; side < 2; side++) {
      bool apart = node.empty(side);
      for (int k = 0; k < 3; k++) apart |= node.low[k][side] > box.high[k] || node.high[k][side] < box.low[k];
      if (apart) continue;
      if (node.count[side] == 0) stack[top++] = node.child[side];
      for (std::uint32_t k = 0; k < node.count[side]; k++) visit(triangles_[node.child[side] + k]);
    }
  }
}

void TriangleTree::visit_pairs(const Mesh& mesh,
                               const std::function<bool(std::uint32_t, std::uint32_t)>& visit) const {
  if (!nodes_.empty()) PairWalk(*this, mesh, visit).run();
}

}  // namespace padder
