// SPDX-License-Identifier: MIT
// Are the answers of detect_worlds() those of the contacts? On the host or on the device.
#pragma once
#include <sstream>
#include <string>
#include <vector>

#include "tests/detect/device_memory.h"
#include "tests/detect/oracle.h"

namespace padder::detect {

// What went wrong with a call.
struct Wrong {
  std::string what;
};
template <class... Parts>
void require(bool good, const Parts&... parts) {
  if (good) return;
  std::ostringstream text;
  (text << ... << parts);
  throw Wrong{text.str()};
}

inline std::string text(const Pair& p) {
  return "(" + std::to_string(p.i) + ", " + std::to_string(p.j) + ")";
}

// The answers of detect_worlds(), from all contacts, which ascend.
inline void check_answers(const WorldAnswers& a, Answer asked, std::uint32_t worlds,
                          const std::vector<Seen>& spheres, const std::vector<Pair>& contacts) {
  std::vector<std::uint64_t> count(worlds, 0);
  std::vector<double> distance(worlds, INFINITY);
  std::vector<Pair> pair(worlds, {~0u, ~0u});
  for (const Pair& p : contacts) {
    const std::uint32_t w = std::min(spheres[p.i].world, spheres[p.j].world);
    if (w == kEveryWorld) continue;
    count[w]++;
    const double d = -geometry(spheres[p.i].sphere, spheres[p.j].sphere).depth;
    if (d < distance[w]) distance[w] = d, pair[w] = p;
  }
  require(a.worlds == worlds, "answers of ", a.worlds, " worlds, not ", worlds);
  const auto on_host = [&](const auto* from) {
    std::vector<std::decay_t<decltype(*from)>> all(worlds);
    if (worlds == 0) return all;
    require(from != nullptr, "an array of the answers is null");
    if (a.memory == Memory::device)
      copy_from_device(all.data(), from, worlds * sizeof(*from));
    else
      std::copy_n(from, worlds, all.begin());
    return all;
  };
  if (asked == Answer::any) {
    const auto any = on_host(a.any);
    for (std::uint32_t w = 0; w < worlds; w++)
      require(any[w] == (count[w] > 0), "world ", w, " has ", count[w], " contacts, and any is ",
              int(any[w]));
  }
  if (asked == Answer::count) {
    const auto counted = on_host(a.count);
    for (std::uint32_t w = 0; w < worlds; w++)
      require(counted[w] == count[w], "world ", w, " has ", count[w], " contacts, not ", counted[w]);
  }
  if (asked == Answer::distance) {
    const auto found = on_host(a.distance);
    const auto between = on_host(a.pair);
    for (std::uint32_t w = 0; w < worlds; w++) {
      require(found[w] == distance[w], "distance of world ", w, " is ", found[w], ", not ", distance[w]);
      require(between[w] == pair[w], "the pair of world ", w, " is ", text(between[w]), ", not ",
              text(pair[w]));
    }
  }
  require(asked == Answer::any || !a.any, "any, which nobody asked for");
  require(asked == Answer::count || !a.count, "count, which nobody asked for");
  require(asked == Answer::distance || (!a.distance && !a.pair), "distance, which nobody asked for");
}

}  // namespace padder::detect
