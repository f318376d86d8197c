// SPDX-License-Identifier: GPL-3.0-or-later
// Sparse and uneven scenes, standing and moving, beside dense: time over (spheres + contacts). Spheres and
// contacts are in the memory of the device. Moving: each sphere moves by a fiftieth of its radius between
// calls, back and forth through some frames; copying a frame to where the detector reads is not timed.
#include <algorithm>
#include <cstring>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/bench/scenes/shown_spheres.h"
#include "tools/bench/scenes/uneven_scenes.h"

namespace padder::bench {
namespace {

using detect::FloatSphere;

// How the spheres lie in memory.
struct Layout {
  bool wide = false;   // doubles
  bool apart = false;  // centers and radii in two arrays, not x, y, z and radius together
  double origin = 0;   // where the scene lies on each axis
  std::string name() const {
    return std::string(wide ? ", double" : "") + (apart ? ", two arrays" : "") +
           (origin > 0 ? ", at " + number(origin, "%g") : "");
  }
};

// The frames of a scene, in the memory of the device if there is one, and the place that detect() reads.
class Frames {
 public:
  Frames(const std::vector<FloatSphere>& spheres, int frames, const Layout& layout,
         [[maybe_unused]] bool on_device)
      : layout_(layout), count_(spheres.size()), frames_(frames) {
    bytes_ = count_ * 4 * scalar_bytes();
    host_.resize(static_cast<std::size_t>(frames) * bytes_);
    for (int f = 0; f < frames; f++)
      for (std::size_t k = 0; k < count_; k++) fill(static_cast<std::size_t>(f), k, spheres[k]);
    here_.assign(host_.begin(), host_.begin() + static_cast<std::ptrdiff_t>(bytes_));
    input_.spheres = view(here_.data());
#ifdef PADDER_CUDA
    if (on_device) {
      if (cudaMalloc(reinterpret_cast<void**>(&device_), bytes_ * static_cast<std::size_t>(frames + 1)) !=
              cudaSuccess ||
          cudaMemcpy(device_ + bytes_, host_.data(), host_.size(), cudaMemcpyHostToDevice) != cudaSuccess)
        throw Error("the spheres do not fit the GPU's memory: choose fewer");
      input_.spheres = view(device_), input_.spheres.memory = detect::Memory::device;
    }
#endif
    show(0);
  }
  ~Frames() {
#ifdef PADDER_CUDA
    cudaFree(device_);
#endif
  }
  Frames(const Frames&) = delete;
  Frames& operator=(const Frames&) = delete;
  const detect::Input& input() const { return input_; }
  // The first frame, in the memory of the host.
  detect::Input host_input() {
    detect::Input input = input_;
    input.spheres = view(host_.data());
    return input;
  }
  // Back and forth.
  void show(int call) {
    const int last = std::max(frames_ - 1, 1), at = call % (2 * last),
              frame = frames_ == 1 ? 0 : std::min(at, 2 * last - at);
    const std::size_t from = static_cast<std::size_t>(frame) * bytes_;
#ifdef PADDER_CUDA
    if (device_) {
      cudaMemcpy(device_, device_ + bytes_ + from, bytes_, cudaMemcpyDeviceToDevice);
      cudaDeviceSynchronize();
      return;
    }
#endif
    std::copy_n(host_.begin() + static_cast<std::ptrdiff_t>(from), bytes_, here_.begin());
  }

 private:
  std::size_t scalar_bytes() const { return layout_.wide ? sizeof(double) : sizeof(float); }
  detect::Spheres view(const std::byte* at) const {
    const std::byte* const radii = at + scalar_bytes() * 3 * (layout_.apart ? count_ : 1);
    detect::Spheres s;
    s.count = count_, s.scalar = layout_.wide ? detect::Scalar::f64 : detect::Scalar::f32;
    s.centers = at, s.radii = radii;
    if (!layout_.apart) s.center_stride = s.radius_stride = 4;
    return s;
  }
  void fill(std::size_t frame, std::size_t k, const FloatSphere& s) {
    detect::SplitMix64 random(k);
    const double step = 0.02 * static_cast<double>(frame) * s.r;
    double v[4] = {s.x, s.y, s.z, s.r};
    for (int a = 0; a < 3; a++) v[a] += layout_.origin + step * random.signed_unit();
    const float f[4] = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]),
                        static_cast<float>(v[3])};
    const std::byte* const from =
        layout_.wide ? reinterpret_cast<const std::byte*>(v) : reinterpret_cast<const std::byte*>(f);
    std::byte* const to = host_.data() + frame * bytes_;
    const std::size_t one = scalar_bytes();
    std::memcpy(to + k * one * (layout_.apart ? 3 : 4), from, 3 * one);
    std::memcpy(to + one * (layout_.apart ? 3 * count_ + k : 4 * k + 3), from + 3 * one, one);
  }

  Layout layout_;
  std::size_t count_, bytes_ = 0;
  int frames_;
  std::vector<std::byte> host_, here_;
  [[maybe_unused]] std::byte* device_ = nullptr;
  detect::Input input_;
};

