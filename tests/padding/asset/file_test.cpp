// SPDX-License-Identifier: MIT
#include "padding/asset/file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "tests/error_of.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

class File : public ::testing::Test, protected TemporaryFolder {
 protected:
  ~File() override { fs::permissions(folder_, fs::perms::owner_all); }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), {}));
  }
};

template <class Work>
void expect_error(const Work& work, const std::string& words) {
  EXPECT_TRUE(refuses(work, words));
}

TEST_F(File, EveryByteComesBack) {
  std::string bytes;
  for (int k = 0; k < 100000; k++) bytes += static_cast<char>(k * 7 + k / 256);
  write_file(folder_ / "a", bytes);
  EXPECT_EQ(read_file(folder_ / "a"), bytes);
  write_file(folder_ / "a", "");  // over it
  EXPECT_EQ(read_file(folder_ / "a"), "");
  EXPECT_EQ(entries(), 1u);  // nothing beside it
}

TEST_F(File, ReadingWhatIsNotThere) {
  expect_error([&] { read_file(folder_ / "absent"); }, (folder_ / "absent").string());
  expect_error([&] { read_file(folder_); }, "is a folder");
  expect_error([&] { read_file(""); }, "the name of the file to read is empty");
}

TEST_F(File, OnlyRegularFilesOfSomeSizeAreRead) {
  for (const char* device : {"/dev/zero", "/dev/null", "/dev/tty"})
    if (fs::exists(device)) expect_error([&] { read_file(device); }, "name");  // no terminal: cannot open
  expect_error([&] { read_file("/dev/zero"); }, "is a device, a pipe or a socket: name a regular file");
  for (const char* system : {"/proc/self/mem", "/proc/self/status"})
    if (fs::exists(system)) expect_error([&] { read_file(system); }, "without a size");
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  expect_error([&] { read_file(folder_ / "pipe"); }, "is a device, a pipe or a socket");  // at once
  std::ofstream(folder_ / "large").put('x');
  fs::resize_file(folder_ / "large", std::uintmax_t(1) << 40);  // a hole
  expect_error([&] { read_file(folder_ / "large"); }, "1099511627776 bytes, and at most 8589934592 are read");
  write_file(folder_ / "four", "1234");
  expect_error([&] { read_file(folder_ / "four", 3); }, "has 4 bytes, and at most 3 are read");
  EXPECT_EQ(read_file(folder_ / "four", 4), "1234");
  expect_error([&] { read_file("a\nb\x1b"); }, "a\\nb\\x1b");
}

TEST_F(File, AFailedWriteLeavesNothingAndHarmsNothing) {
  expect_error([&] { write_file(folder_ / "no" / "a", "x"); }, (folder_ / "no" / "a").string());
  EXPECT_EQ(entries(), 0u);
  fs::create_directory(folder_ / "taken");
  write_file(folder_ / "taken" / "inside", "old");
  expect_error([&] { write_file(folder_ / "taken", "x"); }, "taken");  // a folder of that name
  EXPECT_EQ(read_file(folder_ / "taken" / "inside"), "old");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(File, GrowsInPiecesAndAnywhere) {
  FileWriter out(folder_ / "a");
  out.append("one "), out.append("two ");
  out.write_at(12, "four"), out.write_at(8, "for ");
  EXPECT_FALSE(fs::exists(folder_ / "a"));
  out.commit();
  EXPECT_EQ(read_file(folder_ / "a"), "one two for four");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(File, RoomIsTakenBeforehandOrRefused) {
  const std::string bytes(100000, 'x');
  FileWriter out(folder_ / "a");
  out.reserve(bytes.size() - 4);
  out.write_at(50000, bytes.substr(50000)), out.write_out(0, bytes.size());
  EXPECT_EQ(out.size(), bytes.size());
  out.write_at(0, bytes.substr(0, 50000));
  out.commit();
  EXPECT_EQ(read_file(folder_ / "a"), bytes);
  expect_error([&] { FileWriter(folder_ / "b").reserve(std::uint64_t(1) << 62); },
               (folder_ / "b").string() + " (File too large): check");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(File, DevicesAreNotReplacedAndModesStay) {
  write_file(folder_ / "a", "old");
  fs::permissions(folder_ / "a", fs::perms::owner_read | fs::perms::owner_write);
  write_file(folder_ / "a", "new");
  EXPECT_EQ(fs::status(folder_ / "a").permissions(), fs::perms::owner_read | fs::perms::owner_write);
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", folder_ / "to_pipe");
  for (const char* name : {"pipe", "to_pipe"})
    expect_error([&] { write_file(folder_ / name, "x"); }, "is a device, a pipe or a socket");
  EXPECT_TRUE(fs::is_fifo(folder_ / "to_pipe"));
  expect_error([] { FileWriter("/dev/null"); }, "/dev/null: it is a device");
  EXPECT_EQ(entries(), 3u);
}

TEST_F(File, LinksAreWrittenThrough) {
  fs::create_directory(folder_ / "far");
  write_file(folder_ / "far" / "a", "old");
  fs::permissions(folder_ / "far" / "a", fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("far/a", folder_ / "link"), fs::create_symlink("link", folder_ / "second");
  fs::create_symlink(folder_ / "far" / "fresh", folder_ / "to_nothing");
  fs::create_symlink("round", folder_ / "round"), fs::create_symlink("no/a", folder_ / "no_folder");
  {
    FileWriter out(folder_ / "second");
    out.append("new");
    EXPECT_EQ(read_file(folder_ / "link"), "old");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "far"), {}), 2);  // the one in the making
    out.commit();
  }
  EXPECT_EQ(read_file(folder_ / "far" / "a"), "new");
  EXPECT_EQ(fs::status(folder_ / "far" / "a").permissions(), fs::perms::owner_read | fs::perms::owner_write);
  write_file(folder_ / "to_nothing", "fresh");
  EXPECT_EQ(read_file(folder_ / "far" / "fresh"), "fresh");
  expect_error([&] { write_file(folder_ / "round", "x"); }, "round (Too many levels of symbolic links)");
  expect_error([&] { write_file(folder_ / "no_folder", "x"); }, "no_folder (No such file or directory)");
  for (const char* link : {"link", "second", "to_nothing", "round", "no_folder"})
    EXPECT_TRUE(fs::is_symlink(folder_ / link));
  EXPECT_EQ(entries(), 6u);
}

// Processes that do nothing but begin files are ended at some moment, and their handlers leave nothing.
TEST_F(File, IsKnownToTheHandlerBeforeItIsThere) {
  for (int k = 0; k < 200; k++) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::signal(SIGALRM, [](int) {
        remove_unfinished_files();
        ::_exit(0);
      });
      const itimerval soon{{0, 0}, {0, 1000 + 7 * k}};
      ::setitimer(ITIMER_REAL, &soon, nullptr);
      for (;;) FileWriter(folder_ / "a");
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_EQ(status, 0);
  }
  EXPECT_EQ(entries(), 0u);
}

