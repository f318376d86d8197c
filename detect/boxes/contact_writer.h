// SPDX-License-Identifier: MIT
// A consumer that writes contacts to a file as they come, so that no memory needs to hold them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "detect/boxes/contact_batch.h"
#include "padding/asset/file.h"

namespace padder::detect {

// The records of a streamed file: what stands before them, and the bytes of a batch.
class ContactRecords {
 public:
  static constexpr std::size_t kHead = 256;  // bytes: room for any count, and a multiple of 64

  ContactRecords(Width width, Scalar scalar) : width_(width), scalar_(scalar) {}
  std::string head(std::uint64_t count) const;  // of kHead bytes, as NumPy reads it
  std::size_t bytes_of_one() const;
  // Appends the batch to `to`. Throws Error for batches of another width or scalar.
  void append(const ContactBatch& batch, std::string& to) const;

 private:
  Width width_;
  Scalar scalar_;
};

// Throws Error for another ending than .npy.
void check_streamed_ending(const std::filesystem::path& path);

// One NumPy array of records, one for each contact, in the order of delivery. numpy.load reads it, also with
// mmap_mode. The fields are i and j (uint64), with Width::normals also normal (3) and depth, with
// Width::points also on_i (3) and on_j (3); these are float32 or float64 by `scalar`.
//
//   ContactWriter writer("contacts.npy", options.detector.width, options.detector.scalar);
//   boxed.detect(input, writer.consumer());
//   writer.finish();
//
// Until finish() the file grows under another name beside its own, and without it nothing is left. All
// functions throw Error that names the file when it cannot be written.
class ContactWriter {
 public:
  // Throws Error for another ending than .npy.
  ContactWriter(const std::filesystem::path& path, Width width, Scalar scalar);

  // Borrows this object. Throws Error for batches of another width or scalar.
  ContactConsumer consumer() {
    return [this](const ContactBatch& batch) { append(batch); };
  }
  void finish();
  std::uint64_t count() const { return count_; }

 private:
  void append(const ContactBatch& batch);

  ContactRecords records_;
  FileWriter file_;
  std::uint64_t count_ = 0;
  std::string block_;
};

}  // namespace padder::detect
