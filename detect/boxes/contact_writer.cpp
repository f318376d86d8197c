// SPDX-License-Identifier: MIT
#include "detect/boxes/contact_writer.h"

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

const std::filesystem::path& checked(const std::filesystem::path& path) {
  check_streamed_ending(path);
  return path;
}

void add(std::string& to, const void* array, std::size_t k, std::size_t bytes) {
  if (array) to.append(static_cast<const char*>(array) + k * bytes, bytes);
}

}  // namespace

void check_streamed_ending(const std::filesystem::path& path) {
  if (path.extension() != ".npy")
    throw Error(path.string() + ": contacts are streamed to .npy, one record for each contact");
}

std::string ContactRecords::head(std::uint64_t count) const {
  const std::string real = scalar_ == Scalar::f32 ? "'<f4'" : "'<f8'";
  std::string text = "{'descr': [('i', '<u8'), ('j', '<u8')";
  if (width_ != Width::pairs) text += ", ('normal', " + real + ", (3,)), ('depth', " + real + ")";
  if (width_ == Width::points) text += ", ('on_i', " + real + ", (3,)), ('on_j', " + real + ", (3,))";
  text += "], 'fortran_order': False, 'shape': (" + std::to_string(count) + ",), }";
  text.resize(kHead - 10 - 1, ' ');
  text += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(text.size() & 255), out += static_cast<char>(text.size() >> 8);
  return out + text;
}

std::size_t ContactRecords::bytes_of_one() const {
  const std::size_t real = scalar_ == Scalar::f32 ? 4 : 8;
  return sizeof(WidePair) + real * (width_ == Width::pairs ? 0 : width_ == Width::normals ? 4 : 10);
}

void ContactRecords::append(const ContactBatch& batch, std::string& to) const {
  if (batch.width != width_ || batch.scalar != scalar_)
    throw Error("a ContactWriter was given records of another width or scalar than it was made for");
  const std::size_t real = scalar_ == Scalar::f32 ? 4 : 8;
  for (std::size_t k = 0; k < batch.pairs.size(); k++) {
    add(to, batch.pairs.data(), k, sizeof(WidePair));
    if (width_ != Width::pairs) add(to, batch.normals, k, 4 * real);
    if (width_ == Width::points) add(to, batch.points, k, 6 * real);
  }
}

ContactWriter::ContactWriter(const std::filesystem::path& path, Width width, Scalar scalar)
    : records_(width, scalar), file_(checked(path)) {
  file_.append(records_.head(0));
}

void ContactWriter::append(const ContactBatch& batch) {
  block_.clear();
  records_.append(batch, block_);
  file_.append(block_);
  count_ += batch.pairs.size();
}

void ContactWriter::finish() {
  file_.write_at(0, records_.head(count_));
  file_.commit();
}

}  // namespace padder::detect