struct Row {
  const UnevenScene* scene;
  Layout layout;
};

class Table {
 public:
  explicit Table(const Settings& s) : settings_(s) {}

  void row(const Row& r, std::uint64_t n, detect::BackendKind backend) {
    const Settings& s = settings_;
    const bool cuda = backend == detect::BackendKind::cuda;
    const std::string name = r.scene->name + r.layout.name();
    say(s, name + " " + std::to_string(n) + " " + name_of(backend));
    const std::vector<FloatSphere> spheres = uneven_scene(*r.scene, n);
    Frames frames(spheres, s.moving ? (n > 2000000 ? 5 : 9) : 1, r.layout, cuda);
    detect::CallOptions o = options_of(s, backend);
    o.order = s.stable ? detect::Order::stable : detect::Order::any;
    detect::Detector d({backend}, o);
    const int calls = std::max(s.repeat, cuda ? 21 : 3);
    const auto show = [&](int k) { frames.show(k); };
    Times standing = timed(d, frames.input(), calls);
    if (cuda) standing.processor = 0;  // of a thread that waits
    const std::uint64_t contacts = detect_watched(d, frames.input()).count, hash = hash_watched(d);
    check_contacts(d, contacts, frames.input(), frames.host_input(),
                   {name + " " + std::to_string(n), r.scene->crowds_nine_stages});
    o.timings = true;
    detect::Detector by_stages({backend}, o);
    detect::Seconds stages;
    for (int k = 0; k < 5; k++) stages = detect_watched(by_stages, frames.input()).seconds;
    o.timings = false;
    Times moving;
    if (s.moving) moving = timed(d, frames.input(), std::max(calls, 100), show);
    Times followed, followed_moving;
    if (s.history) {
      o.history = true;
      detect::Detector with_history({backend}, o);
      followed = timed(with_history, frames.input(), calls);
      if (s.moving) followed_moving = timed(with_history, frames.input(), std::max(calls, 100), show);
    }
    const Near near = s.margin > 0 ? with_margin(r, frames, spheres, backend, o, calls) : Near{};
    const double work = static_cast<double>(n) + static_cast<double>(contacts), each = standing.median / work,
                 processor = standing.processor / work;
    if (r.scene == &uneven_scenes()[0] && r.layout.name().empty())
      dense_ = each, dense_processor_ = processor;
    const auto ms = [](double t) { return t > 0 ? number(t * 1e3, "%.3f") : std::string("-"); };
    const auto ratio = [](double a, double b) { return b > 0 && a > 0 ? number(a / b, "%.2f") : "-"; };
    say(s, "  " + ms(standing.median) + " ms, over dense " + ratio(each, dense_) + ", CPU time " +
               ms(standing.processor) + " ms, over dense " + ratio(processor, dense_processor_) +
               ", moving " + ms(moving.median) + ", worst " + ms(moving.worst));
    rows.push_back({{"scene", name},
                    {"spheres", n},
                    {"contacts", contacts},
                    {"hash", std::to_string(hash)},
                    {"backend", d.backend()},
                    {"seconds", standing.median},
                    {"seconds_worst", standing.worst},
                    {"seconds_processor", standing.processor},
                    {"seconds_survey", stages.stage[0]},
                    {"seconds_order", stages.stage[3]},
                    {"seconds_search", stages.stage[8]},
                    {"seconds_moving", moving.median},
                    {"seconds_moving_worst", moving.worst},
                    {"seconds_history", followed.median},
                    {"seconds_history_moving", followed_moving.median},
                    {"seconds_margin", near.seconds},
                    {"contacts_margin", near.contacts},
                    {"seconds_grown", near.seconds_grown},
                    {"over_dense", dense_ > 0 ? each / dense_ : 0}});
    const std::vector<std::pair<const char*, std::string>> columns = {
        {"scene", name},
        {"spheres", std::to_string(n)},
        {"contacts", std::to_string(contacts)},
        {"backend", d.backend()},
        {"standing [ms]", ms(standing.median)},
        {"worst [ms]", ms(standing.worst)},
        {"over dense", ratio(each, dense_)},
        {"CPU time [ms]", ms(standing.processor)},
        {"over dense", ratio(processor, dense_processor_)},
        {"aim", number(r.scene->most, "%.1f")},
        {"moving [ms]", ms(moving.median)},
        {"worst of 100 [ms]", ms(moving.worst)},
        {"moving / standing", ratio(moving.median, standing.median)},
        {"worst / median", ratio(moving.worst, moving.median)},
        {"with history [ms]", ms(followed.median)},
        {"over standing", ratio(followed.median, standing.median)},
        {"moving with history [ms]", ms(followed_moving.median)},
        {"over moving", ratio(followed_moving.median, moving.median)},
        {"contacts with margin", std::to_string(near.contacts)},
        {"with margin [ms]", ms(near.seconds)},
        {"over standing", ratio(near.seconds, standing.median)},
        {"grown by half of it [ms]", ms(near.seconds_grown)},
        {"over grown", ratio(near.seconds, near.seconds_grown)}};
    Json headings, cells;
    for (const auto& [heading, cell] : columns) headings.push_back(heading), cells.push_back(cell);
    table[0] = headings, table.push_back(cells);
  }

