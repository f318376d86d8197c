// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/body_input.h"

#include <algorithm>

#include "detect/cuda/call/call.h"
#include "detect/cuda/device/blocks.h"
#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256;

// Elements that take the places from `begin` on: those in the list or, without one, those from `first` on.
struct Source {
  PosePart part;  // that has their poses
  const std::uint32_t* numbers = nullptr;
  std::uint32_t first = 0, begin = 0;
};
struct Sources {
  Source source[kMostPoseParts];
  std::uint32_t count = 0, begin = 0, end = 0;  // places
};

__global__ void __launch_bounds__(kThreads)
    place_kernel(const __grid_constant__ Placing placing, const __grid_constant__ Sources sources) {
  __shared__ PosesOfWarp poses_of_warp[kThreads / 32];
  PosesOfWarp& poses = poses_of_warp[threadIdx.x / 32];
  const unsigned lane = threadIdx.x % 32;
  for (std::uint32_t base = sources.begin + blockIdx.x * kThreads + (threadIdx.x - lane); base < sources.end;
       base += gridDim.x * kThreads) {
    const std::uint32_t at = base + lane;
    std::uint32_t k = 0;
    while (k + 1 < sources.count && sources.source[k + 1].begin <= at) k++;
    const Source& source = sources.source[k];
    const std::uint32_t n = at - source.begin;
    Element e{kLoose, 0};
    if (at < sources.end) e = placing.view.elements[source.numbers ? source.numbers[n] : source.first + n];
    read_poses(placing, source.part, e, poses);
    if (at < sources.end) put(placing, at, e, poses[lane], placed_ball(placing, e, poses[lane]));
    __syncwarp();  // all have read what the next round writes over
  }
}

void place(const Placing& placing, const Sources& sources, cudaStream_t stream) {
  if (sources.begin == sources.end) return;
  place_kernel<<<blocks_of_loop(sources.end - sources.begin, kThreads), kThreads, 0, stream>>>(placing,
                                                                                               sources);
  cuda_launched("place the balls about bodies");
}

// Copies loose spheres to the array of our own: those in `list`, or all if it is null.
__global__ void loose_kernel(DeviceSpheres from, const std::uint32_t* list, std::uint32_t count, Sphere* to,
                             std::uint32_t* tags, std::uint32_t all) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < count; k += gridDim.x * kThreads) {
    const std::uint32_t n = list ? list[k] : k;
    const Filter f = from.filter(n);
    to[n] = from.sphere(n), tags[n] = f.family, tags[all + n] = f.mask,
    tags[2 * std::uint64_t(all) + n] = f.owner;
  }
}
__global__ void record_kernel(const LooseRecord* from, std::uint32_t count, Sphere* to, std::uint32_t* tags,
                              std::uint32_t all) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < count; k += gridDim.x * kThreads) {
    const LooseRecord r = from[k];
    to[r.number] = r.sphere, tags[r.number] = r.filter.family, tags[all + r.number] = r.filter.mask;
    tags[2 * std::uint64_t(all) + r.number] = r.filter.owner;
  }
}

}  // namespace

std::vector<std::uint8_t> marks_on_device(const Input& input, cudaStream_t stream) {
  std::vector<std::uint8_t> marks(loose_count(input));
  const auto read = [&](std::uint64_t to, const std::uint8_t* from, std::uint64_t count) {
    if (from && count)
      cuda_check(cudaMemcpyAsync(&marks[to], from, count, cudaMemcpyDeviceToHost, stream),
                 "read what is static");
  };
  const Spheres& own = input.spheres;
  const std::uint64_t before = input.around ? input.around->before : 0;
  read(before, own.is_static, own.count);
  if (input.around) {
    const Spheres& others = input.around->spheres;
    read(0, others.is_static, before);
    if (others.is_static) read(before + own.count, others.is_static + before, others.count - before);
  }
  cuda_check(cudaStreamSynchronize(stream), "read what is static");
  return marks;
}

std::uint64_t moving_loose(const Input& input, cudaStream_t stream) {
  if (!marks_static(input)) return loose_count(input);
  if (input.spheres.memory == Memory::host && !input.around)
    return static_cast<std::uint64_t>(
        std::count(input.spheres.is_static, input.spheres.is_static + input.spheres.count, 0));
  const std::vector<std::uint8_t> marks = marks_on_device(input, stream);
  return static_cast<std::uint64_t>(std::count(marks.begin(), marks.end(), 0));
}

BodyInput::BodyInput(MemoryBook& book, PosedBodies& posed)
    : copy_(book, posed),
      posed_(posed),
      arrays_(book),
      near_elements_(book),
      elements_(book, "the pieces of bodies"),
      balls_(book, "the balls about bodies"),
      loose_spheres_(book, "the spheres"),
      static_balls_(book, "what is static"),
      stances_(book, "the balls about bodies"),
      tags_(book, "families and masks"),
      loose_tags_(book, "families and masks"),
      moving_list_(book, "what moves"),
      static_starts_(book, "what is static"),
      static_elements_(book, "what is static"),
      records_(book, "what moved"),
      host_records_(book, "what moved", true) {}

