// SPDX-License-Identifier: GPL-3.0-or-later
// Says what is wrong with a command line: which option, what was given, and what the option takes. CLI11's
// own messages show how it checks ("OR {0,1,2} FAILED") and not what to type.
#pragma once
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <functional>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace padder::cli {

// The text in quotes, cut if it is too long to read.
inline std::string in_quotes(std::string_view text) {
  constexpr std::size_t most = 100;
  return '"' + std::string(text.substr(0, most)) + (text.size() > most ? "...\"" : "\"");
}

// "a, b and c".
inline std::string listed(const std::vector<std::string>& words) {
  std::string out;
  for (std::size_t k = 0; k < words.size(); k++)
    out += (k == 0 ? "" : k + 1 < words.size() ? ", " : " and ") + words[k];
  return out;
}

// What an option takes, in words. CLI11 appends the descriptions of its checks to the type name, as in
// "N:UINT in [1 - 9]", "X:POSITIVE", "AXIS:{x,y,z}", "WHAT:value in {a->1,b->2} OR {1,2}".
inline std::string taken_by(const CLI::Option& option) {
  const std::string type = option.get_type_name(), name = type.substr(0, type.find(':'));
  const auto between = [&](const char* open, const char* close) -> std::string {
    const std::size_t from = type.find(open);
    if (from == std::string::npos) return "";
    const std::size_t begin = from + std::string_view(open).size();
    return type.substr(begin, type.find(close, begin) - begin);
  };
  if (const std::string all = between("{", "}"); !all.empty()) {
    std::vector<std::string> words;
    for (const std::string& word : CLI::detail::split(all, ','))
      words.push_back(word.substr(0, word.find("->")));
    return "one of " + listed(words);
  }
  if (name.starts_with("LENGTH")) return "a length above 0: a number, or a share of the diagonal as 1%";
  const bool whole = name == "N" || name == "K" || name == "INT" || name == "UINT" ||
                     name.starts_with("N,") || type.find("INT in [") != std::string::npos;
  const int count = option.get_type_size_max();
  std::string out = count > 1 && count < 10 ? std::to_string(count) + (whole ? " whole numbers" : " numbers")
                    : whole                 ? "a whole number"
                                            : "a number";
  if (const std::string range = between(" in [", "]"); !range.empty())
    out += " from " + range.substr(0, range.find(" - ")) + " to " + range.substr(range.find(" - ") + 3);
  else if (name == "UINT")
    out += " up to 4294967295";
  else if (type.find("POSITIVE") != std::string::npos)
    out += " above 0";
  else if (type.find("NONNEGATIVE") != std::string::npos)
    out += ", 0 or more";
  return out;
}

inline bool takes_numbers_or_words(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  for (const char* text : {"FILE", "DIR", "MESH", "NAME", "TEXT"})
    if (type.starts_with(text)) return type.find('{') != std::string::npos;
  return true;
}

// The option that the message is about, of the app or of one of its subcommands; null if there is none.
inline const CLI::Option* option_of(const CLI::App& app, const std::string& message) {
  for (const CLI::Option* option : app.get_options())
    if (message.starts_with(option->get_name() + ":") ||
        message.starts_with("Could not convert: " + option->get_name() + " = "))
      return option;
  for (const CLI::App* sub : app.get_subcommands())
    if (const CLI::Option* option = option_of(*sub, message)) return option;
  return nullptr;
}

// The value that was given, if the message is from one of CLI11's own checks. None if the message is a
// sentence of our own checks.
inline std::optional<std::string> refused_value(std::string_view message, const CLI::Option& option) {
  constexpr std::string_view convert = "Could not convert: ";
  if (message.starts_with(convert)) return std::string(message.substr(message.find(" = ") + 3));
  message.remove_prefix(option.get_name().size() + 2);
  const auto inside = [&](std::string_view before, std::string_view after) -> std::optional<std::string> {
    const std::size_t end = message.rfind(after);
    if (!message.starts_with(before) || end == std::string_view::npos || end < before.size()) return {};
    return std::string(message.substr(before.size(), end - before.size()));
  };
  auto value = inside("Value ", " not in range ");
  if (!value) value = inside("Check ", " value in {");
  if (!value) value = inside("", " not in {");
  return value;
}

// How many letters must be added, left out or changed to get from a to b (Levenshtein).
inline std::size_t letters_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); i++) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); j++) {
      const std::size_t changed = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, diagonal + 1, row[j] + 1});
    }
  }
  return row.back();
}

