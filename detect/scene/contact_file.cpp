// SPDX-License-Identifier: MIT
#include "detect/scene/contact_file.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "detect/scene/sorted_runs.h"
#include "padding/asset/crc32.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "padding/asset/vtp.h"

namespace padder::detect {
namespace {

// The contacts that a thread turns into bytes and writes at once: 16 to 96 KiB of each array. Larger writes
// can be slower: in a virtual machine whose host takes back large pieces of free memory, a copy in writes of
// 1 MiB took four times as long as one in writes of 64 KiB.
constexpr std::uint64_t kBlock = 1 << 12;
constexpr int kMostWriters = 16;  // each holds a block: a megabyte of text at most

// The next bytes of one array of the file, or of the file itself.
struct Column {
  std::string bytes;
  std::uint32_t checksum = 0;  // if the file has one
  std::uint64_t offset = 0;    // of the bytes in the file
};

// Contacts that follow one another in the sorted list, the first of them its contact number `first`.
struct Block {
  std::uint64_t first = 0;
  std::span<const KeyedContact> contacts;
  std::vector<Column> columns;
};

// A file format. Several threads call fill() at once; place() is called for one block after the other.
class Format {
 public:
  explicit Format(const Contacts& c) : normals_(c.normal_span<double>()), points_(c.point_span<double>()) {}
  virtual ~Format() = default;
  virtual void fill(Block& block) const = 0;  // makes the bytes of the columns
  virtual void place(Block& block) = 0;       // finds their offsets
  virtual void finish() {}

 protected:
  // Calls use(k, pair, normal, points) for each contact of the block. Its records lie anywhere in a list of
  // gigabytes: they are asked for early, or the processor would wait for memory at each of them.
  template <class Use>
  void each(const Block& block, const Use& use) const {
    constexpr std::size_t ahead = 24;
    const std::span<const KeyedContact> contacts = block.contacts;
    for (std::size_t k = 0; k < contacts.size(); k++) {
      if (k + ahead < contacts.size()) {
        const std::uint64_t at = contacts[k + ahead].at;
        fetch(&normals_[at], sizeof normals_[at]), fetch(&points_[at], sizeof points_[at]);
      }
      const KeyedContact& c = contacts[k];
      use(k, Pair{static_cast<std::uint32_t>(c.key >> 32), static_cast<std::uint32_t>(c.key)}, normals_[c.at],
          points_[c.at]);
    }
  }

 private:
  static void fetch(const void* record, std::size_t size) {
    __builtin_prefetch(record), __builtin_prefetch(static_cast<const char*>(record) + size - 1);
  }
  std::span<const Normal<double>> normals_;
  std::span<const Points<double>> points_;
};

class CsvFormat : public Format {
 public:
  CsvFormat(const Contacts& c, FileWriter& file) : Format(c), end_(kTitle.size()) {
    file.write_at(0, kTitle);
  }
  void fill(Block& block) const override {
    constexpr std::size_t longest = 2 * 11 + 10 * 25;  // of a line: i and j, ten doubles, what stands between
    block.columns.resize(1);
    std::string& text = block.columns[0].bytes;
    text.resize(block.contacts.size() * longest);
    char* at = text.data();
    char* const end = at + text.size();
    const auto add = [&](auto value, char after) {
      at = std::to_chars(at, end, value).ptr;
      *at++ = after;
    };
    each(block, [&](std::size_t, const Pair& pair, const Normal<double>& n, const Points<double>& p) {
      add(pair.i, ','), add(pair.j, ',');
      for (const double v : {n.x, n.y, n.z, n.depth}) add(v, ',');
      for (const double v : p.on_i) add(v, ',');
      add(p.on_j[0], ','), add(p.on_j[1], ','), add(p.on_j[2], '\n');
    });
    text.resize(static_cast<std::size_t>(at - text.data()));
  }
  void place(Block& block) override {
    block.columns[0].offset = end_;
    end_ += block.columns[0].bytes.size();
  }

