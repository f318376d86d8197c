// SPDX-License-Identifier: GPL-3.0-or-later
// Checks what is typed before CLI11 reads a number from it, because CLI11 also takes nan, inf, 0x10, and 010
// as 8.
#pragma once
#include <CLI/CLI.hpp>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "padding/input/read.h"
#include "padding/pad_options.h"

namespace padder::cli {

inline std::string not_a(const std::string& text, const char* what) {
  return '"' + text + "\" is no " + what;
}

// Takes the texts for which `good` is true; of the others the sentence says what they are not.
template <class Good>
CLI::Validator accepting(Good good, const char* what) {
  return {[=](const std::string& text) { return good(text) ? std::string() : not_a(text, what); }, ""};
}

// The number that is all of the text.
template <class T, class... Format>
std::optional<T> number_of(std::string_view text, Format... format) {
  T value = 0;
  const char* end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value, format...);
  return read.ec == std::errc() && read.ptr == end ? std::optional(value) : std::nullopt;
}

// A finite decimal number.
inline CLI::Validator decimal() {
  return accepting([](auto& text) { return std::isfinite(number_of<double>(text).value_or(NAN)); },
                   "decimal number");
}

// A length in the unit of a scene, as the detector takes it.
inline CLI::Validator distance() {
  return accepting([](auto& text) { return number_of<double>(text).value_or(NAN) <= 1e100; },
                   "length: write a decimal number of at most 1e100");
}

// To stand before CLI11's own checks, which take for 0 what double arithmetic holds with fewer digits or not
// at all.
inline CLI::Validator not_tiny() {
  return accepting(
      [](auto& text) {
        errno = 0;
        return std::abs(std::strtod(text.c_str(), nullptr)) >= 1 || errno != ERANGE;
      },
      "length that can be computed with: write at least 2.3e-308");
}

// Digits without a sign and without a leading zero. CLI11 would replace a number that is too large by the
// largest there is.
inline bool is_whole(const std::string& text) {
  return number_of<std::uint64_t>(text) && (text == "0" || text[0] != '0');
}

// The type of the numbers that an option holds.
template <class Value>
struct Held {
  using Number = Value;
};
template <class T>
struct Held<std::optional<T>> {
  using Number = T;
};
template <class T>
struct Held<std::vector<T>> {
  using Number = T;
};
template <class Value>
inline constexpr std::uint64_t kLargest = std::numeric_limits<typename Held<Value>::Number>::max();

// Adds an option of whole numbers from `least` to `most`, with the check that CLI11 lacks. So no option of a
// whole number is to be added in another way.
template <class Value>
CLI::Option* add_whole(CLI::App& app, const std::string& name, Value& value, const std::string& what,
                       std::uint64_t least = 0, std::uint64_t most = kLargest<Value>) {
  const std::string range = '[' + std::to_string(least) + " - " + std::to_string(most) + ']';
  const auto fault = [=](const std::string& text) -> std::string {
    const std::size_t digits = text.find_first_not_of("+-");
    if (digits != std::string::npos && text[digits] == '0' && digits + 1 < text.size() &&
        text[digits + 1] != '.')
      return not_a(text, "whole number in decimal digits without a leading zero");
    const bool fits = is_whole(text);  // into 64 bits
    const std::uint64_t number = fits ? std::stoull(text) : 0;
    if (fits && number >= least && number <= most) return "";
    const bool is_digits = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
    if (most == kLargest<Value> && is_digits && (!fits || number > most))
      return '"' + text + "\" is too large: write at most " + std::to_string(most);
    return "Value " + text + " not in range " + range;  // in CLI11's words, which tools/usage.h knows
  };
  // In CLI11's words, too: the range is shown by --help, unless it is that of the type.
  const std::string taken = most != kLargest<Value> ? "UINT in " + range
                            : least > 0             ? "POSITIVE"
                                                    : "NONNEGATIVE";
  return app.add_option(name, value, what)->type_name("N")->check(CLI::Validator(fault, taken));
}

