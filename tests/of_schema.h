// SPDX-License-Identifier: MIT
// Documents against the schemas of assets/, by Python's jsonschema where it is installed.
#pragma once
#include <cstdlib>
#include <filesystem>
#include <string>

namespace padder {

inline bool schemas_are_checked() {
  return std::system("'" PADDER_PYTHON "' -c 'import jsonschema' >/dev/null 2>&1") == 0;
}

inline bool of_schema(const std::filesystem::path& document, const std::string& schema) {
  const std::string command = "'" PADDER_PYTHON "' -W ignore -m jsonschema -i '" + document.string() +
                              "' '" PADDER_ASSETS "/" + schema + "' >/dev/null 2>&1";
  return std::system(command.c_str()) == 0;
}

}  // namespace padder
