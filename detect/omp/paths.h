// SPDX-License-Identifier: MIT
// What the OpenMP backend's sources share; internal.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>
#include <string>
#include <vector>

#include "detect/core/backend.h"
#include "detect/omp/kernels.h"

namespace padder::detect::omp {

// How much this backend holds and may hold. Linux grants memory it does not have and kills the process later:
// so what is really free is asked for before every growth.
class Budget {
 public:
  // Begins a call. What it takes counts against the memory free at its first large growth: taken memory shows
  // as used only once it is written to.
  void begin(std::uint64_t limit) { limit_ = limit, free_ = taken_ = 0; }
  std::uint64_t held() const { return held_.load(std::memory_order_relaxed); }
  bool take(std::uint64_t bytes);  // false: not to be had
  void give(std::uint64_t bytes) { held_.fetch_sub(bytes, std::memory_order_relaxed); }

 private:
  std::uint64_t limit_ = 0;
  std::atomic<std::uint64_t> held_{0}, free_{0}, taken_{0};
};

// Memory that only grows, not initialised, its contents lost when it grows.
template <class T>
class Buffer {
 public:
  explicit Buffer(Budget& budget) : budget_(&budget) {}
  Buffer(Buffer&& other) noexcept : budget_(other.budget_) { swap(other); }
  Buffer& operator=(Buffer&&) = delete;
  ~Buffer() { release(); }

  // Room for n; false when it is not to be had (then the buffer is empty).
  bool try_resize(std::uint64_t n) {
    if (n <= capacity_) return true;
    release();
    const std::uint64_t bytes = (n * sizeof(T) + 63) / 64 * 64;
    if (!budget_->take(bytes)) return false;
    data_ = static_cast<T*>(std::aligned_alloc(64, bytes));
    if (!data_) return budget_->give(bytes), false;
    capacity_ = bytes / sizeof(T), bytes_ = bytes;
    return true;
  }
  T* resize(std::uint64_t n, const char* what);  // throws Error

  T* data() const { return data_; }
  T& operator[](std::uint64_t k) const { return data_[k]; }
  std::uint64_t capacity() const { return capacity_; }
  void swap(Buffer& other) noexcept {
    std::swap(data_, other.data_), std::swap(capacity_, other.capacity_), std::swap(bytes_, other.bytes_);
  }

 private:
  void release() {
    if (data_) budget_->give(bytes_);
    std::free(data_);
    data_ = nullptr, capacity_ = bytes_ = 0;
  }
  Budget* budget_;
  T* data_ = nullptr;
  std::uint64_t capacity_ = 0, bytes_ = 0;
};

[[noreturn]] void throw_memory(std::uint64_t bytes, const char* what);
template <class T>
T* Buffer<T>::resize(std::uint64_t n, const char* what) {
  if (!try_resize(n)) throw_memory(n * sizeof(T) + budget_->held(), what);
  return data_;
}

// The spheres where they lie: the caller's arrays, or the placed ones of scenes with bodies.
template <class T>
struct View {
  const T* centers;
  const T* radii;
  std::uint64_t center_stride, radius_stride, count;
  const std::uint32_t* family;  // null: 0
  const std::uint32_t* mask;
  const std::uint32_t* owner = nullptr;     // null: those of loose spheres
  const std::uint8_t* is_static = nullptr;  // of loose spheres
  Sphere operator[](std::uint64_t k) const {
    const T* c = centers + k * center_stride;
    return {c[0], c[1], c[2], radii[k * radius_stride]};
  }
  Filter filter(std::uint64_t k) const {
    return {family ? family[k] : 0, mask ? mask[k] : 0,
            owner                       ? owner[k]
            : is_static && is_static[k] ? kStatic
                                        : 0};
  }
  void prefetch(std::uint64_t k) const {
#ifdef __GNUC__
    __builtin_prefetch(centers + k * center_stride);
#else
    (void)k;
#endif
  }
  bool filtered() const { return family || mask || owner || is_static; }
};

// Of spheres side by side; null when there are none.
inline View<double> view_of(const Sphere* spheres, std::uint64_t count, const std::uint32_t* family,
                            const std::uint32_t* mask, const std::uint32_t* owner) {
  if (count == 0) return {nullptr, nullptr, 4, 4, 0, family, mask, owner};
  return {&spheres->x, &spheres->r, 4, 4, count, family, mask, owner};
}

// Seconds since the last call.
class Watch {
 public:
  Watch();
  double lap();

