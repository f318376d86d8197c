// SPDX-License-Identifier: GPL-3.0-or-later
// The option --colour of the tools that draw.
#pragma once
#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "padding/view/view.h"

namespace padder::cli {

inline void add_colour(CLI::App& app, ColourBy& colour, const std::string& description) {
  std::map<std::string, ColourBy> colours;
  for (const ColourBy by : kColourings) colours.emplace(name_of(by), by);
  app.add_option("--colour", colour, description)
      ->transform(CLI::CheckedTransformer(colours))
      ->type_name("WHAT");
}

}  // namespace padder::cli