  Json rows = Json::array();
  Json table = Json::array({Json::array()});  // its headings, and a row for each scene

 private:
  // Standing, with a margin; and spheres that are larger by half of it, without one.
  struct Near {
    double seconds = 0, seconds_grown = 0;
    std::uint64_t contacts = 0;
  };
  Near with_margin(const Row& r, Frames& frames, const std::vector<FloatSphere>& spheres,
                   detect::BackendKind backend, detect::CallOptions o, int calls) const {
    double sum = 0;
    for (const FloatSphere& s : spheres) sum += s.r;
    frames.show(0);  // what is checked
    o.history = false, o.margin = settings_.margin * sum / static_cast<double>(spheres.size());
    detect::Detector d({backend}, o);
    const double median = timed(d, frames.input(), calls).median;
    const std::uint64_t contacts = detect_watched(d, frames.input()).count;
    const bool cuda = backend == detect::BackendKind::cuda;
    check_contacts(d, contacts, frames.input(), frames.host_input(),
                   {std::string(r.scene->name) + " with a margin", r.scene->crowds_nine_stages, o.margin});
    std::vector<FloatSphere> grown = spheres;
    for (FloatSphere& s : grown) s.r += static_cast<float>(o.margin / 2);
    Frames larger(grown, 1, r.layout, cuda);
    o.margin = 0;
    detect::Detector plain({backend}, o);
    return {median, timed(plain, larger.input(), calls).median, contacts};
  }

  const Settings& settings_;
  double dense_ = 0, dense_processor_ = 0;  // for each sphere and contact
};

}  // namespace

Json scenes(const Settings& s) {
  std::vector<std::string> names;
  for (const UnevenScene& scene : uneven_scenes()) names.emplace_back(scene.name);
  check_scene(s, "scenes", names);
  Table t(s);
  std::vector<Row> rows;
  for (const UnevenScene& scene : uneven_scenes()) {
    rows.push_back({&scene, {}});
    const std::string name = scene.name;
    const bool far = name == "dense" || name == "poly100";
    if (far || name == "escaped" || name == "settled") rows.push_back({&scene, {.wide = true}});
    if (far) rows.push_back({&scene, {.wide = true, .origin = 1e7}});
    if (name == "dense")
      rows.push_back({&scene, {.apart = true}}), rows.push_back({&scene, {.wide = true, .apart = true}});
  }
  for (const detect::BackendKind backend : backends(s))
    for (const std::uint64_t n : sizes_or(s, {100000, 1000000, 5000000}))
      for (const Row& r : rows)
        if (s.scene.empty() || r.scene == &uneven_scenes()[0] || s.scene == r.scene->name)
          t.row(r, n, backend);
  return {{"bench", "scenes"},    {"record", "i, j, normal, depth in float"},
          {"machine", machine()}, {"device", device_name()},
          {"threads", s.threads}, {"rows", t.rows},
          {"table", t.table}};
}

}  // namespace padder::bench
