// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/bodies.h"

#include <algorithm>
#include <cub/device/device_scan.cuh>

#include "detect/cuda/bodies/narrow_phase.h"

namespace padder::detect::cuda {
namespace {

constexpr int kThreads = 256;
unsigned blocks_for(std::uint64_t n) {
  return static_cast<unsigned>(std::clamp<std::uint64_t>((n + kThreads - 1) / kThreads, 1, kProcessors * 32));
}

__global__ void __launch_bounds__(kThreads)
    place_kernel(BodyView v, Source loose, std::uint32_t first, std::uint32_t end) {
  for (std::uint32_t k = first + blockIdx.x * kThreads + threadIdx.x; k < end; k += gridDim.x * kThreads) {
    const Element e = v.elements[k];
    if (e.body == kLoose) {
      v.balls[k] = ball_of(loose.sphere(e.piece));
      const Filter f = loose.filter(e.piece);
      v.family[k] = f.family, v.mask[k] = f.mask, v.owner[k] = f.owner;
    } else {
      const Body& body = v.bodies[e.body];
      v.balls[k] = ball_of(body, v.pieces[e.piece]);
      v.family[k] = body.family, v.mask[k] = body.mask, v.owner[k] = owner_of(e.body, body.is_static);
    }
  }
}
__device__ void put(Body& to, const Pose& pose) {
  for (int k = 0; k < 9; k++) to.rotation[k] = pose.rotation[k];
  for (int k = 0; k < 3; k++) to.position[k] = pose.position[k];
}
__global__ void moved_kernel(const MovedBody* moved, std::uint32_t count, Body* bodies) {
  for (std::uint32_t k = blockIdx.x * kThreads + threadIdx.x; k < count; k += gridDim.x * kThreads)
    put(bodies[moved[k].body], moved[k].pose);
}
// A thread for each number of a pose. `list` null: all; `moving`: but those of static bodies, which are where
// they were put.
__global__ void __launch_bounds__(kThreads) pose_kernel(const Pose* poses, const std::uint32_t* list,
                                                        std::uint32_t count, Body* bodies, bool moving) {
  const std::uint64_t all = 12 * std::uint64_t(count);
  for (std::uint64_t k = blockIdx.x * kThreads + threadIdx.x; k < all;
       k += std::uint64_t(gridDim.x) * kThreads) {
    const auto b = static_cast<std::uint32_t>(k / 12), c = static_cast<std::uint32_t>(k % 12);
    const std::uint32_t body = list ? list[b] : b;
    if (moving && bodies[body].is_static) continue;
    if (c < 9)
      bodies[body].rotation[c] = poses[body].rotation[c];
    else
      bodies[body].position[c - 9] = poses[body].position[c - 9];
  }
}
// Loose spheres to the array of our own; `list` null: all.
__global__ void loose_kernel(Source from, const std::uint32_t* list, std::uint32_t count, Sphere* to,
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

template <class T>
T* copied(Buffer<T>& to, const T* from, std::uint64_t count, cudaStream_t stream) {
  T* p = to.reserve(count);
  if (count)
    cuda_check(cudaMemcpyAsync(p, from, count * sizeof(T), cudaMemcpyHostToDevice, stream),
               "copy the bodies");
  return p;
}

}  // namespace

BodySearch::BodySearch(MemoryBook& book)
    : book_(book),
      input_(book),
      tools_(book),
      bodies_(book, "the bodies"),
      poses_(book, "the poses"),
      elements_(book, "the pieces of bodies"),
      pieces_(book, "the pieces of bodies"),
      spheres_(book, "the shapes"),
      balls_(book, "the balls about bodies"),
      loose_spheres_(book, "the spheres"),
      static_balls_(book, "what is static"),
      near_(book, "the shapes"),
      numbers_(book, "the shapes"),
      body_first_(book, "the bodies"),
      tags_(book, "families and masks"),
      loose_tags_(book, "families and masks"),
      moving_list_(book, "what moves"),
      static_starts_(book, "what is static"),
      static_elements_(book, "what is static"),
      records_(book, "what moved"),
      host_records_(book, "what moved", true),
      moved_(book, "what moved"),
      host_moved_(book, "what moved", true),
      pairs_(book, "the bodies that meet"),
      hits_(book, "the contacts") {}

BodySearch::Tools::Tools(MemoryBook& book)
    : surveyor(book),
      orderer(book),
      search(book),
      ranks(book, "the order of the list"),
      batch_counts(book, "the order of the list"),
      query_counts(book, "what is static"),
      batch_places(book, "the order of the list"),
      query_places(book, "what is static"),
      scratch(book, "sums"),
      counters(book, "counters"),
      host_counters(book, "counters", true) {}

bool BodySearch::knows(const Input& input) const {
  return input.revision != 0 && input.revision == revision_ && input.bodies.size() == known_bodies_ &&
         input.spheres.count == known_loose_;
}

void BodySearch::read_all(const Input& input, cudaStream_t stream) {
  const std::uint64_t n = input.bodies.size();
  const Spheres& s = input.spheres;
  std::vector<std::uint8_t> is_static;
  if (s.is_static && s.memory == Memory::device) {
    is_static.resize(s.count);
    cuda_check(cudaMemcpyAsync(is_static.data(), s.is_static, s.count, cudaMemcpyDeviceToHost, stream),
               "read what is static");
    cuda_check(cudaStreamSynchronize(stream), "read what is static");
  }
  assembly_.update(input, is_static.empty() ? s.is_static : is_static.data());
  moving_bodies_.clear(), moving_loose_.clear();
  for (std::uint32_t e = 0; e < assembly_.moving; e++) {
    const Element el = assembly_.elements[e];
    if (el.body == kLoose)
      moving_loose_.push_back(el.piece);
    else if (moving_bodies_.empty() || moving_bodies_.back() != el.body)
      moving_bodies_.push_back(el.body);
  }
  const Pieces& p = assembly_.pieces;
  view_ = {};
  Body* bodies = copied(bodies_, input.bodies.data(), n, stream);
  view_.bodies = bodies;
  view_.elements = copied(elements_, assembly_.elements.data(), assembly_.elements.size(), stream);
  view_.pieces = copied(pieces_, p.pieces.data(), p.pieces.size(), stream);
  view_.spheres = copied(spheres_, p.spheres.data(), p.spheres.size(), stream);
  view_.numbers = copied(numbers_, p.numbers.data(), p.numbers.size(), stream);
  view_.near = copied(near_, reinterpret_cast<const float4*>(p.near.data()), p.near.size(), stream);
  view_.body_first = copied(body_first_, assembly_.body_first.data(), assembly_.body_first.size(), stream);
  view_.count = static_cast<std::uint32_t>(assembly_.elements.size()), view_.moving = assembly_.moving;
  view_.loose_first = assembly_.body_first.back();
  view_.balls = balls_.reserve(view_.count);
  view_.family = tags_.reserve(3 * std::uint64_t(view_.count));
  view_.mask = view_.family + view_.count, view_.owner = view_.mask + view_.count;
  std::vector<std::uint32_t> lists = moving_bodies_;
  lists.insert(lists.end(), moving_loose_.begin(), moving_loose_.end());
  copied(moving_list_, lists.data(), lists.size(), stream);
  if (input.poses && n) {
    const Pose* poses =
        input.pose_memory == Memory::device ? input.poses : copied(poses_, input.poses, n, stream);
    pose_kernel<<<blocks_for(12 * n), kThreads, 0, stream>>>(poses, nullptr, static_cast<std::uint32_t>(n),
                                                             bodies, input.revision != 0);
    cuda_launched("place the bodies");
  }
  cuda_check(cudaStreamSynchronize(stream), "copy the bodies");  // the vectors must outlive their copies
  known_bodies_ = n, known_loose_ = s.count;
}

// The poses of what moves; only these few bytes travel. Poses in host memory are in `bodies` (revision.h).
void BodySearch::read_moved(const Input& input, cudaStream_t stream) {
  Body* bodies = bodies_.data();
  const auto count = static_cast<std::uint32_t>(moving_bodies_.size());
  if (input.poses && input.pose_memory == Memory::device) {
    if (count)
      pose_kernel<<<blocks_for(12 * std::uint64_t(count)), kThreads, 0, stream>>>(
          input.poses, moving_list_.data(), count, bodies, false);
    cuda_launched("place the bodies");
    return;
  }
  if (input.moved.empty()) return;
  MovedBody* host = host_moved_.reserve(input.moved.size());
  std::uint32_t n = 0;
  for (const std::uint32_t b : input.moved) {
    const Body& body = input.bodies[b];
    if (body.is_static) continue;
    std::copy_n(body.rotation, 9, host[n].pose.rotation),
        std::copy_n(body.position, 3, host[n].pose.position);
    host[n++].body = b;
  }
  if (n == 0) return;
  MovedBody* device = copied(moved_, host, n, stream);
  moved_kernel<<<blocks_for(n), kThreads, 0, stream>>>(device, n, bodies);
  cuda_launched("place the bodies");
}

// Without static ones the loose spheres are read as they are given, in every call. With static ones they are
// kept in an array of our own, in which what moves is renewed.
void BodySearch::read_loose(const Input& input, bool known, cudaStream_t stream) {
  const Spheres& s = input.spheres;
  const auto n = static_cast<std::uint32_t>(s.count);
  loose_ = {};
  if (n == 0) return;
  Input only;
  only.spheres = s;
  if (!s.is_static) {
    loose_ = input_.source(only, stream);
    return;
  }
  Sphere* to = loose_spheres_.reserve(n);
  std::uint32_t* tags = loose_tags_.reserve(3 * std::uint64_t(n));
  const auto moving = static_cast<std::uint32_t>(moving_loose_.size());
  if (!known) {
    loose_kernel<<<blocks_for(n), kThreads, 0, stream>>>(input_.source(only, stream), nullptr, n, to, tags,
                                                         n);
  } else if (moving > 0 && s.memory == Memory::device) {
    loose_kernel<<<blocks_for(moving), kThreads, 0, stream>>>(
        input_.source(only, stream), moving_list_.data() + moving_bodies_.size(), moving, to, tags, n);
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
    record_kernel<<<blocks_for(moving), kThreads, 0, stream>>>(copied(records_, host, moving, stream), moving,
                                                               to, tags, n);
  }
  cuda_launched("copy the spheres");
  loose_.centers = &to->x, loose_.radii = &to->r, loose_.center_stride = loose_.radius_stride = 4;
  loose_.family = tags, loose_.mask = tags + n, loose_.owner = tags + 2 * std::uint64_t(n);
  loose_.count = n, loose_.wide = loose_.filtered = true;
}

void BodySearch::place(std::uint32_t first, std::uint32_t end, cudaStream_t stream) {
  if (first == end) return;
  place_kernel<<<blocks_for(end - first), kThreads, 0, stream>>>(view_, loose_, first, end);
  cuda_launched("place the balls about bodies");
}

// The table is made by the host, once; it is the one the OpenMP backend uses.
bool BodySearch::build_table(cudaStream_t stream) {
  const std::uint32_t count = view_.count - view_.moving;
  std::vector<Sphere> balls(count);
  place(view_.moving, view_.count, stream);
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

void BodySearch::make_plan(const Options& options, const Output& output, int processors) {
  plan_ = {};
  plan_.view = view_, plan_.loose = loose_, plan_.output = output, plan_.own = options.own;
  plan_.statics = static_view_, plan_.static_grid = table_.grid, plan_.static_count = table_.count;
  plan_.grid = choose_grid(summary_, 0), plan_.method = method_, plan_.moves = book_.moves;
  plan_.stable_order = options.order == Order::stable;
  if (plan_.stable_order) plan_.share = share_;
  plan_.octaves = needs_octaves(summary_), plan_.top = exponent_of(summary_.need_max);
  plan_.processors = processors;
  plan_.pairs.pairs = pairs_.data(), plan_.pairs.capacity = pairs_.capacity();
  plan_.pairs.width = Width::pairs;
  plan_.hits = hits_.data(), plan_.hit_room = hits_.capacity();
  Source& b = plan_.balls;
  b.centers = &view_.balls->x, b.radii = &view_.balls->r, b.center_stride = b.radius_stride = 4;
  b.family = view_.family, b.mask = view_.mask, b.owner = view_.owner;
  b.count = view_.moving, b.wide = b.filtered = true;
}

void BodySearch::meet_static(const Plan& plan, Tools& tools, cudaStream_t stream) {
  const std::uint32_t moving = plan.view.moving;
  if (plan.static_count == 0 || moving == 0) return;
  StaticTask t{plan.view, plan.statics, plan.pairs.pairs, plan.pairs.capacity,
               tools.query_counts.reserve(moving)};
  unsigned long long* places = tools.query_places.reserve(moving);
  t.places = places, t.counters = tools.counters.data();
  count_static(t, plan.static_grid, stream);
  std::size_t bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, bytes, t.counts, places, moving, stream);
  void* scratch = tools.scratch.reserve(bytes);
  cuda_check(cub::DeviceScan::ExclusiveSum(scratch, bytes, t.counts, places, moving, stream), "scan");
  write_static(t, plan.static_grid, stream);
}

// The spheres of all elements that met.
void BodySearch::meet_all(const Plan& plan, Tools& tools, MeetTask& t, cudaStream_t stream) {
  if (!plan.stable_order) return meet(t, stream);
  const std::uint64_t batches = (plan.pairs.capacity + kBatch - 1) / kBatch;
  t.ranks = tools.ranks.reserve(plan.hit_room), t.batch_counts = tools.batch_counts.reserve(batches);
  meet(t, stream);
  if (batches <= kMostBatches) return;
  unsigned long long* places = tools.batch_places.reserve(batches);
  t.batch_places = places;
  std::size_t bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, bytes, t.batch_counts, places, batches, stream);
  void* scratch = tools.scratch.reserve(bytes);
  cuda_check(cub::DeviceScan::ExclusiveSum(scratch, bytes, t.batch_counts, places, batches, stream), "scan");
}

void BodySearch::expect_report(const Plan& plan, Tools& tools) {
  tools.report.clear();
  if (plan.view.moving > 0 && plan.with_survey)
    tools.surveyor.read(plan.balls, plan.octaves, false, tools.report);
  tools.report.add(tools.counters.reserve(1), tools.host_counters.reserve(1), sizeof(BodyCounters));
  tools.report.expect();
}

// One pass over the device, up to the counters on the host.
void BodySearch::enqueue(const Plan& plan, Tools& tools, cudaStream_t stream, const Mark& mark) {
  BodyCounters* counters = tools.counters.reserve(1);
  cuda_check(cudaMemsetAsync(counters, 0, sizeof *counters, stream), "clear the counters");
  if (plan.view.moving > 0) {
    if (plan.with_survey) tools.surveyor.begin(plan.balls, plan.octaves, plan.top, stream);
    // Both are written after the spheres are in order.
    const Lent lent{reinterpret_cast<float4*>(plan.hits), plan.hit_room,
                    reinterpret_cast<std::uint32_t*>(plan.pairs.pairs), plan.pairs.capacity * 2};
    const Ordered ordered =
        tools.orderer.order(plan.balls, plan.grid, SlotKind::fixed_point, plan.stable_order, plan.method, {},
                            lent, &counters->broad, plan.processors, stream);
    mark(3);
    SearchOptions o;
    o.stable_order = plan.stable_order, o.share = plan.share;
    search(plan.balls, plan.grid, ordered, o, plan.pairs, &counters->broad, tools.search, plan.processors,
           stream);
    meet_static(plan, tools, stream);
    mark(6);
    MeetTask t{plan.view, plan.loose, plan.own};
    t.owns_all = plan.own == Region{}, t.stable_order = plan.stable_order;
    t.pairs = plan.pairs.pairs, t.pair_room = plan.pairs.capacity, t.room = plan.hit_room;
    t.hits = plan.hits, t.counters = counters;
    meet_all(plan, tools, t, stream);
    mark(7);
    write_hits(t, plan.output, stream);
  }
  tools.report.send(stream);
}

// The pass of plan_, to its end; with `side` recorded there.
void BodySearch::pass(cudaStream_t stream, SideStream* side, const Mark& mark) {
  expect_report(plan_, tools_);
  if (side)
    recording_.run(plan_, book_.moves, stream, *side,
                   [&](cudaStream_t s) { enqueue(plan_, tools_, s, [](int) {}); });
  else
    enqueue(plan_, tools_, stream, mark);
  tools_.report.arrived(stream, "search for contacts");
  found_ = *tools_.host_counters.data();
}

bool BodySearch::ordinary(const Options& options) const {
  if (summary_.first_fault != ~std::uint64_t(0)) return false;
  return options.width == Width::pairs || options.scalar == Scalar::f64 ||
         std::max(summary_.extent + summary_.radius_max, static_extent_) <= 1e37;
}

bool BodySearch::run(const Input& input, const Options& options, const Room& output, std::uint64_t& contacts,
                     cudaStream_t stream, SideStream& side, int processors, const Mark& mark) {
  const bool known = knows(input);
  const std::uint64_t revision = input.revision;
  revision_ = 0;  // known again when all went well
  known ? read_moved(input, stream) : read_all(input, stream);
  read_loose(input, known, stream);
  if (!known && !build_table(stream)) return false;
  place(0, view_.moving, stream);
  mark(-1);
  pairs_.reserve(4 * std::uint64_t(view_.moving) + 1024);
  hits_.reserve(1024);
  Output out = output(hits_.capacity());
  bool done = false;
  if (known && hope_ > 0 && view_.moving > 0) {
    make_plan(options, out, processors);
    plan_.with_survey = true;
    pass(stream, options.timings ? nullptr : &side, mark);  // marks wait for the device: not when recorded
    const Grid grid = plan_.grid;
    done = tools_.surveyor.finish(plan_.balls, plan_.octaves, plan_.top, false, summary_);
    if (done) {
      if (!ordinary(options)) return false;
      done = grid == choose_grid(summary_, 0) && !(found_.broad.flags & kOutside) &&
             summary_.octave[kOctaves - 1].count == 0;
    }
    hope_ = done ? 1 : -4;
  }
  if (!done) {
    if (hope_ <= 0) hope_++;
    method_ = OrderMethod::automatic;
    summary_ = {};
    if (view_.moving > 0) {
      make_plan(options, out, processors);
      summary_ = tools_.surveyor.survey(plan_.balls, stream);
    }
    if (!ordinary(options)) return false;
    mark(0);
    make_plan(options, out, processors);
    pass(stream, nullptr, mark);
  }
  // Whatever was too small was counted to its end; it is made larger and the pass repeated. So is a list of
  // pairs in the order of another length.
  while (true) {
    const BodyCounters& found = found_;
    const std::uint64_t pairs = found.broad.contacts + found.static_pairs;
    const bool fixed = plan_.stable_order && view_.moving > 0;
    const Share share =
        fixed ? share_for(found.broad, view_.moving, plan_.grid, SlotKind::fixed_point) : Share{};
    const bool known = !fixed || share == plan_.share;
    const std::uint64_t spilled = fixed ? found.broad.spilled : 0;
    if (found.broad.flags & kOutside) throw Error(kChanged);
    if (found.broad.flags & kCrowded) {
      method_ = OrderMethod::sort;
    } else if (pairs > pairs_.capacity() || !known || spilled > tools_.search.spill.capacity()) {
      if (pairs > pairs_.capacity()) pairs_.reserve(pairs + pairs / 8);
      if (fixed)
        tools_.search.spill.reserve(known ? spilled + spilled / 8 : pairs / 16 + 4096), share_ = share;
    } else if (found.contacts > std::min(hits_.capacity(), out.capacity)) {
      hits_.reserve(found.contacts + found.contacts / 8);
      out = output(hits_.capacity());
    } else {
      contacts = found.contacts;
      break;
    }
    make_plan(options, out, processors);
    pass(stream, nullptr, mark);
  }
  mark(8);
  revision_ = revision;
  return true;
}

}  // namespace padder::detect::cuda