 private:
  double last_;
};

template <class T>
Summary summarize(const View<T>& spheres, int threads);

// Where the contacts end up; kept from call to call.
struct Records {
  explicit Records(Budget& b) : pairs(b), normals(b), points(b) {}
  Buffer<Pair> pairs;
  Buffer<std::byte> normals, points;
  std::uint64_t count = 0;

  void resize(std::uint64_t n, const Options& options);  // throws Error with the bytes for all of it
  // Writes record k of a contact between spheres of numbers a and b; puts the smaller first.
  void write(std::uint64_t k, std::uint32_t a, std::uint32_t b, const Sphere& sa, const Sphere& sb,
             const Options& options);
};

// Writes records one behind the other, from `first` on. What is left is written when it ends.
class RecordWriter {
 public:
  RecordWriter(Records& records, const Options& options, std::uint64_t first)
      : records_(records), options_(options), next_(first), batch_first_(first) {}
  ~RecordWriter() { flush(); }
  RecordWriter(const RecordWriter&) = delete;

  // A contact of spheres number a and b; `other` gives the second one when it is needed.
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
  const Options& options_;
  std::uint64_t next_, batch_first_;
  std::uint32_t size_ = 0;
  Batch batch_;
};

// The nine stages (stages.cpp).
class Stages {
 public:
  explicit Stages(Budget& b);
  template <class T>
  void run(const View<T>& spheres, const Summary& summary, const Options& options, int threads,
           Records& records, Seconds& seconds, Arrays* arrays);

 private:
  Buffer<std::uint64_t> T_, S_, D_, E_;
  Buffer<BinEntry> B_, B_spare_;
  Buffer<BinStart> C_, C_spare_;
};

// The exact sphere of a slot: float slots hold it, for fixed-point slots it is kept beside them.
inline Sphere exact_sphere(const Sphere*, const Slots<FloatSlot>& slots, std::uint32_t k) {
  return {slots.x[k], slots.y[k], slots.z[k], slots.r[k]};
}
inline Sphere exact_sphere(const Sphere* spheres, const Slots<FixedPointSlot>&, std::uint32_t k) {
  return spheres[k];
}

// The fast path (fast.cpp, search.cpp, record.cpp).
class Fast {
 public:
  explicit Fast(Budget& b);
  template <class T>
  std::uint64_t run(const View<T>& spheres, const Summary& summary, const Options& options, int threads,
                    Records& records,
                    Seconds& seconds);  // gives the number of doubtful pairs

 private:
  struct Entry {
    std::uint32_t key, id;
  };
  template <class Slot, class T>
  std::uint64_t sort_and_search(const View<T>& spheres, const Grid& grid, const Options& options, int threads,
                                Records& records, Seconds& seconds);
  template <class Slot>
  Slots<Slot> slots() const {
    using C = typename Slots<Slot>::Component;
    return {reinterpret_cast<C*>(slots_[0].data()), reinterpret_cast<C*>(slots_[1].data()),
            reinterpret_cast<C*>(slots_[2].data()), slots_[3].data()};
  }
  template <class Slot, class T>
  void sort(const View<T>& spheres, const Grid& grid, int threads, Seconds& seconds);
  template <class Slot>
  std::uint64_t search(const Grid& grid, const Options& options, bool filtered, int threads,
                       Seconds& seconds);
  template <class Slot>
  void write(const Options& options, int threads, Records& records);

  // Slots searched at a stretch, and where their hits are: in the list of one thread.
  struct Chunk {
    std::uint64_t slot, slots, first, count, record;
    int thread;
  };

  Budget* budget_;
  Buffer<std::uint32_t> keys_, starts_, ids_, found_;  // found_: hits of each slot; keys_: sorted at last
  Buffer<std::uint32_t> counts_, places_;              // of each thread: spheres of each part, of each bin
  Buffer<Entry> entries_;
  Buffer<float> slots_[4];
  Buffer<Filter> filters_;
  Buffer<Sphere> spheres_;                   // in the order of slots; for double input
  std::vector<Buffer<std::uint32_t>> hits_;  // of each thread: slots of the partners
  std::vector<Chunk> chunks_;
};

}  // namespace padder::detect::omp
