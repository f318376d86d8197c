// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/body_input.h"

#include <algorithm>

#include "detect/cuda/device/blocks.h"

namespace padder::detect::cuda {
namespace {

constexpr unsigned kThreads = 256;

// The elements of a block, whose first takes place `to`.
struct ElementRun {
  std::uint32_t number[kThreads], to, count;
};

// Those of elements `base` to `end`, a run at most, that are chosen. By the whole block.
__device__ void choose_run(const ChosenElements& chosen, std::uint32_t base, std::uint32_t end,
                           ElementRun& run) {
  const std::uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32, k = base + threadIdx.x;
  std::uint32_t at = threadIdx.x, to = base, count = min(end - base, kThreads);
  bool mine = k < end;
  if (chosen.bits) {
    const std::uint32_t* const words = chosen.bits + base / 32;
    to = static_cast<std::uint32_t>(chosen.before[base / kThreads]), count = at = 0;
    for (std::uint32_t w = 0; w < kThreads / 32; w++) {
      const std::uint32_t word = words[w];
      if (w == warp) at = count + __popc(word & ((1u << lane) - 1)), mine = word >> lane & 1;
      count += __popc(word);
    }
  }
  if (threadIdx.x == 0) run.to = to, run.count = count;
  if (mine) run.number[at] = k;
  __syncthreads();
}

// Elements `first` to `end`, or those of them that are chosen, one after the other. Poses that are neither
// read in place nor with the bodies are brought there. A block reads the poses of its elements together,
// number by number, since they may lie on another GPU.
__global__ void __launch_bounds__(kThreads)
    place_kernel(const __grid_constant__ BodyView v, Body* bodies, const __grid_constant__ PoseParts parts,
                 ChosenElements chosen, const __grid_constant__ DeviceSpheres loose, double grown_by,
                 std::uint32_t first, std::uint32_t end) {
  static_assert(kThreads == ChosenElements::kRun);
  __shared__ double poses[kThreads][13];  // odd, against conflicts of banks
  __shared__ ElementRun run;
  for (std::uint32_t base = first + blockIdx.x * kThreads; base < end; base += gridDim.x * kThreads) {
    choose_run(chosen, base, end, run);
    for (std::uint32_t n = threadIdx.x; n < 12 * run.count; n += kThreads) {
      const std::uint32_t at = n / 12, c = n % 12, body = v.elements[run.number[at]].body;
      if (body == kLoose) continue;
      const PosePart& part = part_of(parts, body);
      const double value = part.poses[std::uint64_t(body - part.first) * part.step + c];
      poses[at][c] = value;
      if (part.poses != v.in_place.poses && part.poses != bodies->rotation)
        reinterpret_cast<double*>(bodies + body)[c] = value;
    }
    __syncthreads();
    if (threadIdx.x < run.count) {
      const std::uint32_t k = run.to + threadIdx.x;
      const Element e = v.elements[run.number[threadIdx.x]];
      Sphere ball;
      Filter f;
      if (e.body == kLoose) {
        const Sphere sphere = loose.sphere(e.piece);
        ball = ball_of(sphere), v.stances[k] = stance_of(e, sphere, ball), f = loose.filter(e.piece);
      } else {
        const Body body = body_at_pose(poses[threadIdx.x]);
        const Body& tags = v.bodies[e.body];
        ball = ball_of(body, v.pieces[e.piece]);
        v.stances[k] = stance_of(body, e, v.pieces[e.piece], ball);
        f = {tags.family, tags.mask, owner_of(e.body, tags.is_static)};
      }
      if (grown_by > 0) ball.r += grown_by;  // stances are those of the balls themselves
      v.balls[k] = ball, v.family[k] = f.family, v.mask[k] = f.mask, v.owner[k] = f.owner;
    }
    __syncthreads();  // all have read what the next round writes over
  }
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

// Which loose spheres are static.
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

}  // namespace

BodyInput::BodyInput(MemoryBook& book)
    : copy_(book),
      arrays_(book),
      of_region_(book),
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

bool BodyInput::read(const Input& input, double margin, const Region& own, cudaStream_t stream) {
  const bool known = knows(input), table_known = known && margin == margin_;
  forget(), margin_ = margin;
  if (!known)
    read_all(input, stream);
  else if (!has_device_poses(input))
    arrays_.move(input, stream);
  read_loose(input, known, stream);
  if (!table_known && !build_table(stream)) return false;
  near_ = view_;
  if (view_.moving == 0) return true;
  const bool limited = !(own == Region{});
  if (limited) of_region_.begin(input, loose_, own, margin, stream);
  const PoseParts parts = find_poses(input, limited, stream);
  near_.in_place = arrays_.in_place(input);
  if (has_device_poses(input)) arrays_.expect_poses(!limited && near_.in_place.count == 0);
  ChosenElements chosen;
  if (limited) chosen = of_region_.choose(view_, parts, stream);
  place(near_, parts, chosen, 0, view_.moving, stream);
  if (limited) near_.moving = of_region_.count(stream);
  return true;
}

// Where the poses of this call are; with marks of the bodies that are near, if it is limited to a box.
PoseParts BodyInput::find_poses(const Input& input, bool limited, cudaStream_t stream) {
  PoseParts parts;
  if (input.poses_around) {
    std::copy(input.poses_around->parts.begin(), input.poses_around->parts.end(), parts.part);
  } else {
    PosePart& all = parts.part[0] = part_of_bodies();
    if (has_device_poses(input)) all.poses = input.poses->rotation, all.step = sizeof(Pose) / sizeof(double);
    if (limited) all.marks = of_region_.mark(all, stream);
  }
  return parts;
}
// Those with the bodies.
PosePart BodyInput::part_of_bodies() const {
  return {reinterpret_cast<const double*>(view_.bodies), nullptr, 0,
          static_cast<std::uint32_t>(known_bodies_), sizeof(Body) / sizeof(double)};
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
  of_region_.forget();
  view_ = arrays_.read(input, assembly_.pieces, assembly_.body_first, stream);
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

void BodyInput::place(const BodyView& view, const PoseParts& parts, const ChosenElements& chosen,
                      std::uint32_t first, std::uint32_t end, cudaStream_t stream) {
  if (first == end) return;
  // More than half of the margin, by far more than the decisions about it round.
  const double grown_by = 0.5 * margin_ * (1 + 0x1p-40);
  place_kernel<<<blocks_of_loop(end - first, kThreads), kThreads, 0, stream>>>(
      view, arrays_.bodies(), parts, chosen, loose_, grown_by, first, end);
  cuda_launched("place the balls about bodies");
}

// The host builds the table of what is static, once for each revision and margin. It is that of the OpenMP
// backend.
bool BodyInput::build_table(cudaStream_t stream) {
  const std::uint32_t count = view_.count - view_.moving;
  std::vector<Sphere> balls(count);
  place(view_, {{part_of_bodies()}}, {}, view_.moving, view_.count, stream);
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
