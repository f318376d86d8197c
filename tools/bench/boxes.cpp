// SPDX-License-Identifier: GPL-3.0-or-later
// Fig. 27 of the paper: time against the number of contacts on one and several GPUs, the spheres already on
// them, as in a simulation that runs there, or in pinned host memory. Without a GPU: boxes on the CPU.
#include "detect/boxes/boxed_detector.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "detect/boxes/resident_detector.h"
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

using detect::FloatSphere, detect::Spheres;
using Scene = std::vector<FloatSphere>;

constexpr std::uint64_t kMostChecked = 100000000;  // spheres; beyond, the CPU would take minutes

Spheres view(const FloatSphere* spheres, std::uint64_t count) {
  Spheres s = detect::spheres_of<float>(count, &spheres->x, &spheres->r);
  s.center_stride = s.radius_stride = 4;
  return s;
}

// A straight line through the points by least squares.
struct Line {
  double offset = 0, slope = 0, r2 = 1;
};
Line line_through(const std::vector<std::pair<double, double>>& points) {
  const double n = static_cast<double>(points.size());
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (const auto& [a, b] : points) x += a / n, y += b / n;
  for (const auto& [a, b] : points) xx += (a - x) * (a - x), xy += (a - x) * (b - y), yy += (b - y) * (b - y);
  Line line;
  if (xx > 0) line.slope = xy / xx;
  line.offset = y - line.slope * x;
  if (yy > 0 && xx > 0) line.r2 = xy * xy / (xx * yy);
  return line;
}

class Table {
 public:
  explicit Table(const Settings& s) : settings_(s) {}

  void add(const std::string& scene, const char* backend, std::size_t devices, std::uint64_t spheres,
           std::uint64_t contacts, const std::string& against, double resident, double pinned, double deal,
           double halo, double efficiency) {
    rows.push_back({{"scene", scene},
                    {"backend", backend},
                    {"devices", devices},
                    {"spheres", spheres},
                    {"contacts", contacts},
                    {"hash_compared_with", against},
                    {"seconds", resident},
                    {"seconds_pinned", pinned},
                    {"seconds_deal", deal},
                    {"halo", halo},
                    {"efficiency", efficiency}});
    const auto ms = [](double v) { return v > 0 ? number(v * 1e3, "%.2f") : std::string("-"); };
    table.push_back({scene, backend, std::to_string(devices), std::to_string(spheres),
                     std::to_string(contacts), against, ms(resident), ms(pinned), ms(deal),
                     number(100 * halo, "%.2f"), efficiency > 0 ? number(100 * efficiency, "%.0f") : "-"});
  }

  Json rows = Json::array();
  Json table =
      Json::array({{"scene", "backend", "devices", "spheres", "contacts", "hash is that of", "time [ms]",
                    "from pinned memory [ms]", "of it dealing [ms]", "halo [%]", "efficiency [%]"}});

 private:
  const Settings& settings_;
};

#ifdef PADDER_CUDA

int gpus() {
  int count = 0;
  return cudaGetDeviceCount(&count) == cudaSuccess ? count : 0;
}

void must(cudaError_t e, const char* what) {
  if (e != cudaSuccess) throw Error(std::string("CUDA failed to ") + what + ": " + cudaGetErrorString(e));
}

