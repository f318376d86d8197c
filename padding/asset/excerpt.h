// SPDX-License-Identifier: MIT
// Text of messages and files: what comes from a file or a user made safe to show, numbers, and bytes.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

namespace padder {

// Returns at most `most` characters, then "…". Control characters and bytes that are not UTF-8 become escapes
// as in C. So a message stays one line of plain text, whatever the file holds. The cost depends on what is
// shown only.
std::string excerpt(std::string_view text, std::size_t most = 60);

// Text for XML and HTML: &, <, > and " escaped.
std::string xml_text(std::string_view text);

// Without the blanks, tabs and carriage returns around it.
std::string_view trimmed(std::string_view text);

std::string base64(std::string_view bytes);

std::string lower_case(std::string_view text);  // of the letters A to Z; others stay

// "1 part", "2 parts"; where an s alone does not do, `many` is the word.
std::string counted(std::uint64_t n, const std::string& one, const std::string& many = "");

// The number to so many significant digits at most, as printf's %g writes it.
std::string short_number(double value, int digits);

}  // namespace padder