 private:
  static constexpr std::string_view kTitle = "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n";
  std::uint64_t end_;
};

// The column of the block as so many numbers for each contact, one after the other as they lie in memory.
template <class T>
T* numbers(Block& block, std::size_t column, std::size_t for_each) {
  std::string& bytes = block.columns[column].bytes;
  bytes.resize(block.contacts.size() * for_each * sizeof(T));
  return reinterpret_cast<T*>(bytes.data());
}

WriteAt into(FileWriter& file) {
  return [&file](std::uint64_t offset, std::string_view bytes) { file.write_at(offset, bytes); };
}

class NpzFormat : public Format {
 public:
  NpzFormat(const Contacts& c, FileWriter& file)
      : Format(c),
        writer_({{"depths", 'f', 8, {c.count}},
                 {"normals", 'f', 8, {c.count, 3}},
                 {"pairs", 'u', 4, {c.count, 2}},
                 {"points_i", 'f', 8, {c.count, 3}},
                 {"points_j", 'f', 8, {c.count, 3}}},
                into(file)) {}
  void fill(Block& block) const override {
    block.columns.resize(5);
    double* const depths = numbers<double>(block, 0, 1);
    double* const normals = numbers<double>(block, 1, 3);
    Pair* const pairs = numbers<Pair>(block, 2, 1);
    double* const on_i = numbers<double>(block, 3, 3);
    double* const on_j = numbers<double>(block, 4, 3);
    each(block, [=](std::size_t k, const Pair& pair, const Normal<double>& n, const Points<double>& p) {
      depths[k] = n.depth, pairs[k] = pair;
      std::copy_n(&n.x, 3, normals + 3 * k);
      std::copy_n(p.on_i, 3, on_i + 3 * k), std::copy_n(p.on_j, 3, on_j + 3 * k);
    });
    for (Column& c : block.columns) c.checksum = crc32(c.bytes);
  }
  void place(Block& block) override {
    for (std::size_t k = 0; k < block.columns.size(); k++) {
      Column& c = block.columns[k];
      c.offset = writer_.place(k, c.bytes.size(), c.checksum);
    }
  }
  void finish() override { writer_.finish(); }

 private:
  NpzWriter writer_;
};

class VtpFormat : public Format {
 public:
  VtpFormat(const Contacts& c, FileWriter& file)
      : Format(c),
        writer_(c.count, {{"i", 'u', 4, 1}, {"j", 'u', 4, 1}, {"normal", 'f', 8, 3}, {"depth", 'f', 8, 1}},
                into(file)) {}
  void fill(Block& block) const override {
    block.columns.resize(writer_.offsets() + 1);
    std::uint32_t* const i = numbers<std::uint32_t>(block, 0, 1);
    std::uint32_t* const j = numbers<std::uint32_t>(block, 1, 1);
    double* const normals = numbers<double>(block, 2, 3);
    double* const depths = numbers<double>(block, 3, 1);
    double* const halfway = numbers<double>(block, writer_.positions(), 3);
    std::int64_t* const connectivity = numbers<std::int64_t>(block, writer_.connectivity(), 1);
    std::int64_t* const offsets = numbers<std::int64_t>(block, writer_.offsets(), 1);
    const auto first = static_cast<std::int64_t>(block.first);
    each(block, [=](std::size_t k, const Pair& pair, const Normal<double>& n, const Points<double>& p) {
      i[k] = pair.i, j[k] = pair.j, depths[k] = n.depth;
      std::copy_n(&n.x, 3, normals + 3 * k);
      for (std::size_t d = 0; d < 3; d++) halfway[3 * k + d] = 0.5 * (p.on_i[d] + p.on_j[d]);
      connectivity[k] = first + static_cast<std::int64_t>(k), offsets[k] = connectivity[k] + 1;
    });
  }
  void place(Block& block) override {
    for (std::size_t k = 0; k < block.columns.size(); k++)
      block.columns[k].offset = writer_.place(k, block.columns[k].bytes.size());
  }
  void finish() override { writer_.finish(); }