// The option that was probably meant by `word`, of the app or of its subcommand; empty if none is near.
inline std::string meant_by(const CLI::App& app, std::string word) {
  word = word.substr(0, word.find('='));
  const std::size_t letters = word.size() - std::min(word.size(), word.find_first_not_of('-'));
  std::string best;
  std::size_t least = word.size() + 20;
  const std::function<void(const CLI::App&)> search = [&](const CLI::App& a) {
    for (const CLI::Option* option : a.get_options())
      for (const std::string& name : option->get_lnames()) {
        const std::string whole = "--" + name;
        const bool begun = letters > 2 && whole.starts_with(word);
        const std::size_t between = begun ? 0 : letters_between(word, whole);
        const bool near = between <= 1 + letters / 4 || (letters > 2 && whole.starts_with(word.substr(0, 5)));
        if (near && between < least) best = whole, least = between;
      }
    for (const CLI::App* sub : a.get_subcommands()) search(*sub);
  };
  if (word.size() < 40) search(app);
  return best;
}

inline std::string extra_sentence(const CLI::App& app) {
  const std::vector<std::string> extras = app.remaining(true);
  const std::string first = extras.empty() ? "" : extras.front();
  if (first.starts_with("-")) {
    const std::string meant = meant_by(app, first);
    return "there is no option " + in_quotes(first) + (meant.empty() ? "" : ": " + meant + " may be meant");
  }
  std::vector<std::string> parts;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    parts.push_back(sub->get_name());
  if (!parts.empty()) return in_quotes(first) + " is none of " + listed(parts);
  return in_quotes(first) + " is one input too many";
}

// CLI11 takes -o=FILE for a file whose name begins with =. Throws for a short option that is written so.
inline void refuse_short_with_equals(int argc, char** argv) {
  for (int k = 1; k < argc; k++)
    if (const std::string word = argv[k];
        word.size() > 2 && word[0] == '-' && std::isalpha(word[1]) && word[2] == '=')
      throw CLI::ParseError(in_quotes(word) + ": write " + word.substr(0, 2) + " and its value as two words",
                            2);
}

// The sentence for an error of `app`'s parsing.
inline std::string usage_sentence(const CLI::App& app, const CLI::ParseError& error) {
  const std::string message = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error)) return extra_sentence(app);
  if (dynamic_cast<const CLI::RequiredError*>(&error))
    for (const CLI::Option* needed : app.get_options())
      if (message.starts_with(needed->get_name() + " is required"))
        return needed->get_name() + " is missing: " + needed->get_description();
  const CLI::Option* option = option_of(app, message);
  if (!option) return message;
  const std::string name = option->get_name();
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error)) {
    if (message.find("At Most") != std::string::npos)
      return name + " is given " + std::to_string(option->results().size()) + " times: give it once";
    return name + " takes " + (takes_numbers_or_words(*option) ? taken_by(*option) : "a value") + ", and " +
           (option->results().empty() || option->get_type_size_max() == 1 ? "none is given"
                                                                          : "fewer are given");
  }
  const auto given = refused_value(message, *option);
  if (!given) return message;
  if (option->get_expected_max() == 0) return name + " takes no value, not " + in_quotes(*given);
  return name + " takes " + taken_by(*option) + ", not " + in_quotes(*given);
}

}  // namespace padder::cli
