// SPDX-License-Identifier: MIT
#include "padding/asset/json.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_set>
#include <utility>
#include <vector>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder {
namespace {

constexpr std::size_t kDeepest = 64;
constexpr int kOverflow = 406;  // nlohmann's number for it

// What a child says of the text.
constexpr char kNull = 'n', kTrue = 't', kFalse = 'f', kInteger = 'i', kUnsigned = 'u', kFloat = 'd',
               kString = 's', kKey = 'k', kObject = '{', kArray = '[', kClose = ']', kFault = '!', kEnd = '.';

// "\"key\"", short enough for a message.
std::string key_text(std::string_view key) { return '"' + excerpt(key) + '"'; }

// Builds the document from the parser's events. nlohmann's own builder silently keeps the last of two equal
// keys, and compares each new key of an ordered object with all keys before it.
template <class Json>
class Builder : public nlohmann::json_sax<Json> {
 public:
  Builder(std::string_view text, const std::string& where, const char* wanted)
      : text_(text), where_(where), wanted_(wanted) {}

  Json document;

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(std::int64_t value) override { return add(value); }
  bool number_unsigned(std::uint64_t value) override { return add(value); }
  bool number_float(double value, const std::string&) override { return add(value); }
  bool string(std::string& value) override { return add(std::move(value)); }
  bool binary(typename Json::binary_t&) override { return false; }  // not in text
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool end_object() override { return close(); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_array() override { return close(); }
  bool key(std::string& name) override {
    keyed_ = true;
    Level& level = open_.back();
    if (!level.keys.insert(name).second)
      throw Error(where_ + place() + ": the key " + key_text(name) +
                  " stands twice in one object: remove one");
    level.key = std::move(name);
    return true;
  }
  bool parse_error(std::size_t byte, const std::string& token,
                   const nlohmann::detail::exception& e) override {
    return fault(byte, token, e.id == kOverflow);
  }
  bool fault(std::size_t byte, const std::string& token, bool overflow) const {
    const bool begun = !open_.empty() || !document.is_null();
    if (!begun && !overflow && byte <= text_.size())
      throw Error(where_ + ": it is not JSON, as it begins with '" + excerpt(text_, 20) + "': " + wanted_);
    const std::size_t end = std::min(byte, text_.size());
    const std::string at = " at byte " + std::to_string(byte) + " (line " +
                           std::to_string(1 + std::count(text_.begin(), text_.begin() + end, '\n')) + ")";
    if (overflow)
      throw Error(where_ + place() + ": the number '" + excerpt(token) + "'" + at +
                  " is too large for a double: write one below 1.8e308");
    throw Error(where_ + ": not JSON" + at +
                (byte > text_.size() ? ", where it ends too early" : ", near '" + excerpt(token) + "'") +
                ": check that the file is whole");
  }

  // The events that a child sends, which a file may have taken over: false for those that no text gives.
  bool receive(ChildPipe& pipe) {
    std::string text;
    std::int64_t whole = 0;
    std::uint64_t natural = 0;
    double real = 0;
    char overflow = 0;
    for (char event = 0; pipe.get(event) && may_come(event);) switch (event) {
        case kNull:
          null();
          break;
        case kTrue:
        case kFalse:
          boolean(event == kTrue);
          break;
        case kInteger:
          if (!pipe.get(whole)) return false;
          number_integer(whole);
          break;
        case kUnsigned:
          if (!pipe.get(natural)) return false;
          number_unsigned(natural);
          break;
        case kFloat:
          if (!pipe.get(real)) return false;
          number_float(real, {});
          break;
        case kString:
        case kKey:
          if (!pipe.get_array(text)) return false;
          event == kKey ? key(text) : string(text);
          break;
        case kObject:
          start_object(0);
          break;
        case kArray:
          start_array(0);
          break;
        case kClose:
          close();
          break;
        case kFault:
          if (!pipe.get(natural) || !pipe.get_array(text) || !pipe.get(overflow)) return false;
          fault(natural, text, overflow != 0);
          break;
        default:
          return event == kEnd;
      }
    return false;
  }

 private:
  struct Level {
    Json* container;
    std::string key;
    std::unordered_set<std::string> keys;
  };

  bool may_come(char event) const {
    const bool in_object = !open_.empty() && open_.back().container->is_object();
    if (event == kKey) return in_object && !keyed_;
    if (event == kClose) return !open_.empty() && !keyed_;
    if (event == kFault || event == kEnd) return true;
    return !in_object || keyed_;
  }
  template <class T>
  Json* put(T&& value) {
    keyed_ = false;
    if (open_.empty()) {
      document = std::forward<T>(value);
      return &document;
    }
    Level& level = open_.back();
    if (level.container->is_array()) {
      level.container->push_back(std::forward<T>(value));
      return &level.container->back();
    }
    auto& object = level.container->template get_ref<typename Json::object_t&>();
    if constexpr (requires { object.back(); }) {  // ordered: a vector
      object.emplace_back(level.key, std::forward<T>(value));
      return &object.back().second;
    } else {
      return &object.emplace(level.key, std::forward<T>(value)).first->second;
    }
  }
  template <class T>
  bool add(T&& value) {
    put(std::forward<T>(value));
    return true;
  }
  bool open(Json container) {
    if (open_.size() == kDeepest)
      throw Error(where_ + place() + ": it is nested deeper than " + std::to_string(kDeepest) +
                  " levels, and no document of padder is: check that it is the right file");
    Json* at = put(std::move(container));
    open_.push_back({at, {}, {}});
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }
  std::string place() const {  // ", bodies 3, position"
    std::string out;
    for (std::size_t k = 0; k + 1 < open_.size(); k++)
      out += open_[k].container->is_array() ? " " + std::to_string(open_[k].container->size() - 1)
                                            : ", " + excerpt(open_[k].key);
    return out;
  }

  std::string_view text_;
  const std::string& where_;
  const char* wanted_;
  std::vector<Level> open_;
  bool keyed_ = false;  // a key has come, and not yet its value
};

// Sends the parser's events.
template <class Json>
class Sender : public nlohmann::json_sax<Json> {
 public:
  explicit Sender(ChildPipe& pipe) : pipe_(pipe) {}