TEST_F(File, ALinkOfThePartsNameIsNotFollowed) {
  write_file(folder_ / "precious", "old");
  fs::create_symlink("precious", folder_ / ("a.part" + std::to_string(::getpid())));
  write_file(folder_ / "a", "new");
  EXPECT_EQ(read_file(folder_ / "precious"), "old");
  EXPECT_EQ(read_file(folder_ / "a"), "new");
  EXPECT_FALSE(fs::is_symlink(folder_ / "a"));
  EXPECT_EQ(entries(), 2u);
}

TEST_F(File, WithoutCommitNothingIsLeft) {
  write_file(folder_ / "a", "old");
  { FileWriter(folder_ / "a").append("new"); }
  EXPECT_EQ(read_file(folder_ / "a"), "old");
  EXPECT_EQ(entries(), 1u);
}

// The writer takes the lowest number that is free, under which /dev/full is put then.
void write_to_full_disk(const fs::path& path) {
  const int full = ::open("/dev/full", O_WRONLY), next = ::dup(full);
  ::close(next);
  FileWriter out(path);
  ::dup2(full, next), ::close(full);
  out.append(std::string(100000, 'x'));
}

TEST_F(File, AFullDiskIsNoticedAndToBlame) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full on this system";
  expect_error([&] { write_to_full_disk(folder_ / "a"); },
               "a (No space left on device): check that the folder exists, may be written and has room");
  EXPECT_EQ(entries(), 0u);
  EXPECT_THROW(write_to_full_disk(folder_ / "a"), DiskError);
  try {
    write_file(folder_ / "absent" / "a", "x");
    ADD_FAILURE();
  } catch (const DiskError&) {
    ADD_FAILURE() << "a folder that is absent is no fault of the disk";
  } catch (const Error&) {
  }
}

TEST_F(File, WhatIsUnfinishedCanBeRemovedAtOnce) {
  write_file(folder_ / "a", "old"), write_file(folder_ / "c", "done");
  std::vector<std::unique_ptr<FileWriter>> writers;
  for (int k = 0; k < 70; k++) {  // more than it has places for
    writers.push_back(std::make_unique<FileWriter>(folder_ / ("b" + std::to_string(k))));
    if (k < 60) writers.pop_back();  // places are given back
  }
  FileWriter out(folder_ / "a"), other(folder_ / std::string(200, 'n'));
  out.append("new"), other.append("x");
  EXPECT_EQ(entries(), 2u + 10u + 2u);
  remove_unfinished_files();
  EXPECT_EQ(entries(), 2u);
  EXPECT_EQ(read_file(folder_ / "a"), "old");
}

TEST_F(File, AReaderSeesTheOldFileOrTheNewOne) {
  const std::string old_bytes(1 << 20, 'o'), new_bytes(1 << 20, 'n');
  write_file(folder_ / "a", old_bytes);
  std::thread writer([&] {
    for (int k = 0; k < 20; k++) write_file(folder_ / "a", k % 2 ? old_bytes : new_bytes);
  });
  for (int k = 0; k < 20; k++) {
    const std::string seen = read_file(folder_ / "a");
    EXPECT_TRUE(seen == old_bytes || seen == new_bytes);
  }
  writer.join();
}

}  // namespace
}  // namespace padder
