// SPDX-License-Identifier: MIT
#include "detect/mpi/rank_detector.h"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "detect/boxes/assignment.h"
#include "detect/boxes/device_worker.h"
#include "detect/core/backend.h"
#include "detect/core/revision.h"
#include "detect/mpi/exchange.h"
#include "detect/mpi/rank_cut.h"
#include "detect/mpi/ranks.h"
#include "detect/mpi/together.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr double kMostImbalance = 1.1;  // of the heaviest rank's work over the mean, before space is cut anew
constexpr std::uint64_t kSampleOfRank = 1 << 14;
constexpr std::uint64_t kTableBytes = 256 << 20;

using Count = unsigned long long;
static_assert(sizeof(Count) == sizeof(std::uint64_t));

// Sums over the ranks, element by element.
template <std::size_t N>
void add_up(MPI_Comm ranks, Count (&values)[N]) {
  MPI_Allreduce(MPI_IN_PLACE, values, N, MPI_UNSIGNED_LONG_LONG, MPI_SUM, ranks);
}

std::uint64_t checksum_of(std::span<const Shape> shapes) {
  std::uint64_t sum = mixed(shapes.size());
  for (const Shape& s : shapes) {
    sum = mixed(sum ^ s.count);
    for (std::uint64_t k = 0; k < s.count; k++)
      for (const double v : {s.spheres[k].x, s.spheres[k].y, s.spheres[k].z, s.spheres[k].r})
        sum = mixed(sum ^ std::bit_cast<std::uint64_t>(v));
  }
  return sum;
}

DeviceChoice device_for(const Ranks& ranks) {
  const int gpus = cuda_device_count();
  if (gpus == 0) return {BackendKind::omp, 0};
  return {BackendKind::automatic, ranks.rank_on_host % gpus};
}

// Threads of one rank. Where MPI has bound the rank to some processors, OpenMP sees only these; where it has
// not, the ranks of a machine share all of them.
int threads_for(const Ranks& ranks, int asked) {
  if (asked > 0) return asked;
  const bool bound = omp_get_num_procs() < ::sysconf(_SC_NPROCESSORS_ONLN);
  return std::max(1, bound ? omp_get_max_threads() : omp_get_max_threads() / ranks.count_on_host);
}

}  // namespace

class RankDetector::Work {
 public:
  Work(MPI_Comm ranks, const RankOptions& options) : ranks_(ranks), options_(options.detector) {
    together(ranks_,
             [&] { worker_ = std::make_unique<DeviceWorker>(options.device.value_or(device_for(ranks_))); });
  }
  const RankReport& run(const Input& part, const ContactConsumer& consumer);
  const RankReport& report() const { return report_; }
  Region region() const { return tree_.region(box()); }
  const char* backend() const { return worker_->on_host() ? "omp" : "cuda"; }
  CallOptions& options() { return options_; }

 private:
  std::uint32_t box() const {
    return static_cast<std::uint32_t>(ranks_.rank) < tree_.boxes() ? static_cast<std::uint32_t>(ranks_.rank)
                                                                   : 0;
  }
  int threads() const { return threads_for(ranks_, options_.threads); }
  Input read(const Input& part);
  Numbering number(const Input& part);
  LoadForm agree(const Input& part, Assignment& assignment);
  void plan(Assignment& assignment);
  void cut(const Assignment& assignment);
  double imbalance(double work) const;
  double expected_imbalance(const Assignment& assignment) const;
  Traffic exchange(const LoadForm& form, const Assignment& assignment);
  BoxLoad& own_load() { return loads_[static_cast<std::size_t>(ranks_.rank)]; }
  void finish(const BoxResult& found);

  Ranks ranks_;
  CallOptions options_;
  std::unique_ptr<DeviceWorker> worker_;
  RevisionKeeper bodies_;
  BoxTree tree_;
  bool has_tree_ = false;
  double density_ = 1;  // work for each sphere given to this rank, in the call before
  bool known_density_ = false, informed_ = false;  // the cut knew the density
  double settled_imbalance_ = 1;                   // what the last cut could reach
  // For each rank, from this part; for this one, from all ranks. Kept, since new memory must be cleared
  // first.
  std::vector<BoxLoad> loads_;
  RankReport report_;
};

// The part with all poses in its bodies, checked.
Input RankDetector::Work::read(const Input& part) {
  check_boxed_options(options_), check_options(options_);
  check_boxed_input(part);
  return bodies_.settle(part);
}

