// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/report/document.h"

#include <cmath>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/asset/json.h"

namespace padder::bench {

std::string text_of(const Json& document) {
  std::string text;
  for (const auto& [key, value] : document.items()) {
    text += (text.empty() ? "{\n  " : ",\n  ") + Json(key).dump() + ": ";
    if (!value.is_array()) {
      text += value.dump();
      continue;
    }
    std::string rows;
    for (const Json& row : value) rows += (rows.empty() ? "\n    " : ",\n    ") + row.dump();
    text += "[" + rows + (rows.empty() ? "]" : "\n  ]");
  }
  return text + "\n}\n";
}

Json read_document(const std::string& file) {
  return parse_json<Json>(read_file(file, kMostText), file,
                          "bench NAME -o DIR writes what can be drawn and compared as DIR/NAME.json");
}

std::string bench_of(const Json& document, const std::string& where) {
  const Json name = document.is_object() ? document.value("bench", Json()) : Json();
  if (!name.is_string())
    throw Error(where + " is not what a bench wrote: bench NAME -o DIR writes DIR/NAME.json");
  return name;
}

Reader::Reader(const Json& object, std::string where) : object_(object), where_(std::move(where)) {
  if (!object.is_object()) fail("", "an object");
}

double Reader::amount(const std::string& key) const {
  const Json& v = at(key);
  if (!v.is_number() || !std::isfinite(v.get<double>()) || v.get<double>() < 0)
    fail(key, "a number of at least 0");
  return v.get<double>();
}

std::string Reader::text(const std::string& key) const {
  if (!at(key).is_string()) fail(key, "a text");
  return at(key).get<std::string>();
}

bool Reader::flag(const std::string& key) const {
  if (!at(key).is_boolean()) fail(key, "true or false");
  return at(key).get<bool>();
}

const Json& Reader::at(const std::string& key) const {
  static const Json absent;
  const auto it = object_.find(key);
  return it == object_.end() ? absent : *it;
}

void Reader::fail(const std::string& key, const std::string& expected) const {
  throw Error(where_ + (key.empty() ? "" : "." + key) + " is not " + expected +
              ": the file is damaged, or not what this bench writes");
}

std::vector<Reader> rows_of(const Json& document, const std::string& where) {
  const auto it = document.find("rows");
  if (it == document.end() || !it->is_array() || it->empty())
    throw Error(where +
                ": \"rows\" is not a list with rows in it: the file is damaged, or the bench was broken off");
  std::vector<Reader> rows;
  for (std::size_t k = 0; k < it->size(); k++)
    rows.emplace_back((*it)[k], where + ": rows[" + std::to_string(k) + "]");
  return rows;
}

}  // namespace padder::bench
