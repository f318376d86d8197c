// SPDX-License-Identifier: GPL-3.0-or-later
// The JSON documents that benches write, and read again. A document may come from anywhere: each field is
// checked before it is used, and an Error names the file and the field.
#pragma once
#include <string>
#include <vector>

#include "tools/bench/bench.h"

namespace padder::bench {

// The document as it is written: each row of a list stands on a line of its own, as in a table.
std::string text_of(const Json& document);

// Throws Error where the file cannot be read or is no JSON.
Json read_document(const std::string& file);

// The name of the bench that wrote the document. `where`, the file's name, begins the sentence of the Error
// that is thrown where no bench did.
std::string bench_of(const Json& document, const std::string& where);

// An object of a document, and its place there ("FILE: rows[3]"), which begins the sentence of each Error.
class Reader {
 public:
  Reader(const Json& object, std::string where);

  bool has(const std::string& key) const { return object_.contains(key); }
  double amount(const std::string& key) const;  // a finite number of at least 0
  std::string text(const std::string& key) const;
  bool flag(const std::string& key) const;
  Reader inner(const std::string& key) const { return {at(key), where_ + "." + key}; }
  const std::string& where() const { return where_; }

 private:
  const Json& at(const std::string& key) const;
  [[noreturn]] void fail(const std::string& key, const std::string& expected) const;

  const Json& object_;
  std::string where_;
};

// The document's rows, at least one. They refer to `document`, which must outlive them.
std::vector<Reader> rows_of(const Json& document, const std::string& where);

}  // namespace padder::bench
