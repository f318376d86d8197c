// SPDX-License-Identifier: MIT
// A run as one HTML file that plays: it needs neither a network nor another program than a browser.
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tools/settle/stepper.h"

namespace padder::settle {

// Which of these points are not hidden by the others from somebody who looks from the sides or from above.
// Space is divided into cells of about three points. The air is what can be reached from the sides and from
// above through empty cells, and a point is hidden if none of the 125 cells around it is air. Time linear in
// the points.
std::vector<bool> seen_from_outside(std::span<const Vec3> points);

// Collects frames. A page holds of each sphere its place in the first frame and by how much it moves from
// frame to frame, along each axis in steps of a 64th of the smallest radius (or, if that is longer, of 2^-16
// of the box of first and last frame), all compressed: what rests takes no room. Of a scene of more than
// 50,000 spheres a page leaves out what is hidden in all frames, but nothing that is large.
class Movie {
 public:
  // How many frames a page of so many spheres has if nobody says: 100, fewer from a million spheres on, so
  // that frames take at most 1.5 GB while they are collected.
  static std::uint64_t usual_frames(std::uint64_t spheres);

  // Takes where the spheres of `stepper` are now (placed()).
  void add(const Stepper& stepper);
  std::size_t frames() const { return times_.size(); }
  // What a page shows, and its size.
  struct Written {
    std::uint64_t frames = 0, spheres = 0, bytes = 0;
  };
  // How large a page becomes if nobody says how many frames it has.
  static constexpr std::uint64_t kUsualBytes = 30'000'000;
  // A page that is larger than `usual` has every second frame only, or every fourth, and so on; the last
  // frame always. usual = 0: all frames. Throws Error if there are no frames, if they are more than a page
  // can hold (512 MB), or if the file cannot be written.
  Written write(const std::string& title, const System& system, const std::filesystem::path& path,
                std::uint64_t usual = 0) const;

 private:
  struct Box;
  std::vector<std::uint32_t> spheres_to_show(const System& system) const;
  Box box_of(const System& system, std::span<const std::uint32_t> shown) const;
  std::vector<std::string> packed(const Box& box, std::span<const std::uint32_t> shown,
                                  std::size_t stride) const;

  std::vector<std::vector<float>> centers_;
  std::vector<double> times_;
  std::vector<bool> seen_;  // movers, in a frame so far; empty: all
};

}  // namespace padder::settle
