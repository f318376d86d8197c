// SPDX-License-Identifier: MIT
#include "detect/boxes/contact_writer.h"

#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::size_t kHead = 256;  // bytes of NumPy's head: room for any count, and a multiple of 64

const std::filesystem::path& checked(const std::filesystem::path& path) {
  if (path.extension() != ".npy")
    throw Error(path.string() + ": contacts are streamed to .npy, one record for each contact");
  return path;
}

void add(std::string& to, const void* array, std::size_t k, std::size_t bytes) {
  if (array) to.append(static_cast<const char*>(array) + k * bytes, bytes);
}

}  // namespace

ContactWriter::ContactWriter(const std::filesystem::path& path, Width width, Scalar scalar)
    : file_(checked(path)), width_(width), scalar_(scalar) {
  file_.append(head());
}

std::string ContactWriter::head() const {
  const std::string real = scalar_ == Scalar::f32 ? "'<f4'" : "'<f8'";
  std::string text = "{'descr': [('i', '<u8'), ('j', '<u8')";
  if (width_ != Width::pairs) text += ", ('normal', " + real + ", (3,)), ('depth', " + real + ")";
  if (width_ == Width::points) text += ", ('on_i', " + real + ", (3,)), ('on_j', " + real + ", (3,))";
  text += "], 'fortran_order': False, 'shape': (" + std::to_string(count_) + ",), }";
  text.resize(kHead - 10 - 1, ' ');
  text += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(text.size() & 255), out += static_cast<char>(text.size() >> 8);
  return out + text;
}

void ContactWriter::append(const ContactBatch& batch) {
  if (batch.width != width_ || batch.scalar != scalar_)
    throw Error("a ContactWriter was given records of another width or scalar than it was made for");
  const std::size_t real = scalar_ == Scalar::f32 ? 4 : 8;
  block_.clear();
  for (std::size_t k = 0; k < batch.pairs.size(); k++) {
    add(block_, batch.pairs.data(), k, sizeof(WidePair));
    if (width_ != Width::pairs) add(block_, batch.normals, k, 4 * real);
    if (width_ == Width::points) add(block_, batch.points, k, 6 * real);
  }
  file_.append(block_);
  count_ += batch.pairs.size();
}

void ContactWriter::finish() {
  file_.write_at(0, head());
  file_.commit();
}

}  // namespace padder::detect
