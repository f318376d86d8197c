// SPDX-License-Identifier: MIT
// Text of messages: what comes from a file or a user made safe to show, and numbers.
#pragma once
#include <string>
#include <string_view>

namespace padder {

// Returns at most `most` characters, then "…". Control characters and bytes that are not UTF-8 become escapes
// as in C. So a message stays one line of plain text, whatever the file holds. The cost depends on what is
// shown only.
std::string excerpt(std::string_view text, std::size_t most = 60);

// The number to so many significant digits at most, as printf's %g writes it.
std::string short_number(double value, int digits);

}  // namespace padder