 private:
  VtpWriter writer_;
};

// Each thread takes the next block, makes its bytes and writes them. Only finding their offsets goes by
// turns, because they depend on the blocks before. A thread that waits for its turn sleeps: OpenMP's
// `ordered` would keep a processor busy. The disk's own pace is the system's business: it takes the bytes
// into its cache, and writes them while the threads prepare others.
class Pipeline {
 public:
  Pipeline(Format& format, FileWriter& file, int threads)
      : format_(format), file_(file), blocks_(static_cast<std::size_t>(threads)) {}

  // Contacts that follow those of the call before.
  void write(std::span<const KeyedContact> contacts) {
    const std::uint64_t count = (contacts.size() + kBlock - 1) / kBlock;
    turn_ = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(static_cast <int>(blocks_.size()))
    for (std::uint64_t b = 0; b < count; b++) {  // handed out in ascending order, so that every turn comes
      Block& block = blocks_[static_cast<std::size_t>(omp_get_thread_num())];
      block.first = done_ + b * kBlock;
      block.contacts = contacts.subspan(b * kBlock, std::min(kBlock, contacts.size() - b * kBlock));
      unless_failed([&] { format_.fill(block); });
      take_turn(b, [&] { unless_failed([&] { format_.place(block); }); });
      unless_failed([&] {
        for (const Column& c : block.columns) file_.write_at(c.offset, c.bytes);
      });
    }
    done_ += contacts.size();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  // After the first error nothing more is done.
  template <class Work>
  void unless_failed(const Work& work) {
    if (failed_) return;
    try {
      work();
    } catch (...) {
      if (!failed_.exchange(true)) error_ = std::current_exception();
    }
  }

  template <class Work>
  void take_turn(std::uint64_t block, const Work& work) {
    std::unique_lock lock(mutex_);
    turn_came_.wait(lock, [&] { return turn_ == block; });
    work();
    turn_++;
    turn_came_.notify_all();
  }

  Format& format_;
  FileWriter& file_;
  std::vector<Block> blocks_;  // of each thread
  std::uint64_t done_ = 0;     // contacts of the calls before
  std::mutex mutex_;
  std::condition_variable turn_came_;
  std::uint64_t turn_ = 0;  // the block that is to be placed next
  std::atomic<bool> failed_ = false;
  std::exception_ptr error_;
};

std::unique_ptr<Format> format_of(const std::filesystem::path& path, const Contacts& c, FileWriter& file) {
  const auto ending = path.extension();
  if (ending == ".csv") return std::make_unique<CsvFormat>(c, file);
  if (ending == ".npz") return std::make_unique<NpzFormat>(c, file);
  return std::make_unique<VtpFormat>(c, file);
}

}  // namespace

void check_contact_ending(const std::filesystem::path& path) {
  const auto ending = path.extension();
  if (ending != ".csv" && ending != ".npz" && ending != ".vtp")
    throw Error("cannot tell the format of " + path.string() +
                ": contacts are written as .csv, .npz or .vtp");
}

void write_contacts(const Contacts& c, const std::filesystem::path& path, int threads) {
  check_contact_ending(path);
  if (c.memory != Memory::host || c.width != Width::points || c.scalar != Scalar::f64)
    throw Error("a file of contacts is made of double records with both points in host memory");
  threads = std::clamp(threads > 0 ? threads : omp_get_max_threads(), 1, kMostWriters);
  FileWriter file(path);
  const std::unique_ptr<Format> format = format_of(path, c, file);
  Pipeline pipeline(*format, file, threads);
  SortedRuns(c.pair_span(), threads).each([&](std::span<const KeyedContact> run) { pipeline.write(run); });
  format->finish();
  file.commit();
}

}  // namespace padder::detect