// Where the numbers of this part begin in the scene.
Numbering RankDetector::Work::number(const Input& part) {
  Count mine[3] = {part.bodies.size(), 0, part.spheres.count}, before[3] = {};
  for (const Body& b : part.bodies) mine[1] += part.shapes[b.shape].count;
  MPI_Exscan(mine, before, 3, MPI_UNSIGNED_LONG_LONG, MPI_SUM, ranks_);
  if (ranks_.rank == 0) std::fill_n(before, 3, 0);
  add_up(ranks_, mine);
  report_.bodies = mine[0], report_.spheres = mine[1] + mine[2];
  return {before[0], before[1], mine[1] + before[2]};
}

// What has to be the same on all ranks.
LoadForm RankDetector::Work::agree(const Input& part, Assignment& assignment) {
  const Spheres& s = part.spheres;
  const std::uint64_t sum = checksum_of(part.shapes);
  // The largest of all ranks. The complement of one gives the least.
  enum { doubles, families, masks, statics, worlds, last_world, not_first_world, shapes, not_shapes, all };
  const Count world = s.world_of_all;
  Count flags[all] = {s.count && s.scalar == Scalar::f64,
                      s.count && s.family,
                      s.count && s.mask,
                      s.count && s.is_static,
                      s.count && s.world,
                      s.count ? world : 0,
                      s.count ? ~world : 0,
                      sum,
                      ~sum};
  MPI_Allreduce(MPI_IN_PLACE, flags, all, MPI_UNSIGNED_LONG_LONG, MPI_MAX, ranks_);
  if (flags[shapes] != ~flags[not_shapes])
    throw Error("the ranks were given different shapes: give all of them the same");
  double radius = assignment.largest_radius();
  MPI_Allreduce(MPI_IN_PLACE, &radius, 1, MPI_DOUBLE, MPI_MAX, ranks_);
  assignment.raise_largest_radius(radius);
  return {flags[doubles] ? Scalar::f64 : Scalar::f32,
          flags[families] != 0,
          flags[masks] != 0,
          flags[statics] != 0,
          flags[worlds] != 0 || flags[last_world] != ~flags[not_first_world],
          static_cast<std::uint32_t>(flags[last_world])};
}

// Counts the spheres of each box, and cuts anew when there is no cut yet or the work has become uneven.
void RankDetector::Work::plan(Assignment& assignment) {
  bool fresh = !has_tree_;
  if (!fresh) {
    together(ranks_, [&] { assignment.count(tree_, kTableBytes); });
    fresh = expected_imbalance(assignment) > std::max(kMostImbalance, 1.05 * settled_imbalance_);
  }
  if (!fresh) return;
  cut(assignment);
  together(ranks_, [&] { assignment.count(tree_, kTableBytes); });
}

// Each sphere weighs what spheres of its box cost in the call before: itself, and its contacts.
void RankDetector::Work::cut(const Assignment& assignment) {
  std::vector<WeightedPoint> points;
  together(ranks_, [&] { points = assignment.sample(kSampleOfRank); });
  const auto n = static_cast<std::size_t>(ranks_.count);
  std::vector<double> density(n, 1), work(n, 0), weight(n, 0);
  if (known_density_) MPI_Allgather(&density_, 1, MPI_DOUBLE, density.data(), 1, MPI_DOUBLE, ranks_);
  std::vector<double> plain;
  for (WeightedPoint& p : points) {
    plain.push_back(p.weight);
    if (has_tree_) p.weight *= density[tree_.box_of(p.at)];
  }
  tree_ = cut_among_ranks(ranks_, points);
  // What the new boxes are expected to cost.
  for (std::size_t k = 0; k < points.size(); k++) {
    const std::uint32_t b = tree_.box_of(points[k].at);
    work[b] += points[k].weight, weight[b] += plain[k];
  }
  MPI_Allreduce(MPI_IN_PLACE, work.data(), ranks_.count, MPI_DOUBLE, MPI_SUM, ranks_);
  MPI_Allreduce(MPI_IN_PLACE, weight.data(), ranks_.count, MPI_DOUBLE, MPI_SUM, ranks_);
  density_ = weight[box()] > 0 ? work[box()] / weight[box()] : 1;
  has_tree_ = true, informed_ = known_density_;
  report_.cut = true;
}

double RankDetector::Work::imbalance(double work) const {
  double sum = 0, most = 0;
  MPI_Allreduce(&work, &sum, 1, MPI_DOUBLE, MPI_SUM, ranks_);
  MPI_Allreduce(&work, &most, 1, MPI_DOUBLE, MPI_MAX, ranks_);
  return sum > 0 ? most * ranks_.count / sum : 1;
}

double RankDetector::Work::expected_imbalance(const Assignment& assignment) const {
  std::vector<Count> to(static_cast<std::size_t>(ranks_.count));
  for (std::uint32_t b = 0; b < tree_.boxes(); b++) to[b] = assignment.spheres_of(b);
  Count mine = 0;
  MPI_Reduce_scatter_block(to.data(), &mine, 1, MPI_UNSIGNED_LONG_LONG, MPI_SUM, ranks_);
  return imbalance(density_ * static_cast<double>(mine));
}

