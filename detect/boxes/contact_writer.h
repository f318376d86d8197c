// SPDX-License-Identifier: MIT
// A consumer that writes contacts to a file as they come, so that no memory needs to hold them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "detect/boxes/contact_batch.h"
#include "padding/asset/file.h"

namespace padder::detect {

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
  std::string head() const;

  FileWriter file_;
  Width width_;
  Scalar scalar_;
  std::uint64_t count_ = 0;
  std::string block_;
};

}  // namespace padder::detect
