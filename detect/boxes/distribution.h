// SPDX-License-Identifier: MIT
// Deals items out to boxes: each item goes to every box that its bounds meet, and the items of a box keep
// their order. Two linear passes over the items, shared by the threads: one that counts, one that delivers.
// The result does not depend on the number of threads. Internal.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "detect/boxes/cut.h"

namespace padder::detect {

class Distribution {
 public:
  // Counts n items for the boxes of `tree`. bounds.one(k) gives the Bounds of item k, and
  // bounds.all(first, end) some that hold those of all items from `first` to before `end`.
  // weight_of(first, end) is a whole number for such a run of items, which is added up for each box. Items
  // are counted in blocks, with one counter for each block and box; together the counters take about
  // `table_bytes`, or 4096 of them if that is more.
  template <class BoundsOf, class WeightOf>
  void count(std::uint64_t n, const BoxTree& tree, const BoundsOf& bounds, const WeightOf& weight_of,
             int threads, std::uint64_t table_bytes) {
    items_ = n, boxes_ = tree.boxes();
    const std::uint64_t most =
        std::max<std::uint64_t>(4096, table_bytes / sizeof(std::uint64_t)) / std::max(boxes_, 1u);
    const std::uint64_t blocks =
        std::clamp<std::uint64_t>(n / 1024, 1, std::clamp<std::uint64_t>(most, 1, 65536));
    per_block_ = (n + blocks - 1) / blocks, blocks_ = per_block_ ? (n + per_block_ - 1) / per_block_ : 0;
    first_.assign((blocks_ + 1) * boxes_, 0);
    weights_.assign(boxes_, 0);
#pragma omp parallel num_threads(threads)
    {
      // A thread's own: in the table threads would write to one cache line in turn, at every item.
      std::vector<std::uint64_t> weights(boxes_, 0), counts(boxes_);
#pragma omp for schedule(dynamic) nowait
      for (std::int64_t block = 0; block < static_cast<std::int64_t>(blocks_); block++) {
        std::ranges::fill(counts, 0);
        each_run(static_cast<std::uint64_t>(block), tree, {}, bounds,
                 [&](std::uint64_t first, std::uint64_t end, std::uint32_t box) {
                   counts[box] += end - first, weights[box] += weight_of(first, end);
                 });
        std::ranges::copy(counts, &first_[static_cast<std::uint64_t>(block) * boxes_]);
      }
#pragma omp critical(padder_boxes_weights)
      for (std::uint32_t b = 0; b < boxes_; b++) weights_[b] += weights[b];
    }
    // Counts become the place of a block's first item in its box's list; the last row holds the totals.
    std::vector<std::uint64_t> sum(boxes_, 0);
    for (std::uint64_t block = 0; block <= blocks_; block++)
      for (std::uint32_t b = 0; b < boxes_; b++) sum[b] += std::exchange(first_[block * boxes_ + b], sum[b]);
  }

  std::uint64_t count_of(std::uint32_t box) const { return first_[blocks_ * boxes_ + box]; }
  std::uint64_t weight_of(std::uint32_t box) const { return weights_[box]; }
  std::uint64_t bytes() const { return first_.capacity() * sizeof(std::uint64_t); }

