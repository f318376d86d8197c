// SPDX-License-Identifier: GPL-3.0-or-later
// What a tool with --json prints on stdout.
#pragma once
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

namespace padder::cli {

// The document as text. Bytes that are no UTF-8, as the name of a file may have them, are replaced.
inline void print_json(const nlohmann::ordered_json& document) {
  std::cout << document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << std::endl;
}

// When the work fails. The sentence goes to stderr as well.
inline void print_failure(const std::string& input, const std::string& error) {
  print_json({{"input", input}, {"error", error}});
}

}  // namespace padder::cli
