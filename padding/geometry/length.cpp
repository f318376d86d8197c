// SPDX-License-Identifier: MIT
#include "padding/geometry/length.h"

#include <charconv>
#include <cmath>

namespace padder {

std::optional<Length> length_of(std::string_view text) {
  const bool percent = text.ends_with('%');
  if (percent) {
    text.remove_suffix(1);
    while (text.ends_with(' ')) text.remove_suffix(1);
  }
  // from_chars accepts no blank, no plus sign and no 0x, but it accepts "inf" and "nan".
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  if (percent) value /= 100;
  if (!std::isfinite(value) || !(value > 0)) return std::nullopt;
  return percent ? Length::share(value) : Length::of(value);
}

}  // namespace padder
