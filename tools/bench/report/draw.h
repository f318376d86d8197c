// SPDX-License-Identifier: GPL-3.0-or-later
// Plots of the benches, made from their JSON documents only. So `bench draw` makes the same plot later, on
// another machine, as the bench itself.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "tools/bench/bench.h"

namespace padder::bench {

// One picture as a script for gnuplot, but for its terminal and output.
struct Plot {
  std::string name;  // to follow the document's own: "", "_bodies", "_MESH"
  std::string script;
  int width = 800, height = 500;  // pixels
};

// What there is to draw of a bench's document; none where that bench has no plot (table2). `where`, the
// file's name, begins the sentence of the Error thrown where it is no such document, or a damaged one.
std::vector<Plot> plots_of(const Json& document, const std::string& where);  // plots.cpp

bool have_gnuplot();

// Draws them as FOLDER/STEM….svg, each written whole or not at all, and gives their names. Throws Error
// where gnuplot is not installed or fails.
std::vector<std::filesystem::path> draw(const std::vector<Plot>& plots, const std::filesystem::path& folder,
                                        const std::string& stem);

}  // namespace padder::bench
