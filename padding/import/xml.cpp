// SPDX-License-Identifier: MIT
#include "padding/import/xml.h"

#include <algorithm>
#include <charconv>

#include "padding/asset/child.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"

namespace padder::importing {
namespace {

constexpr const char* kBlanks = " \t\n\r";
constexpr int kDeepest = 256;  // levels of elements: the readers recurse, and must not exhaust the stack

// pugixml drops what it cannot read when it converts. On most texts a look at each byte is enough.
bool is_utf8(std::string_view text) {
  const auto ascii = [](char c) { return static_cast<unsigned char>(c) < 0x80; };
  return std::ranges::all_of(text, ascii) || pugi::as_utf8(pugi::as_wide(std::string(text))) == text;
}

// Refuses what XML forbids and pugixml takes: an attribute that stands twice, of which it would take the
// first, and bytes that are no text.
class Check : public pugi::xml_tree_walker {
 public:
  explicit Check(const std::string& where) : where_(where) {}
  bool for_each(pugi::xml_node& node) override {
    const auto fail = [&](const std::string& what) {
      throw Error(where_ + ", byte " + std::to_string(node.offset_debug()) + ": the element <" +
                  excerpt(*node.name() ? node.name() : node.parent().name()) + "> " + what);
    };
    if (depth() > kDeepest) fail("is nested deeper than " + std::to_string(kDeepest) + " levels");
    if (!is_utf8(node.name()) || !is_utf8(node.value()))
      fail("holds bytes that are not UTF-8: save the file as UTF-8");
    names_.clear();
    for (const pugi::xml_attribute& a : node.attributes()) {
      if (!is_utf8(a.name()) || !is_utf8(a.value()))
        fail("has the attribute '" + excerpt(a.name()) +
             "' with bytes that are not UTF-8: save the file as UTF-8");
      names_.emplace_back(a.name());
    }
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

// Behind the first element pugixml would pass over text, and a reader over more elements.
void check_top(pugi::xml_document& document, const std::string& where) {
  // Of a file that is no XML nothing is quoted: one that an <include> names may be anything.
  if (!document.document_element())
    throw Error(where + ": there is no element in it: check that it is the right file, and whole");
  std::size_t elements = 0;
  for (pugi::xml_node node = document.first_child(); node;) {
    const pugi::xml_node next = node.next_sibling();
    const auto fail = [&](const std::string& what) {
      throw Error(where + ", byte " + std::to_string(node.offset_debug()) + ": " + what);
    };
    if (node.type() == pugi::node_doctype) {
      if (std::string_view(node.value()).find("<!ENTITY") != std::string_view::npos)
        fail("entities (<!ENTITY) are not read: write what they stand for in their places");
      document.remove_child(node);
    } else if (node.type() != pugi::node_element) {
      fail("text outside of the root element: '" + excerpt(node.value()) + "': remove it");
    } else if (++elements > 1) {
      fail("a second root element, <" + excerpt(node.name()) +
           ">: a file has one, so put it into a file of its own");
    }
    node = next;
  }
}

void parse(pugi::xml_document& document, std::string_view text, const std::string& where) {
  const pugi::xml_parse_result result = document.load_buffer(
      text.data(), text.size(), pugi::parse_default | pugi::parse_doctype | pugi::parse_fragment);
  if (!result) {
    const auto byte = static_cast<std::size_t>(std::max<std::ptrdiff_t>(result.offset, 0));
    const std::string_view before = text.substr(0, std::min(byte, text.size()));
    throw Error(where + ": not XML at byte " + std::to_string(byte) + " (line " +
                std::to_string(1 + std::count(before.begin(), before.end(), '\n')) + "), near '" +
                excerpt(text.substr(before.size(), 100)) + "': check that the file is whole");
  }
  check_top(document, where);
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
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    if (text.empty()) return out;
    if (text.front() == '+' && !text.starts_with("+-")) text.remove_prefix(1);
    const char* end = text.data() + text.size();
    const auto [next, code] = std::from_chars(text.data(), end, out.emplace_back());
    if (code != std::errc()) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(next - text.data()));
    if (text.find_first_of(kBlanks) != 0 && !text.empty()) return std::nullopt;  // 0.1.2 is not 0.1 and 0.2
  }
}

}  // namespace padder::importing
