// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/world_scene.h"

#include <cub/device/device_radix_sort.cuh>

#include "detect/core/input.h"
#include "detect/cuda/device/each.h"
#include "detect/cuda/worlds/curve.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;
// A world of more elements is sorted along the curve in every call; a smaller one, and kEveryWorld, when its
// revision is new, or for a list of stable order.
constexpr std::uint32_t kLargeWorld = 4096;

// The index of the first of worlds[0 .. n) that is `world` or more.
__device__ std::uint32_t first_of(const std::uint32_t* worlds, std::uint32_t n, std::uint64_t world) {
  std::uint32_t low = 0, high = n;
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (worlds[middle] < world)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

// A ball in float that contains it; of infinite radius where a float does not reach.
__device__ __forceinline__ float4 near_ball(const Sphere& s) {
  const double far = magnitude(s.x) + magnitude(s.y) + magnitude(s.z);
  return make_float4(static_cast<float>(s.x), static_cast<float>(s.y), static_cast<float>(s.z),
                     far < 0x1p126 ? float_above(s.r + 0x1p-23 * far + 0x1p-140) : INFINITY);
}

// Places element k of the tree, and reports faults.
__device__ void place(const WorldScene& scene, std::uint32_t k, std::uint32_t worlds, double& extent) {
  const BodyView& v = scene.view;
  const WorldElement e = scene.elements[k];
  Sphere ball;
  if (e.body == kLoose) {
    ball = scene.loose.sphere(e.piece);
    scene.elements[k].filter = scene.loose.filter(e.piece);  // the caller may have changed it
    if (fault_of(ball) != Fault::none)
      atomicMin(&scene.report->fault, static_cast<unsigned long long>(v.loose_first) + e.piece);
    if (v.stances) v.stances[k] = stance_of({e.body, e.piece}, ball, ball_of(ball));
  } else {
    const Body body = v.placed_body(e.body);
    const Piece& piece = v.pieces[e.piece];
    ball = ball_of(body, piece);
    if (!(ball.r < INFINITY)) {  // a fault, or so far out that there are no balls
      for (std::uint32_t q = piece.first; q < piece.first + piece.count; q++)
        if (fault_of(placed(body, v.spheres[q])) != Fault::none)
          atomicMin(&scene.report->fault,
                    static_cast<unsigned long long>(v.body_first[e.body]) + v.numbers[q]);
      ball = {0, 0, 0, INFINITY};
    }
    if (v.stances) v.stances[k] = stance_of(body, {e.body, e.piece}, piece, ball);
  }
  v.balls[k] = ball;
  scene.near_balls[k] = near_ball(ball);
  if (e.world >= worlds && e.world != kEveryWorld)
    atomicMin(&scene.report->world_fault, static_cast<unsigned long long>(scene.order[k]));
  extent = larger(larger(magnitude(ball.x), magnitude(ball.y)), magnitude(ball.z)) + ball.r;
}
__global__ void __launch_bounds__(kThreads) place_kernel(WorldScene scene, std::uint32_t worlds) {
  double most = 0;
  for (std::uint64_t k = blockIdx.x * std::uint64_t(kThreads) + threadIdx.x; k < scene.count;
       k += std::uint64_t(gridDim.x) * kThreads) {
    double extent;
    place(scene, static_cast<std::uint32_t>(k), worlds, extent);
    most = larger(most, extent);
  }
  auto bits = static_cast<unsigned long long>(__double_as_longlong(most));  // ordered as the numbers are
  for (int d = 16; d; d >>= 1) bits = max(bits, __shfl_xor_sync(~0u, bits, d));
  if ((threadIdx.x & 31) == 0 && bits > *static_cast<volatile unsigned long long*>(&scene.report->extent))
    atomicMax(&scene.report->extent, bits);
}

// A device lambda may not stand in a private member function, so these are functions of their own.
// `from` null: the elements as they are given.
void copy_order(std::uint32_t n, const std::uint32_t* from, std::uint32_t* to, cudaStream_t stream) {
  each(n, stream, "number the elements", [=] __device__(std::uint64_t k) { to[k] = from ? from[k] : k; });
}
void curve_of(const WorldScene& scene, CurveBox* box, std::uint64_t* curve, cudaStream_t stream) {
  put_on_curve(
      scene.count, [=] __device__(std::uint32_t k) { return scene.ball_given(k); }, box, curve, stream);
}
void read_worlds(const WorldScene& scene, const std::uint32_t* order, std::uint32_t* worlds,
                 cudaStream_t stream) {
  each(scene.count, stream, "read the worlds",
       [=] __device__(std::uint64_t k) { worlds[k] = scene.world_given(order[k]); });
}
// What of the elements does not change from call to call of a revision.
void fill_elements(const WorldScene& scene, cudaStream_t stream) {
  const std::uint32_t n = scene.count;
  each(n, stream, "read the elements", [=] __device__(std::uint64_t k) {
    WorldElement& out = scene.elements[k];
    const Element e = scene.given(scene.order[k]);
    const std::uint32_t world = scene.worlds[k], end = first_of(scene.worlds, n, world + std::uint64_t(1));
    out.body = e.body, out.piece = e.piece, out.world = world, out.world_end = end, out.filter = {};
    if (e.body != kLoose) {
      const Body& body = scene.view.bodies[e.body];
      out.filter = {body.family, body.mask, owner_of(e.body, body.is_static)};
    }
    if (k == 0 || scene.worlds[k - 1] != world) {
      atomicMax(&scene.report->largest, end - k);
      if (world != kEveryWorld) atomicMax(&scene.report->largest_own, end - k);
    }
    if (k == 0) scene.report->every_first = first_of(scene.worlds, n, kEveryWorld);
  });
  // The filter of a loose sphere may change, so that it counts as a partner. 64 are looked at at most.
  each(n, stream, "find the partners", [=] __device__(std::uint64_t k) {
    WorldElement& e = scene.elements[k];
    const std::uint32_t last = min(e.world_end, static_cast<std::uint32_t>(k) + 1 + kSmallWorld);
    e.partners = k + 1;
    while (e.body != kLoose && e.partners < last && scene.elements[e.partners].body != kLoose &&
           !admitted(e.filter, scene.elements[e.partners].filter))
      e.partners++;
  });
}
void build_tree(const WorldTree& tree, TreeBox* nodes, cudaStream_t stream) {
  for (std::uint32_t level = 1; level <= tree.levels; level++)
    each(tree.first[level + 1] - tree.first[level], stream, "build the tree of worlds",
         [=] __device__(std::uint64_t k) {
           nodes[tree.first[level] + k] = box_of_node(tree, level, static_cast<std::uint32_t>(k));
         });
}

}  // namespace

