// SPDX-License-Identifier: MIT
// Reads XML for the readers of this folder. Not installed.
#pragma once
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace padder::importing {

// Throws Error, which begins with `where`, for text that is not XML or not UTF-8, text or a second element at
// the top, entities, an attribute that stands twice in one element, and elements nested deeper than 256.
void load_xml(pugi::xml_document& document, std::string_view text, const std::string& where);

// The numbers of a text, with blanks between them all; a plus may stand before each. Nothing where one is
// none.
std::optional<std::vector<double>> numbers_in(std::string_view text);

}  // namespace padder::importing
