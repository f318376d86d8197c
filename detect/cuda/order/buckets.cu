// SPDX-License-Identifier: MIT
// The order through buckets: some thousand of them, each of consecutive bins. A first pass divides the
// spheres among the buckets (bucket_split.cu). Then each bucket, which fits shared memory, is put in order
// and its part of the table written (bucket_order.cu). So no sphere is read from or written to a random
// place. Where there are too many buckets to divide among them at once, spheres are divided among groups of
// buckets first. Where buckets begin is counted (bucket_count.cu). Or, where the previous call had the same
// buckets, each gets a little more room than it needed then, and what it needs now is counted along.
#include "detect/cuda/order/buckets.h"

#include <algorithm>
#include <cmath>

#include "detect/cuda/device/device.h"

namespace padder::detect::cuda {
namespace {

// Bytes of shared memory that the kernels declare themselves, or less; that the device takes for each block,
// from what it offers, too, but once.
constexpr std::uint32_t kStaticShared = 1024, kTakenShared = 1024;

// As many buckets as give each about `aim` spheres on average, of fewer than `widest` entries.
Buckets choose_buckets(const Grid& grid, const Ordered& o, double aim, double widest) {
  Buckets b;
  b.merge = o.merge, b.levels = grid.levels, b.entries = static_cast<std::uint32_t>(o.entries);
  for (int k = 0; k < grid.levels; k++) {
    Buckets::Part& part = b.part[k];
    part.entry = k ? grid.level[k].offset : 0, part.bucket = b.count;
    const std::uint32_t entries = (k + 1 < grid.levels ? grid.level[k + 1].offset : b.entries) - part.entry;
    const Level& l = grid.level[k];
    // Hashed levels fill buckets less evenly: lines and planes of spheres come in runs. Of a dense level, the
    // two empty layers of the border are buckets of their own, which leaves fewer entries to the others.
    const double spheres = static_cast<double>(std::max<std::uint64_t>(l.spheres, 1)),
                 part_filled =
                     l.hashed ? tuning::kHashedBucket : l.least_filled * l.count[2] / (l.count[2] + 2.0),
                 width = std::floor(std::clamp(aim * part_filled * entries / spheres, 2.0, widest - 1));
    part.magic = static_cast<std::uint32_t>(std::ceil(4294967296.0 / width));
    // A level of few spheres may have fewer entries than its buckets have room for.
    b.widest = std::max(b.widest, std::min(static_cast<std::uint32_t>(width), entries) + 2);
    b.count += static_cast<std::uint32_t>((std::uint64_t(entries - 1) * part.magic) >> 32) + 1;
  }
  return b;
}

// Spheres that a block divides at once: as many as leave a quarter of its shared memory to the buckets, or
// kMostAtOnce of these.
std::uint32_t choose_portion(std::uint32_t shared) {
  const std::uint32_t most = kWideBlock * kPortionItems;
  if (portion_bytes(most, kMostAtOnce) <= shared) return most;
  return std::min(most, shared / 4 * 3 / 18 / kWideBlock * kWideBlock);
}

// False: these spheres cannot be put in order through buckets, here or on no device.
bool choose_plan(const Grid& grid, const Ordered& o, double bucket_spheres, int crowding, BucketPlan& p) {
  const auto offered = static_cast<std::uint32_t>(shared_memory_of_block());
  const std::uint32_t shared = p.shared_bytes = offered - std::min(offered, kStaticShared);
  const std::uint32_t portion = choose_portion(shared);
  if (portion == 0 || portion_bytes(portion, 1u << kGroupBits) > shared) return false;
  const std::uint32_t at_once = std::min(kMostAtOnce, ((shared - portion * 18) / 4 - 1) / 2);
  const bool halved = o.count <= tuning::kHalvedBuckets;
  p.threads = halved ? kWideBlock / 2 : kWideBlock;
  const std::uint32_t parts = halved ? 2 : 1,
                      room =
                          (shared - std::min(shared, (parts - 1) * (kStaticShared + kTakenShared))) / parts,
                      bytes = sphere_bytes(o), octaves = has_ids(o) ? sizeof(OctaveBounds) : 0;
  if (room <= octaves) return false;
  // Where a device offers less, buckets are as much smaller as what is left for their spheres.
  const double aim = bucket_spheres / parts *
                     std::min(1.0, double(room - octaves) / (tuning::kBucketShared / parts - octaves));
  // No more entries than leave room for the spheres, nor than 16 bits can number. Chance fills a bucket with
  // more than its aim, small ones by a larger share. Smaller buckets of a crowded scene keep that room: what
  // they do not need on average is for those that are fuller.
  const double most = aim + std::max(0.12 * aim, 6.8 * std::sqrt(aim)),
               widest = std::min((room - octaves - most * bytes) / 4 - 4, 65535.0);
  if (widest < 64) return false;
  p.buckets = choose_buckets(grid, o, aim / (1 << crowding), widest);
  p.buckets.portion_spheres = portion;
  p.groups = p.buckets.count > at_once ? groups_of(p.buckets.count) : 0;
  if (p.groups > at_once) return false;
  p.table_bytes = ((p.buckets.widest + 4) & ~3u) * 4 + octaves;
  p.capacity = std::min<std::uint32_t>((room - p.table_bytes) / bytes, kMostBucketItems * p.threads) & ~3u;
  return true;
}

Starts starts_in(std::uint32_t* memory, std::uint32_t buckets) {
  Starts s;
  s.finished = memory, s.bucket = s.finished + 1, s.cursor = s.bucket + buckets + 1,
  s.room = s.cursor + buckets + 1, s.group_cursor = s.room + buckets + 1;
  s.group_portion = s.group_cursor + groups_of(buckets);
  return s;
}
std::uint64_t words_of_starts(std::uint32_t buckets) {
  return 3 * std::uint64_t(buckets) + 2 * groups_of(buckets) + 6;
}

}  // namespace

// May the spheres be divided by what the previous call found? Sets plan.kept, and returns how many places the
// divided spheres take. Whatever the spheres do, and however many they are, two calls have the same buckets
// if their layouts say so: then those of the first have room in the second.
std::uint64_t Orderer::plan_rooms(const OrderRequest& r, const Ordered& o, BucketPlan& p) {
  const std::uint64_t n = o.count;
  Layout layout{n, p.buckets.count, p.buckets.entries};
  for (int k = 0; k < p.buckets.levels; k++) layout.magic[k] = p.buckets.part[k].magic;
  const bool same = layout_.has_same_buckets(layout);
  const auto most = static_cast<std::uint32_t>(same ? std::max(n, layout_.spheres) : n);
  const std::uint64_t roomy_count = roomy(most, p.buckets.count) + 1ull;
  // Rooms are not worth memory of their own where the list lends enough for spheres without rooms.
  const bool fits = r.lent.slots >= roomy_count || r.lent.slots < n,
             keepable = !has_keys(o) && p.groups == 0 && roomy_count > n && fits;
  p.kept = r.keep && keepable && same;
  keep_layout(keepable ? layout : Layout{});
  return keepable ? roomy_count : n;
}

// Work space lies in the list of contacts, which is written afterwards; where that is too short, in memory of
// our own.
void Orderer::plan_work_space(const Lent& list, std::uint64_t split_room, Ordered& o, BucketPlan& p) {
  const std::uint64_t n = o.count;
  const bool ids = has_ids(o), keyed = has_keys(o);
  const bool lent = list.slots >= split_room && list.words >= (keyed ? 2 * n : 0);
  if (keyed) o.keys = sorted_keys_.reserve(n);
  p.out = {o.slots, nullptr, o.keys, o.codes};
  p.split.slots = lent ? list.slot : split_slots_.reserve(split_room);
  if (keyed) {
    p.source.keys = lent ? list.word : keys_.reserve(n);
    p.split.keys = lent ? list.word + n : ids_.reserve(n);
  }
  const bool lent_ids = lent && list.words >= (keyed ? 2 * n : 0) + split_room;
  if (ids) {
    p.out.ids = o.ids = sorted_ids_.reserve(lent_ids ? n : n + split_room);
    p.split.ids = lent_ids ? list.word + (keyed ? 2 * n : 0) : o.ids + n;
  }
  p.starts = starts_in(starts_.reserve(words_of_starts(p.buckets.count)), p.buckets.count);
}

bool Orderer::by_buckets(const OrderRequest& r, Ordered& o) {
  BucketPlan plan;
  if (!choose_plan(r.grid, o, bucket_spheres, r.crowding, plan)) return false;
  plan.radius = r.radius, plan.stable = r.stable, plan.gather = r.gather, plan.counters = r.counters,
  plan.processors = r.processors;
  const std::uint64_t split_room = plan_rooms(r, o, plan);
  plan_work_space(r.lent, split_room, o, plan);
  if (r.gather.octaves && !plan.kept) Surveyor::gather_octaves(r.source, r.gather, r.processors, r.stream);
  begin_buckets(plan, r.stream);
  if (!plan.kept) count_buckets(plan, r.source, o, r.grid, r.stream);
  split_into_buckets(plan, r.source, o, r.grid, r.stream);
  order_buckets(plan, o, r.grid, r.stream);
  return true;
}

}  // namespace padder::detect::cuda