bool BodyInput::knows(const Input& input) const {
  return input.revision != 0 && input.revision == revision_ && input.bodies.size() == known_bodies_ &&
         loose_count(input) == known_loose_;
}

bool BodyInput::read(const Call& call) {
  const Input& input = call.input;
  const cudaStream_t stream = call.stream;
  const bool known = knows(input), table_known = known && call.options.margin == margin_;
  forget(), margin_ = call.options.margin;
  if (!known)
    read_all(input, stream);
  else if (!has_device_poses(input))
    posed_.move(input, stream);
  read_loose(input, known, stream);
  const bool limited = !(call.options.own == Region{});
  near_ = view_, near_.in_place = posed_.in_place(input);
  if (view_.moving > 0 && has_device_poses(input)) posed_.expect_poses(!limited && near_.in_place.count == 0);
  // First, since other GPUs wait for it.
  if (limited && view_.moving > 0) place_near(call);
  if (!table_known && !build_table(stream)) return false;
  if (!limited) place_all(part_of_call(input), 0, view_.moving, stream);
  return true;
}

// Where the poses of this call are: those with the bodies, or those that this GPU has.
PosePart BodyInput::part_of_bodies() const {
  return {reinterpret_cast<const double*>(view_.bodies), 0, static_cast<std::uint32_t>(known_bodies_),
          sizeof(Body) / sizeof(double)};
}
PosePart BodyInput::part_of_call(const Input& input) const {
  if (input.poses_around) return input.poses_around->parts[input.poses_around->own];
  PosePart all = part_of_bodies();
  if (has_device_poses(input)) all.poses = input.poses->rotation, all.step = sizeof(Pose) / sizeof(double);
  return all;
}

// The moving elements of bodies that follow one another.
ElementRange BodyInput::elements_of(const PosePart& part) const {
  const auto begin = assembly_.elements.begin(), end = begin + assembly_.moving_pieces;
  const auto before = [&](std::uint32_t body) {
    return static_cast<std::uint32_t>(
        std::partition_point(begin, end, [&](const Element& e) { return e.body < body; }) - begin);
  };
  const std::uint32_t first = before(part.first);
  return {first, before(part.first + part.count) - first};
}

Placing BodyInput::placing() {
  // More than half of the margin, by far more than the decisions about it round.
  return {near_, posed_.bodies(), loose_, 0.5 * margin_ * (1 + 0x1p-40)};
}

// Places what may have a contact in the box: of the bodies whose poses this GPU has, then of those whose
// poses others have.
void BodyInput::place_near(const Call& call) {
  const PosesAround* const around = call.input.poses_around;
  NearElements::Task task{placing(), part_of_call(call.input)};
  task.of_bodies = elements_of(task.part);
  task.loose = {assembly_.moving_pieces, assembly_.moving - assembly_.moving_pieces};
  task.largest = std::max(largest_radius_, around ? around->largest_radius : 0), task.margin = margin_;
  task.ordered = call.options.order == Order::stable;
  std::vector<Region> boxes{call.options.own};
  for (std::size_t k = 0; around && k < around->boxes.size(); k++)
    if (k != around->own) boxes.push_back(around->boxes[k]);
  task.boxes = boxes;
  near_.moving = near_elements_.place(task, call.stream);
  if (!around) return;
  std::vector<ListedElements> lists(around->parts.size());
  for (std::size_t k = 0, box = 1; k < lists.size(); k++)
    if (k != around->own) lists[k] = near_elements_.listed(box++);
  place_listed(*around, around->exchange(lists), call.stream);
}

void BodyInput::place_listed(const PosesAround& around, std::span<const ListedElements> lists,
                             cudaStream_t stream) {
  Sources sources;
  sources.begin = sources.end = near_.moving;
  for (std::size_t k = 0; k < lists.size(); k++) {
    if (lists[k].count == 0) continue;
    sources.source[sources.count++] = {around.parts[k], lists[k].numbers, 0, sources.end};
    sources.end += lists[k].count;
  }
  place(placing(), sources, stream);
  near_.moving = sources.end;
}

// Elements `first` to `end` take the places of the same numbers.
void BodyInput::place_all(const PosePart& part, std::uint32_t first, std::uint32_t end, cudaStream_t stream) {
  Sources sources;
  sources.source[0] = {part, nullptr, first, first};
  sources.count = 1, sources.begin = first, sources.end = end;
  place(placing(), sources, stream);
}

