// SPDX-License-Identifier: MIT
#include "padding/import/xml.h"

#include <algorithm>
#include <charconv>
#include <vector>

#include "padding/asset/child.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder::importing {
namespace {

constexpr int kDeepest = 256;  // levels of elements: the readers recurse, and must not exhaust the stack

// Refuses an attribute that stands twice, which XML forbids: pugixml would take the first.
class Check : public pugi::xml_tree_walker {
 public:
  explicit Check(const std::string& where) : where_(where) {}
  bool for_each(pugi::xml_node& node) override {
    const auto fail = [&](const std::string& what) {
      throw Error(where_ + ", byte " + std::to_string(node.offset_debug()) + ": the element <" +
                  excerpt(node.name()) + "> " + what);
    };
    if (depth() > kDeepest) fail("is nested deeper than " + std::to_string(kDeepest) + " levels");
    names_.clear();
    for (const pugi::xml_attribute& a : node.attributes()) names_.emplace_back(a.name());
    std::sort(names_.begin(), names_.end());  // an element may have a million
    const auto twice = std::adjacent_find(names_.begin(), names_.end());
    if (twice != names_.end()) fail("has the attribute '" + excerpt(*twice) + "' twice: remove one");
    return true;
  }

 private:
  const std::string& where_;
  std::vector<std::string_view> names_;  // of the element's attributes
};

// Sends each element and each text with its depth, parents first, and a depth of -1 at the end.
struct Sender : pugi::xml_tree_walker {
  explicit Sender(ChildPipe& to) : pipe(to) {}
  bool for_each(pugi::xml_node& node) override {
    const auto text = [&](std::string_view t) { return pipe.put_array(t); };
    bool sent = pipe.put(depth()) && text(node.name()) && text(node.value());
    for (const pugi::xml_attribute& a : node.attributes()) sent = sent && text(a.name()) && text(a.value());
    return sent && text("");
  }
  ChildPipe& pipe;
};

// False for what no walk sends.
bool receive(ChildPipe& pipe, pugi::xml_document& document) {
  std::vector<pugi::xml_node> path = {document};
  std::string name, value;
  int depth = 0;
  while (pipe.get(depth) && depth >= 0) {
    if (static_cast<std::size_t>(depth) >= path.size() || depth > kDeepest) return false;
    path.resize(static_cast<std::size_t>(depth) + 1);
    if (!pipe.get_array(name) || !pipe.get_array(value)) return false;
    pugi::xml_node node = path.back().append_child(name.empty() ? pugi::node_pcdata : pugi::node_element);
    node.set_name(name.c_str()), node.set_value(value.c_str());
    while (pipe.get_array(name) && !name.empty()) {
      if (!pipe.get_array(value)) return false;
      node.append_attribute(name.c_str()).set_value(value.c_str());
    }
    path.push_back(node);
  }
  return depth == -1;
}

void parse(pugi::xml_document& document, std::string_view text, const std::string& where) {
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (!result) {
    const auto byte = static_cast<std::size_t>(std::max<std::ptrdiff_t>(result.offset, 0));
    const std::string_view before = text.substr(0, std::min(byte, text.size()));
    throw Error(where + ": not XML at byte " + std::to_string(byte) + " (line " +
                std::to_string(1 + std::count(before.begin(), before.end(), '\n')) + "), near '" +
                excerpt(text.substr(before.size(), 100)) + "': check that the file is whole");
  }
  Check check(where);
  document.traverse(check);
}

}  // namespace

void load_xml(pugi::xml_document& document, std::string_view text, const std::string& where) {
  const auto send = [&](ChildPipe& pipe) {
    Sender sender(pipe);
    return document.traverse(sender) && pipe.put(-1);
  };
  in_child([&] { parse(document, text, where); }, send,
           [&](ChildPipe& pipe) { return receive(pipe, document); }, text.size(), where);
}

std::optional<std::vector<double>> numbers_in(std::string_view text) {
  std::vector<double> out;
  for (;;) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t\n\r"), text.size()));
    if (text.empty()) return out;
    if (text.front() == '+') text.remove_prefix(1);
    const char* end = text.data() + text.size();
    const auto [next, code] = std::from_chars(text.data(), end, out.emplace_back());
    if (code != std::errc()) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(next - text.data()));
  }
}

}  // namespace padder::importing
