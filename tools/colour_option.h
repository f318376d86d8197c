// SPDX-License-Identifier: GPL-3.0-or-later
// The option --colour of the tools that draw.
#pragma once
#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "padding/view/view.h"
#include "tools/cli.h"

namespace padder::cli {

// Also takes what scripts pass to any program about the colours of text: it changes nothing.
inline void add_colour(CLI::App& app, ColourBy& colour, const std::string& description) {
  std::map<std::string, ColourBy> colours;
  for (const ColourBy by : kColourings) colours.emplace(name_of(by), by);
  for (const char* when : kWhenColoured) colours.emplace(when, colour);
  app.add_option("--colour,--color", colour,
                 description + "; never, auto and always are of text, which has none")
      ->transform(CLI::CheckedTransformer(colours))
      ->type_name("WHAT");
}

}  // namespace padder::cli