// For programs that take a scene: people give them the mesh, or a file of spheres with one of these endings,
// which only a scene can name.
inline CLI::Validator scene_file(std::vector<std::string> in_scenes_alone) {
  return {[=](const std::string& text) {
            if (has_mesh_ending(text))
              return '"' + text + "\" is a mesh: make spheres of it first, with pad " + text;
            for (const std::string& ending : in_scenes_alone)
              if (text.ends_with(ending))
                return '"' + text +
                       "\" holds spheres alone: name it in a scene, as \"spheres\": [{\"file\": \"" + text +
                       "\"}]";
            return std::string();
          },
          ""};
}

// A level of detail: a whole number, or auto.
inline CLI::Validator rung() {
  return accepting([](auto& text) { return text == "auto" || (is_whole(text) && text.size() < 9); },
                   "level of detail: write a whole number (0 is the finest), or auto");
}

// Says on stderr that `fewer` bodies have no level of detail `lod`.
inline void tell_fewer_levels(const char* program, const std::string& lod, std::uint64_t fewer) {
  if (fewer == 0) return;
  std::fprintf(stderr,
               "%s: warning: --lod %s: %llu bod%s no such level and take%s the coarsest that there is\n",
               program, lod.c_str(), static_cast<unsigned long long>(fewer),
               fewer == 1 ? "y has" : "ies have", fewer == 1 ? "s" : "");
}

// A whole number, or hexadecimal digits after 0x: for masks.
inline CLI::Validator bits() {
  return accepting(
      [](auto& text) {
        const bool hex = text.starts_with("0x") && text.size() > 2 &&
                         text.find_first_not_of("0123456789abcdefABCDEF", 2) == std::string::npos;
        return hex || is_whole(text);
      },
      "whole number, as 12 or 0xc");
}

// 0.03 of "3%" and of "0.03"; nothing where the text is neither, or below 0.
inline std::optional<double> fraction_of(std::string_view text) {
  const bool percent = text.ends_with('%');
  if (percent) text.remove_suffix(1);
  const double value = number_of<double>(text).value_or(NAN);
  if (!std::isfinite(value) || value < 0) return std::nullopt;
  return percent ? value / 100 : value;
}

inline CLI::Validator fraction() {
  return accepting([](auto& text) { return fraction_of(text).has_value(); },
                   "fraction: write a number of at least 0, as 3% or 0.03");
}

// 21474836480 of "20G"; nothing where the text is no number of bytes above 0 that 64 bits hold.
inline std::optional<std::uint64_t> bytes_of(std::string_view text) {
  constexpr std::string_view units = "KMGT";
  std::uint64_t unit = 1;
  if (!text.empty() && units.find(text.back()) != std::string_view::npos)
    unit = std::uint64_t(1) << (10 * (units.find(text.back()) + 1)), text.remove_suffix(1);
  const double value =
      number_of<double>(text, std::chars_format::fixed).value_or(NAN) * static_cast<double>(unit);
  if (!(value >= 1 && value < 0x1p63)) return std::nullopt;
  return static_cast<std::uint64_t>(value);
}

inline CLI::Validator bytes() {
  return accepting([](auto& text) { return bytes_of(text).has_value(); },
                   "number of bytes: write a number above 0, and K, M, G or T for 2^10, 2^20, 2^30 or 2^40 "
                   "of them, as 20G");
}

// What padder::length_of takes.
inline CLI::Validator length() {
  return accepting([](auto& text) { return length_of(text).has_value(); },
                   "length: write a number above 0 for the mesh's own unit, as 0.01, or a share of its "
                   "diagonal, as 1%");
}

// The same, or 0.
inline CLI::Validator length_or_zero() {
  return accepting([](auto& text) { return text == "0" || length_of(text); },
                   "length: write 0, a number above 0 for the mesh's own unit, as 0.01, or a share of its "
                   "diagonal, as 1%");
}

}  // namespace padder::cli
