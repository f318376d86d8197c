// SPDX-License-Identifier: MIT
// All ranks write their contacts into one file, by MPI-IO.
#pragma once
#include <mpi.h>

#include <filesystem>
#include <optional>
#include <string>

#include "detect/boxes/contact_batch.h"
#include "detect/boxes/contact_writer.h"
#include "padding/asset/file.h"

namespace padder::detect {

// One file as a ContactWriter makes it, with the records of all ranks: in the order in which they were found,
// which differs from run to run. The folder must be the same on all machines. Constructor and finish()
// are collective. Until finish() the file grows under another name beside its own; without it nothing is
// left, and remove_unfinished_files() removes it, too (padding/asset/file.h).
class RankContactFile {
 public:
  // Throws the same Error on all ranks if the file cannot be made.
  RankContactFile(MPI_Comm ranks, const std::filesystem::path& path, Width width, Scalar scalar);
  ~RankContactFile();
  RankContactFile(const RankContactFile&) = delete;
  RankContactFile& operator=(const RankContactFile&) = delete;

  // Of this rank. Borrows this object. Throws Error for batches of another width or scalar, and when the
  // file cannot be written.
  ContactConsumer consumer() {
    return [this](const ContactBatch& batch) { append(batch); };
  }
  void finish();

 private:
  void append(const ContactBatch& batch);
  void flush();

  MPI_Comm ranks_ = MPI_COMM_NULL;
  int rank_ = 0;
  std::filesystem::path path_, target_, beside_;  // as in FileWriter
  ContactRecords records_;
  std::optional<UnfinishedFile> unfinished_;  // on rank 0
  MPI_File file_ = MPI_FILE_NULL;
  MPI_Win window_ = MPI_WIN_NULL;         // on rank 0: the number of records that have a place
  unsigned long long* placed_ = nullptr;  // that number, where the window is
  std::string block_;
};

}  // namespace padder::detect
