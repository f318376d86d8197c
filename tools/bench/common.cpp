// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string_view>
#include <thread>

#include "detect/core/backend.h"
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/cli.h"
#include "tools/watchdog.h"

namespace padder::bench {

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

double median_seconds(int repeat, const std::function<void()>& work) {
  work();
  std::vector<double> times;
  for (int k = 0; k < repeat; k++) times.push_back(seconds_of(work));
  return median(times);
}

void say(const Settings& s, const std::string& sentence) {
  if (!s.quiet) std::fprintf(stderr, "bench: %s\n", sentence.c_str());
}

const detect::Contacts& detect_watched(detect::Detector& detector, const detect::Input& input) {
  double seconds = 60;
  if (std::string_view(detector.backend()) == "omp") {
    std::uint64_t largest = 0;  // body
    for (const detect::Shape& shape : input.shapes) largest = std::max(largest, shape.count);
    seconds += 1e-6 * static_cast<double>(input.spheres.count + largest * input.bodies.size());
  }
  const Watchdog limit("bench: detect", seconds);
  return detector.detect(input);
}

std::uint64_t hash_watched(const detect::Detector& detector) {
  const Watchdog limit("bench: hash");
  return detector.hash();
}

void wrong_usage(const std::string& sentence) { throw cli::UsageError(sentence); }

void check_scene(const Settings& s, const char* bench, std::vector<std::string> names) {
  if (s.scene.empty() || std::find(names.begin(), names.end(), s.scene) != names.end()) return;
  wrong_usage("--scene of " + std::string(bench) + " is one of " + cli::listed(names) + ", not " +
              cli::in_quotes(s.scene));
}

std::vector<detect::BackendKind> backends(const Settings& s) {
  const std::string absence = s.backend == "omp" ? "omp alone is asked for" : detect::cuda_absence(0);
  if (s.backend == "cuda" && !absence.empty()) throw Error(absence);
  std::vector<detect::BackendKind> found;
  if (s.backend != "cuda") found.push_back(detect::BackendKind::omp);
  if (absence.empty()) found.push_back(detect::BackendKind::cuda);
  return found;
}

const char* name_of(detect::BackendKind backend) {
  return backend == detect::BackendKind::cuda ? "cuda" : "omp";
}

std::vector<std::uint64_t> sizes_or(const Settings& s, std::vector<std::uint64_t> own) {
  return s.spheres.empty() ? own : s.spheres;
}
std::uint64_t size_or(const Settings& s, std::uint64_t own) { return sizes_or(s, {own})[0]; }

detect::Spheres view_of(const detect::FloatSphere* spheres, std::uint64_t count) {
  detect::Spheres s = detect::spheres_of<float>(count, &spheres->x, &spheres->r);
  s.center_stride = s.radius_stride = 4;
  return s;
}

detect::Input input_of(const std::vector<detect::FloatSphere>& spheres) {
  detect::Input input;
  if (!spheres.empty()) input.spheres = view_of(spheres.data(), spheres.size());
  return input;
}

std::vector<detect::Pair> plain_grid(const std::vector<detect::FloatSphere>& spheres) {
  std::vector<detect::Pair> pairs;
  if (spheres.empty()) return pairs;
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, radius = 0;
  for (const auto& s : spheres) {
    const double c[3] = {s.x, s.y, s.z};
    for (int k = 0; k < 3; k++) low[k] = std::min(low[k], c[k]), high[k] = std::max(high[k], c[k]);
    radius = std::max<double>(radius, s.r);
  }
  const double size = 2 * radius * (1 + 1e-9);
  std::int64_t side[3];
  for (int k = 0; k < 3; k++) side[k] = static_cast<std::int64_t>((high[k] - low[k]) / size) + 1;
  const auto bin = [&](double v, int k) {
    return std::min(static_cast<std::int64_t>((v - low[k]) / size), side[k] - 1);
  };
  const std::size_t n = spheres.size();
  std::vector<std::int64_t> bins(n);
  std::vector<std::uint32_t> start(static_cast<std::size_t>(side[0] * side[1] * side[2]) + 1, 0), order(n);
  for (std::size_t i = 0; i < n; i++) {
    bins[i] = bin(spheres[i].x, 0) + side[0] * (bin(spheres[i].y, 1) + side[1] * bin(spheres[i].z, 2));
    start[static_cast<std::size_t>(bins[i]) + 1]++;
  }
  for (std::size_t b = 1; b < start.size(); b++) start[b] += start[b - 1];
  std::vector<std::uint32_t> at(start.begin(), start.end() - 1);
  for (std::size_t i = 0; i < n; i++)
    order[at[static_cast<std::size_t>(bins[i])]++] = static_cast<std::uint32_t>(i);
  for (std::size_t i = 0; i < n; i++) {
    const auto& a = spheres[i];
    const std::int64_t x = bin(a.x, 0), y = bin(a.y, 1), z = bin(a.z, 2);
    for (std::int64_t bz = std::max<std::int64_t>(z - 1, 0); bz <= std::min(z + 1, side[2] - 1); bz++)
      for (std::int64_t by = std::max<std::int64_t>(y - 1, 0); by <= std::min(y + 1, side[1] - 1); by++) {
        const std::int64_t row = side[0] * (by + side[1] * bz);
        const auto first = static_cast<std::size_t>(row + std::max<std::int64_t>(x - 1, 0));
        const auto last = static_cast<std::size_t>(row + std::min(x + 1, side[0] - 1));
        for (std::uint32_t k = start[first]; k < start[last + 1]; k++) {
          const std::uint32_t j = order[k];
          if (j <= i) continue;
          const auto& b = spheres[j];
          const double dx = double(b.x) - a.x, dy = double(b.y) - a.y, dz = double(b.z) - a.z,
                       s = double(a.r) + b.r;
          if (dx * dx + dy * dy + dz * dz <= s * s) pairs.push_back({static_cast<std::uint32_t>(i), j});
        }
      }
  }
  return pairs;
}

std::uint64_t hash_of(const std::vector<detect::Pair>& pairs) {
  std::uint64_t sum = 0;
  for (const detect::Pair& p : pairs) sum += detect::pair_hash(p.i, p.j);
  return sum;
}

FittedLine fitted_line(const Points& points) {
  const double n = static_cast<double>(points.size());
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (const auto& [a, b] : points) x += a / n, y += b / n;
  for (const auto& [a, b] : points) xx += (a - x) * (a - x), xy += (a - x) * (b - y), yy += (b - y) * (b - y);
  FittedLine line;
  if (xx > 0) line.slope = xy / xx;
  line.offset = y - line.slope * x;
  if (yy > 0 && xx > 0) line.r2 = xy * xy / (xx * yy);
  return line;
}

std::string machine() {
  std::string name = "unknown processor";
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("model name")) {
      name = line.substr(line.find(':') + 2);
      break;
    }
  return name + ", " + std::to_string(std::thread::hardware_concurrency()) + " hardware threads";
}

std::string number(double value, const char* format) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace padder::bench
