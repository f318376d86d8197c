// SPDX-License-Identifier: MIT
#include "padding/robots/mesh_file.h"

#include <algorithm>

#include "padding/asset/excerpt.h"
#include "padding/input/text.h"

namespace padder::reading {

namespace fs = std::filesystem;

std::string slashed(std::string name) {
  std::ranges::replace(name, '\\', '/');
  return name;
}

fs::path file_in(const fs::path& folder, const std::string& name) {
  std::error_code code;
  const fs::path file = folder / name;
  return fs::is_regular_file(file, code) ? file : folder / slashed(name);
}

std::string in_other_case(const fs::path& file) {
  std::error_code code;
  fs::path at;
  for (const fs::path& part : fs::absolute(file).lexically_normal()) {
    if (fs::exists(at / part, code)) {
      at /= part;
      continue;
    }
    fs::path same;
    for (const auto& entry : fs::directory_iterator(at, code))
      if (lower_case(entry.path().filename().string()) == lower_case(part.string())) same = entry.path();
    if (same.empty()) return "";
    at = same;
  }
  if (fs::is_directory(at, code)) return "; it is a folder";
  return "; " + excerpt(at.string(), 500) + " is there: write the name with the same capital letters";
}

}  // namespace padder::reading
