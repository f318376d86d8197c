// SPDX-License-Identifier: MIT
// XML documents as our readers take them. Not installed.
#pragma once
#include <pugixml.hpp>
#include <string>
#include <string_view>

namespace padder::importing {

// Throws Error, which begins with `where`: not XML, an attribute twice in one element, nested deeper than
// 256.
void load_xml(pugi::xml_document& document, std::string_view text, const std::string& where);

}  // namespace padder::importing