void BodyInput::read_all(const Input& input, cudaStream_t stream) {
  const Spheres& s = input.spheres;
  std::vector<std::uint8_t> is_static;
  if (marks_static(input) && s.memory == Memory::device) is_static = marks_on_device(input, stream);
  assembly_.update(input, is_static.empty() ? s.is_static : is_static.data());
  moving_loose_.clear();
  for (std::uint32_t e = 0; e < assembly_.moving; e++) {
    const Element el = assembly_.elements[e];
    if (el.body == kLoose) moving_loose_.push_back(el.piece);
  }
  largest_radius_ = 0;
  for (const Shape& shape : input.shapes)
    for (std::uint64_t k = 0; k < shape.count; k++)
      largest_radius_ = std::max(largest_radius_, shape.spheres[k].r);
  view_ = arrays_.read(input, posed_.read(input, stream), assembly_.pieces, assembly_.body_first, stream);
  view_.elements = copied(elements_, assembly_.elements.data(), assembly_.elements.size(), stream);
  view_.count = static_cast<std::uint32_t>(assembly_.elements.size()), view_.moving = assembly_.moving;
  view_.balls = balls_.reserve(view_.count), view_.stances = stances_.reserve(view_.count);
  view_.family = tags_.reserve(3 * std::uint64_t(view_.count));
  view_.mask = view_.family + view_.count, view_.owner = view_.mask + view_.count;
  copied(moving_list_, moving_loose_.data(), moving_loose_.size(), stream);
  cuda_check(cudaStreamSynchronize(stream), "copy the bodies");  // the vectors must outlive their copies
  known_bodies_ = input.bodies.size(), known_loose_ = loose_count(input);
}

// If no loose sphere is static, all are read where the caller has them, in every call. Else they are kept in
// an array of our own, and each call brings only those that move.
void BodyInput::read_loose(const Input& input, bool known, cudaStream_t stream) {
  const Spheres& s = input.spheres;
  const auto n = static_cast<std::uint32_t>(loose_count(input));
  loose_ = {};
  if (n == 0) return;
  Input only;
  only.spheres = s, only.around = input.around;
  if (!marks_static(input)) {
    loose_ = copy_.source(only, stream);
    return;
  }
  Sphere* to = loose_spheres_.reserve(n);
  std::uint32_t* tags = loose_tags_.reserve(3 * std::uint64_t(n));
  const auto moving = static_cast<std::uint32_t>(moving_loose_.size());
  if (!known) {
    loose_kernel<<<blocks_of_loop(n, kThreads), kThreads, 0, stream>>>(copy_.source(only, stream), nullptr, n,
                                                                       to, tags, n);
  } else if (moving > 0 && s.memory == Memory::device) {
    loose_kernel<<<blocks_of_loop(moving, kThreads), kThreads, 0, stream>>>(
        copy_.source(only, stream), moving_list_.data(), moving, to, tags, n);
  } else if (moving > 0) {
    LooseRecord* host = host_records_.reserve(moving);
    const auto read = [&](std::uint32_t k, const auto* centers, const auto* radii) {
      const auto* c = centers + std::uint64_t(k) * s.center_stride;
      return Sphere{c[0], c[1], c[2], radii[std::uint64_t(k) * s.radius_stride]};
    };
    for (std::uint32_t q = 0; q < moving; q++) {
      const std::uint32_t k = moving_loose_[q];
      host[q].sphere =
          s.scalar == Scalar::f32
              ? read(k, static_cast<const float*>(s.centers), static_cast<const float*>(s.radii))
              : read(k, static_cast<const double*>(s.centers), static_cast<const double*>(s.radii));
      host[q].filter = {s.family ? s.family[k] : 0, s.mask ? s.mask[k] : 0, 0}, host[q].number = k;
    }
    record_kernel<<<blocks_of_loop(moving, kThreads), kThreads, 0, stream>>>(
        copied(records_, host, moving, stream), moving, to, tags, n);
  }
  cuda_launched("copy the spheres");
  loose_.centers = &to->x, loose_.radii = &to->r, loose_.center_stride = loose_.radius_stride = 4;
  loose_.family = tags, loose_.mask = tags + n, loose_.owner = tags + 2 * std::uint64_t(n);
  loose_.count = n, loose_.wide = loose_.filtered = true;
}

// The host builds the table of what is static, once for each revision and margin. It is that of the OpenMP
// backend.
bool BodyInput::build_table(cudaStream_t stream) {
  const std::uint32_t count = view_.count - view_.moving;
  std::vector<Sphere> balls(count);
  place_all(part_of_bodies(), view_.moving, view_.count, stream);
  if (count)
    cuda_check(cudaMemcpyAsync(balls.data(), view_.balls + view_.moving, count * sizeof(Sphere),
                               cudaMemcpyDeviceToHost, stream),
               "read what is static");
  cuda_check(cudaStreamSynchronize(stream), "read what is static");
  if (!table_.build(balls, view_.moving)) return false;
  static_extent_ = 0;
  for (const Sphere& b : balls)
    static_extent_ =
        std::max({static_extent_, std::abs(b.x) + b.r, std::abs(b.y) + b.r, std::abs(b.z) + b.r});
  std::copy_n(table_.bounds, kMaxLevels, static_view_.bounds);
  static_view_.starts = copied(static_starts_, table_.starts.data(), table_.starts.size(), stream);
  static_view_.elements = copied(static_elements_, table_.elements.data(), count, stream);
  static_view_.balls = copied(static_balls_, table_.balls.data(), count, stream);
  cuda_check(cudaStreamSynchronize(stream), "copy what is static");
  return true;
}

}  // namespace padder::detect::cuda
