// SPDX-License-Identifier: MIT
#include "detect/mpi/rank_contact_file.h"

#include <filesystem>
#include <system_error>

#include "detect/mpi/together.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::size_t kBlock = 4 << 20;  // bytes written at once: each block takes a message to rank 0

}  // namespace

RankContactFile::RankContactFile(MPI_Comm ranks, const std::filesystem::path& path, Width width,
                                 Scalar scalar)
    : path_(path), target_(behind_links(path)), beside_(target_), records_(width, scalar) {
  check_streamed_ending(path);
  MPI_Comm_dup(ranks, &ranks_);
  MPI_Comm_rank(ranks_, &rank_);
  beside_ += ".part";
  if (rank_ == 0) unfinished_.emplace(beside_);
  const int opened =
      MPI_File_open(ranks_, beside_.c_str(), MPI_MODE_CREATE | MPI_MODE_WRONLY, MPI_INFO_NULL, &file_);
  const int emptied =  // of what an earlier run left that was killed
      opened == MPI_SUCCESS ? MPI_File_set_size(file_, 0) : opened;
  try {
    together(ranks_, [&] {
      if (opened != MPI_SUCCESS) file_ = MPI_FILE_NULL;
      mpi_check(emptied, ("write " + path_.string()).c_str());
      if (rank_ == 0) {
        const std::string head = records_.head(0);
        mpi_check(MPI_File_write_at(file_, 0, head.data(), static_cast<int>(head.size()), MPI_BYTE,
                                    MPI_STATUS_IGNORE),
                  ("write " + path_.string()).c_str());
      }
    });
  } catch (...) {
    if (file_ != MPI_FILE_NULL) MPI_File_close(&file_);
    MPI_Comm_free(&ranks_);
    throw;
  }
  MPI_Win_allocate(rank_ == 0 ? sizeof *placed_ : 0, sizeof *placed_, MPI_INFO_NULL, ranks_, &placed_,
                   &window_);
  if (rank_ == 0) *placed_ = 0;
  MPI_Barrier(ranks_);
  MPI_Win_lock_all(MPI_MODE_NOCHECK, window_);
}

RankContactFile::~RankContactFile() {
  if (window_ != MPI_WIN_NULL) MPI_Win_unlock_all(window_), MPI_Win_free(&window_);
  if (file_ != MPI_FILE_NULL) {
    MPI_File_close(&file_);
    std::error_code ignored;
    if (rank_ == 0) std::filesystem::remove(beside_, ignored);
  }
  MPI_Comm_free(&ranks_);
}

void RankContactFile::append(const ContactBatch& batch) {
  records_.append(batch, block_);
  if (block_.size() >= kBlock) flush();
}

// A block takes the next free place; so nobody has to know how many contacts the others find.
void RankContactFile::flush() {
  if (block_.empty()) return;
  const std::size_t one = records_.bytes_of_one();
  const unsigned long long count = block_.size() / one;
  unsigned long long place = 0;
  MPI_Fetch_and_op(&count, &place, MPI_UNSIGNED_LONG_LONG, 0, 0, MPI_SUM, window_);
  MPI_Win_flush(0, window_);
  MPI_Status status;
  int written = 0;
  mpi_check(MPI_File_write_at(file_, static_cast<MPI_Offset>(ContactRecords::kHead + place * one),
                              block_.data(), static_cast<int>(block_.size()), MPI_BYTE, &status),
            ("write " + path_.string()).c_str());
  MPI_Get_count(&status, MPI_BYTE, &written);
  if (static_cast<std::size_t>(written) != block_.size())
    throw Error("cannot write " + path_.string() + ": check that the folder has room");
  block_.clear();
}

void RankContactFile::finish() {
  together(ranks_, [&] { flush(); });
  MPI_Barrier(ranks_);  // every place is taken
  together(ranks_, [&] {
    if (rank_ != 0) return;
    MPI_Win_sync(window_);
    const std::string head = records_.head(*placed_);
    mpi_check(
        MPI_File_write_at(file_, 0, head.data(), static_cast<int>(head.size()), MPI_BYTE, MPI_STATUS_IGNORE),
        ("write " + path_.string()).c_str());
  });
  const int closed = MPI_File_close(&file_);
  together(ranks_, [&] { mpi_check(closed, ("write " + path_.string()).c_str()); });
  together(ranks_, [&] {
    std::error_code error;
    if (rank_ == 0) std::filesystem::rename(beside_, target_, error);
    if (error) throw Error("cannot write " + path_.string() + " (" + error.message() + ")");
  });
}

}  // namespace padder::detect