WorldInput::WorldInput(MemoryBook& book, PosedBodies& posed)
    : copy_(book, posed),
      posed_(posed),
      arrays_(book),
      elements_(book, "the pieces of bodies"),
      balls_(book, "the balls about bodies"),
      near_balls_(book, "the balls about bodies"),
      stances_(book, "the balls about bodies"),
      order_(book, "the order of worlds"),
      spare_order_(book, "the order of worlds"),
      worlds_(book, "worlds"),
      spare_worlds_(book, "worlds"),
      curve_(book, "the order of worlds"),
      spare_curve_(book, "the order of worlds"),
      curve_box_(book, "the order of worlds"),
      tree_elements_(book, "the tree of worlds"),
      nodes_(book, "the tree of worlds"),
      scratch_(book, "sorting"),
      report_(book, "the report"),
      host_report_(book, "the report", true) {}

void WorldInput::read_bodies(const Input& input, cudaStream_t stream) {
  host_pieces_.update(input.shapes);
  host_elements_.clear();
  std::vector<std::uint32_t> first(1, 0);
  for (std::size_t b = 0; b < input.bodies.size(); b++) {
    const std::uint32_t shape = input.bodies[b].shape;
    first.push_back(first.back() + static_cast<std::uint32_t>(input.shapes[shape].count));
    for (std::uint32_t p = host_pieces_.shape_first[shape]; p < host_pieces_.shape_first[shape + 1]; p++)
      host_elements_.push_back({static_cast<std::uint32_t>(b), p});
  }
  worlds_of_bodies_ = 0;
  for (std::size_t b = 0; b < input.bodies.size(); b++)
    if (const std::uint32_t world = input.bodies[b].world; world != kEveryWorld && world >= worlds_of_bodies_)
      worlds_of_bodies_ = world + 1, last_world_body_ = b;
  scene_ = {};
  scene_.view = arrays_.read(input, posed_.read(input, stream), host_pieces_, first, stream);
  scene_.pieces_given = copied(elements_, host_elements_.data(), host_elements_.size(), stream);
  scene_.of_bodies = static_cast<std::uint32_t>(host_elements_.size());
  cuda_check(cudaStreamSynchronize(stream), "copy the bodies");  // the vectors must outlive their copies
}

// Sorts the elements by world, and inside a world along the curve or as they were given.
void WorldInput::sort(bool along_curve, cudaStream_t stream) {
  const std::uint32_t n = scene_.count;
  std::uint32_t *order = order_.reserve(n), *spare = spare_order_.reserve(n), *worlds = worlds_.reserve(n),
                *spare_worlds = spare_worlds_.reserve(n);
  copy_order(n, nullptr, spare, stream);
  std::size_t bytes = 0;
  if (along_curve) {
    std::uint64_t *curve = curve_.reserve(n), *sorted = spare_curve_.reserve(n);
    curve_of(scene_, curve_box_.reserve(1), curve, stream);
    const auto by_curve = [&](void* room) {
      cuda_check(cub::DeviceRadixSort::SortPairs(room, bytes, curve, sorted, spare, order, n, 0, 63, stream),
                 "sort the elements");
    };
    by_curve(nullptr), by_curve(scratch_.reserve(bytes));
    copy_order(n, order, spare, stream);
  }
  read_worlds(scene_, spare, spare_worlds, stream);
  const auto by_world = [&](void* room) {
    cuda_check(
        cub::DeviceRadixSort::SortPairs(room, bytes, spare_worlds, worlds, spare, order, n, 0, 32, stream),
        "sort the elements");
  };
  by_world(nullptr), by_world(scratch_.reserve(bytes));
}