  bool null() override { return pipe_.put(kNull); }
  bool boolean(bool value) override { return pipe_.put(value ? kTrue : kFalse); }
  bool number_integer(std::int64_t value) override { return pipe_.put(kInteger) && pipe_.put(value); }
  bool number_unsigned(std::uint64_t value) override { return pipe_.put(kUnsigned) && pipe_.put(value); }
  bool number_float(double value, const std::string&) override {
    return pipe_.put(kFloat) && pipe_.put(value);
  }
  bool string(std::string& value) override { return pipe_.put(kString) && pipe_.put_array(value); }
  bool binary(typename Json::binary_t&) override { return false; }  // not in text
  bool key(std::string& name) override { return pipe_.put(kKey) && pipe_.put_array(name); }
  bool start_object(std::size_t) override { return pipe_.put(kObject); }
  bool end_object() override { return pipe_.put(kClose); }
  bool start_array(std::size_t) override { return pipe_.put(kArray); }
  bool end_array() override { return pipe_.put(kClose); }
  bool parse_error(std::size_t byte, const std::string& token,
                   const nlohmann::detail::exception& e) override {
    pipe_.put(kFault) && pipe_.put<std::uint64_t>(byte) && pipe_.put_array(token) &&
        pipe_.put<char>(e.id == kOverflow);
    return false;
  }

