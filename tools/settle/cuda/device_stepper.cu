// SPDX-License-Identifier: MIT
// The state of a stepper in the memory of a GPU, and the rows of steps.
#include "tools/settle/device_stepper.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>

#include "detect/cuda/device/device.h"
#include "detect/detector.h"
#include "tools/settle/cuda/candidates.h"
#include "tools/settle/cuda/step_kernels.h"
#include "tools/settle/cuda/watch_sums.h"

namespace padder::settle {
namespace cuda {
namespace {

using detect::cuda::Buffer;
using detect::cuda::cuda_check;

constexpr int kDevice = 0;
// Steps that are launched before the host looks at their outcome. Steps behind one that was not taken do
// nothing, which takes a few microseconds each; to look takes about as long as five of them.
constexpr std::uint64_t kRow = 16;
// A sphere this many times larger than the mean may have more contacts than a thread should sum.
constexpr double kLarge = 6;

class Stepper : public DeviceStepper {
 public:
  explicit Stepper(const System& s) : detector_(detect::DeviceChoice{detect::BackendKind::cuda, kDevice}) {
    const detect::cuda::OnDevice on(kDevice);
    on.require();
    detector_.options().width = detect::Width::pairs;
    detector_.options().order = detect::Order::any;  // candidates are sorted anyway
    detector_.options().output = detect::Memory::device;
    shapes_ = s.shapes, host_bodies_ = s.bodies;
    put_what_stays(s);
    put_tags(s);
    put_bushings(s);
    Snapshot first{0, s.position, s.velocity, s.momentum, s.spin, s.orientation, {}, {}};
    put(first);
  }

  void put(const Snapshot& s) override {
    const detect::cuda::OnDevice on(kDevice);
    const std::size_t n = s.position.size(), bodies = view_.bodies;
    std::vector<Motion> motions(n);
    for (std::size_t m = 0; m < n; m++)
      motions[m] = {s.velocity[m], inverse_mass_[m], s.spin[m], material_.empty() ? 0u : material_[m]};
    up(motions_, motions), up(momentum_, s.momentum), up(orientation_, s.orientation);
    std::vector<Place> places(bodies);
    for (std::size_t b = 0; b < bodies; b++) places[b].at = s.position[b];
    up(body_places_, places);
    std::vector<detect::Sphere> centers(view_.spheres);
    for (std::size_t g = 0; g < grain_radius_.size(); g++) {
      const Vec3& at = s.position[bodies + g];
      centers[view_.body_spheres + g] = {at.x, at.y, at.z, grain_radius_[g]};
    }
    up(centers_, centers);
    look();
    candidates_.put(view_, s.contacts, s.walls);
    view_.rows = candidates_.rows();
    launch_place(view_, nullptr);
    old_ = true;
    revision_++;  // static bodies may stand elsewhere
    cuda_check(cudaDeviceSynchronize(), "copy the state");
  }

  void get(System& s) override {
    const detect::cuda::OnDevice on(kDevice);
    std::vector<Motion> motions(view_.movers);
    std::vector<detect::Sphere> grains(grain_radius_.size());
    down(motions.data(), motions_.data(), motions.size());
    down(grains.data(), centers_.data() + view_.body_spheres, grains.size());
    std::vector<Place> places(view_.bodies);
    down(places.data(), body_places_.data(), places.size());
    down(s.momentum.data(), momentum_.data(), view_.movers);
    down(s.orientation.data(), orientation_.data(), view_.bodies);
    for (std::size_t m = 0; m < motions.size(); m++)
      s.velocity[m] = motions[m].velocity, s.spin[m] = motions[m].spin;
    for (std::size_t b = 0; b < places.size(); b++) s.position[b] = places[b].at;
    for (std::size_t g = 0; g < grains.size(); g++) s.position[view_.bodies + g] = center_of(grains[g]);
  }
  void get(std::vector<SpringMemory>& pairs, std::vector<SpringMemory>& walls) override {
    const detect::cuda::OnDevice on(kDevice);
    candidates_.get(pairs, walls, view_.spheres);
  }

