// SPDX-License-Identifier: GPL-3.0-or-later
// What a tool with --json prints on stdout when its work fails. The sentence goes to stderr as well.
#pragma once
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

namespace padder::cli {

inline void print_failure(const std::string& input, const std::string& error) {
  using Json = nlohmann::ordered_json;
  // The name of a file need not be valid UTF-8.
  std::cout << Json{{"input", input}, {"error", error}}.dump(2, ' ', false, Json::error_handler_t::replace)
            << std::endl;
}

}  // namespace padder::cli