// Parts of a scene, one for each GPU, that lie one after the other in host memory, and copies on the GPUs.
class Parts {
 public:
  // Each part has the spheres of its GPU's box; before there are boxes, equal numbers of spheres.
  Parts(const Scene& scene, const detect::ResidentDetector& detector, bool boxes) : all_(scene.size()) {
    const std::size_t n = detector.devices();
    std::vector<std::uint64_t> first(n + 1, 0);
    if (!boxes) {
      all_ = scene;
      for (std::size_t k = 0; k <= n; k++) first[k] = scene.size() * k / n;
    } else {
      std::vector<std::uint8_t> box(scene.size());
      for (std::size_t k = 0; k < scene.size(); k++) {
        const FloatSphere& s = scene[k];
        for (std::size_t b = 0; b < n; b++)
          if (owns(detector.region(b), {s.x, s.y, s.z})) box[k] = static_cast<std::uint8_t>(b);
        first[box[k] + 1u]++;
      }
      for (std::size_t b = 0; b < n; b++) first[b + 1] += first[b];
      std::vector<std::uint64_t> next(first.begin(), first.end() - 1);
      for (std::size_t k = 0; k < scene.size(); k++) all_[next[box[k]]++] = scene[k];
    }
    for (std::size_t k = 0; k < n; k++) host.push_back(view(all_.data() + first[k], first[k + 1] - first[k]));
  }
  ~Parts() {
    for (std::size_t k = 0; k < copies_.size(); k++) cudaSetDevice(static_cast<int>(k)), cudaFree(copies_[k]);
    if (pinned_) cudaHostUnregister(all_.data());
    cudaSetDevice(0);
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  void copy_to_gpus() {
    for (std::size_t k = 0; k < host.size(); k++) {
      const std::size_t bytes = host[k].count * sizeof(FloatSphere);
      must(cudaSetDevice(static_cast<int>(k)), "choose a GPU");
      must(cudaMalloc(&copies_.emplace_back(nullptr), bytes + 16), "allocate the spheres");
      must(cudaMemcpy(copies_[k], host[k].centers, bytes, cudaMemcpyHostToDevice), "copy the spheres");
      must(cudaDeviceSynchronize(), "copy the spheres");
      Spheres s = host[k];
      s.memory = detect::Memory::device;
      s.centers = copies_[k], s.radii = static_cast<const float*>(copies_[k]) + 3;
      device.push_back(s);
    }
    cudaSetDevice(0);
  }
  void pin() {
    must(cudaHostRegister(all_.data(), all_.size() * sizeof(FloatSphere), cudaHostRegisterPortable),
         "pin the spheres");
    pinned_ = true;
  }
  const Scene& all() const { return all_; }

  std::vector<Spheres> host, device;

 private:
  Scene all_;
  std::vector<void*> copies_;
  bool pinned_ = false;
};

detect::ResidentOptions options_for(int devices) {
  detect::ResidentOptions o;
  o.detector.order = detect::Order::any, o.detector.timings = false;
  for (int k = 0; k < devices; k++) o.devices.push_back(k);
  return o;
}

// What the hash was compared with; throws Error where it differs.
std::string compare(const Scene& scene, std::uint64_t hash, std::size_t devices) {
  std::string against;
  const auto expect = [&](std::uint64_t other, const char* name) {
    if (other != hash)
      throw Error("the contacts of " + std::to_string(devices) + " GPUs differ from those of " + name);
    against += (against.empty() ? "" : ", ") + std::string(name);
  };
  if (devices > 1) {
    try {
      detect::ResidentDetector one(options_for(1));
      const Spheres all[1] = {view(scene.data(), scene.size())};
      one.detect(all);
      expect(one.hash(), "one GPU");
    } catch (const Error& e) {
      if (std::string(e.what()).find("differ") != std::string::npos) throw;  // else it does not fit
    }
  }
  if (scene.size() <= kMostChecked) {
    detect::CallOptions o;
    o.width = detect::Width::pairs;
    detect::Detector cpu(detect::DeviceChoice{detect::BackendKind::omp}, o);
    detect::Input input;
    input.spheres = view(scene.data(), scene.size());
    cpu.detect(input);
    expect(cpu.hash(), "the CPU");
  }
  return against.empty() ? "nothing" : against;
}

void dense_row(const Settings& s, Table& t, const Scene& scene, int devices) {
  say(s, "dense " + std::to_string(scene.size()) + " on " + std::to_string(devices));
  detect::ResidentDetector detector(options_for(devices));
  std::unique_ptr<Parts> parts = std::make_unique<Parts>(scene, detector, false);
  const int repeat = std::max(s.repeat, 5);
  if (devices > 1) {
    parts->copy_to_gpus();
    for (int k = 0; k < 2; k++) detector.detect(parts->device);
    parts = nullptr;
    parts =
        std::make_unique<Parts>(scene, detector, true);  // the simulation has moved each sphere to its box
  }
  parts->copy_to_gpus();
  double deal = 0;
  for (int k = 0; k < 2; k++) detector.detect(parts->device);
  const double resident = median_seconds(repeat, [&] {
    detector.detect(parts->device);
    deal = detector.report().deal_seconds;
  });
  const detect::ResidentReport r = detector.report();
  const std::uint64_t hash = detector.hash();
  parts->pin();
  const double pinned = median_seconds(3, [&] { detector.detect(parts->host); });
  const Scene order = parts->all();
  parts = nullptr;
  detector = detect::ResidentDetector(options_for(devices));  // gives its memory back
  const double halo = static_cast<double>(r.copies) / static_cast<double>(r.spheres) - 1;
  t.add("dense", "cuda", static_cast<std::size_t>(devices), r.spheres, r.contacts,
        compare(order, hash, static_cast<std::size_t>(devices)), resident, pinned, deal,
        devices > 1 ? halo : 0, 0);
}

// Half of the cube ten times as dense as the rest: at rest, or a front that crosses the cube in `steps`.
Scene front(const Scene& full, double middle, double width) {
  float edge = 0;
  for (const FloatSphere& s : full) edge = std::max(edge, s.x);
  Scene some;
  for (std::size_t k = 0; k < full.size(); k++) {
    const double from = std::abs(full[k].x / edge - middle);
    if (std::min(from, 1 - from) < width / 2 || detect::mixed(k) % 10 == 0) some.push_back(full[k]);
  }
  return some;
}

void front_rows(const Settings& s, Table& t, const Scene& full, int devices, bool moves) {
  constexpr int kSteps = 12;
  const char* const name = moves ? "moving front" : "10 : 1";
  say(s, std::string(name) + " on " + std::to_string(devices));
  detect::ResidentDetector one(options_for(1)), several(options_for(devices));
  double alone = 0, together = 0, deal = 0;
  std::uint64_t contacts = 0, spheres = 0, copies = 0;
  for (int step = -3; step < kSteps; step++) {
    const Scene scene = front(full, moves ? 0.5 + 0.5 / kSteps * std::max(step, 0) : 0.25, 0.5);
    Parts parts(scene, several, step > -3);
    parts.copy_to_gpus();
    Parts whole(parts.all(), one, false);
    whole.copy_to_gpus();
    const double first = seconds_of([&] { one.detect(whole.device); });
    const double second = seconds_of([&] { several.detect(parts.device); });
    if (one.hash() != several.hash())
      throw Error(std::string("the contacts of the ") + name + " differ from those of one GPU");
    if (step < 0) continue;
    const detect::ResidentReport& r = several.report();
    alone += first, together += second, deal += r.deal_seconds;
    contacts += r.contacts, spheres += r.spheres, copies += r.copies;
  }
  t.add(name, "cuda", static_cast<std::size_t>(devices), spheres / kSteps, contacts / kSteps, "one GPU",
        together / kSteps, 0, deal / kSteps, static_cast<double>(copies) / static_cast<double>(spheres) - 1,
        alone / (devices * together));
}

void gpu_rows(const Settings& s, Table& t) {
  std::vector<std::uint64_t> sizes = s.spheres;
  if (sizes.empty()) sizes = {28750000, 57500000, 115000000, 230000000};
  for (const std::uint64_t n : sizes) {
    if (!s.scene.empty() && s.scene != "dense") break;
    const Scene scene = detect::generate("dense", n, false);
    for (int devices = 1; devices <= gpus(); devices *= 2) dense_row(s, t, scene, devices);
  }
  if (!s.scene.empty() && s.scene != "front") return;
  const Scene full = detect::generate("dense", s.spheres.empty() ? 100000000 : s.spheres[0], false);
  for (int devices = 2; devices <= gpus(); devices *= 2)
    for (const bool moves : {false, true}) front_rows(s, t, full, devices, moves);
}

#else
int gpus() { return 0; }
void gpu_rows(const Settings&, Table&) {}
#endif

void cpu_rows(const Settings& s, Table& t) {
  std::vector<std::uint64_t> sizes = s.spheres;
  if (sizes.empty()) sizes = {250000, 500000, 1000000, 2000000};
  for (const std::uint64_t n : sizes) {
    const Scene scene = detect::generate("dense", n, false);
    detect::Input input;
    input.spheres = view(scene.data(), scene.size());
    detect::BoxOptions o;
    o.detector.threads = s.threads;
    o.devices = {{detect::BackendKind::omp, 0}};
    detect::Detector one(o.devices[0], o.detector);
    one.detect(input);
    for (const std::uint32_t boxes : {1u, 8u}) {
      say(s, "dense " + std::to_string(n) + " in " + std::to_string(boxes) + " boxes on the CPU");
      o.boxes = boxes;
      detect::BoxedDetector boxed(o);
      const double seconds = median_seconds(std::max(s.repeat, 3), [&] { boxed.detect(input, {}); });
      const detect::BoxReport& r = boxed.report();
      if (r.hash != one.hash()) throw Error("the contacts of boxes differ from those of one detector");
      t.add("dense", boxes == 1 ? "omp, 1 box" : "omp, 8 boxes", 1, n, r.contacts, "one detector", seconds, 0,
            r.cut_seconds + r.copy_seconds,
            static_cast<double>(r.copies) / static_cast<double>(r.spheres) - 1, 0);
    }
  }
}

// The straight line of each backend and number of devices, and its scaling against one device.
Json lines_of(const Json& rows) {
  std::map<std::pair<std::string, std::uint64_t>, std::vector<std::pair<double, double>>> points;
  for (const Json& r : rows)
    if (r["scene"] == "dense") points[{r["backend"], r["devices"]}].push_back({r["contacts"], r["seconds"]});
  Json lines = Json::array();
  for (const auto& [key, of] : points) {
    const Line line = line_through(of);
    lines.push_back({{"backend", key.first},
                     {"devices", key.second},
                     {"seconds_at_0", line.offset},
                     {"ns_a_contact", line.slope * 1e9},
                     {"r2", line.r2}});
  }
  return lines;
}

}  // namespace

Json boxes(const Settings& s) {
  if (!s.scene.empty() && s.scene != "dense" && s.scene != "front")
    throw Error("boxes has the scenes dense and front");
  Table t(s);
  const bool cuda = s.backend != "omp" && gpus() > 0;
  if (s.backend == "cuda" && !cuda) throw Error("there is no GPU that CUDA can use: choose omp");
  if (cuda)
    gpu_rows(s, t);
  else
    cpu_rows(s, t);
  const Json lines = lines_of(t.rows);
  for (const Json& line : lines)
    t.table.push_back({"line", line["backend"], std::to_string(line["devices"].get<int>()), "-", "-", "-",
                       number(line["seconds_at_0"].get<double>() * 1e3, "%.2f") + " ms + " +
                           number(line["ns_a_contact"], "%.4f") + " ns a contact",
                       "R^2 " + number(line["r2"], "%.4f")});
  Json result = {{"bench", "boxes"},     {"record", "i, j, normal, depth in float"},
                 {"machine", machine()}, {"device", device_name()},
                 {"gpus", gpus()},       {"threads", s.threads},
                 {"rows", t.rows},       {"lines", lines},
                 {"table", t.table}};
  write_result(s, result);
  return result;
}

}  // namespace padder::bench
