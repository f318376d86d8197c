// SPDX-License-Identifier: MIT
// A run as one HTML file that plays: it needs neither a network nor another program than a browser.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "tools/settle/stepper.h"

namespace padder::settle {

// Collects frames: of each sphere 6 bytes. The box of the first frame, widened to what the frames reach, is
// kept to 2^-16 of its edges.
class Movie {
 public:
  // Takes where the spheres of `stepper` are now (placed()). Throws Error if the frames together would be
  // larger than a page can be (512 MB).
  void add(const Stepper& stepper);
  std::size_t frames() const { return times_.size(); }
  // Throws Error if there are no frames, or the file cannot be written.
  void write(const std::string& title, const System& system, const std::filesystem::path& path) const;

 private:
  std::vector<std::vector<float>> centers_;
  std::vector<double> times_;
};

}  // namespace padder::settle
