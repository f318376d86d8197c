// SPDX-License-Identifier: GPL-3.0-or-later
// Fig. 27 of the paper: time against the number of contacts on one and several GPUs, the spheres already on
// them, as in a simulation that runs there, or in pinned host memory. Without a GPU: boxes on the CPU.
#include "detect/boxes/boxed_detector.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <span>

#include "detect/boxes/resident_detector.h"
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"

namespace padder::bench {
namespace {

using detect::FloatSphere, detect::Spheres;
using Scene = std::vector<FloatSphere>;

// Appends the spheres k of `from` for which keep(k), in their order.
template <class Keep>
void append(const Scene& from, const Keep& keep, Scene& to) {
  constexpr std::size_t kBlock = 1 << 18;
  const std::size_t blocks = (from.size() + kBlock - 1) / kBlock;
  std::vector<std::size_t> first(blocks + 1, to.size());
  const auto each_kept = [&](std::size_t block, const auto& use) {
    for (std::size_t k = block * kBlock; k < std::min(from.size(), (block + 1) * kBlock); k++)
      if (keep(k)) use(k);
  };
#pragma omp parallel for schedule(dynamic)
  for (std::size_t b = 0; b < blocks; b++) {
    std::size_t count = 0;
    each_kept(b, [&](std::size_t) { count++; });
    first[b + 1] = count;
  }
  for (std::size_t b = 0; b < blocks; b++) first[b + 1] += first[b];
  to.resize(first[blocks]);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t b = 0; b < blocks; b++) {
    std::size_t place = first[b];
    each_kept(b, [&](std::size_t k) { to[place++] = from[k]; });
  }
}

class Table {
 public:
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
};

#ifdef PADDER_CUDA

constexpr std::uint64_t kMostChecked = 100000000;  // spheres; beyond, the CPU would take minutes

// Parts of a scene, one for each GPU, that lie one after the other in host memory.
class Parts {
 public:
  ~Parts() {
    if (pinned_) cudaHostUnregister(all_.data());
  }
  Parts() = default;
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  // Each part gets equal numbers of spheres.
  void share(const Scene& scene, const detect::ResidentDetector& detector) {
    all_ = scene;
    std::vector<std::uint64_t> first;
    for (std::size_t k = 0; k <= detector.devices(); k++)
      first.push_back(scene.size() * k / detector.devices());
    make_views(first);
  }
  // Each part gets the spheres of its GPU's box.
  void share_by_box(const Scene& scene, const detect::ResidentDetector& detector) {
    const std::size_t n = detector.devices();
    std::vector<std::uint8_t> box(scene.size());
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < scene.size(); k++) {
      const FloatSphere& s = scene[k];
      for (std::size_t b = 0; b < n; b++)
        if (owns(detector.region(b), {s.x, s.y, s.z})) box[k] = static_cast<std::uint8_t>(b);
    }
    std::vector<std::uint64_t> first(n + 1, 0);
    all_.clear(), all_.reserve(scene.size());
    for (std::size_t b = 0; b < n; b++) {
      append(
          scene, [&](std::size_t k) { return box[k] == b; }, all_);
      first[b + 1] = all_.size();
    }
    make_views(first);
  }
  void pin() {
    must(cudaHostRegister(all_.data(), all_.size() * sizeof(FloatSphere), cudaHostRegisterPortable),
         "pin the spheres");
    pinned_ = true;
  }
  const Scene& all() const { return all_; }
  const std::vector<Spheres>& views() const { return views_; }

 private:
  void make_views(const std::vector<std::uint64_t>& first) {
    views_.clear();
    for (std::size_t k = 0; k + 1 < first.size(); k++)
      views_.push_back(view_of(all_.data() + first[k], first[k + 1] - first[k]));
  }

  Scene all_;
  std::vector<Spheres> views_;
  bool pinned_ = false;
};

// Copies of the parts, one on each GPU.
void put_on_gpus(std::span<const Spheres> parts, OnGpus& there) {
  for (std::size_t k = 0; k < parts.size(); k++)
    k < there.parts().size() ? there.put(k, parts[k]) : there.add(static_cast<int>(k), parts[k]);
}
std::unique_ptr<OnGpus> on_gpus(std::span<const Spheres> parts) {
  auto there = std::make_unique<OnGpus>();
  put_on_gpus(parts, *there);
  return there;
}

