// SPDX-License-Identifier: MIT

#include <openssl/evp.h>

#include <fstream>
#include <memory>
#include <vector>

#include "padding/asset/error.h"
#include "padding/input/read_internal.h"

namespace padder {
namespace {

class Digest {
 public:
  Digest() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    check(context_ && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
  }
  void add(std::string_view bytes) { check(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size())); }
  std::string hex() {
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned length = 0;
    check(EVP_DigestFinal_ex(context_.get(), digest, &length));
    std::string text;
    for (unsigned k = 0; k < length; k++)
      text += "0123456789abcdef"[digest[k] >> 4], text += "0123456789abcdef"[digest[k] & 15];
    return text;
  }

 private:
  static void check(bool good) {
    if (!good) throw Error("OpenSSL computes no SHA-256: it has no memory left, or was built without");
  }

  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context_;
};

}  // namespace

std::string sha256(std::string_view bytes) {
  Digest digest;
  digest.add(bytes);
  return digest.hex();
}

std::string sha256_of_file(const std::filesystem::path& path) {
  std::error_code code;  // a pipe that nobody writes to would keep open() waiting
  std::ifstream file;
  if (std::filesystem::is_regular_file(path, code)) file.open(path, std::ios::binary);
  if (!file.is_open())
    throw Error("cannot open " + path.string() + ": check the name and that it may be read");
  Digest digest;
  std::vector<char> piece(std::size_t(1) << 18);
  while (file.read(piece.data(), static_cast<std::streamsize>(piece.size())) || file.gcount() > 0)
    digest.add({piece.data(), static_cast<std::size_t>(file.gcount())});
  if (file.bad()) throw Error("cannot read " + path.string() + " to its end: check the disk");
  return digest.hex();
}

}  // namespace padder