void RankDetector::Work::finish(const BoxResult& found) {
  const double spheres = static_cast<double>(own_load().spheres()),
               work = spheres + static_cast<double>(found.contacts);
  density_ = spheres > 0 ? work / spheres : 1, known_density_ = true;
  report_.own_contacts = found.contacts, report_.own_spheres = own_load().spheres();
  Count sums[5] = {found.contacts, own_load().spheres(), found.hash, found.doubtful, found.splits};
  add_up(ranks_, sums);
  report_.contacts = sums[0], report_.copies = sums[1], report_.hash = sums[2];
  report_.doubtful = sums[3], report_.splits = sums[4];
  report_.imbalance = imbalance(work);
  if (report_.cut) settled_imbalance_ = informed_ ? report_.imbalance : 1;
}

// Deals this part out and brings what the other ranks have for this one. Every rank has a box.
Traffic RankDetector::Work::exchange(const LoadForm& form, const Assignment& assignment) {
  std::vector<LoadSizes> sizes;
  for (std::uint32_t b = 0; b < tree_.boxes(); b++)
    sizes.push_back({assignment.loose_of(b), assignment.bodies_of(b), assignment.body_spheres_of(b)});
  const Exchange among(ranks_, form, std::move(sizes));
  together(ranks_, [&] {
    loads_.resize(tree_.boxes());
    own_load().room = among.room();
    assignment.fill(tree_, 0, loads_);
  });
  return among.run(loads_);
}

const RankReport& RankDetector::Work::run(const Input& part, const ContactConsumer& consumer) {
  report_ = {};
  try {
    const double start = MPI_Wtime();
    Input settled;
    together(ranks_, [&] { settled = read(part); });
    const Numbering numbering = number(settled);
    std::optional<Assignment> assignment;
    together(ranks_, [&] { assignment.emplace(settled, threads(), numbering); });
    assignment->set_margin(options_.margin);
    const LoadForm form = agree(settled, *assignment);
    plan(*assignment);
    const double planned = MPI_Wtime();
    const Traffic traffic = exchange(form, *assignment);
    assignment.reset();
    const double exchanged = MPI_Wtime();
    BoxResult found;
    together(ranks_, [&] {
      CallOptions options = options_;
      options.threads = threads();
      Delivery delivery{consumer, {}};
      found = worker_->run(own_load(), box(), options, threads(), delivery);
    });
    finish(found);
    report_.sent_bytes = traffic.bytes, report_.messages = traffic.messages;
    report_.cut_seconds = planned - start, report_.exchange_seconds = exchanged - planned;
    report_.detect_seconds = MPI_Wtime() - exchanged;
  } catch (...) {
    bodies_.forget();
    report_ = {};
    throw;
  }
  return report_;
}

RankDetector::RankDetector(MPI_Comm ranks, const RankOptions& options)
    : work_(std::make_unique<Work>(ranks, options)) {}
RankDetector::~RankDetector() = default;
RankDetector::RankDetector(RankDetector&&) noexcept = default;
RankDetector& RankDetector::operator=(RankDetector&&) noexcept = default;
const RankReport& RankDetector::detect(const Input& part, const ContactConsumer& consumer) {
  return work_->run(part, consumer);
}
const RankReport& RankDetector::report() const { return work_->report(); }
Region RankDetector::region() const { return work_->region(); }
const char* RankDetector::backend() const { return work_->backend(); }
CallOptions& RankDetector::options() { return work_->options(); }

Part part_of(std::uint64_t n, int rank, int ranks) {
  const auto k = static_cast<std::uint64_t>(rank), all = static_cast<std::uint64_t>(ranks);
  const auto before = [&](std::uint64_t r) { return n / all * r + std::min(r, n % all); };
  return {before(k), before(k + 1)};
}

Input part_of(const Input& input, int rank, int ranks) {
  Input part = input;
  const Part bodies = part_of(input.bodies.size(), rank, ranks);
  const Part loose = part_of(input.spheres.count, rank, ranks);
  part.bodies = input.bodies.subspan(bodies.first, bodies.count());
  if (input.poses) part.poses += bodies.first;
  Spheres& s = part.spheres;
  s.count = loose.count();
  const auto skip = [&](const auto*& array) {
    if (array) array += loose.first;
  };
  const std::uint64_t bytes = s.scalar == Scalar::f32 ? 4 : 8;
  if (s.centers) s.centers = static_cast<const char*>(s.centers) + loose.first * s.center_stride * bytes;
  if (s.radii) s.radii = static_cast<const char*>(s.radii) + loose.first * s.radius_stride * bytes;
  skip(s.family), skip(s.mask), skip(s.is_static), skip(s.world);
  return part;
}

}  // namespace padder::detect
