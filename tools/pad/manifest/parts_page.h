// SPDX-License-Identifier: GPL-3.0-or-later
// The page about many parts: a row for each, with a picture, its figures or its error, to be sorted and
// sifted.
#pragma once
#include <filesystem>
#include <functional>
#include <vector>

#include "tools/pad/manifest/records.h"
#include "tools/pad/manifest/workers.h"

namespace padder {

// A part, and what is known of it when it was reached.
struct PageRow {
  Record record;
  bool reached = false;
};

// Writes FOLDER/index.html. Pictures lie below FOLDER/.pad/pictures, named by the content of their asset, so
// each is drawn once. They are drawn for assets of our own format, at most `at_once` together; an asset whose
// picture fails has none. `progress` takes the share that is done. Throws Error.
void write_parts_page(const std::vector<PageRow>& rows, const std::filesystem::path& folder, Workers& workers,
                      std::size_t at_once, const std::function<void(double)>& progress);

}  // namespace padder