  std::uint64_t find(double skin) override {
    const detect::cuda::OnDevice on(kDevice);
    std::vector<detect::Shape> shapes;
    for (const auto& shape : shapes_) shapes.push_back({shape.data(), shape.size()});
    detect::Input input;
    if (first_loose_ > 0) {
      input.shapes = shapes, input.bodies = host_bodies_;
      launch_poses(view_, poses_.reserve(view_.bodies), nullptr);
      input.poses = poses_.data(), input.pose_memory = detect::Memory::device;
      input.revision = revision_;
    }
    if (const std::uint32_t loose = view_.spheres - first_loose_; loose) {
      const detect::Sphere* const first = view_.centers + first_loose_;
      input.spheres = detect::spheres_of<double>(loose, &first->x, &first->r, detect::Memory::device);
      input.spheres.center_stride = input.spheres.radius_stride = 4;
      input.spheres.family = family_.data(), input.spheres.mask = mask_.data();
      input.spheres.is_static = is_static_.data();
    }
    detector_.options().margin = skin;
    const detect::Contacts& found = detector_.detect(input);
    candidates_.find(view_, found.pair_span(), 0.5 * skin, nullptr);
    view_.rows = candidates_.rows();
    cuda_check(cudaMemcpyAsync(reference_.data(), centers_.data(), view_.spheres * sizeof(detect::Sphere),
                               cudaMemcpyDeviceToDevice),
               "keep the centres");
    cuda_check(cudaStreamSynchronize(nullptr), "find candidates");  // whoever measures, measures this whole
    old_ = false, limit_ = 0.499999 * skin;                         // a hair less than half, for rounding
    return found.count;
  }

  StepsTaken step(std::uint64_t count) override {
    const detect::cuda::OnDevice on(kDevice);
    StepsTaken out;
    while (out.steps < count && !old_) {
      const std::uint64_t row = limit_ > 0 ? std::min(count - out.steps, kRow) : 1;
      const Record* const r = launch_row(row);
      for (std::uint64_t k = 1; k <= row && !r[k].stopped; k++) {
        out.contacts = 0;
        for (const auto c : r[k].contacts) out.contacts += c;
        out.deepest = std::bit_cast<double>(r[k].deepest), out.ratio = std::bit_cast<double>(r[k].ratio);
        out.most = std::max(out.most, out.deepest), out.most_ratio = std::max(out.most_ratio, out.ratio);
        out.wild = r[k].wild;
        if (out.ratio > 1 || out.wild != ~0u) return out;
        out.steps++;
        old_ = !(std::sqrt(std::bit_cast<double>(r[k].moved)) < limit_);
      }
    }
    out.detect = old_;
    return out;
  }

  Watch watch() override {
    const detect::cuda::OnDevice on(kDevice);
    return sums_.watch(view_, nullptr);
  }

 private:
  template <class T>
  void up(Buffer<T>& to, const std::vector<T>& from) {
    to.reserve(from.size());
    if (!from.empty())
      cuda_check(cudaMemcpy(to.data(), from.data(), from.size() * sizeof(T), cudaMemcpyHostToDevice),
                 "copy the scene");
  }
  template <class T>
  void down(T* to, const T* from, std::size_t count) {
    if (count) cuda_check(cudaMemcpy(to, from, count * sizeof(T), cudaMemcpyDeviceToHost), "read the state");
  }

  // Launches a row of steps and waits for it. The records of its steps begin at 1.
  const Record* launch_row(std::uint64_t row) {
    Record* const host = host_records_.reserve(kRow + 1);
    Record* const records = records_.reserve(kRow + 1);
    for (std::uint64_t k = 0; k <= row; k++) host[k] = {}, host[k].wild = ~0u;
    cuda_check(cudaMemcpyAsync(records, host, (row + 1) * sizeof(Record), cudaMemcpyHostToDevice),
               "begin the steps");
    StepTask task{view_,         records,      limit_,           longest_step_ / view_.step,
                  large_.data(), large_count_, large_in_bodies_, largest_body_};
    for (std::uint64_t k = 0; k < row; k++, task.records++) launch_step(task, nullptr);
    cuda_check(cudaMemcpyAsync(host, records, (row + 1) * sizeof(Record), cudaMemcpyDeviceToHost),
               "read the steps");
    cuda_check(cudaStreamSynchronize(nullptr), "take a step");
    return host;
  }