  // Calls put(k, end, box, place) for runs of items, from k to before `end`, of the boxes from `first` to
  // before `last`, where `place` is the place of item k in the list of its box. Blocks of items without any
  // for these boxes are not looked at. `tree` and `bounds` must be those that were counted with. Calls
  // done(box) when the box has all of its items, which is early where neighbours in space have neighbouring
  // numbers. put and done are called from several threads.
  template <class BoundsOf, class Put, class Done>
  void deliver(std::uint32_t first, std::uint32_t last, const BoxTree& tree, const BoundsOf& bounds,
               const Put& put, const Done& done, int threads) const {
    const Region around = around_all(first, last, tree);
    std::vector<std::atomic<std::uint64_t>> missing(last - first);
    for (std::uint32_t box = first; box < last; box++)
      if ((missing[box - first] = count_of(box)) == 0) done(box);
#pragma omp parallel num_threads(threads)
    {
      std::vector<std::uint64_t> place(last - first);
#pragma omp for schedule(dynamic)
      for (std::int64_t block = 0; block < static_cast<std::int64_t>(blocks_); block++) {
        const std::uint64_t* const from = &first_[static_cast<std::uint64_t>(block) * boxes_];
        if (std::equal(from + first, from + last, from + boxes_ + first)) continue;
        std::copy(from + first, from + last, place.begin());
        each_run(static_cast<std::uint64_t>(block), tree, around, bounds,
                 [&](std::uint64_t k, std::uint64_t end, std::uint32_t box) {
                   if (box < first || box >= last) return;
                   put(k, end, box, place[box - first]), place[box - first] += end - k;
                 });
        for (std::uint32_t box = first; box < last; box++)
          if (const std::uint64_t put_now = place[box - first] - from[box]; put_now > 0)
            if (missing[box - first].fetch_sub(put_now) == put_now) done(box);
      }
    }
  }

 private:
  // The least region around some boxes: a cheap test that most items fail where there are many rounds.
  static Region around_all(std::uint32_t first, std::uint32_t last, const BoxTree& tree) {
    Region r = tree.region(first);
    for (std::uint32_t b = first + 1; b < last; b++)
      for (int a = 0; a < 3; a++) {
        r.low[a] = std::min(r.low[a], tree.region(b).low[a]);
        r.high[a] = std::max(r.high[a], tree.region(b).high[a]);
      }
    return r;
  }
  // Whether each_box() may reach one of the boxes within `r`; a face at infinity belongs to its box.
  static bool meets(const Bounds& b, const Region& r) {
    bool all = true;
    for (int a = 0; a < 3; a++) all &= b.low[a] <= r.high[a] && b.high[a] >= r.low[a];
    return all;
  }

  // Calls use(first, end, box) for runs of items of a block and their boxes, if they meet `around`; the runs
  // of a box come in order. Successive items often lie in one box, all of them. So the tree is asked about
  // groups; of a group that lies in several boxes, about smaller groups; and at last about single items.
  template <class BoundsOf, class Use>
  void each_run(std::uint64_t block, const BoxTree& tree, const Region& around, const BoundsOf& bounds,
                const Use& use) const {
    constexpr std::uint64_t kGroup = 64, kPart = 8;
    // Deals with a run as a whole, if all of it lies in one box or away from `around`.
    const auto is_one_run = [&](std::uint64_t first, std::uint64_t end) {
      const Bounds all = bounds.all(first, end);
      if (!meets(all, around)) return true;
      const std::optional<std::uint32_t> box = tree.only_box(all);
      if (box) use(first, end, *box);
      return box.has_value();
    };
    const std::uint64_t block_end = std::min(items_, (block + 1) * per_block_);
    for (std::uint64_t group = block * per_block_; group < block_end; group += kGroup) {
      const std::uint64_t group_end = std::min(group + kGroup, block_end);
      if (is_one_run(group, group_end)) continue;
      for (std::uint64_t part = group; part < group_end; part += kPart) {
        const std::uint64_t part_end = std::min(part + kPart, group_end);
        if (is_one_run(part, part_end)) continue;
        for (std::uint64_t k = part; k < part_end; k++)
          if (const Bounds b = bounds.one(k); meets(b, around))
            tree.each_box(b, [&](std::uint32_t box) { use(k, k + 1, box); });
      }
    }
  }

  std::uint64_t items_ = 0, per_block_ = 0, blocks_ = 0;
  std::uint32_t boxes_ = 0;
  std::vector<std::uint64_t> first_;    // of block b and box k at b * boxes_ + k
  std::vector<std::uint64_t> weights_;  // of each box
};

}  // namespace padder::detect
