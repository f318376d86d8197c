// SPDX-License-Identifier: MIT
// What the sources of the OpenMP backend share: memory, the view of the input, records, and the two paths.
// Internal.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <vector>

#include "detect/core/backend.h"
#include "detect/omp/batches.h"

namespace padder::detect::omp {

// How much memory this backend holds and may hold. Linux grants memory that it does not have, and kills the
// process when it is used. So the memory that is really free is asked for before each large allocation.
class Budget {
 public:
  // Begins a call. What the call takes counts against the memory that is free at its first large allocation,
  // because Linux shows memory as used only when it has been written to.
  void begin(std::uint64_t limit) { limit_ = limit, free_ = taken_ = 0; }
  std::uint64_t limit() const { return limit_; }
  std::uint64_t held() const { return held_.load(std::memory_order_relaxed); }
  bool take(std::uint64_t bytes);  // false: there is not so much
  void give(std::uint64_t bytes) { held_.fetch_sub(bytes, std::memory_order_relaxed); }

 private:
  std::uint64_t limit_ = 0;
  std::atomic<std::uint64_t> held_{0}, free_{0}, taken_{0};
};

// An array that only grows. It is not initialised, and its contents are lost when it grows.
template <class T>
class Buffer {
 public:
  explicit Buffer(Budget& budget) : budget_(&budget) {}
  Buffer(Buffer&& other) noexcept : budget_(other.budget_) { swap(other); }
  Buffer& operator=(Buffer&&) = delete;
  ~Buffer() { release(); }

  // Makes room for n entries. An array that grows again takes a quarter more, if there is memory for it: in a
  // scene that moves, each call may need a few more than the call before. False if there is not enough
  // memory; then the buffer is empty.
  bool try_resize(std::uint64_t n) {
    if (n <= capacity_) return true;
    const std::uint64_t roomy = capacity_ + capacity_ / 4;
    release();
    return (roomy > n && allocate(roomy)) || allocate(n);
  }
  T* resize(std::uint64_t n, const char* what);  // as try_resize; throws Error that names `what`

  T* data() const { return data_; }
  T& operator[](std::uint64_t k) const { return data_[k]; }
  std::uint64_t capacity() const { return capacity_; }
  void swap(Buffer& other) noexcept {
    std::swap(data_, other.data_), std::swap(capacity_, other.capacity_), std::swap(bytes_, other.bytes_);
  }

