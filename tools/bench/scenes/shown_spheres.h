// SPDX-License-Identifier: GPL-3.0-or-later
// Spheres that change between the calls of a bench, and how their contacts are checked and calls are timed.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "tools/bench/bench.h"

namespace padder::bench {

// Spheres where a simulation would have them: always at the same place, on the GPU if there is one.
class ShownSpheres {
 public:
  // Has room for so many. Throws Error if they do not fit the GPU's memory.
  ShownSpheres(std::uint64_t most, bool on_device);
  ~ShownSpheres();
  ShownSpheres(const ShownSpheres&) = delete;
  ShownSpheres& operator=(const ShownSpheres&) = delete;

  void show(std::vector<detect::FloatSphere> spheres);
  const detect::Input& input() const { return input_; }
  detect::Input host_input() const { return input_of(spheres_); }

 private:
  std::vector<detect::FloatSphere> spheres_;
  void* device_ = nullptr;
  detect::Input input_;
};

// Are the contacts of the detector's last call, whose count is given, right? Throws Error, which names the
// scene, if not. The nine stages decide every pair in double, on a way of their own. They have bins of one
// size: where many small spheres lie in the bins of large ones (`crowds_nine_stages`), the processor's grid
// checks instead. Then the processor's own contacts are checked by nothing else.
struct Checked {
  std::string scene;
  bool crowds_nine_stages = false;
  double margin = 0;
};
void check_contacts(const detect::Detector& detector, std::uint64_t count, const detect::Input& input,
                    const detect::Input& on_host, const Checked& what);

struct Times {
  double median = 0, worst = 0;
  double processor = 0;  // median of the time that this process had one: other programs change it least
};
// Of so many calls, after eight more. `show(k)` comes before the k-th and is not timed.
Times timed(detect::Detector& detector, const detect::Input& input, int calls,
            const std::function<void(int)>& show = {});

}  // namespace padder::bench