  void put_what_stays(const System& s) {
    view_.spheres = static_cast<std::uint32_t>(s.spheres());
    view_.bodies = static_cast<std::uint32_t>(s.bodies.size());
    view_.body_spheres = static_cast<std::uint32_t>(s.body_spheres());
    view_.movers = static_cast<std::uint32_t>(s.movers());
    view_.walls = static_cast<std::uint32_t>(s.walls.size());
    view_.law = s.law, view_.gravity = s.gravity, view_.step = s.step;
    view_.all_move = std::ranges::count(s.inverse_mass, 0) == 0;
    inverse_mass_ = s.inverse_mass, material_ = s.material, grain_radius_ = s.grain_radius;
    up(inverse_inertia_, s.inverse_inertia), up(driven_, s.driven), up(walls_, s.walls);
    std::vector<std::uint32_t> first_of_shape, first_of_body, owner, first, large;
    std::vector<detect::Sphere> shape_spheres;
    for (const auto& shape : s.shapes) {
      first_of_shape.push_back(static_cast<std::uint32_t>(shape_spheres.size()));
      shape_spheres.insert(shape_spheres.end(), shape.begin(), shape.end());
    }
    for (std::uint32_t b = 0; b < s.bodies.size(); b++) {
      const auto count = static_cast<std::uint32_t>(s.shapes[s.bodies[b].shape].size());
      first_of_body.push_back(first_of_shape[s.bodies[b].shape]);
      owner.insert(owner.end(), count, b), largest_body_ = std::max(largest_body_, count);
    }
    for (const std::uint64_t f : s.first_sphere) first.push_back(static_cast<std::uint32_t>(f));
    std::vector<double> radii;
    for (const std::uint32_t b : owner) {
      const auto k = radii.size();
      radii.push_back(s.shapes[s.bodies[b].shape][k - s.first_sphere[b]].r);
    }
    radii.insert(radii.end(), s.grain_radius.begin(), s.grain_radius.end());
    double mean = 0;
    for (const double r : radii) mean += r / static_cast<double>(radii.size());
    longest_step_ = 0.5 * *std::min_element(radii.begin(), radii.end());
    view_.large_radius = kLarge * mean;
    for (std::uint32_t k = 0; k < radii.size(); k++)
      if (radii[k] > view_.large_radius) large.push_back(k);
    large_count_ = static_cast<std::uint32_t>(large.size());
    large_in_bodies_ = !large.empty() && large.front() < view_.body_spheres;
    up(owner_, owner), up(first_sphere_, first), up(first_of_shape_, first_of_body);
    up(shape_spheres_, shape_spheres), up(large_, large);
    loads_.reserve(large_count_ ? view_.spheres : 0), reference_.reserve(view_.spheres);
  }

  // Small bodies go to the detector as loose spheres, which takes half the time of searching their balls
  // first (docs/results/table3.md, clumps). The spheres of one share a family, so that they do not meet.
  void put_tags(const System& s) {
    const auto in_worlds = [](const detect::Body& b) { return b.world != 0; };
    const bool small = largest_body_ <= kSmallBody && std::ranges::none_of(s.bodies, in_worlds);
    first_loose_ = small ? 0 : view_.body_spheres;
    std::set<std::uint32_t> taken(s.grain_family.begin(), s.grain_family.end());
    for (const detect::Body& b : s.bodies) taken.insert(b.family);
    std::vector<std::uint32_t> family, mask;
    std::vector<std::uint8_t> is_static;
    std::uint32_t own = ~0u;
    for (std::size_t b = 0; b < s.bodies.size() && small; b++) {
      const detect::Body& body = s.bodies[b];
      while (body.family == 0 && taken.contains(own)) own--;
      const std::uint64_t spheres = s.first_sphere[b + 1] - s.first_sphere[b];
      family.insert(family.end(), spheres, body.family ? body.family : own--);
      mask.insert(mask.end(), spheres, body.mask), is_static.insert(is_static.end(), spheres, body.is_static);
    }
    const auto add_grains = [&](auto& tags, const auto& of_grains) {
      tags.insert(tags.end(), of_grains.begin(), of_grains.end());
      tags.resize(view_.spheres - first_loose_);
    };
    add_grains(family, s.grain_family), add_grains(mask, s.grain_mask), add_grains(is_static, s.grain_static);
    const auto put = [&](auto& to, const auto& tags) {
      if (std::ranges::any_of(tags, [](auto tag) { return tag != 0; })) up(to, tags);
    };
    put(family_, family), put(mask_, mask), put(is_static_, is_static);
  }

