// SPDX-License-Identifier: MIT
#include "detect/scene/contact_file.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "detect/core/errors.h"
#include "detect/core/input.h"
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
  std::span<const std::uint64_t> keys;
  std::vector<Column> columns;
};

// The spheres of a scene by their numbers.
class NumberedSpheres {
 public:
  explicit NumberedSpheres(const Input& input) : input_(input) {
    check_arrays(input);
    if ((input.spheres.count && input.spheres.memory == Memory::device) ||
        (input.poses && input.pose_memory == Memory::device))
      throw Error("a file of contacts is made from spheres and poses in host memory: copy them there");
    first_of_body_.reserve(input.bodies.size() + 1);
    for (const Body& b : input.bodies)
      first_of_body_.push_back(loose_), loose_ += input.shapes[b.shape].count;
    first_of_body_.push_back(loose_);
  }
  std::uint64_t size() const { return loose_ + input_.spheres.count; }

  // `near`: the body of the sphere that was asked for before.
  Sphere at(std::uint32_t k, std::size_t& near) const {
    if (k >= loose_) return loose_at(input_.spheres, k - loose_);
    if (k < first_of_body_[near] || k >= first_of_body_[near + 1])
      near =
          static_cast<std::size_t>(std::ranges::upper_bound(first_of_body_, k) - first_of_body_.begin()) - 1;
    const Body body = body_at(input_, near);
    return placed(body, input_.shapes[body.shape].spheres[k - first_of_body_[near]]);
  }
  // Where the centre of loose sphere k lies; null for a sphere of a body.
  const void* place_of(std::uint32_t k) const {
    const Spheres& s = input_.spheres;
    const std::uint64_t bytes = s.center_stride * (s.scalar == Scalar::f32 ? 4u : 8u);
    return k < loose_ ? nullptr : static_cast<const char*>(s.centers) + (k - loose_) * bytes;
  }

 private:
  const Input& input_;
  std::uint64_t loose_ = 0;  // number of the first loose sphere
  std::vector<std::uint64_t> first_of_body_;
};

// A file format. Several threads call fill() at once; place() is called for one block after the other.
class Format {
 public:
  explicit Format(const NumberedSpheres& spheres) : spheres_(spheres) {}
  virtual ~Format() = default;
  virtual void fill(Block& block) const = 0;  // makes the bytes of the columns
  virtual void place(Block& block) = 0;       // finds their offsets
  virtual void finish() {}

 protected:
  // Calls use(k, pair, geometry) for each contact of the block. Its second spheres lie anywhere in memory:
  // they are asked for early, or the processor would wait at each of them. (In a function of its own the
  // compiler takes such a request for work without effect, and leaves it out.)
  template <class Use>
  void each(const Block& block, const Use& use) const {
    constexpr std::size_t ahead = 24;
    std::size_t near_i = 0, near_j = 0;
    for (std::size_t k = 0; k < block.keys.size(); k++) {
      if (k + ahead < block.keys.size())
        __builtin_prefetch(spheres_.place_of(static_cast<std::uint32_t>(block.keys[k + ahead])));
      const Pair pair{static_cast<std::uint32_t>(block.keys[k] >> 32),
                      static_cast<std::uint32_t>(block.keys[k])};
      if (std::max(pair.i, pair.j) >= spheres_.size())
        throw Error("a contact of spheres " + std::to_string(pair.i) + " and " + std::to_string(pair.j) +
                    " cannot be written: the scene has " + std::to_string(spheres_.size()) + " spheres");
      use(k, pair, geometry(spheres_.at(pair.i, near_i), spheres_.at(pair.j, near_j)));
    }
  }

 private:
  const NumberedSpheres& spheres_;
};

