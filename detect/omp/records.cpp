// SPDX-License-Identifier: MIT
// Turns hits into records, in which the smaller number comes first. Normals and penetrations are computed in
// batches, so that the compiler uses vector instructions for square roots and divisions.
#include "detect/omp/paths.h"

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
void write_batch(Batch& batch, int count, std::uint64_t first, const CallOptions& options, Records& records) {
  to_normals(batch, count);
  const auto copy = [&]<class T>(Normal<T>* to) {
    for (int k = 0; k < count; k++)
      to[k] = {static_cast<T>(batch.x[k]), static_cast<T>(batch.y[k]), static_cast<T>(batch.z[k]),
               static_cast<T>(batch.s[k])};
  };
  if (options.scalar == Scalar::f32)
    copy(reinterpret_cast<Normal<float>*>(records.normals.data()) + first);
  else
    copy(reinterpret_cast<Normal<double>*>(records.normals.data()) + first);
}

// Writes the contacts of slots, one after the other.
template <class Slot>
class SlotWriter {
 public:
  SlotWriter(const Slots<Slot>& slots, const Sphere* spheres, const std::uint32_t* ids,
             const CallOptions& options, std::uint64_t first, Records& records)
      : slots_(slots), spheres_(spheres), ids_(ids), options_(options), next_(first), records_(records) {}

  // The contacts of slot a with slots hits[0] to hits[count - 1].
  void add(std::uint32_t a, const std::uint32_t* hits, std::uint32_t count) {
    while (count > 0) {
      const std::uint32_t n = std::min(count, kBatch - size_);
      kernels_.order_pairs(a, hits, static_cast<int>(n), ids_, pairs_ + size_, i_ + size_, j_ + size_);
      size_ += n, hits += n, count -= n;
      if (size_ == kBatch) flush();
    }
  }
  void flush() {
    std::copy_n(pairs_, size_, records_.pairs.data() + next_);
    if (options_.width == Width::normals) {
      differences(slots_, spheres_, i_, j_, static_cast<int>(size_), batch_);
      write_batch(batch_, static_cast<int>(size_), next_, options_, records_);
    }
    for (std::uint32_t k = 0; k < size_ && options_.width == Width::points; k++)
      records_.write(next_ + k, pairs_[k].i, pairs_[k].j, exact_sphere(spheres_, slots_, i_[k]),
                     exact_sphere(spheres_, slots_, j_[k]), options_);
    next_ += size_, size_ = 0;
  }

 private:
  const Slots<Slot> slots_;
  const Sphere* spheres_;
  const std::uint32_t* ids_;
  const CallOptions& options_;
  const Kernels<Slot> kernels_ = kernels_for_this_machine<Slot>();
  std::uint64_t next_;
  Records& records_;
  std::uint32_t size_ = 0;
  Pair pairs_[kBatch + kLanes];
  std::uint32_t i_[kBatch + kLanes], j_[kBatch + kLanes];
  Batch batch_;
};

}  // namespace

void Records::resize(std::uint64_t n, const CallOptions& o) {
  const std::uint64_t normal = record_bytes(o, false), point = record_bytes(o, true);
  count = 0;
  if (!pairs.try_resize(n) || !normals.try_resize(n * normal) || !points.try_resize(n * point))
    throw_memory(n * (sizeof(Pair) + normal + point), (std::to_string(n) + " contacts").c_str());
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
  write_batch(batch_, static_cast<int>(size_), batch_first_, options_, records_);
  batch_first_ += size_, size_ = 0;
}

template <class Slot>
void GridPath::write(const CallOptions& options, int threads, Records& records) {
  const auto chunks = static_cast<std::int64_t>(chunks_.size());
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads)
  for (std::int64_t k = 0; k < chunks; k++) {
    const Chunk& c = chunks_[static_cast<std::size_t>(k)];
    const std::uint32_t* hit = hits_[static_cast<std::size_t>(c.thread)].data() + c.first;
    SlotWriter<Slot> writer(slots<Slot>(), spheres_.data(), ids_.data(), options, c.record, records);
    for (std::uint64_t a = c.slot; a < c.slot + c.slots; hit += found_[a], a++)
      writer.add(static_cast<std::uint32_t>(a), hit, found_[a]);
    writer.flush();
  }
}
template void GridPath::write<FloatSlot>(const CallOptions&, int, Records&);
template void GridPath::write<FixedPointSlot>(const CallOptions&, int, Records&);

}  // namespace padder::detect::omp