detect::ResidentOptions options_for(int devices) {
  detect::ResidentOptions o;
  o.detector.order = detect::Order::any, o.detector.timings = false;
  for (int k = 0; k < devices; k++) o.devices.push_back(k);
  return o;
}

// What the hash was compared with; throws Error where it differs.
std::string compare(const Scene& scene, std::uint64_t hash, const std::string& what, bool with_one_gpu) {
  std::string against;
  const auto expect = [&](std::uint64_t other, const char* name) {
    if (other != hash) throw Error("the contacts of " + what + " differ from those of " + name);
    against += (against.empty() ? "" : ", ") + std::string(name);
  };
  if (with_one_gpu) {
    try {
      detect::ResidentDetector one(options_for(1));
      const Spheres all[1] = {input_of(scene).spheres};
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
    const detect::Input input = input_of(scene);
    cpu.detect(input);
    expect(cpu.hash(), "the CPU");
  }
  if (against.empty()) {
    detect::BoxOptions o;
    o.devices = detect::all_devices(), o.boxes = 4 * static_cast<std::uint32_t>(o.devices.size());
    o.detector.order = detect::Order::any, o.detector.width = detect::Width::pairs;
    const detect::Input input = input_of(scene);
    expect(detect::BoxedDetector(o).detect(input, {}).hash, "boxes from host memory");
  }
  return against;
}

void row(const Settings& s, Table& t, const std::string& name, const Scene& scene, int devices) {
  say(s, name + " " + std::to_string(scene.size()) + " on " + std::to_string(devices));
  detect::ResidentDetector detector(options_for(devices));
  Parts parts;
  parts.share(scene, detector);
  const int repeat = std::max(s.repeat, 5);
  if (devices > 1) {
    const auto there = on_gpus(parts.views());
    for (int k = 0; k < 2; k++) detector.detect(there->parts());
    parts.share_by_box(scene, detector);  // the simulation has moved each sphere to its box
  }
  auto there = on_gpus(parts.views());
  double deal = 0;
  for (int k = 0; k < 2; k++) detector.detect(there->parts());
  const double resident = median_seconds(repeat, [&] {
    detector.detect(there->parts());
    deal = detector.report().deal_seconds;
  });
  const detect::ResidentReport r = detector.report();
  const std::uint64_t hash = detector.hash();
  there.reset();
  parts.pin();
  const double pinned = median_seconds(3, [&] { detector.detect(parts.views()); });
  detector = detect::ResidentDetector(options_for(devices));  // gives its memory back
  const double halo = static_cast<double>(r.copies) / static_cast<double>(r.spheres) - 1;
  t.add(name, "cuda", static_cast<std::size_t>(devices), r.spheres, r.contacts,
        compare(parts.all(), hash, std::to_string(devices) + " GPUs", devices > 1), resident, pinned, deal,
        devices > 1 ? halo : 0, 0);
}

// The poses of bodies on GPUs, those of bodies[cuts[k]] to bodies[cuts[k + 1]] on GPU k.
class PosesOnGpus {
 public:
  PosesOnGpus(std::span<const detect::Body> bodies, const std::vector<std::uint64_t>& cuts) {
    for (std::size_t k = 0; k + 1 < cuts.size(); k++) {
      std::vector<detect::Pose> poses;
      for (const detect::Body& b : bodies.subspan(cuts[k], cuts[k + 1] - cuts[k]))
        poses.push_back(pose_of(b));
      const std::size_t bytes = poses.size() * sizeof(detect::Pose);
      must(cudaSetDevice(static_cast<int>(k)), "choose a GPU");
      must(cudaMalloc(&copies_.emplace_back(nullptr), bytes + 1), "allocate the poses");
      must(cudaMemcpy(copies_.back(), poses.data(), bytes, cudaMemcpyHostToDevice), "copy the poses");
      must(cudaDeviceSynchronize(), "copy the poses");
      parts.push_back({static_cast<const detect::Pose*>(copies_.back()), poses.size()});
    }
  }
  PosesOnGpus(const PosesOnGpus&) = delete;
  ~PosesOnGpus() {
    for (std::size_t k = 0; k < copies_.size(); k++) cudaSetDevice(static_cast<int>(k)), cudaFree(copies_[k]);
  }
  std::vector<detect::ResidentPoses> parts;

 private:
  std::vector<void*> copies_;
};

// Sorts bodies by the box in which they are. Returns where each box's begin, and the end.
std::vector<std::uint64_t> sort_by_box(std::vector<detect::Body>& bodies,
                                       const detect::ResidentDetector& detector) {
  std::vector<std::vector<detect::Body>> of_box(detector.devices());
  for (const detect::Body& b : bodies)
    for (std::size_t k = 0; k < of_box.size(); k++)
      if (owns(detector.region(k), {b.position[0], b.position[1], b.position[2]})) of_box[k].push_back(b);
  bodies.clear();
  std::vector<std::uint64_t> cuts = {0};
  for (const auto& some : of_box)
    bodies.insert(bodies.end(), some.begin(), some.end()), cuts.push_back(bodies.size());
  return cuts;
}

// Bodies of 64 spheres, each pose on the GPU of the box where the body is, as in a stepping simulation.
void body_row(const Settings& s, Table& t, std::uint64_t count, int devices) {
  say(s, std::to_string(count) + " bodies on " + std::to_string(devices));
  detect::BodyScene scene = detect::generate_bodies(count);
  const detect::Shape shape{scene.shape.data(), scene.shape.size()};
  detect::Input input;
  input.shapes = {&shape, 1}, input.bodies = scene.bodies, input.revision = 1;
  const std::vector<Spheres> none(static_cast<std::size_t>(devices));
  detect::ResidentDetector detector(options_for(devices));
  for (int k = 0; k < 8; k++) detector.detect(none, input);  // until the cut stays as it is
  const std::vector<std::uint64_t> cuts = sort_by_box(scene.bodies, detector);
  const PosesOnGpus poses(scene.bodies, cuts);
  input.bodies = scene.bodies, input.revision = 2;
  for (int k = 0; k < 8; k++) detector.detect(none, input, poses.parts);
  const double seconds =
      median_seconds(std::max(s.repeat, 5), [&] { detector.detect(none, input, poses.parts); });
  const detect::ResidentReport r = detector.report();
  const std::uint64_t hash = detector.hash();
  detector = detect::ResidentDetector(options_for(devices));  // gives its memory back
  detect::Detector host(
      detect::DeviceChoice{devices > 1 ? detect::BackendKind::cuda : detect::BackendKind::omp},
      options_for(1).detector);
  host.detect(input);
  if (host.hash() != hash)
    throw Error("the contacts of the bodies differ from those of " +
                std::string(devices > 1 ? "one GPU" : "the CPU"));
  t.add("bodies of 64", "cuda", static_cast<std::size_t>(devices), r.spheres, r.contacts,
        devices > 1 ? "one GPU" : "the CPU", seconds, 0, r.deal_seconds, 0, 0);
}

// What the driver takes to copy the spheres to a GPU, piece by piece to the same place.
double copy_seconds(const Scene& scene) {
  constexpr std::size_t kPiece = 1 << 30;
  const std::size_t bytes = scene.size() * sizeof scene[0];
  void* device = nullptr;
  must(cudaMalloc(&device, std::min(bytes, kPiece)), "allocate the spheres");
  const double seconds = median_seconds(3, [&] {
    for (std::size_t at = 0; at < bytes; at += kPiece)
      must(cudaMemcpy(device, reinterpret_cast<const char*>(scene.data()) + at, std::min(kPiece, bytes - at),
                      cudaMemcpyHostToDevice),
           "copy the spheres");
  });
  cudaFree(device);
  return seconds;
}

// What the scene leaves of the machine's memory, less an eighth.
std::uint64_t memory_beside(const Scene& scene) {
  const auto all = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                   static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  const std::uint64_t used = scene.size() * sizeof scene[0];
  return all > used ? (all - used) / 8 * 7 : 1;
}

// More than the memory of a GPU: spheres in host memory, box by box through one GPU whose detector may hold
// 20 bytes for three spheres, about a twentieth of what it would need for all of them. Contacts are counted
// and hashed. The same with half of that has other boxes, and must give the same.
void out_of_core_row(const Settings& s, Table& t, const Scene& scene) {
  const std::uint64_t limit = 20 * scene.size() / 3;
  say(s, "out of core, " + std::to_string(scene.size()) + " through " + std::to_string(limit) + " bytes");
  const double copy = copy_seconds(scene);
  say(s, "the driver copies them in " + number(copy, "%.3f") + " s");
  const detect::Input input = input_of(scene);
  detect::BoxOptions o;
  o.devices = {{detect::BackendKind::cuda, 0}};
  o.detector.order = detect::Order::any, o.detector.memory_limit = limit;
  o.memory_limit = memory_beside(scene);
  detect::BoxReport r, half;
  double seconds = 0;
  {
    detect::BoxedDetector boxed(o);
    boxed.detect(input, {});
    seconds = median_seconds(3, [&] { boxed.detect(input, {}); });
    r = boxed.report();
  }
  say(s, std::to_string(r.boxes) + " boxes: cut " + number(r.cut_seconds, "%.2f") + " s, copy " +
             number(r.copy_seconds, "%.2f") + " s, detect " + number(r.detect_seconds, "%.2f") + " s");
  {
    o.detector.memory_limit = limit / 2;
    detect::BoxedDetector boxed(o);
    half = boxed.detect(input, {});
  }
  if (half.hash != r.hash || half.contacts != r.contacts)
    throw Error("the contacts by boxes of half the memory differ");
  const std::string against =
      std::to_string(half.boxes) + " boxes, " + compare(scene, r.hash, "the boxes", true);
  t.add("out of core", "cuda", 1, r.spheres, r.contacts, against, seconds, 0, r.cut_seconds + r.copy_seconds,
        static_cast<double>(r.copies) / static_cast<double>(r.spheres) - 1, copy / seconds);
}

// The same without a limit: a call that copies the spheres itself, beside what the driver takes to copy them.
// The list stays on the GPU.
void host_row(const Settings& s, Table& t, const Scene& scene) {
  say(s, "the driver copies " + std::to_string(scene.size()) + " spheres in " +
             number(1e3 * copy_seconds(scene), "%.1f") + " ms");
  const detect::Input input = input_of(scene);
  detect::CallOptions o;
  o.order = detect::Order::any, o.output = detect::Memory::device;
  detect::Detector detector(detect::DeviceChoice{detect::BackendKind::cuda}, o);
  detector.detect(input);
  const double seconds = median_seconds(9, [&] { detector.detect(input); });
  const std::uint64_t contacts = detector.detect(input).count, hash = detector.hash();
  detector = detect::Detector(detect::DeviceChoice{detect::BackendKind::omp});  // gives its memory back
  t.add("from the host", "cuda", 1, scene.size(), contacts, compare(scene, hash, "the call", true), seconds,
        0, 0, 0, 0);
}

// Half of the cube ten times as dense as the rest: at rest, or a front that crosses the cube in `steps`.
void make_front(const Scene& full, double middle, double width, Scene& some) {
  float edge = 0;
  std::vector<std::uint8_t> in(full.size());
#pragma omp parallel
  {
#pragma omp for schedule(static) reduction(max : edge)
    for (std::size_t k = 0; k < full.size(); k++) edge = std::max(edge, full[k].x);
#pragma omp for schedule(static)
    for (std::size_t k = 0; k < full.size(); k++) {
      const double from = std::abs(full[k].x / edge - middle);
      in[k] = std::min(from, 1 - from) < width / 2 || detect::mixed(k) % 10 == 0;
    }
  }
  some.clear();
  append(
      full, [&](std::size_t k) { return in[k] != 0; }, some);
}

void front_rows(const Settings& s, Table& t, const Scene& full, int devices, bool moves) {
  constexpr int kSteps = 12;
  const char* const name = moves ? "moving front" : "10 : 1";
  say(s, std::string(name) + " on " + std::to_string(devices));
  detect::ResidentDetector one(options_for(1)), several(options_for(devices));
  double alone = 0, together = 0, deal = 0;
  std::uint64_t contacts = 0, spheres = 0, copies = 0;
  Scene scene;
  Parts parts;
  OnGpus whole, divided;
  for (int step = -3; step < kSteps; step++) {
    if (moves || step < 0) {
      make_front(full, moves ? 0.5 + 0.5 / kSteps * std::max(step, 0) : 0.25, 0.5, scene);
      step > -3 ? parts.share_by_box(scene, several) : parts.share(scene, several);
      put_on_gpus(parts.views(), divided);
      const Spheres all[1] = {input_of(parts.all()).spheres};
      put_on_gpus(all, whole);
    }
    const double first = seconds_of([&] { one.detect(whole.parts()); });
    const double second = seconds_of([&] { several.detect(divided.parts()); });
    if (one.hash() != several.hash())
      throw Error(std::string("the contacts of the ") + name + " differ from those of one GPU");
    if (step < 0) continue;
    const detect::ResidentReport& r = several.report();
    alone += first, together += second, deal += r.deal_seconds;
    contacts += r.contacts, spheres += r.spheres, copies += r.copies;
    say(s, number(first * 1e3, "%.2f") + " and " + number(second * 1e3, "%.2f") + " ms, of it dealing " +
               number(r.deal_seconds * 1e3, "%.2f") + ", detecting " +
               number(r.detect_seconds * 1e3, "%.2f") + (r.cut ? ", cut anew" : ""));
  }
  t.add(name, "cuda", static_cast<std::size_t>(devices), spheres / kSteps, contacts / kSteps, "one GPU",
        together / kSteps, 0, deal / kSteps, static_cast<double>(copies) / static_cast<double>(spheres) - 1,
        alone / (devices * together));
}

// The number asked for; else `least`, twice that, and so on, as far as there are GPUs.
std::vector<int> numbers_of_gpus(const Settings& s, int least) {
  if (s.devices > gpus())
    throw Error("there are " + std::to_string(gpus()) + " GPUs: choose no more with --devices");
  if (s.devices > 0) return {s.devices};
  std::vector<int> numbers;
  for (int devices = least; devices <= gpus(); devices *= 2) numbers.push_back(devices);
  return numbers;
}

void gpu_rows(const Settings& s, Table& t) {
  const std::vector<std::uint64_t> dense = {28750000, 57500000, 115000000, 230000000}, poly100 = {40000000};
  for (const char* const name : {"dense", "poly100"}) {
    if (!s.scene.empty() && s.scene != name) continue;
    for (const std::uint64_t n : sizes_or(s, *name == 'd' ? dense : poly100)) {
      const Scene scene = detect::generate(name, n, false);
      for (const int devices : numbers_of_gpus(s, 1)) row(s, t, name, scene, devices);
    }
  }
  if (s.scene.empty() || s.scene == "bodies")
    for (const int devices : numbers_of_gpus(s, 1)) body_row(s, t, size_or(s, 64000000) / 64, devices);
  for (const bool whole : {false, true}) {
    if (!s.scene.empty() && s.scene != (whole ? "host" : "out-of-core")) continue;
    const Scene scene = detect::generate("dense", size_or(s, 100000000), false);
    whole ? host_row(s, t, scene) : out_of_core_row(s, t, scene);
  }
  if (!s.scene.empty() && s.scene != "front") return;
  const Scene full = detect::generate("dense", size_or(s, 100000000), false);
  for (const int devices : numbers_of_gpus(s, 2))
    for (const bool moves : {false, true}) front_rows(s, t, full, devices, moves);
}

#else
void gpu_rows(const Settings&, Table&) {}
#endif

void cpu_rows(const Settings& s, Table& t) {
  for (const std::uint64_t n : sizes_or(s, {250000, 500000, 1000000, 2000000})) {
    const Scene scene = detect::generate("dense", n, false);
    const detect::Input input = input_of(scene);
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
  std::map<std::pair<std::string, std::uint64_t>, Points> points;
  for (const Json& r : rows)
    if (r["scene"] == "dense") points[{r["backend"], r["devices"]}].push_back({r["contacts"], r["seconds"]});
  Json lines = Json::array();
  for (const auto& [key, of] : points) {
    const FittedLine line = fitted_line(of);
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
  check_scene(s, "boxes", {"dense", "poly100", "bodies", "host", "out-of-core", "front"});
  Table t;
  if (backends(s).back() == detect::BackendKind::cuda) {
    gpu_rows(s, t);
  } else {
    if (s.devices > 0) wrong_usage("--devices counts GPUs, and the CPU is measured: leave it out");
    if (!s.scene.empty() && s.scene != "dense")
      wrong_usage("--scene " + s.scene + " is measured on GPUs, and dense on the CPU: leave it out");
    cpu_rows(s, t);
  }
  const Json lines = lines_of(t.rows);
  for (const Json& line : lines)
    t.table.push_back({"line", line["backend"], std::to_string(line["devices"].get<int>()), "-", "-", "-",
                       number(line["seconds_at_0"].get<double>() * 1e3, "%.2f") + " ms + " +
                           number(line["ns_a_contact"], "%.4f") + " ns a contact",
                       "R^2 " + number(line["r2"], "%.4f")});
  return {{"bench", "boxes"},     {"record", "i, j, normal, depth in float"},
          {"machine", machine()}, {"device", device_name()},
          {"gpus", gpus()},       {"threads", s.threads},
          {"rows", t.rows},       {"lines", lines},
          {"table", t.table}};
}

}  // namespace padder::bench