class CsvFormat : public Format {
 public:
  CsvFormat(const NumberedSpheres& spheres, FileWriter& file) : Format(spheres), end_(kTitle.size()) {
    file.write_at(0, kTitle);
  }
  void fill(Block& block) const override {
    constexpr std::size_t longest = 2 * 11 + 10 * 25;  // of a line: i and j, ten doubles, what stands between
    block.columns.resize(1);
    std::string& text = block.columns[0].bytes;
    text.resize(block.keys.size() * longest);
    char* at = text.data();
    char* const end = at + text.size();
    const auto add = [&](auto value, char after) {
      at = std::to_chars(at, end, value).ptr;
      *at++ = after;
    };
    each(block, [&](std::size_t, const Pair& pair, const Geometry& g) {
      add(pair.i, ','), add(pair.j, ',');
      for (const double v : g.normal) add(v, ',');
      add(g.depth, ',');
      for (const double v : g.on_i) add(v, ',');
      add(g.on_j[0], ','), add(g.on_j[1], ','), add(g.on_j[2], '\n');
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
  bytes.resize(block.keys.size() * for_each * sizeof(T));
  return reinterpret_cast<T*>(bytes.data());
}

WriteAt into(FileWriter& file) {
  return [&file](std::uint64_t offset, std::string_view bytes) { file.write_at(offset, bytes); };
}

class NpzFormat : public Format {
 public:
  NpzFormat(const NumberedSpheres& spheres, std::uint64_t count, FileWriter& file)
      : Format(spheres),
        writer_({{"depths", 'f', 8, {count}},
                 {"normals", 'f', 8, {count, 3}},
                 {"pairs", 'u', 4, {count, 2}},
                 {"points_i", 'f', 8, {count, 3}},
                 {"points_j", 'f', 8, {count, 3}}},
                into(file)) {
    file.reserve(writer_.size());
  }
  void fill(Block& block) const override {
    block.columns.resize(5);
    double* const depths = numbers<double>(block, 0, 1);
    double* const normals = numbers<double>(block, 1, 3);
    Pair* const pairs = numbers<Pair>(block, 2, 1);
    double* const on_i = numbers<double>(block, 3, 3);
    double* const on_j = numbers<double>(block, 4, 3);
    each(block, [=](std::size_t k, const Pair& pair, const Geometry& g) {
      depths[k] = g.depth, pairs[k] = pair;
      std::copy_n(g.normal, 3, normals + 3 * k);
      std::copy_n(g.on_i, 3, on_i + 3 * k), std::copy_n(g.on_j, 3, on_j + 3 * k);
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
  VtpFormat(const NumberedSpheres& spheres, std::uint64_t count, FileWriter& file)
      : Format(spheres),
        writer_(count, {{"i", 'u', 4, 1}, {"j", 'u', 4, 1}, {"normal", 'f', 8, 3}, {"depth", 'f', 8, 1}},
                into(file)) {
    file.reserve(writer_.size());
  }
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
    each(block, [=](std::size_t k, const Pair& pair, const Geometry& g) {
      i[k] = pair.i, j[k] = pair.j, depths[k] = g.depth;
      std::copy_n(g.normal, 3, normals + 3 * k);
      for (std::size_t d = 0; d < 3; d++) halfway[3 * k + d] = 0.5 * (g.on_i[d] + g.on_j[d]);
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

// Lets the disk write from the first block on. By itself the system begins when a tenth of the memory waits
// to be written, and the disk idles until then. It asks for little at a time, so that a slow disk does not
// keep the program from its end.
class EarlyWriteOut {
 public:
  explicit EarlyWriteOut(const FileWriter& file)
      : thread_([&file](const std::stop_token& end) {
          constexpr std::uint64_t piece = 16 << 20;
          std::mutex mutex;
          std::condition_variable_any pause;
          std::unique_lock lock(mutex);
          while (!end.stop_requested()) {
            for (std::uint64_t at = 0, size = file.size(); at < size && !end.stop_requested(); at += piece)
              file.write_out(at, piece);
            pause.wait_for(lock, end, std::chrono::milliseconds(20), [] { return false; });
          }
        }) {}

 private:
  std::jthread thread_;  // its destructor ends it
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
  void write(std::span<const std::uint64_t> keys) {
    const std::uint64_t count = (keys.size() + kBlock - 1) / kBlock;
    turn_ = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(static_cast <int>(blocks_.size()))
    for (std::uint64_t b = 0; b < count; b++) {  // handed out in ascending order, so that every turn comes
      Block& block = blocks_[static_cast<std::size_t>(omp_get_thread_num())];
      block.first = done_ + b * kBlock;
      block.keys = keys.subspan(b * kBlock, std::min(kBlock, keys.size() - b * kBlock));
      unless_failed([&] { format_.fill(block); });
      take_turn(b, [&] { unless_failed([&] { format_.place(block); }); });
      unless_failed([&] {
        for (const Column& c : block.columns) file_.write_at(c.offset, c.bytes);
      });
    }
    done_ += keys.size();
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

std::unique_ptr<Format> format_of(const std::filesystem::path& path, const NumberedSpheres& spheres,
                                  std::uint64_t contacts, FileWriter& file) {
  const auto ending = path.extension();
  if (ending == ".csv") return std::make_unique<CsvFormat>(spheres, file);
  if (ending == ".npz") return std::make_unique<NpzFormat>(spheres, contacts, file);
  return std::make_unique<VtpFormat>(spheres, contacts, file);
}

}  // namespace

void check_contact_ending(const std::filesystem::path& path) {
  const auto ending = path.extension();
  if (ending != ".csv" && ending != ".npz" && ending != ".vtp")
    throw Error("cannot tell the format of " + path.string() +
                ": contacts are written as .csv, .npz or .vtp");
}

void write_contacts(const Contacts& contacts, const Input& input, const std::filesystem::path& path,
                    int threads) {
  check_contact_ending(path);
  if (contacts.memory != Memory::host)
    throw Error("a file of contacts is made from pairs in host memory: set CallOptions::output to it");
  const NumberedSpheres spheres(input);
  threads = std::clamp(threads > 0 ? threads : omp_get_max_threads(), 1, kMostWriters);
  FileWriter file(path);
  const std::unique_ptr<Format> format = format_of(path, spheres, contacts.count, file);
  Pipeline pipeline(*format, file, threads);
  {
    const EarlyWriteOut write_out(file);
    SortedRuns(contacts.pair_span(), threads).each([&](std::span<const std::uint64_t> run) {
      pipeline.write(run);
    });
    format->finish();
  }
  file.commit();
}

}  // namespace padder::detect
