// SPDX-License-Identifier: MIT
// Turns hits into records, in which the smaller number comes first. Normals and penetrations are computed in
// batches, so that the compiler uses vector instructions for square roots and divisions.
#include "detect/omp/paths.h"

#include <algorithm>

namespace padder::detect::omp {
namespace {

std::uint64_t record_bytes(const CallOptions& o, bool points) {
  const std::uint64_t scalar = o.scalar == Scalar::f32 ? 4 : 8;
  return points ? (o.width == Width::points ? 6 * scalar : 0) : (o.width == Width::pairs ? 0 : 4 * scalar);
}

template <class T>
void write_geometry(const Geometry& g, std::byte* normals, std::byte* points, std::uint64_t k) {
  reinterpret_cast<Normal<T>*>(normals)[k] = {static_cast<T>(g.normal[0]), static_cast<T>(g.normal[1]),
                                              static_cast<T>(g.normal[2]), static_cast<T>(g.depth)};
  if (!points) return;
  Points<T>& p = reinterpret_cast<Points<T>*>(points)[k];
  for (int c = 0; c < 3; c++) p.on_i[c] = static_cast<T>(g.on_i[c]), p.on_j[c] = static_cast<T>(g.on_j[c]);
}

// Writes the normals and penetrations of a batch into the records from `first` on.
void write_batch(Batch& batch, std::uint32_t count, std::uint64_t first, const CallOptions& options,
                 Records& records) {
  to_normals(batch, static_cast<int>(count));
  if (options.scalar == Scalar::f32)
    copy_normals(batch, count, reinterpret_cast<Normal<float>*>(records.normals.data()) + first);
  else
    copy_normals(batch, count, reinterpret_cast<Normal<double>*>(records.normals.data()) + first);
}

// Writes the contacts of chunks, a batch at a time.
template <class Slot>
class ChunkWriter {
 public:
  ChunkWriter(const Exact<Slot>* spheres, const std::uint32_t* ids, const CallOptions& options,
              Records& records)
      : spheres_(spheres), ids_(ids), options_(options), records_(records) {}

  // The contacts of `count` hits, into the records from `first` on. scattered: the slots of `b` are of
  // another level, and lie anywhere.
  void write(const std::uint32_t* a, const std::uint32_t* b, std::uint64_t count, std::uint64_t first,
             bool scattered) {
    const auto batch = [&](std::uint64_t from) {
      return static_cast<std::uint32_t>(std::min<std::uint64_t>(kBatch, count - std::min(from, count)));
    };
    if (scattered) fetch(b, batch(0));
    for (std::uint64_t done = 0, next = kBatch; done < count; done = next, next += kBatch) {
      if (scattered) fetch(b + next, batch(next));  // while the batch before it is written
      write_batch_of(a + done, b + done, batch(done), first + done);
    }
  }

 private:
  void fetch([[maybe_unused]] const std::uint32_t* slots, [[maybe_unused]] std::uint32_t count) const {
#ifdef __GNUC__
    for (std::uint32_t k = 0; k < count; k++)
      __builtin_prefetch(spheres_ + slots[k]), __builtin_prefetch(ids_ + slots[k]);
#endif
  }
  void write_batch_of(const std::uint32_t* a, const std::uint32_t* b, std::uint32_t count,
                      std::uint64_t first) {
    Pair* const pairs = records_.pairs.data() + first;
    order_pairs(a, b, count, ids_, pairs, i_, j_);
    if (options_.width == Width::normals) {
      differences(spheres_, i_, j_, count, batch_);
      write_batch(batch_, count, first, options_, records_);
    }
    if (options_.width != Width::points) return;
#ifdef __GNUC__
    // All at once: the computation of a record leaves no room to wait for the spheres of the next ones.
    for (std::uint32_t k = 0; k < count; k++)
      __builtin_prefetch(spheres_ + i_[k]), __builtin_prefetch(spheres_ + j_[k]);
#endif
    for (std::uint32_t k = 0; k < count; k++)
      records_.write(first + k, pairs[k].i, pairs[k].j, sphere_of(spheres_[i_[k]]),
                     sphere_of(spheres_[j_[k]]), options_);
  }

  const Exact<Slot>* spheres_;
  const std::uint32_t* ids_;
  const CallOptions& options_;
  Records& records_;
  std::uint32_t i_[kBatch] = {}, j_[kBatch] = {};
  Batch batch_;
};

}  // namespace

void Records::resize(std::uint64_t n, const CallOptions& o) {
  const std::uint64_t normal = record_bytes(o, false), point = record_bytes(o, true);
  count = 0;
  if (!pairs.try_resize(n) || !normals.try_resize(n * normal) || !points.try_resize(n * point))
    throw_memory(*budget, n * (sizeof(Pair) + normal + point), n, what);
  count = n;
}

void Records::write(std::uint64_t k, std::uint32_t a, std::uint32_t b, const Sphere& sa, const Sphere& sb,
                    const CallOptions& o) {
  const bool ordered = a < b;
  pairs[k] = ordered ? Pair{a, b} : Pair{b, a};
  if (o.width == Width::pairs) return;
  const Geometry g = ordered ? geometry(sa, sb) : geometry(sb, sa);
  std::byte* p = o.width == Width::points ? points.data() : nullptr;
  if (o.scalar == Scalar::f32)
    write_geometry<float>(g, normals.data(), p, k);
  else
    write_geometry<double>(g, normals.data(), p, k);
}

void RecordWriter::flush() {
  if (size_ == 0) return;
  write_batch(batch_, size_, batch_first_, options_, records_);
  batch_first_ += size_, size_ = 0;
}

template <class Slot>
void GridPath::write(const CallOptions& options, int threads, Records& records) {
  const auto chunks = static_cast<std::int64_t>(chunks_.size());
#pragma omp parallel num_threads(threads)
  {
    ChunkWriter<Slot> writer(exact_spheres<Slot>(), ids_.data(), options, records);
#pragma omp for schedule(dynamic, 8)
    for (std::int64_t k = 0; k < chunks; k++) {
      const Chunk& c = chunks_[static_cast<std::size_t>(k)];
      const Buffer<std::uint32_t>& hits = hits_[static_cast<std::size_t>(c.thread)];
      const std::uint32_t* const a = hits.data() + c.first;
      writer.write(a, a + hits.capacity() / 2, c.count, c.record, c.at != c.level);
    }
  }
}
template void GridPath::write<FloatSlot>(const CallOptions&, int, Records&);
template void GridPath::write<FixedPointSlot>(const CallOptions&, int, Records&);

}  // namespace padder::detect::omp
