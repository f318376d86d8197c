// SPDX-License-Identifier: MIT
// Loose spheres in a file that need not fit in memory: the file is mapped, and its pages are read when a box
// asks for them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// A mapped file of spheres, in one of these forms, little-endian and in C order:
// .npy: one array (N, 4) of float32 or float64: x, y, z, r.
// .npz: stored without compression (numpy.savez), with `centers` (N, 3) and `radii` (N), and perhaps
//   `family`, `mask` and `world` (N), whole numbers of 4 or 8 bytes. Centres and radii that are neither both
//   float32 nor both float64 are converted to double and held: 32 bytes for each sphere. So are families,
//   masks and worlds of another type than uint32: 4 bytes for each number.
// Of all else the constructor reads the heads alone; check() reads everything. Both throw Error, which names
// the file, if it has another form or is damaged. The file must not be shortened while it is mapped: reading
// what is no longer there raises SIGBUS.
class SphereFile {
 public:
  explicit SphereFile(const std::filesystem::path& path);
  ~SphereFile();
  SphereFile(const SphereFile&) = delete;
  SphereFile& operator=(const SphereFile&) = delete;

  // Compares the checksums of an .npz with its arrays. Takes as long as reading the file once.
  void check() const;

  // Borrows the file. The arrays of an .npz begin at any address: for BoxedDetector, which reads them byte by
  // byte, and not for Detector.
  const Spheres& spheres() const { return spheres_; }

  // For a program's main: from here on SIGBUS in a mapped file calls `before` (null: nothing), prints one
  // sentence that begins with `program` and names the file, and ends the program with exit code 1. `before`
  // may call what a signal handler may call.
  static void end_program_if_shortened(const char* program, void (*before)());

 private:
  void read_npy();
  void read_npz();
  void unmap();

  std::string where_;
  const char* data_ = nullptr;
  std::uint64_t size_ = 0;
  bool is_npz_ = false;
  Spheres spheres_;
  std::vector<std::uint32_t> families_, masks_, worlds_;  // where the file has another type
  std::vector<double> centers_, radii_;                   // the same
};

}  // namespace padder::detect
