// SPDX-License-Identifier: MIT
// Reads JSON documents and says where in them a fault is. Not installed, because it names nlohmann's types.
#pragma once
#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "padding/asset/child.h"

namespace padder {

// Parses a document. Throws Error, which begins with `where`, for text that is not JSON, for a number too
// large for a double, for a key twice in one object (it would be a guess which one counts) and for more than
// 64 levels of nesting. Of a text that does not begin as JSON, such as another program's file, the sentence
// ends with `wanted`: what it should be, and where that comes from. Json is nlohmann::json or
// nlohmann::ordered_json. A child (padding/asset/child.h) takes the text apart, while this process builds the
// document.
template <class Json>
Json parse_json(std::string_view text, const std::string& where,
                const char* wanted = "check that it is the right file");

// Builds the document that a child sends. Returns false if no text gives what was sent.
template <class Json>
bool receive_json(ChildPipe& pipe, Json& document, std::string_view text, const std::string& where,
                  const char* wanted = "");

// One place in a document. It knows its path, so that a message can say where it is: "FILE, bodies 3,
// position: 3 numbers are wanted". Refers to the document and to `where`, and does not own them.
template <class Json>
class JsonPlace {
 public:
  JsonPlace(const Json& document, const std::string& where)
      : document_(&document), at_(&document), where_(&where) {}

  [[noreturn]] void fail(const std::string& sentence) const;

  bool has(const std::string& key) const { return at_->is_object() && at_->contains(key); }
  JsonPlace at(const std::string& key) const;
  JsonPlace at(std::size_t k) const { return {*this, (*at_)[k]}; }
  std::size_t size() const;            // of an array
  std::vector<JsonPlace> all() const;  // entries of an array
  std::vector<JsonPlace> all(
      const std::string& key) const;  // of that under the key; none where it is missing
  void object() const;                // fails if it is not an object
  void only(std::initializer_list<const char*> keys) const;  // fails for any other key, too
  const Json& json() const { return *at_; }

  std::string text() const;
  std::string unit() const;  // of length: one of those that metres() in padding/asset/cluster.h knows
  std::string file() const;  // a string that can be the name of a file
  bool truth() const;
  double real() const;
  std::int64_t integer() const;
  std::uint64_t whole(std::uint64_t most) const;
  std::uint32_t bits() const { return static_cast<std::uint32_t>(whole(0xffffffffu)); }
  void reals(double* to, std::size_t count) const;  // of an array of this length
  template <std::size_t N>
  void reals(double (&to)[N]) const {
    reals(to, N);
  }

 private:
  JsonPlace(const JsonPlace& above, const Json& at)
      : document_(above.document_), at_(&at), where_(above.where_) {}

  const Json *document_, *at_;
  const std::string* where_;
};

extern template nlohmann::json parse_json(std::string_view, const std::string&, const char*);
extern template nlohmann::ordered_json parse_json(std::string_view, const std::string&, const char*);
extern template class JsonPlace<nlohmann::json>;
extern template class JsonPlace<nlohmann::ordered_json>;

}  // namespace padder