 private:
  bool allocate(std::uint64_t n) {
    const std::uint64_t bytes = (n * sizeof(T) + 63) / 64 * 64;
    if (!budget_->take(bytes)) return false;
    data_ = static_cast<T*>(std::aligned_alloc(64, bytes));
    if (!data_) return budget_->give(bytes), false;
    capacity_ = bytes / sizeof(T), bytes_ = bytes;
    return true;
  }
  void release() {
    if (data_) budget_->give(bytes_);
    std::free(data_);
    data_ = nullptr, capacity_ = bytes_ = 0;
  }
  Budget* budget_;
  T* data_ = nullptr;
  std::uint64_t capacity_ = 0, bytes_ = 0;
};

// Of so many bytes beside what the budget holds.
[[noreturn]] void throw_memory(const Budget& budget, std::uint64_t bytes, const char* what);
// For a list of so many entries; `what` is the word for them.
[[noreturn]] void throw_memory(const Budget& budget, std::uint64_t bytes, std::uint64_t entries,
                               const char* what);
template <class T>
T* Buffer<T>::resize(std::uint64_t n, const char* what) {
  if (!try_resize(n)) throw_memory(*budget_, n * sizeof(T), what);
  return data_;
}

// The spheres that a path reads: in the caller's arrays, or, for scenes with bodies, as the backend has
// placed them.
template <class T>
struct View {
  const T* centers;
  const T* radii;
  std::uint64_t center_stride, radius_stride, count;
  const std::uint32_t* family;              // null: 0 for all
  const std::uint32_t* mask;                // null: 0 for all
  const std::uint32_t* owner = nullptr;     // Filter::owner; null: all spheres are loose
  const std::uint8_t* is_static = nullptr;  // read if owner is null; null: none is static
  const std::uint32_t* world = nullptr;     // read by the nine stages; null: all are in `world_of_all`
  std::uint32_t world_of_all = 0;
  const T* center(std::uint64_t k) const { return centers + k * center_stride; }
  T radius(std::uint64_t k) const { return radii[k * radius_stride]; }
  Sphere operator[](std::uint64_t k) const {
    const T* c = center(k);
    return {c[0], c[1], c[2], radius(k)};
  }
  Filter filter(std::uint64_t k) const {
    return {family ? family[k] : 0, mask ? mask[k] : 0,
            owner                       ? owner[k]
            : is_static && is_static[k] ? kStatic
                                        : 0};
  }
  std::uint32_t world_of(std::uint64_t k) const { return world ? world[k] : world_of_all; }
  bool filtered() const { return family || mask || owner || is_static; }
};

// The view of an array of spheres.
inline View<double> view_of(const Sphere* spheres, std::uint64_t count, const std::uint32_t* family,
                            const std::uint32_t* mask, const std::uint32_t* owner) {
  if (count == 0) return {nullptr, nullptr, 4, 4, 0, family, mask, owner, nullptr, nullptr, 0};
  return {&spheres->x, &spheres->r, 4, 4, count, family, mask, owner, nullptr, nullptr, 0};
}

// The spheres from number `first` on. The last batch is filled up with its last sphere.
template <class T>
void load_batch(const View<T>& spheres, std::uint64_t first, double (&v)[4][kBatch]) {
  const std::uint64_t last = spheres.count - 1;
  for (std::uint64_t k = 0; k < kBatch; k++) {
    const Sphere p = spheres[std::min(first + k, last)];
    v[0][k] = p.x, v[1][k] = p.y, v[2][k] = p.z, v[3][k] = p.r;
  }
}

// Measures the seconds since it was made, or since the last lap.
class Stopwatch {
 public:
  Stopwatch();
  double lap();

 private:
  double last_;
};

template <class T>
Summary summarize(const View<T>& spheres, int threads);

// The arrays of contacts. They are kept from call to call.
struct Records {
  // `what`: what a sentence about missing memory calls them.
  explicit Records(Budget& b, const char* name = "contacts")
      : budget(&b), what(name), pairs(b), normals(b), points(b) {}
  const Budget* budget;
  const char* what;
  Buffer<Pair> pairs;
  Buffer<std::byte> normals, points;
  std::uint64_t count = 0;

  // Makes room for n records, or throws MemoryError.
  void resize(std::uint64_t n, const CallOptions& options);
  // Writes record k, of a contact between the spheres with numbers a and b. The smaller number comes first.
  void write(std::uint64_t k, std::uint32_t a, std::uint32_t b, const Sphere& sa, const Sphere& sb,
             const CallOptions& options);
};

// Writes records one after the other, beginning with record `first`. It computes normals in batches; the
// destructor writes the last one.
class RecordWriter {
 public:
  RecordWriter(Records& records, const CallOptions& options, std::uint64_t first)
      : records_(records), options_(options), next_(first), batch_first_(first) {}
  ~RecordWriter() { flush(); }
  RecordWriter(const RecordWriter&) = delete;

  // A contact between the spheres with numbers a and b. `other` returns sphere b; it is called only if b is
  // needed.
  template <class Other>
  void add(std::uint32_t a, std::uint32_t b, const Sphere& sa, Other other) {
    if (options_.width == Width::points) {
      records_.write(next_++, a, b, sa, other(), options_);
      return;
    }
    const bool ordered = a < b;
    records_.pairs[next_++] = ordered ? Pair{a, b} : Pair{b, a};
    if (options_.width == Width::pairs) return;
    const Sphere sb = other();
    const Sphere &i = ordered ? sa : sb, &j = ordered ? sb : sa;
    batch_.x[size_] = j.x - i.x, batch_.y[size_] = j.y - i.y, batch_.z[size_] = j.z - i.z,
    batch_.s[size_] = i.r + j.r;
    if (++size_ == kBatch) flush();
  }

