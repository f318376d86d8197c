// SPDX-License-Identifier: MIT
#include "padding/input/packages.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <pugixml.hpp>

#include "padding/asset/error.h"
#include "padding/asset/file.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> listed_in(const char* variable) {
  std::vector<fs::path> out;
  const char* value = std::getenv(variable);
  const std::string all = value ? value : "";
  for (std::size_t k = 0; k < all.size();) {
    const std::size_t end = std::min(all.find(':', k), all.size());
    if (end > k) out.emplace_back(all.substr(k, end - k));
    k = end + 1;
  }
  return out;
}

// What the folder's package.xml says; "" where there is none that can be read.
std::string package_name(const fs::path& folder) {
  std::error_code code;
  const fs::path file = folder / "package.xml";
  if (!fs::is_regular_file(file, code)) return "";
  pugi::xml_document document;
  try {
    constexpr std::uintmax_t most = 1 << 20;
    if (!document.load_string(read_file(file, most).c_str())) return "";
  } catch (const Error&) {  // a package that cannot be read is not the one that is looked for
    return "";
  }
  return document.child("package").child("name").text().as_string();
}

// A package may lie beside the URDF, beside its folder, or beside the package that has this folder.
constexpr int kPackageBeside = 2;
// Folders of packages are searched so deep: WORKSPACE/src/REPOSITORY/PACKAGE is of 3.
constexpr int kPackageBelow = 4;

void look_in(const fs::path& folder, const std::string& name, std::vector<fs::path>& roots) {
  roots.push_back(folder / name);
  if (package_name(folder) == name) roots.push_back(folder);
}

// The nearest come first. A package has none inside it.
void look_below(const fs::path& folder, const std::string& name, int depth, std::vector<fs::path>& roots) {
  std::vector<fs::path> level{folder}, next;
  for (int k = 1; k <= depth; k++, level.swap(next), next.clear()) {
    for (const fs::path& above : level) {
      std::error_code code;
      for (const auto& entry : fs::directory_iterator(above, code)) {
        const fs::path& at = entry.path();
        if (!entry.is_directory(code) || at.filename().string().starts_with('.')) continue;
        if ((k > 1 && at.filename() == name) || package_name(at) == name) roots.push_back(at);
        // What a link leads to could lead back.
        if (!entry.is_symlink(code) && !fs::exists(at / "package.xml", code)) next.push_back(at);
      }
    }
    std::ranges::sort(next);
  }
}

}  // namespace

std::string unescaped(std::string_view uri) {
  std::string name;
  for (; !uri.empty(); uri.remove_prefix(1)) {
    unsigned char byte = 0;
    const bool escape =
        uri[0] == '%' && uri.size() > 2 && std::from_chars(&uri[1], &uri[1] + 2, byte, 16).ptr == &uri[1] + 2;
    name += escape ? static_cast<char>(byte) : uri[0];
    if (escape) uri.remove_prefix(2);
  }
  return name;
}

std::vector<fs::path> places_in_package(const std::string& name, const fs::path& rest, const fs::path& home,
                                        const std::vector<fs::path>& folders) {
  std::vector<fs::path> roots;
  const auto look = [&](const fs::path& folder, int depth) {
    look_in(folder, name, roots);
    look_below(folder, name, depth, roots);
  };
  for (const fs::path& folder : folders) look(folder, kPackageBelow);
  // Of the folders far above not all others in them are read.
  int above = 0;
  for (fs::path folder = home;; folder = folder.parent_path(), above++) {
    above <= kPackageBeside ? look(folder, 1) : look_in(folder, name, roots);
    if (folder == folder.parent_path()) break;
  }
  for (const fs::path& folder : listed_in("ROS_PACKAGE_PATH")) {
    look(folder, kPackageBelow);
    if (folder.filename() == name) roots.push_back(folder);
  }
  for (const fs::path& prefix : listed_in("AMENT_PREFIX_PATH")) roots.push_back(prefix / "share" / name);
  for (fs::path& root : roots) root /= rest;
  return roots;
}

}  // namespace padder
