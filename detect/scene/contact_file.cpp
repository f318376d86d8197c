// SPDX-License-Identifier: MIT
#include "detect/scene/contact_file.h"

#include <omp.h>

#include <algorithm>
#include <charconv>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <string>

#include "detect/scene/sorted_runs.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/asset/npz.h"
#include "padding/asset/vtp.h"

namespace padder::detect {
namespace {

constexpr std::uint64_t kBlock = 1 << 12;  // contacts that a thread turns into bytes before they are written
constexpr int kMostWriters = 16;           // each holds a block: a megabyte of text at most

// What a block becomes: the next bytes of each array of the file, or of the file itself.
using Columns = std::vector<std::string>;

Pair pair_of(const KeyedContact& c) {
  return {static_cast<std::uint32_t>(c.key >> 32), static_cast<std::uint32_t>(c.key)};
}

// A kind of file. columns() is asked by several threads at once, write() for one block after the other.
class Kind {
 public:
  explicit Kind(const Contacts& c) : normals_(c.normal_span<double>()), points_(c.point_span<double>()) {}
  virtual ~Kind() = default;
  virtual void columns(std::span<const KeyedContact> block, Columns& out) const = 0;
  virtual void write(const Columns& columns) = 0;
  virtual void finish() {}

 protected:
  std::span<const Normal<double>> normals_;
  std::span<const Points<double>> points_;
};

class CsvOut : public Kind {
 public:
  CsvOut(const Contacts& c, FileWriter& file) : Kind(c), file_(file) {
    file.append("i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n");
  }
  void columns(std::span<const KeyedContact> block, Columns& out) const override {
    constexpr std::size_t longest = 2 * 11 + 10 * 25;  // of a line: i and j, ten doubles, what stands between
    out.resize(1);
    out[0].resize(block.size() * longest);
    char* at = out[0].data();
    char* const end = at + out[0].size();
    const auto add = [&](auto value, char after) {
      at = std::to_chars(at, end, value).ptr;
      *at++ = after;
    };
    for (const KeyedContact& c : block) {
      const Normal<double>& n = normals_[c.at];
      const Points<double>& p = points_[c.at];
      add(pair_of(c).i, ','), add(pair_of(c).j, ',');
      for (const double v : {n.x, n.y, n.z, n.depth}) add(v, ',');
      for (const double v : p.on_i) add(v, ',');
      add(p.on_j[0], ','), add(p.on_j[1], ','), add(p.on_j[2], '\n');
    }
    out[0].resize(static_cast<std::size_t>(at - out[0].data()));
  }
  void write(const Columns& columns) override { file_.append(columns[0]); }

 private:
  FileWriter& file_;
};

// Values behind one another, as they lie in memory.
class Bytes {
 public:
  Bytes(std::string& out, std::size_t size) : at_((out.resize(size), out.data())) {}
  template <class T>
  void add(const T* values, std::size_t count) {
    at_ = std::copy_n(reinterpret_cast<const char*>(values), count * sizeof(T), at_);
  }

 private:
  char* at_;
};

// A file of arrays, by NpzWriter or VtpWriter: a column for each.
template <class Writer>
class OfArrays : public Kind {
 public:
  OfArrays(const Contacts& c, Writer writer) : Kind(c), writer_(std::move(writer)) {}
  void write(const Columns& columns) override {
    for (std::size_t k = 0; k < columns.size(); k++) writer_.append(k, columns[k]);
  }
  void finish() override { writer_.finish(); }

