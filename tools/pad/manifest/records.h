// SPDX-License-Identifier: GPL-3.0-or-later
// What became of each part, kept beside the assets: a rerun and other shards read it.
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <unordered_map>
#include <vector>

#include "tools/pad/manifest/part_list.h"

namespace padder {

// One part that was made or tried.
struct Record {
  // A file that the asset was made from: the mesh, then the files that it refers to.
  struct Input {
    std::string file, sha256;
  };
  std::string output, mesh;   // as in Part
  std::string key;            // key_of(); empty when the mesh could not be read
  std::vector<Input> inputs;  // each with the content that it had
  std::string sha256;         // sha256_of_asset(); empty when there is none
  std::string error;          // the sentence; empty when it was made
  // Of the asset. Lengths in parts of the diagonal.
  std::uint64_t triangles = 0, spheres = 0;
  double protrusion = 0, gap = 0;
  bool certified = false, within = true;
  std::vector<std::string> warnings;
  double seconds = 0, cpu_seconds = 0;  // of the worker
  std::uint64_t memory = 0;             // bytes, its peak

  bool done() const { return error.empty(); }
};

nlohmann::ordered_json to_json(const Record& record);
Record record_of(const nlohmann::ordered_json& json);  // throws nlohmann's exceptions

// What an asset is made of, besides the content of further inputs: content and name of the mesh, settings,
// version.
std::string key_of(const Part& part, const std::string& sha256_of_mesh);

// Of the part's files in `folder`: its output, or this and the SRDF that came with it. Throws Error.
std::string sha256_of_asset(const Part& part, const std::filesystem::path& folder);

// Is the asset that `record` tells of still there, and made of what `part` would be made of now? Reads the
// inputs and the asset.
bool is_current(const Record& record, const Part& part, const std::filesystem::path& folder);

// The records of a folder of assets: one file of JSON lines for each shard, below FOLDER/.pad. The shard's
// own grows by one line, written at once, for each part. A line that was cut short by a crash is passed over,
// and so is everything in the file that is no record.
class Records {
 public:
  // Locks the shard's file: two runs of one shard would do the same work. Throws Error when another process
  // has it, and where the folder cannot be read or written.
  Records(const std::filesystem::path& folder, const Shard& shard);
  ~Records();
  Records(const Records&) = delete;
  Records& operator=(const Records&) = delete;

  // The records of an output, of every shard and run.
  const std::vector<Record>& of(const std::string& output) const;

  void add(const Record& record);  // throws Error
  void close_in_child();           // a forked process must not keep the lock

 private:
  void read(const std::filesystem::path& file);

  std::filesystem::path path_;
  int file_ = -1;
  std::unordered_map<std::string, std::vector<Record>> known_;
};

}  // namespace padder
