// SPDX-License-Identifier: MIT
// Text of a file or of a user as a message may show it.
#pragma once
#include <string>
#include <string_view>

namespace padder {

// At most `most` characters, then …; control characters, and bytes that are no UTF-8, as escapes of C are
// written: a message stays one line that a terminal takes for text, whatever the file holds. Cost: that of
// what is shown.
std::string excerpt(std::string_view text, std::size_t most = 60);

}  // namespace padder