  void put_bushings(const System& s) {
    view_.bushings = static_cast<std::uint32_t>(s.bushings.size());
    if (s.bushings.empty()) return;
    std::vector<std::uint32_t> starts = {0}, list;
    for (std::uint32_t b = 0; b < s.bodies.size(); b++) {
      for (std::uint32_t u = 0; u < s.bushings.size(); u++)
        if (s.bushings[u].a == b || s.bushings[u].b == b) list.push_back(u);
      starts.push_back(static_cast<std::uint32_t>(list.size()));
    }
    up(bushings_, s.bushings), up(bushing_starts_, starts), up(bushing_list_, list);
    bushing_loads_.reserve(view_.bodies);
  }

  // The view of what lies in the buffers now.
  void look() {
    View& v = view_;
    v.centers = centers_.data(), v.reference = reference_.data(), v.motions = motions_.data();
    v.momentum = momentum_.data(), v.inverse_inertia = inverse_inertia_.data(), v.loads = loads_.data();
    v.body_places = body_places_.data(), v.orientation = orientation_.data();
    v.driven = driven_.data(), v.owner = owner_.data(), v.first_sphere = first_sphere_.data();
    v.first_of_shape = first_of_shape_.data(), v.shape_spheres = shape_spheres_.data();
    v.bushing_loads = bushing_loads_.data(), v.bushing_starts = bushing_starts_.data();
    v.bushing_list = bushing_list_.data(), v.bushing = bushings_.data(), v.wall = walls_.data();
  }

  detect::cuda::MemoryBook book_;
  template <class T>
  struct Array : Buffer<T> {
    explicit Array(detect::cuda::MemoryBook& book, bool pinned = false)
        : Buffer<T>(book, "the scene of settle", pinned) {}
  };
  detect::Detector detector_;
  View view_;
  std::vector<std::vector<detect::Sphere>> shapes_;
  std::vector<detect::Body> host_bodies_;
  std::vector<double> inverse_mass_, grain_radius_;
  double limit_ = 0, longest_step_ = 0;
  std::uint64_t revision_ = 0;
  bool old_ = true;  // the candidates are no longer to be used
  std::uint32_t large_count_ = 0, largest_body_ = 0;
  std::uint32_t first_loose_ = 0;  // spheres from this one on are loose to the detector
  bool large_in_bodies_ = false;
  std::vector<std::uint8_t> material_;
  Array<Motion> motions_{book_};
  Array<detect::Sphere> centers_{book_}, reference_{book_}, shape_spheres_{book_};
  Array<Vec3> momentum_{book_}, inverse_inertia_{book_};
  Array<Place> body_places_{book_};
  Array<Load> loads_{book_}, bushing_loads_{book_};
  Array<Quaternion> orientation_{book_};
  Array<detect::Pose> poses_{book_};
  Array<std::uint8_t> driven_{book_}, is_static_{book_};
  Array<std::uint32_t> owner_{book_}, first_sphere_{book_}, first_of_shape_{book_}, family_{book_},
      mask_{book_}, large_{book_}, bushing_starts_{book_}, bushing_list_{book_};
  Array<Bushing> bushings_{book_};
  Array<Wall> walls_{book_};
  Array<Record> records_{book_}, host_records_{book_, true};
  Candidates candidates_{book_};
  WatchSums sums_{book_};
};

}  // namespace
}  // namespace cuda

std::unique_ptr<DeviceStepper> make_device_stepper(const System& system) {
  return std::make_unique<cuda::Stepper>(system);
}

}  // namespace padder::settle