 private:
  ChildPipe& pipe_;
};

// Finds the path from a value to one inside it. Only error messages need it, so reading does not keep track.
template <class Json>
bool find_path(const Json& from, const Json* to, std::string& path) {
  if (&from == to) return true;
  const std::size_t length = path.size();
  std::size_t k = 0;
  for (auto it = from.begin(); from.is_structured() && it != from.end(); ++it, k++) {
    path += from.is_array() ? " " + std::to_string(k) : ", " + excerpt(it.key());
    if (find_path(*it, to, path)) return true;
    path.resize(length);
  }
  return false;
}

// The value if it is a whole number that fits. JSON does not tell 3 from 3.0, and some programs write the
// latter.
template <class To, class Json>
std::optional<To> whole_value(const Json& json) {
  const auto fit = [](auto n) {
    return std::in_range<To>(n) ? std::optional(static_cast<To>(n)) : std::nullopt;
  };
  if (json.is_number_unsigned()) return fit(json.template get<std::uint64_t>());
  if (json.is_number_integer()) return fit(json.template get<std::int64_t>());
  if (!json.is_number()) return std::nullopt;
  const double d = json.template get<double>();
  return d == std::floor(d) && std::abs(d) < 0x1p63 ? fit(static_cast<std::int64_t>(d)) : std::nullopt;
}

}  // namespace

template <class Json>
bool receive_json(ChildPipe& pipe, Json& document, std::string_view text, const std::string& where,
                  const char* wanted) {
  Builder<Json> builder(text, where, wanted);
  const bool whole = builder.receive(pipe);
  document = std::move(builder.document);
  return whole;
}

template <class Json>
Json parse_json(std::string_view text, const std::string& where, const char* wanted) {
  if (reads_here()) {
    Builder<Json> builder(text, where, wanted);
    Json::sax_parse(text, &builder);
    return std::move(builder.document);
  }
  Json document;
  const auto send = [&](ChildPipe& pipe) {
    Sender<Json> sender(pipe);
    Json::sax_parse(text, &sender);
    return pipe.put(kEnd);
  };
  const auto receive = [&](ChildPipe& pipe) { return receive_json(pipe, document, text, where, wanted); };
  in_child([] {}, send, receive, text.size(), where);
  return document;
}

template <class Json>
void JsonPlace<Json>::fail(const std::string& sentence) const {
  std::string path;
  find_path(*document_, at_, path);
  throw Error(*where_ + path + ": " + sentence);
}

template <class Json>
JsonPlace<Json> JsonPlace<Json>::at(const std::string& key) const {
  object();
  const auto it = at_->find(key);
  if (it == at_->end()) fail(key_text(key) + " is missing");
  return {*this, *it};
}

template <class Json>
std::size_t JsonPlace<Json>::size() const {
  if (!at_->is_array()) fail("an array is wanted");
  return at_->size();
}

template <class Json>
std::vector<JsonPlace<Json>> JsonPlace<Json>::all() const {
  std::vector<JsonPlace> entries;
  for (std::size_t k = 0; k < size(); k++) entries.push_back(at(k));
  return entries;
}

template <class Json>
std::vector<JsonPlace<Json>> JsonPlace<Json>::all(const std::string& key) const {
  return has(key) ? at(key).all() : std::vector<JsonPlace>();
}

template <class Json>
void JsonPlace<Json>::object() const {
  if (!at_->is_object()) fail("an object is wanted");
}

template <class Json>
void JsonPlace<Json>::only(std::initializer_list<const char*> keys) const {
  object();
  for (auto it = at_->begin(); it != at_->end(); ++it)
    if (std::find(keys.begin(), keys.end(), it.key()) == keys.end()) {
      std::string known;
      for (const char* key : keys) known += std::string(known.empty() ? "" : ", ") + key;
      fail("the key " + key_text(it.key()) + " is unknown: the keys here are " + known);
    }
}

template <class Json>
std::string JsonPlace<Json>::text() const {
  if (!at_->is_string()) fail("a string is wanted");
  return at_->template get<std::string>();
}

template <class Json>
std::string JsonPlace<Json>::unit() const {
  std::string word = text();
  try {
    metres(word);
  } catch (const Error& e) {
    fail(e.what());
  }
  return word;
}

template <class Json>
std::string JsonPlace<Json>::file() const {
  const std::string name = text();
  const auto control = [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; };
  if (name.empty() || name.size() > 4095 || std::ranges::any_of(name, control))
    fail("the name of a file is wanted, not '" + excerpt(name) + "'");
  return name;
}

template <class Json>
bool JsonPlace<Json>::truth() const {
  if (!at_->is_boolean()) fail("true or false is wanted");
  return at_->template get<bool>();
}

template <class Json>
double JsonPlace<Json>::real() const {
  if (!at_->is_number()) fail("a number is wanted");
  return at_->template get<double>();
}

template <class Json>
std::int64_t JsonPlace<Json>::integer() const {
  const auto n = whole_value<std::int64_t>(*at_);
  if (!n) fail("a whole number is wanted");
  return *n;
}

template <class Json>
std::uint64_t JsonPlace<Json>::whole(std::uint64_t most) const {
  const auto n = whole_value<std::uint64_t>(*at_);
  if (!n || *n > most) fail("a whole number from 0 to " + std::to_string(most) + " is wanted");
  return *n;
}

template <class Json>
void JsonPlace<Json>::reals(double* to, std::size_t count) const {
  if (!at_->is_array() || at_->size() != count) fail(std::to_string(count) + " numbers are wanted");
  for (std::size_t k = 0; k < count; k++) to[k] = at(k).real();
}

template bool receive_json(ChildPipe&, nlohmann::json&, std::string_view, const std::string&, const char*);
template bool receive_json(ChildPipe&, nlohmann::ordered_json&, std::string_view, const std::string&,
                           const char*);
template nlohmann::json parse_json(std::string_view, const std::string&, const char*);
template nlohmann::ordered_json parse_json(std::string_view, const std::string&, const char*);
template class JsonPlace<nlohmann::json>;
template class JsonPlace<nlohmann::ordered_json>;

}  // namespace padder