 private:
  void flush();
  Records& records_;
  const CallOptions& options_;
  std::uint64_t next_, batch_first_;
  std::uint32_t size_ = 0;
  Batch batch_;
};

// The nine stages (nine_stages.cpp).
class NineStages {
 public:
  explicit NineStages(Budget& b);
  template <class T>
  void run(const View<T>& spheres, const Summary& summary, const CallOptions& options, int threads,
           Records& records, Seconds& seconds, Arrays* arrays);

 private:
  Buffer<std::uint64_t> T_, S_, D_, E_;
  Buffer<BinEntry> B_, B_spare_;
  Buffer<BinStart> C_, C_spare_;
};

// A sphere to be sorted by its key.
template <class T>
struct Entry {
  std::uint32_t key, id;
  T x, y, z, r;
};

class ReachTable;

// How the spheres of a level search another. By rows of its bins; or, a coarser one, by its table of reaches;
// or they test all of its spheres, if these are few.
enum class Way { rows, table, whole };

// The grid path (order.cpp, search/search.cpp, records.cpp).
class GridPath {
 public:
  // `what`: as in Records, of what it finds.
  explicit GridPath(Budget& b, const char* what = "contacts");
  ~GridPath();
  template <class T>
  std::uint64_t run(const View<T>& spheres, const Summary& summary, const CallOptions& options, int threads,
                    Records& records, Seconds& seconds);  // returns the number of doubtful pairs

 private:
  template <class Slot>
  std::uint64_t search_and_write(const Grid& grid, const Summary& summary, const CallOptions& options,
                                 bool filtered, int threads, Records& records, Seconds& seconds);
  template <class Slot>
  const Exact<Slot>* exact_spheres() const {
    return reinterpret_cast<const Exact<Slot>*>(spheres_.data());
  }
  template <class Slot>
  Slots<Slot> slots() const {
    using C = typename Slots<Slot>::Component;
    return {reinterpret_cast<C*>(slots_[0].data()), reinterpret_cast<C*>(slots_[1].data()),
            reinterpret_cast<C*>(slots_[2].data()), slots_[3].data()};
  }
  template <class Slot, class T>
  void sort(const View<T>& spheres, const Grid& grid, int threads, Seconds& seconds);
  template <class Slot>
  std::uint64_t search(const Grid& grid, const Summary& summary, const CallOptions& options, bool filtered,
                       int threads, Seconds& seconds);
  template <class Slot>
  void write(const CallOptions& options, int threads, Records& records);

  // Consecutive slots of a level that search a level, as a unit of work and of the stable order. One thread
  // searches them, and their hits are in that thread's list.
  struct Chunk {
    std::uint64_t slot, slots;   // the first slot, and how many
    std::uint64_t first, count;  // the hits in the lists of the thread
    std::uint64_t record;        // number of the first record
    int thread, level, at;       // the level of the slots, and the level that they search
    Way way;
  };

  Budget* budget_;
  const char* what_;
  Buffer<std::uint32_t> keys_;             // by sphere while they are sorted, then by slot
  Buffer<std::uint32_t> starts_;           // the first slot of each bucket, and the end
  Buffer<std::uint32_t> ids_;              // the number of the sphere in each slot
  Buffer<std::uint32_t> counts_, places_;  // of each thread: spheres of each part, and of each bin of a part
  Buffer<std::byte> entries_;
  Buffer<float> slots_[4];
  Buffer<Filter> filters_;
  Buffer<std::byte> spheres_;                // in the order of the slots: Exact<Slot>
  std::vector<Buffer<std::uint32_t>> hits_;  // of each thread: HitLists, half of the buffer each
  std::vector<ReachTable> reaches_;          // of each level, where finer spheres search it so
  std::vector<Chunk> chunks_;
};

}  // namespace padder::detect::omp
