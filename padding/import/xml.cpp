// SPDX-License-Identifier: MIT
#include "padding/import/xml.h"

#include <algorithm>
#include <vector>

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

}  // namespace

void load_xml(pugi::xml_document& document, std::string_view text, const std::string& where) {
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

}  // namespace padder::importing