 private:
  Writer writer_;
};

WriteAt into(FileWriter& file) {
  return [&file](std::uint64_t offset, std::string_view bytes) { file.write_at(offset, bytes); };
}

class NpzOut : public OfArrays<NpzWriter> {
 public:
  NpzOut(const Contacts& c, FileWriter& file)
      : OfArrays(c, NpzWriter({{"depths", 'f', 8, {c.count}},
                               {"normals", 'f', 8, {c.count, 3}},
                               {"pairs", 'u', 4, {c.count, 2}},
                               {"points_i", 'f', 8, {c.count, 3}},
                               {"points_j", 'f', 8, {c.count, 3}}},
                              into(file))) {}
  void columns(std::span<const KeyedContact> block, Columns& out) const override {
    out.resize(5);
    const std::size_t n = block.size();
    Bytes depths(out[0], 8 * n), normals(out[1], 24 * n), pairs(out[2], 8 * n), on_i(out[3], 24 * n),
        on_j(out[4], 24 * n);
    for (const KeyedContact& c : block) {
      const Pair pair = pair_of(c);
      depths.add(&normals_[c.at].depth, 1), normals.add(&normals_[c.at].x, 3), pairs.add(&pair, 1);
      on_i.add(points_[c.at].on_i, 3), on_j.add(points_[c.at].on_j, 3);
    }
  }
};

class VtpOut : public OfArrays<VtpWriter> {
 public:
  VtpOut(const Contacts& c, FileWriter& file)
      : OfArrays(c,
                 VtpWriter(c.count,
                           {{"i", 'u', 4, 1}, {"j", 'u', 4, 1}, {"normal", 'f', 8, 3}, {"depth", 'f', 8, 1}},
                           into(file))) {}
  void columns(std::span<const KeyedContact> block, Columns& out) const override {
    out.resize(5);
    const std::size_t n = block.size();
    Bytes i(out[0], 4 * n), j(out[1], 4 * n), normals(out[2], 24 * n), depths(out[3], 8 * n),
        halfway(out[4], 24 * n);
    for (const KeyedContact& c : block) {
      const Pair pair = pair_of(c);
      const Points<double>& p = points_[c.at];
      i.add(&pair.i, 1), j.add(&pair.j, 1), normals.add(&normals_[c.at].x, 3);
      depths.add(&normals_[c.at].depth, 1);
      double middle[3];
      for (int k = 0; k < 3; k++) middle[k] = 0.5 * (p.on_i[k] + p.on_j[k]);
      halfway.add(middle, 3);
    }
  }
};

// Blocks become bytes side by side, and are written one after the other. Who waits for its turn sleeps:
// OpenMP's `ordered` would burn a processor while the disk is busy.
void write_run(std::span<const KeyedContact> run, Kind& kind, int threads) {
  std::mutex mutex;
  std::condition_variable turn_came;
  std::uint64_t turn = 0;  // the block that is to be written next
  std::exception_ptr error;
  const std::uint64_t blocks = (run.size() + kBlock - 1) / kBlock;
#pragma omp parallel num_threads(threads)
  {
    Columns columns;
#pragma omp for schedule(dynamic, 1)  // hands out blocks in ascending order, so that every turn comes
    for (std::uint64_t b = 0; b < blocks; b++) {
      std::exception_ptr mine;
      try {
        kind.columns(run.subspan(b * kBlock, std::min(kBlock, run.size() - b * kBlock)), columns);
      } catch (...) {
        mine = std::current_exception();
      }
      std::unique_lock lock(mutex);
      turn_came.wait(lock, [&] { return turn == b; });
      if (!error) error = mine;
      lock.unlock();  // the others prepare their blocks meanwhile; the file is ours until the turn passes on
      try {
        if (!error) kind.write(columns);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      turn++;
      turn_came.notify_all();
    }
  }
  if (error) std::rethrow_exception(error);
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
  const auto ending = path.extension();
  FileWriter file(path);
  std::unique_ptr<Kind> kind;
  if (ending == ".csv") kind = std::make_unique<CsvOut>(c, file);
  if (ending == ".npz") kind = std::make_unique<NpzOut>(c, file);
  if (ending == ".vtp") kind = std::make_unique<VtpOut>(c, file);
  SortedRuns(c.pair_span(), threads).each([&](std::span<const KeyedContact> run) {
    write_run(run, *kind, threads);
  });
  kind->finish();
  file.commit();
}

}  // namespace padder::detect