void WorldInput::order(bool along_curve, cudaStream_t stream) {
  const std::uint32_t n = scene_.count;
  sort(along_curve, stream);
  scene_.order = order_.data(), scene_.worlds = worlds_.data();
  scene_.elements = tree_elements_.reserve(n);
  fill_elements(scene_, stream);
  WorldReport* host = host_report_.reserve(1);
  cuda_check(cudaMemcpyAsync(host, scene_.report, sizeof *host, cudaMemcpyDeviceToHost, stream),
             "find the worlds");
  cuda_check(cudaStreamSynchronize(stream), "find the worlds");
  found_ = *host;
  scene_.tree.every_first = found_.every_first;
}

bool WorldInput::read(const Input& input, const Wanted& wanted, cudaStream_t stream) {
  const Spheres& s = input.spheres;
  const std::uint64_t loose = loose_count(input);
  const bool known = knows(input);
  std::optional<std::uint32_t> world_of_loose;
  if (!s.world && !(input.around && input.around->spheres.world)) world_of_loose = s.world_of_all;
  const bool same_order =
      known && loose == known_loose_ && world_of_loose && world_of_loose == known_world_of_loose_;
  revision_ = 0;  // until keep()
  if (known)
    scene_.view.in_place = posed_.move_in_place(input, stream);
  else
    read_bodies(input, stream);
  if (worlds_of_bodies_ > wanted.worlds)
    throw Error(world_sentence(false, last_world_body_, worlds_of_bodies_ - 1, wanted.worlds));
  known_bodies_ = input.bodies.size(), known_loose_ = loose;
  known_world_of_loose_ = world_of_loose;
  Input only;
  only.spheres = s, only.around = input.around;
  scene_.loose = copy_.source(only, stream);
  scene_.count = scene_.of_bodies + static_cast<std::uint32_t>(loose);
  const std::uint32_t n = scene_.count;
  scene_.report = report_.reserve(1);
  cuda_check(cudaMemsetAsync(scene_.report, 0xff, offsetof(WorldReport, extent), stream), "begin");
  cuda_check(
      cudaMemsetAsync(&scene_.report->extent, 0, sizeof(WorldReport) - offsetof(WorldReport, extent), stream),
      "begin");
  if (n == 0) return true;
  if (!same_order) order(false, stream);
  if (found_.largest_own > wanted.elements_of_world) return false;
  if (same_order && !wanted.reproducible ? found_.largest_own > kLargeWorld : found_.largest > kSmallWorld)
    order(true, stream);
  scene_.view.count = n;
  scene_.tree.balls = scene_.view.balls = balls_.reserve(n);
  scene_.near_balls = near_balls_.reserve(n);
  scene_.view.stances = wanted.stances ? stances_.reserve(n) : nullptr;
  const std::uint32_t base = base_of(found_.largest_own, found_.every_first);
  TreeBox* nodes = nodes_.reserve(lay_out(scene_.tree, n, base));
  scene_.tree.nodes = nodes;
  place_kernel<<<blocks_of_loop(n, kThreads), kThreads, 0, stream>>>(scene_, wanted.worlds);
  cuda_launched("place the balls about bodies");
  build_tree(scene_.tree, nodes, stream);
  return true;
}

void WorldInput::check(const WorldReport& report, const Input& input, const CallOptions& options,
                       std::uint32_t worlds, cudaStream_t stream) const {
  if (report.fault != ~0ull) {
    Sphere faulty;
    if (report.fault >= scene_.view.loose_first) {
      faulty =
          sphere_at(scene_.loose, static_cast<std::uint32_t>(report.fault - scene_.view.loose_first), stream);
    } else {
      std::uint64_t before = 0;
      std::size_t b = 0;
      while (before + input.shapes[input.bodies[b].shape].count <= report.fault)
        before += input.shapes[input.bodies[b++].shape].count;
      Body body;
      const double* const pose = scene_.view.pose_of(static_cast<std::uint32_t>(b));
      cuda_check(cudaMemcpyAsync(&body, pose, sizeof(Pose), cudaMemcpyDeviceToHost, stream), "read a body");
      cuda_check(cudaStreamSynchronize(stream), "read a body");
      faulty = placed(body, input.shapes[input.bodies[b].shape].spheres[report.fault - before]);
    }
    throw Error(fault_sentence(report.fault, faulty, input));
  }
  if (report.world_fault != ~0ull) {
    std::uint32_t world = input.spheres.world_of_all;  // of a loose sphere: read() has looked at the bodies
    const std::uint64_t k = report.world_fault - scene_.of_bodies;
    if (scene_.loose.world)
      cuda_check(cudaMemcpy(&world, scene_.loose.world + k, sizeof world, cudaMemcpyDeviceToHost),
                 "read a world");
    throw Error(world_sentence(true, k, world, worlds));
  }
  Summary summary;
  const auto bits = static_cast<std::uint64_t>(report.extent);
  std::memcpy(&summary.extent, &bits, sizeof bits);
  check_range(summary, options);
}

}  // namespace padder::detect::cuda
